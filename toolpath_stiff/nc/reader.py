"""An NC program or a cutter-location file, from file or text, to `Program`.

Programs in other languages than G code are recognised by their first lines and refused by name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.codes.points import increments_hint
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, Dialect, Switches, check_plain, plain
from toolpath_stiff.nc.kinematics import PostedKinematics
from toolpath_stiff.nc.lathes import lathe_program, lathe_warning
from toolpath_stiff.nc.moves import RAPID, Moves, Program
from toolpath_stiff.nc.operations import split_comments
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.request import ORIGIN_WINS, ZERO, Request
from toolpath_stiff.nc.state import START, State
from toolpath_stiff.nc.tables import Offsets, ToolEntry, read_offsets, read_tool_table
from toolpath_stiff.nc.words import HEAD_LINES, looks_like_cutter_location, read_lines, split_lines
from toolpath_stiff.units import Pose, mm_per_min_from_m_per_s, pose_in_si

_HEIDENHAIN = "Heidenhain's conversational language"


_SIEMENS = "Siemens' own language (Sinumerik)"


_ISG = "ISG's own language (Beckhoff TwinCAT CNC)"


_ACRAMATIC = "the language of Acramatic controls (Cincinnati, Vickers)"


_SUB = "neither LinuxCNC's language (o<name> sub) nor Fanuc's"


HINTS = {
    _HEIDENHAIN: "post it as ISO G code, in X, Y, Z, A, B, C of the tool tip",
    _SIEMENS: "post it as ISO G code: no frames (TRANS, ROT), no CYCLE calls, no variables, no X=... words",
    _ISG: "post it as ISO G code: no # commands, no $IF, no V. variables",
    _ACRAMATIC: "post it as ISO G code of Fanuc's or LinuxCNC's kind",
    _SUB: "post it as ISO G code, or write its subprograms as LinuxCNC's O words",
}


LONGEST_SIGN = 200  # characters of a line that are looked at


# What no G code of the controls read here has at the beginning of a block, blanks and N words apart.
_SIGNS = (
    (_HEIDENHAIN, r"BEGIN\s+PGM\b"),
    (_HEIDENHAIN, r"(?:L|LN|C|CC|CR|CT|RND|CHF)\s[^(;]*\bF\s*MAX\b|C\s+I?[A-Z][+-][^(;]*\bDR[+-]"),
    (_HEIDENHAIN, r"(?:L|CC|LN)\s+I?[XYZABC][+-]"),
    (_HEIDENHAIN, r"TOOL\s+(?:CALL|DEF)\b|CYCL\s+(?:DEF|CALL)\b|BLK\s+FORM\b|CALL\s+LBL\b|LBL\s+\d|PLANE\s+[A-Z]+"),
    (_SIEMENS, r";\s*\$PATH\s*=|%_N_\w+_(?:MPF|SPF)\b"),
    (_SIEMENS, r"DEF\s+(?:REAL|INT|BOOL|STRING|CHAR|AXIS|FRAME)\b|PROC\s+\w+|EXTERN\s+\w+"),
    (_SIEMENS, r"MSG\s*\(|(?:CYCLE|POCKET|SLOT|HOLES)\d+\s*\(|WORKPIECE\s*\("),
    (_SIEMENS, r"A?(?:TRANS|ROT|SCALE|MIRROR)(?:\s|;|$)|TRAORI\b|TRAFOOF\b|SUPA\b|D?R\d+\s*="),
    (_ISG, r"#\s*SLOPE\b|SLOPE\s*\[|#\s*(?:TRAFO|HSC|RTCP|CS|MCS|SCALE)\s+(?:ON|OFF)\b|\$(?:IF|FOR|WHILE|ENDIF)\b"),
    (_ACRAMATIC, r":?\s*\(\s*PGM\s*,\s*NAME\s*="),
    (_SUB, r"SUB\s+\w+\s*\["),
    (_SIEMENS, r"(?:[A-Z]++[\d.+-]*+\s++)*(?:T\s*=\s*\"|[XYZABCIJKFS]\d?\s*=|CR\s*=|(?:A3|B3|C3|AP|RP)\s*=)"),
)


@cache
def _patterns() -> tuple[tuple[str, re.Pattern[str]], ...]:
    """Language and pattern of each sign: most programs need none of them."""
    number = r"\s*(?:N\d+\s+|\d+\s+)?"
    return tuple((what, re.compile(f"{number}(?:{sign})", re.IGNORECASE)) for what, sign in _SIGNS)


def language_of(line: str) -> str | None:
    """The other language that a line is written in, or None.

    Examples
    --------
    >>> language_of("L X+10 Y+20 R0 F MAX")
    "Heidenhain's conversational language"
    >>> language_of("G1 X10 Y20")
    """
    head = line.lstrip()[:LONGEST_SIGN]
    return next((what for what, pattern in _patterns() if pattern.match(head)), None)


def foreign_program(lines: tuple[str, ...], name: str, suspect: int | None = None) -> InputError | None:
    """The error for a program in another language; `suspect` is a line (from 1) that could not be read as G code."""
    places = list(range(min(HEAD_LINES, len(lines))))
    if suspect is not None and 0 < suspect <= len(lines):
        places.append(suspect - 1)
    for at in places:
        what = language_of(lines[at])
        if what is not None:
            return Place(name, at + 1).fail(
                f"{lines[at].strip()[:40]!r} is {what}, which is not read", "G code", HINTS[what]
            )
    return None


def refused_program(lines: tuple[str, ...], name: str, dialect: Dialect) -> InputError | None:
    """The error for a program in another language, or for a lathe; LinuxCNC's lathes have X as a position."""
    foreign = foreign_program(lines, name)
    return foreign if foreign is not None or dialect.name == "linuxcnc" else lathe_program(lines, name)


