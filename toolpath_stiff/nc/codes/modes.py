"""Units, plane, distance modes: G20 G21, G17 G18 G19, G90 G91, G90.1 G91.1."""

from __future__ import annotations

from toolpath_stiff.nc.blocks import CurrentBlock
from toolpath_stiff.nc.codes.contract import (
    ARC_DISTANCE,
    DISTANCE,
    PLANE,
    UNITS,
    Alias,
    Code,
    g_codes,
)
from toolpath_stiff.nc.codes.turning import forget_polar, refuse_while_rotated
from toolpath_stiff.nc.state import State


def units(state: State, block: CurrentBlock, code: str) -> None:
    """G20: lengths and feeds in inches; G21: in millimetres."""
    inch = code == "G20"
    if inch != state.inch and state.frames.tool:
        raise block.fail(
            block.codes[code], "while a tool length is in force: LinuxCNC would take its number anew", "G49 before it"
        )
    state.inch = inch


def plane(state: State, block: CurrentBlock, code: str) -> None:
    """G17, G18, G19: the plane of arcs, drilling cycles and polar words."""
    if code != state.plane:
        refuse_while_rotated(state, block, block.codes[code], "takes another plane")
        state.plane = code
        forget_polar(state)


def distance(state: State, block: CurrentBlock, code: str) -> None:
    """G90: axis words name points; G91: steps from the present one."""
    state.absolute = code == "G90"


def arc_distance(state: State, block: CurrentBlock, code: str) -> None:
    """G90.1: I, J, K name the centre; G91.1: its distance from the start."""
    state.arc_absolute = code == "G90.1"


_UNITS, _PLANE, _DISTANCE = g_codes("G20 G21"), g_codes("G17 - G19.1"), g_codes("G90 G91")
_FANUC = "Fanuc, operator's manuals, Inch/metric conversion (G20 G21, in G-code system C G70 G71)"
CODES = (
    Code("G17", PLANE, plane, "plane XY", _PLANE),
    Code("G18", PLANE, plane, "plane ZX", _PLANE),
    Code("G19", PLANE, plane, "plane YZ", _PLANE),
    Code("G20", UNITS, units, "inch", _UNITS),
    Code("G21", UNITS, units, "mm", _UNITS),
    Code("G90", DISTANCE, distance, "absolute", _DISTANCE),
    Code("G91", DISTANCE, distance, "incremental", _DISTANCE),
    Code("G90.1", ARC_DISTANCE, arc_distance, "absolute arc centres", g_codes("G90.1 G91.1")),
    Code("G91.1", ARC_DISTANCE, arc_distance, "incremental arc centres", g_codes("G90.1 G91.1")),
)
ALIASES = (
    Alias("G70", "G20", "inch", _FANUC, ("fanuc",)),
    Alias("G71", "G21", "mm", _FANUC, ("fanuc",)),
)
