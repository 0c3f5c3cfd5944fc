"""The table of Siemens' words: name, function, meaning, source; the words listed as ignored, those refused, and why.

Codes that mean what they mean in G code are those of the one table (`codes.registry`). The programming manuals meant
are those of the SINUMERIK 840D sl (Fundamentals, Job Planning) and of the 840D (Cycles, 11/2002).
"""

from toolpath_stiff.nc.codes.code import Code, Rows, holds_anyway, refused, table
from toolpath_stiff.nc.codes.feeds import feed_mode, time_word
from toolpath_stiff.nc.codes.registry import CODES, code_meaning
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.siemens import contours, coordinates, cycles, milling, tools
from toolpath_stiff.nc.siemens.motion import SIDES
from toolpath_stiff.nc.state import CurrentBlock, Flow, State

CONTROLS = ("siemens",)
MANUAL = "SIEMENS, SINUMERIK 840D"
BASICS, PLANNING, CYCLES = f"{MANUAL}, Fundamentals", f"{MANUAL}, Job Planning", f"{MANUAL}, Cycles"
# Codes of `codes.registry` that mean the same here.
SHARED = (
    "G17", "G18", "G19", "G90", "G91", "G93", "G94", "G95", "M0", "M1", "M2", "M3", "M4", "M5", "M7",
    "M8", "M9", "M19", "M30", "F", "S",
)  # fmt: skip


def mode(state: State, block: CurrentBlock, code: str) -> None:
    """G0 to G3, CIP, CT: the modal motion; SUPA: for its block alone. The block's own move comes last."""
    if code in _MOTION:
        state.motion = code


def side(state: State, block: CurrentBlock, code: str) -> None:
    """G40, G41, G42: in force from the next straight move in the plane."""
    plain, on = state.plain, state.cutter
    same = SIDES[code] == ("R0" if on is None else "RL" if on.side > 0 else "RR")
    other = on is not None and code != "G40" and not same
    block.refuse_if(other, code, "while the tool is on the other side", "G40 before it")
    block.refuse_if(plain.entry and code != "G40", code, f"under {plain.entry}", "NORM and G450")
    plain.side = "" if same else code


def entry(state: State, block: CurrentBlock, code: str) -> None:
    """Entry, outside corners and kind of compensation: `plain.entry` names those in force that are not supported."""
    group = next(names for names in _ENTRIES if code in names)
    others = [name for name in state.plain.entry.split() if name not in group]
    state.plain.entry = " ".join(others + [code] * (code not in _ENTERED))
    block.refuse_if(state.cutter is not None and state.plain.entry, code, "while G41 or G42 is on", "NORM and G450")


def feed_place(state: State, block: CurrentBlock, code: str) -> None:
    """CFC, CFIN, CFTCP: F holds on a compensated contour's arcs, on inside ones, or for the tool's centre."""
    state.plain.feed_place = code


def dwell(state: State, block: CurrentBlock, code: str) -> None:
    """G4 F: a pause in seconds; G4 S: in revolutions of the spindle."""
    seconds, turns = (time_word(state, block, letter) for letter in "FS")
    if turns is not None:
        block.refuse_if(state.speed <= 0.0, "S", "counts turns of a spindle that stands", "S and M3 before it")
        seconds = 60.0 * turns / state.speed
    state.pause(block, code, seconds, "G4 F1.5")


def per_revolution(state: State, block: CurrentBlock, code: str) -> None:
    """G97: the speed is one of revolutions, and F is per revolution, as in G95 (both of G94's group)."""
    feed_mode(state, block, "G95")


def fixed_point(state: State, block: CurrentBlock, code: str) -> None:
    """G74, G75: moves to the machine's fixed points; ignored, and the position after them is unknown."""
    state.warnings.append(Remark(f"{code} goes to points of the machine: left out of the path", block.line))
    state.plain.unknown |= {0, 1, 2}
    block.free.clear()


