"""Codes of Fanuc's and Haas' controls that change no path, and those that would and are refused with the reason.

The first are what programs begin with ("safe start"): they switch off what is refused where it is switched on.
"""

from __future__ import annotations

from toolpath_stiff.nc.codes.code import Code, Refused, holds_anyway
from toolpath_stiff.nc.codes.modes import _FANUC, _HAAS, _OURS
from toolpath_stiff.nc.state import POINT_WORDS, CurrentBlock, State


def stroke_check(state: State, block: CurrentBlock, code: str) -> None:
    """G22 X Y Z I J K, G23: the zone that the tool must not enter, and no zone."""
    for letter in (*POINT_WORDS, "I", "J", "K") if code == "G22" else ():
        block.take(letter)


def speed_watch(state: State, block: CurrentBlock, code: str) -> None:
    """G25, G26 P Q R I: whether the control watches that the spindle keeps its speed."""
    for letter in "PQRI":
        block.take(letter)


_OFF = "none is on, since switching it on is refused"


_STROKE, _WATCH = (
    f"{_FANUC}, Stored stroke check (G22, G23)",
    f"{_FANUC}, Spindle speed fluctuation detection (G25, G26)",
)


_MIRRORED = f"{_FANUC}, Programmable mirror image (G50.1, G51.1)"


OTHER_CODES = (
    Code(
        "G13.1", "polar interpolation", holds_anyway, "polar interpolation off",
        f"{_FANUC}, Polar coordinate interpolation (G12.1, G13.1)", _OURS, listed=_OFF,
    ),
    Code("G50.1", "mirror image", holds_anyway, "mirror image off", _MIRRORED, _OURS, listed=_OFF),
    Code("G100", "mirror image", holds_anyway, "mirror image off", f"{_HAAS}, G100", ("generic", "haas"), listed=_OFF),
    Code(
        "G22", "stroke check", stroke_check, "stored stroke check on", _STROKE, _OURS, takes_axes=True,
        listed="the zone that the tool must not enter",
    ),
    Code(
        "G23", "stroke check", stroke_check, "stored stroke check off", _STROKE, _OURS,
        listed="no zone that the tool must not enter",
    ),
    Code("G25", "speed watch", speed_watch, "spindle speed not watched", _WATCH, _OURS, listed="the spindle's speed"),
    Code("G26", "speed watch", speed_watch, "spindle speed watched", _WATCH, _OURS, listed="the spindle's speed"),
    Code(
        "G62", "path control", holds_anyway, "automatic corner override", f"{_FANUC}, Automatic corner override (G62)",
        _OURS, listed="slower feed in corners",
    ),
    Code(
        "G63", "path control", holds_anyway, "tapping mode", f"{_FANUC}, Tapping mode (G63)", _OURS,
        listed="no override of the feed",
    ),
)  # fmt: skip


_MIRROR = ("mirror image", "post the program as it is cut")


OTHER_REFUSED = (
    Refused("G31", "a move up to a signal (skip, probing)", "leave probing out", f"{_FANUC}, Skip function (G31)"),
    Refused("G44", "a tool length counted the other way", "G43 with the length's other sign", f"{_FANUC}, G43, G44"),
    Refused("G47", "engraving in the control's own letters", "post the program with lines and arcs", f"{_HAAS}, G47"),
    Refused("G51.1", *_MIRROR, _MIRRORED),
    Refused(
        "G53.1", "the tool turned to a tilted work plane", "post X, Y, Z, A, B, C of the tool tip",
        f"{_FANUC}, Tool axis direction control (G53.1)",
    ),
    Refused("G101", *_MIRROR, f"{_HAAS}, G101"),
    Refused("G107", "cylindrical mapping", "post X, Y, Z, A of the tool tip", f"{_HAAS}, G107"),
)  # fmt: skip
