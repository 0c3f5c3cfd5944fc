"""Cutter-location files: the points, tool axes and feeds that CAM systems hand to post processors, in APT's words.

Here is the table of words: word to function, meaning, who writes it, source; and how it is used. A word that acts is
a row beside its function in `modes` and `motion`; those that need no function of their own, because they are listed,
doubted or refused, are rows here. A function takes the `state` and a statement; `state` splits lines into
statements and makes moves of what `geometry` computes.

A file is read to `Program`, the same contract as the reader of G code, or checked, with all its errors.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import groupby

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.cutter_location.geometry import AxisError
from toolpath_stiff.nc.cutter_location.modes import COMPENSATION, HEADING, MODE_WORDS, TOOL, TOOL_CENTRE, one_frame
from toolpath_stiff.nc.cutter_location.motion import CYCLE_WORDS, MOTION_WORDS, to_point
from toolpath_stiff.nc.cutter_location.state import (
    ALL,
    APT,
    CAMPLETE,
    CATIA,
    CREO,
    DASSAULT,
    DOUBTFUL,
    ISO,
    LISTED,
    MANUALS,
    NX,
    POSTS,
    PTC,
    READ,
    REFUSED,
    SIEMENS,
    VERICUT,
    Act,
    State,
    Statement,
    Word,
    frame_in_comment,
    is_number,
    plain_point,
    read_statement,
)
from toolpath_stiff.nc.geometry import ArcError
from toolpath_stiff.nc.moves import CUTTER_LOCATION, Program, Unsupported
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import any_statement
from toolpath_stiff.units import Pose

NO_CUT = "no cutting move"
NO_UNITS = "the file names no UNITS; its numbers are taken as mm"

# CATIA's heading of an operation, a comment; NX and Autodesk's posts have TOOL PATH/ and CSI_TOOL_PATH/.
OPERATION = re.compile(r"\s*\$\$\s*OPERATION NAME\s*:\s*(.*\S)", re.IGNORECASE)
PACKED_AT = 50_000  # moves
OnError = Callable[[InputError], None]
OnWord = Callable[[str, int], None]
GEOMETRY = "points, tool axes and feeds alone"
UNKNOWN = "is not known"

# An unknown word that begins like one of a motion or a feed, or that carries a point, is not passed over.
LIKE_MOTION = ("GO", "RAP", "FED", "CIR", "ARC", "MOV", "HEL", "CYC", "TLA", "TLO", "TLL", "TLR", "UNI", "MUL", "FRO")
NUMBERS_OF_A_POINT = 3
LIKE_G_CODE = re.compile(r"[A-Z]-?[\d.]+")


def not_for(controller: Controller, offsets_given: bool, block_delete: bool) -> tuple[str, ...]:
    """Warnings about what was asked for and means nothing to a cutter-location file."""
    given = (
        ("a dialect", controller.dialect.name != "generic"),
        ("work offsets", offsets_given),
        ("posted kinematics", controller.kinematics is not None),
        ("block-delete switches", block_delete or bool(controller.switches)),
        ("posted kinematics", controller.kinematics is not None),
    )
    return tuple(f"{what} mean nothing to a cutter-location file and are not used" for what, asked in given if asked)


def read(
    lines: tuple[str, ...],
    name: str,
    path: str,
    origin: Pose | None,
    default_origin: Pose,
    tools: dict[int, ToolEntry] | None,
    warnings: tuple[str, ...] = (),
    feed: float | None = None,
) -> Program:
    """Read a cutter-location file.

    Parameters
    ----------
    lines, name, path
        The file's lines; its name for messages; where it lies.
    origin, default_origin
        Where program zero sits, m and rad: as asked for, and where neither the caller nor the program says so.
    tools
        Tool table; its lengths win over the file's.
    warnings
        Warnings of the reader, which come first.
    feed
        Of cuts before the first FEDRAT, mm/min; None: they are refused.

    Raises
    ------
    InputError
        With line and column, what was found and what was expected.

    Examples
    --------
    >>> lines = ("UNITS/MM", "FEDRAT/600,MMPM", "FROM/0,0,50", "GOTO/0,0,0", "GOTO/40,0,0", "FINI")
    >>> read(lines, "part.apt", "", None, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), None)
    <Program part.apt: 2 moves, read as cutter-location file>
    """
    state = State(name, copy.deepcopy(tools), feed=feed)
    run(state, lines)
    if not state.recorder.cuts:
        raise _no_cut(name)
    return Program(
        name=name,
        path=path,
        source=lines,
        moves=state.recorder.moves(),
        origin=default_origin if origin is None else origin,
        origin_source="default" if origin is None else "option",
        unsupported=unsupported(state),
        warnings=(*warnings, *state.warnings),
        assumptions=tuple(state.assumptions),
        tools=tuple(state.used_tools.values()),
        dialect=CUTTER_LOCATION,
        marks=tuple(state.marks),
    )


def _no_cut(name: str) -> InputError:
    return ProgramError(NO_CUT, expected="GOTO/ after FEDRAT/, not after RAPID", file=name)


# -- running -----------------------------------------------------------------------------------------------------------


def run(state: State, lines: tuple[str, ...], on_error: OnError | None = None, on_word: OnWord | None = None) -> None:
    """Execute all lines in order.

    Parameters
    ----------
    state
        What is in force; it goes on from there.
    lines
        The file's.
    on_error
        Called with an error, after which the next statement is executed; without it errors are raised.
    on_word
        Called with the word and line of every statement.
    """
    at = 0
    while at < len(lines) and not state.ended:
        if len(state.recorder.line) > PACKED_AT:
            state.recorder.pack()
        here = at
        try:
            statement: Statement | None = Statement(at + 1, 1, "GOTO")
            point = plain_point(lines[at])
            if point is None:
                statement, at = read_statement(lines, at, state.name)
            else:
                at += 1
            if statement is None:
                _comment(state, lines, here)
            else:
                if on_word is not None:
                    on_word(statement.word, statement.line)
                _perform(state, statement, point)
        except InputError as error:
            if state.last_word == "END" and not any_statement(lines[here:]):  # notes that a CAM system writes behind it
                state.warnings.append(f"line {here + 1}: what follows END is no statement, and not read")
                break
            _pass_on(error, on_error)
            at = max(at, here + 1)
    if state.ended and any(line.strip() and not line.lstrip().startswith("$$") for line in lines[at:]):
        state.warnings.append(f"line {at}: FINI ends the file; what follows is not read")
    try:
        state.no_circle("the end of the file")
    except InputError as error:
        _pass_on(error, on_error)
    _conclude(state)


def _pass_on(error: InputError, on_error: OnError | None) -> None:
    if on_error is None:
        raise error
    on_error(error)


def _perform(state: State, statement: Statement, point: list[float] | None) -> None:
    """Execute a statement, whose numbers are known if it is a plain GOTO; geometry's errors get its place."""
    state.statement = statement
    try:
        if point is None:
            execute(state, statement)
        else:
            to_point(state, point)
    except (ArcError, AxisError) as error:
        raise state.fail(error.found, error.expected) from None
    state.last_word = statement.word or state.last_word


