"""Table of statements of the plain language: head, function, meaning, source; and refused statements with reasons.

The functions are in `contouring`, `approach`, `circles`, `coordinates`, `cycles`, `functions`; `run` carries out the
flow (LBL, CALL, FN). M functions that mean what they mean in G code are the one table's (`codes.registry`).
"""

import re
from functools import lru_cache

from toolpath_stiff.nc.codes.code import Code, Rows, holds_anyway, refused, table
from toolpath_stiff.nc.codes.registry import code_meaning
from toolpath_stiff.nc.contouring import contour, tilting
from toolpath_stiff.nc.heidenhain import approach, circles, coordinates, cycles, free_contour, functions, tools

CONTROLS = ("heidenhain",)
MANUAL = "HEIDENHAIN, user's manual of the iTNC 530"
PATHS, POLAR = f"{MANUAL}, Path contours: Cartesian coordinates", f"{MANUAL}, Path contours: Polar coordinates"
_CYCLES = "HEIDENHAIN, user's manual Cycles of the iTNC 530"
_DRILLING, _TRANSFORM = f"{_CYCLES}, Fixed cycles: drilling", f"{_CYCLES}, Coordinate transformation cycles"
_TAPPING, _PATTERNS = f"{_CYCLES}, Fixed cycles: tapping", f"{_CYCLES}, Pattern definitions"
_APPROACH, _TOOLS = f"{MANUAL}, Contour approach and departure", f"{MANUAL}, Tool data"
_PLANE, _FLOW = f"{MANUAL}, The PLANE function", f"{MANUAL}, Subprograms and program section repeats"
_Q, _BASICS = f"{MANUAL}, Programming: Q parameters", f"{MANUAL}, Fundamentals of programming"
_SPECIAL, _FREE = f"{_CYCLES}, Special cycles", f"{MANUAL}, Path contours: FK free contour programming"


def _parts(cycle: int, first: int, last: int) -> str:
    """Statements of which a cycle of older controls consists."""
    return "|".join(f"CYCL DEF {cycle}.{part}" for part in range(first, last + 1))


