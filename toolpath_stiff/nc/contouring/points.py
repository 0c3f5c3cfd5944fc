"""Points and feeds that the words of a statement name: axis words and their steps, polar words, F. mm, degrees.

HEIDENHAIN, user's manual of the iTNC 530, "Fundamentals of positioning", "Polar coordinates", "Feed rate F"; SIEMENS,
SINUMERIK 840D sl, Programming Manual Fundamentals, "Travel commands with polar coordinates".
"""

import cmath
import math
from collections.abc import Iterator
from contextlib import contextmanager

from toolpath_stiff.nc.codes.feeds import SLOWEST
from toolpath_stiff.nc.geometry import PLANES, turned
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES
from toolpath_stiff.units import MM_PER_INCH

WORDS_OF_AXES = {f"{step}{letter}": axis for axis, letter in enumerate(AXES) for step in ("", "I")}
ROTARY = "A, B, C are roll, pitch and yaw of the platform: where they are another machine's axes, [kinematics] says so"
FREE_POLE = "FPOL"  # of free contours alone: the user's manual asks for a new CC behind them
ON_CIRCLE_MM = 0.016  # how far an end may lie off its circle (user's manual, "Circular path C")


def present(state: State) -> list[float]:
    """Programmed point in program axes: the end of a waiting element, the contour point of an APPR."""
    plain, here = state.plain, state.frames.to_program(state.frames.position)
    if plain.held is not None:
        first, second, _ = PLANES[state.plane]
        here[first], here[second] = plain.held[1][1].real, plain.held[1][1].imag
    elif plain.approach is not None:
        here = [plain.approach[0].get(axis, value) for axis, value in enumerate(here)]
    return here


def outside_contour(state: State, block: CurrentBlock, what: str, also: object = False) -> None:
    """Refuse a statement not allowed in a contour: with compensation, between a corner and its element, after APPR."""
    plain = state.plain
    waits = state.cutter is not None or plain.held or plain.approach or plain.free or also
    problem = f"{what} inside a contour with compensation or a corner"
    block.refuse_if(waits, None, problem.strip(), "R0 or G40, and a positioning, before it")


def in_plane(state: State, point: list[float]) -> complex:
    """The two in-plane coordinates of a point."""
    first, second, _ = PLANES[state.plane]
    return complex(point[first], point[second])


def end_of(state: State, there: dict[int, float]) -> complex:
    """End of a move in the plane; coordinates that its words do not give are the present ones."""
    return in_plane(state, [there.get(axis, value) for axis, value in enumerate(present(state))])


def named(state: State, block: CurrentBlock) -> dict[int, float]:
    """Axis -> coordinate of the axis words, steps added to the present point; marks the words as used."""
    words = block.free & WORDS_OF_AXES.keys()
    relative = state.plain.shorter or any(letter[0] == "I" for letter in words)
    here, there = present(state) if relative else [], dict[int, float]()
    for letter in sorted(words):
        axis, value = WORDS_OF_AXES[letter], block.values[letter].value
        value = value * state.length_scale if axis < 3 else value
        block.refuse_if(axis in there, letter, "and its step are both given", "one of them")
        there[axis] = here[axis] + value if letter[0] == "I" else value
        if axis > 2 and value and state.frames.posted is None and state.plain.tilt is None:
            state.assume(ROTARY)
        if letter[0] != "I" and axis > 2 and state.plain.shorter:  # M126
            there[axis] = here[axis] + math.remainder(value - here[axis], 360.0)
    block.free -= words
    return there


@contextmanager
def plane_of_pole(state: State, block: CurrentBlock) -> Iterator[complex]:
    """The pole in its own plane, which is in force meanwhile: CC X Z in G17 gives a circle in ZX."""
    if state.plain.pole is None or state.plain.pole[0] == FREE_POLE:
        problem = "without a circle centre or pole, or after a change of the coordinates"
        raise block.fail(None, problem, "CC before it")
    kept, (state.plane, pole) = state.plane, state.plain.pole
    plain, other = state.plain, state.plane != kept
    waits = state.cutter or state.beside or plain.held or plain.to_corner or plain.approach
    try:
        block.refuse_if(other and waits, None, f"in another plane than {kept}, beside a corner or RL, RR", "R0 before")
        yield pole
    finally:
        state.plane = kept
    plain.heading = None if other else plain.heading


def polar(state: State, block: CurrentBlock, pole: complex) -> dict[int, float]:
    """Axis -> coordinate of PR and PA about the pole, and of the other axis words."""
    here = in_plane(state, present(state)) - pole
    radius, step = block.take("PR"), block.take("IPR")
    angle, turn = block.take("PA"), block.take("IPA")
    size = abs(here) if radius is None else radius * state.length_scale
    size += (step or 0.0) * state.length_scale
    lost = abs(here) < ON_CIRCLE_MM and angle is None
    block.refuse_if(lost, None, "takes the polar angle of the pole itself", "PA")
    heading = (math.degrees(cmath.phase(here)) if angle is None else angle) + (turn or 0.0)
    place = pole + turned(heading, size)
    first, second, _ = PLANES[state.plane]
    return named(state, block) | {first: place.real, second: place.imag}


def feed(state: State, block: CurrentBlock) -> bool:
    """Take F; returns True for FMAX, which holds for its statement only."""
    value, rapid = block.take("F"), "FMAX" in block.values
    block.take("FMAX")
    if value is not None:
        state.feed = value * inch_tenths(state)
        block.refuse_if(not state.feed >= SLOWEST, "F", "is no feed that moves", "F above 0")
    if block.take("FAUTO") is not None:
        block.refuse_if(
            state.plain.tool_feed is None, "FAUTO", "without F in TOOL CALL", "F with a number, or --feed MM_PER_MIN"
        )
        state.feed = state.plain.tool_feed
    return rapid


def inch_tenths(state: State) -> float:
    """Feed of F 1 in mm/min: in inch programs a tenth of an inch a minute (user's manual, "Feed rate F")."""
    return MM_PER_INCH / 10.0 if state.inch else 1.0
