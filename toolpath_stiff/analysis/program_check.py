"""Checks of a program before any stiffness: extents, lengths, times, arcs, reach and strut speeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import other_poses
from toolpath_stiff.analysis.statistics import operation_heading, rows_of_parts
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.files import write_atomically
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Reach, machine_limits, reach
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.nc.checking import check_by
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, Switches
from toolpath_stiff.nc.courses import arc_frame, move_lengths, points_along
from toolpath_stiff.nc.findings import ERROR, WARNING, Checked, Finding
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.nc.operations import find_operations
from toolpath_stiff.nc.request import ZERO
from toolpath_stiff.path import BLOCK, Samples, move_durations, place, sample_moves
from toolpath_stiff.results import Result
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import Pose, deg_from_rad, m_from_mm, mm_from_m, mm_per_min_from_m_per_s

if TYPE_CHECKING:
    import pandas as pd

RADII_APART = m_from_mm(2e-3)  # what rounding I, J, K, X, Y to 0.001 mm explains, and a little more
MOST_NAMED = 20  # lines named for one kind of finding
Extents = dict[str, list[float]]


@dataclass(frozen=True)
class Figures:
    """Extents of the tip in program coordinates of G54, lengths and times of some moves."""

    extents_mm: Extents
    extents_deg: Extents
    extents_with_rapids_mm: Extents
    lengths_mm: dict[str, float]
    times_s: dict[str, float]


def figures(moves: Moves | None, rapid_feed: float = defaults.RAPID_FEED) -> Figures:
    """Extents, lengths and times of moves; rapids at `rapid_feed`, m/s."""
    if moves is None:
        return Figures({}, {}, {}, {}, {})
    cutting = moves.motion != RAPID
    length, duration = move_lengths(moves), move_durations(moves, rapid_feed)
    parts = (("cutting", cutting), ("rapid", ~cutting))
    lengths = {name: mm_from_m(float(length[rows].sum())) for name, rows in parts}
    times = {name: float(duration[rows].sum()) for name, rows in parts} | {"dwell": float(moves.dwell.sum())}
    cuts, everything = extents(moves.take(cutting)), extents(moves)
    return Figures(
        {axis: cuts[axis] for axis in "xyz" if cuts},
        {axis: cuts[axis] for axis in "abc" if cuts},
        {axis: everything[axis] for axis in "xyz" if everything},
        {**lengths, "total": sum(lengths.values())},
        {**times, "total": sum(times.values())},
    )


def extents(moves: Moves) -> Extents:
    """Smallest and largest x, y, z (mm) and a, b, c (degrees) on the way, the bulges of arcs included."""
    if not len(moves):
        return {}
    ends = np.stack([moves.start, moves.end])
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    bulges = _arc_extremes(moves.take(moves.arc_sweep != 0.0))
    if len(bulges):
        low[:3], high[:3] = np.minimum(low[:3], bulges.min(axis=0)), np.maximum(high[:3], bulges.max(axis=0))
    scale = np.array([mm_from_m(1.0)] * 3 + [deg_from_rad(1.0)] * 3)
    return {name: [float(lo), float(hi)] for name, lo, hi in zip("xyzabc", low * scale, high * scale, strict=True)}


def _arc_extremes(arcs: Moves) -> FloatArray:
    """(m, 3) m, points of arcs where a coordinate turns; climbs and growing radii as far along as the angle is."""
    row = np.arange(len(arcs))
    frame, sweep = arc_frame(arcs, row), np.abs(arcs.arc_sweep)
    points = [np.empty((0, 3))]
    for axis in range(3):
        turning = np.arctan2(frame.e2[:, axis] * np.sign(arcs.arc_sweep), frame.e1[:, axis])
        for opposite in (0.0, np.pi):
            angle = np.mod(turning + opposite, 2.0 * np.pi)
            last_turn = angle + 2.0 * np.pi * np.floor(np.maximum(sweep - angle, 0.0) / (2.0 * np.pi))
            for turned in (angle, last_turn):
                inside = turned < sweep
                points.append(points_along(arcs, row[inside], (turned / sweep)[inside])[0])
    return np.concatenate(points)


def radii_findings(moves: Moves) -> list[Finding]:
    """Arcs whose end lies off the circle of their start by more than rounding."""
    arcs = moves.take(moves.arc_sweep != 0.0)
    frame = arc_frame(arcs, np.arange(len(arcs)))
    bad = np.flatnonzero(np.abs(frame.radius_end - frame.radius_start) > RADII_APART)
    findings = []
    for i in bad[:MOST_NAMED]:
        first, last = mm_from_m(float(frame.radius_start[i])), mm_from_m(float(frame.radius_end[i]))
        text = f"the arc's radius is {first:.4f} mm at its start and {last:.4f} mm at its end"
        findings.append(Finding(int(arcs.line[i]), 0, "arc radii", text, WARNING))
    return findings + _rest("arc radii", len(bad))


def machine_findings(
    checked: Checked, machine: Hexapod, origin: Pose, step: float, speed_limit: float | None
) -> tuple[list[Finding], dict[str, float]]:
    """Moves beyond reach, and the struts' speeds (m/s) at the programmed feeds.

    Parameters
    ----------
    checked
        With moves.
    machine, origin
        The machine, and where program zero sits on it, m and rad.
    step
        Distance of the samples, m.
    speed_limit
        m/s that no strut may exceed in a cut; None: none is known.

    Returns
    -------
    findings, and the largest speed of a strut in a cut with its line.
    """
    assert checked.moves is not None
    samples = sample_moves(place(checked.moves, origin), step=step, rapid_feed=machine.rapid_feed, origin=origin)
    strut_lengths, within = _struts_and_reach(machine, samples)
    cutting = samples.motion != RAPID
    findings = []
    for line in np.unique(samples.line[~within.reachable])[:MOST_NAMED]:
        there = np.flatnonzero((samples.line == line) & ~within.reachable)
        worst = int(there[np.argmin(within.margin[there])])
        cuts = bool(cutting[there].any())
        text = f"{'a cutting move' if cuts else 'a rapid'} leaves the machine's reach: {within.describe(worst)}"
        findings.append(Finding(int(line), 0, "reach", text, ERROR if cuts else WARNING))
    findings += _rest("reach", len(np.unique(samples.line[~within.reachable])))
    same = (samples.move[1:] == samples.move[:-1]) & cutting[1:] & (np.diff(samples.t) > 0.0)
    speed = np.abs(np.diff(strut_lengths, axis=0)[same]) / np.diff(samples.t)[same, None]
    if not len(speed):
        return findings, {}
    fastest, lines = speed.max(axis=1), samples.line[1:][same]
    top = int(np.argmax(fastest))
    if speed_limit is not None:
        over = np.unique(lines[fastest > speed_limit])
        for line in over[:MOST_NAMED]:
            most = mm_per_min_from_m_per_s(float(fastest[lines == line].max()))
            text = (
                f"a strut moves at {most:.0f} mm/min at the programmed feed, beyond "
                f"{mm_per_min_from_m_per_s(speed_limit):.0f} mm/min"
            )
            findings.append(Finding(int(line), 0, "strut speed", text, WARNING))
        findings += _rest("strut speed", len(over))
    return findings, {"mm_per_min": mm_per_min_from_m_per_s(float(fastest[top])), "line": int(lines[top])}


def _struts_and_reach(machine: Hexapod, samples: Samples) -> tuple[FloatArray, Reach]:
    """(n, 6) m strut lengths of n samples, and their reach; block by block, as work arrays of a long path are large."""
    other = other_poses(samples.position, samples.abc, samples.tool_length)
    poses, of_sample = np.flatnonzero(other), np.cumsum(other) - 1
    n = len(poses)
    lengths = np.empty((n, 6))
    margin, limit, value = np.empty(n), np.empty(n, dtype=np.int64), np.empty(n)
    for start in range(0, n, BLOCK):
        rows = poses[start : start + BLOCK]
        here = slice(start, start + BLOCK)
        position, rotation = samples.position[rows], rotation_matrices(samples.abc[rows])
        struts = solve_struts(machine, position, rotation, samples.tool_length[rows])
        within = reach(machine, position, struts, rotation)
        lengths[here] = struts.lengths
        margin[here], limit[here], value[here] = within.margin, within.limit, within.value
    return lengths[of_sample], Reach(margin[of_sample], limit[of_sample], value[of_sample], machine_limits(machine))


def _rest(code: str, count: int) -> list[Finding]:
    if count <= MOST_NAMED:
        return []
    return [Finding(0, 0, code, f"and {count - MOST_NAMED} more of the kind {code!r}", WARNING)]


class ProgramCheck(Result):
    r"""What a program uses, what is not understood, extents, times, and what a machine says to it.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.check(tps.Program.from_text("G21 G90\nG1 X40 F300\nG999\nM2", name="slot.nc"))
    >>> found
    <ProgramCheck: slot.nc, 1 error>
    >>> found.errors == [one for one in found.findings if one["severity"] == "error"]
    True
    >>> found.to_frame()["line"].tolist(), found.to_dict()["complete"]
    ([3], False)
    """

    command: ClassVar[str] = "check"
    shown_by: ClassVar[str] = "check"

    def __init__(self, document: dict[str, Any]) -> None:
        self._document = document

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command."""
        return self._document

    @property
    def findings(self) -> list[dict[str, Any]]:
        """What was found: line, column, subject, text, severity."""
        return list(self._document["findings"])

    @property
    def errors(self) -> list[dict[str, Any]]:
        """The findings that keep the program from running as it stands."""
        return [finding for finding in self.findings if finding["severity"] == ERROR]

    def to_frame(self) -> pd.DataFrame:
        """The findings, one a row."""
        import pandas as pd

        return pd.DataFrame(self.findings, columns=["line", "column", "code", "text", "severity", "count"])

    def save(self, file: str | Path) -> Path:
        r"""Write the JSON document to a file, whole or not at all.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     tps.check(tps.Program.from_text("G21\nM2")).save(pathlib.Path(folder) / "check.json").name
        'check.json'
        """
        return write_atomically(file, self.to_json())

    def _short(self) -> str:
        count = len(self.errors)
        errors = f"{self.view.number(count)} error{'s' * (count > 1)}" if count else "no errors"
        return f"{self._document['program']}, {errors}"


