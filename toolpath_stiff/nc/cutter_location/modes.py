"""Words of a cutter-location file that are modal: units, feed, spindle, tool, pauses, coordinate systems."""

from __future__ import annotations

import math
from dataclasses import dataclass

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.cutter_location import vocabulary
from toolpath_stiff.nc.cutter_location.circles import Circle
from toolpath_stiff.nc.cutter_location.cycles import Cycle
from toolpath_stiff.nc.cutter_location.statements import Argument, Statement, is_number, number_of
from toolpath_stiff.nc.cutter_location.tilting import VERTICAL, Vector, unit_axis
from toolpath_stiff.nc.cutter_location.tool_path import ToolPath
from toolpath_stiff.nc.moves import ToolUse
from toolpath_stiff.nc.tables import LARGEST_MM, ToolEntry
from toolpath_stiff.units import MM_PER_INCH

SECONDS_PER_DAY = 86400.0
MM_PER_FOOT = 12.0 * MM_PER_INCH
# FEDRAT: mm of its unit (None: the file's length unit), and whether per revolution.
FEED_UNITS: dict[str, tuple[float | None, bool]] = {
    "MMPM": (1.0, False),
    "IPM": (MM_PER_INCH, False),
    "FPM": (MM_PER_FOOT, False),
    "PERMIN": (None, False),
    "MMPR": (1.0, True),
    "IPR": (MM_PER_INCH, True),
    "FPR": (MM_PER_FOOT, True),
    "PERREV": (None, True),
}
INCH_FEEDS = ("IPM", "IPR", "FPM", "FPR")
LENGTH_UNITS = {"MM": 1.0, "INCH": MM_PER_INCH, "INCHES": MM_PER_INCH, "IN": MM_PER_INCH}
SEVERAL_TOOLS = ToolUse(0, math.nan, math.nan, "several tools without numbers")
SAME_LENGTH_MM = 1e-3
NO_UNITS = "the file names no UNITS; its numbers are taken as mm"


@dataclass
class Noted:
    """A word that was not acted upon: where it stands first, and how often."""

    statement: Statement
    reason: str
    count: int = 1


