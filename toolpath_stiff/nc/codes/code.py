"""The codes: what a code is, in which modal group it stands, and when in its block it acts.

Each module here has a group of codes, each a function and a row; `registry` joins the rows to one table. Modal groups
and the order of execution are LinuxCNC's (manual, "G-Code Overview", "Modal Groups" and "Order of Execution"), because
its interpreter is what the results are compared with.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from toolpath_stiff.nc.state import CurrentBlock, State

# Modal groups. Those of M codes begin with "M ", since a G code may have a group of that name too.
MOTION, PLANE, DISTANCE, ARC_DISTANCE = "motion", "plane", "distance", "arc distance"


UNITS, FEED_MODE, CUTTER, LENGTH = "units", "feed mode", "cutter compensation", "tool length"


OFFSET, RETRACT, ONCE = "work offset", "cycle return", "non-modal"


PATH_CONTROL, SPINDLE_MODE, DIAMETER = "path control", "spindle mode", "lathe diameter"


POLAR, ROTATION, SCALING = "polar", "rotation", "scaling"


M_STOP, M_TOOL, M_SPINDLE, M_COOLANT = "M stop", "M tool change", "M spindle", "M coolant"


M_SUBPROGRAM, M_OVERRIDES = "M subprogram", "M overrides"


EXACT_STOP, SMOOTHING, DYNAMIC, CORNER = "exact stop", "look-ahead", "dynamic offset", "corner"


MIRROR, STROKE_CHECK, SPEED_WATCH, POLAR_PLANE = "mirror image", "stroke check", "speed watch", "polar interpolation"


M_TAPPING, M_STATE = "M rigid tapping", "M modal state"


DWELL, FEED, SPEED, TOOL = "dwell", "F", "S", "T"  # steps of their own: G4, and words that act without a code


# The order in which the codes and words of a block act; the moves come last. Units first, so that an F beside G20 is
# in inches. `MODES` may be executed ahead of the rest of the block: doing so twice changes nothing but dwells.
MODES = (
    UNITS, FEED_MODE, FEED, SPEED, TOOL, M_TOOL, DWELL, PLANE, POLAR, LENGTH, M_SUBPROGRAM, OFFSET,
    PATH_CONTROL, EXACT_STOP, SMOOTHING, DYNAMIC, SPINDLE_MODE, DISTANCE, ARC_DISTANCE, RETRACT, CUTTER, DIAMETER,
    SCALING, MIRROR, STROKE_CHECK, SPEED_WATCH, POLAR_PLANE, M_SPINDLE, M_COOLANT, M_OVERRIDES, M_TAPPING, M_STATE,
)  # fmt: skip


ACTS = (ROTATION, ONCE, M_STOP)


STEPS = {step: at for at, step in enumerate((*MODES, *ACTS, MOTION, CORNER))}


EVERYWHERE = ("generic", "linuxcnc", "fanuc", "haas")


NAME = re.compile(r"[GM](0|[1-9]\d*)(\.\d)?|[FST]|,[CR]")


Act = Callable[[State, CurrentBlock, str], None]


@dataclass(frozen=True)
class Code:
    """A code that is understood.

    Attributes
    ----------
    name
        "G1", "G59.3", "M6"; "F", "S", "T", ",C" and ",R" act as words.
    group
        Its modal group; two codes of one are an error.
    act
        What it does: a function of the state, the current block and the code's name. A motion code's is called for
        each block as long as its mode is in force.
    meaning
        In a few words.
    source
        The manual and section that it follows.
    controls
        The dialects that have it.
    step
        When it acts, unless its group says so; one of `MOTION` moves in place of the mode in force.
    takes_axes
        Whether it takes the axis words of its block, which then cannot move.
    listed
        Why it is listed as not acted upon, although it is understood.
    label
        What `tps check` calls it, where not by `meaning`.
    many
        Whether plain lines of it are executed many at a time (`plain_lines`), by the same rules on arrays.
    """

    name: str
    group: str
    act: Act
    meaning: str
    source: str
    controls: tuple[str, ...] = EVERYWHERE
    step: str = ""
    takes_axes: bool = False
    listed: str = ""
    label: str = ""
    many: bool = False

    def __post_init__(self) -> None:
        if NAME.fullmatch(self.name) is None:
            raise ValueError(f"{self.name!r} is not the name of a code: expected G1, G59.3, M6, F, S, T, `,C` or `,R`")
        if not callable(self.act):
            raise TypeError(f"{self.name} has no function that acts")
        if self.when not in STEPS:
            raise ValueError(f"{self.name} acts at {self.when!r}, which is not a step of the order of execution")
        if not self.meaning or not self.source:
            raise ValueError(f"{self.name} needs its meaning and its source")
        if not self.controls or not set(self.controls) <= set(EVERYWHERE):
            raise ValueError(f"{self.name} is of the controls {self.controls}: expected some of {EVERYWHERE}")

    @property
    def when(self) -> str:
        """Its step of the order of execution."""
        return self.step or self.group

    @property
    def rank(self) -> int:
        """Its place in the order of execution."""
        return STEPS[self.when]


@dataclass(frozen=True)
class Refused:
    """A code that changes the path, or what a force does to it, in a way that is not supported: what it is, a hint."""

    name: str
    what: str
    hint: str
    source: str


@dataclass(frozen=True)
class Alias:
    """Another name that some dialects have for a code."""

    name: str
    code: str
    meaning: str
    source: str
    controls: tuple[str, ...]
    label: str = ""


def code_name(letter: str, value: float) -> str:
    """`G` and 59.3 to "G59.3", `G` and 1.0 to "G1".

    Examples
    --------
    >>> code_name("G", 59.3), code_name("G", 1.0)
    ('G59.3', 'G1')
    """
    return f"{letter}{value:g}"


def g_codes(section: str) -> str:
    """A section of LinuxCNC's page on G codes, as a source."""
    return f"LinuxCNC, G-Codes, {section}"


def m_codes(section: str) -> str:
    """A section of LinuxCNC's page on M codes, as a source."""
    return f"LinuxCNC, M-Codes, {section}"


def holds_anyway(state: State, block: CurrentBlock, code: str) -> None:
    """What the code asks for does not affect a path, or holds anyway."""