def _comment(state: State, lines: tuple[str, ...], at: int) -> None:
    """What CAM systems say in comments: CATIA's operations, CATIA's and Creo's coordinate systems."""
    found = OPERATION.match(lines[at])
    if found:
        state.marks.append((at + 1, found[1]))
        return
    frame = frame_in_comment(lines, at)
    if frame is not None:
        state.statement = Statement(at + 1, 1, frame[0])
        one_frame(state, *frame, lines[at].strip()[:40])


def _conclude(state: State) -> None:
    """Warnings about the file as a whole."""
    if not state.units_said and len(state.recorder):
        state.assume(NO_UNITS)
    for noted in state.doubtful.values():
        statement = noted.statement
        state.warnings.append(f"line {statement.line}: {statement.shown}: {noted.reason}{noted.times}")
    if state.unsmooth and not state.smooth:
        state.warnings.append(
            f"line {state.first_unsmooth}: the tool turns back where this arc begins, and no arc of the file begins "
            "smoothly: check that the arcs turn the right way about their axes"
        )


def unsupported(state: State) -> tuple[Unsupported, ...]:
    """Words that were not acted upon, in the order of the file, each once."""
    both = sorted({**state.noted, **state.doubtful}.values(), key=lambda noted: noted.statement.line)
    return tuple(
        Unsupported(noted.statement.line, noted.statement.column, noted.statement.word, f"{noted.reason}{noted.times}")
        for noted in both
    )