def check_program(
    lines: tuple[str, ...],
    name: str,
    *,
    machine: Hexapod | None,
    origin: Pose | None = None,
    step: float = defaults.STEP,
    strut_speed: float | None = None,
    controller: Controller = UNKNOWN_CONTROL,
    block_delete: Switches = False,
    interpreter: str = "builtin",
    rs274: str | None = None,
    unconfined: bool = False,
) -> ProgramCheck:
    """Everything that is to be said of a program, in the shop's units.

    Parameters
    ----------
    lines, name
        The program.
    machine
        Whose reach and strut speeds are checked; None: the program alone.
    origin, step, strut_speed
        Where program zero sits (m, rad); distance of the samples, m; largest speed of a strut, m/s.
    controller, block_delete, interpreter, rs274, unconfined
        As of `read_program`.
    """
    default = machine.default_origin if machine else ZERO
    run: dict[str, Any] = {"rs274": rs274, "unconfined": unconfined, "controller": controller}
    checked, reader = check_by(
        interpreter, lines, name, origin=origin, default_origin=default, block_delete=block_delete, **run
    )
    findings: list[Finding] = list(checked.findings)
    speed: dict[str, float] = {}
    rapid_feed = machine.rapid_feed if machine else defaults.RAPID_FEED
    whole = figures(checked.moves, rapid_feed)
    if checked.moves is not None:
        findings += radii_findings(checked.moves)
        if machine is not None:
            more, speed = machine_findings(checked, machine, checked.origin, step, strut_speed)
            findings += more
    tools, operations = check_parts(checked, lines, name, rapid_feed, whole)
    posted = controller.kinematics if checked.dialect in ("", "linuxcnc") else None
    return ProgramCheck(
        {
            "program": name,
            "interpreter": reader,
            "dialect": checked.dialect or controller.label,
            "kinematics": posted.label if posted else "",
            "complete": checked.complete,
            "used": [asdict(code) for code in checked.used],
            "unsupported": [asdict(word) for word in checked.unsupported],
            "findings": [
                asdict(finding) for finding in sorted(findings, key=lambda finding: (finding.line, finding.column))
            ],
            **asdict(whole),
            "tools": tools,
            "operations": operations,
            "fastest_strut": speed,
            "modal_start": checked.start,
            "modal_end": checked.end,
        }
    )


