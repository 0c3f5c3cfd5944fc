"""Placements of the work: the search, a trial of any placement, the program rewritten for a placement."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.analysis.turning import BEST, FEED, FIXED, check_free_turn
from toolpath_stiff.api import inputs
from toolpath_stiff.api.cutting import Cutting, Material, StockBox, cut_setup
from toolpath_stiff.api.inputs import origin_si, pose_si, read_at
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.cutting.cut import evaluate_cut
from toolpath_stiff.defaults import FORCE, LOAD, OBJECTIVES
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.limits import working_box
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.options import Option, checked, low_high, numbers
from toolpath_stiff.placement.evaluator import Evaluator
from toolpath_stiff.placement.goals import Bounds, SearchRules
from toolpath_stiff.placement.keep_out import KeepOut
from toolpath_stiff.placement.paths import work_path
from toolpath_stiff.placement.placing import place_program
from toolpath_stiff.placement.result import Placement, PlacementTask
from toolpath_stiff.placement.surface_error import errors_of_walls
from toolpath_stiff.results import Progress, counter
from toolpath_stiff.rewriting.program import RewrittenProgram, rewrite_program
from toolpath_stiff.units import m_from_mm, mm_from_m, n_per_mm_from_n_per_m, rad_from_deg

MOST_FRONT_POINTS = 1000
ERROR = "error"  # the objective that requires a cut
Range = tuple[float, float] | float


@checked
def place(
    program: Program | str | Path,
    machine: Machine | str | Path = "nist",
    *,
    x_mm: Annotated[Range | None, Option("--x", "LO:HI", read=low_high)] = None,
    y_mm: Annotated[Range | None, Option("--y", "LO:HI", read=low_high)] = None,
    z_mm: Annotated[Range | None, Option("--z", "LO:HI", read=low_high)] = None,
    z_values_mm: Annotated[Sequence[float], Option("--z-values", "Z,Z,...", read=numbers, instead_of="z_mm")] = (),
    base_mm: Annotated[Sequence[float], Option("--base", "X,Y,Z", read=numbers)] = (0.0, 0.0, 0.0),
    rotate_deg: Annotated[Range, Option("--rotate", "LO:HI", at_least=-720, at_most=720, read=low_high)] = (0.0, 360.0),
    tilt_a_deg: Annotated[Range, Option("--tilt-a", "LO:HI", at_least=-180, at_most=180, read=low_high)] = 0.0,
    tilt_b_deg: Annotated[Range, Option("--tilt-b", "LO:HI", at_least=-180, at_most=180, read=low_high)] = 0.0,
    turn: inputs.Turn = FIXED,
    keep_out: Annotated[
        Iterable[KeepOut], Option("--keep-out", "NAME:X0,Y0,Z0,X1,Y1,Z1", read=_keep_out, count="append")
    ] = (),
    margin_percent: Annotated[float, Option("--margin", "%", at_least=0, below=50)] = 1.0,
    allow_extrapolation: Annotated[bool, Option("--allow-extrapolation")] = False,
    objective: Annotated[str, Option("--objective", choices=(*OBJECTIVES, ERROR))] = "balanced",
    points: Annotated[int, Option("--points", at_least=2, at_most=MOST_FRONT_POINTS)] = 60,
    seed: Annotated[int, Option("--seed", at_least=0)] = 1,
    origin_mm_deg: inputs.Origin = None,
    load: inputs.LoadDirection = LOAD,
    step_mm: inputs.Step = 1.0,
    force_N: inputs.Force = FORCE,
    cut: Cutting = None,
    material: Material = None,
    stock_mm: StockBox = None,
    write: Annotated[str | Path | None, Option("--write", "FILE")] = None,
    decimals: inputs.Decimals = None,
    linearise_mm: inputs.Linearised = None,
    progress: Progress | None = None,
) -> Placement:
    r"""Search where the work should sit.

    Parameters
    ----------
    program, machine
        The program, and the machine that runs it.
    x_mm, y_mm, z_mm
        Position of program zero, mm: low and high, or a number to fix it; unless given, as far as the machine reaches.
    z_values_mm
        Heights to choose from, mm, instead of a range.
    base_mm
        Position of the work's table relative to the machine's base; bounds and heights are measured from there.
    rotate_deg, tilt_a_deg, tilt_b_deg
        Rotation of the set-up about Z and tilts about X and Y, degrees: low and high, or a number to fix it.
    turn
        How a robot rotates the tool about its axis: fixed as programmed, by a number of degrees, or best, a constant
        rotation that the search chooses with the placement.
    keep_out
        Boxes that the tool tip stays out of, rapids included, machine coordinates, mm.
    margin_percent
        Distance that cuts and rapids keep from each limit, as a share of its span.
    allow_extrapolation
        Allow struts to leave the length range of their law at more samples than now.
    objective
        What to optimise: balanced is mean - range, error (with `cut`) the error that 95 % of the final walls stay
        below. In any case mean, range and weakest place get no worse where that can be avoided.
    points
        Maximum number of points on the front.
    seed
        Random seed of the search.
    origin_mm_deg
        The present placement, X, Y, Z or X, Y, Z, A, B, C of program zero; unless given, where the program's G10 says,
        else the machine's default.
    load
        Direction of the load: tangential, axial, normal, softest, radial, x, y, z or "DX,DY,DZ".
    step_mm
        Largest distance between two samples.
    force_N
        Size of the load: for deflections, and for effects that depend on it.
    cut, material, stock_mm
        The cut, as in `analyze`, for the objective error.
    write
        File for the transformed program, which cuts at the placement when it is run at the present origin.
    decimals
        Decimals of the numbers written; unless given, 4 in mm and degrees, 5 in inch.
    linearise_mm
        Write arcs that the rotation takes out of the planes as straight moves within this tolerance; unless given,
        refuse them.
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
    on, part = machine_from(machine), program_from(program)
    model, origin, turns = on.running(part), origin_si(origin_mm_deg), (tilt_a_deg, tilt_b_deg, rotate_deg)
    default, setup = model.machine.default_origin, cut_setup(cut, material, stock_mm)
    _check_together(write is None, decimals is None and linearise_mm is None, objective, setup is None, turn)
    (read, present), step = read_at(part, origin, default), m_from_mm(step_mm)
    now = None if setup is None else evaluate_cut(model, read, present, setup, step, progress)
    task = PlacementTask(
        model=model,
        program=read,
        present=present,
        read=lambda other: part.moves(other, default),
        bounds=_bounds(model.machine, *_from_base(base_mm, (x_mm, y_mm, z_mm), z_values_mm), turns, turn),
        rules=SearchRules(objective, margin_percent / 100.0, allow_extrapolation, tuple(keep_out), seed, points),
        load=parse_load(load),
        step=step,
        force=force_N,
        write="" if write is None else str(write),
        decimals=decimals,
        linearise=None if linearise_mm is None else m_from_mm(linearise_mm),
        control=part.request.controller,
        errors=None if now is None else errors_of_walls(model, now, present, read.name),
    )
    placed = place_program(task, counter(progress, f"{part.name}: search"))
    return replace(placed, inputs=(*part.inputs, *on.inputs))


