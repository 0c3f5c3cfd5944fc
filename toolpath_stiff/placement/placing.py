"""A program placed: search or an earlier search's front, one placement chosen, analyzed, and everything said about it.

`place_program` searches; `place_again` takes another point of a front that was found before, and refuses where
anything has changed since that search (`fingerprint`). Both return `Placed`, which the command line saves and prints.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.results import Analysis, analyze
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.errors import InputError, UnreachableError
from toolpath_stiff.hints import both_names
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.placement.climb import Bounds
from toolpath_stiff.placement.document import (
    FIGURES,
    USUAL_CHORD_MM,
    figures_of,
    front_rows,
    placement_of,
    placement_row,
    placement_summary,
    placement_warnings,
    pose_of,
    worsened,
)
from toolpath_stiff.placement.evaluator import Evaluator, PlacementFigures
from toolpath_stiff.placement.paths import Read, WorkPath, work_path
from toolpath_stiff.placement.search import SearchRules, search_placements
from toolpath_stiff.rewriting.program import Rewritten, check_decimals, check_rewritable, rewrite_program
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import Pose, m_from_mm, mm_from_m

COMPARED = {"mean": "mean_N_per_mm", "range": "range_N_per_mm", "min": "min_N_per_mm"}


@dataclass(frozen=True)
class Rewriting:
    """How the program itself is to be written: its file's name, decimals, chords (m), and what it was read with."""

    file: str
    decimals: int | None
    linearise: float | None
    reading: dict[str, Any]


@dataclass(frozen=True)
class Task:
    """What is to be placed, and how. SI.

    Attributes
    ----------
    model, program
        Machine and effects; the program as read where its zero sits now.
    present
        Where that is.
    read
        Reads the program for another zero: moves to machine coordinates depend on it.
    bounds, rules
        What may vary; what a placement must keep and be good at.
    load, step, force
        As `analyze` takes them.
    rewriting
        Whether and how the program itself is written; None: not.
    """

    model: StiffnessModel
    program: Program
    present: Pose
    read: Read
    bounds: Bounds
    rules: SearchRules
    load: Load
    step: float
    force: float
    rewriting: Rewriting | None = None


@dataclass(frozen=True)
class Placed:
    """A program at the chosen placement.

    Attributes
    ----------
    task
        What was asked.
    summary
        Everything in the shop's units, as `placement.json` has it.
    best, before
        Analyses at the chosen and at the present placement; `before` None where that is out of reach.
    program
        As read for the chosen placement.
    rewritten
        Bytes of the transformed program; None unless asked for, and where it cannot be written (`summary` says why).
    """

    task: Task
    summary: dict[str, Any]
    best: Analysis
    before: Analysis | None
    program: Program
    rewritten: bytes | None


def place_program(task: Task, progress: Callable[[int, int], None] | None = None) -> Placed:
    r"""Search, and place the program where the search recommends.

    Raises
    ------
    InputError
        The program cannot be placed, or not be written there (before the search where that can be seen).
    UnreachableError
        No placement keeps the limits.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> present = (0.0, 0.0, 0.8, 0.0, 0.0, 0.0)
    >>> slot = parse_program("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2\n", "slot.nc", origin=present)
    >>> here = np.array([0.0, 0.1, 0.8, 0.0, 0.0, 0.0])  # a search of some seconds has bounds apart
    >>> task = Task(
    ...     build_model(load_machine("nist")), slot, present, lambda zero: slot, Bounds(here, here),
    ...     SearchRules(objective="mean", points=5), Load(), step=0.01, force=1000.0,
    ... )
    >>> placed = place_program(task)
    >>> [round(placed.summary[which]["mean_N_per_mm"]) for which in ("before", "chosen")]
    [54352, 54097]
    >>> placed.summary["warnings"][0].partition(",")[0]
    'WORSE: at the recommended placement the mean is lower than at the present one'
    """
    check_task(task)
    path = _path(task)
    found = search_placements(
        task.model,
        path,
        task.load,
        task.bounds,
        task.rules,
        force=task.force,
        present=np.array(task.present),
        progress=progress,
    )
    rows = front_rows(task.model, path, task.load, found, task.force)
    search = {
        **fingerprint(task),
        "recommended": found.best + 1,
        "rapids_left_out": [{"line": line, "reason": reason} for line, reason in found.rapids_left_out],
        "pose_evaluations": found.pose_evaluations,
        "searches": found.searches,
        "nothing_better": found.alone,
    }
    assert found.present is not None
    return _placed(task, rows, search, found.best + 1, found.present)


def place_again(task: Task, earlier: dict[str, Any], number: int) -> Placed:
    """Place the program at point `number` (from 1) of the front in an earlier `placement.json`, without a search.

    Raises
    ------
    InputError
        The earlier search was another one's (program, machine or options differ), or has no such point.
    """
    check_task(task)
    refuse_other_search(task, earlier)
    rows = earlier["front"]
    if not 1 <= number <= len(rows):
        raise InputError(f"--pick {number}", expected=f"1 to {len(rows)}, the points of the front in placements.csv")
    path = _path(task)
    evaluator = Evaluator(task.model, path, task.load, task.force, task.rules.keepouts)
    placed = _placed(task, rows, earlier["search"], number, evaluator.figures(np.array([task.present])))
    row, again = rows[number - 1], placed.summary["chosen"]
    if any(abs(row[key] - again[key]) > 1e-6 * abs(row["mean_N_per_mm"]) for key in FIGURES.values()):
        raise InputError(
            f"--pick {number}: the figures of this point have changed since the search (the model is another one)",
            hint="search again, without --pick",
        )
    return placed


