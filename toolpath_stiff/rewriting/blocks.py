"""One block of a program, written for another placement: straight moves, homes, arcs, cycles, moves cut into pieces."""

import math
import re
from collections.abc import Sequence

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.drilling import CYCLES
from toolpath_stiff.nc.codes.motion import ARCS
from toolpath_stiff.nc.codes.registry import CODES
from toolpath_stiff.nc.interpreter import begin, finish
from toolpath_stiff.nc.moves import RAPID, Arc, Move
from toolpath_stiff.nc.state import Flow
from toolpath_stiff.nc.words import AXES, CORNERS, Block
from toolpath_stiff.rewriting.controls import FEED_DECIMALS, OFF, SAME, Controls, LineEdit
from toolpath_stiff.rewriting.side_shift import Course
from toolpath_stiff.rewriting.turn import LEAN, LEVER, chords, lean, point_at

Piece = tuple[str, list[float], float]  # G0 or G1, end in the set-up frame, dwell after it in s
SLASH = re.compile(r"^\s*/\d*")
LINEARISE = "give --linearise MM to have straight moves within MM of it, or place the work without that turn"


def rewrite_block(controls: Controls, block: Block, text: str) -> tuple[list[str], bool]:
    """Lines that replace a block, and True if the program continues after it."""
    if not block.words:
        return [text], True
    source, out = controls.source, controls.out
    controls.edit = LineEdit(text, block)
    controls.trace.clear()
    first, first_out = len(source.recorder.recent), len(out.recorder.recent)
    controls.current = current = begin(source, block)
    letters = {word.letter for word in block.words}
    refused = {
        "a subprogram (M98, M99), which may run at several places,": current.flow is not Flow.NEXT,
        "a corner with the next block (,R ,C)": bool(letters & set(CORNERS)),
        "a block with a slash in its middle": block.rest is not None,
    }
    turned = {"cutter compensation (G41, G42)": source.cutter, "polar words (G16)": source.polar}
    stays = next((what for what, state in turned.items() if state is not None), "")
    refused[stays] = bool(stays) and controls.courses is None
    for what, holds in refused.items():
        controls.refuse_if(holds, f"{what} cannot be rewritten", "post the moves of the tool centre, one a block")
    if stays:
        goes_on, lines = finish(source, current) is Flow.NEXT, [controls.emit()]
        controls.fixed |= dict.fromkeys(range(first, len(source.recorder.recent)), stays)
        controls.check(first, first_out, pieces=False)
        return lines, goes_on
    controls.axes = [letter for letter in AXES if current.has(letter)]
    plane_before = out.plane
    begin(out, block)
    goes_on = finish(source, current) is Flow.NEXT
    plane, course = controls.plane_word(plane_before), (controls.courses or {}).get(first)
    if course is not None and len(source.recorder.recent) > first:
        lines = _shifted(controls, plane, course)
    elif controls.courses is not None and out.absolute:
        lines = [controls.emit()]
    else:
        lines = _lines(controls, current.groups.get("non-modal"), plane, first)
    controls.check(first, first_out, pieces=len(lines) > 1)
    return lines, goes_on


def _lines(controls: Controls, once: str | None, plane: str, first: int) -> list[str]:
    source, last = controls.source, controls.trace[-1] if controls.trace else None
    if last is None or once == "G53":
        return [controls.emit()]
    if once is not None and CODES[once].takes_axes:
        _home(controls)
    elif source.motion in CYCLES:
        normal = geometry.PLANES[source.plane][2]
        if controls.matrix[normal, normal] != 1.0:
            out_of_it = f"{source.motion} drills along {AXES[normal]}, and the placement turns the work out of it"
            controls.refuse_if(controls.linearise is None, out_of_it, LINEARISE)
            moves = source.recorder.recent[first:]
            return _one_by_one(controls, [("G0" if m.motion == RAPID else "G1", m.end, m.dwell) for m in moves])
        _cycle(controls, plane)
    else:
        count = _piece_count(controls, last)
        if count > 1:
            start, end = (source.frames.to_setup(point) for point in (last.start, last.end))
            points = [point_at(start, end, last.arc, part / count) for part in range(1, count)]
            return _one_by_one(controls, [("G1", point, 0.0) for point in (*points, end)])
        if last.arc is None:
            controls.motion_word(source.motion or "")
            controls.go(controls.target(last.end), controls.axes)
        else:
            _arc(controls, plane, last, last.arc)
    return [controls.emit()]


def _home(controls: Controls) -> None:
    """G28, G30: the intermediate point moves with the work, the reference point does not."""
    axes = controls.axes
    named = [AXES.index(letter) for letter in axes]
    mixed = (controls.matrix != 0.0) | (controls.matrix.T != 0.0)
    linear = [axis for axis in named if axis < 3]
    missing = [AXES[axis] for axis in range(3) if axis not in named and mixed[axis, linear].any()]
    controls.refuse_if(
        missing,
        f"G28 or G30 of {', '.join(axes)} without {', '.join(missing)}: the turned work has no such axis alone",
        f"name {', '.join(missing)} too",
    )
    controls.go(controls.target(controls.trace[0].end), axes, only=named)


