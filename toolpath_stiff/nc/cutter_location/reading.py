"""Statements of a cutter-location file, executed in order: points, circles, holes."""

from __future__ import annotations

import re
from collections.abc import Callable

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.arcs import ArcError
from toolpath_stiff.nc.cutter_location import vocabulary
from toolpath_stiff.nc.cutter_location.curves import Curves
from toolpath_stiff.nc.cutter_location.cycles import Cycle, read_cycle
from toolpath_stiff.nc.cutter_location.modes import FEED_UNITS, NO_UNITS
from toolpath_stiff.nc.cutter_location.statements import (
    Statement,
    frame_in_comment,
    is_number,
    number_of,
    plain_point,
    read_statement,
)
from toolpath_stiff.nc.cutter_location.tilting import AxisError, Vector
from toolpath_stiff.nc.cutter_location.tool_path import NoFeedError
from toolpath_stiff.nc.moves import FEED, RAPID, Unsupported
from toolpath_stiff.nc.tables import ToolEntry

# CATIA's heading of an operation, a comment; NX and Autodesk's posts have TOOL PATH/ and CSI_TOOL_PATH/.
OPERATION = re.compile(r"\s*\$\$\s*OPERATION NAME\s*:\s*(.*\S)", re.IGNORECASE)
HEADINGS = ("TOOL PATH", "CSI_TOOL_PATH")
PACKED_AT = 50_000  # moves
LIKE_G_CODE = re.compile(r"[A-Z]-?[\d.]+")