# -- checking ----------------------------------------------------------------------------------------------------------


@dataclass
class CheckedCutterLocation:
    """A cutter-location file read with all its errors.

    Attributes
    ----------
    state
        After the last statement.
    start, end
        What was in force before the first and after the last.
    errors
        Those found.
    used
        Words to the line where they stand first and how often.
    """

    state: State
    start: dict[str, str]
    end: dict[str, str] = field(default_factory=dict)
    errors: list[InputError] = field(default_factory=list)
    used: dict[str, list[int]] = field(default_factory=dict)

    def meanings(self) -> list[tuple[str, str, int, int]]:
        """Words used: word, meaning, first line, count."""
        return [(word, meaning_of(word), line, count) for word, (line, count) in self.used.items()]


def check(
    lines: tuple[str, ...],
    name: str,
    tools: dict[int, ToolEntry] | None,
    most_errors: int,
    feed: float | None = None,
) -> CheckedCutterLocation:
    """Check a cutter-location file: it goes on where `read` would stop, up to so many errors."""
    state = State(name, copy.deepcopy(tools), feed=feed)
    checked = CheckedCutterLocation(state, in_force(state))

    def on_error(error: InputError) -> None:
        checked.errors.append(error)
        if len(checked.errors) >= most_errors:
            raise error

    def on_word(word: str, line: int) -> None:
        if word in checked.used:
            checked.used[word][1] += 1
        elif word:
            checked.used[word] = [line, 1]

    try:
        run(state, lines, on_error, on_word)
    except InputError as error:
        if error not in checked.errors:
            checked.errors.append(error)
    if not checked.errors and not state.recorder.cuts:
        checked.errors.append(_no_cut(name))
    checked.end = in_force(state)
    return checked


def in_force(state: State) -> dict[str, str]:
    """What is in force, names to words."""
    i, j, k = state.next_axis
    feed = "none" if state.feed is None else f"{state.feed:g} mm/{'rev' if state.per_revolution else 'min'}"
    return {
        "units": "mm" if state.scale == 1.0 else "inch",
        "tool axis": f"{i:g} {j:g} {k:g}",
        "MULTAX": {None: "not given", True: "on", False: "off"}[state.multax],
        "feed": feed,
        "spindle": f"{state.speed:g} rpm",
        "tool": str(state.tool),
        "tool length": "reference" if math.isnan(state.tool_length) else f"{state.tool_length:g} mm",
        "cycle": "off" if state.cycle is None else "on",
    }


# -- words without a function of their own -----------------------------------------------------------------------------


def listed(reason: str) -> Act:
    """What a word does that changes nothing of the path."""
    return lambda state, statement: state.note(state.noted, reason)


def doubted(reason: str) -> Act:
    """What a word does that depends on the machine: it is listed, and a warning."""
    return lambda state, statement: state.note(state.doubtful, reason)


def refused(what: str, hint: str) -> Act:
    """What a word does that changes the path in a way that is not supported."""

    def act(state: State, statement: Statement) -> None:
        raise state.fail(f"{statement.shown} {what}, which is not supported", GEOMETRY, hint)

    return act


_TOLERANCE = "a tolerance of the CAM system: the points are taken as they stand"
_STOP = "a stop: the path goes on"
_SCREEN = "for the CAM system's screen"
_OUTPUT = "about the output of the post processor"

