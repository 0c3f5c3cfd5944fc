"""Checks of a program before any stiffness: extents, lengths, times, arcs, reach and strut speeds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import other_poses
from toolpath_stiff.analysis.statistics import operation_heading, rows_of_parts
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.documents import to_dict
from toolpath_stiff.files import write_atomically
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import Reach, machine_limits, reach
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.nc.checking import ERROR, WARNING, Finding, UsedCode, check, in_order
from toolpath_stiff.nc.courses import arc_frame, move_lengths, points_along
from toolpath_stiff.nc.moves import RAPID, Moves, ReadProgram
from toolpath_stiff.nc.operations import operations
from toolpath_stiff.nc.request import Request
from toolpath_stiff.path.placing import place
from toolpath_stiff.path.sampling import BLOCK, Samples, move_durations, sample_moves
from toolpath_stiff.results import Result, frame_of
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import deg_from_rad, m_from_mm, mm_from_m, mm_per_min_from_m_per_s

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


def figures(moves: Moves, rapid_feed: float = defaults.RAPID_FEED) -> Figures:
    """Extents, lengths and times of moves; rapids at `rapid_feed`, m/s."""
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
    program: ReadProgram, machine: Hexapod, step: float, speed_limit: float | None
) -> tuple[list[Finding], dict[str, float]]:
    """Moves beyond reach, and the struts' speeds (m/s) at the programmed feeds.

    Parameters
    ----------
    program, machine
        The program, where it sits on the machine, and that.
    step
        Distance of the samples, m.
    speed_limit
        m/s that no strut may exceed in a cut; None: none is known.

    Returns
    -------
    findings, and the largest speed of a strut in a cut with its line.
    """
    moves, origin = place(program.moves, program.origin), program.origin
    samples = sample_moves(moves, step=step, rapid_feed=machine.rapid_feed, origin=origin)
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


@dataclass(frozen=True)
class ToolRow(Figures):
    """What a tool does; `remark` is the tool table's."""

    tool: int
    remark: str


@dataclass(frozen=True)
class OperationRow(Figures):
    """What an operation does; from its heading to the last line of its moves."""

    operation: int
    name: str
    tool: int
    first_line: int
    last_line: int


@dataclass(frozen=True, repr=False)
class ProgramCheck(Result):
    r"""What a program uses, what is not understood, extents, times, and what a machine says to it.

    Attributes
    ----------
    program, interpreter, dialect, kinematics
        Its name, who read it, as what, and for which machine it was posted, "" for this one.
    complete
        Whether it was read to its end.
    used, unsupported, findings
        Codes; words not acted upon; errors, warnings and notes, in the order of lines.
    whole, tools, operations
        Figures of all moves, of each tool in order of use, of each operation in the order of the run.
    fastest_strut
        Largest speed of a strut in a cut with its line; empty without a machine.
    modal_start, modal_end
        The modes in force before the first block and after the last one.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.check(tps.Program.from_text("G21 G90\nG1 X40 F300\nG999\nM2", name="slot.nc"))
    >>> found
    <ProgramCheck: slot.nc, 1 error>
    >>> [(finding.line, finding.severity) for finding in found.errors]
    [(3, 'error')]
    >>> found.to_frame()["line"].tolist(), found.to_dict()["complete"]
    ([3], False)
    """

    command: ClassVar[str] = "check"
    shown_by: ClassVar[str] = "check"

    program: str
    interpreter: str
    dialect: str
    kinematics: str
    complete: bool
    used: tuple[UsedCode, ...]
    unsupported: tuple[Finding, ...]
    findings: tuple[Finding, ...]
    whole: Figures
    tools: tuple[ToolRow, ...]
    operations: tuple[OperationRow, ...]
    fastest_strut: dict[str, float]
    modal_start: dict[str, str]
    modal_end: dict[str, str]

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command; the figures of all moves stand among its own keys."""
        document: dict[str, Any] = {}
        for key, value in to_dict(self).items():
            document |= value if key == "whole" else {key: value}
        return document

    @property
    def errors(self) -> list[Finding]:
        """The findings that keep the program from running as it stands."""
        return [finding for finding in self.findings if finding.severity == ERROR]

    def to_frame(self) -> pd.DataFrame:
        """The findings, one a row."""
        return frame_of(to_dict(self.findings), columns=["line", "column", "code", "text", "severity"])

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
        return f"{self.program}, {errors}"


def check_program(
    request: Request, machine: Hexapod | None, step: float = defaults.STEP, strut_speed: float | None = None
) -> ProgramCheck:
    """Everything that is to be said of a program, in the shop's units.

    Parameters
    ----------
    request
        The program, and how it is read; its default origin is the machine's.
    machine
        Whose reach and strut speeds are checked; None: the program alone.
    step, strut_speed
        Distance of the samples, m; largest speed of a strut, m/s.
    """
    checked = check(request)
    program, findings = checked.program, list(checked.findings)
    speed: dict[str, float] = {}
    rapid_feed = machine.rapid_feed if machine else defaults.RAPID_FEED
    if len(program.moves):
        findings += radii_findings(program.moves)
        if machine is not None:
            more, speed = machine_findings(program, machine, step, strut_speed)
            findings += more
    return ProgramCheck(
        program=program.name,
        interpreter=program.interpreter,
        dialect=program.dialect,
        kinematics=program.kinematics,
        complete=checked.complete,
        used=checked.used,
        unsupported=checked.unsupported,
        findings=in_order(findings),
        whole=figures(program.moves, rapid_feed),
        tools=tool_rows(program, rapid_feed),
        operations=operation_rows(program, rapid_feed),
        fastest_strut=speed,
        modal_start=checked.start,
        modal_end=checked.end,
    )


def tool_rows(program: ReadProgram, rapid_feed: float = defaults.RAPID_FEED) -> tuple[ToolRow, ...]:
    """Figures of each tool in order of use; rapids at `rapid_feed`, m/s."""
    numbers, first, of_move = np.unique(program.moves.tool, return_index=True, return_inverse=True)
    remarks = {tool.number: tool.remark for tool in program.tools}
    parts = _parts(program.moves, of_move, len(numbers), rapid_feed)
    return tuple(
        ToolRow(**vars(parts[i]), tool=int(numbers[i]), remark=remarks.get(int(numbers[i]), ""))
        for i in np.argsort(first).tolist()
    )


def operation_rows(program: ReadProgram, rapid_feed: float = defaults.RAPID_FEED) -> tuple[OperationRow, ...]:
    """Figures of each operation in the order of the run; rapids at `rapid_feed`, m/s."""
    stretches = operations(program)
    parts = _parts(program.moves, stretches.of_move, len(stretches.rows), rapid_feed)
    return tuple(
        OperationRow(**vars(part), **operation_heading(row)) for row, part in zip(stretches.rows, parts, strict=True)
    )


def _parts(moves: Moves, of_move: IntArray, count: int, rapid_feed: float) -> list[Figures]:
    """The figures of moves in `count` parts, each in the part that `of_move` (n,) says."""
    return [figures(moves.take(part), rapid_feed) for part in rows_of_parts(of_move, count)] if count else []
