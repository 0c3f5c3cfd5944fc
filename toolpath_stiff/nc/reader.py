"""An NC program or a cutter-location file, from file or text, to `ReadProgram`."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.controller import DIALECTS, LANGUAGES, UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.languages import CUTTER_LOCATION_FILE, READ, foreign_program, recognise, refused_program
from toolpath_stiff.nc.lines import read_lines, split_lines
from toolpath_stiff.nc.moves import CUTTER_LOCATION, RAPID, ReadProgram
from toolpath_stiff.nc.parametric.families import line_with_variables
from toolpath_stiff.nc.posted import check_rotary_offsets, recovered
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.request import ZERO, Request
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import read_tool_table
from toolpath_stiff.poses import Pose
from toolpath_stiff.units import mm_per_min_from_m_per_s

INTERPRETERS = ("builtin", "linuxcnc", "auto")
PARAMETRIC = "variables and jumps"
READ_ELSEWHERE = (*READ, CUTTER_LOCATION_FILE)  # languages with a reader of their own


RUNS = {
    CUTTER_LOCATION_FILE: "cutter_location.reader:CutterLocationRun", LANGUAGES["siemens"]: "siemens.run:SiemensRun",
    LANGUAGES["heidenhain"]: "heidenhain.run:HeidenhainRun", PARAMETRIC: "parametric.run:ParametricRun",
}  # fmt: skip


def run_of(language: str) -> type[ProgramRun]:
    """The class that runs programs of a language, or `PARAMETRIC` ones; imported on demand: most are plain G code."""
    module, name = RUNS[language].split(":")
    run: type[ProgramRun] = getattr(import_module(f"toolpath_stiff.nc.{module}"), name)
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
    """Read an NC program file; the tool table overrides the controller's. Other arguments as for `Request`.

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
    r"""Read an NC program from text; arguments as for `Request`.

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
    """A program read by the chosen interpreter: the built-in one, LinuxCNC's, or LinuxCNC's where the first refuses.

    Raises
    ------
    InputError
        With file, line and column, what was found and what was expected.
    """
    lines, name, (language, sign) = request.lines, request.name, recognised(request)
    native = request.interpreter == "linuxcnc"
    if native and language in READ_ELSEWHERE:
        what = "cutter-location files" if language == CUTTER_LOCATION_FILE else f"{language} ({sign})"
        problem = f"LinuxCNC's interpreter reads no {what}"
        raise ProgramError(problem, expected="--interpreter builtin", file=name)
    if language in READ_ELSEWHERE:
        request = in_language(request, language)
        return _finished(request, run_of(language)(request))
    refused = foreign_program(lines, name) if native else refused_program(lines, name, request.controller.dialect)
    if refused is not None:
        raise refused
    if native:
        request.controller.check_plain()
        return by_linuxcnc(request)
    try:
        return _read_built_in(request)
    except InputError as error:
        foreign = foreign_program(lines, name, error.line)
        if foreign is not None:
            raise foreign from None
        if request.interpreter == "builtin" or not request.controller.plain:
            raise
        try:
            return by_linuxcnc(request)
        except InputError as second:
            raise ProgramError(
                error.found,
                expected=error.expected,
                hint=f"LinuxCNC's interpreter does not read it either: {second}",
                file=error.file,
                line=error.line,
                column=error.column,
            ) from None


def recognised(request: Request) -> tuple[str, str]:
    """The language of a program, and its sign. Raises `InputError` for an empty one, or an unknown interpreter."""
    if request.interpreter not in INTERPRETERS:
        raise ProgramError(f"interpreter {request.interpreter!r}", expected=", ".join(INTERPRETERS))
    if not any(line.strip() for line in request.lines):
        raise ProgramError("the program is empty", expected="an NC program", file=request.name)
    return recognise(request.lines, request.name, request.controller.dialect)


def in_language(request: Request, language: str) -> Request:
    """The request with the dialect of the program's language, if that language is a dialect."""
    dialect = DIALECTS[READ[language]] if language in READ else request.controller.dialect
    return replace(request, controller=replace(request.controller, dialect=dialect))


def by_linuxcnc(request: Request) -> ReadProgram:
    """A program read by LinuxCNC's interpreter."""
    from toolpath_stiff.nc.linuxcnc.reader import read as read_by_linuxcnc

    return on_the_part(read_by_linuxcnc(request), request)


def _read_built_in(request: Request) -> ReadProgram:
    try:
        return _finished(request, ProgramRun(request))
    except InputError:
        if not line_with_variables(request.lines):
            raise
    return replace(_finished(request, run_of(PARAMETRIC)(request)), parametric=True)


def _finished(request: Request, run: ProgramRun) -> ReadProgram:
    ending = run.run()
    if not run.state.recorder.cuts:
        raise no_cut(run)
    return on_the_part(run.program(ending), request, run.state)


def no_cut(run: ProgramRun) -> ProgramError:
    """The error for a program without a cut."""
    return ProgramError("no cutting move", expected=run.cuts_by, file=run.name)


def on_the_part(program: ReadProgram, request: Request, state: State | None = None) -> ReadProgram:
    """A program with moves of the tool on the part, if posted for another machine; `state`: that at its end."""
    program = _with_feed(program, request)
    if request.controller.kinematics is None or program.dialect == CUTTER_LOCATION:
        return program
    offsets = request.work_offsets if state is None else state.frames.offsets
    check_rotary_offsets(offsets, request.controller.kinematics, program.name)
    tip_held = () if state is None else state.tip_held
    if request.origin is None:
        return recovered(program, request.controller.kinematics, tip_held, request.default_origin, "default")
    return recovered(program, request.controller.kinematics, tip_held, request.origin, "option")


def _with_feed(program: ReadProgram, request: Request) -> ReadProgram:
    """The program with a note that its first cuts have the requested feed."""
    feed, cuts = request.controller.feed, program.moves.feed[program.moves.motion != RAPID][:1]
    if feed is None or not len(cuts) or abs(mm_per_min_from_m_per_s(float(cuts[0])) - feed) > 1e-9 * feed:
        return program
    assumed = f"cuts before the first feed of the program have {feed:g} mm/min, as asked for"
    return replace(program, assumptions=(*program.assumptions, assumed))