# Meaning, who writes them, source, words.
_LISTED = (
    (HEADING, ALL, ISO, "PARTNO PPRINT REMARK LETTER"),
    (HEADING, "", APT, "TITLES TITLE"),
    (HEADING, CATIA, DASSAULT, "TPRINT"),
    (HEADING, CREO, PTC, "MFGNO"),
    (HEADING, NX, SIEMENS, "END-OF-PATH"),
    (_TOLERANCE, ALL, VERICUT, "INTOL OUTTOL TOLER LINTOL THICK MCHTOL"),
    (_TOLERANCE, "", APT, "OUTOL MAXDP NUMPTS"),
    (_STOP, ALL, ISO, "STOP OPSTOP END BREAK"),
    (_SCREEN, NX, SIEMENS, "PAINT"),
    (_SCREEN, "", VERICUT, "DISPLY PLOT VERIFY CLPRNT"),
    (TOOL, NX, SIEMENS, "SELECT"),
    (TOOL, "", VERICUT, "SELCTL SELECTL TLCHG OFSTNO"),
    (TOOL, "", MANUALS, "TOOL HEAD SWITCH"),
    (_OUTPUT, ALL, ISO, "MACHIN SEQNO LEADER TMARK REWIND"),
    (_OUTPUT, "", MANUALS, "CHANNEL NOPOST CLDATA PROGRM"),
    ("for CAMplete", CAMPLETE, POSTS, "CSI_PROGRAM_COMMENT CSI_SET_PATH_PARAM CSI_PATH_TOLERANCE"),
    (TOOL, CAMPLETE, POSTS, "CSI_SET_FLUTE_LENGTH"),
    ("coolant", ALL, ISO, "COOLNT FLUSH"),
    ("a plane to retract to, of which nothing is made without RETRCT", "", ISO, "CLEARP CLRSRF"),
    ("the part surface; the points have its height already", CATIA, DASSAULT, "AUTOPS PSIS"),
    ("clamps of machine axes", "", ISO, "CLAMP UNCLMP"),
)
_BLOCK = "a block for the control as it stands: what it does is not known"
_DOUBTFUL = (
    ("an M code of one control: what it does is not known", "", ISO, "AUXFUN"),
    ("a G code of one control: what it does is not known", "", ISO, "PREFUN"),
    (_BLOCK, "", ISO, "INSERT"),
    (_BLOCK, CAMPLETE, POSTS, "CSI_INSERT_CUSTOM_GCODE"),
    ("statements that the operator may leave out: they are read", "", ISO, "OPSKIP"),
)
_WHERE_CUT = "have the CAM system write the points where they are cut"
_POINT, _POINTS = "have the CAM system write the point", "have the CAM system write points"
_ONE_SYSTEM = "have the CAM system write points and tool axes in one system"
_OUT = "have the CAM system write the points out"
_DRIVE, _PROCESSOR = "is driven along surfaces", "give the file of points that APT's processor writes"

# What they do, what to do, source, words.
_REFUSED = (
    ("changes where all that follows lies", _WHERE_CUT, APT, "TRACUT MIRROR SCALE"),
    ("turns the work or the head of one machine", _ONE_SYSTEM, ISO, "PIVOTZ"),
    ("repeats or calls a part of the file", _OUT, APT, "COPY CALL CALSUB DEFSUB ENDSUB MACRO TERMAC LOOPST JUMPTO"),
    ("repeats or calls a part of the file", _OUT, MANUALS, "CALLSUB"),
    (_DRIVE, _PROCESSOR, APT, "TLLFT TLRGT TLON TLONPS TLOFPS TLNDON"),
    (_DRIVE, _PROCESSOR, APT, "GO GOFWD GOBACK GOLFT GORGT GOUP GODOWN OFFSET POCKET SCURV"),
    (f"is {COMPENSATION}", TOOL_CENTRE, MANUALS, "TLCOMP"),
    ("feeds the tool to where a post processor knows", _POINT, MANUALS, "PLUNGE"),
    ("retracts the tool to a plane of the post processor's", _POINT, ISO, "RETRCT"),
    ("cuts a thread", "leave threading out", ISO, "THREAD"),
    ("is an arc of one post processor", "have the CAM system write CIRCLE/ or points", VERICUT, "ARC"),
    ("is a NURBS curve", _POINTS, SIEMENS, "NURBS"),
    ("is a spline", _POINTS, MANUALS, "SPLINE"),
    ("is a polynomial", _POINTS, MANUALS, "POLYNO"),
)
TURNS = "turns the work or the head of one machine"


def turn(state: State, statement: Statement) -> None:
    """A rotary axis: listed where it turns by nothing, or goes to 0; refused otherwise."""
    numbers = [argument for argument in statement.arguments if is_number(argument.text)]
    if not numbers or any(state.number(number) for number in numbers):
        raise state.fail(f"{statement.shown} {TURNS}, which is not supported", GEOMETRY, _ONE_SYSTEM)
    state.note(state.noted, "a rotary axis that stays at 0")


