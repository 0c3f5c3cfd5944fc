"""What the axis words of a block mean: distance mode, polar words (G16), the rotated coordinate system (G68).

Polar words and the rotation follow Fanuc's milling controls (operator's manuals of the series 16 and 15i, "Polar
coordinate command" and "Coordinate system rotation"); LinuxCNC has neither code. Where these manuals leave the point to
parameters or forbid the block, it is refused. mm and degrees.
"""

from __future__ import annotations

import math

from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import AXES, BlockReader, Codes
from toolpath_stiff.nc.dialects import GENERIC, INCREMENT_DEGREE, INCREMENT_INCH, INCREMENT_MM, Dialect
from toolpath_stiff.nc.frames import Frames, Rotation
from toolpath_stiff.nc.words import Word
from toolpath_stiff.units import MM_PER_INCH

LINEAR = frozenset("XYZ")
LENGTHS = frozenset("XYZIJKRQ")
INCREMENTS = (
    "lengths and angles without a decimal point count least increments (0.001 mm, 0.0001 inch, 0.001 degrees: IS-B), "
    "as the dialect {} has it"
)
MIXED = (
    "some lengths end with their decimal point (X10.), and {} in line {} has none: Fanuc's and Haas' controls count "
    "such a number in 0.001 mm or 0.0001 inch; here it counts whole units, unless --dialect says otherwise"
)
SAME_PLACE_MM = 1e-9
XY = frozenset((0, 1))


