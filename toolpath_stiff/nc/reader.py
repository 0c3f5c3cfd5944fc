"""An NC program or a cutter-location file, from file or text, to `ReadProgram`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.codes.increments import point_warning
from toolpath_stiff.nc.controller import DIALECTS, LANGUAGES, UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.languages import (
    CUTTER_LOCATION_FILE,
    READ,
    foreign_program,
    lathe_warning,
    recognise,
    refused_program,
)
from toolpath_stiff.nc.lines import read_lines, split_lines
from toolpath_stiff.nc.moves import RAPID, Blank, ReadProgram, Remark
from toolpath_stiff.nc.parametric.families import uses_variables
from toolpath_stiff.nc.posted import check_rotary_offsets, recovered
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.request import ORIGIN_WINS, ZERO, Request
from toolpath_stiff.nc.state import START, State
from toolpath_stiff.nc.tables import read_tool_table
from toolpath_stiff.poses import Pose, pose_in_si
from toolpath_stiff.units import m_from_mm, mm_per_min_from_m_per_s

INTERPRETERS = ("builtin", "linuxcnc", "auto")
PARAMETRIC = "variables and jumps"
# What runs a program of a language, loaded where there is such a program: most are plain G code, and are not to wait.
LANGUAGE_RUNS = {
    LANGUAGES["heidenhain"]: ("heidenhain", "HeidenhainRun"),
    LANGUAGES["siemens"]: ("siemens", "SiemensRun"),
}


def reader_of(room: str) -> ModuleType:
    """The reader of cutter-location files, or that by LinuxCNC's interpreter, loaded when it is asked for."""
    return import_module(f"toolpath_stiff.nc.{room}.reader")


def run_of(language: str) -> type[ProgramRun]:
    """What runs programs of a language of `LANGUAGE_RUNS`, or `PARAMETRIC` ones."""
    room, name = LANGUAGE_RUNS.get(language, ("parametric", "ParametricRun"))
    run: type[ProgramRun] = getattr(import_module(f"toolpath_stiff.nc.{room}.run"), name)
    return run


def read_program(
    path: str | Path,
    *,
    tool_table: str | Path | None = None,
    controller: Controller = UNKNOWN_CONTROL,
    origin: Pose | None = None,
    default_origin: Pose = ZERO,
    interpreter: str = "builtin",
    rs274: str | None = None,
) -> ReadProgram:
    """Read an NC program file; the tool table wins over the controller's. Further arguments as of `Request`.

    Examples
    --------
    >>> from importlib.resources import files
    >>> program = read_program(files("toolpath_stiff") / "data" / "programs" / "case_study.nc")
    >>> program
    <ReadProgram case_study.nc: 7 moves, read as generic>
    >>> [tool.number for tool in program.tools]
    [1]
    """
    if tool_table:
        controller = replace(controller, tools=read_tool_table(tool_table))
    lines, name = read_lines(path), Path(path).name
    return read(Request(lines, name, str(path), origin, default_origin, interpreter, rs274, controller=controller))


def parse_program(
    text: str,
    name: str = "program",
    *,
    controller: Controller = UNKNOWN_CONTROL,
    origin: Pose | None = None,
    default_origin: Pose = ZERO,
    interpreter: str = "builtin",
) -> ReadProgram:
    r"""Read an NC program from text; arguments as of `Request`.

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
    return read(Request(split_lines(text, name), name, "", origin, default_origin, interpreter, controller=controller))


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
    native, (language, sign) = request.interpreter == "linuxcnc", recognise(lines, name, request.controller.dialect)
    if native and (language == CUTTER_LOCATION_FILE or language in LANGUAGE_RUNS):
        what = "cutter-location files" if language == CUTTER_LOCATION_FILE else f"{language} ({sign})"
        problem = f"LinuxCNC's interpreter reads no {what}"
        raise ProgramError(problem, expected="--interpreter builtin", file=name)
    if language == CUTTER_LOCATION_FILE:
        return _with_feed(reader_of("cutter_location").read(request), request)
    if language in LANGUAGE_RUNS:
        request = in_language(request, language)
        return _finished(request, run_of(language)(request))
    refused = foreign_program(lines, name) if native else refused_program(lines, name, request.controller.dialect)
    if refused is not None:
        raise refused
    if native:
        request.controller.check_plain()
        return on_the_part(reader_of("linuxcnc").read(request), request)
    try:
        return _read_built_in(request)
    except InputError as error:
        foreign = foreign_program(lines, name, error.line)
        if foreign is not None:
            raise foreign from None
        if request.interpreter == "builtin" or not request.controller.plain:
            raise
        try:
            return on_the_part(reader_of("linuxcnc").read(request), request)
        except InputError as second:
            raise ProgramError(
                error.found,
                expected=error.expected,
                hint=f"LinuxCNC's interpreter does not read it either: {second}",
                file=error.file,
                line=error.line,
                column=error.column,
            ) from None


def in_language(request: Request, language: str) -> Request:
    """The request with the dialect of the program's language, which has a reader."""
    return replace(request, controller=replace(request.controller, dialect=DIALECTS[READ[language]]))


def _read_built_in(request: Request) -> ReadProgram:
    try:
        return _finished(request, ProgramRun(request))
    except InputError:
        if not uses_variables(request.lines):
            raise
    return replace(_finished(request, run_of(PARAMETRIC)(request)), parametric=True)


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
            *point_warning(state, run.lines),
        ),
        assumptions=(START, *state.assumptions),
        tools=tuple(state.used_tools.values()),
        dialect=request.controller.label,
        jumps=tuple(run.jumps),
        stock=blank_of(state.plain.stock),
    )


def blank_of(stock: Mapping[str, Sequence[float]]) -> Blank | None:
    """The corners of BLK FORM in m, where both are whole."""
    corners = [[m_from_mm(v) for v in corner] for corner in stock.values()]
    if len(corners) != 2 or any(map(math.isnan, [*corners[0], *corners[1]])):
        return None
    (a, b, c), (d, e, f) = corners
    return (a, b, c), (d, e, f)


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
