"""Where the work should sit: the search, any placement tried, the program written for a placement."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from toolpath_stiff.api.inputs import FARTHEST_MM, Force, Linearised, LoadDirection, Origin, Step, origin_si, pose_si
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.defaults import FORCE, LOAD, OBJECTIVES
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.options import Option, checked, low_high, numbers
from toolpath_stiff.results import Progress, counter
from toolpath_stiff.units import m_from_mm, mm_from_m, rad_from_deg

if TYPE_CHECKING:
    from toolpath_stiff.analysis.loads import Load
    from toolpath_stiff.machine.model import Machine as MachineModel
    from toolpath_stiff.nc.moves import ReadProgram
    from toolpath_stiff.placement.climb import Bounds
    from toolpath_stiff.placement.paths import WorkPath
    from toolpath_stiff.placement.result import Placement
    from toolpath_stiff.placement.search import SearchRules
    from toolpath_stiff.placement.task import Rewriting
    from toolpath_stiff.rewriting.program import RewrittenProgram
    from toolpath_stiff.stiffness.model import StiffnessModel

FARTHEST_TURN_DEG = 720.0
MOST_FRONT_POINTS = 1000
Range = tuple[float, float] | float


@dataclass(frozen=True)
class KeepOut:
    """A box that the tool tip stays out of, rapids included: its name, two corners in machine coordinates, mm.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.KeepOut("vice", (-100, -50, 600), (100, 50, 700)).high_mm
    (100, 50, 700)
    """

    name: str
    low_mm: tuple[float, float, float]
    high_mm: tuple[float, float, float]


@checked
def place(
    program: Program | str | Path,
    machine: Machine | str | Path = "nist",
    *,
    x_mm: Annotated[Range | None, Option("--x", "LO:HI", read=low_high)] = None,
    y_mm: Annotated[Range | None, Option("--y", "LO:HI", read=low_high)] = None,
    z_mm: Annotated[Range | None, Option("--z", "LO:HI", read=low_high)] = None,
    z_values_mm: Annotated[Sequence[float], Option("--z-values", "Z,Z,...", read=numbers, instead_of="z_mm")] = (),
    rotate_deg: Annotated[Range, Option("--rotate", "LO:HI", read=low_high)] = (0.0, 360.0),
    tilt_a_deg: Annotated[Range, Option("--tilt-a", "LO:HI", read=low_high)] = 0.0,
    tilt_b_deg: Annotated[Range, Option("--tilt-b", "LO:HI", read=low_high)] = 0.0,
    keep_out: Annotated[
        Iterable[KeepOut], Option("--keep-out", "NAME:X0,Y0,Z0,X1,Y1,Z1", read=_keep_out, count="append")
    ] = (),
    margin_percent: Annotated[float, Option("--margin", "%", at_least=0, below=50)] = 1.0,
    allow_extrapolation: Annotated[bool, Option("--allow-extrapolation")] = False,
    objective: Annotated[str, Option("--objective", choices=tuple(OBJECTIVES))] = "balanced",
    points: Annotated[int, Option("--points", at_least=2, at_most=MOST_FRONT_POINTS)] = 60,
    seed: Annotated[int, Option("--seed", at_least=0)] = 1,
    pick: Annotated[int | None, Option("--pick")] = None,
    earlier: Placement | str | Path | Mapping[str, Any] | None = None,
    origin_mm_deg: Origin = None,
    load: LoadDirection = LOAD,
    step_mm: Step = 1.0,
    force_N: Force = FORCE,
    write: Annotated[str | Path | None, Option("--write", "FILE")] = None,
    decimals: Annotated[int | None, Option("--decimals")] = None,
    linearise_mm: Linearised = None,
    progress: Progress | None = None,
) -> Placement:
    r"""Search where the work should sit, or take another point of an earlier search.

    Parameters
    ----------
    program, machine
        What it runs on, what runs.
    x_mm, y_mm, z_mm
        Of program zero, mm: low and high, or a number to fix it; unless given, as far as the machine reaches.
    z_values_mm
        The only heights that there are, mm.
    rotate_deg, tilt_a_deg, tilt_b_deg
        Turn and tilts of the set-up, degrees: low and high, or a number to fix it.
    keep_out
        Boxes that the tool tip stays out of, rapids included, machine coordinates, mm.
    margin_percent
        Share of each limit's span that cuts and rapids keep from it.
    allow_extrapolation
        Let struts leave the lengths of their law at more samples than now.
    objective
        Balanced is mean - range; whatever it is, none of mean, range and weakest gets worse where that can be avoided.
    points
        Most points of the front.
    seed
        Of the search.
    pick
        Take this point (its number in placements.csv) of the front of an earlier search, without searching again.
        Everything else has to be as it was.
    earlier
        That search as its result, its document or the file `placement.json`.
    origin_mm_deg
        The present placement; unless given, as `analyze` takes it.
    load, step_mm, force_N
        As of `analyze`.
    write
        The program itself, transformed so that, run at the present origin, it cuts at the placement: name of its file.
    decimals
        Of its numbers; unless given, 4 in mm and degrees, 5 in inch.
    linearise_mm
        Write arcs that the turn takes out of the planes as straight moves within so much; unless given, refuse them.
    progress
        Called with what is being done, how much of it is done, how much there is.

    Raises
    ------
    InputError
        The program cannot be placed, or not be written there.
    UnreachableError
        No placement keeps the limits.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> found = tps.place(slot, "nist", x_mm=(-50, 50), y_mm=0, z_mm=(700, 800), rotate_deg=0, step_mm=10)
    >>> found.worse
    []
    """
    from toolpath_stiff.analysis.loads import parse_load
    from toolpath_stiff.placement.placing import place_again, place_program
    from toolpath_stiff.placement.task import Task

    on, part = machine_from(machine), program_from(program)
    if write is None and (decimals is not None or linearise_mm is not None):
        option = "decimals" if decimals is not None else "linearise"
        raise InputError(f"--{option} without --write", hint="say with --write FILE where the program goes")
    rules = _rules(objective, margin_percent, allow_extrapolation, keep_out, seed, points)
    model = on.running(part)
    default = model.machine.default_origin
    asked = origin_si(origin_mm_deg)
    read = part.moves(asked, default)
    task = Task(
        model=model,
        program=read,
        present=asked or (read.origin if read.origin_source == "program" else default),
        read=lambda origin: part.moves(origin, default),
        bounds=_bounds(model.machine, (x_mm, y_mm, z_mm), z_values_mm, (tilt_a_deg, tilt_b_deg, rotate_deg)),
        rules=rules,
        load=parse_load(load),
        step=m_from_mm(step_mm),
        force=force_N,
        rewriting=None if write is None else _rewriting(part, str(write), decimals, linearise_mm),
    )
    if pick is None:
        placed = place_program(task, counter(progress, f"{part.name}: search"))
    else:
        placed = place_again(task, _earlier(earlier), pick)
    return replace(placed, inputs=(*part.inputs, *on.inputs))


def _rules(
    objective: str,
    margin_percent: float,
    allow_extrapolation: bool,
    keep_out: Iterable[KeepOut],
    seed: int,
    points: int,
) -> SearchRules:
    """What a placement must keep and be good at, in SI."""
    from toolpath_stiff.placement.evaluator import Keepout
    from toolpath_stiff.placement.search import SearchRules

    return SearchRules(
        objective=objective,
        margin=margin_percent / 100.0,
        allow_extrapolation=allow_extrapolation,
        keepouts=tuple(
            Keepout(box.name, _corner(box.low_mm), _corner(box.high_mm)) for box in map(_checked_box, keep_out)
        ),
        seed=seed,
        points=points,
    )


def _keep_out(text: str) -> KeepOut:
    """`NAME:X0,Y0,Z0,X1,Y1,Z1`."""
    name, _, corners = text.rpartition(":")
    values = numbers(corners)
    if not name or len(values) != 6:
        raise ValueError("NAME:X0,Y0,Z0,X1,Y1,Z1")
    return _checked_box(KeepOut(name, values[:3], values[3:]))


def _corner(corner_mm: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (m_from_mm(float(v)) for v in corner_mm)
    return x, y, z


def _checked_box(box: KeepOut) -> KeepOut:
    for low, high, axis in zip(box.low_mm, box.high_mm, "XYZ", strict=True):
        if low >= high:
            raise InputError(f"keep-out {box.name}: {axis}1 = {high:g} is not above {axis}0 = {low:g}")
    return box


def _rewriting(part: Program, file: str, decimals: int | None, linearise_mm: float | None) -> Rewriting:
    from toolpath_stiff.placement.task import Rewriting

    chord = None
    if linearise_mm is not None:
        chord = m_from_mm(linearise_mm)
    return Rewriting(file, decimals, chord, part.read_as)


def _earlier(earlier: Placement | str | Path | Mapping[str, Any] | None) -> dict[str, Any]:
    """The document of an earlier search."""
    from toolpath_stiff.files import read_text
    from toolpath_stiff.placement.result import Placement

    if isinstance(earlier, Placement):
        return earlier.to_dict()
    if isinstance(earlier, Mapping):
        return dict(earlier)
    if earlier is None:
        raise InputError("--pick without an earlier search", hint="search first, without --pick")
    file = Path(earlier)
    if not file.exists():
        raise InputError(
            f"--pick: there is no earlier search in {file.parent} (no {file.name})",
            hint=f"search first, without --pick, or name the search's folder with {both_names('--out')}",
        )
    try:
        found = json.loads(read_text(file, "the earlier search"))
    except ValueError as error:
        raise InputError(f"--pick: {file} is no JSON: {error}", hint="search again, without --pick") from None
    if not isinstance(found, dict):
        raise InputError(f"--pick: {file} is no result of a search", hint="search again, without --pick")
    return found


def _bounds(
    machine: MachineModel, box: Sequence[Range | None], heights_mm: Sequence[float], turns: Sequence[Range]
) -> Bounds:
    """What may vary, in SI; where nothing is said, the machine's workspace."""
    import numpy as np

    from toolpath_stiff.placement.climb import Bounds

    heights = sorted(set(map(float, heights_mm)))
    asked = [None if one is None else _pair(one) for one in box]
    if heights:
        asked[2] = (heights[0], heights[-1])
    low, high = (mm_from_m(corner) for corner in machine.limits.workspace)
    sides = []
    for name, side, lo, hi in zip("xyz", asked, low, high, strict=True):
        if side is None and not np.isfinite(hi - lo):
            raise InputError(f"the machine file bounds no workspace in {name}", hint=f"give --{name} LO:HI")
        sides.append(side if side is not None else (float(lo), float(hi)))
    if not max(abs(v) for side in sides for v in side) <= FARTHEST_MM:
        raise InputError("bounds beyond 100 m", expected="mm")
    angles = [_pair(turn) for turn in turns]
    if not max(abs(v) for pair in angles for v in pair) <= FARTHEST_TURN_DEG:
        raise InputError(f"a turn or tilt beyond {FARTHEST_TURN_DEG:g} degrees", expected="at most two whole turns")
    ends = [[*(m_from_mm(s[end]) for s in sides), *(rad_from_deg(t[end]) for t in angles)] for end in (0, 1)]
    return Bounds(np.array(ends[0]), np.array(ends[1]), tuple(m_from_mm(z) for z in heights))