_SILENT, _LISTED = functions.nothing, functions.listed
# Modal group, source, and names with function and meaning.
_ROWS: Rows = (
    ("units", _BASICS, (("BEGIN PGM", functions.units, "begin, with the unit of length"),)),
    ("motion", PATHS, (
        ("L", contour.line, "straight"),
        ("CC", circles.pole, "circle centre, pole"),
        ("C", circles.circle, "arc about CC"),
        ("CR", contour.radius_circle, "arc of a radius"),
        ("CT", contour.tangent_circle, "arc that goes on smoothly"),
        ("CHF", free_contour.rounding, "chamfer of the corner to the next element"),
        ("RND", free_contour.rounding, "rounding of the corner to the next element"),
    )),
    ("motion", POLAR, (
        ("LP", contour.polar_line, "straight, in polar coordinates"),
        ("CP", circles.circle, "arc about CC by a polar angle, helix"),
        ("CTP", contour.tangent_circle, "arc that goes on smoothly, in polar coordinates"),
    )),
    ("motion", _FREE, (
        ("FPOL", circles.pole, "pole of a free contour"),
        ("FL|FC|FLT|FCT", free_contour.free_element, "straight, arc of a free contour; the latter two go on smoothly"),
    )),
    ("motion", f"{MANUAL}, Three-dimensional tool compensation", (
        ("LN", tilting.vectors, "straight, with a tool axis"),
    )),
    ("motion", _APPROACH, (
        ("APPR LT|APPR LN|APPR CT|APPR LCT|APPR PLT|APPR PLN|APPR PCT|APPR PLCT", approach.approach,
         "approach of a contour"),
        ("DEP LT|DEP LN|DEP CT|DEP LCT|DEP PLCT", approach.depart, "departure from a contour"),
    )),
    ("M tool change", _TOOLS, (
        ("TOOL CALL", tools.tool_call, "tool, tool axis, speed, feed"),
        ("TOOL DEF", tools.tool_definition, "length and radius of a tool, or the next tool"),
    )),
    ("dynamic offset", _TRANSFORM, (
        (f"{_parts(7, 1, 6)}|TRANS DATUM AXIS|TRANS DATUM RESET", coordinates.shift, "shift"),
        ("CYCL DEF 8.1", coordinates.mirror, "mirror image"),
        ("CYCL DEF 10.1", coordinates.rotation, "rotation"),
        ("CYCL DEF 11.1", coordinates.scale, "scale"),
        ("CYCL DEF 19.1", coordinates.tilt, "tilted plane"),
        ("CYCL DEF 247", coordinates.datum, "datum of the preset table"),
        ("CYCL DEF 7.0|CYCL DEF 8.0|CYCL DEF 10.0|CYCL DEF 11.0|CYCL DEF 19.0", _SILENT, "heading of its cycle"),
    )),
    ("dynamic offset", _PLANE, (
        ("PLANE SPATIAL", coordinates.tilt, "tilted plane by spatial angles"),
        ("PLANE RESET", coordinates.tilt, "no tilted plane"),
        ("PLANE AXIAL", coordinates.tilt, "tilted plane by the machine's axes: angles of 0 alone"),
    )),
    ("tool length", f"{MANUAL}, FUNCTION TCPM", (
        ("FUNCTION TCPM|FUNCTION RESET TCPM", coordinates.hold_tip, "tool centre point control"),
    )),
    ("motion", _DRILLING, (
        ("CYCL DEF 200", cycles.define, "drilling, with pecks"),
        ("CYCL DEF 201", cycles.define, "reaming"),
        ("CYCL DEF 202", cycles.define, "boring"),
        ("CYCL DEF 203", cycles.define, "drilling, with pecks and chip breaking"),
        ("CYCL DEF 205", cycles.define, "deep drilling"),
        ("CYCL DEF 240", cycles.define, "centring"),
        ("CYCL DEF 241", cycles.define, "single-lip drilling"),
        ("CYCL DEF 208", cycles.define, "bore milling on a helix"),
        (_parts(1, 0, 5), cycles.define_older, "pecking, of older controls"),
        ("CYCL CALL|CYCL CALL POS|CYCL CALL PAT", cycles.call_statement, "carries out the cycle"),
    )),
    ("motion", _TAPPING, (
        ("CYCL DEF 206|CYCL DEF 207|CYCL DEF 209", cycles.define, "tapping"),
        (f"{_parts(2, 0, 4)}|{_parts(17, 0, 3)}", cycles.define_older, "tapping, of older controls"),
    )),
    ("motion", f"{_CYCLES}, Fixed cycles: pocket milling, stud milling, slot milling", (
        ("CYCL DEF 251|CYCL DEF 252|CYCL DEF 253|CYCL DEF 256|CYCL DEF 257", cycles.define,
         "rectangular, circular pocket; slot; rectangular, circular stud"),
        (f"{_parts(4, 0, 6)}|{_parts(5, 0, 5)}", cycles.define_older, "pockets, of older controls"),
    )),
    ("motion", f"{_CYCLES}, Fixed cycles: contour pocket, contour trains", (
        ("CYCL DEF 14.0|CYCL DEF 14.1", _SILENT, "labels of contours"),
        ("CYCL DEF 20|CYCL DEF 22|CYCL DEF 23|CYCL DEF 24|CYCL DEF 25", cycles.define,
         "contour pockets: shared data, rough-out, floor and side finishing; contour train"),
    )),
    ("motion", _PATTERNS, (
        ("CYCL DEF 220|CYCL DEF 221", cycles.define, "the cycle on a circle, on lines"),
        ("PATTERN DEF", _SILENT, "points, rows, patterns, circles for CYCL CALL PAT"),
    )),
    ("motion", _SPECIAL, (("CYCL DEF 300", functions.left_out, "300 to 399: the machine builder's, left out"),)),
    ("motion", f"{_CYCLES}, Touch probe cycles", (("TCH PROBE", functions.left_out, "probing, left out"),)),
    ("dwell", _SPECIAL, (("CYCL DEF 9.1|FUNCTION DWELL TIME", functions.dwell, "dwell"),)),
    ("path control", _SPECIAL, (
        (f"CYCL DEF 9.0|{_parts(13, 0, 1)}|{_parts(32, 0, 3)}", _LISTED,
         "dwell, spindle angle, tolerance: changes no path"),
    )),
    ("M subprogram", _FLOW, (("LBL", _SILENT, "label"), ("CALL LBL|CALL PGM", _SILENT, "call"))),
    ("M stop", _BASICS, (("STOP|M", holds_anyway, "M functions alone"), ("END PGM", _SILENT, "end"))),
    ("non-modal", _Q, (
        ("Q|FN0|FN1|FN2|FN3|FN4|FN5|FN6|FN7|FN8|FN13", _SILENT, "Q parameter"),
        ("QS|DECLARE STRING", _LISTED, "a text: not known where a tool, a label or a program is called by it"),
        ("FN9|FN10|FN11|FN12", _SILENT, "jump on a condition"),
        ("FN14", _SILENT, "error: the program stops"),
        ("FN18", _LISTED, "data of the control: tool, datum shift, rotation, scale; others are not known"),
        ("FN28", _LISTED, "data of the control: the parameter is not known from there on"),
        ("FN15|FN16|FN19|FN20|FN26|FN27|FN29|FN37|FN38", _LISTED, "message, PLC, table: changes no path"),
    )),
    ("non-modal", _BASICS, (
        ("BLK FORM 0.1|BLK FORM 0.2", tools.blank, "corner of the blank"),
        ("BLK FORM CYLINDER|BLK FORM ROTATION|BLK FORM FILE|FUNCTION MODE|SEL TABLE|FUNCTION FEED|FUNCTION SPINDLE"
         "|FUNCTION DCM|FUNCTION AFC|FUNCTION COUNT",
         _LISTED, "changes no path"),
    )),
)  # fmt: skip
STATEMENTS = table(_ROWS, CONTROLS, "|")
OWN = {
    "M89": "the cycle after each positioning", "M99": "the cycle here", "M91": "machine coordinates",
    "M92": "points of the machine builder", "M126": "rotary axes go the shorter way", "M127": "they go as programmed",
    "M128": "tool centre point control", "M129": "tool centre point control off", "M140": "retract along the tool",
}  # fmt: skip
_BY_MOVES = "post the moves of the cycle"
_REFUSED = (
    ("FSELECT", "a choice of solutions that the manual only draws", "convert the FK program to L and C", _FREE),
    ("PLANE PROJECTED, PLANE EULER, PLANE VECTOR, PLANE POINTS, PLANE RELATIV, PLANE RELATIVE",
     "a tilted plane given otherwise", "PLANE SPATIAL", _PLANE),
    ("CYCL DEF 204", "back boring", _BY_MOVES, _DRILLING),
    ("SEL, CALL", "points or programs of other files", "post the points one by one, CALL PGM", _PATTERNS),
    ("FN17", "data of the control", "put the numbers into the program", _Q),
    ("SPL", "a spline", "post lines and arcs", PATHS),
)  # fmt: skip
REFUSED = refused(_REFUSED, ", ")