class Coordinates(BlockReader):
    """Turns axis words into points.

    Attributes
    ----------
    polar
        The last programmed radius (mm) and angle (degrees), nan before there is one; None: Cartesian words (G15).
    spoke
        The polar words (@, ^) of the block: the first one, radius and angle.
    unsettled
        "G68", "G69" or "G10", whichever turned the numbers of the present X and Y last, until both are programmed.
    """

    def __init__(self, name: str, frames: Frames, dialect: Dialect = GENERIC) -> None:
        super().__init__(name, dialect)
        self.frames = frames
        self.plane = "G17"
        self.absolute, self.inch = True, False
        self.polar: list[float] | None = None
        self.unsettled: str | None = None
        self.rotation_changed = False
        self.spoke: tuple[Word, float | None, float | None] | None = None

    @property
    def length_scale(self) -> float:
        """Millimetres of one length unit of the program."""
        return MM_PER_INCH if self.inch else 1.0

    def _read_numbers(self, codes: Codes) -> None:
        """Give the block's words their values in program units, by the dialect's decimal-point rule."""
        if not self.dialect.increments:
            if self.dialect.name == GENERIC.name and (self.bare is None or not self.pointed):
                self._watch_points()
            return
        inch = (codes.get("units") or ("G20" if self.inch else "G21")) == "G20"
        angles = {"A", "B", "C"}
        if codes.get("rotation") == "G68":
            angles.add("R")
        polar = codes.get("polar") == "G16" if codes.get("polar") else self.polar is not None
        if polar and not codes.once:
            angles.add(AXES[arcs.PLANES[codes.get("plane") or self.plane][1]])
        for letter, word in self.values.items():
            if "." in word.text or not word.value or not (letter in LENGTHS or letter in angles):
                continue
            unit = INCREMENT_DEGREE if letter in angles else INCREMENT_INCH if inch else INCREMENT_MM
            self.values[letter] = word._replace(value=word.value * unit)
            self.assume(INCREMENTS.format(self.dialect.name))

    def _watch_points(self) -> None:
        """Notice what looks like a program for a control that counts increments."""
        for letter, word in self.values.items():
            if letter not in LENGTHS or not word.value:
                continue
            if word.text.endswith("."):
                self.pointed = True
            elif self.bare is None and "." not in word.text and "E" not in word.text.upper():
                self.bare = (self.block.line, word)
        self.warn_of_points()

    def warn_of_points(self) -> None:
        """Say, once, that some lengths have their decimal point and others none."""
        if self.pointed and self.bare is not None:
            self.warnings.append(MIXED.format(self.bare[1].text, self.bare[0]))

    def _axis_words(self) -> dict[int, float]:
        """Axis index -> value of the block's axis words in mm and degrees; they are thereby used."""
        found = {}
        for index, letter in enumerate(AXES):
            value = self.take(letter)
            if value is not None:
                found[index] = value * self.length_scale if letter in LINEAR else value
        return found

    def _point_words(self) -> dict[int, float]:
        """As `_axis_words`, of a block that moves in program coordinates: under G16 the second one is an angle."""
        self.spoke = None
        if self.has("@") or self.has("^"):
            return self._at_radius_and_angle()
        if self.polar is None:
            words = self._axis_words()
            if self.unsettled:
                self._settle(words)
            return words
        second = arcs.PLANES[self.plane][1]
        angle = self.take(AXES[second])
        words = self._axis_words()
        if angle is not None:
            words[second] = angle
        return words

    def _at_radius_and_angle(self) -> dict[int, float]:
        """LinuxCNC's polar words: @ the radius, ^ the angle about the program zero, of the XY plane.

        As measured on `rs274` 2.9: the one that is absent is that of the present point; in G91 both add to it.
        """
        word = self.values["@" if self.has("@") else "^"]
        if self.dialect.increments:
            raise self.fail(word, f"is not a word of the dialect {self.dialect.name}", "X and Y, or G16")
        if self.plane != "G17" or self.polar is not None or self.unsettled or self.frames.rotation is not None:
            raise self.fail(word, "is a polar word outside of G17, or under G16 or a rotation", "X and Y")
        if self.has("X") or self.has("Y"):
            raise self.fail(word, "is a polar word beside X or Y", "either")
        self.spoke = (word, self.take("@"), self.take("^"))
        return {**self._axis_words(), **self._xy_of_spoke()}

    def _xy_of_spoke(self) -> dict[int, float]:
        """X and Y, as words in the distance mode in force, of the block's polar words at the present point."""
        assert self.spoke is not None
        word, radius, angle = self.spoke
        here = self.frames.to_program(self.frames.position)
        present, turn = math.hypot(here[0], here[1]), math.atan2(here[1], here[0])
        if present < SAME_PLACE_MM and (radius is None or angle is None or not self.absolute):
            raise self.fail(word, "counts from the present point, which is the program zero", "both @ and ^, in G90")
        if radius is not None:
            present = radius * self.length_scale + (0.0 if self.absolute else present)
        if angle is not None:
            turn = math.radians(angle) + (0.0 if self.absolute else turn)
        point = (present * math.cos(turn), present * math.sin(turn))
        return {axis: value if self.absolute else value - here[axis] for axis, value in enumerate(point)}

    def _cartesian(self, here: list[float], words: dict[int, float]) -> list[float]:
        """The point that words name in the distance mode in force, coming from `here`."""
        point = list(here)
        for axis, value in words.items():
            point[axis] = value if self.absolute else here[axis] + value
        return point

    def _destination(self, here: list[float], words: dict[int, float]) -> list[float]:
        """Program coordinates of the point that words from `_point_words` name, coming from `here`."""
        point = self._cartesian(here, words)
        if self.polar is not None:
            first, second, _ = arcs.PLANES[self.plane]
            if first in words or second in words:
                point[first], point[second] = self._polar_point(words.get(first), words.get(second))
        return point

    def _control_point(self, here: list[float], words: dict[int, float]) -> list[float]:
        """Control coordinates of that point.

        Where nothing turns, axis by axis: one that is not named keeps its number to the last digit.
        """
        frames = self.frames
        point = frames.to_control(self._destination(here, words))
        if self.polar is None and not frames.rotated:
            for axis, present in enumerate(frames.position):
                if axis not in words:
                    point[axis] = present
                elif not self.absolute:
                    point[axis] = present + words[axis]
        return point

    # -- polar words -----------------------------------------------------------------------------------------------

    def _polar_mode(self, code: str | None) -> None:
        if code is not None:
            self.polar = [math.nan, math.nan] if code == "G16" else None

    def _forget_polar(self) -> None:
        """The tool went, or the zero moved, otherwise than by polar words: the next ones must name both."""
        if self.polar is not None:
            self.polar = [math.nan, math.nan]

    def _polar_point(self, radius: float | None, angle: float | None) -> tuple[float, float]:
        first, second = (AXES[axis] for axis in arcs.PLANES[self.plane][:2])
        polar = self.polar
        assert polar is not None
        if radius is not None:
            if not self.absolute:
                raise self.fail(
                    self.values[first],
                    "is a polar radius in incremental mode (G91)",
                    "a radius from the program zero (G90); the angle alone may be incremental",
                )
            polar[0] = radius
        if angle is not None:
            polar[1] = angle if self.absolute else polar[1] + angle
        if math.isnan(polar[0]) or math.isnan(polar[1]):
            raise self.fail(
                self.values[second if radius is None else first],
                "is half of a polar point, and nothing before says the other half",
                f"{first} (radius) and {second} (angle), absolute",
            )
        self.unsettled = None
        turn = math.radians(polar[1])
        return (polar[0] * math.cos(turn), polar[0] * math.sin(turn))

    # -- rotation --------------------------------------------------------------------------------------------------

    def _rotate(self, code: str, word: Word) -> None:
        """G68 X Y R: programmed points turn about X, Y (absolute; without them about the present point). G69: no more.

        On Fanuc's controls incremental words between G68 and the first absolute ones turn about the tool's place at
        G68: from there on they are turned steps, as they are here.
        """
        frames = self.frames
        here = frames.to_program(frames.position)
        if code == "G69":
            frames.rotation = None
        else:
            rotation = self._rotation_of(word, here)
            if frames.rotation is not None and frames.rotation[:2] != rotation[:2]:
                raise self.fail(word, "with another centre while a rotation is in force", "G69 before it")
            frames.rotation = rotation
        there = frames.to_program(frames.position)
        if math.dist(here[:2], there[:2]) > SAME_PLACE_MM:
            self.unsettled = code

    def _rotation_of(self, word: Word, here: list[float]) -> Rotation:
        if self.plane != "G17":
            raise self.fail(word, f"in the plane {self.plane}, which is not supported", "G17")
        solid = next((self.values[letter] for letter in "ZIJK" if self.has(letter)), None)
        if solid is not None:
            raise self.fail(solid, "makes G68 a rotation in space, which is not supported", "G68 X Y R in G17")
        angle = self.take("R")
        if angle is None:
            raise self.fail(word, "without its angle, which is then a parameter of the control", "R in degrees")
        if not self.absolute and self.frames.rotation is not None:
            raise self.fail(
                word,
                "in incremental mode (G91) under a rotation: a parameter of the control says whether R adds",
                "G90, or G69 before it",
            )
        x, y = self.take("X"), self.take("Y")
        if self.frames.rotation is not None:
            here = [*self.frames.rotation[:2], *here[2:]] if x is None and y is None else here
        return (
            here[0] if x is None else x * self.length_scale,
            here[1] if y is None else y * self.length_scale,
            angle,
        )

    def _zero_moved(self) -> None:
        """Note that the zero of turned coordinates moved: LinuxCNC's rs274 forgets that at the next M6."""
        if self.frames.offsets.at(self.frames.active).rotation:
            self.rotation_changed = True

    def _know_place(self, word: Word) -> None:
        """Refuse what hangs on the present X and Y, after a G10 that turned the offset in force."""
        if self.unsettled == "G10":
            raise self.fail(
                word,
                "hangs on the present X and Y after G10, or another work offset and M6, turned the coordinates: "
                "LinuxCNC's interpreter may have other ones",
                "a move with both X and Y before it",
            )

    def _settle(self, words: dict[int, float]) -> None:
        """Refuse what a control may take for another point: X and Y had other numbers before the rotation changed."""
        named = XY & words.keys()
        if self.unsettled == "G10" and not (self.absolute and named == XY):
            raise self.fail(
                None,
                "G10, or another work offset and M6, turned the coordinates, and the next move does not name both X "
                "and Y: LinuxCNC would take the old numbers for them",
                "absolute X and Y in the first move after it",
            )
        if not named:
            return
        word = self.values[AXES[min(named)]]
        if self.absolute and named == XY:
            self.unsettled = None
        elif self.absolute:
            raise self.fail(word, f"alone in the first move after {self.unsettled}", "both X and Y")
        elif self.unsettled == "G69":
            raise self.fail(word, "is incremental in the first move after G69", "absolute X and Y (G90)")

    def _refuse_while_rotated(self, word: Word, what: str) -> None:
        """What Fanuc's controls forbid between G68 and G69."""
        if self.frames.rotation is not None:
            raise self.fail(word, f"{what} while the coordinate system is rotated (G68)", "G69 before it")
