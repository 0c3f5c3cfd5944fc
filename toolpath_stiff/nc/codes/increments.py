"""Numbers without a decimal point: whole units, or the least increments of Fanuc's and Haas' controls.

Sources: Fanuc's operator's manuals, "Decimal point programming"; Haas' "Help with the decimal points".
"""

import re
from collections.abc import Sequence

from toolpath_stiff.nc.controller import GENERIC, INCREMENT_DEGREE, INCREMENT_INCH, INCREMENT_MM
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.operations import split_comments
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, CORNERS

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
    if not state.dialect.increments:
        return
    # Q may be a count or a number: G5.1 Q1, M61 Q5.
    counts = "Q" if "look-ahead" in block.groups or "M61" in block.codes else ""
    words = [word for letter, word in block.values.items() if letter not in counts]
    inch = block.groups.get("units", "G20" if state.inch else "G21") == "G20"
    angles = set(ANGLES)
    if block.groups.get("rotation") == "G68":
        angles.add("R")
    polar = block.groups["polar"] == "G16" if "polar" in block.groups else state.polar is not None
    if polar and "non-modal" not in block.groups:
        angles.add(AXES[PLANES[block.groups.get("plane", state.plane)][1]])
    for word in words:
        if "." not in word.text and word.value and word.letter in LENGTHS | angles:
            block.values[word.letter] = word._replace(value=word.value * increment(word.letter in angles, inch))
            assume_increments(state)


def increment(angle: bool, inch: bool) -> float:
    """The least increment of a word: degrees of an angle, or the unit of length in force."""
    return INCREMENT_DEGREE if angle else INCREMENT_INCH if inch else INCREMENT_MM


def assume_increments(state: State) -> None:
    """Note that numbers without a point were counted in increments."""
    state.assume(INCREMENTS.format(state.dialect.name))


def increments_hint(state: State) -> str:
    """Hint for an arc that does not fit, if numbers without a point were counted in increments."""
    if INCREMENTS.format(state.dialect.name) not in state.assumptions:
        return ""
    step, unit = ("0.0001", "inch") if state.inch else ("0.001", "mm")
    name = state.dialect.name
    return f"numbers without a point are read in {step} {unit} (--dialect {name}); without it X10 is 10 {unit}"


_LENGTH_WORDS = re.compile(r"[XYZIJR]\s*[-+]?(?:\d+\.?\d*|\.\d+)(?![\d.]|\s*E)", re.IGNORECASE)
_LOOKED_AT = 10_000  # lines: a program keeps to the number format of its beginning


def point_warning(state: State, lines: Sequence[str]) -> list[Remark]:
    """Warning that lengths without a decimal point may be misread, judged by how other lengths are written.

    Where whole numbers are increments, posts end those in mm with their point. So X10 beside X5. is one, whatever it
    was read as; X10 beside X5.5, and nothing like X5., is none.
    """
    texts = ((line, split_comments(text)[0]) for line, text in enumerate(lines[:_LOOKED_AT], 1))
    words = [(line, word) for line, text in texts for word in _LENGTH_WORDS.findall(text)]
    pointed = any(word.endswith(".") for _, word in words)
    line, whole = next((word for word in words if "." not in word[1] and set(word[1]) & {*"123456789"}), (0, ""))
    if whole and pointed and state.dialect == GENERIC:
        return [Remark(MIXED.format(whole), line)]
    hint = increments_hint(state)
    if whole and hint and not pointed and any("." in word for _, word in words):
        return [Remark(f"{whole} stands beside numbers with decimals, and none ends with its point: {hint}")]
    return []
