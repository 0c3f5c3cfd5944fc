"""All that a control keeps from block to block, and all that reading the program has found. mm, degrees, mm/min."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from toolpath_stiff.nc.dialects import GENERIC, Dialect
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.moves import ToolUse, Unsupported
from toolpath_stiff.nc.recorder import Arc, Recorder
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import Word
from toolpath_stiff.units import MM_PER_INCH

START = "before its first move the tool stands at 0, 0, 0 of the control, as LinuxCNC assumes"


class Segment(NamedTuple):
    """One move of a block, those of no length too: control coordinates of its ends, and its arc."""

    motion: int
    start: list[float]
    end: list[float]
    arc: Arc | None


@dataclass
class State:
    """The state of a control, at its start as LinuxCNC's is unless the dialect says otherwise.

    Attributes
    ----------
    name
        Of the program, for errors.
    frames, tools, dialect
        Its coordinates (with the present point), its tool table (None: there is none), what its words mean.
    motion
        The motion mode: "G0", "G1", "G2", "G3" or a drilling cycle; None after G80, and at the start.
    plane
        "G17", "G18" or "G19".
    absolute, arc_absolute, inch
        G90, G90.1, G20 in force.
    feed_mode
        "G93", "G94" or "G95".
    feed
        F in force: mm/min, mm per revolution or, in G93, one over minutes; None before there is one.
    speed
        S in force, 1/min.
    retract
        "G98" or "G99", once the program or the dialect says; LinuxCNC starts as in G99.
    polar
        G16: the last programmed radius (mm) and angle (degrees), nan before there is one; None: G15.
    tool, selected
        The tool in the spindle, and the one that T names for the next M6.
    renamed
        Whether the tool in the spindle is M61's.
    tool_length
        In force through G43, mm; nan: none, the machine's reference tool.
    sticky
        What a run of drilling cycles keeps: R, Z, Q, P, the unit, the level from which it began.
    heights
        Of the last hole: whether in G90, R plane, bottom.
    unsettled
        "G68", "G69" or "G10", whichever turned the numbers of the present X and Y last, until both are programmed.
    length_changed, rotation_changed, height_lost
        LinuxCNC's rs274 forgets at M6 that tool length or rotation changed since the last move: the next begins
        elsewhere. `height_lost`: it did, and no Z was named since.
    recorder
        The moves found so far.
    used_tools
        The tools that moved, by number.
    tip_held
        Tool centre point control, by the number of moves before it is switched (G43.4) on or off.
    unsupported, warnings, assumptions
        As in `Program`.
    bare, pointed
        The first length without a decimal point, with its line; whether any length ends with its point, as `X10.`.
    trace
        Each move of the block in hand, for whoever starts the list.
    """

    name: str
    frames: Frames
    tools: dict[int, ToolEntry] | None = None
    dialect: Dialect = GENERIC
    motion: str | None = None
    plane: str = "G17"
    absolute: bool = True
    arc_absolute: bool = field(init=False)
    inch: bool = False
    feed_mode: str = "G94"
    feed: float | None = None
    speed: float = 0.0
    retract: str | None = field(init=False)
    polar: list[float] | None = None
    tool: int = 0
    selected: int = 0
    renamed: bool = False
    tool_length: float = math.nan
    sticky: dict[str, float] = field(default_factory=dict)
    heights: tuple[bool, float, float] = (True, 0.0, 0.0)
    unsettled: str | None = None
    length_changed: bool = False
    rotation_changed: bool = False
    height_lost: bool = False
    recorder: Recorder = field(default_factory=Recorder)
    used_tools: dict[int, ToolUse] = field(default_factory=dict)
    tip_held: list[tuple[int, bool]] = field(default_factory=list)
    unsupported: list[Unsupported] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    assumptions: list[str] = field(default_factory=list)
    bare: tuple[int, Word] | None = None
    pointed: bool = False
    trace: list[Segment] | None = None

    def __post_init__(self) -> None:
        self.arc_absolute, self.retract = self.dialect.arc_absolute, self.dialect.retract

    @property
    def length_scale(self) -> float:
        """Millimetres of one length unit of the program."""
        return MM_PER_INCH if self.inch else 1.0

    @property
    def feed_scale(self) -> float:
        """Millimetres of the length unit of F."""
        return MM_PER_INCH if self.inch and self.feed_mode != "G93" else 1.0

    def note(self, line: int, word: Word, reason: str) -> None:
        """List a word that is not acted upon."""
        self.unsupported.append(Unsupported(line, word.column, word.text, reason))

    def assume(self, sentence: str) -> None:
        """Note what is taken for granted, once."""
        if sentence not in self.assumptions:
            self.assumptions.append(sentence)
