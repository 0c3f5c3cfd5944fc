"""Placing a program: search or an earlier search's front, one placement chosen, analyzed, the program written for it.

`place_program` searches; `place_again` takes another point of a front that was found before, and refuses where
anything has changed since that search.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from toolpath_stiff.analysis.results import Analysis, analyze
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.placement.evaluator import Evaluator, PlacementFigures
from toolpath_stiff.placement.paths import work_path
from toolpath_stiff.placement.result import Placement
from toolpath_stiff.placement.rows import FIGURES, PLACEMENT, PlacementRow, analyzed_row, front_rows, placement_mm_deg
from toolpath_stiff.placement.search import search_placements
from toolpath_stiff.placement.task import Rewriting, Task
from toolpath_stiff.rewriting.program import RewrittenProgram, rewrite_program
from toolpath_stiff.units import Pose, m_from_mm

COMPARED = {"mean": "mean_N_per_mm", "range": "range_N_per_mm", "min": "min_N_per_mm"}
USUAL_CHORD_MM = 0.01  # tried where a program cannot be written without chords


def place_program(task: Task, progress: Callable[[int, int], None] | None = None) -> Placement:
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
    >>> from toolpath_stiff.placement.climb import Bounds
    >>> from toolpath_stiff.placement.search import SearchRules
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> present = (0.0, 0.0, 0.8, 0.0, 0.0, 0.0)
    >>> slot = parse_program("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2\n", "slot.nc", origin=present)
    >>> here = np.array([0.0, 0.1, 0.8, 0.0, 0.0, 0.0])  # a search of some seconds has bounds apart
    >>> task = Task(
    ...     build_model(load_machine("nist")), slot, present, lambda zero: slot, Bounds(here, here),
    ...     SearchRules(objective="mean", points=5), Load(), step=0.01, force=1000.0,
    ... )
    >>> placed = place_program(task)
    >>> [round(row.mean_N_per_mm) for row in (placed.present, placed.chosen)]
    [54352, 54097]
    >>> placed.warnings[0].partition(",")[0]
    'WORSE: at the recommended placement the mean is lower than at the present one'
    """
    task.check()
    path = work_path(task.program, task.step, task.load, task.present, task.read)
    result = search_placements(
        task.model,
        path,
        task.load,
        task.bounds,
        task.rules,
        force=task.force,
        present=np.array(task.present),
        progress=progress,
    )
    rows = front_rows(task.model, path, task.load, result, task.force)
    search = {
        **task.fingerprint(),
        "recommended": result.best + 1,
        "rapids_left_out": [{"line": line, "reason": reason} for line, reason in result.rapids_left_out],
        "pose_evaluations": result.pose_evaluations,
        "searches": result.searches,
        "nothing_better": result.alone,
    }
    assert result.present is not None
    return _placed(task, rows, search, result.best + 1, result.present)


def place_again(task: Task, earlier: dict[str, Any], number: int) -> Placement:
    """Place the program at point `number` (from 1) of the front in an earlier `placement.json`, without a search.

    Raises
    ------
    InputError
        The earlier search was another one's (program, machine or options differ), or has no such point.
    """
    task.check()
    task.refuse_other_search(earlier)
    rows = [PlacementRow(**row) for row in earlier["front"]]
    if not 1 <= number <= len(rows):
        raise InputError(f"--pick {number}", expected=f"1 to {len(rows)}, the points of the front in placements.csv")
    path = work_path(task.program, task.step, task.load, task.present, task.read)
    evaluator = Evaluator(task.model, path, task.load, task.force, task.rules.keepouts)
    placed = _placed(task, rows, earlier["search"], number, evaluator.figures(np.array([task.present])))
    changes = [getattr(rows[number - 1], key) - getattr(placed.chosen, key) for key in FIGURES.values()]
    if max(map(abs, changes)) > 1e-6 * abs(rows[number - 1].mean_N_per_mm):
        raise InputError(
            f"--pick {number}: the figures of this point have changed since the search (the model is another one)",
            hint="search again, without --pick",
        )
    return placed


