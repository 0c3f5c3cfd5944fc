"""One block of a program, written for another placement: straight moves, homes, arcs, cycles, moves cut into pieces."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from toolpath_stiff.hints import both_names
from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.arc import ARCS
from toolpath_stiff.nc.codes.drilling import CYCLES
from toolpath_stiff.nc.codes.registry import CODES
from toolpath_stiff.nc.interpreter import begin, finish
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.nc.state import Flow
from toolpath_stiff.nc.words import AXES, POLAR, Block, read_block
from toolpath_stiff.rewriting.controls import FEED_DECIMALS, OFF, SAME, Controls, LineEdit
from toolpath_stiff.rewriting.turn import LEAN, LEVER, chords, lean, points_between

HALF_CIRCLE = 0.999  # chord over diameter, from which R magnifies a rounded end more than twenty times
NEAR = 2.0  # units by which the centre of an arc given by R may miss its place; beyond, I, J, K are written
Piece = tuple[str, list[float], float]  # G0 or G1, end in the set-up frame, dwell after it in s
SLASH = re.compile(r"\s*/\d*")
SUBPROGRAM = "a subprogram (M98, M99) cannot be rewritten: it may run at several places"
COMPENSATION = "cutter compensation (G41, G42) cannot be rewritten"
LINEARISE = (
    f"give {both_names('--linearise', 'MM')} to have straight moves within MM of it, "
    "or place the work without that turn"
)


def rewrite_block(controls: Controls, block: Block, text: str) -> tuple[list[str], bool]:
    """The lines that take a block's place, and whether the program goes on."""
    if not block.words:
        return [text], True
    source, out = controls.source, controls.out
    controls.block = block
    controls.trace.clear()
    first, first_out = len(source.recorder.recent), len(out.recorder.recent)
    controls.current = current = begin(source, block)
    if current.flow is not Flow.NEXT:
        raise controls.refusal(SUBPROGRAM, "expand the subprograms first")
    if "M modal state" in current.groups:
        raise controls.refusal("saved modes (M70 to M73) cannot be rewritten", "write the modes out")
    if {source.motion, current.groups.get("motion")} & {"G33", "G33.1"}:
        raise controls.refusal("spindle-synchronised motion (G33) cannot be rewritten", "leave it out")
    if source.cutter is not None:
        raise controls.refusal(COMPENSATION, "post the program with the path of the tool centre")
    controls.axes = [letter for letter in AXES if current.has(letter)]
    plane_before = out.plane
    begin(out, block)
    goes_on = finish(source, current) is Flow.NEXT
    controls.edit = LineEdit(text, block, controls.digits)
    plane = controls.plane_word(plane_before)
    lines, pieces = _lines(controls, current.groups.get("non-modal"), plane, first)
    controls.check(first, first_out, pieces)
    return lines, goes_on


def _lines(controls: Controls, once: str | None, plane: str, first: int) -> tuple[list[str], bool]:
    """The lines, and whether they are one move cut into pieces."""
    source = controls.source
    if not controls.trace:
        return [controls.emit()], False
    last = controls.trace[-1]
    if source.polar is not None or any(word.letter in POLAR for word in controls.block.words):
        raise controls.refusal(
            "polar words (G16, @, ^) cannot be rewritten", "post the program in Cartesian coordinates"
        )
    if once == "G53":
        controls.note("moves of G53 keep their machine coordinates")
    elif once is not None and CODES[once].takes_axes:
        controls.note("the reference points of G28 and G30 stay where they are; intermediate points move with the work")
        _home(controls)
    elif source.motion in CYCLES:
        if controls.matrix[geometry.PLANES[source.plane][2], geometry.PLANES[source.plane][2]] != 1.0:
            return _one_by_one(controls, _cycle_in_moves(controls, first)), False
        _cycle(controls, plane)
    else:
        count = _piece_count(controls)
        if count > 1:
            start, end = (source.frames.to_setup(point) for point in (last.start, last.end))
            points = points_between(start, end, last.arc, count)
            return _one_by_one(controls, [("G1", point, 0.0) for point in points]), True
        if last.arc is None:
            controls.motion_word(source.motion or "")
            controls.go(controls.target(last.end), controls.axes)
        else:
            _arc(controls, plane)
    return [controls.emit()], False


