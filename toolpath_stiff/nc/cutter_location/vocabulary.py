"""Table of words of cutter-location files: word to function, meaning, writers, source; and how it is used.

Functions of words that act are in `modes` and `motion`; those of words that are listed, doubted or refused are here.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

from toolpath_stiff.nc.cutter_location import cycles, modes, motion
from toolpath_stiff.nc.cutter_location.modes import FRAMES, HEADING, TOOL
from toolpath_stiff.nc.cutter_location.state import CutterLocationState
from toolpath_stiff.nc.cutter_location.statements import MajorStatement, is_number, number

# Treatment of a word.
READ, LISTED, DOUBTFUL, REFUSED = "read", "listed", "listed, with a warning", "refused"
# Who writes it.
ALL, CREO, NX, CATIA, AUTODESK, CAMPLETE = "all", "Creo", "NX", "CATIA", "Autodesk", "Autodesk for CAMplete"
SOLIDWORKS = "SolidWorks CAM"
CATIA_CREO, CREO_NX, MOST = f"{CATIA}, {CREO}", f"{CREO}, {NX}, {AUTODESK}", f"{CATIA}, {CREO}, {AUTODESK}"
# Sources.
ISO, APT = "ISO 4343", "ISO 4342, the APT language"
PTC, SIEMENS = 'PTC, "Supported CL Data Commands"', 'Siemens NX, "CLSF Manager"'
DASSAULT, POSTS = "Dassault, CATIA's help on APT import", "Autodesk's APT posts"
SAMPLES = "published files of SolidWorks CAM"
VERICUT, MANUALS = 'Vericut, "Supported APT-CLS NC Program Records"', "manuals of post processors"
# An unknown word that looks like a motion or a feed, or that carries a point, is not skipped.
LIKE_MOTION = ("GO", "RAP", "FED", "CIR", "ARC", "MOV", "HEL", "CYC", "TLA", "TLO", "TLL", "TLR", "UNI", "MUL", "FRO")
LIKE_G_CODE = re.compile(r"[A-Z]-?[\d.]+")
GEOMETRY = "points, tool axes and feeds alone"
UNKNOWN, NO_CHANGE = "is not known", "changes nothing"
Act = Callable[[CutterLocationState, MajorStatement], None]


@dataclass(frozen=True)
class MajorWord:
    """A major word of a statement.

    Attributes
    ----------
    name
        Upper case; "" is a line of numbers alone.
    act
        Executes a statement of it.
    meaning
        What it is taken for, as `tps check` lists it; of a refused word what it does.
    written_by, source
        Which CAM systems write it, "" where that is not known; where it is described.
    form
        The arguments that are read, as the documentation shows them.
    kind
        READ, LISTED, DOUBTFUL or REFUSED: what becomes of it.
    """

    name: str
    act: Act
    meaning: str
    written_by: str
    source: str
    form: str = ""
    kind: str = READ


def listed(meaning: str, written_by: str, source: str, names: str, kind: str = LISTED) -> list[MajorWord]:
    """Words that do not change the path or (DOUBTFUL) change how the machine follows it."""

    def act(state: CutterLocationState, statement: MajorStatement) -> None:
        state.note(meaning, doubtful=kind == DOUBTFUL)

    return [MajorWord(name, act, meaning, written_by, source, kind=kind) for name in names.split()]


def refused(meaning: str, source: str, names: str, unless: str = "") -> list[MajorWord]:
    """Words that change the path in a way that is not supported, `unless` the statement is one that changes nothing."""

    def act(state: CutterLocationState, statement: MajorStatement) -> None:
        if not unless or not changes_nothing(statement):
            hint = "have the CAM system write points and tool axes, of the tool's centre and in one system"
            raise state.fail(f"{statement.shown} {meaning}, which is not supported", unless or GEOMETRY, hint)
        state.note(f"{unless} {NO_CHANGE}")

    form = f" other than {unless}" if unless else ""
    return [MajorWord(name, act, meaning, "", source, form, REFUSED) for name in names.split()]


def changes_nothing(statement: MajorStatement) -> bool:
    """True for OFF, and if all numbers are 0: a shift or turn by nothing."""
    numbers = [number(word) for word in statement.words if is_number(word)]
    return statement.words == ["OFF"] or (bool(numbers) and not any(numbers))


_POINT, _PAUSE = "/x,y,z[,i,j,k]", "/seconds or revolutions,REV"
_CIRCLE, _SHIFTS = "the next motion follows a circle", "shifts all that follows"
_TOLERANCE = "a tolerance of the CAM system: the points are taken as they stand"
_SCREEN = "for the CAM system's screen"
_OUTPUT = "about the output of the post processor"
_BLOCK = "a block for the control as it stands: what it does is not known"
_TURNS, _COMPENSATES = "turns the work or the head of one machine", "is cutter compensation"
_REPEATS, _DRIVE = "repeats or calls a part of the file", "is driven along surfaces: APT's processor writes the points"
TABLE = (
    MajorWord("GOTO", motion.goto, "the tool moves to a point", ALL, ISO, _POINT),
    MajorWord("", motion.more_points, "further points of the GOTO before it", CREO, PTC, "x,y,z[,i,j,k]"),
    MajorWord("GODLTA", motion.godlta, "the tool moves by a distance", "", ISO, _POINT),
    MajorWord("FROM", motion.from_, "the tool stands at a point", ALL, ISO, _POINT),
    MajorWord("RAPID", motion.rapid, "the next motion is rapid", ALL, ISO),
    MajorWord("GOHOME", motion.gohome, motion.HOME, NX, SIEMENS, " without a point", DOUBTFUL),
    MajorWord("CIRCLE", motion.circle, _CIRCLE, CREO_NX, f"{PTC}; {SIEMENS}", "/x,y,z,i,j,k[,r[,t,f,d,e]]"),
    MajorWord("MOVARC", motion.movarc, _CIRCLE, AUTODESK, ISO, "/x,y,z,i,j,k,r,ANGLE,a"),
    MajorWord("INDIRV", motion.indirv, "direction in which the next circle begins", CATIA_CREO, APT, "/i,j,k"),
    MajorWord("TLON,GOFWD", motion.tlon, "the tool moves along a circle", CATIA_CREO, DASSAULT, "/(...),ON,(...)"),
    MajorWord("CYCLE", cycles.cycle, "drilling cycle", ALL, PTC, "/DRILL, DEEP, BRKCHP, TAP, BORE and pairs, or /OFF"),
    MajorWord("FEDRAT", modes.fedrat, "feed", ALL, ISO, "/number[,unit] or unit,number"),
    MajorWord("SPINDL", modes.spindl, "spindle speed", ALL, ISO),
    MajorWord("UNITS", modes.units, "length unit", f"{CREO}, {AUTODESK}", ISO, "/MM or INCHES"),
    MajorWord("UNIT", modes.units, "length unit", "", ISO, "/MM or INCHES"),
    MajorWord("MULTAX", modes.multax, "whether points carry a tool axis", MOST, ISO, "[/ON or OFF]"),
    MajorWord("TLAXIS", modes.tlaxis, "tool axis", "", ISO, "/i,j,k"),
    MajorWord("LOADTL", modes.loadtl, "tool change", MOST, PTC, "/n[,LENGTH,l]"),
    MajorWord("LOAD", modes.loadtl, "tool change", NX, SIEMENS, "/TOOL,n"),
    MajorWord("CUTTER", modes.cutter, "tool diameter", MOST, ISO, "/d"),
    MajorWord("TLDATA", modes.cutter, "tool diameter", NX, SIEMENS, "/kind,d"),
    MajorWord("DELAY", modes.delay, "pause", ALL, ISO, _PAUSE),
    MajorWord("DWELL", modes.delay, "pause", "", ISO, _PAUSE),
    MajorWord("CUTCOM", modes.cutcom, "cutter compensation", MOST, ISO, "/LEFT, RIGHT, ON or OFF", DOUBTFUL),
    MajorWord("MODE", modes.mode, "milling; turning is read alike", AUTODESK, POSTS, "/MILL or TURN"),
    MajorWord("FINI", modes.fini, "end of the file", MOST, ISO),
    MajorWord("TOOL PATH", modes.heading, HEADING, NX, SIEMENS, "/name,TOOL,tool", LISTED),
    MajorWord("CSI_TOOL_PATH", modes.heading, HEADING, CAMPLETE, POSTS, "/name", LISTED),
    MajorWord("MSYS", modes.frame_word, FRAMES["MSYS"], NX, SIEMENS, kind=LISTED),
    MajorWord("MCS", modes.frame_word, FRAMES["MCS"], AUTODESK, POSTS, kind=LISTED),
    MajorWord("CSYS", modes.frame_word, FRAMES["CSYS"], "", VERICUT, kind=LISTED),
    MajorWord("ZERO", modes.frame_word, FRAMES["ZERO"], AUTODESK, POSTS, kind=LISTED),
    *refused(_SHIFTS, ISO, "TRANS ORIGIN", unless="0,0,0"),
    *refused(_TURNS, ISO, "ROTABL ROTHED", unless="0"),
    *refused(_TURNS, MANUALS, "ROTATE TABLE INDEX TILT", unless="0"),
    *listed(HEADING, ALL, ISO, "PARTNO PPRINT REMARK LETTER"),
    *listed(HEADING, "", APT, "TITLES TITLE"),
    *listed(HEADING, CATIA, DASSAULT, "TPRINT"),
    *listed(HEADING, CREO, PTC, "MFGNO"),
    *listed(HEADING, NX, SIEMENS, "END-OF-PATH"),
    *listed(_TOLERANCE, ALL, VERICUT, "INTOL OUTTOL TOLER LINTOL THICK MCHTOL"),
    *listed(_TOLERANCE, "", APT, "OUTOL MAXDP NUMPTS"),
    *listed("a stop: the path goes on", ALL, ISO, "STOP OPSTOP END BREAK"),
    *listed(_SCREEN, NX, SIEMENS, "PAINT"),
    *listed(_SCREEN, "", VERICUT, "DISPLY PLOT VERIFY CLPRNT"),
    *listed(TOOL, NX, SIEMENS, "SELECT"),
    *listed(TOOL, "", VERICUT, "SELCTL SELECTL TLCHG OFSTNO"),
    *listed(TOOL, "", MANUALS, "TOOL HEAD SWITCH"),
    *listed(_OUTPUT, ALL, ISO, "MACHIN SEQNO LEADER TMARK REWIND"),
    *listed(_OUTPUT, "", MANUALS, "CHANNEL NOPOST CLDATA PROGRM"),
    *listed("for CAMplete", CAMPLETE, POSTS, "CSI_PROGRAM_COMMENT CSI_SET_PATH_PARAM CSI_PATH_TOLERANCE"),
    *listed(TOOL, CAMPLETE, POSTS, "CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH"),
    *listed("in which system the machine is", SOLIDWORKS, SAMPLES, "TRNTYP"),
    *listed("coolant", ALL, ISO, "COOLNT FLUSH"),
    *listed("a plane to retract to, which has no effect without RETRCT", "", ISO, "CLEARP CLRSRF"),
    *listed("the part surface; the points have its height already", CATIA, DASSAULT, "AUTOPS PSIS"),
    *listed("clamps of machine axes", "", ISO, "CLAMP UNCLMP"),
    *listed("an M code of one control: what it does is not known", "", ISO, "AUXFUN", DOUBTFUL),
    *listed("a G code of one control: what it does is not known", "", ISO, "PREFUN", DOUBTFUL),
    *listed(_BLOCK, "", ISO, "INSERT", DOUBTFUL),
    *listed(_BLOCK, CAMPLETE, POSTS, "CSI_INSERT_CUSTOM_GCODE", DOUBTFUL),
    *listed("statements that the operator may leave out: they are read", "", ISO, "OPSKIP", DOUBTFUL),
    *listed(TOOL, CATIA, ISO, "TOOLNO"),
    *refused(_SHIFTS, APT, "TRACUT MIRROR SCALE"),
    *refused(_TURNS, ISO, "PIVOTZ"),
    *refused(_REPEATS, APT, "COPY CALL CALSUB DEFSUB ENDSUB MACRO TERMAC LOOPST JUMPTO"),
    *refused(_REPEATS, MANUALS, "CALLSUB"),
    *refused(_DRIVE, APT, "TLLFT TLRGT TLON TLONPS TLOFPS TLNDON"),
    *refused(_DRIVE, APT, "GO GOFWD GOBACK GOLFT GORGT GOUP GODOWN OFFSET POCKET SCURV"),
    *refused(_COMPENSATES, MANUALS, "TLCOMP"),
    *refused("feeds the tool to where a post processor knows", MANUALS, "PLUNGE"),
    *refused("retracts the tool to a plane of the post processor's", ISO, "RETRCT"),
    *refused("cuts a thread", ISO, "THREAD"),
    *refused("is an arc of one post processor", VERICUT, "ARC"),
    *refused("is a NURBS curve", SIEMENS, "NURBS"),
    *refused("is a spline or a polynomial", MANUALS, "SPLINE POLYNO"),
)
WORDS = {word.name: word for word in TABLE}


def look_up(name: str) -> MajorWord | None:
    """Entry of a word; a refused one is refused with anything after its comma, as in `TLRGT,GORGT`."""
    head = WORDS.get(name.partition(",")[0])
    return WORDS.get(name) or (head if head is not None and head.kind == REFUSED else None)


def meaning_of(name: str) -> str:
    """Meaning of a word, for a list of the words used."""
    word = look_up(name)
    meaning = word.meaning if word is not None else UNKNOWN
    return f"{meaning}, not supported" if word is not None and word.kind == REFUSED else meaning


def execute(state: CutterLocationState, statement: MajorStatement) -> None:
    """Execute a statement. Raises `InputError` and `GeometryError`.

    A word that is not known is listed with a warning, and refused where it may move the tool or belong to another
    language.
    """
    name, count = statement.word, len(statement.arguments)
    word = look_up(name)
    if word is not None:
        word.act(state, statement)
        return
    other = LIKE_G_CODE.match(name) or (not count and " " in name)
    state.refuse_if(other, f"{statement.shown!r} is not a statement of a cutter-location file", "a word of APT's")
    carries_point = count >= 3 and all(map(is_number, statement.words))
    moves = f"{statement.shown}: {name} {UNKNOWN}, and may move the tool"
    state.refuse_if(name.startswith(LIKE_MOTION) or carries_point, moves, GEOMETRY, "take the line out if it does not")
    state.note(f"{name} {UNKNOWN}, and not acted upon", doubtful=True)
