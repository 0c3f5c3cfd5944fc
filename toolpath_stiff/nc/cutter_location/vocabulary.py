"""What the major words of a cutter-location file mean to the tool path, where they are not acted upon.

Sources: ISO 4343; PTC's "Supported CL Data Commands"; Siemens' and Dassault's help on CLSF and APT import; Autodesk's
APT posts; Vericut's "Supported APT-CLS NC Program Records".
"""

from __future__ import annotations

GEOMETRY = "points, tool axes and feeds alone"

# Acted upon: word -> what it is taken for.
ACTED_UPON = {
    "GOTO": "the tool moves to a point",
    "GODLTA": "the tool moves by a distance",
    "FROM": "the tool stands at a point",
    "RAPID": "the next motion is rapid",
    "FEDRAT": "feed",
    "SPINDL": "spindle speed",
    "UNITS": "length unit",
    "UNIT": "length unit",
    "MULTAX": "whether points carry a tool axis",
    "TLAXIS": "tool axis",
    "CIRCLE": "the next motion follows a circle",
    "MOVARC": "the next motion follows a circle",
    "INDIRV": "direction in which the next circle begins",
    "TLON,GOFWD": "the tool moves along a circle",
    "LOADTL": "tool change",
    "LOAD": "tool change",
    "CUTTER": "tool diameter",
    "TLDATA": "tool diameter",
    "DELAY": "pause",
    "DWELL": "pause",
    "CYCLE": "drilling cycle",
    "MODE": "milling, not turning",
    "FINI": "end of the file",
    "": "further points of the GOTO before it",
}

_HEADING = "a heading or a remark"
_TOLERANCE = "a tolerance of the CAM system: the points are taken as they stand"
_STOP = "a stop: the path goes on"
_DRAWING = "for the CAM system's screen"
_TOOL = "about the tool; LOADTL, LOAD/TOOL and CUTTER are what counts"
_OUTPUT = "about the output of the post processor"
_FRAME = "where the points' coordinate system lies in the part; the points are taken in that system, as program zero"

# Harmless: listed as not acted upon.
HARMLESS = {
    **dict.fromkeys(("PARTNO", "PPRINT", "REMARK", "TITLES", "TITLE", "TPRINT", "MFGNO", "LETTER"), _HEADING),
    **dict.fromkeys(("TOOL PATH", "CSI_TOOL_PATH", "END-OF-PATH"), _HEADING),
    **dict.fromkeys(("INTOL", "OUTTOL", "OUTOL", "TOLER", "LINTOL", "MAXDP", "NUMPTS", "THICK", "MCHTOL"), _TOLERANCE),
    **dict.fromkeys(("STOP", "OPSTOP", "END", "BREAK"), _STOP),
    **dict.fromkeys(("PAINT", "DISPLY", "PLOT", "VERIFY", "CLPRNT"), _DRAWING),
    **dict.fromkeys(("TOOLNO", "SELECT", "SELCTL", "SELECTL", "TLCHG", "OFSTNO", "TOOL", "HEAD", "SWITCH"), _TOOL),
    **dict.fromkeys(("MACHIN", "SEQNO", "LEADER", "TMARK", "REWIND", "CHANNEL", "NOPOST", "CLDATA", "PROGRM"), _OUTPUT),
    **dict.fromkeys(("CSI_PROGRAM_COMMENT", "CSI_SET_PATH_PARAM", "CSI_PATH_TOLERANCE"), "for CAMplete"),
    **dict.fromkeys(("CSI_SET_FLUTE_LENGTH",), _TOOL),
    **dict.fromkeys(("COOLNT", "FLUSH"), "coolant"),
    **dict.fromkeys(("CLEARP", "CLRSRF"), "a plane to retract to, of which nothing is made without RETRCT"),
    **dict.fromkeys(("AUTOPS", "PSIS"), "the part surface; the points have its height already"),
    **dict.fromkeys(("CLAMP", "UNCLMP"), "clamps of machine axes"),
}
FRAMES = {
    **dict.fromkeys(("MSYS", "MCS", "CSYS"), _FRAME),
    "ZERO": "the work offset of the posted program; here it is program zero",
}  # a second, different one is refused

