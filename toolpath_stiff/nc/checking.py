"""What a program uses, and what the reader has to say about it: it goes on where `read_program` would stop.

With `--interpreter linuxcnc`, what LinuxCNC's interpreter says of the program, in the words of the built-in check.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.codes.registry import code_meaning, would_change
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, Switches, plain, switches_on
from toolpath_stiff.nc.cutter_location import reader as cutter_location
from toolpath_stiff.nc.cutter_location.state import State as CutterLocationState
from toolpath_stiff.nc.cutter_location.vocabulary import meaning_of
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.interpreter import ProgramRun
from toolpath_stiff.nc.kinematics import PostedKinematics
from toolpath_stiff.nc.languages import foreign_program, refused_program
from toolpath_stiff.nc.lathes import lathe_warning
from toolpath_stiff.nc.linuxcnc.inputs import split
from toolpath_stiff.nc.moves import CUTTER_LOCATION, Jump, Moves, ReadProgram, Unsupported
from toolpath_stiff.nc.reader import INTERPRETERS, feed_assumption, millimetre_warning, read
from toolpath_stiff.nc.request import ZERO, Request
from toolpath_stiff.nc.state import Flow, State, Then
from toolpath_stiff.nc.tables import WORK_OFFSETS, Offsets
from toolpath_stiff.nc.words import Block, looks_like_cutter_location
from toolpath_stiff.units import Pose, m_from_mm, pose_in_mm, pose_in_si

if TYPE_CHECKING:
    from toolpath_stiff.nc.plain_words import PlainWords

ERROR, WARNING, NOTE = "error", "warning", "note"
NO_CHANGE = "nothing of the path"
MOST_ERRORS = 100  # beyond, a file is not a program for this reader


@dataclass(frozen=True)
class Finding:
    """One finding about a program.

    Attributes
    ----------
    line, column
        Where, from 1; 0: of the program as a whole.
    code
        What kind of finding it is, a short word; of used and unsupported words the word itself.
    text
        One sentence.
    severity
        "error": the program is refused for it; "warning": to be checked; "note": for the record.
    """

    line: int
    column: int
    code: str
    text: str
    severity: str


@dataclass(frozen=True)
class UsedCode:
    """A G or M code of the program: where it stands first, how often, and what it is taken for."""

    line: int
    column: int
    code: str
    text: str
    severity: str
    count: int


@dataclass(frozen=True)
class Checked:
    """What was found without a machine.

    Attributes
    ----------
    used
        Codes in the order of their first appearance.
    unsupported
        Words that were read and not acted upon, with what they would change.
    findings
        In the order of lines.
    start, end
        Modal state before the first block and after the last one, names to words.
    moves
        In the set-up frame; after an error the moves of the blocks that could be read, None if there are none.
    origin
        Where program zero sits, m and rad.
    complete
        Whether the whole program was read.
    dialect
        What the file was taken for, where that is not the control's dialect.
    remarks
        What the tool table says of the tools that were used, by number.
    marks, jumps
        Where operations begin, where the run left the order of the lines; as in `ReadProgram`.
    """

    used: tuple[UsedCode, ...]
    unsupported: tuple[Finding, ...]
    findings: tuple[Finding, ...]
    start: dict[str, str]
    end: dict[str, str]
    moves: Moves | None
    origin: Pose
    complete: bool
    dialect: str = ""
    remarks: dict[int, str] = field(default_factory=dict)
    marks: tuple[tuple[int, str], ...] | None = None
    jumps: tuple[Jump, ...] | None = None


class _CheckingRun(ProgramRun):
    """A run that notes the codes of each block, and notes an error and goes on with the next block."""

    def __init__(self, state: State, lines: tuple[str, ...], name: str, switches: frozenset[int], **more: Any) -> None:
        super().__init__(state, lines, name, switches, **more)
        self.errors: list[InputError] = []
        self.first: dict[str, tuple[int, int]] = {}
        self.count: dict[str, int] = {}

    def _read(self, at: int) -> Block:
        try:
            return super()._read(at)
        except InputError as error:
            self._add(error)
            return Block(at + 1, ())

    def _steered(self, at: int) -> int | None:
        try:
            return super()._steered(at)
        except InputError as error:
            self._add(error)
            return at + 1

    def _executed(self, at: int, words: PlainWords) -> None:
        found = [(words.code == number).nonzero()[0] for number in range(int(words.code.max()) + 1)]
        for rows in sorted((rows for rows in found if len(rows)), key=lambda rows: int(rows[0])):
            code, line, count = f"G{words.code[rows[0]]}", at + int(rows[0]), len(rows)
            if code not in self.first:
                column = next(word.column for word in self._read(line).words if word.letter == "G")
                self.first[code] = (line + 1, column)
            self.count[code] = self.count.get(code, 0) + count

    def _execute(self, block: Block) -> Then:
        for word in block.words:
            if word.letter in "GM":
                code = f"{word.letter}{word.value:g}"
                self.first.setdefault(code, (block.line, word.column))
                self.count[code] = self.count.get(code, 0) + 1
        try:
            return super()._execute(block)
        except InputError as error:
            self._add(error)
            return Flow.NEXT

    def _add(self, error: InputError) -> None:
        self.errors.append(error)
        if len(self.errors) >= MOST_ERRORS:
            raise error


def check_lines(
    lines: tuple[str, ...],
    name: str,
    *,
    origin: Iterable[float] | None = None,
    default_origin: Iterable[float] = ZERO,
    block_delete: Switches = False,
    controller: Controller = UNKNOWN_CONTROL,
) -> Checked:
    """Check a program; parameters as in `read_program`. Raises `InputError` for an empty program alone.

    Examples
    --------
    >>> checked = check_lines(("G21 G90 F600", "G1 X10", "G41 D1", "M30"), "slot.nc")
    >>> checked.complete
    False
    >>> [(code.code, code.text) for code in checked.used][-2:]
    [('G41', 'cutter compensation, tool on the left'), ('M30', 'end')]
    >>> checked.findings[0].line, checked.findings[0].severity
    (3, 'error')
    """
    if not any(line.strip() for line in lines):
        raise ProgramError("the program is empty", expected="an NC program", file=name)
    if looks_like_cutter_location(lines, name):
        return _check_cutter_location(lines, name, origin or default_origin, bool(block_delete), controller)
    place, default = None if origin is None else pose_in_mm(origin), pose_in_mm(default_origin)
    posted = controller.kinematics
    if posted is None:
        frames = Frames(copy.deepcopy(controller.offsets or Offsets()), place, default)
    else:  # first in the coordinates of the machine that the program was posted for
        frames = Frames(copy.deepcopy(controller.offsets or Offsets()), None, ZERO, posted=posted)
    first = State(name, frames, copy.deepcopy(controller.tools), controller.dialect)
    first.feed = controller.feed
    start = modal_state(first)
    run, errors, warnings = _checked_run(
        first, lines, name, switches_on(block_delete, controller), controller.subprograms
    )
    state, frames = run.state, run.state.frames
    warnings, assumptions = [*warnings, *state.warnings], list(state.assumptions)
    moves = state.recorder.moves() if len(state.recorder) else None
    warnings += [*lathe_warning(state.turning, moves), *millimetre_warning(state, lines)]
    assumptions += feed_assumption(controller, moves)
    at = frames.origin
    if posted is not None:
        at = default if place is None else place
        moves, refused, more, assumed = _on_the_part(moves, posted, state, name)
        errors, warnings, assumptions = [*errors, *refused], [*warnings, *more], [*assumptions, *assumed]
    return Checked(
        used=tuple(UsedCode(*run.first[code], code, code_meaning(code), NOTE, run.count[code]) for code in run.first),
        unsupported=tuple(_of_unsupported(word) for word in state.unsupported),
        findings=findings_of(errors, warnings, assumptions),
        start=start,
        end=modal_state(state),
        moves=moves,
        origin=pose_in_si(at),
        complete=not errors,
        remarks={tool.number: tool.remark for tool in state.used_tools.values()},
        jumps=tuple(run.jumps) if posted is None else None,
    )


def _checked_run(
    state: State, lines: tuple[str, ...], name: str, switches: frozenset[int], subprograms: str | Path | None
) -> tuple[_CheckingRun, list[InputError], list[str]]:
    """The run, its errors and warnings; a program with variables is run again with their values, from the start."""
    again = copy.deepcopy(state)
    run = _CheckingRun(state, lines, name, switches)
    errors, warnings = _run_to_the_end(run)
    if errors:
        from toolpath_stiff.nc.parametric.statements import uses_variables

        if uses_variables(lines):
            run = _parametric_run(again, lines, name, switches, subprograms)
            errors, warnings = _run_to_the_end(run)
    return run, errors, warnings


def _parametric_run(
    state: State, lines: tuple[str, ...], name: str, switches: frozenset[int], subprograms: str | Path | None
) -> _CheckingRun:
    from toolpath_stiff.nc.parametric.run import ParametricRun

    class CheckingParametricRun(_CheckingRun, ParametricRun):
        """Both: `super()` in the first is the second."""

    return CheckingParametricRun(state, lines, name, switches, folder=subprograms)


def _run_to_the_end(run: _CheckingRun) -> tuple[list[InputError], list[str]]:
    """Run a program; its errors, and the warnings of its end. A file in another language has that one error alone."""
    lines, name, warnings = run.lines, run.name, list[str]()
    foreign = refused_program(lines, name, run.state.dialect)
    if foreign is None:
        try:
            warnings = run.run()
        except InputError as error:
            if error not in run.errors:
                run.errors.append(error)
        foreign = next((f for e in run.errors if (f := foreign_program(lines, name, e.line)) is not None), None)
    errors = run.errors if foreign is None else [foreign]
    if not errors and not run.state.recorder.cuts:
        errors = [ProgramError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=name)]
    return errors, warnings


def _on_the_part(
    moves: Moves | None, kinematics: PostedKinematics, state: State, name: str
) -> tuple[Moves | None, list[InputError], list[str], list[str]]:
    """Moves of the posted machine on the part, None where that is refused; errors, warnings, assumptions."""
    from toolpath_stiff.nc.posted import check_rotary_offsets, on_the_part

    if moves is None:
        return None, [], [], []
    frames = state.frames
    x, y, z = (m_from_mm(v) for v in frames.origin[:3])
    zero = (x, y, z, 0.0, 0.0, 0.0) if frames.source == "program" else None
    try:
        check_rotary_offsets(frames.offsets, kinematics, name)
        tools = state.used_tools.values()
        moves, warnings, assumptions = on_the_part(moves, kinematics, zero, tools, name, state.tip_held)
    except InputError as error:
        return None, [error], [], []
    return moves, [], warnings, assumptions


def _check_cutter_location(
    lines: tuple[str, ...], name: str, origin: Iterable[float], block_delete: bool, controller: Controller
) -> Checked:
    state = CutterLocationState(name, copy.deepcopy(controller.tools), controller.feed)
    start, errors = cutter_location.in_force(state), cutter_location.run(state, lines, MOST_ERRORS)
    warnings = (*cutter_location.not_for(controller, controller.offsets, block_delete), *state.warnings)
    changes = {word: "what is not known" if noted.doubtful else NO_CHANGE for word, noted in state.noted.items()}
    x, y, z, a, b, c = origin
    return Checked(
        used=tuple(
            UsedCode(line, 1, word, meaning_of(word), NOTE, count) for word, (line, count) in state.used_words.items()
        ),
        unsupported=tuple(
            Finding(word.line, word.column, word.word, f"{word.reason}; it would change {changes[word.word]}", NOTE)
            for word in cutter_location.unsupported(state)
        ),
        findings=findings_of(errors, warnings, state.assumptions),
        start=start,
        end=cutter_location.in_force(state),
        moves=state.recorder.moves() if len(state.recorder) else None,
        origin=(x, y, z, a, b, c),
        complete=not errors,
        dialect=CUTTER_LOCATION,
        marks=tuple(state.marks),
    )


def findings_of(
    errors: Iterable[InputError], warnings: Iterable[str], assumptions: Iterable[str]
) -> tuple[Finding, ...]:
    """All findings about a program, in the order of lines."""
    return in_order(
        [
            *(finding_of(error) for error in errors),
            *(Finding(line_in(text), 0, "warning", text, WARNING) for text in warnings),
            *(Finding(0, 0, "assumption", text, NOTE) for text in assumptions),
        ]
    )


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings in the order of lines."""
    return tuple(sorted(findings, key=lambda finding: (finding.line, finding.column)))