def _check_together(unwritten: bool, as_written: bool, objective: str, uncut: bool, turn: str | float) -> None:
    """Raise `InputError` for options that require or exclude each other."""
    if unwritten and not as_written:
        raise InputError("--decimals or --linearise without --write", hint="say with --write FILE where it goes")
    if (objective == ERROR) == uncut:
        raise InputError("--objective error and a cut need each other", hint="say --cut, or --material and --stock")
    if turn != FIXED and not (uncut and unwritten):
        hint = "leave --turn out, or --write and --objective error"
        raise InputError("--turn with --write or --objective error: neither turns the tool", hint=hint)


def _keep_out(text: str) -> KeepOut:
    """The box of `NAME:X0,Y0,Z0,X1,Y1,Z1`."""
    name, _, corners = text.rpartition(":")
    values = numbers(corners) if name else ()
    if len(values) != 6:
        raise ValueError("NAME:X0,Y0,Z0,X1,Y1,Z1")
    return KeepOut(name, values[:3], values[3:])


def _bounds(
    machine: MachineTool,
    box: Sequence[Range | None],
    heights_mm: Sequence[float],
    turns: Sequence[Range],
    tool: str | float,
) -> Bounds:
    """Bounds of the search, in SI; where not given, the machine's workspace."""
    heights = sorted(set(map(float, heights_mm)))
    sides = [*box[:2], (heights[0], heights[-1]) if heights else box[2]]
    workspace = mm_from_m(working_box(machine)).T.tolist()
    for axis, side, reach in zip("xyz", sides, workspace, strict=True):
        if side is None and not np.isfinite(reach).all():
            raise InputError(f"the machine file has no workspace limits in {axis}", hint=f"give --{axis} LO:HI")
    lengths = np.array([_pair(reach if side is None else side) for side, reach in zip(sides, workspace, strict=True)])
    angles = np.array([_pair(turn) for turn in (*turns, *_turn_of_tool(machine, tool))])
    if not np.abs(lengths).max() <= inputs.FARTHEST_MM:
        raise InputError("bounds beyond reason", expected="within 100 m")
    low, high = np.concatenate([m_from_mm(lengths), rad_from_deg(angles)]).T
    return Bounds(low, high, tuple(m_from_mm(z) for z in heights))