def back(state: State, block: CurrentBlock, code: str) -> None:
    """M17: the end of a subprogram."""
    block.flow = Flow.RETURN


_ENTRIES = ("NORM", "KONT", "KONTC", "KONTT"), ("G450", "G451"), ("CUT2D", "CUT2DF", "CUT3DC", "CUT3DF", "CUT3DFS")
_ENTERED = ("NORM", "G450", "CUT2D", "CUT2DF")
_MOTION = ("G0", "G1", "G2", "G3", "CIP", "CT", "ASPLINE", "CSPLINE")
_FRAMES = f"{BASICS}, Coordinate transformations (frames)"
_ROWS: Rows = (
    ("motion", f"{BASICS}, Motion commands", (
        ("G0", mode, "rapid"), ("G1", mode, "feed"), ("G2", mode, "clockwise arc"),
        ("G3", mode, "counter-clockwise arc"), ("CIP", mode, "arc through a point"),
        ("CT", mode, "arc that goes on smoothly"),
    )),
    ("motion", f"{PLANNING}, Spline interpolation", (("ASPLINE CSPLINE", mode, "spline, as chords of its points"),)),
    ("non-modal", f"{BASICS}, Suppress frames", (("SUPA G53 G153", mode, "machine coordinates"),)),
    ("non-modal", f"{BASICS}, Reference point, fixed point", (("G74 G75", fixed_point, "to points of the machine"),)),
    ("polar", f"{BASICS}, Travel commands with polar coordinates", (("G110 G111 G112", coordinates.pole, "pole"),)),
    ("work offset", f"{BASICS}, Settable zero offset", (
        (" ".join(["G54 G55 G56 G57", *(f"G{n}" for n in range(505, 600))]), coordinates.offset, "settable offset"),
        ("G500", coordinates.offset, "no settable offset"),
    )),
    ("feed mode", f"{BASICS}, Constant cutting rate", (
        ("G97", per_revolution, "feed per revolution, at a speed in revolutions"),
    )),
    ("units", f"{BASICS}, Inch or metric dimensions", (
        ("G70 G700", coordinates.units, "inch"), ("G71 G710", coordinates.units, "mm"),
    )),
    ("cutter compensation", f"{BASICS}, Tool radius compensation", (
        ("G40", side, "cutter compensation off"), ("G41", side, "cutter compensation, tool on the left"),
        ("G42", side, "cutter compensation, tool on the right"),
    )),
    ("path control", f"{BASICS}, Tool radius compensation", (
        ("NORM KONT KONTC KONTT G450 G451", entry, "how a compensated contour begins, and its outside corners"),
        ("CUT2D CUT2DF CUT3DC CUT3DF CUT3DFS", entry, "in a plane, or in space"),
    )),
    ("path control", f"{BASICS}, Feedrate optimization for curved path sections", (
        ("CFC CFIN CFTCP", feed_place, "where F holds beside arcs"),
    )),
    ("T", f"{BASICS}, Tool change", (("T", tools.select, "tool"),)),
    ("M tool change", f"{BASICS}, Tool change", (("M6", tools.change, "tool change"),)),
    ("tool length", f"{BASICS}, Tool offsets", (("D", tools.edge, "cutting edge: length and radius"),)),
    ("dwell", f"{BASICS}, Dwell time", (("G4", dwell, "dwell: F in seconds, S in turns"),)),
    ("dynamic offset", _FRAMES, (
        ("TRANS ATRANS", coordinates.frame, "shift"), ("ROT AROT", coordinates.frame, "rotation"),
        ("$P_UIFR", coordinates.set_offset, "values of a settable offset"),
        ("SCALE ASCALE", coordinates.frame, "scale"), ("MIRROR AMIRROR", coordinates.frame, "mirror image"),
    )),
    ("dynamic offset", f"{CYCLES}, Swivelling", (("CYCLE800", coordinates.swivel, "swivelled plane"),)),
    ("rotation", f"{PLANNING}, Transformations", (
        ("TRAORI TRAFOOF", coordinates.transformation, "tool centre point control, on and off"),
    )),
    ("M subprogram", f"{PLANNING}, Subprogram technique", (("M17", back, "subprogram end"),)),
    ("cycle return", f"{CYCLES}, Drilling patterns", (("MCALL", cycles.modal, "the cycle behind each move"),)),
    ("corner", f"{CYCLES}, Drilling cycles", (
        ("CYCLE81 CYCLE82", cycles.cycle, "drilling"), ("CYCLE83", cycles.cycle, "deep drilling"),
        ("CYCLE84 CYCLE840", cycles.cycle, "tapping"), ("CYCLE85", cycles.cycle, "reaming"),
        ("CYCLE86 CYCLE87 CYCLE88 CYCLE89", cycles.cycle, "boring"),
    )),
    ("corner", f"{CYCLES}, Drilling patterns", (
        ("HOLES1 HOLES2 CYCLE801 CYCLE802", cycles.pattern, "holes on a line, on a circle, in a grid, at points"),
    )),
    ("corner", f"{CYCLES}, Milling cycles", (
        ("POCKET1 POCKET2 POCKET3 POCKET4", milling.mill_area, "rectangular pocket, circular pocket"),
        ("CYCLE76 CYCLE77", milling.mill_area, "rectangular spigot, circular spigot"),
        ("CYCLE71 CYCLE61", milling.mill_area, "face"), ("CYCLE72", contours.mill_contour, "contour"),
        ("CYCLE62", contours.contour_call, "call of a contour"),
    )),
    ("corner", f"{MANUAL}, Operating, Blank input", (("WORKPIECE", tools.blank, "blank"),)),
)  # fmt: skip
LISTED = {
    name: what
    for what, names in {
        "how the control plans ahead: the path is taken as programmed":
            "G9 G60 G64 G601 G602 G603 G641 G642 G643 G644 G645 G62 G621 BRISK BRISKA SOFT SOFTA DRIVE FFWON FFWOF "
            "COMPON COMPCURV COMPCAD COMPSURF COMPOF CYCLE832 DYNNORM DYNPOS DYNROUGH DYNSEMIFIN DYNFINISH DYNPREC "
            "FIFOCTRL STARTFIFO STOPFIFO RTLION RTLIOF UPATH SPATH FNORM FLIN FCUB FENDNORM "
            "CPRECON CPRECOF FGROUP ORISON ORISOF ORIWKS ORIMKS ORIRESET CDON CDOF CDOF2 G460 G461 G462 OST OSOF G290 "
            "HIGH_SPEED ORIVECT ORIPLANE ORIAXES ORIEULER ORIRPY ORIRPY2 ORIC ORID BNAT BTAN BAUTO ENAT ETAN EAUTO CP",
        "message, stop of the look-ahead, display":
            "MSG STOPRE GROUP_BEGIN GROUP_END GROUP_ADDEND DISPLOF DISPLON NEWCONF WRITE SETAL PARAM_END EXTERN WAITM "
            "SETM CLEARM SETMS STOPREOF SAVE SBLOF SBLON ENDLABEL",
        "limits of the working area and of the spindle": "G25 G26 WALIMON WALIMOF LIMS",
        "none is on, since switching it on is refused": "DIAMOF PAROTOF TOROTOF TOFRAMEOF TCOABS TMOF CUTMOF G49",
        "a tool length of the ISO dialect: D has it": "G43",
        "a spindle or an axis that is told apart":
            "SPOS SPOSA SPCON SPCOF M70 WAITP WAITS GET GETD RELEASE TANGOF GWPSOF",
    }.items()
    for name in names.split()
}  # fmt: skip
WORDS = frozenset((
    "ADIS", "ADISPOS", "SPOS", "SPOSA", "OVR", "OVRRAP", "FGREF", "CTOL", "OTOL", "ACC", "H", "FRC", "FL", "LIMS",
    "ATOL", "VELOLIM", "ACCLIM", "JERKLIM", "VELOLIMA", "ACCLIMA", "JERKLIMA", "FA", "STOLF", "FB",
))  # fmt: skip
_BY_MOVES = "post the moves of the cycle"
REFUSED = refused((
    ("SLOT1 SLOT2 LONGHOLE CYCLE73 CYCLE74 CYCLE75 CYCLE63 CYCLE64 CYCLE70 CYCLE78 CYCLE79 "
     "CYCLE90 CYCLE60 CYCLE899",
     "a cycle whose path the manual draws without numbers", _BY_MOVES, f"{CYCLES}, Milling cycles"),
    ("CYCLE92 CYCLE93 CYCLE94 CYCLE95 CYCLE96 CYCLE97 CYCLE98 CYCLE99 CYCLE930 CYCLE940 CYCLE951 CYCLE952 DIAMON "
     "DIAM90 G33 G34 G35 G96", "a code of lathes", "post it for a mill", f"{CYCLES}, Turning cycles"),
    ("CYCLE971 CYCLE976 CYCLE977 CYCLE978 CYCLE979 CYCLE996 CYCLE998 CYCLE982 MEAS MEAW MEASA", "probing",
     "leave probing out", f"{MANUAL}, Measuring cycles"),
    ("BSPLINE POLY PW PO", "a spline of coefficients", "post lines and arcs", f"{PLANNING}, Spline interpolation"),
    ("TRANSMIT TRACYL TRAANG TRACON TOFRAME TOROT PAROT TCARR TCOFR CUTMOD", "a transformation of the machine's",
     "post X, Y, Z, A3, B3, C3 of the tool's tip", f"{PLANNING}, Transformations"),
    ("G58 G59", "an offset axis by axis", "TRANS, ATRANS", _FRAMES),
    ("ROTS AROTS CROTS", "a rotation by spatial angles", "ROT, AROT", _FRAMES),
    ("PRESETON PRESETONS", "another number of the machine's axis", "TRANS", f"{PLANNING}, Preset offset"),
    ("DEFINE", "a macro of another form", "DEFINE NAME AS ...", f"{PLANNING}, Macro technique"),
    ("G63 G331 G332", "tapping without a cycle", "CYCLE84", f"{BASICS}, Tapping"),
    ("G140 G141 G142 G143 G147 G148 G247 G248 G340 G341 G347 G348", "smooth approach and retraction",
     "post its moves", f"{BASICS}, Smooth approach and retraction"),
    ("G291", "the ISO dialect", "read it as G code: --dialect fanuc", f"{MANUAL}, ISO Milling"),
    ("DISC", "corners between an arc and an intersection", "DISC=0", f"{BASICS}, Tool radius compensation"),
    ("A2 B2 C2 A4 B4 C4 A5 B5 C5 LEAD TILT THETA OFFN OEMIPO1", "an orientation given otherwise", "A3, B3, C3",
     f"{PLANNING}, Orientation"),
    ("WHEN WHENEVER EVERY DO ID IDS", "a synchronised action", "IF with GOTOF", PLANNING),
    ("PCALL CALLPATH ISOCALL", "a call by path", "the subprogram's name, with --subprograms",
     f"{PLANNING}, Subprogram technique"),
))  # fmt: skip
TABLE = table(_ROWS, CONTROLS)
TABLE |= {name: CODES[name] for name in SHARED}
TABLE |= {
    name: Code(name, "look-ahead", holds_anyway, what, BASICS, CONTROLS, listed=what) for name, what in LISTED.items()
}


def meaning_of(name: str) -> str:
    """The meaning given to a word.

    Examples
    --------
    >>> meaning_of("CIP"), meaning_of("MSG")
    ('arc through a point', 'message, stop of the look-ahead, display: not acted upon')
    """
    if name in TABLE:
        return f"{TABLE[name].meaning}: not acted upon" if TABLE[name].listed else TABLE[name].meaning
    return REFUSED[name].what if name in REFUSED else code_meaning(name)