_BUILDERS, _PARAMETER = re.compile(r"CYCL DEF 3\d\d"), re.compile(r"(Q[LRS]?)\d")


@lru_cache(256)
def look_up(head: str) -> Code | None:
    """Row of a statement's head; Q parameters have the row "Q", the machine builder's cycles that of 300."""
    head = "TCH PROBE" if head.startswith("TCH PROBE") else "CYCL DEF 300" if _BUILDERS.fullmatch(head) else head
    parameter = _PARAMETER.match(head)
    return STATEMENTS.get(parameter[1].rstrip("LR") if parameter else head * (head != "Q"))


def refusal_of(head: str) -> tuple[str, str]:
    """Description of a statement without a row, and what to do instead."""
    for name in (head, " ".join(head.split()[:2]), head.split(maxsplit=1)[0]):
        if name in REFUSED:
            return f"is {REFUSED[name].what}, which is not supported", REFUSED[name].hint
    if head.startswith("CYCL DEF"):
        return "is a cycle that is not supported", _BY_MOVES
    return "is no statement that is known", "check the program, or post it without it"


def meaning_of(name: str) -> str:
    """Meaning of a statement or M function to the reader.

    Examples
    --------
    >>> meaning_of("CR"), meaning_of("M118")
    ('arc of a radius', 'moves by the handwheel: not acted upon')
    """
    if name[0] == "M" and name[1:].isdigit():
        passive = functions.PASSIVE.get(name)
        return OWN.get(name) or (f"{passive}: not acted upon" if passive else code_meaning(name))
    row = look_up(name)
    return row.meaning if row is not None else refusal_of(name)[0]
