"""What a number without a decimal point counts: whole units, or the least increments of Fanuc's and Haas' controls.

Sources: Fanuc's operator's manuals ("Decimal point programming"), Haas' "Help with the decimal points".
"""

from __future__ import annotations

from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import CurrentBlock
from toolpath_stiff.nc.codes.contract import ONCE, PLANE, POLAR, ROTATION, UNITS
from toolpath_stiff.nc.dialects import GENERIC, INCREMENT_DEGREE, INCREMENT_INCH, INCREMENT_MM
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.words import AXES

ANGLES = frozenset("ABC")
LENGTHS = frozenset("XYZIJKRQ")
INCREMENTS = (
    "lengths and angles without a decimal point count least increments (0.001 mm, 0.0001 inch, 0.001 degrees: IS-B), "
    "as the dialect {} has it"
)
MIXED = (
    "some lengths end with their decimal point (X10.), and {} in line {} has none: Fanuc's and Haas' controls count "
    "such a number in 0.001 mm or 0.0001 inch; here it counts whole units, unless --dialect says otherwise"
)


def read_numbers(state: State, block: CurrentBlock) -> None:
    """Give the block's words their values in program units, by the dialect's decimal-point rule."""
    if not state.dialect.increments:
        if watches_points(state):
            _watch_points(state, block)
        return
    inch = block.groups.get(UNITS, "G20" if state.inch else "G21") == "G20"
    angles = set(ANGLES)
    if block.groups.get(ROTATION) == "G68":
        angles.add("R")
    polar = block.groups[POLAR] == "G16" if POLAR in block.groups else state.polar is not None
    if polar and ONCE not in block.groups:
        angles.add(AXES[arcs.PLANES[block.groups.get(PLANE, state.plane)][1]])
    for letter, word in block.values.items():
        if "." in word.text or not word.value or not (letter in LENGTHS or letter in angles):
            continue
        block.values[letter] = word._replace(value=word.value * increment(letter in angles, inch))
        assume_increments(state)


def increment(angle: bool, inch: bool) -> float:
    """The least increment of a word: degrees of an angle, or the unit of length in force."""
    return INCREMENT_DEGREE if angle else INCREMENT_INCH if inch else INCREMENT_MM


def assume_increments(state: State) -> None:
    """Say that numbers without a point were counted in increments."""
    state.assume(INCREMENTS.format(state.dialect.name))


def watches_points(state: State) -> bool:
    """Whether the dialect leaves it open what such numbers count, and nothing was said yet."""
    return state.dialect.name == GENERIC.name and (state.bare is None or not state.pointed)


def _watch_points(state: State, block: CurrentBlock) -> None:
    """Notice what looks like a program for a control that counts increments."""
    for letter, word in block.values.items():
        if letter not in LENGTHS or not word.value:
            continue
        if word.text.endswith("."):
            state.pointed = True
        elif state.bare is None and "." not in word.text and "E" not in word.text.upper():
            state.bare = (block.line, word)
    warn_of_points(state)


def warn_of_points(state: State) -> None:
    """Say, once, that some lengths have their decimal point and others none."""
    if state.pointed and state.bare is not None:
        state.warnings.append(MIXED.format(state.bare[1].text, state.bare[0]))
