"""The state of a cutter-location file being read, and what a word is: a function of that state and its statement.

mm, degrees, mm/min.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.cutter_location.geometry import VERTICAL, Circle, Vector
from toolpath_stiff.nc.cutter_location.statements import Argument, Statement, number_of
from toolpath_stiff.nc.cycles import Drilling
from toolpath_stiff.nc.moves import ToolUse
from toolpath_stiff.nc.recorder import Recorder
from toolpath_stiff.nc.tables import LARGEST_MM, ToolEntry


@dataclass(frozen=True)
class Cycle:
    """A drilling cycle: the hole, heights from the GOTO point in mm; its feed in mm/min or mm per revolution."""

    hole: Drilling
    feed: float
    per_revolution: bool


@dataclass
class Noted:
    """A word that was not acted upon: where it stands first, and how often."""

    statement: Statement
    reason: str
    count: int = 1

    @property
    def times(self) -> str:
        """How often, for a message; nothing if once."""
        return f" ({self.count} times)" if self.count > 1 else ""


@dataclass
class State:
    """What is in force after the statements so far; every word is a function of this and its statement."""

    name: str  # of the file, for messages
    tools: dict[int, ToolEntry] | None
    statement: Statement = field(default_factory=lambda: Statement(1, 1, ""))  # being executed
    last_word: str = ""  # of the statement before
    ended: bool = False

    # Units, feed, spindle.
    scale: float = 1.0  # mm of the length unit
    units_said: bool = False
    feed: float | None = None  # mm/min, or mm per revolution
    per_revolution: bool = False
    speed: float = 0.0
    revolutions: float = 0.0  # that SPINDL/ON goes back to
    frames: dict[str, tuple[float, ...]] = field(default_factory=dict)  # who names a coordinate system: its numbers

    # The tool.
    tool: int = 0
    tool_length: float = math.nan
    diameter: float = math.nan
    tool_name: str = ""
    cutter_at: int = 0  # moves before the last CUTTER

    # Where the tool stands.
    point: Vector | None = None
    axis: Vector = VERTICAL
    angles: tuple[float, float] = (0.0, 0.0)
    heading: Vector | None = None  # direction of the straight move before

    # What the next motion is.
    rapid: int = 0  # line of the RAPID that waits for its motion
    multax: bool | None = None
    next_axis: Vector = VERTICAL  # of a point that gives none
    axis_said: bool = True  # false where MULTAX/OFF leaves open how the tool stands
    direction: Vector | None = None  # of INDIRV
    circle: Circle | None = None  # waits for its GOTO
    circle_line: int = 0
    followed: Circle | None = None  # whose arc the last GOTO made
    swept: float = 0.0  # rad, along that circle
    cycle: Cycle | None = None

    # What was found.
    recorder: Recorder = field(default_factory=Recorder)
    used_tools: dict[int, ToolUse] = field(default_factory=dict)
    marks: list[tuple[int, str]] = field(default_factory=list)  # line and name of each operation
    assumptions: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    noted: dict[str, Noted] = field(default_factory=dict)
    doubtful: dict[str, Noted] = field(default_factory=dict)
    smooth: int = 0  # arcs that a straight move enters smoothly, and would turn back into
    unsmooth: int = 0
    first_unsmooth: int = 0

    def fail(self, found: str, expected: str = "", hint: str = "", at: Argument | None = None) -> InputError:
        """The error for the statement being executed."""
        place = at or self.statement
        return InputError(
            found, expected=expected, hint=hint, file=self.name, line=place.line, column=max(place.column, 1)
        )

    def note(self, table: dict[str, Noted], reason: str) -> None:
        """Note in a table that the word being executed is not acted upon."""
        word = self.statement.word
        if word in table:
            table[word].count += 1
        else:
            table[word] = Noted(self.statement, reason)

    def assume(self, text: str) -> None:
        """Note an assumption, once."""
        if text not in self.assumptions:
            self.assumptions.append(text)

    def number(self, argument: Argument, what: str = "a number") -> float:
        """The number of an argument. Raises `InputError`."""
        return number_of(argument, self.name, what)

    def numbers(self, statement: Statement, *counts: int) -> list[float]:
        """All arguments as numbers; there must be one of `counts` of them."""
        numbers = [self.number(argument) for argument in statement.arguments]
        if len(numbers) not in counts:
            expected = " or ".join(str(count) for count in counts)
            raise self.fail(f"{statement.word}/ with {len(numbers)} numbers", f"{expected} numbers")
        return numbers

    def scaled(self, numbers: list[float]) -> Vector:
        """The point of three numbers of the file, in mm."""
        scale = self.scale
        x, y, z = numbers[0] * scale, numbers[1] * scale, numbers[2] * scale
        if max(abs(x), abs(y), abs(z)) > LARGEST_MM:
            raise self.fail(f"a point at {x:g}, {y:g}, {z:g} mm", f"within {LARGEST_MM:g} mm")
        return (x, y, z)

    def no_circle(self, what: str) -> None:
        """Refuse `what` while a circle waits for its GOTO."""
        if self.circle is not None:
            raise self.fail(f"{what} while the circle of line {self.circle_line} waits for its GOTO", "GOTO/")

    def feed_per_minute(self, feed: float, per_revolution: bool) -> float:
        """mm/min of a feed that may be per revolution."""
        if not per_revolution:
            return feed
        if not self.speed > 0.0:
            raise self.fail("a feed per revolution without a spindle speed", "SPINDL/ with RPM before it")
        return feed * self.speed


Act = Callable[[State, Statement], None]

# What becomes of a word.
READ, LISTED, DOUBTFUL, REFUSED = "read", "listed", "listed, with a warning", "refused"
# Who writes it.
ALL, CREO, NX, CATIA, AUTODESK, CAMPLETE = "all", "Creo", "NX", "CATIA", "Autodesk", "Autodesk for CAMplete"
# Where it is described.
ISO, APT = "ISO 4343", "ISO 4342, the APT language"
PTC, SIEMENS = 'PTC, "Supported CL Data Commands"', 'Siemens NX, "CLSF Manager"'
DASSAULT, POSTS = "Dassault, CATIA's help on APT import", "Autodesk's APT posts"
VERICUT, MANUALS = 'Vericut, "Supported APT-CLS NC Program Records"', "manuals of post processors"


@dataclass(frozen=True)
class Word:
    """A major word of a statement.

    Attributes
    ----------
    name
        Upper case; "" is a line of numbers alone.
    act
        Executes a statement of it.
    meaning
        What it is taken for, as `tps check` lists it; of a refused word what it does.
    written_by, source
        Which CAM systems write it, "" where that is not known; where it is described.
    form
        The arguments that are read, for people.
    kind
        READ, LISTED, DOUBTFUL or REFUSED: what becomes of it.
    """

    name: str
    act: Act
    meaning: str
    written_by: str
    source: str
    form: str = ""
    kind: str = READ