def finding_of(error: InputError) -> Finding:
    """What could not be read, and what it would change."""
    text = error.found + (f"; expected {error.expected}" if error.expected else "")
    changes = would_change(error.found)
    text += f"; it would change {changes}" if changes else ""
    text += f". {error.hint[0].upper()}{error.hint[1:]}" if error.hint else ""
    return Finding(error.line or 0, error.column or 0, "not read", text, ERROR)


def _of_unsupported(word: Unsupported) -> Finding:
    text = f"{word.reason}; it would change {would_change(word.word, listed=True) or NO_CHANGE}"
    return Finding(word.line, word.column, word.word, text, NOTE)


def line_in(text: str) -> int:
    """The line that a warning names; 0 if it names none."""
    _, found, rest = text.partition("line ")
    digits = rest[: len(rest) - len(rest.lstrip("0123456789"))]
    return int(digits) if found and digits else 0


def modal_state(state: State) -> dict[str, str]:
    """What is in force, as codes and words."""
    frames, feed = state.frames, state.feed
    standard = len(WORK_OFFSETS)
    offset = WORK_OFFSETS[frames.active] if frames.active < standard else f"G54.1 P{frames.active - standard + 1}"
    return {
        "motion": state.motion or "none",
        "plane": state.plane,
        "distance": "G90" if state.absolute else "G91",
        "arc centres": "G90.1" if state.arc_absolute else "G91.1",
        "units": "G20" if state.inch else "G21",
        "feed mode": state.feed_mode,
        "feed": "none" if feed is None else f"F{feed / state.feed_scale:g}",
        "spindle": f"S{state.speed:g}",
        "tool": f"T{state.tool}",
        "tool length": "G49" if state.tool_length != state.tool_length else f"{frames.tool:g} mm",
        "work offset": offset,
        "cycle return": state.retract or "none",
        "polar": "G15" if state.polar is None else "G16",
        "rotation": "G69" if frames.rotation is None else f"G68 R{frames.rotation[2]:g}",
        "shift (G92, G52)": "none" if not any(frames.g92) else " ".join(f"{v:g}" for v in frames.g92),
    }


