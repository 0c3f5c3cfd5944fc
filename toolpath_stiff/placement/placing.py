"""Placing a program: the search, the recommended placement analyzed, the program written for it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from toolpath_stiff.analysis.loads import plunging_rows
from toolpath_stiff.analysis.results import Analysis, analyze
from toolpath_stiff.analysis.statistics import share, stiffness_figures
from toolpath_stiff.analysis.turning import FIXED
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.defaults import OBJECTIVES
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.placement.evaluator import Evaluator
from toolpath_stiff.placement.goals import Goal
from toolpath_stiff.placement.paths import WorkPath, representative_path, work_path
from toolpath_stiff.placement.result import FIGURES, Placement, PlacementRow, PlacementTask, Written
from toolpath_stiff.placement.search import SCOUTS, PlacementResult, search_placements
from toolpath_stiff.placement.working import NO_FLOORS, SCOUT_SAMPLES, Search
from toolpath_stiff.poses import Pose, ShopPose, pose_in_mm
from toolpath_stiff.rewriting.program import RewrittenProgram, check_rewritable, rewrite_program
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import deg_from_rad, n_per_mm_from_n_per_m, um_from_m

ZERO = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "rotation_deg")


def place_program(task: PlacementTask, progress: Callable[[int, int], None] | None = None) -> Placement:
    r"""Search, and place the program where the search recommends.

    Raises
    ------
    InputError
        The program cannot be placed, or not be written there (before the search where that can be seen).
    UnreachableError
        No placement keeps the limits.

    Examples
    --------
    >>> from toolpath_stiff.analysis.loads import Load
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> from toolpath_stiff.placement.goals import Bounds, SearchRules
    >>> from toolpath_stiff.placement.result import PlacementTask
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> present = (0.0, 0.0, 0.8, 0.0, 0.0, 0.0)
    >>> slot = parse_program("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2\n", "slot.nc", origin=present)
    >>> here = np.array([0.0, 0.1, 0.8, 0.0, 0.0, 0.0])  # a search of some seconds has bounds apart
    >>> task = PlacementTask(
    ...     build_model(load_machine("nist")), slot, present, lambda zero: slot, Bounds(here, here),
    ...     SearchRules(objective="mean", points=5), Load(), step=0.01, force=1000.0,
    ... )
    >>> placed = place_program(task)
    >>> [round(row.mean_N_per_mm) for row in (placed.present, placed.chosen)]
    [54352, 54097]
    >>> placed.warnings[0].partition(",")[0]
    'WORSE: at the recommended placement the mean is lower than at the present one'
    """
    _check(task)
    path = work_path(task.program, task.step, task.load, task.model.machine)
    present, given = np.append(task.present, np.zeros(len(task.bounds.low) - 6)), task  # the tool's turn as programmed
    if len(present) > 6 and len(task.model.machine.configurations) > 1:
        task = replace(task, model=_in_best_configuration(task, path))
    search = Search(task.model, path, task.load, task.bounds, task.rules, task.force, present)
    search.report, search.errors = progress or search.report, task.errors
    found = search_placements(search)
    front = numbered_rows(task, path, found)
    before, reason = _analyzed(given, task.program, task.present)
    row = front[found.best]
    program = task.read(row.origin) if task.program.moves.from_machine.any() else task.program
    best, beyond = _analyzed(task, program, row.origin, row.tool_turn_deg)
    if best is None:
        raise UnreachableError(f"placement {row.number} of the front: {beyond}", hint="search again")
    rewritten, written = _rewritten(task, best) if task.write else (None, None)
    places = {"chosen": row.origin, **({"before": task.present} if before else {})}
    return Placement(
        task=task,
        front=front,
        searches=found.searches,
        pose_evaluations=search.poses,
        nothing_better=found.alone,
        chosen=_analyzed_row(best, row),
        present=_analyzed_row(before) if before else None,
        present_reason=reason,
        best=best,
        before=before,
        rewritten=rewritten,
        written=written,
        surface_error_um=task.errors
        and {name: float(um_from_m(task.errors(np.array([place])))[0]) for name, place in places.items()},
    )


def _in_best_configuration(task: PlacementTask, path: WorkPath) -> StiffnessModel:
    """The model in the machine's configuration with the best of many placements for the objective."""
    bounds, rules, model = task.bounds, task.rules, task.model
    draws = np.random.default_rng(rules.seed).uniform(size=(SCOUTS, len(bounds.free)))
    scouts, few = bounds.placements(draws), representative_path(path, SCOUT_SAMPLES)
    goal, values = Goal(OBJECTIVES[rules.objective], NO_FLOORS), []
    machines = [model.machine.with_changes(only=i) for i in range(len(model.machine.configurations))]
    for machine in machines:
        tried = replace(model, machine=machine)
        figures = Evaluator(tried, few, task.load, task.force, rules.keepouts).figures(scouts)
        values.append(np.where(rules.violation(figures) > 0.0, -np.inf, goal.value(figures)).max())
    return replace(model, machine=machines[int(np.argmax(values))])


