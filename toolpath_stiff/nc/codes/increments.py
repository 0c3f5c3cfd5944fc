"""Numbers without a decimal point: whole units, or the least increments of Fanuc's and Haas' controls.

Sources: Fanuc's operator's manuals, "Decimal point programming"; Haas' "Help with the decimal points".
"""

from collections.abc import Iterable

from toolpath_stiff.nc.controller import GENERIC, INCREMENT_DEGREE, INCREMENT_INCH, INCREMENT_MM
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, CORNERS, Word

ANGLES = frozenset("ABC")
LENGTHS = frozenset((*"XYZIJKRQ", *CORNERS))
INCREMENTS = (
    "lengths and angles without a decimal point count least increments (0.001 mm, 0.0001 inch, 0.001 degrees: IS-B), "
    "as in the dialect {}"
)
MIXED = (
    "some lengths end with their decimal point (X10.), and {} has none: Fanuc's and Haas' controls count "
    "such a number in 0.001 mm or 0.0001 inch; here it counts whole units, unless --dialect says otherwise"
)


def read_numbers(state: State, block: CurrentBlock) -> None:
    """Give the block's words their values in program units, by the dialect's decimal-point rule."""
    # Q may be a number of something else: G5.1 Q1, M61 Q5, M98 Q5.
    counts = "Q" if "look-ahead" in block.groups or not {"M61", "M98"}.isdisjoint(block.codes) else ""
    words = [word for letter, word in block.values.items() if letter not in counts]
    if not state.dialect.increments:
        notice_lengths(state, block.line, words)
        return
    inch = block.groups.get("units", "G20" if state.inch else "G21") == "G20"
    angles = set(ANGLES)
    if block.groups.get("rotation") == "G68":
        angles.add("R")
    polar = block.groups["polar"] == "G16" if "polar" in block.groups else state.polar is not None
    if polar and "non-modal" not in block.groups:
        angles.add(AXES[PLANES[block.groups.get("plane", state.plane)][1]])
    for word in words:
        if "." not in word.text and word.value and word.letter in LENGTHS | angles:
            unit = increment(word.letter in angles, inch)
            block.values[word.letter] = word._replace(value=word.value * unit)
            assume_increments(state)


def increment(angle: bool, inch: bool) -> float:
    """The least increment of a word: degrees of an angle, or the unit of length in force."""
    return INCREMENT_DEGREE if angle else INCREMENT_INCH if inch else INCREMENT_MM


def assume_increments(state: State) -> None:
    """Say that numbers without a point were counted in increments."""
    state.assume(INCREMENTS.format(state.dialect.name))


def increments_hint(state: State) -> str:
    """What to do about an arc that fits nowhere, once numbers without a point were counted in increments."""
    if INCREMENTS.format(state.dialect.name) not in state.assumptions:
        return ""
    step, unit = ("0.0001", "inch") if state.inch else ("0.001", "mm")
    name = state.dialect.name
    return f"numbers without a point are read in {step} {unit} (--dialect {name}); without it X10 is 10 {unit}"


def notice_lengths(state: State, line: int, words: Iterable[Word]) -> None:
    """Warn, once, of what looks like a program for a control that counts increments, where no dialect is named."""
    if state.dialect.name != GENERIC.name or (state.bare is not None and state.pointed):
        return
    for word in words:
        if word.letter not in LENGTHS or not word.value:
            continue
        if word.text.endswith("."):
            state.pointed = True
        elif state.bare is None and "." not in word.text and "E" not in word.text.upper():
            state.bare = (line, word)
    if state.pointed and state.bare is not None:
        state.warnings.append(Remark(MIXED.format(state.bare[1].text), state.bare[0]))