def _placed(
    task: Task, rows: list[PlacementRow], search: dict[str, Any], number: int, present: PlacementFigures
) -> Placement:
    """Analyze, before and at the chosen point."""
    before, reason = _analyzed(task, task.program, task.present)
    origin = rows[number - 1].origin
    program = task.read(origin) if task.program.moves.from_machine.any() else task.program
    best, beyond = _analyzed(task, program, origin)
    if best is None:
        raise UnreachableError(f"placement {number} of the front: {beyond}", hint="search again")
    rewritten, written = _rewritten(task, program, best)
    return Placement(
        task=task,
        front=rows,
        search=search,
        chosen=analyzed_row(best, number, rows[number - 1]),
        present=analyzed_row(before) if before else None,
        present_figures=present,
        present_reason=reason,
        best=best,
        before=before,
        program=program,
        rewritten=rewritten,
        written=written,
    )


def _analyzed(task: Task, program: ReadProgram, at: Pose) -> tuple[Analysis | None, str]:
    """The program at a placement, or None and why."""
    try:
        return analyze(task.model, program, origin=at, load=task.load, step=task.step, force=task.force), ""
    except UnreachableError as error:
        return None, str(error)


def _rewritten(task: Task, program: ReadProgram, best: Analysis) -> tuple[bytes | None, dict[str, Any] | None]:
    """The transformed program's bytes, and what `placement.json` says of it; None, None unless asked for."""
    writing = task.rewriting
    if writing is None:
        return None, None
    try:
        rewritten = _written_there(task, writing, program, best)
    except InputError as error:
        return None, {"file": writing.file, "refused": f"{error}{_linearised_words(task, writing, program, best)}"}
    return rewritten.content, {
        "file": writing.file,
        "analysed_at": dict(zip(PLACEMENT, placement_mm_deg(task.present), strict=True)),
        "relative_difference": rewriting_differences(best, rewritten, task.present, **writing.reading),
        "notes": list(rewritten.notes),
    }


def _written_there(task: Task, writing: Rewriting, program: ReadProgram, best: Analysis) -> RewrittenProgram:
    return rewrite_program(
        program,
        best.origin,
        task.present,
        decimals=writing.decimals,
        linearise=writing.linearise,
        **writing.reading,
    )


def _linearised_words(task: Task, writing: Rewriting, program: ReadProgram, best: Analysis) -> str:
    """What a refused program would be with chords; nothing where these were asked for or do not help."""
    if writing.linearise is not None:
        return ""
    try:
        chords = _written_there(task, replace(writing, linearise=m_from_mm(USUAL_CHORD_MM)), program, best)
    except InputError:
        return ""
    apart = rewriting_differences(best, chords, task.present, **writing.reading)
    option = both_names("--linearise", f"{USUAL_CHORD_MM:g}")
    return (
        f". {option} would write it in {len(chords.text.splitlines())} lines instead of {len(program.source)}; its "
        f"mean would differ by {apart['mean']:.1e}, its range by {apart['range']:.1e} (relative)"
    )


def rewriting_differences(
    placed: Analysis, rewritten: RewrittenProgram, original_origin: Pose, **reading: Any
) -> dict[str, float]:
    """Relative differences of mean, range and smallest stiffness: the rewritten program against the placed one.

    Parameters
    ----------
    placed
        The untouched program, analyzed at the placement.
    rewritten
        Is read and analyzed at the original origin with the same load, force and step.
    original_origin
        m and rad, as it was given to `rewrite_program`.
    **reading
        `offsets`, `tools`, `block_delete`, as for `parse_program`.
    """
    program = parse_program(rewritten.text, placed.program.name, origin=original_origin, **reading)
    again = analyze(
        placed.model, program, origin=original_origin, load=placed.load, step=placed.step, force=placed.force
    )
    wanted, found = (stiffness_figures(analysis, analysis.counted) for analysis in (placed, again))
    scale = {"range": wanted["range_N_per_mm"] or wanted["mean_N_per_mm"]}  # a path of one point has no range
    return {name: abs(found[key] - wanted[key]) / scale.get(name, wanted[key]) for name, key in COMPARED.items()}
