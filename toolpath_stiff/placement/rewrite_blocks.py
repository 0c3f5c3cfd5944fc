"""One block of a program, written for another placement: straight moves, homes, arcs, cycles, moves cut into pieces."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import AXES, Codes
from toolpath_stiff.nc.codes import ARCS, CYCLES
from toolpath_stiff.nc.interpreter import USES_AXES
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.nc.recorder import Arc
from toolpath_stiff.nc.words import POLAR, Block, read_block
from toolpath_stiff.placement.rewrite_controls import OFF, Controls
from toolpath_stiff.placement.rewrite_pieces import LEAN, LEVER, chords, lean, points_between
from toolpath_stiff.placement.rewrite_words import FEED_DECIMALS, SAME, LineEdit

HALF_CIRCLE = 0.999  # chord over diameter, from which R magnifies a rounded end more than twenty times
NEAR = 2.0  # units by which the centre of an arc given by R may miss its place; beyond, I, J, K are written
SLASH = re.compile(r"\s*/\d*")
LINEARISE = "give --linearise MM to have straight moves within MM of it, or place the work without that turn"


class Rewriter(Controls):
    """Rewrites blocks in order."""

    def block(self, block: Block, text: str) -> tuple[list[str], bool]:
        """The lines that take a block's place, and whether the program goes on."""
        if not block.words:
            return [text], True
        source, out = self.source, self.out
        source.segments = []
        first, first_out = len(source.recorder.line), len(out.recorder.line)
        codes = source.begin(block)
        if source.call is not None or source.returns:
            raise self._refusal(
                "a subprogram (M98, M99) cannot be rewritten: it may run at several places",
                "expand subprograms before",
            )
        axes = [letter for letter in AXES if source.has(letter)]
        plane_before = out.plane
        out.begin(block)
        goes_on = source.finish(codes)
        edit = LineEdit(text, block, self._digits)
        plane = self._plane_word(codes, edit, plane_before)
        self._pieces = False
        lines = self._lines(codes, edit, axes, plane, first)
        self._check(first, first_out, self._pieces)
        return lines, goes_on

    def _lines(self, codes: Codes, edit: LineEdit, axes: list[str], plane: str, first: int) -> list[str]:
        source = self.source
        once = [code for code, _ in codes.once]
        if not source.segments:
            return [self._emit(edit)]
        last = source.segments[-1]
        if source.polar is not None or any(word.letter in POLAR for word in source.block.words):
            raise self._refusal(
                "polar words (G16, @, ^) cannot be rewritten", "post the program in Cartesian coordinates"
            )
        if "G53" in once:
            self._note("moves of G53 keep their machine coordinates")
        elif any(code in USES_AXES for code in once):
            self._note(
                "the reference points of G28 and G30 stay where they are; intermediate points move with the work"
            )
            self._home(edit, axes)
        elif source.motion in CYCLES:
            if self._matrix[arcs.PLANES[source.plane][2], arcs.PLANES[source.plane][2]] != 1.0:
                return self._cycle_in_moves(codes, edit, axes, first)
            self._cycle(codes, edit, axes, plane)
        else:
            count = self._piece_count(last.motion, last.start, last.end, last.arc)
            if count > 1:
                return self._in_pieces(codes, edit, axes, count)
            if last.arc is None:
                self._motion_word(codes, edit, source.motion or "")
                self._go(edit, self._target(last.end), axes)
            else:
                self._arc(codes, edit, axes, plane)
        return [self._emit(edit)]

    # -- homes -----------------------------------------------------------------------------------------------------

    def _home(self, edit: LineEdit, axes: list[str]) -> None:
        """G28, G30: the intermediate point moves with the work, the reference point does not."""
        if not axes:
            return
        mixed = self._matrix != 0.0
        named = [AXES.index(letter) for letter in axes]
        missing = [
            AXES[other]
            for other in range(3)
            if other not in named and any(axis < 3 and (mixed[axis, other] or mixed[other, axis]) for axis in named)
        ]
        if missing:
            raise self._refusal(
                f"G28 or G30 of {', '.join(axes)} without {', '.join(missing)}: the turned work has no such axis alone",
                f"name {', '.join(missing)} too",
            )
        self._go(edit, self._target(self.source.segments[0].end), axes, only=named)

    # -- arcs ------------------------------------------------------------------------------------------------------

    def _arc(self, codes: Codes, edit: LineEdit, axes: list[str], plane: str) -> None:
        source = self.source
        image, last = self._image(source.plane), source.segments[-1]
        assert image is not None
        assert last.arc is not None
        name, sign = image
        if name != plane:
            edit.add_code(name)
        code = source.motion or ""
        code = code if sign > 0.0 else ARCS[1 - ARCS.index(code)]
        self._motion_word(codes, edit, code)
        first, second, normal = arcs.PLANES[name]
        target = self._target(last.end)
        start, end = (source.frames.to_program(point) for point in (last.start, last.end))
        chord = math.dist(*([point[axis] for axis in arcs.PLANES[source.plane][:2]] for point in (start, end)))
        if chord < SAME:
            self._full_circle(edit, target, axes, normal)
        else:
            self._go(edit, target, axes)
        self._center(edit, last.arc.center, code == "G2", (first, second), chord)

    def _full_circle(self, edit: LineEdit, target: list[float], axes: list[str], normal: int) -> None:
        """A circle ends on its own start to the last digit, or it is none: words that cannot say so are left out."""
        here = self.out.frames.to_program(self.out.frames.position)
        for axis in range(3):
            place = here[axis] / self._scale(axis)
            if axis == normal or AXES[axis] not in axes:
                continue
            if self.out.absolute and abs(round(place, self._digits) - place) > SAME:
                edit.remove(AXES[axis])
            else:
                edit.write(AXES[axis], place if self.out.absolute else 0.0)
        along = [normal, 3, 4, 5]
        self._go(edit, target, [letter for letter in axes if AXES.index(letter) in along], only=along)

    def _center(
        self, edit: LineEdit, center: Sequence[float], clockwise: bool, plane: tuple[int, int], exact_chord: float
    ) -> None:
        """I, J, K of a centre (set-up frame of the untouched program); R stays where it says the same."""
        out = self.out
        there = out.frames.to_program(self._of_setup([*center, 0.0, 0.0, 0.0]))
        here = out.frames.to_program(out.frames.position)
        if edit.word("R") is not None:
            if self._radius_says(edit, here, there, clockwise, plane, exact_chord):
                return
            edit.remove("R")
        letters = [arcs.CENTER_WORDS[axis] for axis in plane]
        edit.remove(letter for letter in arcs.CENTER_WORDS if letter not in letters)
        for axis, letter in zip(plane, letters, strict=True):
            value = (there[axis] if out.arc_absolute else there[axis] - here[axis]) / self._scale(axis)
            if edit.word(letter) is not None or out.arc_absolute or abs(value) > OFF * 10.0**-self._digits:
                edit.write(letter, value)

    def _radius_says(
        self,
        edit: LineEdit,
        here: Sequence[float],
        center: Sequence[float],
        clockwise: bool,
        plane: tuple[int, int],
        exact_chord: float,
    ) -> bool:
        """Whether R with the rounded ends puts the centre where it belongs; near half circles it does not."""
        radius = edit.word("R")
        assert radius is not None
        end = list(here)
        for word in read_block(edit.render(), self.source.block.line, self.source.name).words:
            if word.letter in AXES:
                axis = AXES.index(word.letter)
                value = word.value * self._scale(axis)
                end[axis] = value if self.out.absolute else here[axis] + value
        first, second = plane
        size = radius.value * self._scale(first)
        chord = math.dist((here[first], here[second]), (end[first], end[second]))
        if abs(chord - exact_chord) > SAME and chord > HALF_CIRCLE * 2.0 * abs(size):
            return False
        try:
            found = arcs.center_from_radius((here[first], here[second]), (end[first], end[second]), size, clockwise)
        except arcs.ArcError:
            return False
        return math.dist(found, (center[first], center[second])) <= NEAR * self._unit

    # -- cycles ----------------------------------------------------------------------------------------------------

    def _cycle(self, codes: Codes, edit: LineEdit, axes: list[str], plane: str) -> None:
        """The hole's place turns and moves, bottom and R plane (in G90) move along the drilling axis."""
        source, out = self.source, self.out
        first, second, normal = arcs.PLANES[source.plane]
        if source.plane != plane:
            edit.add_code(source.plane)
        self._motion_word(codes, edit, source.motion or "")
        repeats = edit.word("L")
        holes = [letter for letter in axes if AXES.index(letter) != normal]
        target = self._target(source.segments[-1].end)
        self._go(edit, target, holes, only=[first, second], parts=int(repeats.value) if repeats else 1)
        for key, letter in (("Z", AXES[normal]), ("R", "R")):
            height = source.sticky[key]
            if source.absolute:
                place = source.frames.to_program(source.frames.position)
                place[normal] = height
                height = out.frames.to_program(self._target(source.frames.to_control(place)))[normal]
            if edit.word(letter) or abs(height - out.sticky.get(key, math.inf)) > OFF * self._unit:
                edit.write(letter, height / self._scale(normal))

    def _cycle_in_moves(self, codes: Codes, edit: LineEdit, axes: list[str], first: int) -> list[str]:
        """A cycle along an axis that is none any more: its moves, rapids and dwells, one a line."""
        source = self.source
        if self.linearise is None:
            axis = AXES[arcs.PLANES[source.plane][2]]
            raise self._refusal(
                f"{source.motion} drills along {axis}, and the placement turns the work out of it", LINEARISE
            )
        self._note("drilling cycles are written as their single moves")
        rows = source.recorder
        pieces = [
            ("G0" if rows.motion[i] == RAPID else "G1", rows.end[i], rows.dwell[i])
            for i in range(first, len(rows.line))
        ]
        return self._one_by_one(codes, edit, axes, pieces)

    # -- pieces ----------------------------------------------------------------------------------------------------

    def _piece_count(self, motion: int, start: list[float], end: list[float], arc: Arc | None) -> int:
        """Into how many pieces a move must be cut; those that must be are refused, unless it was asked for."""
        off_plane = arc is not None and self._image(self.source.plane) is None
        leaning = 0.0
        if motion != RAPID and self.turn.turns and start[3:] != end[3:]:
            written = self.out.frames.position[3:], self._target(end)[3:]
            leaning = lean(self.turn, (start[3:], end[3:]), written)
        if not off_plane and leaning == 0.0:
            return 1
        if self.linearise is None:
            self._refuse_to_cut(off_plane, leaning)
            return 1
        tolerance = self.linearise - self._unit
        if tolerance < self._unit:
            raise self._refusal(
                f"--linearise {self.linearise:g} mm is no more than the rounding to {self._digits} decimals",
                "give more of it, or more --decimals",
            )
        count = math.ceil(math.sqrt(leaning / math.degrees(tolerance / LEVER)))
        if arc is not None and (off_plane or count > 1):
            self._note(f"arcs that the turn takes out of the planes are written as chords within {self.linearise:g} mm")
            frames = self.source.frames
            count = max(count, chords(arc, frames.to_setup(start), frames.to_setup(end), tolerance), 2)
        return count

    def _refuse_to_cut(self, off_plane: bool, leaning: float) -> None:
        if off_plane:
            raise self._refusal(
                f"an arc of {self.source.plane}, turned with the work, lies in none of the planes G17, G18, G19",
                LINEARISE,
            )
        if leaning > LEAN:
            raise self._refusal(
                f"between its ends the tool would lean {leaning:.3g} degrees otherwise than placed, as a control "
                "interpolates A, B and C",
                LINEARISE,
            )

    def _in_pieces(self, codes: Codes, edit: LineEdit, axes: list[str], count: int) -> list[str]:
        """A cutting move as `count` straight ones."""
        source = self.source
        self._pieces = True
        last = source.segments[-1]
        start, end = (source.frames.to_setup(point) for point in (last.start, last.end))
        points = points_between(start, end, last.arc, count)
        return self._one_by_one(codes, edit, axes, [("G1", point, 0.0) for point in points])

    def _one_by_one(
        self, codes: Codes, edit: LineEdit, axes: list[str], pieces: Sequence[tuple[str, list[float], float]]
    ) -> list[str]:
        """Straight moves (code, end in the set-up frame, dwell after it in s), the first in the block's own line."""
        stop = codes.groups.get("M stop")
        if stop is not None:
            raise self._refusal(f"{stop[0]} in a block that is written as several", "give it a block of its own")
        edit.remove("IJKRPLQ")
        feed = edit.word("F") if self.out.feed_mode == "G93" else None
        slash = SLASH.match(edit.render()) if edit.block.optional else None
        lines = []
        for number, (code, point, dwell) in enumerate(pieces):
            if number:
                edit = edit.next_line(slash[0] if slash else "")
                codes = Codes()
            self._motion_word(codes, edit, code)
            self._go(edit, self._of_setup(point), [] if number else axes)
            if feed is not None:  # of each piece, as G93 counts the moves
                edit.write("F", feed.value * len(pieces), FEED_DECIMALS)
            if number == 0 or edit.moves:
                lines.append(self._emit(edit))
            if dwell:
                pause = edit.next_line(slash[0] if slash else "")
                pause.add_code("G4")
                pause.write("P", dwell, FEED_DECIMALS)
                lines.append(self._emit(pause))
        return lines
