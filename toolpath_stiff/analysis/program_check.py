"""Checks of a program before any stiffness: extents, lengths, times, reach and strut speeds."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.documents import Document, number, to_dict
from toolpath_stiff.files import write_atomically
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.nc.checking import ERROR, WARNING, Finding, UsedCode, check, in_order
from toolpath_stiff.nc.courses import Extents
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.request import Request
from toolpath_stiff.path.sampling import move_figures, sample_moves
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import mm_per_min_from_m_per_s

MOST_NAMED = 20  # lines named for one kind of finding


def machine_findings(program: ReadProgram, machine: MachineTool, step: float) -> tuple[list[Finding], dict[str, float]]:
    """Moves beyond reach; the largest strut speed in a cut at the programmed feeds, with its line.

    The program sits where it was read for; `step` is the distance of the samples, m.
    """
    words = machine.angles_of if program.native else None
    samples = sample_moves(program.moves, step, machine.rapid_feed, program.origin, words)
    poses = (samples.position, samples.abc, samples.tangent, samples.tool_length)
    there = evaluate(StiffnessModel(machine), *poses, Load("z"))
    lines, findings = np.unique(samples.line[~there.reachable]).tolist(), []
    for line in lines[:MOST_NAMED]:
        rows = np.flatnonzero((samples.line == line) & ~there.reachable)
        limit = there.reach.describe(int(rows[np.argmin(there.reach.margin[rows])]))
        cuts = samples.cutting[rows].any()
        text = f"{'a cutting move' if cuts else 'a rapid'} leaves the machine's reach: {limit}"
        findings.append(Finding(line, 0, "reach", text, ERROR if cuts else WARNING))
    if more := len(lines) - len(findings):
        findings.append(Finding(0, 0, "reach", f"and {more} more lines leave the machine's reach", WARNING))
    time = np.diff(samples.t)
    same = (samples.move[1:] == samples.move[:-1]) & samples.cutting[1:] & (time > 0.0)
    if not same.any() or not isinstance(machine, Hexapod):
        return findings, {}
    speed = (np.abs(np.diff(there.joints, axis=0)[same]) / time[same, None]).max(axis=1)
    fastest, top = mm_per_min_from_m_per_s(float(speed.max())), int(np.argmax(speed))
    return findings, {"mm_per_min": fastest, "line": int(samples.line[1:][same][top])}


@dataclass(frozen=True, repr=False)
class ProgramCheck(Result):
    r"""Check of a program: words used, words not understood, extents, times, and findings for a machine.

    Attributes
    ----------
    program, interpreter, dialect, kinematics
        Its name, who read it, as what, and for which machine it was posted, "" for this one.
    complete
        Whether it was read to its end.
    language, needs
        What it is written in, with the sign that says so; the options without which it is refused, with a line each.
    used, unsupported, findings
        Codes; words not acted upon; errors, warnings and notes, in the order of lines.
    extents_mm, extents_deg
        Smallest and largest X, Y, Z and A, B, C of the cuts in program coordinates of G54.
    lengths_mm, times_s
        Of cuts, of rapids, together; dwells among the times.
    fastest_strut
        Largest speed of a strut in a cut with its line; empty without a machine.

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
    language: str
    needs: tuple[str, ...]
    used: tuple[UsedCode, ...]
    unsupported: tuple[Finding, ...]
    findings: tuple[Finding, ...]
    extents_mm: Extents
    extents_deg: Extents
    lengths_mm: dict[str, float]
    times_s: dict[str, float]
    fastest_strut: dict[str, float]

    def to_dict(self) -> Document:
        """JSON document of the command."""
        document: Document = to_dict(self)
        return document

    @property
    def errors(self) -> list[Finding]:
        """Findings that prevent the program from running as it stands."""
        return [finding for finding in self.findings if finding.severity == ERROR]

    def to_frame(self) -> DataFrame:
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
        errors = f"{number(count)} error{'s' * (count > 1)}" if count else "no errors"
        return f"{self.program}, {errors}"


def check_program(request: Request, machine: MachineTool | None, step: float = defaults.STEP) -> ProgramCheck:
    """Check a program: all findings, in the shop's units.

    Parameters
    ----------
    request
        The program, and how it is read; its default origin is the machine's.
    machine
        Whose reach and strut speeds are checked; None: the program alone.
    step
        Distance of the samples, m.
    """
    checked = check(request)
    program, findings = checked.program, list(checked.findings)
    speed: dict[str, float] = {}
    if machine is not None and len(program.moves):
        more, speed = machine_findings(program, machine, step)
        findings += more
    figures = move_figures(program.moves, machine.rapid_feed if machine else defaults.RAPID_FEED)
    if not checked.complete:  # extents of a part of the path say nothing about the whole
        figures |= {"extents_mm": {}, "extents_deg": {}}
    return ProgramCheck(
        program=program.name,
        interpreter=program.interpreter,
        dialect=program.dialect,
        kinematics=program.kinematics,
        complete=checked.complete,
        language=checked.language,
        needs=checked.needs,
        used=checked.used,
        unsupported=checked.unsupported,
        findings=in_order(findings),
        **figures,
        fastest_strut=speed,
    )