TURN_WORDS = tuple(
    Word(name, turn, TURNS, "", source, "/angle other than 0", REFUSED)
    for names, source in (("ROTABL ROTHED", ISO), ("ROTATE TABLE INDEX TILT", MANUALS))
    for name in names.split()
)
LISTED_WORDS = tuple(
    Word(name, listed(meaning), meaning, by, source, kind=LISTED)
    for meaning, by, source, names in _LISTED
    for name in names.split()
)
DOUBTFUL_WORDS = tuple(
    Word(name, doubted(meaning), meaning, by, source, kind=DOUBTFUL)
    for meaning, by, source, names in _DOUBTFUL
    for name in names.split()
)
REFUSED_WORDS = tuple(
    Word(name, refused(what, hint), what, "", source, kind=REFUSED)
    for what, hint, source, names in _REFUSED
    for name in names.split()
)


# -- the table ---------------------------------------------------------------------------------------------------------


def table(words: Iterable[Word]) -> dict[str, Word]:
    """Name to word. Raises `ValueError` for a name that is there twice."""
    found: dict[str, Word] = {}
    for word in words:
        if word.name in found:
            raise ValueError(f"{word.name} is in the table twice")
        found[word.name] = word
    return found


WORDS = table((*MOTION_WORDS, *CYCLE_WORDS, *MODE_WORDS, *TURN_WORDS, *LISTED_WORDS, *DOUBTFUL_WORDS, *REFUSED_WORDS))
REFUSED_HEADS = table(REFUSED_WORDS)


def look_up(name: str) -> Word | None:
    """The entry of a word; a refused one is refused with whatever follows its comma, as in `TLRGT,GORGT`."""
    return WORDS.get(name) or REFUSED_HEADS.get(name.partition(",")[0])


def meaning_of(name: str) -> str:
    """What a word is taken for, for a list of the words used."""
    found = look_up(name)
    if found is None:
        return UNKNOWN
    return f"{found.meaning}, not supported" if found.kind == REFUSED else found.meaning


def execute(state: State, statement: Statement) -> None:
    """Execute a statement. Raises `InputError`, `ArcError` and `AxisError`."""
    found = look_up(statement.word)
    if found is None:
        _unknown(state, statement)
    else:
        found.act(state, statement)


def _unknown(state: State, statement: Statement) -> None:
    """Listed with a warning, and refused where the word may move the tool or belong to another language."""
    name = statement.word
    if LIKE_G_CODE.match(name) or (not statement.arguments and " " in name):
        raise state.fail(f"{statement.shown!r} is not a statement of a cutter-location file", "a word of APT's")
    numbers = sum(is_number(argument.text) for argument in statement.arguments)
    carries_point = numbers == len(statement.arguments) >= NUMBERS_OF_A_POINT
    if name.startswith(LIKE_MOTION) or carries_point:
        raise state.fail(
            f"{statement.shown}: {name} {UNKNOWN}, and may move the tool",
            GEOMETRY,
            "take the line out if it does not",
        )
    state.note(state.doubtful, f"{name} {UNKNOWN}, and not acted upon")


def words_table() -> str:
    r"""The words as a Markdown table, as it stands in docs/nc.md: neighbours with the same meaning share a row.

    Examples
    --------
    >>> print("\n".join(words_table().splitlines()[:3]))
    | words | taken for | | written by | source |
    | --- | --- | --- | --- | --- |
    | `GOTO/x,y,z[,i,j,k]` | the tool moves to a point | read | all | ISO 4343 |
    """
    lines = ["| words | taken for | | written by | source |", "| --- | --- | --- | --- | --- |"]
    order = (READ, LISTED, DOUBTFUL, REFUSED)
    words = sorted(WORDS.values(), key=lambda word: order.index(word.kind))
    for (kind, meaning, by, source), group in groupby(
        words, lambda word: (word.kind, word.meaning, word.written_by, word.source)
    ):
        names = " ".join(f"`{word.name}{word.form}`" for word in group)
        lines.append(f"| {names} | {meaning} | {kind} | {by} | {source} |")
    return "\n".join(lines) + "\n"