# -- by LinuxCNC's interpreter -----------------------------------------------------------------------------------------

CODE = re.compile(r"([GM])(\d+\.?\d*)")


def check_by(
    interpreter: str,
    lines: tuple[str, ...],
    name: str,
    *,
    rs274: str | None = None,
    unconfined: bool = False,
    origin: Iterable[float] | None = None,
    default_origin: Iterable[float] = ZERO,
    block_delete: Switches = False,
    controller: Controller = UNKNOWN_CONTROL,
) -> tuple[Checked, str]:
    """Check a program by an interpreter; parameters as in `read_program`. Returns who read it, too.

    "auto" is the built-in check where that reads the whole program, or LinuxCNC's interpreter cannot. Raises
    `InputError` for an empty program, or where "linuxcnc" is asked for and cannot be had.

    Examples
    --------
    >>> checked, reader = check_by("builtin", ("G21 G90 F600", "G1 X10", "M30"), "slot.nc")
    >>> checked.complete, reader, checked.end["motion"]
    (True, 'builtin', 'G1')
    """
    if interpreter not in INTERPRETERS:
        raise ProgramError(f"interpreter {interpreter!r}", expected=", ".join(INTERPRETERS))
    options: dict[str, Any] = {"origin": origin, "default_origin": default_origin, "block_delete": block_delete}
    run: dict[str, Any] = {"interpreter": "linuxcnc", "rs274": rs274, "unconfined": unconfined}
    ours = None
    if interpreter != "linuxcnc":
        ours = check_lines(lines, name, controller=controller, **options)
        second = plain(block_delete, controller) and not looks_like_cutter_location(lines, name)
        if interpreter == "builtin" or ours.complete or not second:
            return ours, "builtin"
    try:
        program = read(Request(lines, name, controller=controller, **run, **options))
    except InputError as error:
        if ours is not None:
            return _refused_by_both(ours, error), "builtin"
        if error.file is None:
            raise
        at = _pose(origin, default_origin)
        return Checked(_used(lines, name), (), (finding_of(error),), {}, {}, None, at, False), "linuxcnc"
    return _checked(program, lines, ours), "linuxcnc"