def check_task(task: Task) -> None:
    """Raise `InputError` for what can be told before a search."""
    writing, program = task.rewriting, task.program
    if writing is None:
        return
    check_decimals(writing.decimals)
    check_rewritable(program)
    if program.interpreter != "builtin":
        raise InputError(
            f"--write {writing.file}: {program.name} was read by LinuxCNC's interpreter; its blocks cannot be "
            "rewritten",
            hint="leave --write out and set the work offset",
        )


def _path(task: Task) -> WorkPath:
    return work_path(task.program, task.step, task.load, task.present, task.read)


def _placed(
    task: Task, rows: list[dict[str, Any]], search: dict[str, Any], number: int, present: PlacementFigures
) -> Placed:
    """Analyze, before and at the chosen point; collect what is to be said."""
    before, reason = _analyzed(task, task.program, task.present)
    at = pose_of(placement_of(rows[number - 1]))
    program = task.read(at) if task.program.moves.from_machine.any() else task.program
    best, beyond = _analyzed(task, program, at)
    if best is None:
        raise UnreachableError(f"placement {number} of the front: {beyond}", hint="search again")
    margins = {key: rows[number - 1][key] for key in ("margin", "rapid_margin")}
    chosen = {"number": number, **figures_of(best), **margins}
    old = figures_of(before) if before else None
    worse = worsened(chosen, old)
    rewritten, written = _rewritten(task, program, best)
    warnings = placement_warnings(task.bounds, task.rules, search, chosen, old, reason, worse, present, best)
    summary = placement_summary(program, best, rows, search, chosen, old, reason, worse, written, warnings)
    return Placed(task, summary, best, before, program, rewritten)


def _analyzed(task: Task, program: Program, at: Pose) -> tuple[Analysis | None, str]:
    """The program at a placement, or None and why."""
    try:
        return analyze(task.model, program, origin=at, load=task.load, step=task.step, force=task.force), ""
    except UnreachableError as error:
        return None, str(error)


def _rewritten(task: Task, program: Program, best: Analysis) -> tuple[bytes | None, dict[str, Any] | None]:
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
        "analysed_at": placement_row(np.array(task.present)),
        "relative_difference": rewriting_differences(best, rewritten, task.present, **writing.reading),
        "notes": list(rewritten.notes),
    }


def _written_there(task: Task, writing: Rewriting, program: Program, best: Analysis) -> Rewritten:
    return rewrite_program(
        program,
        best.origin,
        task.present,
        decimals=writing.decimals,
        linearise=writing.linearise,
        **writing.reading,
    )


def _linearised_words(task: Task, writing: Rewriting, program: Program, best: Analysis) -> str:
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


def fingerprint(task: Task) -> dict[str, Any]:
    """Hashes of program and machine, and the options that a search depends on, under their names."""
    program, rules, bounds = task.program, task.rules, task.bounds
    moves = [getattr(program.moves, f.name).tobytes() for f in fields(program.moves)]
    acting = [(active.effect.name, sorted(active.values.items())) for active in task.model.effects]
    acting_in = f"{acting!r} {task.model.conditions!r}"
    low, high = bounds.low.tolist(), bounds.high.tolist()
    return {
        "program_sha256": _hash("\n".join(program.source).encode("utf-8", "replace"), *moves),
        "machine_sha256": _hash(machine_toml(task.model.machine).encode(), acting_in.encode()),
        "options": {
            **{f"--{name}": [low[i], high[i]] for i, name in enumerate(("x", "y", "z", "tilt-a", "tilt-b", "rotate"))},
            "--z-values": list(bounds.heights),
            "--keep-out": [[box.name, *box.low, *box.high] for box in rules.keepouts],
            "--objective": rules.objective,
            "--margin": rules.margin,
            "--allow-extrapolation": rules.allow_extrapolation,
            "--points": rules.points,
            "--seed": rules.seed,
            "--origin": list(task.present),
            "--load": str(task.load),
            "--step": mm_from_m(task.step),
            "--force": task.force,
        },
    }


def refuse_other_search(task: Task, earlier: dict[str, Any]) -> None:
    """Raise `InputError` where an earlier search was not of this program, machine and options; names what differs."""
    now, then = fingerprint(task), earlier.get("search")
    if not isinstance(then, dict) or "front" not in earlier:
        raise InputError("--pick: placement.json is of an older version", hint="search again, without --pick")
    differ = [name for name in ("program", "machine") if now[f"{name}_sha256"] != then.get(f"{name}_sha256")]
    options = then.get("options", {})
    differ += [name for name, value in now["options"].items() if options.get(name) != value]
    if differ:
        raise InputError(
            f"--pick: the earlier search differs in {', '.join(differ)}",
            expected="the same program, machine and options as in the search",
            hint="repeat the search's own command with --pick added, or search again without it",
        )


def _hash(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def rewriting_differences(
    placed: Analysis, rewritten: Rewritten, original_origin: Pose, **reading: Any
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
