"""What a program uses, and what the reader has to say about it: it goes on where `read_program` would stop.

With `--interpreter linuxcnc`, what LinuxCNC's interpreter says of the program, in the words of the built-in check.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.codes.registry import code_meaning
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, Switches, plain
from toolpath_stiff.nc.cutter_location import reader as cutter_location
from toolpath_stiff.nc.cutter_location.state import CutterLocationState
from toolpath_stiff.nc.cutter_location.vocabulary import meaning_of
from toolpath_stiff.nc.findings import (
    ERROR,
    NO_CHANGE,
    NOTE,
    Checked,
    Finding,
    UsedCode,
    finding_of,
    finding_of_unsupported,
    findings_of,
    in_order,
)  # fmt: skip
from toolpath_stiff.nc.languages import foreign_program, refused_program
from toolpath_stiff.nc.lathes import lathe_warning
from toolpath_stiff.nc.linuxcnc.inputs import split
from toolpath_stiff.nc.moves import CUTTER_LOCATION, ReadProgram
from toolpath_stiff.nc.parametric.run import ParametricRun
from toolpath_stiff.nc.parametric.statements import uses_variables
from toolpath_stiff.nc.posted import check_rotary_offsets, on_the_part
from toolpath_stiff.nc.program_run import MOST_ERRORS, ProgramRun, Tally
from toolpath_stiff.nc.reader import INTERPRETERS, feed_assumption, millimetre_warning, read
from toolpath_stiff.nc.request import ZERO, Request
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import WORK_OFFSETS
from toolpath_stiff.nc.words import looks_like_cutter_location
from toolpath_stiff.units import Pose, m_from_mm, pose_in_si

CODE = re.compile(r"([GM])(\d+\.?\d*)")


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
    given = None if origin is None else _pose(origin)
    request = Request(
        lines,
        name,
        origin=given,
        default_origin=_pose(default_origin),
        block_delete=block_delete,
        controller=controller,
    )
    run, start, errors, ending = _checked_run(request)
    state, frames, tally, posted = run.state, run.state.frames, run.tally, request.posted
    assert tally is not None
    moves = state.recorder.moves() if len(state.recorder) else None
    warnings = [*ending, *state.warnings, *lathe_warning(state.turning, moves), *millimetre_warning(state, lines)]
    assumptions = [*state.assumptions, *feed_assumption(controller, moves)]
    zero = pose_in_si(frames.origin)
    if posted is not None:
        x, y, z = (m_from_mm(v) for v in frames.origin[:3])
        there: Pose | None = (x, y, z, 0.0, 0.0, 0.0) if frames.source == "program" else None
        zero = request.default_origin if request.origin is None else request.origin
        try:
            if moves is not None:
                check_rotary_offsets(frames.offsets, posted, name)
                tools = state.used_tools.values()
                moves, more, assumed = on_the_part(moves, posted, there, tools, name, state.tip_held)
                warnings, assumptions = [*warnings, *more], [*assumptions, *assumed]
        except InputError as error:
            moves, errors = None, [*errors, error]
    return Checked(
        used=_used_codes(tally),
        unsupported=tuple(finding_of_unsupported(word) for word in state.unsupported),
        findings=findings_of(errors, warnings, assumptions),
        start=start,
        end=modal_state(state),
        moves=moves,
        origin=zero,
        complete=not errors,
        remarks={tool.number: tool.remark for tool in state.used_tools.values()},
        jumps=tuple(run.jumps) if posted is None else None,
    )


def _checked_run(request: Request) -> tuple[ProgramRun, dict[str, str], list[InputError], list[str]]:
    """The run, the modes at its start, its errors, the warnings of its end.

    A program with variables is run again with their values, from the start.
    """
    lines, name = request.lines, request.name
    run = ProgramRun(request.start(), lines, name, request.switches, tally=Tally())
    start = modal_state(run.state)
    errors, warnings = _run_to_the_end(run)
    if errors and uses_variables(lines):
        run = ParametricRun(request.start(), lines, name, request.switches, request.controller.subprograms, Tally())
        errors, warnings = _run_to_the_end(run)
    return run, start, errors, warnings


def _run_to_the_end(run: ProgramRun) -> tuple[list[InputError], list[str]]:
    """Run a program; its errors, and the warnings of its end. A file in another language has that one error alone."""
    assert run.tally is not None
    lines, name, errors, warnings = run.lines, run.name, run.tally.errors, list[str]()
    foreign = refused_program(lines, name, run.state.dialect)
    if foreign is None:
        try:
            warnings = run.run()
        except InputError as error:
            if error not in errors:
                errors.append(error)
        foreign = next((f for e in errors if (f := foreign_program(lines, name, e.line)) is not None), None)
    if foreign is not None:
        return [foreign], warnings
    if not errors and not run.state.recorder.cuts:
        errors = [ProgramError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=name)]
    return errors, warnings


def _used_codes(tally: Tally) -> tuple[UsedCode, ...]:
    return tuple(
        UsedCode(*tally.first[code], code, code_meaning(code), NOTE, tally.count[code]) for code in tally.first
    )


def _check_cutter_location(
    lines: tuple[str, ...], name: str, origin: Iterable[float], block_delete: bool, controller: Controller
) -> Checked:
    state = CutterLocationState(name, copy.deepcopy(controller.tools), controller.feed)
    start, errors = cutter_location.in_force(state), cutter_location.run(state, lines, MOST_ERRORS)
    warnings = (*cutter_location.not_for(controller, controller.offsets, block_delete), *state.warnings)
    changes = {word: "what is not known" if noted.doubtful else NO_CHANGE for word, noted in state.noted.items()}
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
        origin=_pose(origin),
        complete=not errors,
        dialect=CUTTER_LOCATION,
        marks=tuple(state.marks),
    )


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
            refused = finding_of(error)
            other = Finding(refused.line, refused.column, "not read", f"nor by LinuxCNC: {refused.text}", ERROR)
            return replace(ours, findings=in_order([*ours.findings, other])), "builtin"
        if error.file is None:
            raise
        zero = _pose(default_origin if origin is None else origin)
        return Checked(_used(lines, name), (), (finding_of(error),), {}, {}, None, zero, False), "linuxcnc"
    return _checked(program, lines, ours), "linuxcnc"


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


def _pose(origin: Iterable[float]) -> Pose:
    x, y, z, a, b, c = origin
    return (x, y, z, a, b, c)


def _used(lines: tuple[str, ...], name: str) -> tuple[UsedCode, ...]:
    """G and M codes as they stand in the lines, not how often they run; computed ones are not among them."""
    tally = Tally()
    try:
        split_lines = split(lines, name)
    except InputError:
        return ()
    for line in split_lines:
        for letter, digits in CODE.findall(line.plain):
            code = code_name(letter, float(digits))
            tally.first.setdefault(code, (line.number, 0))
            tally.count[code] += 1
    return _used_codes(tally)