def _arc(controls: Controls, plane: str, move: Move, arc: Arc) -> None:
    source, edit, axes = controls.source, controls.edit, controls.axes
    name, sign = controls.image(source.plane) or (source.plane, 1.0)
    if name != plane:
        edit.write_code(name)
    code = source.motion or ""
    controls.motion_word(code if sign > 0.0 else ARCS[1 - ARCS.index(code)])
    first, second, normal = geometry.PLANES[name]
    start, end = (source.frames.to_program(point) for point in (move.start, move.end))
    only: Sequence[int] = range(6)
    if max(abs(start[axis] - end[axis]) for axis in geometry.PLANES[source.plane][:2]) < SAME:
        edit.remove((AXES[first], AXES[second]))  # a circle ends where it begins, whatever is rounded
        only = (normal, 3, 4, 5)
    controls.go(controls.target(move.end), axes, only=only)
    _write_center(controls, name, arc)


def _write_center(controls: Controls, plane: str, arc: Arc) -> None:
    """Write the centre as I, J, K, replacing R if the block has it."""
    out, edit = controls.out, controls.edit
    first, second, normal = geometry.PLANES[plane]
    here = out.frames.to_program(out.frames.position)
    there = out.frames.to_program(controls.of_setup([*arc.center, 0.0, 0.0, 0.0]))
    edit.remove(("R", geometry.CENTER_WORDS[normal]))
    for axis in (first, second):
        letter = geometry.CENTER_WORDS[axis]
        value = (there[axis] if out.arc_absolute else there[axis] - here[axis]) / controls.scale(axis)
        if edit.word(letter) is not None or out.arc_absolute or abs(value) > OFF * 10.0**-controls.digits:
            edit.write(letter, value, controls.digits)


def _cycle(controls: Controls, plane: str) -> None:
    """Turn and move the hole's position; its bottom and R plane (in G90) move along the drilling axis."""
    source, out, edit = controls.source, controls.out, controls.edit
    first, second, normal = geometry.PLANES[source.plane]
    if source.plane != plane:
        edit.write_code(source.plane)
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
            edit.write(letter, height / controls.scale(normal), controls.digits)


def _piece_count(controls: Controls, move: Move) -> int:
    """Number of pieces into which a move must be cut. Refuse a move that must be cut unless that was asked for."""
    motion, start, end, arc = move.motion, move.start, move.end, move.arc
    plane, leaning = controls.source.plane, 0.0
    off_plane = arc is not None and controls.image(plane) is None
    if motion != RAPID and controls.turn.turns and start[3:] != end[3:]:
        written = controls.out.frames.position[3:], controls.target(end)[3:]
        leaning = lean(controls.turn, (start[3:], end[3:]), written)
    if controls.linearise is None:
        off = f"an arc of {plane}, turned with the work, lies in none of the planes G17, G18, G19"
        controls.refuse_if(off_plane, off, LINEARISE)
        leans = f"as a control interpolates A, B and C, the tool would lean {leaning:.3g} degrees between its ends"
        controls.refuse_if(leaning > LEAN, leans, LINEARISE)
    if controls.linearise is None or (not off_plane and leaning == 0.0):
        return 1
    tolerance = controls.linearise - controls.unit
    rounding = f"--linearise {controls.linearise:g} is no more than the rounding to {controls.digits} decimals"
    controls.refuse_if(tolerance < controls.unit, rounding, "give more of it, or more --decimals")
    count = math.ceil(math.sqrt(leaning / math.degrees(tolerance / LEVER)))
    if arc is not None and (off_plane or count > 1):
        controls.notes.add(
            f"arcs that the turn takes out of the planes are written as chords within {controls.linearise:g} mm"
        )
        frames = controls.source.frames
        count = max(count, chords(arc, frames.to_setup(start), frames.to_setup(end), tolerance), 2)
    return count


def _lead(controls: Controls) -> str:
    """Text that begins the further lines in a block's place; words that belong to the whole move are taken out."""
    stop, edit = controls.current and controls.current.code("M stop"), controls.edit
    several = f"{stop[0] if stop else 'inverse-time feed (G93)'} in a block that is written as several"
    controls.refuse_if(stop or controls.out.feed_mode == "G93", several, "give it a block of its own, or G94")
    edit.remove("IJKRPLQ")
    return "".join(SLASH.findall(edit.render())) if edit.block.optional else ""


def _shifted(controls: Controls, plane: str, course: Course) -> list[str]:
    """Straight moves and arcs in place of a move, the first in the block's line."""
    lead = _lead(controls) if len(course) > 1 else ""
    edit, axes = controls.edit, controls.axes
    lines: list[str] = []
    for start, end, arc in course:
        if lines:
            controls.edit, controls.current, axes = edit.next_line(lead), None, []
        controls.motion_word("G1" if arc is None else ARCS[arc.sweep * arc.normal[2] > 0.0])
        closed = arc is not None and math.dist(start[:2], end[:2]) < SAME
        controls.edit.remove("IJKR" if arc is None else "XY" if closed else "")  # as `_arc` has closed circles
        controls.go(controls.of_setup(end), axes, only=range(2, 6) if closed else range(6))
        if arc is not None:
            _write_center(controls, plane, arc)
        lines.append(controls.emit())
    return lines


def _one_by_one(controls: Controls, pieces: Sequence[Piece]) -> list[str]:
    """Straight moves in a block's place, the first in its own line."""
    lead, edit, lines = _lead(controls), controls.edit, []
    for number, (code, point, dwell) in enumerate(pieces):
        if number:
            controls.edit, controls.current = edit.next_line(lead), None
        controls.motion_word(code)
        controls.go(controls.of_setup(point), [] if number else controls.axes)
        if number == 0 or any(map(controls.edit.word, AXES)):
            lines.append(controls.emit())
        if dwell:
            controls.edit = edit.next_line(lead)
            controls.edit.write_code("G4")
            controls.edit.write("P", dwell, FEED_DECIMALS)
            lines.append(controls.emit())
    return lines