def _check(task: PlacementTask) -> None:
    """Raise `InputError` for faults that show before a search."""
    machine, turns = task.model.machine, np.concatenate([task.bounds.low[3:6], task.bounds.high[3:6]])
    if not isinstance(machine, Hexapod) and task.program.native and task.program.moves.end[:, 3:].any() and turns.any():
        mistake = f"the program turns axes of machine {machine.name}, whose words another turn of the work would change"
        raise InputError(mistake, hint="place it with --rotate 0, untilted")
    if task.write:
        check_rewritable(task.program)


def numbered_rows(task: PlacementTask, path: WorkPath, found: PlacementResult) -> list[PlacementRow]:
    """The front, numbered from 1 by rising mean."""
    figures, nothing = found.figures, np.full(len(found.front), np.nan)
    stiffnesses = [figures.mean, figures.spread, figures.lowest]
    plunging = plunging_rows(task.load, path.tangent, path.abc, path.cutting & (path.weight > 0.0)) & ~path.headline
    if plunging.any():  # plunges are counted separately
        plunges = Evaluator(task.model, path.alone(plunging), task.load, task.force).figures(found.front)
        stiffnesses += [plunges.mean, plunges.lowest]
    else:
        stiffnesses += [nothing, nothing]
    columns = [n_per_mm_from_n_per_m(values) for values in stiffnesses]
    columns.insert(3, um_from_m(task.force * figures.compliance))
    columns += [figures.extrapolated, figures.margin, figures.rapid_margin]
    rows = []
    for i, values in enumerate(np.stack(columns, axis=1).tolist()):
        cells: list[Any] = [value if np.isfinite(value) else None for value in values]
        turn = [deg_from_rad(float(angle)) % 360.0 for angle in found.front[i, 6:]]
        rows.append(PlacementRow(i + 1, *_mm_deg(found.front[i, :6]), *cells, *turn))
    return rows


def _analyzed_row(analysis: Analysis, like: PlacementRow | None = None) -> PlacementRow:
    """Placement and figures of an analysis, headline and plunges; number and margins from a row `like` it."""
    headline, plunges = (stiffness_figures(analysis, rows) for rows in (analysis.headline, analysis.set_aside))
    cells: list[Any] = [headline[key] for key in (*FIGURES.values(), "mean_deflection_um")]
    cells += [plunges["mean_N_per_mm"], plunges["min_N_per_mm"]]
    cells.append(share(analysis.at.extrapolated, analysis.samples.cutting))
    cells += [like.margin, like.rapid_margin, like.tool_turn_deg] if like else []
    return PlacementRow(like.number if like else None, *_mm_deg(analysis.origin), *cells)


def _mm_deg(placement: Pose | FloatArray) -> ShopPose:
    """A placement (6,) in mm and degrees; the rotation from 0 to 360."""
    x, y, z, a, b, c = pose_in_mm(map(float, placement))
    return x, y, z, a, b, c % 360.0


def _analyzed(
    task: PlacementTask, program: ReadProgram, origin: Pose, turn_deg: float | None = None
) -> tuple[Analysis | None, str]:
    """Analysis of the program at a placement, with the tool turned about its axis; or None and the reason."""
    turn = FIXED if turn_deg is None else turn_deg
    try:
        return analyze(
            task.model, program, origin=origin, load=task.load, step=task.step, force=task.force, turn=turn
        ), ""
    except UnreachableError as error:
        return None, str(error)


def _rewritten(task: PlacementTask, best: Analysis) -> tuple[bytes | None, Written]:
    """Bytes of the transformed program, and how it compares; or the reason why there is none."""
    try:
        place, chord = (best.program, best.origin, task.present), task.linearise
        rewritten = rewrite_program(*place, decimals=task.decimals, linearise=chord, control=task.control)
        differences = rewriting_differences(best, rewritten, task.present, task.control)
    except InputError as error:
        return None, Written(task.write, refused=str(error))
    zero = dict(zip(ZERO, _mm_deg(task.present), strict=True))
    return rewritten.content, Written(task.write, zero, differences, tuple(rewritten.notes))


def rewriting_differences(
    placed: Analysis, rewritten: RewrittenProgram, original_origin: Pose, control: Controller = UNKNOWN_CONTROL
) -> dict[str, float]:
    """Relative differences of mean, range and smallest stiffness between rewritten and placed program.

    Parameters
    ----------
    placed
        The untouched program, analyzed at the placement.
    rewritten
        Is read and analyzed at the original origin with the same load, force and step.
    original_origin
        m and rad, as it was given to `rewrite_program`.
    control
        Offsets, tools and block-delete switches that the program was read with.
    """
    program = parse_program(rewritten.text, placed.program.name, origin=original_origin, controller=control)
    again = analyze(
        placed.model, program, origin=original_origin, load=placed.load, step=placed.step, force=placed.force
    )
    wanted, now = (stiffness_figures(analysis, analysis.counted) for analysis in (placed, again))
    scale = {"range": wanted["range_N_per_mm"] or wanted["mean_N_per_mm"]}  # a path of one point has no range
    return {name: abs(now[key] - wanted[key]) / scale.get(name, wanted[key]) for name, key in FIGURES.items()}
