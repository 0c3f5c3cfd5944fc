"""What the axis words of a block mean: points and steps. mm and degrees."""

from toolpath_stiff.nc.codes.polar import at_radius_and_angle, polar_point
from toolpath_stiff.nc.codes.unsettled import settle
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

LINEAR = frozenset("XYZ")


def axis_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """Axis index -> value of the block's axis words in mm and degrees; they then count as used."""
    values = {axis: block.take(letter) for axis, letter in enumerate(AXES)}
    return {
        axis: value * (state.length_scale if axis < len(LINEAR) else 1.0)
        for axis, value in values.items()
        if value is not None
    }


def point_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """As `axis_words`, of a block that moves in program coordinates: under G16 the second one is an angle."""
    block.polar_words = None
    if block.has("@") or block.has("^"):
        xy = at_radius_and_angle(state, block)
        return {**axis_words(state, block), **xy}
    if state.polar is None:
        words = axis_words(state, block)
        if state.unsettled:
            settle(state, block, words)
        return words
    second = PLANES[state.plane][1]
    angle = block.take(AXES[second])
    words = axis_words(state, block)
    if angle is not None:
        words[second] = angle
    return words


def cartesian(state: State, here: list[float], words: dict[int, float]) -> list[float]:
    """The point that words name in the distance mode in force, coming from `here`."""
    point = list(here)
    for axis, value in words.items():
        point[axis] = value if state.absolute else here[axis] + value
    return point


def destination(state: State, block: CurrentBlock, here: list[float], words: dict[int, float]) -> list[float]:
    """Program coordinates of the point that words from `point_words` name, coming from `here`."""
    point = cartesian(state, here, words)
    if state.polar is not None:
        first, second, _ = PLANES[state.plane]
        if first in words or second in words:
            point[first], point[second] = polar_point(state, block, words.get(first), words.get(second))
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