INTERPRETERS = ("builtin", "linuxcnc", "auto")


def read_program(
    path: str | Path,
    *,
    origin: Iterable[float] | None = None,
    default_origin: Iterable[float] = ZERO,
    offsets_file: str | Path | None = None,
    tool_table: str | Path | None = None,
    block_delete: Switches = False,
    interpreter: str = "builtin",
    rs274: str | None = None,
    unconfined: bool = False,
    controller: Controller = UNKNOWN_CONTROL,
) -> Program:
    """Read an NC program file to its moves in the set-up frame.

    Parameters
    ----------
    path
        The program.
    origin, default_origin
        Where program zero (G54) sits in machine coordinates, x, y, z in m, A, B, C in rad: as asked for, and
        where neither the caller nor the program says so. Only moves in machine coordinates (G53, G28, G30) depend on
        it.
    offsets_file
        Work offsets: `G55 = [x, y, z, a, b, c, r]` (mm, degrees) or a LinuxCNC parameter file.
    tool_table
        Tool lengths: a LinuxCNC tool table or CSV.
    block_delete
        Leave out blocks that begin with a slash: True, all of them; switches 1 to 9, those of theirs (`/` is `/1`);
        False, those of the controller file's.
    interpreter
        "builtin"; "linuxcnc", LinuxCNC's own (`rs274`); "auto", the first and, where it refuses, the second.
    rs274
        Path of the program `rs274`, if it is not on PATH.
    unconfined
        Run it even where bubblewrap, which keeps it from all files but its own, cannot be used.
    controller
        Dialect, block-delete switches, work offsets and tools of the control, and the kinematics that the program was
        posted for; the two files above win over its tables.

    Raises
    ------
    InputError
        With file, line and column, what was found and what was expected.

    Examples
    --------
    >>> from importlib.resources import files
    >>> program = read_program(files("toolpath_stiff") / "data" / "programs" / "case_study.nc")
    >>> program
    <Program case_study.nc: 7 moves, read as generic>
    >>> [tool.number for tool in program.tools]
    [1]
    """
    lines, place = read_lines(path), None if origin is None else _six(origin)
    offsets = read_offsets(offsets_file) if offsets_file else controller.offsets or Offsets()
    tools = read_tool_table(tool_table) if tool_table else controller.tools
    options = (offsets, tools, block_delete, interpreter, rs274, unconfined, controller)
    return _read(Request(lines, Path(path).name, str(path), place, _six(default_origin), *options))