def _home(controls: Controls) -> None:
    """G28, G30: the intermediate point moves with the work, the reference point does not."""
    axes = controls.axes
    if not axes:
        return
    mixed = controls.matrix != 0.0
    named = [AXES.index(letter) for letter in axes]
    missing = [
        AXES[other]
        for other in range(3)
        if other not in named and any(axis < 3 and (mixed[axis, other] or mixed[other, axis]) for axis in named)
    ]
    if missing:
        raise controls.refusal(
            f"G28 or G30 of {', '.join(axes)} without {', '.join(missing)}: the turned work has no such axis alone",
            f"name {', '.join(missing)} too",
        )
    controls.go(controls.target(controls.trace[0].end), axes, only=named)


def _arc(controls: Controls, plane: str) -> None:
    source, edit, axes = controls.source, controls.edit, controls.axes
    image, last = controls.image(source.plane), controls.trace[-1]
    assert image is not None
    assert last.arc is not None
    name, sign = image
    if name != plane:
        edit.add_code(name)
    code = source.motion or ""
    code = code if sign > 0.0 else ARCS[1 - ARCS.index(code)]
    controls.motion_word(code)
    first, second, normal = geometry.PLANES[name]
    target = controls.target(last.end)
    start, end = (source.frames.to_program(point) for point in (last.start, last.end))
    chord = math.dist(*([point[axis] for axis in geometry.PLANES[source.plane][:2]] for point in (start, end)))
    if chord >= SAME:
        controls.go(target, axes)
    else:  # a circle ends on its own start to the last digit, or it is none: words that cannot say so are left out
        here = controls.out.frames.to_program(controls.out.frames.position)
        for axis in (axis for axis in range(3) if axis != normal and AXES[axis] in axes):
            place = here[axis] / controls.scale(axis)
            if controls.out.absolute and abs(round(place, controls.digits) - place) > SAME:
                edit.remove(AXES[axis])
            else:
                edit.write(AXES[axis], place if controls.out.absolute else 0.0)
        along = [normal, 3, 4, 5]
        controls.go(target, [letter for letter in axes if AXES.index(letter) in along], only=along)
    _center(controls, last.arc.center, code == "G2", (first, second), chord)


def _center(
    controls: Controls, center: Sequence[float], clockwise: bool, plane: tuple[int, int], exact_chord: float
) -> None:
    """I, J, K of a centre (set-up frame of the untouched program); R stays where it says the same."""
    out, edit = controls.out, controls.edit
    there = out.frames.to_program(controls.of_setup([*center, 0.0, 0.0, 0.0]))
    here = out.frames.to_program(out.frames.position)
    if edit.word("R") is not None:
        by_radius = _center_by_radius(controls, here, clockwise, plane, exact_chord)
        if by_radius and math.dist(by_radius, [there[axis] for axis in plane]) <= NEAR * controls.unit:
            return
        edit.remove("R")
    letters = [geometry.CENTER_WORDS[axis] for axis in plane]
    edit.remove(letter for letter in geometry.CENTER_WORDS if letter not in letters)
    for axis, letter in zip(plane, letters, strict=True):
        value = (there[axis] if out.arc_absolute else there[axis] - here[axis]) / controls.scale(axis)
        if edit.word(letter) is not None or out.arc_absolute or abs(value) > OFF * 10.0**-controls.digits:
            edit.write(letter, value)


def _center_by_radius(
    controls: Controls, here: Sequence[float], clockwise: bool, plane: tuple[int, int], exact_chord: float
) -> geometry.Point2 | None:
    """The centre that R gives with the rounded ends; None near half circles, where R magnifies the rounding."""
    end, size = list(here), 0.0
    for word in read_block(controls.edit.render(), controls.block.line, controls.source.name).words:
        if word.letter in AXES:
            axis = AXES.index(word.letter)
            end[axis] = word.value * controls.scale(axis) + (0.0 if controls.out.absolute else here[axis])
        elif word.letter == "R":
            size = word.value * controls.scale(plane[0])
    first, last = ((point[plane[0]], point[plane[1]]) for point in (here, end))
    chord = math.dist(first, last)
    if abs(chord - exact_chord) > SAME and chord > HALF_CIRCLE * 2.0 * abs(size):
        return None
    try:
        return geometry.center_from_radius(first, last, size, clockwise)
    except geometry.ArcError:
        return None


