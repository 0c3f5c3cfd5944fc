"""A code: its name, its modal group (`groups`), what it does, and the manual that it follows.

Each module here has a group of codes, each a function and a row; `registry` joins the rows to one table.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from toolpath_stiff.nc.groups import STEPS, Group
from toolpath_stiff.nc.state import CurrentBlock, State

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
    group: Group
    act: Act
    meaning: str
    source: str
    controls: tuple[str, ...] = EVERYWHERE
    step: Group | None = None
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
    def when(self) -> Group:
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
