"""Units, plane, distance modes, polar words: G20 G21 (G70 G71), G17 to G19, G90 G91, G90.1 G91.1, G15 G16."""

import math

from toolpath_stiff.nc.codes.code import FANUC, family, g_codes
from toolpath_stiff.nc.codes.points import forget_polar, refuse_while_rotated
from toolpath_stiff.nc.controller import INCH_METRIC
from toolpath_stiff.nc.state import CurrentBlock, State


def units(state: State, block: CurrentBlock, code: str) -> None:
    """G20: lengths and feeds in inches; G21: in millimetres."""
    inch = code == "G20"
    block.refuse_if(inch != state.inch and state.frames.tool, code, "while a tool length is in force", "G49 before it")
    state.inch = inch


def units_or_cycle(state: State, block: CurrentBlock, code: str) -> None:
    """G70, G71 that are not G20 and G21 by dialect or controller file: taken as units unless with a cycle's words."""
    what = "is inch or metric units on some controls, a cycle on others"
    hint = 'write G20 or G21, or give a controller file with inch_metric = "G70 G71"'
    block.refuse_if(block.values.keys() - {*"FS"}, code, what, hint=hint)
    state.assume("G70 and G71 without the words of a cycle are inch and mm (Siemens, Fagor, Mach3)")
    units(state, block, INCH_METRIC[code])


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


def polar_mode(state: State, block: CurrentBlock, code: str) -> None:
    """G16: the plane's first axis word is a radius, the second an angle. G15: they are Cartesian."""
    state.polar = [math.nan, math.nan] if code == "G16" else None


_INCH = f"{FANUC}, Inch/metric conversion (G20 G21, in G-code system C G70 G71)"
_CENTERS = {"G90.1": "absolute arc centres", "G91.1": "incremental arc centres"}
_POLAR = f"{FANUC} of the series 16 and 15i, Polar coordinate command (G15, G16)"
MODE_CODES = (
    *family({"G17": "plane XY", "G18": "plane ZX", "G19": "plane YZ"}, "plane", plane, g_codes("G17 - G19.1")),
    *family({"G20": "inch", "G21": "mm"}, "units", units, g_codes("G20 G21")),
    *family({"G70": "inch, as G20", "G71": "mm, as G21"}, "units", units_or_cycle, _INCH, ("generic", "fanuc")),
    *family({"G90": "absolute", "G91": "incremental"}, "distance", distance, g_codes("G90 G91")),
    *family(_CENTERS, "arc distance", arc_distance, g_codes("G90.1 G91.1")),
    *family({"G15": "Cartesian words", "G16": "polar words"}, "polar", polar_mode, _POLAR),
)
