"""Compensation of a program for deflection by cutting forces, and measured walls compared with the predicted error."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from toolpath_stiff.api import inputs
from toolpath_stiff.api.cutting import Cutting, Material, StockBox, cut_setup
from toolpath_stiff.api.inputs import origin_si, read_at
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.comparison.walls import WallComparison, read_walls
from toolpath_stiff.comparison.walls import compare_walls as compare_points
from toolpath_stiff.cutting.compensation import Compensation, compensate_program
from toolpath_stiff.cutting.cut import Cut, evaluate_cut
from toolpath_stiff.cutting.setup import CutSetup
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.nc.reader import read
from toolpath_stiff.options import Option, checked
from toolpath_stiff.results import Progress, teller
from toolpath_stiff.units import m_from_mm


@checked
def compensate(
    program: Program | str | Path,
    machine: Machine | str | Path = "nist",
    *,
    cut: Cutting = None,
    material: Material = None,
    stock_mm: StockBox = None,
    origin_mm_deg: inputs.Origin = None,
    step_mm: inputs.Step = 1.0,
    decimals: inputs.Decimals = None,
    progress: Progress | None = None,
) -> Compensation:
    r"""A program whose path is shifted against the deflection of its final walls.

    Parameters
    ----------
    program, machine
        The program, and the machine that runs it.
    cut, material, stock_mm
        The cut, as in `analyze`.
    origin_mm_deg
        Where program zero (G54) sits, as in `analyze`.
    step_mm
        Largest distance between two samples.
    decimals
        Decimals of the numbers written; unless given, 4 in mm, 5 in inch.
    progress
        Called with what is being done.

    Raises
    ------
    InputError
        Nothing is known of the cut, no pass makes a final wall, or a block cannot be written otherwise: where and why.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> text = "G21 G90\nT1 M6\nS8000 M3\nG0 X-20 Y-15 Z5\nG1 Z-4 F300\nY-4.5\nX120 F900\nY-15\nG0 Z5\nM2\n"
    >>> tool = "[[tool]]\nnumber = 1\ndiameter_mm = 10\nflutes = 3\nhelix_deg = 30\nstick_out_mm = 30\n"
    >>> stock = "[stock]\nbox_mm = [100, 40, 20]\ncorner_mm = [0, 0, -20]\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cut = pathlib.Path(folder, "cut.toml")
    ...     _ = cut.write_text(f"{stock}[coefficients]\nmaterial = 'Al7075'\n{tool}")
    ...     wall = tps.compensate(tps.Program.from_text(text, name="wall.nc"), cut=cut)
    ...     written = wall.save(pathlib.Path(folder, "wall_comp.nc")).name
    >>> wall.changed, written, wall.rewritten.text.splitlines()[5][:5]
    (True, 'wall_comp.nc', 'Y-4.4')
    >>> wall.walls["mean_before_um"] > 1.0, wall.walls["left_percent"] < 5.0
    (True, True)
    """
    on, part, origin = machine_from(machine), program_from(program), origin_si(origin_mm_deg)
    model, setup = on.running(part), _known(cut_setup(cut, material, stock_mm))
    default = model.machine.default_origin
    first, place = read_at(part, origin, default)
    tell = teller(progress)

    def evaluate(program: ReadProgram) -> Cut:
        tell(f"{part.name}: cutting")
        return evaluate_cut(model, program, place, setup, m_from_mm(step_mm))

    def reread(text: str) -> ReadProgram:
        return read(replace(part.placed(origin, default), lines=split_lines(text, part.name), path=""))

    return compensate_program(first, place, evaluate, reread, decimals=decimals, control=part.request.controller)


@checked
def compare_walls(
    data: str | Path,
    machine: Machine | str | Path = "nist",
    *,
    program: Annotated[Program | str | Path | None, Option("--program", "PROGRAM")] = None,
    cut: Cutting = None,
    material: Material = None,
    stock_mm: StockBox = None,
    columns: Mapped = None,
    origin_mm_deg: inputs.Origin = None,
    step_mm: inputs.Step = 1.0,
    progress: Progress | None = None,
) -> WallComparison:
    r"""Measured walls of a part against the surface error that its cut predicts: where the model fails.

    Parameters
    ----------
    data
        Points of a coordinate measuring machine: x_mm,y_mm,z_mm in program coordinates, nx,ny,nz out of the part, and
        deviation_um along that, + material left, unless the points themselves have it.
    machine
        The machine that cut the part.
    program
        The program that cut the part.
    cut, material, stock_mm
        The cut, as in `analyze`.
    columns
        Columns that the file names differently: "deviation=dev:mm", or such a dict.
    origin_mm_deg
        Where program zero sat.
    step_mm
        Largest distance between two samples.
    progress
        Called with what is being done.

    Raises
    ------
    InputError
        The file cannot be read, no cut is given, or no point lies on a final wall.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> text = "G21 G90\nT1 M6\nS8000 M3\nG0 X-20 Y-15 Z5\nG1 Z-4 F300\nY-4.5\nX120 F900\nY-15\nG0 Z5\nM2\n"
    >>> tool = "[[tool]]\nnumber = 1\ndiameter_mm = 10\nflutes = 3\nhelix_deg = 30\nstick_out_mm = 30\n"
    >>> stock = "[stock]\nbox_mm = [100, 40, 20]\ncorner_mm = [0, 0, -20]\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cut = pathlib.Path(folder, "cut.toml")
    ...     _ = cut.write_text(f"{stock}[coefficients]\nmaterial = 'Al7075'\n{tool}")
    ...     points = pathlib.Path(folder, "points.csv")
    ...     _ = points.write_text("x_mm,y_mm,z_mm,nx,ny,nz,deviation_um\n40,0.5,-2,0,-1,0,9\n60,0.5,-2,0,-1,0,9\n")
    ...     compared = tps.compare_walls(points, program=tps.Program.from_text(text, name="wall.nc"), cut=cut)
    >>> len(compared.line), compared.factor[0] > 0.5, [row["points"] for row in compared.lines]
    (2, True, [2])
    """
    if program is None:
        raise InputError("walls without the program that cut them", hint="say --program FILE")
    on, part, origin = machine_from(machine), program_from(program), origin_si(origin_mm_deg)
    model, setup = on.running(part), _known(cut_setup(cut, material, stock_mm))
    points, normal, deviation, notes = read_walls(str(data), columns)
    first, place = read_at(part, origin, model.machine.default_origin)
    predicted = evaluate_cut(model, first, place, setup, m_from_mm(step_mm), progress)
    notes = (*notes, *predicted.assumptions, *predicted.warnings)
    compared = compare_points(predicted, first.moves, points, normal, deviation, notes)
    return replace(compared, inputs=(str(data), *part.inputs, *on.inputs, *setup.inputs))


def _known(setup: CutSetup | None) -> CutSetup:
    if setup is None:
        raise InputError("no cut is given", hint="say --cut FILE, or --material and --stock")
    return setup
