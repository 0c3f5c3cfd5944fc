"""What a program uses, and what the reader has to say about it: it goes on where `read_program` would stop."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes import WORK_OFFSETS, code_meaning, would_change
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, Switches, switches_on
from toolpath_stiff.nc.cutter_location import reading as cutter_location
from toolpath_stiff.nc.cutter_location.statements import looks_like_cutter_location
from toolpath_stiff.nc.foreign import foreign_program
from toolpath_stiff.nc.frames import Frames, Pose, pose_in_mm, pose_in_si
from toolpath_stiff.nc.interpreter import Interpreter
from toolpath_stiff.nc.moves import CUTTER_LOCATION, Jump, Moves, Unsupported
from toolpath_stiff.nc.plain_lines import G_COLUMN
from toolpath_stiff.nc.posted.kinematics import PostedKinematics
from toolpath_stiff.nc.reader import ZERO
from toolpath_stiff.nc.subprograms import ProgramRun
from toolpath_stiff.nc.tables import Offsets
from toolpath_stiff.nc.words import Block
from toolpath_stiff.units import m_from_mm

ERROR, WARNING, NOTE = "error", "warning", "note"
NO_CHANGE = "nothing of the path"
MOST_ERRORS = 100  # beyond, a file is no program for this reader


@dataclass(frozen=True)
class Finding:
    """One thing to say of a program.

    Attributes
    ----------
    line, column
        Where, from 1; 0: of the program as a whole.
    code
        What kind of finding it is, a short word; of used and unsupported words the word itself.
    text
        A sentence for people.
    severity
        "error": the program is refused for it; "warning": have a look; "note": for the record.
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
        Where operations begin, where the run left the order of the lines; as in `Program`.
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

    def __init__(self, interpreter: Interpreter, lines: tuple[str, ...], name: str, switches: frozenset[int]) -> None:
        super().__init__(interpreter, lines, name, switches)
        self.errors: list[InputError] = []
        self.first: dict[str, tuple[int, int]] = {}
        self.count: dict[str, int] = {}

    def _read(self, at: int) -> Block:
        try:
            return super()._read(at)
        except InputError as error:
            self._add(error)
            return Block(at + 1, ())

    def _executed(self, at: int, rows: list[tuple[str, ...]]) -> None:
        codes = [row[G_COLUMN] for row in rows]
        for number, count in Counter(code for code in codes if code).items():
            code = f"G{number}"
            if code not in self.first:
                line = at + codes.index(number)
                column = next(word.column for word in self._read(line).words if word.letter == "G")
                self.first[code] = (line + 1, column)
            self.count[code] = self.count.get(code, 0) + count

    def _execute(self, block: Block) -> bool:
        for word in block.words:
            if word.letter in "GM":
                code = f"{word.letter}{word.value:g}"
                self.first.setdefault(code, (block.line, word.column))
                self.count[code] = self.count.get(code, 0) + 1
        try:
            return super()._execute(block)
        except InputError as error:
            self._add(error)
            self.interpreter.call, self.interpreter.returns = None, False
            return True

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
    """Check a program; parameters as in `read_program`. Raises `InputError` for an empty program alone."""
    if not any(line.strip() for line in lines):
        raise InputError("the program is empty", expected="an NC program", file=name)
    if looks_like_cutter_location(lines, name):
        return _check_cutter_location(lines, name, origin or default_origin, bool(block_delete), controller)
    place, default = None if origin is None else pose_in_mm(origin), pose_in_mm(default_origin)
    posted = controller.kinematics
    if posted is None:
        frames = Frames(copy.deepcopy(controller.offsets or Offsets()), place, default)
    else:  # first in the coordinates of the machine that the program was posted for
        frames = Frames(copy.deepcopy(controller.offsets or Offsets()), None, ZERO, posted=posted)
    interpreter = Interpreter(name, frames, copy.deepcopy(controller.tools), controller.dialect)
    run = _CheckingRun(interpreter, lines, name, switches_on(block_delete, controller))
    start = modal_state(interpreter)
    warnings: list[str] = []
    foreign = foreign_program(lines, name)
    if foreign is None:
        try:
            warnings = run.run()
        except InputError as error:
            if error not in run.errors:
                run.errors.append(error)
        foreign = next((f for e in run.errors if (f := foreign_program(lines, name, e.line)) is not None), None)
    errors = run.errors if foreign is None else [foreign]
    if not errors and not interpreter.recorder.cuts:
        errors = [InputError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=name)]
    warnings, assumptions = [*warnings, *interpreter.warnings], list(interpreter.assumptions)
    moves = interpreter.recorder.moves() if len(interpreter.recorder) else None
    at = frames.origin
    if posted is not None:
        at = default if place is None else place
        moves, refused, more, assumed = _on_the_part(moves, posted, interpreter, name)
        errors, warnings, assumptions = [*errors, *refused], [*warnings, *more], [*assumptions, *assumed]
    findings = [finding_of(error) for error in errors]
    findings += [Finding(line_in(text), 0, "warning", text, WARNING) for text in warnings]
    findings += [Finding(0, 0, "assumption", text, NOTE) for text in assumptions]
    return Checked(
        used=tuple(UsedCode(*run.first[code], code, code_meaning(code), NOTE, run.count[code]) for code in run.first),
        unsupported=tuple(_of_unsupported(word) for word in interpreter.unsupported),
        findings=tuple(sorted(findings, key=lambda f: (f.line, f.column))),
        start=start,
        end=modal_state(interpreter),
        moves=moves,
        origin=pose_in_si(at),
        complete=not errors,
        remarks={tool.number: tool.remark for tool in interpreter.used_tools.values()},
        jumps=tuple(run.jumps) if posted is None else None,
    )


