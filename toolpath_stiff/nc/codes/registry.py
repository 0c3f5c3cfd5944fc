"""The table of codes, with the user's text on each. A new code is a row beside its function in one of the files.

What is refused in every dialect stands here, with what it is, what to do instead, and the manual that has it.

Codes and modal groups follow LinuxCNC (its manual, "G-Code Overview", modal groups), because its interpreter is what
the results are compared with; polar words and rotation, which it does not have, follow Fanuc's controls.
"""

from toolpath_stiff.nc.codes.code import FANUC, HAAS, Code, g_codes, refused
from toolpath_stiff.nc.codes.coordinates import COORDINATE_CODES
from toolpath_stiff.nc.codes.corner import CORNER_CODES
from toolpath_stiff.nc.codes.cutter import CUTTER_CODES
from toolpath_stiff.nc.codes.drilling import DRILLING_CODES
from toolpath_stiff.nc.codes.feeds import FEED_CODES
from toolpath_stiff.nc.codes.flow import FLOW_CODES
from toolpath_stiff.nc.codes.modes import MODE_CODES
from toolpath_stiff.nc.codes.motion import MOTION_CODES
from toolpath_stiff.nc.codes.passive import PASSIVE_CODES
from toolpath_stiff.nc.codes.saved import SAVED_CODES
from toolpath_stiff.nc.codes.tools import TOOL_CODES

UNDERSTOOD = (
    *MOTION_CODES, *DRILLING_CODES, *MODE_CODES, *COORDINATE_CODES, *FEED_CODES, *TOOL_CODES, *FLOW_CODES,
    *CUTTER_CODES, *PASSIVE_CODES, *CORNER_CODES, *SAVED_CODES,
)  # fmt: skip
CODES: dict[str, Code] = {code.name: code for code in UNDERSTOOD}
LISTED = {code.name: code.listed for code in UNDERSTOOD if code.listed}

_TIP, _MOVES = "post X, Y, Z, A, B, C of the tool tip", "post the moves of the cycle"
_LINES_AND_ARCS, _AS_CUT = "post the program with lines and arcs", "post the program as it is cut"
_POLAR = (
    "milling in polar coordinates on a rotary axis",
    _TIP,
    f"{FANUC}, Polar coordinate interpolation (G12.1, G13.1)",
)
_PLANE = ("a plane of the U, V, W axes", "this machine has X, Y, Z, A, B, C", g_codes("G17 - G19.1"))
_LATHE_CYCLE = ("a lathe cycle", "this is a mill", g_codes("G70 Lathe finishing cycle; G71 G72 Lathe roughing cycles"))

REFUSED = refused((
    ("G5.2 G5.3", "a NURBS curve", _LINES_AND_ARCS, g_codes("G5.2 G5.3")),
    ("G7", "lathe diameter mode", "this is a mill", g_codes("G7")),
    ("G12 G13", "a circular pocket, drawn in the manual without numbers", _LINES_AND_ARCS, f"{HAAS}, G12 and G13"),
    ("G12.1", *_POLAR),
    ("G17.1 G18.1 G19.1", *_PLANE),
    ("G31", "a move up to a signal (skip, probing)", "leave probing out", f"{FANUC}, Skip function (G31)"),
    ("G33 G33.1", "motion synchronised with the spindle", "leave threading and rigid tapping out", g_codes("G33")),
    ("G38.2 G38.3 G38.4 G38.5", "probing", "leave probing out", g_codes("G38.2 - G38.5")),
    ("G43.2", "an added tool length", "put the whole length into the tool table", g_codes("G43.2")),
    ("G44", "a tool length counted the other way", "G43 with the length's other sign", f"{FANUC}, G43, G44"),
    ("G47", "engraving in the control's own letters", _LINES_AND_ARCS, f"{HAAS}, G47"),
    ("G51", "scaling", "post the program at its size", f"{FANUC}, Scaling (G50, G51)"),
    ("G51.1", "mirror image", _AS_CUT, f"{FANUC}, Programmable mirror image (G50.1, G51.1)"),
    ("G53.1", "the tool turned to a tilted work plane", _TIP, f"{FANUC}, Tool axis direction control (G53.1)"),
    ("G68.2", "a tilted work plane", _TIP, f"{FANUC}, Tilted working plane indexing (G68.2)"),
    ("G71.1 G71.2 G72 G72.1 G72.2", *_LATHE_CYCLE),
    ("G87", "back boring", _MOVES, g_codes("G87")),
    ("G88", "boring with manual feed out", _MOVES, g_codes("G88")),
    ("G101", "mirror image", _AS_CUT, f"{HAAS}, G101"),
    ("G107", "cylindrical mapping", "post X, Y, Z, A of the tool tip", f"{HAAS}, G107"),
    ("G150", "a pocket cycle around a subprogram's contour", _LINES_AND_ARCS, f"{HAAS}, G150"),
))  # fmt: skip


def code_meaning(name: str) -> str:
    """Meaning of a code to the reader, in a few words.

    Examples
    --------
    >>> code_meaning("G2"), code_meaning("M8"), code_meaning("G87")
    ('clockwise arc', 'coolant: not acted upon', 'back boring: not supported')
    """
    if name in LISTED:
        return f"{LISTED[name]}: not acted upon"
    if name in CODES:
        return CODES[name].meaning
    if name in REFUSED:
        return f"{REFUSED[name].what}: not supported"
    return "not known" if name.startswith("G") else "an M code of one control: not acted upon"
