"""Units, plane, distance modes: G20 G21, G17 G18 G19, G90 G91, G90.1 G91.1."""

from toolpath_stiff.nc.codes.code import FANUC, Alias, family, g_codes
from toolpath_stiff.nc.codes.polar import forget_polar
from toolpath_stiff.nc.codes.unsettled import refuse_while_rotated
from toolpath_stiff.nc.state import CurrentBlock, State


def units(state: State, block: CurrentBlock, code: str) -> None:
    """G20: lengths and feeds in inches; G21: in millimetres."""
    inch = code == "G20"
    if inch != state.inch and state.frames.tool:
        problem = "while a tool length is in force: LinuxCNC would read its number in the new unit"
        raise block.fail(code, problem, "G49 before it")
    state.inch = inch


def plane(state: State, block: CurrentBlock, code: str) -> None:
    """G17, G18, G19: the plane of arcs, drilling cycles and polar words."""
    if code != state.plane:
        refuse_while_rotated(state, block, code, "takes another plane")
        state.plane = code
        forget_polar(state)


def distance(state: State, block: CurrentBlock, code: str) -> None:
    """G90: axis words name points; G91: steps from the present one."""
    state.absolute = code == "G90"


def arc_distance(state: State, block: CurrentBlock, code: str) -> None:
    """G90.1: I, J, K name the centre; G91.1: its distance from the start."""
    state.arc_absolute = code == "G90.1"


_INCH = f"{FANUC}, Inch/metric conversion (G20 G21, in G-code system C G70 G71)"
_CENTERS = {"G90.1": "absolute arc centres", "G91.1": "incremental arc centres"}
MODE_CODES = (
    *family({"G17": "plane XY", "G18": "plane ZX", "G19": "plane YZ"}, "plane", plane, g_codes("G17 - G19.1")),
    *family({"G20": "inch", "G21": "mm"}, "units", units, g_codes("G20 G21")),
    *family({"G90": "absolute", "G91": "incremental"}, "distance", distance, g_codes("G90 G91")),
    *family(_CENTERS, "arc distance", arc_distance, g_codes("G90.1 G91.1")),
)
MODE_ALIASES = (Alias("G70", "G20", "inch", _INCH, ("fanuc",)), Alias("G71", "G21", "mm", _INCH, ("fanuc",)))
