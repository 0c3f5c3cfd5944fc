"""Codes that set zeros and leave program coordinates: G10, G28 and G30, G52, G92. mm, degrees inside."""

from __future__ import annotations

from collections.abc import Collection

from toolpath_stiff.nc.codes import ADDITIONAL_OFFSETS, WORK_OFFSETS
from toolpath_stiff.nc.coordinates import XY
from toolpath_stiff.nc.motion import Mover
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.nc.tables import ToolEntry, WorkOffset
from toolpath_stiff.nc.words import Word


class Zeros(Mover):
    """Work offsets, reference points, shifts."""

    def _g10(self, word: Word) -> None:
        level, number = self.take("L"), self.take("P")
        if self.dialect.increments:
            self._fanuc_g10(word, level, number)
            return
        if level == 1:
            self._g10_tool(word, number)
            return
        if level not in (2, 20):
            raise self.fail(word, f"with L{level:g}" if level is not None else "without L", "L2, L20 (offsets) or L1")
        if number == 0 and self.frames.active >= len(WORK_OFFSETS):
            raise self.fail(word, "P0 while an additional offset is in force", "P1 to P9")
        self._refuse_while_rotated(word, "sets a work offset")
        self._forget_polar()
        if number is None or number != int(number) or not 0 <= number <= len(WORK_OFFSETS):
            raise self.fail(word, "needs the work offset", f"P0 (the active one) or P1 to P{len(WORK_OFFSETS)}")
        index = self.frames.active if number == 0 else int(number) - 1
        offset = self.frames.offsets.table[index]
        rotation = self.take("R")
        if rotation is not None:
            if level == 20:
                raise self.fail(self.values["R"], "does not go with L20", "L2")
            if index == self.frames.active and rotation != offset.rotation:
                self.unsettled = "G10"
            offset.rotation = rotation
        words = self._axis_words()
        if level == 20:
            self._know_position(word, words)
            self._offset_from_here(index, words)
        else:
            for axis, value in words.items():
                offset.axes[axis] = value
        offset.given = True
        if index == self.frames.active:
            self._zero_moved()

    def _fanuc_g10(self, word: Word, level: float | None, number: float | None) -> None:
        """Fanuc's and Haas' G10: L2 sets G54 to G59, L20 the additional offsets, L10 the length of the tool of an H.

        Sources: Fanuc's operator's manuals ("Programmable data input"), Haas' mill operator's manual (G10).
        """
        if level not in (2, 10, 20):
            raise self.fail(word, f"with L{level:g}" if level is not None else "without L", "L2, L20 or L10")
        most = {2: 6, 10: 999, 20: max(ADDITIONAL_OFFSETS[code] for code in self.dialect.additional)}[int(level)]
        if number is None or number != int(number) or not 1 <= number <= most:
            raise self.fail(word, f"L{level:g} without a number that it knows", f"P1 to P{most}")
        if not self.absolute:
            raise self.fail(word, "in incremental mode (G91), where it adds", "G90")
        if level == 10:
            length = self.take("R")
            if length is None:
                raise self.fail(word, "L10 without the length", "R")
            self.tools = {} if self.tools is None else self.tools
            self.tools.setdefault(int(number), ToolEntry(int(number))).length = length * self.length_scale
            return
        self._refuse_while_rotated(word, "sets a work offset")
        self._forget_polar()
        offsets = self.frames.offsets
        index = int(number) - 1
        offset = offsets.table[index] if level == 2 else offsets.additional.setdefault(index + 1, WorkOffset())
        for axis, value in self._axis_words().items():
            offset.axes[axis] = value
        offset.given = True

    def _offset_from_here(self, index: int, words: dict[int, float]) -> None:
        """L20: choose the offset so that the present point gets these coordinates."""
        frames = self.frames
        active, frames.active = frames.active, index
        here = frames.to_program(frames.position)
        wanted = [words.get(axis, here[axis]) for axis in range(6)]
        shift = [c - w for c, w in zip(frames.position, frames.to_control(wanted), strict=True)]
        frames.active = active
        for axis in range(6):
            frames.offsets.table[index].axes[axis] += shift[axis]

    def _g10_tool(self, word: Word, number: float | None) -> None:
        if number is None or number != int(number) or number < 0:
            raise self.fail(word, "needs the tool number", "P with a whole number")
        words = self._axis_words()
        radius = self.take("R")
        if any(axis != 2 for axis in words):
            raise self.fail(word, "sets other tool offsets than Z", "Z, the tool's length")
        self.tools = {} if self.tools is None else self.tools
        tool = self.tools.setdefault(int(number), ToolEntry(int(number)))
        tool.length = words.get(2, tool.length)
        tool.diameter = tool.diameter if radius is None else 2.0 * radius * self.length_scale

    def _go_home(self, code: str, word: Word) -> None:
        """G28, G30: rapid to the intermediate point, then the axes named there, or all, to the reference point."""
        words = self._axis_words()
        self._leave_program_coordinates(word, words)
        if words:
            between = self._cartesian(self.frames.to_program(self.frames.position), words)
            self._straight(RAPID, self.frames.to_control(between), set(words))
        home = self.frames.offsets.home_g28 if code == "G28" else self.frames.offsets.home_g30
        if not any(home):
            self.assume(f"the reference point of {code}, not given by any offsets file, is machine 0, 0, 0")
        going = set(words) or set(range(6))
        # Axis by axis in program coordinates, as LinuxCNC does: with a rotation in force it is not the same.
        frames = self.frames
        there = frames.to_program(frames.control_of_machine(list(home)))
        here = frames.to_program(frames.position)
        point = [there[axis] if axis in going else here[axis] for axis in range(6)]
        self._straight(RAPID, frames.to_control(point), set(), machine=going)

    def _leave_program_coordinates(self, word: Word, words: dict[int, float]) -> None:
        """A move of `words` (none: all axes) by machine coordinates: harmless under G68 only off the rotated plane."""
        if self.frames.tip_held:
            raise self.fail(word, "while tool centre point control is on (G43.4)", "G49 before it")
        if words and not words.keys() >= XY:
            self._know_place(word)
        if not words or XY & words.keys():
            self._refuse_while_rotated(word, "moves X and Y by machine coordinates")
            self._forget_polar()
            if not words or words.keys() >= XY:
                self.unsettled = None

    def _know_position(self, word: Word, axes: Collection[int]) -> None:
        """Refuse a code that takes the present numbers of axes that LinuxCNC's interpreter may have otherwise."""
        if 2 in axes:
            self._know_height(word)
        if XY & set(axes):
            self._know_place(word)

    def _shift(self, code: str, word: Word) -> None:
        self._refuse_while_rotated(word, "shifts the zero")
        self._forget_polar()
        words = self._axis_words()
        if not words:
            raise self.fail(word, "without axis words", "X, Y, Z, A, B or C")
        frames = self.frames
        if code == "G52":
            for axis, value in words.items():
                frames.g92[axis] = value
        else:
            self._know_position(word, words)
            here = frames.to_program(frames.position)
            for axis, value in words.items():
                frames.g92[axis] += here[axis] - value
        frames.g92_kept = list(frames.g92)
        self._zero_moved()

    def _g92_state(self, code: str, word: Word) -> None:
        self._refuse_while_rotated(word, "shifts the zero")
        self._forget_polar()
        self._zero_moved()
        frames = self.frames
        if code == "G92.3":
            frames.g92 = list(frames.g92_kept)
            return
        frames.g92 = [0.0] * 6
        if code == "G92.1":
            frames.g92_kept = [0.0] * 6
