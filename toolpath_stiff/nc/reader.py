"""An NC program or a cutter-location file, from file or text, to `ReadProgram`."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict, Unpack

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.codes.increments import increments_hint
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, Switches, check_plain, plain
from toolpath_stiff.nc.cutter_location import reader as cutter_location
from toolpath_stiff.nc.languages import (
    foreign_program,
    lathe_warning,
    looks_like_cutter_location,
    refused_program,
)
from toolpath_stiff.nc.lines import read_lines, split_lines
from toolpath_stiff.nc.linuxcnc import reader as linuxcnc
from toolpath_stiff.nc.moves import RAPID, ReadProgram, Remark
from toolpath_stiff.nc.operations import split_comments
from toolpath_stiff.nc.parametric.families import uses_variables
from toolpath_stiff.nc.parametric.run import ParametricRun
from toolpath_stiff.nc.posted import check_rotary_offsets, recovered
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.request import ORIGIN_WINS, Request
from toolpath_stiff.nc.state import START, State
from toolpath_stiff.nc.tables import Offsets, ToolEntry, read_offsets, read_tool_table
from toolpath_stiff.units import Pose, mm_per_min_from_m_per_s, pose_in_si

INTERPRETERS = ("builtin", "linuxcnc", "auto")


class Options(TypedDict, total=False):
    """How a program is read; see `Request` and `Controller`."""

    origin: Pose | None
    default_origin: Pose
    offsets: Offsets
    tools: dict[int, ToolEntry]
    block_delete: Switches
    interpreter: str
    rs274: str | None
    unconfined: bool
    controller: Controller


def read_program(
    path: str | Path,
    *,
    offsets_file: str | Path | None = None,
    tool_table: str | Path | None = None,
    **options: Unpack[Options],
) -> ReadProgram:
    """Read an NC program file; the two files win over `offsets` and `tools` of the further options.

    Examples
    --------
    >>> from importlib.resources import files
    >>> program = read_program(files("toolpath_stiff") / "data" / "programs" / "case_study.nc")
    >>> program
    <ReadProgram case_study.nc: 7 moves, read as generic>
    >>> [tool.number for tool in program.tools]
    [1]
    """
    if offsets_file:
        options["offsets"] = read_offsets(offsets_file)
    if tool_table:
        options["tools"] = read_tool_table(tool_table)
    return _read_lines(read_lines(path), Path(path).name, str(path), options)


def parse_program(text: str, name: str = "program", **options: Unpack[Options]) -> ReadProgram:
    r"""Read an NC program from text.

    Examples
    --------
    >>> program = parse_program("G21 G90 F600\nG0 Z5\nG1 Z-1\nG2 X20 Y0 I10 J0\nM8\nM30\n", "slot.nc")
    >>> program
    <ReadProgram slot.nc: 3 moves, read as generic>
    >>> [(note.line, note.word, note.reason) for note in program.unsupported]
    [(5, 'M8', 'coolant')]

    What cannot be read is refused, with its place and what to do:

    >>> parse_program("G21 G90\nG1 X10\n", "slot.nc")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    toolpath_stiff.errors.ProgramError: slot.nc:2:1: G1 is a feed move before any feed; expected F above 0, ...
    """
    return _read_lines(split_lines(text, name), name, "", options)


def _read_lines(lines: tuple[str, ...], name: str, path: str, options: Options) -> ReadProgram:
    """A program, with tables in place of those of its control."""
    values = dict[str, Any](options)
    tables = {table: values.pop(table) for table in ("offsets", "tools") if table in values}
    controller = replace(options.get("controller", UNKNOWN_CONTROL), **tables)
    return read(Request(lines, name, path, **{**values, "controller": controller}))


def read(request: Request) -> ReadProgram:
    """A program by the interpreter that is asked for: the built-in one, LinuxCNC's, or that where the first refuses.

    Raises
    ------
    InputError
        With file, line and column, what was found and what was expected.
    """
    lines, name = request.lines, request.name
    if request.interpreter not in INTERPRETERS:
        raise ProgramError(f"interpreter {request.interpreter!r}", expected=", ".join(INTERPRETERS))
    if not any(line.strip() for line in lines):
        raise ProgramError("the program is empty", expected="an NC program", file=name)
    native = request.interpreter == "linuxcnc"
    if looks_like_cutter_location(lines, name):
        if native:
            problem = "LinuxCNC's interpreter reads no cutter-location files"
            raise ProgramError(problem, expected="--interpreter builtin", file=name)
        return _with_feed(cutter_location.read(request), request)
    refused = foreign_program(lines, name) if native else refused_program(lines, name, request.controller.dialect)
    if refused is not None:
        raise refused
    if native:
        check_plain(request.block_delete, request.controller)
        return on_the_part(linuxcnc.read(request), request)
    try:
        return _read_built_in(request)
    except InputError as error:
        foreign = foreign_program(lines, name, error.line)
        if foreign is not None:
            raise foreign from None
        if request.interpreter == "builtin" or not plain(request.block_delete, request.controller):
            raise
        try:
            return on_the_part(linuxcnc.read(request), request)
        except InputError as second:
            hint = f"LinuxCNC's interpreter does not read it either: {second}"
            raise ProgramError(
                error.found, expected=error.expected, hint=hint, file=error.file, line=error.line, column=error.column
            ) from None


def _read_built_in(request: Request) -> ReadProgram:
    try:
        return _finished(request, ProgramRun(request))
    except InputError:
        if not uses_variables(request.lines):
            raise
    return replace(_finished(request, ParametricRun(request)), parametric=True)


def _finished(request: Request, run: ProgramRun) -> ReadProgram:
    ending = run.run()
    if not run.state.recorder.cuts:
        raise ProgramError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=request.name)
    return on_the_part(program_of(run, request, ending), request, run.state)


def program_of(run: ProgramRun, request: Request, ending: Sequence[Remark]) -> ReadProgram:
    """What a run made of a program, with the warnings of its end; of a posted one the moves of its own machine."""
    state, frames, warnings = run.state, run.state.frames, [*ending]
    if frames.source == "option" and (request.work_offsets.table[0].given or frames.offsets.table[0].given):
        warnings.append(ORIGIN_WINS)
    moves = state.recorder.moves()
    return ReadProgram(
        name=request.name,
        path=request.path,
        source=request.lines,
        moves=moves,
        origin=pose_in_si(frames.origin),
        origin_source=frames.source,
        unsupported=tuple(state.unsupported),
        warnings=(
            *warnings,
            *state.warnings,
            *lathe_warning(state.turning, moves),
            *millimetre_warning(state, run.lines),
        ),
        assumptions=(START, *state.assumptions),
        tools=tuple(state.used_tools.values()),
        dialect=request.controller.label,
        jumps=tuple(run.jumps),
    )


def on_the_part(program: ReadProgram, request: Request, state: State | None = None) -> ReadProgram:
    """A program with the moves of the tool on the part, if it was posted for another machine; the state at its end."""
    program = _with_feed(program, request)
    if request.controller.kinematics is None:
        return program
    offsets = request.work_offsets if state is None else state.frames.offsets
    check_rotary_offsets(offsets, request.controller.kinematics, program.name)
    tip_held = () if state is None else state.tip_held
    if request.origin is None:
        return recovered(program, request.controller.kinematics, tip_held, request.default_origin, "default")
    return recovered(program, request.controller.kinematics, tip_held, request.origin, "option")


def _with_feed(program: ReadProgram, request: Request) -> ReadProgram:
    """Noted that the first cuts have the feed that was asked for."""
    feed, cuts = request.controller.feed, program.moves.feed[program.moves.motion != RAPID][:1]
    if feed is None or not len(cuts) or abs(mm_per_min_from_m_per_s(float(cuts[0])) - feed) > 1e-9 * feed:
        return program
    assumed = f"cuts before the first feed of the program have {feed:g} mm/min, as asked for"
    return replace(program, assumptions=(*program.assumptions, assumed))


_LENGTHS = re.compile(r"[XYZIJR]\s*[-+]?[\d.]+", re.IGNORECASE)
_LOOKED_AT = 10_000  # lines: a program writes its numbers as it does at its beginning


def millimetre_warning(state: State, lines: Sequence[str]) -> list[Remark]:
    """That numbers which counted increments are written as in mm: X10 beside X5.5, and nothing like `X10.`.

    Where whole numbers are increments, posts end those in mm with their point.
    """
    hint = increments_hint(state)
    if not hint:
        return []
    texts = (split_comments(line)[0] for line in lines[:_LOOKED_AT])
    words = [word for text in texts for word in _LENGTHS.findall(text)]
    whole = next((word for word in words if "." not in word and word.strip("XYZIJRxyzijr+-0 \t")), None)
    if whole is None or not any("." in word for word in words) or any(word[-1] == "." for word in words):
        return []
    return [Remark(f"{whole} stands beside numbers with decimals, and none ends with its point: {hint}")]
