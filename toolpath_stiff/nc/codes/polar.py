"""Polar coordinates: LinuxCNC's @ and ^, Fanuc's G15 and G16. mm and degrees.

Sources: LinuxCNC, "G-Code Overview", "Polar Coordinates"; Fanuc's operator's manuals of the series 16 and 15i, "Polar
coordinate command".
"""

import math

from toolpath_stiff.nc.codes.code import FANUC, family
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

SAME_PLACE_MM = 1e-9


def polar_mode(state: State, block: CurrentBlock, code: str) -> None:
    """G16: the plane's first axis word is a radius, the second an angle. G15: they are Cartesian."""
    state.polar = [math.nan, math.nan] if code == "G16" else None


def at_radius_and_angle(state: State, block: CurrentBlock) -> dict[int, float]:
    """LinuxCNC's polar words: @ the radius, ^ the angle about the program zero, of the XY plane.

    As measured on `rs274` 2.9: the one that is absent is that of the present point; in G91 both add to it.
    """
    word = block.values["@" if block.has("@") else "^"]
    turned = state.polar is not None or state.unsettled or state.frames.rotation is not None
    if state.dialect.increments or state.plane != "G17" or turned or block.has("X") or block.has("Y"):
        problem = "is a polar word of LinuxCNC's, beside X or Y, outside of G17, or under G16 or a rotation"
        raise block.fail(word, problem, "X and Y, or G16")
    block.polar_words = (word, block.take("@"), block.take("^"))
    return xy_of_polar_words(state, block)


def xy_of_polar_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """X and Y, as words in the distance mode in force, of the block's polar words at the present point."""
    assert block.polar_words is not None
    word, radius, angle = block.polar_words
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


def polar_point(state: State, block: CurrentBlock, radius: float | None, angle: float | None) -> tuple[float, float]:
    """The point of G16's words, of which the last ones hold on."""
    polar, letter = state.polar, AXES[PLANES[state.plane][0 if radius is not None else 1]]
    assert polar is not None
    if radius is not None:
        if not state.absolute:
            raise block.fail(
                letter, "is a polar radius in incremental mode (G91)", "G90; the angle alone may be in G91"
            )
        polar[0] = radius
    if angle is not None:
        polar[1] = angle if state.absolute else polar[1] + angle
    if math.isnan(polar[0]) or math.isnan(polar[1]):
        raise block.fail(letter, "is half of a polar point, and nothing before it gives the other half", "both, in G90")
    state.unsettled = None
    turn = math.radians(polar[1])
    return (polar[0] * math.cos(turn), polar[0] * math.sin(turn))


def forget_polar(state: State) -> None:
    """The tool or the zero moved by other than polar words: the next ones must name both."""
    if state.polar is not None:
        state.polar = [math.nan, math.nan]


_POLAR = f"{FANUC} of the series 16 and 15i, Polar coordinate command (G15, G16)"
POLAR_CODES = family({"G15": "Cartesian words", "G16": "polar words"}, "polar", polar_mode, _POLAR)