def parse_program(
    text: str,
    name: str = "program",
    *,
    origin: Iterable[float] | None = None,
    default_origin: Iterable[float] = ZERO,
    offsets: Offsets | None = None,
    tools: dict[int, ToolEntry] | None = None,
    block_delete: Switches = False,
    interpreter: str = "builtin",
    rs274: str | None = None,
    unconfined: bool = False,
    controller: Controller = UNKNOWN_CONTROL,
) -> Program:
    r"""Read an NC program from text; parameters as in `read_program`, tables as read by `nc.tables`.

    Examples
    --------
    >>> program = parse_program("G21 G90 F600\nG0 Z5\nG1 Z-1\nG2 X20 Y0 I10 J0\nM8\nM30\n", "slot.nc")
    >>> program
    <Program slot.nc: 3 moves, read as generic>
    >>> [(note.line, note.word, note.reason) for note in program.unsupported]
    [(5, 'M8', 'coolant')]

    What cannot be read is refused, with its place and what to do:

    >>> parse_program("G21 G90\nG1 X10\n", "slot.nc")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    toolpath_stiff.errors.ProgramError: slot.nc:2:1: G1 is a feed move before any feed; expected F above 0, ...
    """
    lines, place = split_lines(text, name), None if origin is None else _six(origin)
    offsets, tools = offsets or controller.offsets or Offsets(), controller.tools if tools is None else tools
    options = (offsets, tools, block_delete, interpreter, rs274, unconfined, controller)
    return _read(Request(lines, name, "", place, _six(default_origin), *options))


def _read(request: Request) -> Program:
    """Choose the interpreter: the built-in one, LinuxCNC's, or that where the first refuses."""
    lines, name = request.lines, request.name
    if request.interpreter not in INTERPRETERS:
        raise ProgramError(f"interpreter {request.interpreter!r}", expected=", ".join(INTERPRETERS))
    if not any(line.strip() for line in lines):
        raise ProgramError("the program is empty", expected="an NC program", file=name)
    if looks_like_cutter_location(lines, name):
        return _read_cutter_location(request)
    native = request.interpreter == "linuxcnc"
    refused = foreign_program(lines, name) if native else refused_program(lines, name, request.controller.dialect)
    if refused is not None:
        raise refused
    if native:
        check_plain(request.block_delete, request.controller)
        return _read_by_linuxcnc(request)
    try:
        return _read_built_in(request)
    except InputError as error:
        foreign = foreign_program(lines, name, error.line)
        if foreign is not None:
            raise foreign from None
        if request.interpreter == "builtin" or not plain(request.block_delete, request.controller):
            raise
        return _second_opinion(error, request)


def _read_cutter_location(request: Request) -> Program:
    from toolpath_stiff.nc.cutter_location import reader as cutter_location

    if request.interpreter == "linuxcnc":
        found = "LinuxCNC's interpreter reads no cutter-location files"
        raise ProgramError(found, expected="--interpreter builtin", file=request.name)
    program = cutter_location.read(request)
    said = feed_assumption(request.controller, program.moves)
    return replace(program, assumptions=(*program.assumptions, *said)) if said else program


def _second_opinion(error: InputError, request: Request) -> Program:
    """What the built-in interpreter refused with `error`, by the second one if it is there and the program harmless."""
    from toolpath_stiff.nc.linuxcnc.reader import refusal
    from toolpath_stiff.nc.linuxcnc.runner import find_rs274

    refused = refusal(request.lines, request.name)
    if refused is not None:
        raise refused from None
    try:
        find_rs274(request.rs274, request.unconfined)
    except InputError as missing:
        raise ProgramError(
            error.found,
            expected=error.expected,
            hint=f"LinuxCNC's interpreter may read it: {missing.hint}",
            file=error.file,
            line=error.line,
            column=error.column,
        ) from None
    return _read_by_linuxcnc(request)