class CutterLocation(Curves):
    """Executes statements; `recorder`, `unsupported`, `warnings`, `assumptions` hold what was found."""

    def __init__(self, name: str, tools: dict[int, ToolEntry] | None) -> None:
        super().__init__(name, tools)
        self._last_word = ""
        self.marks: list[tuple[int, str]] = []  # line and name of each operation
        self._acts: dict[str, Callable[[Statement], None]] = {
            "GOTO": self._goto,
            "": self._more_points,
            "GODLTA": self._godlta,
            "FROM": self._from,
            "GOHOME": self._gohome,
            "RAPID": self._set_rapid,
            "FEDRAT": self._fedrat,
            "SPINDL": self._spindl,
            "UNITS": self._units,
            "UNIT": self._units,
            "MULTAX": self._multax,
            "TLAXIS": self._tlaxis,
            "CIRCLE": self._circle,
            "MOVARC": self._movarc,
            "INDIRV": self._indirv,
            "TLON,GOFWD": self._tlon,
            "LOADTL": self._loadtl,
            "LOAD": self._load,
            "CUTTER": self._cutter,
            "TLDATA": self._tldata,
            "TOOL PATH": self._tool_path,
            "DELAY": self._delay,
            "DWELL": self._delay,
            "CYCLE": self._cycle_word,
            "CUTCOM": self._cutcom,
            "MODE": self._mode,
            "TOOLNO": self._toolno,
            "TRANS": self._shift,
            "ORIGIN": self._shift,
            "MSYS": self._frame_word,
            "MCS": self._frame_word,
            "CSYS": self._frame_word,
            "ZERO": self._frame_word,
            "FINI": self._fini,
        }

    # -- running -----------------------------------------------------------------------------------------------------

    def run(self, lines: tuple[str, ...], on_error: Callable[[InputError], None] | None = None) -> None:
        """Read all lines; with `on_error`, go on with the next statement after an error."""
        at = 0
        while at < len(lines) and not self.ended:
            here = at
            if len(self.recorder.line) > PACKED_AT:
                self.recorder.pack()
            try:
                numbers = plain_point(lines[at])
                if numbers is not None:
                    self.statement = Statement(at + 1, 1, "GOTO")
                    self.seen("GOTO", at + 1)
                    at += 1
                    self._checked(self._points, numbers)
                    self._last_word = "GOTO"
                    continue
                statement, at = read_statement(lines, at, self.name)
                if statement is None:
                    self._comment(lines, here)
                else:
                    self.statement = statement
                    self.seen(statement.word, statement.line)
                    self._checked(self.execute, statement)
                    self._last_word = statement.word or self._last_word
            except InputError as error:
                if on_error is None:
                    raise
                on_error(error)
                at = max(at, here + 1)
        if self.ended and any(line.strip() and not line.lstrip().startswith("$$") for line in lines[at:]):
            self.warnings.append(f"line {at}: FINI ends the file; what follows is not read")
        try:
            self._no_circle("the end of the file")
        except InputError as error:
            if on_error is None:
                raise
            on_error(error)
        self._finish()

    def _comment(self, lines: tuple[str, ...], at: int) -> None:
        """What CAM systems say in comments: CATIA's operations, CATIA's and Creo's coordinate systems."""
        found = OPERATION.match(lines[at])
        if found:
            self.marks.append((at + 1, found[1]))
            return
        frame = frame_in_comment(lines, at)
        if frame is not None:
            self.statement = Statement(at + 1, 1, frame[0])
            self._one_frame(*frame, lines[at].strip()[:40])

    def seen(self, word: str, line: int) -> None:
        """Called for every statement; the check counts them."""

    def _checked(self, act: Callable[..., None], what: object) -> None:
        """Errors of the geometry get the place of their statement."""
        try:
            act(what)
        except (ArcError, AxisError, NoFeedError) as error:
            raise self.fail(error.found, error.expected) from None

    def _finish(self) -> None:
        if not self.units_said and len(self.recorder):
            self.assume(NO_UNITS)
        for noted in self.doubtful.values():
            times = f" ({noted.count} times)" if noted.count > 1 else ""
            self.warnings.append(f"line {noted.statement.line}: {noted.statement.shown}: {noted.reason}{times}")
        if self.unsmooth and not self.smooth:
            self.warnings.append(
                f"line {self.first_unsmooth}: the tool turns back where this arc begins, and no arc of the file begins "
                "smoothly: look whether the arcs turn the right way about their axes"
            )

    @property
    def unsupported(self) -> tuple[Unsupported, ...]:
        """Words that were not acted upon, in the order of the file, each once."""
        both = sorted({**self.noted, **self.doubtful}.values(), key=lambda noted: noted.statement.line)
        return tuple(
            Unsupported(
                noted.statement.line,
                noted.statement.column,
                noted.statement.word,
                noted.reason + (f" ({noted.count} times)" if noted.count > 1 else ""),
            )
            for noted in both
        )

    # -- words -------------------------------------------------------------------------------------------------------

    def execute(self, statement: Statement) -> None:
        """Execute a statement."""
        word = statement.word
        if word in HEADINGS and statement.arguments:
            self.marks.append((statement.line, statement.arguments[0].text))
        act = self._acts.get(word)
        if act is not None:
            act(statement)
        elif word in vocabulary.HARMLESS:
            self._note(self.noted, statement, vocabulary.HARMLESS[word])
        elif word.partition(",")[0] in vocabulary.REFUSED:
            found, hint = vocabulary.REFUSED[word.partition(",")[0]]
            raise self.fail(f"{statement.shown} {found}, which is not supported", vocabulary.GEOMETRY, hint)
        elif word in vocabulary.DOUBTFUL:
            self._note(self.doubtful, statement, vocabulary.DOUBTFUL[word])
        elif LIKE_G_CODE.match(word) or (not statement.arguments and " " in word):
            raise self.fail(f"{statement.shown!r} is no statement of a cutter-location file", "a word of APT's")
        elif word.startswith(vocabulary.LIKE_MOTION) or self._carries_point(statement):
            raise self.fail(
                f"{statement.shown}: {word} {vocabulary.UNKNOWN}, and may move the tool",
                vocabulary.GEOMETRY,
                "take the line out if it does not",
            )
        else:
            self._note(self.doubtful, statement, f"{word} {vocabulary.UNKNOWN}, and not acted upon")

    def _carries_point(self, statement: Statement) -> bool:
        numbers = sum(is_number(argument.text) for argument in statement.arguments)
        return numbers == len(statement.arguments) >= vocabulary.NUMBERS_OF_A_POINT

    # -- points ------------------------------------------------------------------------------------------------------

    def _goto(self, statement: Statement) -> None:
        named = next((a for a in statement.arguments if a.text[:1].isalpha() or a.text[:1] == "("), None)
        if named is not None:
            hint = "names need APT's processor: give the file of points that it writes"
            raise self.fail(f"GOTO/ to {named.text[:30]!r}", "numbers", hint, named)
        numbers = [number_of(argument, self.name) for argument in statement.arguments]
        if len(numbers) in (3, 6):
            self._points(numbers)
        elif self.circle is not None and len(numbers) >= 9 and len(numbers) % 3 == 0 and not self.multax:
            self.arc_through([self._scaled(numbers[i : i + 3]) for i in range(0, len(numbers), 3)], self.next_axis)
        else:
            raise self.fail(f"GOTO/ with {len(numbers)} numbers", "x,y,z or x,y,z,i,j,k")

    def _more_points(self, statement: Statement) -> None:
        """A line of numbers alone after GOTO: the next point (Creo writes arcs so)."""
        if self._last_word != "GOTO":
            raise self.fail(f"{statement.text[:30]!r} is no statement", "a word, / and its arguments")
        self.circle = self.followed
        self._points(self._numbers(statement, 3, 6))

    def _points(self, numbers: list[float]) -> None:
        """A point, with its tool axis or the one in force."""
        axis = self._axis_of(numbers)
        target = self._scaled(numbers[:3])
        if self.circle is not None:
            self.arc_through([target], axis)
            return
        if self.cycle is not None:
            self._drill(target, axis, self.cycle)
            return
        self._go(target, axis)

    def _go(self, target: Vector, axis: Vector) -> None:
        motion = RAPID if self.rapid else FEED
        self.rapid, self.followed, self.direction = 0, None, None
        self.straight(self.statement.line, motion, target, axis)

    def _godlta(self, statement: Statement) -> None:
        if self.point is None:
            raise self.fail("GODLTA/ before any point", "FROM/ or GOTO/ before it")
        numbers = self._numbers(statement, 3, 6)
        if self.circle is not None or self.cycle is not None:
            raise self.fail("GODLTA/ on a circle or in a cycle", "GOTO/")
        axis = self._axis_of(numbers)
        x, y, z = (p + d for p, d in zip(self.point, self._scaled(numbers[:3]), strict=True))
        self._go((x, y, z), axis)

    def _gohome(self, statement: Statement) -> None:
        """NX says where home is; without a point it is the control's."""
        if statement.arguments:
            self._points(self._numbers(statement, 3, 6))
            return
        self._no_circle("GOHOME")
        self.rapid = 0
        self._note(self.doubtful, statement, vocabulary.DOUBTFUL["GOHOME"])

    def _from(self, statement: Statement) -> None:
        numbers = self._numbers(statement, 3, 6)
        axis = self._axis_of(numbers)
        if len(self.recorder):
            self.warnings.append(
                f"line {statement.line}: FROM amid the path: the tool is taken to stand there; how it came is not said"
            )
        self._no_circle("FROM/")
        self.stand(self._scaled(numbers[:3]), axis)

    # -- cycles ------------------------------------------------------------------------------------------------------

    def _cycle_word(self, statement: Statement) -> None:
        self._no_circle("CYCLE/")
        self.cycle = read_cycle(statement, self.name, self.scale, FEED_UNITS)

    def _drill(self, target: Vector, axis: Vector, cycle: Cycle) -> None:
        self.rapid, self.followed = 0, None
        if self.point is not None and axis != self.axis:
            raise self.fail(
                "a hole with another tool axis than the move before", "a GOTO/ before the cycle that turns the tool"
            )
        feed = self.feed_per_minute(cycle.feed, cycle.per_revolution)
        self.hole(self.statement.line, target, axis, cycle.hole, feed)
