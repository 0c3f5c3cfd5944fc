"""Placing a program: search or an earlier search's front, one placement chosen, analyzed, the program written for it.

`place_program` searches; `place_again` takes another point of a front that was found before, and refuses where
anything has changed since that search.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff.analysis.results import Analysis, analyze
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.placement.paths import work_path
from toolpath_stiff.placement.result import Placement, Written
from toolpath_stiff.placement.rows import (
    FIGURES,
    PLACEMENT,
    PlacementRow,
    analyzed_row,
    numbered_rows,
    placement_mm_deg,
)
from toolpath_stiff.placement.search import search_placements
from toolpath_stiff.placement.task import PlacementTask, Rewriting, SearchRecord
from toolpath_stiff.placement.working import Search
from toolpath_stiff.poses import Pose
from toolpath_stiff.rewriting.program import RewrittenProgram, rewrite_program

AGAIN = "search again, without --pick"


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
    task.check()
    path = work_path(task.program, task.step, task.load, task.present, task.read)
    search = Search(task.model, path, task.load, task.bounds, task.rules, task.force, np.array(task.present))
    search.report = progress or search.report
    front = search_placements(search)
    number = front.best + 1
    record = SearchRecord(task.options(), number, search.left_out, search.poses, front.searches, front.alone)
    return _placed(task, numbered_rows(task.model, path, task.load, front, task.force), record, number)


def place_again(
    task: PlacementTask, earlier: Placement | Mapping[str, Any] | str | Path | None, number: int
) -> Placement:
    """Place the program at point `number` (from 1) of the front of an earlier search, without a search.

    Raises
    ------
    InputError
        The earlier search was another one's (program, machine or options differ), or has no such point.
    """
    task.check()
    front, search = _earlier_search(earlier)
    differ = [name for name, value in task.options().items() if search.options.get(name) != value]
    if differ:
        raise InputError(
            f"--pick: the earlier search differs in {', '.join(differ)}",
            expected="the same program, machine and options as in the search",
            hint="repeat the search's own command with --pick added, or search again without it",
        )
    if not 1 <= number <= len(front):
        raise InputError(f"--pick {number}", expected=f"1 to {len(front)}, the points of the front in placements.csv")
    placed, row = _placed(task, front, search, number), front[number - 1]
    changes = [getattr(row, key) - getattr(placed.chosen, key) for key in FIGURES.values()]
    if max(map(abs, changes)) > 1e-6 * abs(row.mean_N_per_mm):
        raise InputError(
            f"--pick {number}: the figures of this point have changed since the search (the model is another one)",
            hint=AGAIN,
        )
    return placed


def _earlier_search(
    earlier: Placement | Mapping[str, Any] | str | Path | None,
) -> tuple[list[PlacementRow], SearchRecord]:
    """Front and search of a result, of the content of `placement.json`, or of that file. Raises `InputError`."""
    if isinstance(earlier, Placement):
        return earlier.front, earlier.search
    where = f" in {earlier}" if isinstance(earlier, str | Path) else ""
    try:
        document = earlier if isinstance(earlier, Mapping) else json.loads(Path(earlier or "").read_text("utf-8"))
        search = {**document["search"], "rapids_left_out": tuple(document["search"]["rapids_left_out"])}
        return [PlacementRow(**row) for row in document["front"]], SearchRecord(**search)
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"--pick: there is no earlier search of this version{where}", hint=AGAIN) from None


def _placed(task: PlacementTask, rows: Sequence[PlacementRow], search: SearchRecord, number: int) -> Placement:
    """Analyze, before and at the chosen point."""
    before, reason = _analyzed(task, task.program, task.present)
    origin = rows[number - 1].origin
    program = task.read(origin) if task.program.moves.from_machine.any() else task.program
    best, beyond = _analyzed(task, program, origin)
    if best is None:
        raise UnreachableError(f"placement {number} of the front: {beyond}", hint="search again")
    rewritten, written = (None, None) if task.rewriting is None else _rewritten(task.rewriting, best, task.present)
    return Placement(
        task=task,
        front=list(rows),
        search=search,
        chosen=analyzed_row(best, number, rows[number - 1]),
        present=analyzed_row(before) if before else None,
        present_reason=reason,
        best=best,
        before=before,
        rewritten=rewritten,
        written=written,
    )


def _analyzed(task: PlacementTask, program: ReadProgram, origin: Pose) -> tuple[Analysis | None, str]:
    """The program at a placement, or None and why."""
    try:
        return analyze(task.model, program, origin=origin, load=task.load, step=task.step, force=task.force), ""
    except UnreachableError as error:
        return None, str(error)


def _rewritten(writing: Rewriting, best: Analysis, present: Pose) -> tuple[bytes | None, Written]:
    """The transformed program's bytes, and how it compares; or why there are none."""
    try:
        rewritten = rewrite_program(
            best.program,
            best.origin,
            present,
            decimals=writing.decimals,
            linearise=writing.linearise,
            control=writing.control,
        )
        differences = rewriting_differences(best, rewritten, present, writing.control)
    except InputError as error:
        return None, Written(writing.file, refused=str(error))
    zero = dict(zip(PLACEMENT, placement_mm_deg(present), strict=True))
    return rewritten.content, Written(writing.file, zero, differences, tuple(rewritten.notes))


def rewriting_differences(
    placed: Analysis, rewritten: RewrittenProgram, original_origin: Pose, control: Controller = UNKNOWN_CONTROL
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