def _pair(given: Range) -> tuple[float, float]:
    low, high = (given, given) if isinstance(given, int | float) else given
    if low > high:
        raise InputError(f"bounds {low:g} to {high:g}", expected="the lower bound first")
    return float(low), float(high)


class PlacementTrial:
    r"""A program that can be put anywhere, with the figures of every place at once; `try_placement` makes one.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> trial = tps.try_placement(slot, "nist", step_mm=10)
    >>> trial.samples, list(trial.at((0, 0, 800)))
    (7, ['mean_N_per_mm', 'range_N_per_mm', 'min_N_per_mm', 'margin', 'rapid_margin'])
    >>> trial.at((0, 0, 5000))["mean_N_per_mm"] is None  # out of reach
    True
    """

    def __init__(self, model: StiffnessModel, program: ReadProgram, path: WorkPath, load: Load, force: float) -> None:
        from toolpath_stiff.placement.evaluator import Evaluator

        self._evaluator = Evaluator(model, path, load, force)
        self.program, self.samples = program, len(path)

    def at(self, origin_mm_deg: Sequence[float]) -> dict[str, float | None]:
        """Mean, range and weakest in N/mm, margins as shares of a limit's span; None where a cut is out of reach."""
        import numpy as np

        from toolpath_stiff.units import n_per_mm_from_n_per_m

        found = self._evaluator.figures(np.array([pose_si("origin", origin_mm_deg)]))
        names = {"mean_N_per_mm": found.mean, "range_N_per_mm": found.spread, "min_N_per_mm": found.lowest}
        stiffnesses = {name: float(n_per_mm_from_n_per_m(values[0])) for name, values in names.items()}
        margins = {"margin": float(found.margin[0]), "rapid_margin": float(found.rapid_margin[0])}
        return {name: value if np.isfinite(value) else None for name, value in {**stiffnesses, **margins}.items()}