def check_parts(
    checked: Checked,
    lines: Sequence[str],
    name: str,
    rapid_feed: float = defaults.RAPID_FEED,
    whole: Figures | None = None,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Tools in order of use, and operations in the order of the run: rows of `--json`, mm, degrees, s.

    Parameters
    ----------
    checked
        What the check found; without moves there are no rows.
    lines, name
        The program.
    rapid_feed
        Of rapids, m/s.
    whole
        The figures of all moves, where they are known.
    """
    moves = checked.moves
    if moves is None:
        return [], []
    numbers, first, of_move = np.unique(moves.tool, return_index=True, return_inverse=True)
    operations = find_operations(lines, moves, name, checked.remarks, checked.marks, checked.jumps)

    def rows(of_move: IntArray, count: int) -> list[dict[str, Any]]:
        """The figures of moves in `count` parts, each in the part that `of_move` (n,) says."""
        if count == 1 and whole is not None:
            return [asdict(whole)]
        return [asdict(figures(moves.take(part), rapid_feed)) for part in rows_of_parts(of_move, count)]

    by_tool = rows(of_move, len(numbers))
    tools = [
        {"tool": int(numbers[i]), "remark": checked.remarks.get(int(numbers[i]), ""), **by_tool[i]}
        for i in np.argsort(first).tolist()
    ]
    by_operation = zip(operations.rows, rows(operations.of_move, len(operations.rows)), strict=True)
    return tools, [operation_heading(operation) | part for operation, part in by_operation]
