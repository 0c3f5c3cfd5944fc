"""The words of cutter-location files: one table from a word to its function, its meaning, who writes it, the source.

`word` registers a function that acts upon a word (`modes`, `motion`, `cycles`); the words that need none of their own,
because they are listed, doubted or refused, stand here. `execute` looks words up.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby

from toolpath_stiff.nc.cutter_location.state import State
from toolpath_stiff.nc.cutter_location.statements import Statement, is_number

Act = Callable[[State, Statement], None]

# What becomes of a word.
READ, LISTED, DOUBTFUL, REFUSED = "read", "listed", "listed, with a warning", "refused"

# Who writes it.
ALL, CREO, NX, CATIA, CAMPLETE, AUTODESK = (
    "all",
    "Creo",
    "NX",
    "CATIA",
    "Autodesk's post for CAMplete",
    "Autodesk's posts",
)
# Where it is described.
ISO = "ISO 4343"
APT = "ISO 4342, the APT language"
PTC = 'PTC, "Supported CL Data Commands"'
SIEMENS = 'Siemens NX, "CLSF Manager"'
DASSAULT = "Dassault, CATIA's help on APT import"
POSTS = "Autodesk's APT posts"
MANUALS = "manuals of post processors"
VERICUT = 'Vericut, "Supported APT-CLS NC Program Records"'

GEOMETRY = "points, tool axes and feeds alone"
UNKNOWN = "is not known"
# An unknown word that begins like one of a motion or a feed, or that carries a point, is not passed over.
LIKE_MOTION = ("GO", "RAP", "FED", "CIR", "ARC", "MOV", "HEL", "CYC", "TLA", "TLO", "TLL", "TLR", "UNI", "MUL", "FRO")
NUMBERS_OF_A_POINT = 3
LIKE_G_CODE = re.compile(r"[A-Z]-?[\d.]+")


@dataclass(frozen=True)
class Word:
    """A major word of a statement.

    Attributes
    ----------
    name
        Upper case; "" is a line of numbers alone.
    act
        Executes a statement of it.
    meaning
        What it is taken for, as `tps check` lists it; of a refused word what it does.
    kind
        READ, LISTED, DOUBTFUL or REFUSED: what becomes of it.
    written_by, source
        Which CAM systems write it; where it is described.
    form
        The arguments that are read, for a list of the words.
    hint
        What to do, where it is refused.
    """

    name: str
    act: Act
    meaning: str
    kind: str
    written_by: str
    source: str
    form: str = ""
    hint: str = ""


WORDS: dict[str, Word] = {}


def word(
    *names: str,
    meaning: str,
    by: str = ALL,
    source: str = ISO,
    form: str = "",
    kind: str = READ,
    hint: str = "",
) -> Callable[[Act], Act]:
    """Register a function for words; the arguments are those of `Word`."""

    def register(act: Act) -> Act:
        for name in names:
            assert name not in WORDS, name
            WORDS[name] = Word(name, act, meaning, kind, by, source, form, hint)
        return act

    return register


def look_up(name: str) -> Word | None:
    """The entry of a word; a refused one is refused with whatever follows its comma, as in `TLRGT,GORGT`."""
    found = WORDS.get(name)
    if found is None:
        head = WORDS.get(name.partition(",")[0])
        found = head if head is not None and head.act is refuse else None
    return found


def meaning_of(name: str) -> str:
    """What a word is taken for, for a list of the words used."""
    found = look_up(name)
    if found is None:
        return UNKNOWN
    return f"{found.meaning}, not supported" if found.kind == REFUSED else found.meaning


def execute(state: State, statement: Statement) -> None:
    """Execute a statement."""
    found = look_up(statement.word)
    if found is not None:
        found.act(state, statement)
    else:
        _unknown(state, statement)


def _unknown(state: State, statement: Statement) -> None:
    """Listed with a warning, and refused where the word may move the tool or belong to another language."""
    name = statement.word
    if LIKE_G_CODE.match(name) or (not statement.arguments and " " in name):
        raise state.fail(f"{statement.shown!r} is no statement of a cutter-location file", "a word of APT's")
    numbers = sum(is_number(argument.text) for argument in statement.arguments)
    carries_point = numbers == len(statement.arguments) >= NUMBERS_OF_A_POINT
    if name.startswith(LIKE_MOTION) or carries_point:
        raise state.fail(
            f"{statement.shown}: {name} {UNKNOWN}, and may move the tool",
            GEOMETRY,
            "take the line out if it does not",
        )
    state.note(state.doubtful, f"{name} {UNKNOWN}, and not acted upon")


def rows() -> Iterator[tuple[str, str, str, str, str]]:
    """The table for people: words, what they are taken for, what becomes of them, who writes them, the source."""

    def alike(entry: Word) -> tuple[str, str, str, str]:
        return (entry.kind, entry.meaning, entry.written_by, entry.source)

    order = (READ, LISTED, DOUBTFUL, REFUSED)
    entries = sorted(WORDS.values(), key=lambda entry: order.index(entry.kind))
    for (kind, meaning, written_by, source), group in groupby(entries, alike):
        names = " ".join(f"`{entry.name}{entry.form}`" for entry in group)
        yield names, meaning, kind, written_by, source


# -- words without a function of their own -----------------------------------------------------------------------------


def list_it(state: State, statement: Statement) -> None:
    """A word that changes nothing of the path."""
    state.note(state.noted, WORDS[statement.word].meaning)


def doubt_it(state: State, statement: Statement) -> None:
    """A word that hangs on the machine: listed, and a warning."""
    state.note(state.doubtful, WORDS[statement.word].meaning)


def refuse(state: State, statement: Statement) -> None:
    """A word that changes the path in a way that is not supported."""
    entry = look_up(statement.word)
    assert entry is not None
    raise state.fail(f"{statement.shown} {entry.meaning}, which is not supported", GEOMETRY, entry.hint)


HEADING = "a heading or a remark"
TOOL = "about the tool; LOADTL, LOAD/TOOL and CUTTER are what counts"
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

COMPENSATION = "cutter compensation"
TOOL_CENTRE = "have the CAM system write the path of the tool centre"
_WHERE_CUT = "have the CAM system write the points where they are cut"
_POINT, _POINTS = "have the CAM system write the point", "have the CAM system write points"
_ONE_SYSTEM = "have the CAM system write points and tool axes in one system"
_OUT = "have the CAM system write the points out"
_DRIVE, _PROCESSOR = "is driven along surfaces", "give the file of points that APT's processor writes"

# What they do, what to do, source, words.
_REFUSED = (
    ("changes where all that follows lies", _WHERE_CUT, APT, "TRACUT MIRROR SCALE"),
    ("turns the work or the head of one machine", _ONE_SYSTEM, ISO, "ROTABL ROTHED PIVOTZ"),
    ("turns the work or the head of one machine", _ONE_SYSTEM, MANUALS, "ROTATE TABLE INDEX TILT"),
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

for _meaning, _by, _source, _names in _LISTED:
    word(*_names.split(), meaning=_meaning, by=_by, source=_source, kind=LISTED)(list_it)
for _meaning, _by, _source, _names in _DOUBTFUL:
    word(*_names.split(), meaning=_meaning, by=_by, source=_source, kind=DOUBTFUL)(doubt_it)
for _meaning, _hint, _source, _names in _REFUSED:
    word(*_names.split(), meaning=_meaning, by="", source=_source, kind=REFUSED, hint=_hint)(refuse)