@checked
def try_placement(
    program: Program | str | Path,
    machine: Machine | str | Path = "nist",
    *,
    load: LoadDirection = LOAD,
    step_mm: Step = 1.0,
    force_N: Force = FORCE,
) -> PlacementTrial:
    r"""What a program does wherever it is put: read and sampled once, then the figures of any placement at once.

    The figures are those of `place` and of `analyze` with the same step. Arguments and errors as of `analyze`.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> round(tps.try_placement(slot, "nist").at((0, 0, 800))["mean_N_per_mm"])
    54353
    """
    from toolpath_stiff.analysis.loads import parse_load
    from toolpath_stiff.placement.paths import work_path

    on, part = machine_from(machine), program_from(program)
    model, asked = on.running(part), parse_load(load)
    default = model.machine.default_origin
    read = part.moves(None, default)
    present = read.origin if read.origin_source == "program" else default
    step = m_from_mm(step_mm)
    path = work_path(read, step, asked, present, lambda origin: part.moves(origin, default))
    return PlacementTrial(model, read, path, asked, force_N)


def rewrite(
    program: Program | str | Path,
    *,
    to_mm_deg: Sequence[float],
    from_mm_deg: Sequence[float] = (0.0, 0.0, 0.0),
    decimals: int | None = None,
    linearise_mm: Linearised = None,
) -> RewrittenProgram:
    r"""Write a program so that, run where its zero sits now, it does what it would do untouched at another placement.

    Parameters
    ----------
    program
        A program, or its file.
    to_mm_deg, from_mm_deg
        Where program zero is to sit in effect, and where it sits: X, Y, Z or X, Y, Z, A, B, C.
    decimals
        Of the numbers written; unless given, 4 in mm and degrees, 5 in inch.
    linearise_mm
        Write arcs that the turn takes out of the planes as straight moves within this; unless given they are refused.

    Raises
    ------
    InputError
        A block cannot be expressed there, with its line and the reason.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> print(tps.rewrite(slot, to_mm_deg=(10, 0, 0)), end="")
    G21 G90
    G0 X10 Y0 Z5
    G1 Z0 F300
    G1 X50
    M2
    """
    from toolpath_stiff.rewriting.program import rewrite_program

    part = program_from(program)
    new, old = pose_si("placement", to_mm_deg), pose_si("present placement", from_mm_deg)
    chord = None if linearise_mm is None else m_from_mm(linearise_mm)
    return rewrite_program(part.moves(new), new, old, decimals=decimals, linearise=chord, **part.read_as)