def _turn_of_tool(machine: MachineTool, turn: str | float) -> list[Range]:
    """Bounds of a constant turn of the tool about its axis, one or, if as programmed, none. Raises `InputError`."""
    if turn == FIXED:
        return []
    check_free_turn(machine, turn)
    if turn == FEED:
        raise InputError(f"--turn {turn}", expected=f"{FIXED}, {BEST}, or degrees: one turn for the whole path")
    return [(0.0, 360.0) if turn == BEST else inputs.finite("--turn", float(turn))]


def _from_base(
    base_mm: Sequence[float], box: Sequence[Range | None], heights_mm: Sequence[float]
) -> tuple[Sequence[Range | None], list[float]]:
    """Bounds and heights that are given, counted from the machine's base. Raises `InputError`."""
    base = [inputs.finite("--base", value) for value in base_mm]
    if len(base) != 3:
        raise InputError(f"--base of {len(base)} numbers", expected="X,Y,Z in mm")
    sides = zip(box, base, strict=True)
    moved = [side if side is None else tuple(np.add(_pair(side), offset).tolist()) for side, offset in sides]
    return moved, [z + base[2] for z in heights_mm]


def _pair(given: Range) -> tuple[float, float]:
    low, high = (given, given) if isinstance(given, int | float) else given
    if low > high:
        raise InputError(f"bounds {low:g} to {high:g}", expected="the lower bound first")
    return float(low), float(high)


class PlacementTrial:
    r"""A program ready for trial at any placement, with figures in no time; made by `try_placement`.

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

    def __init__(self, program: ReadProgram, evaluator: Evaluator) -> None:
        self._evaluator = evaluator
        self.program, self.samples = program, len(evaluator.path)

    def at(self, origin_mm_deg: Sequence[float]) -> dict[str, float | None]:
        """Mean, range and weakest in N/mm, margins as shares of a limit's span; None where a cut is out of reach."""
        figures = self._evaluator.figures(np.array([pose_si("origin", origin_mm_deg)]))
        sizes = {"mean_N_per_mm": figures.mean, "range_N_per_mm": figures.spread, "min_N_per_mm": figures.lowest}
        values = {name: n_per_mm_from_n_per_m(size) for name, size in sizes.items()}
        values |= {"margin": figures.margin, "rapid_margin": figures.rapid_margin}
        return {name: float(value[0]) if np.isfinite(value[0]) else None for name, value in values.items()}


@checked
def try_placement(
    program: Program | str | Path,
    machine: Machine | str | Path = "nist",
    *,
    load: inputs.LoadDirection = LOAD,
    step_mm: inputs.Step = 1.0,
    force_N: inputs.Force = FORCE,
) -> PlacementTrial:
    r"""A program that can be put anywhere: read and sampled once, then the figures of any placement at once.

    The figures are those of `place` and of `analyze` with the same step. Arguments and errors as of `analyze`.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> round(tps.try_placement(slot, "nist").at((0, 0, 800))["mean_N_per_mm"])
    54353
    """
    on, part = machine_from(machine), program_from(program)
    model, direction = on.running(part), parse_load(load)
    read = part.moves(None, model.machine.default_origin)
    path = work_path(read, m_from_mm(step_mm), direction, model.machine)
    return PlacementTrial(read, Evaluator(model, path, direction, force_N))


@checked
def rewrite(
    program: Program | str | Path,
    *,
    to_mm_deg: Sequence[float],
    from_mm_deg: Sequence[float] = (0.0, 0.0, 0.0),
    decimals: inputs.Decimals = None,
    linearise_mm: inputs.Linearised = None,
) -> RewrittenProgram:
    r"""Write a program so that, run at its present zero, it does what the untouched one would do at another placement.

    Parameters
    ----------
    program
        A program, or its file.
    to_mm_deg, from_mm_deg
        Where program zero is to sit in effect, and where it sits: X, Y, Z or X, Y, Z, A, B, C.
    decimals
        Decimals of the numbers written; unless given, 4 in mm and degrees, 5 in inch.
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
    part = program_from(program)
    new, old = pose_si("placement", to_mm_deg), pose_si("present placement", from_mm_deg)
    chord = None if linearise_mm is None else m_from_mm(linearise_mm)
    return rewrite_program(
        part.moves(new), new, old, decimals=decimals, linearise=chord, control=part.request.controller
    )