def _cycle(controls: Controls, plane: str) -> None:
    """The hole's place turns and moves, bottom and R plane (in G90) move along the drilling axis."""
    source, out, edit = controls.source, controls.out, controls.edit
    first, second, normal = geometry.PLANES[source.plane]
    if source.plane != plane:
        edit.add_code(source.plane)
    controls.motion_word(source.motion or "")
    repeats = edit.word("L")
    holes = [letter for letter in controls.axes if AXES.index(letter) != normal]
    target = controls.target(controls.trace[-1].end)
    controls.go(target, holes, only=[first, second], parts=int(repeats.value) if repeats else 1)
    for key, letter in (("Z", AXES[normal]), ("R", "R")):
        height = source.sticky[key]
        if source.absolute:
            place = source.frames.to_program(source.frames.position)
            place[normal] = height
            height = out.frames.to_program(controls.target(source.frames.to_control(place)))[normal]
        if edit.word(letter) or abs(height - out.sticky.get(key, math.inf)) > OFF * controls.unit:
            edit.write(letter, height / controls.scale(normal))


def _cycle_in_moves(controls: Controls, first: int) -> list[Piece]:
    """The moves, rapids and dwells of a cycle along an axis that is none any more."""
    source = controls.source
    if controls.linearise is None:
        axis = AXES[geometry.PLANES[source.plane][2]]
        raise controls.refusal(
            f"{source.motion} drills along {axis}, and the placement turns the work out of it", LINEARISE
        )
    controls.note("drilling cycles are written as their single moves")
    moves = source.recorder.recent[first:]
    return [("G0" if move.motion == RAPID else "G1", move.end, move.dwell) for move in moves]


def _piece_count(controls: Controls) -> int:
    """Number of pieces into which a move must be cut; those that must be are refused, unless it was asked for."""
    motion, start, end, arc = controls.trace[-1]
    off_plane = arc is not None and controls.image(controls.source.plane) is None
    leaning = 0.0
    if motion != RAPID and controls.turn.turns and start[3:] != end[3:]:
        written = controls.out.frames.position[3:], controls.target(end)[3:]
        leaning = lean(controls.turn, (start[3:], end[3:]), written)
    if controls.linearise is None:
        if off_plane:
            plane = controls.source.plane
            raise controls.refusal(
                f"an arc of {plane}, turned with the work, lies in none of the planes G17, G18, G19", LINEARISE
            )
        if leaning > LEAN:
            raise controls.refusal(
                f"between its ends the tool would lean {leaning:.3g} degrees away from its placed direction, as a "
                "control interpolates A, B and C",
                LINEARISE,
            )
    if controls.linearise is None or (not off_plane and leaning == 0.0):
        return 1
    tolerance = controls.linearise - controls.unit
    if tolerance < controls.unit:
        option = both_names("--linearise", f"{controls.linearise:g}")
        problem = f"{option} is no more than the rounding to {controls.digits} decimals"
        raise controls.refusal(problem, "give more of it, or more --decimals")
    count = math.ceil(math.sqrt(leaning / math.degrees(tolerance / LEVER)))
    if arc is not None and (off_plane or count > 1):
        controls.note(
            f"arcs that the turn takes out of the planes are written as chords within {controls.linearise:g} mm"
        )
        frames = controls.source.frames
        count = max(count, chords(arc, frames.to_setup(start), frames.to_setup(end), tolerance), 2)
    return count


def _one_by_one(controls: Controls, pieces: Sequence[Piece]) -> list[str]:
    """Straight moves, the first in the block's own line."""
    stop, edit = controls.current and controls.current.code("M stop"), controls.edit
    if stop:
        raise controls.refusal(f"{stop[0]} in a block that is written as several", "give it a block of its own")
    edit.remove("IJKRPLQ")
    feed = edit.word("F") if controls.out.feed_mode == "G93" else None
    slash = SLASH.match(edit.render()) if edit.block.optional else None
    lead = slash[0] if slash else ""
    lines = []
    for number, (code, point, dwell) in enumerate(pieces):
        if number:
            controls.edit, controls.current = edit.next_line(lead), None
        controls.motion_word(code)
        controls.go(controls.of_setup(point), [] if number else controls.axes)
        if feed is not None:  # of each piece, as G93 counts the moves
            controls.edit.write("F", feed.value * len(pieces), FEED_DECIMALS)
        if number == 0 or controls.edit.moves:
            lines.append(controls.emit())
        if dwell:
            controls.edit = edit.next_line(lead)
            controls.edit.add_code("G4")
            controls.edit.write("P", dwell, FEED_DECIMALS)
            lines.append(controls.emit())
    return lines
