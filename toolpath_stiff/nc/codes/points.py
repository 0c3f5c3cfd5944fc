"""Points: meaning of a block's axis words and polar words, and uncertainty after rotations. mm, degrees.

Polar words: Fanuc's operator's manuals of the series 16 and 15i, "Polar coordinate command" (G16).
"""

import math

from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, Word

LINEAR = frozenset("XYZ")
XY = frozenset((0, 1))
SAME_PLACE_MM = 1e-9
TURNED = "G10, or another work offset and M6, turned the coordinates: LinuxCNC's interpreter may have other ones"


def axis_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """Axis index -> value of the block's axis words in mm and degrees; marks them as used."""
    return {
        axis: value * (state.length_scale if letter in LINEAR else 1.0)
        for axis, letter in enumerate(AXES)
        if (value := block.take(letter)) is not None
    }


def point_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """`axis_words` of a block that moves in program coordinates: under G16 the second one is an angle."""
    if state.polar is None:
        words = axis_words(state, block)
        if state.unsettled:
            _settle(state, block, words)
        return words
    second = PLANES[state.plane][1]
    angle = block.take(AXES[second])
    return axis_words(state, block) | ({} if angle is None else {second: angle})


def cartesian(state: State, here: list[float], words: dict[int, float]) -> list[float]:
    """Point that words name in the distance mode in force, starting from `here`."""
    if state.absolute:
        return [words.get(axis, coordinate) for axis, coordinate in enumerate(here)]
    return [coordinate + words.get(axis, 0.0) for axis, coordinate in enumerate(here)]


def destination(state: State, block: CurrentBlock, here: list[float], words: dict[int, float]) -> list[float]:
    """Program coordinates of the point that words from `point_words` name, starting from `here`."""
    point = cartesian(state, here, words)
    first, second, _ = PLANES[state.plane]
    if state.polar is not None and (first in words or second in words):
        point[first], point[second] = _polar_point(state, block, words.get(first), words.get(second))
    return point


def control_point(state: State, block: CurrentBlock, here: list[float], words: dict[int, float]) -> list[float]:
    """Control coordinates of the point that words name.

    Where nothing turns, axis by axis: one that is not named keeps its number to the last digit, and a step is added to
    that number.
    """
    frames = state.frames
    point = frames.to_control(destination(state, block, here, words))
    if state.polar is None and not frames.rotated:
        return [
            point[axis] if state.absolute and axis in words else present + words.get(axis, 0.0)
            for axis, present in enumerate(frames.position)
        ]
    return point


def target(state: State, block: CurrentBlock) -> tuple[list[float], dict[int, float]]:
    """Control coordinates of the point that a block names, and the words that name it."""
    words = point_words(state, block)
    return control_point(state, block, state.frames.to_program(state.frames.position), words), words


def _polar_point(state: State, block: CurrentBlock, radius: float | None, angle: float | None) -> tuple[float, float]:
    """Point of G16's words, the last ones of which stay in force."""
    polar, letter = state.polar, AXES[PLANES[state.plane][0 if radius is not None else 1]]
    assert polar is not None
    if radius is not None:
        block.refuse_if(not state.absolute, letter, "is a polar radius in incremental mode (G91)", "G90 before it")
        polar[0] = radius
    if angle is not None:
        polar[1] = angle if state.absolute else polar[1] + angle
    half = math.isnan(polar[0]) or math.isnan(polar[1])
    block.refuse_if(half, letter, "is half of a polar point, without the other half", "both, in G90")
    state.unsettled = None
    turn = math.radians(polar[1])
    return (polar[0] * math.cos(turn), polar[0] * math.sin(turn))


def forget_polar(state: State) -> None:
    """Forget polar words when the tool or the zero moved otherwise: the next ones must give both."""
    if state.polar is not None:
        state.polar = [math.nan, math.nan]


def refuse_while_rotated(state: State, block: CurrentBlock, word: Word | str, what: str) -> None:
    """Refuse words that Fanuc's controls forbid between G68 and G69."""
    block.refuse_if(state.frames.rotation is not None, word, f"{what} while a rotation is on (G68)", "G69 before it")


def know_place(state: State, block: CurrentBlock, word: Word) -> None:
    """Refuse words that depend on the present X and Y after a G10 has rotated the offset in force."""
    block.refuse_if(state.unsettled == "G10", word, f"depends on the present X and Y. {TURNED}", "both before it")


def _settle(state: State, block: CurrentBlock, words: dict[int, float]) -> None:
    """Refuse words that a control may read as another point: X and Y had other numbers before the rotation changed."""
    named = XY & words.keys()
    if state.absolute and named == XY:
        state.unsettled = None
    elif state.unsettled == "G10":
        raise block.fail(None, f"{TURNED}, and the next move does not name both X and Y", "both, in G90")
    elif named and (state.absolute or state.unsettled == "G69"):
        word = block.values[AXES[min(named)]]
        raise block.fail(word, f"alone, or incremental, in the first move after {state.unsettled}", "X and Y, in G90")