class Modes(ToolPath):
    """The modal state, and the words that set it; `statement` is the one being executed."""

    def __init__(self, name: str, tools: dict[int, ToolEntry] | None) -> None:
        super().__init__(tools)
        self.name = name
        self.noted: dict[str, Noted] = {}
        self.doubtful: dict[str, Noted] = {}
        self.warnings: list[str] = []
        self.units_said = False
        self.ended = False
        self.multax: bool | None = None
        self.next_axis: Vector = VERTICAL  # of a point that gives none
        self.axis_said = True  # false where MULTAX/OFF leaves open how the tool stands
        self.cycle: Cycle | None = None
        self.circle: Circle | None = None  # waits for its GOTO
        self.circle_line = 0
        self.rapid = 0  # line of the RAPID that waits for its motion
        self.statement = Statement(1, 1, "")
        self._frames: dict[str, tuple[float, ...]] = {}
        self._revolutions = 0.0

    def fail(self, found: str, expected: str = "", hint: str = "", at: Argument | None = None) -> InputError:
        """The error for the statement being executed."""
        place = at or self.statement
        return InputError(
            found, expected=expected, hint=hint, file=self.name, line=place.line, column=max(place.column, 1)
        )

    def _note(self, table: dict[str, Noted], statement: Statement, reason: str) -> None:
        if statement.word in table:
            table[statement.word].count += 1
        else:
            table[statement.word] = Noted(statement, reason)

    def _numbers(self, statement: Statement, *counts: int) -> list[float]:
        """All arguments as numbers; there must be one of `counts` of them."""
        numbers = [number_of(argument, self.name) for argument in statement.arguments]
        if len(numbers) not in counts:
            expected = " or ".join(str(count) for count in counts)
            raise self.fail(f"{statement.word}/ with {len(numbers)} numbers", f"{expected} numbers")
        return numbers

    def _words(self, statement: Statement) -> list[str]:
        return [argument.text.upper() for argument in statement.arguments]

    def _axis_of(self, numbers: list[float]) -> Vector:
        if len(numbers) == 6:
            axis = unit_axis(*numbers[3:])
            if self.multax is False and axis != VERTICAL:
                raise self.fail("a tilted tool axis after MULTAX/OFF", "MULTAX/ON before it, or x,y,z alone")
            self.next_axis, self.axis_said = axis, True
            return axis
        if not self.axis_said:
            raise self.fail("a point without its tool axis after MULTAX/OFF and a tilted tool", "x,y,z,i,j,k or TLAXIS")
        return self.next_axis

    def _scaled(self, numbers: list[float]) -> Vector:
        scale = self.scale
        x, y, z = numbers[0] * scale, numbers[1] * scale, numbers[2] * scale
        if max(abs(x), abs(y), abs(z)) > LARGEST_MM:
            raise self.fail(f"a point at {x:g}, {y:g}, {z:g} mm", f"within {LARGEST_MM:g} mm")
        return (x, y, z)

    # -- modes -------------------------------------------------------------------------------------------------------

    def _set_rapid(self, statement: Statement) -> None:
        if statement.arguments:
            raise self.fail(statement.shown, "RAPID alone")
        if self.circle is not None:
            raise self.fail("RAPID before the GOTO of a circle", "an arc at a feed")
        if self.cycle is not None:
            raise self.fail("RAPID within a drilling cycle: is the next point a hole?", "CYCLE/OFF before it")
        self.rapid = statement.line

    def _no_circle(self, what: str) -> None:
        if self.circle is not None:
            raise self.fail(f"{what} while the circle of line {self.circle_line} waits for its GOTO", "GOTO/")

    def _fedrat(self, statement: Statement) -> None:
        words = self._words(statement)
        if self.rapid:
            raise self.fail(
                f"a feed after the RAPID of line {self.rapid}, before its motion",
                "one of them",
                "whether the motion is rapid is not certain",
            )
        if words and words[0] == "INVERS":
            self._inverse(statement, words)
            return
        values = [argument for argument in statement.arguments if is_number(argument.text)]
        units = [word for word in words if not is_number(word)]
        if len(values) != 1 or len(units) > 1 or any(unit not in FEED_UNITS for unit in units):
            raise self.fail(statement.shown, f"FEDRAT/ with a number and one of {', '.join(FEED_UNITS)}")
        factor, self.per_revolution = FEED_UNITS[units[0]] if units else (None, False)
        if units and units[0] in INCH_FEEDS and not self.units_said:
            raise self.fail(
                f"{units[0]} in a file that names no UNITS: are its points in inches?",
                "UNITS/INCHES or UNITS/MM before it",
                "add the line at the beginning of the file",
            )
        value = number_of(values[0], self.name)
        if value < 0.0:
            raise self.fail(f"a feed of {value:g}", "a feed above 0", at=values[0])
        self.feed = value * (self.scale if factor is None else factor) or None

    def _inverse(self, statement: Statement, words: list[str]) -> None:
        """Creo: whether the post makes inverse-time feeds of them; the numbers stay per minute."""
        if words[1:] not in (["AUTO"], ["OFF"]):
            raise self.fail(statement.shown, "a feed per minute or per revolution")
        self._note(self.noted, statement, "how the post processor writes feeds")

    def _spindl(self, statement: Statement) -> None:
        words = self._words(statement)
        if "OFF" in words or "STOP" in words:
            self.speed = 0.0
            return
        before = ("RPM", "CLW", "CCLW", "SFM", "SMM")
        found = [place for place, word in enumerate(words) if is_number(word)]
        speeds = [place for place in found if place == 0 or words[place - 1] in before]
        if "SFM" in words or "SMM" in words or (found and not speeds):
            self._note(self.noted, statement, "a speed that is no number of revolutions")
            self._revolutions = 0.0
        elif speeds:
            self._revolutions = abs(number_of(statement.arguments[speeds[0]], self.name))
        self.speed = self._revolutions

    def _units(self, statement: Statement) -> None:
        words = self._words(statement)
        if len(words) != 1 or words[0] not in LENGTH_UNITS:
            raise self.fail(statement.shown, "UNITS/MM or UNITS/INCHES")
        if self.circle is not None:
            raise self.fail("UNITS/ amid an arc", "UNITS/ before CIRCLE/")
        if not self.units_said and len(self.recorder) and LENGTH_UNITS[words[0]] != 1.0:
            raise self.fail("UNITS/ after the first points, which were taken as mm", "UNITS/ before any point")
        self.scale, self.units_said = LENGTH_UNITS[words[0]], True

    def _multax(self, statement: Statement) -> None:
        words = self._words(statement)
        if words not in ([], ["ON"], ["OFF"]):
            raise self.fail(statement.shown, "MULTAX, MULTAX/ON or MULTAX/OFF")
        self.multax = words != ["OFF"]
        if not self.multax and self.next_axis != VERTICAL:
            self.axis_said = False

    def _cutcom(self, statement: Statement) -> None:
        words = self._words(statement)
        if words != ["OFF"]:
            found, hint = vocabulary.COMPENSATION
            raise self.fail(f"{statement.shown} {found}, which is not supported", "", hint)
        self._note(self.noted, statement, "cutter compensation is off")

    def _mode(self, statement: Statement) -> None:
        if self._words(statement) != ["MILL"]:
            found, hint = vocabulary.TURNING
            raise self.fail(f"{statement.shown} {found}", "MODE/MILL", hint)
        self._note(self.noted, statement, "milling")

    def _shift(self, statement: Statement) -> None:
        if statement.arguments and all(is_number(word) for word in self._words(statement)):
            numbers = [number_of(argument, self.name) for argument in statement.arguments]
            if len(numbers) == 3 and not any(numbers):
                self._note(self.noted, statement, "a shift by nothing")
                return
        found, hint = vocabulary.SHIFTS[statement.word]
        raise self.fail(f"{statement.shown} {found}, which is not supported", "0,0,0", hint)

    def _frame_word(self, statement: Statement) -> None:
        numbers = tuple(number_of(a, self.name) for a in statement.arguments if is_number(a.text))
        self._one_frame(statement.word, numbers, statement.shown)
        self._note(self.noted, statement, vocabulary.FRAMES[statement.word])

    def _one_frame(self, kind: str, numbers: tuple[float, ...], shown: str) -> None:
        """Points of one coordinate system only; `kind` says who names it, the numbers where it lies."""
        before = self._frames.get(kind, numbers)
        same = len(before) == len(numbers) and all(abs(a - b) < 1e-6 for a, b in zip(before, numbers, strict=True))
        if not same and self.point is not None:
            raise self.fail(
                f"{shown}: another coordinate system than the one before",
                "one system for the whole file",
                "write each of them to a file of its own",
            )
        self._frames[kind] = numbers

    def _fini(self, statement: Statement) -> None:
        self._no_circle("FINI")
        self.ended = True

    def _tlaxis(self, statement: Statement) -> None:
        x, y, z = self._numbers(statement, 3)
        self.next_axis, self.axis_said = unit_axis(x, y, z), True

    # -- tools and pauses --------------------------------------------------------------------------------------------

    def _loadtl(self, statement: Statement) -> None:
        if not statement.arguments:
            raise self.fail("LOADTL without a tool", "LOADTL/ and the tool's number")
        self._change_tool(statement, statement.arguments[0])

    def _load(self, statement: Statement) -> None:
        words = self._words(statement)
        if words[:1] != ["TOOL"] or len(words) < 2:
            raise self.fail(statement.shown, "LOAD/TOOL, and the tool's number")
        self._change_tool(statement, statement.arguments[1])

    def _change_tool(self, statement: Statement, given: Argument) -> None:
        number = number_of(given, self.name, "the tool's number")
        if number != int(number) or not 0 <= number < 1e9:
            raise self.fail(f"tool {given.text}", "a whole number", at=given)
        self._no_circle(f"{statement.word}/")
        words = self._words(statement)
        length = math.nan
        if "LENGTH" in words and words.index("LENGTH") + 1 < len(words):
            length = number_of(statement.arguments[words.index("LENGTH") + 1], self.name) * self.scale
            length = length if length > 0.0 else math.nan
        self.change_tool(int(number), self._length_of(int(number), length))

    def _length_of(self, number: int, said: float) -> float:
        """The tool table's length, or what the file says; nan: the machine's reference tool."""
        entry = (self.tools or {}).get(number)
        if entry is None or math.isnan(entry.length):
            if not math.isnan(said):
                self.assume("the LENGTH of LOADTL is the tool's length from spindle nose to tip; --tools wins over it")
            return said
        if abs(said - entry.length) > SAME_LENGTH_MM:
            self.assume(f"tool {number}: the tool table's length {entry.length:g} mm, not LOADTL's {said:g} mm")
        return entry.length

    def _toolno(self, statement: Statement) -> None:
        if "TURN" in self._words(statement):
            found, hint = vocabulary.TURNING
            raise self.fail(f"{statement.shown} {found}", "a milling tool", hint)
        self._note(self.noted, statement, vocabulary.HARMLESS["TOOLNO"])

    def _cutter(self, statement: Statement) -> None:
        """The first number is the diameter, in all of APT's forms."""
        first = statement.arguments[0] if statement.arguments else None
        if first is not None and is_number(first.text):
            self.cutter(number_of(first, self.name) * self.scale)

    def _tldata(self, statement: Statement) -> None:
        for argument in statement.arguments:
            if is_number(argument.text):
                self.cutter(number_of(argument, self.name) * self.scale)
                return

    def _tool_path(self, statement: Statement) -> None:
        self._no_circle("TOOL PATH/")
        words = self._words(statement)
        if "TOOL" in words[1:-1]:
            name = statement.arguments[words.index("TOOL", 1) + 1].text
            if self.tool == 0 and 0 in self.used_tools and name != self.tool_name:
                self.used_tools[0] = SEVERAL_TOOLS
            self.tool_name = name
        self._note(self.noted, statement, vocabulary.HARMLESS["TOOL PATH"])

    def _delay(self, statement: Statement) -> None:
        words = self._words(statement)
        if words[1:] not in ([], ["REV"]):
            raise self.fail(statement.shown, "the seconds, or the revolutions and REV")
        time = number_of(statement.arguments[0], self.name) if words else math.nan
        if words[1:]:
            if not self.speed > 0.0:
                raise self.fail("a pause in revolutions without a spindle speed", "SPINDL/ with RPM before it")
            time *= 60.0 / self.speed
        if not 0.0 <= time <= SECONDS_PER_DAY:
            raise self.fail(statement.shown, "the seconds, 0 or more")
        self.recorder.add_dwell(time)