def _refused_by_both(ours: Checked, error: InputError) -> Checked:
    """The built-in check, with what LinuxCNC's interpreter refuses."""
    refused = finding_of(error)
    said = Finding(refused.line, refused.column, "not read", f"nor by LinuxCNC: {refused.text}", ERROR)
    return replace(ours, findings=in_order([*ours.findings, said]))


def _checked(program: ReadProgram, lines: tuple[str, ...], ours: Checked | None) -> Checked:
    """What LinuxCNC's interpreter made of a program, and why the built-in one did not read it (`ours`)."""
    findings = findings_of((), program.warnings, program.assumptions)
    if ours is not None:
        why = next(finding for finding in ours.findings if finding.severity == ERROR)
        text = f"the built-in interpreter says: {why.text.partition('; ')[0]}"
        findings = in_order([*findings, Finding(why.line, why.column, "interpreter", text, NOTE)])
    return Checked(
        used=_used(lines, program.name),
        unsupported=tuple(
            Finding(word.line, word.column, word.word, f"{word.reason}; not acted upon", NOTE)
            for word in program.unsupported
        ),
        findings=findings,
        start={},
        end={},
        moves=program.moves,
        origin=program.origin,
        complete=True,
        dialect=program.dialect,
        remarks={tool.number: tool.remark for tool in program.tools},
        marks=program.marks,
    )


def _pose(origin: Iterable[float] | None, default: Iterable[float]) -> Pose:
    x, y, z, a, b, c = default if origin is None else origin
    return (x, y, z, a, b, c)


def _used(lines: tuple[str, ...], name: str) -> tuple[UsedCode, ...]:
    """G and M codes as they stand in the lines, not how often they run; computed ones are not among them."""
    first: dict[str, tuple[int, int]] = {}
    count: dict[str, int] = {}
    try:
        split_lines = split(lines, name)
    except InputError:
        return ()
    for line in split_lines:
        for letter, digits in CODE.findall(line.plain):
            code = code_name(letter, float(digits))
            first.setdefault(code, (line.number, 0))
            count[code] = count.get(code, 0) + 1
    return tuple(UsedCode(*first[code], code, code_meaning(code), NOTE, count[code]) for code in first)