_WHOLE_PATH = ("changes where all that follows lies", "have the CAM system write the points where they are cut")
_TURN = ("turns the work or the head of one machine", "have the CAM system write points and tool axes in one system")
_CALL = ("repeats or calls a part of the file", "have the CAM system write the points out")
_DRIVE = ("is driven along surfaces", "give the file of points that APT's processor writes")
_SHIFT = ("shifts all that follows", "have the CAM system write the points where they are cut")

TURNING = ("is not milling", "this is a mill")
COMPENSATION = ("is cutter compensation", "have the CAM system write the path of the tool centre")

# Refused by name: word -> what it does, what to do.
REFUSED = {
    **dict.fromkeys(("TRACUT", "MIRROR", "SCALE"), _WHOLE_PATH),
    **dict.fromkeys(("ROTATE", "ROTABL", "ROTHED", "TABLE", "PIVOTZ", "INDEX", "TILT"), _TURN),
    **dict.fromkeys(
        ("COPY", "CALSUB", "CALL", "CALLSUB", "DEFSUB", "ENDSUB", "MACRO", "TERMAC", "LOOPST", "JUMPTO"), _CALL
    ),
    **dict.fromkeys(("TLLFT", "TLRGT", "TLON", "TLONPS", "TLOFPS", "TLNDON"), _DRIVE),
    **dict.fromkeys(("GO", "GOFWD", "GOBACK", "GOLFT", "GORGT", "GOUP", "GODOWN", "OFFSET", "POCKET", "SCURV"), _DRIVE),
    "TLCOMP": COMPENSATION,
    "PLUNGE": ("feeds the tool to where a post processor knows", "have the CAM system write the point"),
    "RETRCT": ("retracts the tool to a plane of the post processor's", "have the CAM system write the point"),
    "THREAD": ("cuts a thread", "leave threading out"),
    "ARC": ("is an arc of one post processor", "have the CAM system write CIRCLE/ or points"),
    "NURBS": ("is a NURBS curve", "have the CAM system write points"),
    "SPLINE": ("is a spline", "have the CAM system write points"),
    "POLYNO": ("is a polynomial", "have the CAM system write points"),
}
SHIFTS = {"TRANS": _SHIFT, "ORIGIN": _SHIFT}  # refused unless they are zero

# Read, not acted upon, and a warning: what they do hangs on the machine.
DOUBTFUL = {
    "AUXFUN": "an M code of one control: what it does is not known",
    "PREFUN": "a G code of one control: what it does is not known",
    "INSERT": "a block for the control as it stands: what it does is not known",
    "CSI_INSERT_CUSTOM_GCODE": "a block for the control as it stands: what it does is not known",
    "GOHOME": "home is the control's: the way there is not part of the path",
    "OPSKIP": "statements that the operator may leave out: they are read",
}
UNKNOWN = "is not known"
# An unknown word that begins like one of a motion or a feed, or that carries a point, is not passed over.
LIKE_MOTION = ("GO", "RAP", "FED", "CIR", "ARC", "MOV", "HEL", "CYC", "TLA", "TLO", "TLL", "TLR", "UNI", "MUL", "FRO")
NUMBERS_OF_A_POINT = 3


def meaning(word: str) -> str:
    """What a major word is taken for, for a list of the words used."""
    for table in (ACTED_UPON, HARMLESS, FRAMES, DOUBTFUL):
        if word in table:
            return table[word]
    if word == "CUTCOM":
        return COMPENSATION[0].removeprefix("is ")
    found = REFUSED.get(word.partition(",")[0]) or SHIFTS.get(word)
    return f"{found[0]}, not supported" if found else UNKNOWN
