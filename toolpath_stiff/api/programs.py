"""A program on a machine: stiffness along the path; the path alone; the paper's regions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.analysis.results import analyze as analyze_path
from toolpath_stiff.analysis.turning import FIXED
from toolpath_stiff.api.cutting import Cutting, Material, StockBox, Tolerance, cut_setup
from toolpath_stiff.api.inputs import Force, LoadDirection, Origin, Step, Turn, origin_si, pose_si
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.defaults import FORCE, LOAD
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.options import Option, checked
from toolpath_stiff.path.sampling import sample_moves
from toolpath_stiff.path.table import SampledPath
from toolpath_stiff.placement.case_study import MOST_REGIONS, CaseStudy, Region, run_case_study
from toolpath_stiff.results import Progress, counter
from toolpath_stiff.units import m_from_mm, m_from_um, n_per_m_from_n_per_mm

Jobs = Annotated[int | None, Option("--jobs", at_least=1)]
Table = Annotated[str, Option("--format", choices=("csv", "parquet"))]


@checked
def analyze(
    program: Program | str | Path,
    machine: Machine | str | Path = "nist",
    *,
    origin_mm_deg: Origin = None,
    load: LoadDirection = LOAD,
    step_mm: Step = 1.0,
    force_N: Force = FORCE,
    partial: Annotated[bool, Option("--partial")] = False,
    turn: Turn = FIXED,
    require_N_per_mm: Annotated[float | None, Option("--require", "N/mm", above=0, at_most=1e7)] = None,
    compare_with: Annotated[Machine | str | Path | None, Option("--compare", "MACHINE")] = None,
    cut: Cutting = None,
    material: Material = None,
    stock_mm: StockBox = None,
    tolerance_um: Tolerance = None,
    progress: Progress | None = None,
) -> Analysis:
    r"""Stiffness along the path of a program.

    Parameters
    ----------
    program, machine
        The program, and the machine that runs it; names and files are loaded.
    origin_mm_deg
        Where program zero (G54) sits in machine coordinates: X, Y, Z or X, Y, Z, A, B, C. Unless given, where the
        program's G10 says, else the machine's default.
    load
        Direction of the load: tangential, axial, normal, softest, radial, x, y, z or "DX,DY,DZ".
    step_mm
        Largest distance between two samples.
    force_N
        Size of the load: for deflections, and for effects that depend on it.
    partial
        Keep the reachable samples of a program that leaves the workspace (exit code 1).
    turn
        How a robot rotates the tool about its axis: fixed as programmed, by a number of degrees, with the feed, or
        best: the stiffest within the limits of the joints, constant unless a changing rotation is stiffer or needed.
    require_N_per_mm
        Required stiffness of every cutting move; those below are listed (exit code 3).
    compare_with
        Another machine to analyze the program on.
    cut
        Setup file of the cut (`tps cut new` writes one): stock, tools, coefficients. It gives engagement, cutting
        forces and the error of the surface.
    material, stock_mm
        Instead of a setup file: a packaged material (--material) and the box of the stock (--stock, X,Y,Z in mm, or
        "extents"), with the tools of the tool table.
    tolerance_um
        Allowed error of the surface; lines that exceed it are listed (exit code 3).
    progress
        Called with what is being done, samples done, samples in all.

    Raises
    ------
    InputError
        Something in a file or an argument is wrong or missing: where, what was found, what was expected.
    UnreachableError
        A sample of a cut is out of reach, and `partial` is not set.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> found = tps.analyze(slot, "nist", origin_mm_deg=(0, 0, 800))
    >>> found
    <Analysis: slot.nc on nist, mean 54 353 N/mm, min 53 875 N/mm>
    >>> found.to_frame()[["line", "x_mm", "stiffness_N_per_mm"]].tail(1).round(0).values.tolist()
    [[4.0, 40.0, 53875.0]]

    The error of the surface, with the stock, tool and coefficients of a setup file:

    >>> import pathlib, tempfile
    >>> wall = "G21 G90 T1 M6 S9000 M3\nG0 X-70 Y44 Z5\nZ-5\nG1 X70 F900\nM2"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = tps.cut_template().save(pathlib.Path(folder, "cut.toml"))
    ...     found = tps.analyze(tps.Program.from_text(wall), cut=file, tolerance_um=5)
    >>> [line for line, error_um in found.beyond_tolerance], found.to_dict()["cut"]["walls"]["mean_um"] > 0.0
    ([4], True)
    """
    first, part, origin = machine_from(machine), program_from(program), origin_si(origin_mm_deg)
    setup = cut_setup(cut, material, stock_mm)
    if tolerance_um is not None and setup is None:
        raise InputError("--tolerance without a cut", hint="say --cut FILE, or --material and --stock")
    second = first.like(compare_with) if isinstance(compare_with, str | Path) else compare_with

    asked: Document = {
        "origin": origin, "load": load, "step": m_from_mm(step_mm), "force": force_N, "partial": partial, "turn": turn,
    }  # fmt: skip

    def on(machine: Machine, other: Machine | None, progress: Callable[[int, int], None] | None) -> Analysis:
        model = machine.running(part, [other] if other else [])
        return analyze_path(model, part.moves(origin, model.machine.default_origin), progress=progress, **asked)

    analysis = on(first, second, counter(progress, f"{part.name}: samples"))
    cut_of = None
    if setup is not None:
        from toolpath_stiff.cutting.cut import evaluate_cut

        at, model = (analysis.program, analysis.origin, setup, analysis.step), analysis.model
        ways = model.machine.configurations
        if len(ways) > 1 and analysis.at.configuration in ways:
            model = replace(model, machine=model.machine.with_changes(only=ways.index(analysis.at.configuration)))
        cut_of = evaluate_cut(model, *at, progress, analysis.samples)
    return replace(
        analysis,
        cut=cut_of,
        tolerance=None if tolerance_um is None else m_from_um(tolerance_um),
        on_other=None if second is None else on(second, first, None),
        required=None if require_N_per_mm is None else n_per_m_from_n_per_mm(require_N_per_mm),
        inputs=(*part.inputs, *first.inputs, *(second.inputs if second else ()), *(setup.inputs if setup else ())),
    )


@checked
def sample_path(program: Program | str | Path, *, origin_mm_deg: Origin = None, step_mm: Step = 1.0) -> SampledPath:
    r"""The tool's path, sampled along its true shape.

    Parameters
    ----------
    program
        A program, or its file.
    origin_mm_deg
        Where program zero sits; unless given, where the program's G10 says, else 0.
    step_mm
        Largest distance between two samples; every move has samples at both ends.

    Raises
    ------
    InputError
        The program cannot be read.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> tps.sample_path(slot, step_mm=10).to_frame()[["motion", "x_mm", "z_mm"]].tail(2).values.tolist()
    [['feed', 30.0, 0.0], ['feed', 40.0, 0.0]]
    """
    origin = origin_si(origin_mm_deg)
    read = program_from(program).moves(origin)
    origin = origin or read.origin
    samples = sample_moves(read.moves, step=m_from_mm(step_mm), origin=origin)
    left = [f"{read.name}:{word.line}:{word.column}: {word.word}: {word.reason}" for word in read.unsupported]
    return SampledPath(read.name, samples, list(map(str, read.warnings)), left)


@checked
def case_study(
    program: Program | str | Path | None = None,
    machine: Machine | str | Path = "nist",
    regions: Mapping[str, Sequence[float]] | None = None,
    *,
    step_mm: Step = 1.0,
) -> CaseStudy:
    r"""One tool path in several regions, at several heights, displaced and turned, as the paper's Figure 10.

    Parameters
    ----------
    program
        The program; unless given, the packaged contour of a 200 mm square.
    machine
        A machine, its name or its file.
    regions
        Name -> x, y, z of program zero in mm and, if turned, the angle in degrees. Unless given, four of the reference
        machine.
    step_mm
        Distance of the samples.

    Raises
    ------
    InputError
        A region or the program cannot be read.
    UnreachableError
        The machine cannot reach a region.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.case_study(machine="nist")
    <CaseStudy: nist, 3 of 3 conclusions of the paper hold>
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> tps.case_study(slot, "nist", {"left": (-200, 0, 800), "right": (200, 0, 800, 90)}, step_mm=10)
    <CaseStudy: slot.nc on nist, 1 of 1 conclusion of the paper holds>
    """
    on = machine_from(machine)
    part = None if program is None else program_from(program)
    model = on.running(part)
    read = None if part is None else lambda origin: part.moves(origin, model.machine.default_origin)
    inputs = (*(part.inputs if part else ()), *on.inputs)
    return run_case_study(model, m_from_mm(step_mm), read, None if regions is None else _regions(regions), inputs)


def _regions(named: Mapping[str, Sequence[float]]) -> dict[str, Region]:
    """Regions by name, from mm and degrees, checked."""
    if not 0 < len(named) <= MOST_REGIONS:
        raise InputError(f"{len(named)} regions", expected=f"1 to {MOST_REGIONS}")
    regions = {}
    for name, numbers in named.items():
        if len(numbers) not in (3, 4):
            raise InputError(f"region {name} of {len(numbers)} numbers", expected="x, y, z in mm, and the turn")
        x, y, z, turn = [*map(float, numbers), 0.0][:4]
        pose_si(f"region {name}", (x, y, z, 0.0, 0.0, turn))
        regions[str(name)] = (x, y, z, turn)
    return regions