def _on_the_part(
    moves: Moves | None, kinematics: PostedKinematics, interpreter: Interpreter, name: str
) -> tuple[Moves | None, list[InputError], tuple[str, ...], tuple[str, ...]]:
    """Moves of the posted machine on the part, None where that is refused; errors, warnings, assumptions."""
    from toolpath_stiff.nc.posted.program import check_rotary_offsets, on_the_part

    if moves is None:
        return None, [], (), ()
    frames = interpreter.frames
    x, y, z = (m_from_mm(v) for v in frames.origin[:3])
    zero = (x, y, z, 0.0, 0.0, 0.0) if frames.source == "program" else None
    try:
        check_rotary_offsets(frames.offsets, kinematics, name)
        tools = interpreter.used_tools.values()
        part = on_the_part(moves, kinematics, zero, tools, name, interpreter.tip_held)
    except InputError as error:
        return None, [error], (), ()
    return part.moves, [], part.warnings, part.assumptions


def _check_cutter_location(
    lines: tuple[str, ...], name: str, origin: Iterable[float], block_delete: bool, controller: Controller
) -> Checked:
    checked = cutter_location.check(lines, name, controller.tools, MOST_ERRORS)
    state = checked.state
    offsets = controller.offsets is not None and any(offset.given for offset in controller.offsets.table)
    warnings = (*cutter_location.not_for(controller, offsets, block_delete), *state.warnings)
    findings = [finding_of(error) for error in checked.errors]
    findings += [Finding(line_in(text), 0, "warning", text, WARNING) for text in warnings]
    findings += [Finding(0, 0, "assumption", text, NOTE) for text in state.assumptions]
    x, y, z, a, b, c = origin
    return Checked(
        used=tuple(UsedCode(line, 1, word, text, NOTE, count) for word, text, line, count in checked.meanings()),
        unsupported=tuple(
            Finding(
                word.line,
                word.column,
                word.word,
                f"{word.reason}; it would change {'what is not known' if word.word in state.doubtful else NO_CHANGE}",
                NOTE,
            )
            for word in cutter_location.unsupported(state)
        ),
        findings=tuple(sorted(findings, key=lambda f: (f.line, f.column))),
        start=checked.start,
        end=checked.end,
        moves=state.recorder.moves() if len(state.recorder) else None,
        origin=(x, y, z, a, b, c),
        complete=not checked.errors,
        dialect=CUTTER_LOCATION,
        marks=tuple(state.marks),
    )


def finding_of(error: InputError) -> Finding:
    """What could not be read, and what it would change."""
    text = error.found + (f"; expected {error.expected}" if error.expected else "")
    changes = would_change(error.found)
    text += f"; it would change {changes}" if changes else ""
    text += f". {error.hint[0].upper()}{error.hint[1:]}" if error.hint else ""
    return Finding(error.line or 0, error.column or 0, "not read", text, ERROR)


def _of_unsupported(word: Unsupported) -> Finding:
    text = f"{word.reason}; it would change {would_change(word.word) or NO_CHANGE}"
    return Finding(word.line, word.column, word.word, text, NOTE)


def line_in(text: str) -> int:
    """The line that a warning names; 0 if it names none."""
    _, found, rest = text.partition("line ")
    digits = rest[: len(rest) - len(rest.lstrip("0123456789"))]
    return int(digits) if found and digits else 0


def modal_state(interpreter: Interpreter) -> dict[str, str]:
    """What is in force, as codes and words."""
    frames, feed = interpreter.frames, interpreter.feed
    standard = len(WORK_OFFSETS)
    offset = WORK_OFFSETS[frames.active] if frames.active < standard else f"G54.1 P{frames.active - standard + 1}"
    return {
        "motion": interpreter.motion or "none",
        "plane": interpreter.plane,
        "distance": "G90" if interpreter.absolute else "G91",
        "arc centres": "G90.1" if interpreter.arc_absolute else "G91.1",
        "units": "G20" if interpreter.inch else "G21",
        "feed mode": interpreter.feed_mode,
        "feed": "none" if feed is None else f"F{feed / interpreter.feed_scale:g}",
        "spindle": f"S{interpreter.speed:g}",
        "tool": f"T{interpreter.tool}",
        "tool length": "G49" if interpreter.tool_length != interpreter.tool_length else f"{frames.tool:g} mm",
        "work offset": offset,
        "cycle return": interpreter.retract or "none",
        "polar": "G15" if interpreter.polar is None else "G16",
        "rotation": "G69" if frames.rotation is None else f"G68 R{frames.rotation[2]:g}",
        "shift (G92, G52)": "none" if not any(frames.g92) else " ".join(f"{v:g}" for v in frames.g92),
    }
