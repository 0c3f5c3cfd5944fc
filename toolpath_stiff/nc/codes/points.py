"""What the axis words of a block mean: points and steps, Cartesian or polar (G15 G16, @ ^). mm and degrees.

G16 follows Fanuc's milling controls (operator's manuals of the series 16 and 15i, "Polar coordinate command"), @ and ^
LinuxCNC ("G-Code Overview", "Polar Coordinates"). Where these leave the point to parameters or forbid the block, it is
refused.
"""

from __future__ import annotations

import math

from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import CurrentBlock
from toolpath_stiff.nc.codes.contract import POLAR, Code
from toolpath_stiff.nc.codes.turning import SAME_PLACE_MM, settle
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.words import AXES

LINEAR = frozenset("XYZ")


def axis_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """Axis index -> value of the block's axis words in mm and degrees; they are thereby used."""
    found = {}
    for index, letter in enumerate(AXES):
        value = block.take(letter)
        if value is not None:
            found[index] = value * state.length_scale if letter in LINEAR else value
    return found


def point_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """As `axis_words`, of a block that moves in program coordinates: under G16 the second one is an angle."""
    block.spoke = None
    if block.has("@") or block.has("^"):
        return _at_radius_and_angle(state, block)
    if state.polar is None:
        words = axis_words(state, block)
        if state.unsettled:
            settle(state, block, words)
        return words
    second = arcs.PLANES[state.plane][1]
    angle = block.take(AXES[second])
    words = axis_words(state, block)
    if angle is not None:
        words[second] = angle
    return words


def cartesian(state: State, here: list[float], words: dict[int, float]) -> list[float]:
    """The point that words name in the distance mode in force, coming from `here`."""
    point = list(here)
    for axis, value in words.items():
        point[axis] = coordinate(state, here[axis], value)
    return point


def coordinate(state: State, here: float, value: float) -> float:
    """The coordinate that an axis word names: that number (G90), or that far from `here` (G91)."""
    return value if state.absolute else here + value


def destination(state: State, block: CurrentBlock, here: list[float], words: dict[int, float]) -> list[float]:
    """Program coordinates of the point that words from `point_words` name, coming from `here`."""
    point = cartesian(state, here, words)
    if state.polar is not None:
        first, second, _ = arcs.PLANES[state.plane]
        if first in words or second in words:
            point[first], point[second] = _polar_point(state, block, words.get(first), words.get(second))
    return point


def control_point(state: State, block: CurrentBlock, here: list[float], words: dict[int, float]) -> list[float]:
    """Control coordinates of that point.

    Where nothing turns, axis by axis: one that is not named keeps its number to the last digit, and a step is added to
    that number.
    """
    frames = state.frames
    point = frames.to_control(destination(state, block, here, words))
    if state.polar is None and not frames.rotated:
        for axis, present in enumerate(frames.position):
            if axis not in words:
                point[axis] = present
            elif not state.absolute:
                point[axis] = present + words[axis]
    return point


# -- LinuxCNC's polar words ------------------------------------------------------------------------------------------


def _at_radius_and_angle(state: State, block: CurrentBlock) -> dict[int, float]:
    """LinuxCNC's polar words: @ the radius, ^ the angle about the program zero, of the XY plane.

    As measured on `rs274` 2.9: the one that is absent is that of the present point; in G91 both add to it.
    """
    word = block.values["@" if block.has("@") else "^"]
    if state.dialect.increments:
        raise block.fail(word, f"is not a word of the dialect {state.dialect.name}", "X and Y, or G16")
    if state.plane != "G17" or state.polar is not None or state.unsettled or state.frames.rotation is not None:
        raise block.fail(word, "is a polar word outside of G17, or under G16 or a rotation", "X and Y")
    if block.has("X") or block.has("Y"):
        raise block.fail(word, "is a polar word beside X or Y", "either")
    block.spoke = (word, block.take("@"), block.take("^"))
    return {**axis_words(state, block), **xy_of_spoke(state, block)}


def xy_of_spoke(state: State, block: CurrentBlock) -> dict[int, float]:
    """X and Y, as words in the distance mode in force, of the block's polar words at the present point."""
    assert block.spoke is not None
    word, radius, angle = block.spoke
    here = state.frames.to_program(state.frames.position)
    present, turn = math.hypot(here[0], here[1]), math.atan2(here[1], here[0])
    if present < SAME_PLACE_MM and (radius is None or angle is None or not state.absolute):
        raise block.fail(word, "counts from the present point, which is the program zero", "both @ and ^, in G90")
    if radius is not None:
        present = radius * state.length_scale + (0.0 if state.absolute else present)
    if angle is not None:
        turn = math.radians(angle) + (0.0 if state.absolute else turn)
    point = (present * math.cos(turn), present * math.sin(turn))
    return {axis: value if state.absolute else value - here[axis] for axis, value in enumerate(point)}


# -- G16 -------------------------------------------------------------------------------------------------------------


def polar_mode(state: State, block: CurrentBlock, code: str) -> None:
    """G16: the plane's first axis word is a radius, the second an angle. G15: they are Cartesian."""
    state.polar = [math.nan, math.nan] if code == "G16" else None


def _polar_point(state: State, block: CurrentBlock, radius: float | None, angle: float | None) -> tuple[float, float]:
    first, second = (AXES[axis] for axis in arcs.PLANES[state.plane][:2])
    polar = state.polar
    assert polar is not None
    if radius is not None:
        if not state.absolute:
            raise block.fail(
                block.values[first],
                "is a polar radius in incremental mode (G91)",
                "a radius from the program zero (G90); the angle alone may be incremental",
            )
        polar[0] = radius
    if angle is not None:
        polar[1] = angle if state.absolute else polar[1] + angle
    if math.isnan(polar[0]) or math.isnan(polar[1]):
        raise block.fail(
            block.values[second if radius is None else first],
            "is half of a polar point, and nothing before says the other half",
            f"{first} (radius) and {second} (angle), absolute",
        )
    state.unsettled = None
    turn = math.radians(polar[1])
    return (polar[0] * math.cos(turn), polar[0] * math.sin(turn))


_FANUC = "Fanuc, operator's manuals of the series 16 and 15i, Polar coordinate command (G15, G16)"
CODES = (
    Code("G15", POLAR, polar_mode, "Cartesian words", _FANUC),
    Code("G16", POLAR, polar_mode, "polar words", _FANUC),
)