def _read_by_linuxcnc(request: Request) -> Program:
    from toolpath_stiff.nc.linuxcnc.reader import read

    program = read(request)
    assumed = feed_assumption(request.controller, program.moves)
    program = replace(program, assumptions=(*program.assumptions, *assumed))
    return program if request.posted is None else _on_the_part(program, request, request.posted, (), request.offsets)


def _read_built_in(request: Request) -> Program:
    try:
        return _run_built_in(request, ProgramRun)
    except InputError:
        from toolpath_stiff.nc.parametric.statements import uses_variables

        if not uses_variables(request.lines):
            raise
    from toolpath_stiff.nc.parametric.run import ParametricRun

    return replace(
        _run_built_in(request, partial(ParametricRun, folder=request.controller.subprograms)), parametric=True
    )


def _run_built_in(
    request: Request, begin: Callable[[State, tuple[str, ...], str, frozenset[int]], ProgramRun]
) -> Program:
    run = begin(request.start(), request.lines, request.name, request.switches)
    posted, state, frames, warnings = request.posted, run.state, run.state.frames, run.run()
    if not state.recorder.cuts:
        raise ProgramError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=request.name)
    g54 = request.offsets.table[0].given or frames.offsets.table[0].given
    if frames.source == "option" and g54:
        warnings.append(ORIGIN_WINS)
    moves, more, assumptions = conclusions(run, request.controller)
    assert moves is not None
    program = Program(
        name=request.name,
        path=request.path,
        source=request.lines,
        moves=moves,
        origin=pose_in_si(frames.origin),
        origin_source=frames.source,
        unsupported=tuple(state.unsupported),
        warnings=(*warnings, *more),
        assumptions=(START, *assumptions),
        tools=tuple(state.used_tools.values()),
        dialect=request.controller.label,
        jumps=tuple(run.jumps),
    )
    if posted is None:
        return program
    return _on_the_part(program, request, posted, state.tip_held, frames.offsets)


def conclusions(run: ProgramRun, controller: Controller) -> tuple[Moves | None, list[str], list[str]]:
    """Moves of a run that has ended, None if there are none; its warnings and assumptions."""
    state = run.state
    moves = state.recorder.moves() if len(state.recorder) else None
    warnings = [*state.warnings, *lathe_warning(state.turning, moves), *millimetre_warning(state, run.lines)]
    return moves, warnings, [*state.assumptions, *feed_assumption(controller, moves)]


_LENGTHS = re.compile(r"[XYZIJR]\s*[-+]?[\d.]+", re.IGNORECASE)


_LOOKED_AT = 10_000  # lines: a program writes its numbers as it does at its beginning


def millimetre_warning(state: State, lines: Sequence[str]) -> list[str]:
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
    return [f"{whole} stands beside numbers with decimals, and none ends with its point: {hint}"]


def feed_assumption(controller: Controller, moves: Moves | None) -> list[str]:
    """That the first cuts have the feed that was asked for."""
    if controller.feed is None or moves is None:
        return []
    cuts = moves.feed[moves.motion != RAPID][:1]
    if not len(cuts) or abs(mm_per_min_from_m_per_s(float(cuts[0])) - controller.feed) > 1e-9 * controller.feed:
        return []
    return [f"cuts before the first feed of the program have {controller.feed:g} mm/min, as asked for"]


def _on_the_part(
    program: Program,
    request: Request,
    posted: PostedKinematics,
    tip_held: Sequence[tuple[int, bool]],
    offsets: Offsets,
) -> Program:
    """A program as read for the machine that it was posted for, with the moves of the tool on the part."""
    from toolpath_stiff.nc.posted import check_rotary_offsets, recovered

    check_rotary_offsets(offsets, posted, program.name)
    if request.origin is None:
        return recovered(program, posted, tip_held, request.default_origin, "default")
    return recovered(program, posted, tip_held, request.origin, "option")


def _six(origin: Iterable[float]) -> Pose:
    x, y, z, a, b, c = origin
    return (x, y, z, a, b, c)
