"""Recorded path of the tool centre under cutter compensation (`compensation`). mm.

The program keeps its own coordinates: `Frames.position` is the programmed point. What is recorded is the path of the
tool centre; the ends of the last moves are set back in the recorder when the next corner is concave.
"""

import math
from dataclasses import replace

from toolpath_stiff.nc import compensation, geometry
from toolpath_stiff.nc.compensation import CenterMove, OffsetArc, Pending, RadiusCompensation
from toolpath_stiff.nc.frames import Frames, standing
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Arc, Move
from toolpath_stiff.nc.state import State

SAME_PLACE = 1e-9  # mm; a step of less in the plane is none


def offset_move(state: State, cutter: RadiusCompensation, move: Move, control: list[float]) -> bool:
    """Record the tool centre's path for a programmed move. Returns True if any move was added.

    `move`: as programmed, from where the tool centre stands; `control`: its programmed end in control coordinates.
    Raises `GeometryError`.
    """
    frames, rows, step = state.frames, len(state.recorder.recent), None
    of_machine, problem = [frames.from_machine[axis] for axis in cutter.axes[:2]], "from machine coordinates"
    geometry.refuse_if(any(of_machine), f"a move under cutter compensation {problem}", "both words of the plane")
    there = frames.to_program(control)
    start, target = cutter.in_plane(frames.to_program(frames.position)), cutter.in_plane(there)
    direction = target - start
    programmed = None if move.arc is None else _programmed(frames, cutter, move.arc)
    if cutter.position is None:
        step, direction = compensation.enter(cutter, start, target, programmed)
        cutter.position, cutter.anchor = frames.to_program(frames.from_setup(move.start)), start
    elif programmed is not None or abs(target - start) >= SAME_PLACE:  # else the corner is still to come
        step = compensation.go_on(cutter, start, target, programmed)
        _go_round_corner(state, cutter, move, step, start, there)
    if step is not None and step.center is not None and programmed is not None:
        programmed = OffsetArc(step.center, programmed.turn, programmed.turns)
    end = cutter.moved(there, cutter.center if step is None else step.end)
    recorded = _add(state, cutter, replace(move), end, programmed)
    place = state.plain.feed_place
    if place and programmed is not None and recorded is not None:
        share = abs(cutter.center - programmed.center) / abs(target - programmed.center)
        recorded.feed *= share if place == "CFC" or (place == "CFIN" and share < 1.0) else 1.0
    if programmed is not None and not programmed.programmed and recorded is not None:
        programmed.programmed = recorded.arc.sweep if recorded.arc else 0.0
    cutter.pending.append(Pending(end, direction, programmed, recorded))
    return len(state.recorder.recent) > rows


def _go_round_corner(
    state: State, cutter: RadiusCompensation, move: Move, step: CenterMove, start: complex, there: list[float]
) -> None:
    """End the moves before the corner, and go round it if convex; rotary axes turn on the way round.

    Straight moves round it are at the feed of the block; rotary axes have turned at the first one's end.
    """
    assert cutter.position is not None
    rapid, bound = move.motion == RAPID, (move.from_machine[0], move.from_machine[0])
    if step.trim is not None:
        settle(state, cutter, step.trim)
    cutter.pending.clear()
    if step.outside:
        state.assume(compensation.STRAIGHT)
    beside = [*cutter.position[:3], *there[3:]]
    straight = replace(move, motion=RAPID if rapid else FEED, from_machine=bound)
    for place in step.way:
        _add(state, cutter, replace(straight), cutter.moved(beside, place), None)
    if step.corner is not None:
        cutter.anchor = cutter.center
        round_it, motion = (None, RAPID) if rapid else (OffsetArc(start, -cutter.side), ARC)
        _add(state, cutter, replace(straight, motion=motion), cutter.moved(beside, step.corner), round_it)
    cutter.anchor = cutter.center


def _add(state: State, cutter: RadiusCompensation, move: Move, end: list[float], arc: OffsetArc | None) -> Move | None:
    """Record a move of the tool centre to a point in program coordinates; None if it has no length."""
    assert cutter.position is not None
    frames, here = state.frames, cutter.position
    move.start = to_setup_of_program(frames, here)
    move.end, move.arc, cutter.position = standing(move.start, to_setup_of_program(frames, end)), None, end
    if arc is not None:
        move.arc = arc_about(state, here, arc.center, arc.sweep_to(cutter.in_plane(here), cutter.in_plane(end)))
    return move if state.recorder.add(move) else None


def settle(state: State, cutter: RadiusCompensation, to: complex) -> None:
    """Move the end of the pending moves; raises `GeometryError` if the tool would have to go back."""
    assert cutter.position is not None
    for pending in cutter.pending:
        geometry.refuse_if(_gouges(cutter, pending, to), compensation.GOUGE, compensation.SMALLER)
        pending.end[:] = cutter.moved(pending.end, to)
        _rewrite(state, cutter, pending)
    cutter.position = cutter.moved(cutter.position, to)
    for pending in reversed(cutter.pending):
        move = pending.move
        if move is not None and move.arc is None and move.start == move.end:
            state.recorder.drop(_row(state, move))


def _row(state: State, move: Move) -> int:
    """Index of a move among the recent ones, near their end."""
    recent = state.recorder.recent
    return next(row for row in range(len(recent) - 1, -1, -1) if recent[row] is move)


def _gouges(cutter: RadiusCompensation, move: Pending, to: complex) -> bool:
    """True if a move that ends at `to` would go back, or the wrong way round."""
    anchor, arc = cutter.anchor, move.arc
    if arc is None:
        return (move.direction.conjugate() * (to - anchor)).real < 0.0
    apart = abs(abs(cutter.in_plane(move.end) - arc.center) - abs(to - arc.center))
    longer = abs(arc.sweep_to(anchor, to)) > abs(arc.programmed) + compensation.SHORTENED
    return apart > compensation.MATCHING * cutter.unit or (arc.programmed != 0.0 and longer)


def arc_about(state: State, here: list[float], center: complex, sweep: float) -> Arc:
    """Arc about a point of the plane in force, from a point in program coordinates."""
    frames, middle, (first, second, _) = state.frames, list(here), geometry.PLANES[state.plane]
    middle[first], middle[second] = center.real, center.imag
    x, y, z = to_setup_of_program(frames, middle)[:3]
    return Arc((x, y, z), frames.turn_direction(geometry.normal_of(state.plane)), sweep)


def _rewrite(state: State, cutter: RadiusCompensation, pending: Pending) -> None:
    """Update the recorded move of a pending one whose end has changed."""
    move, arc, recent = pending.move, pending.arc, state.recorder.recent
    if move is None:
        return
    move.end = standing(move.start, to_setup_of_program(state.frames, pending.end))
    row = _row(state, move)
    if row + 1 < len(recent):
        recent[row + 1].start = move.end
    if arc is not None and move.arc is not None:
        move.arc = replace(move.arc, sweep=arc.sweep_to(cutter.anchor, cutter.in_plane(pending.end)))


def to_setup_of_program(frames: Frames, program: list[float]) -> list[float]:
    """Set-up coordinates of a point in program coordinates."""
    return frames.to_setup(frames.to_control(program))


def _programmed(frames: Frames, cutter: RadiusCompensation, arc: Arc) -> OffsetArc:
    """The programmed arc in program coordinates."""
    center = frames.to_program(frames.from_setup([*arc.center, 0.0, 0.0, 0.0]))
    turns = 1 + int((abs(arc.sweep) - 1e-9) / math.tau)
    return OffsetArc(cutter.in_plane(center), 1 if arc.sweep > 0.0 else -1, turns, arc.sweep)
