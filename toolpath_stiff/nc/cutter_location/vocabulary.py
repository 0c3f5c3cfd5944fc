"""The table of words of cutter-location files: word to function, meaning, who writes it, source; and how it is used.

A word that acts is a row beside its function in `modes` and `motion`. Those that need no function of their
own, because they are listed, doubted or refused, are rows here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import groupby

from toolpath_stiff.nc.cutter_location.modes import COMPENSATION, HEADING, MODE_WORDS, TOOL, TOOL_CENTRE
from toolpath_stiff.nc.cutter_location.motion import CYCLE_WORDS, MOTION_WORDS
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
    Word,
)
from toolpath_stiff.nc.cutter_location.statements import Statement, is_number

GEOMETRY = "points, tool axes and feeds alone"


UNKNOWN = "is not known"


# An unknown word that begins like one of a motion or a feed, or that carries a point, is not passed over.
LIKE_MOTION = ("GO", "RAP", "FED", "CIR", "ARC", "MOV", "HEL", "CYC", "TLA", "TLO", "TLL", "TLR", "UNI", "MUL", "FRO")


NUMBERS_OF_A_POINT = 3


LIKE_G_CODE = re.compile(r"[A-Z]-?[\d.]+")


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
