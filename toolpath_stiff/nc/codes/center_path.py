"""The path of the tool centre under cutter compensation (`compensation`), as it is recorded. mm.

The program keeps its own coordinates: `Frames.position` is the programmed point. What is recorded is the path of the
tool centre; the ends of the last moves are set back in the recorder when the next corner is concave.
"""

import math
from dataclasses import dataclass, replace

from toolpath_stiff.nc import compensation, geometry
from toolpath_stiff.nc.compensation import CenterMove, Cutter, OffsetArc, Pending
from toolpath_stiff.nc.frames import standing
from toolpath_stiff.nc.geometry import Point2
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Arc, Move
from toolpath_stiff.nc.state import CurrentBlock, State

SAME_PLACE = 1e-9  # mm; a step of less in the plane is none


def offset_move(state: State, block: CurrentBlock, move: Move, control: list[float]) -> bool:
    """Record what a programmed move makes of the tool centre's path. Returns whether any move was added.

    `move`: as programmed, from where the tool centre stands; `control`: its programmed end in control coordinates.
    """
    cutter, frames = state.cutter, state.frames
    assert cutter is not None
    if any(frames.from_machine[axis] for axis in cutter.axes[:2]):
        raise block.fail(None, "a move under cutter compensation from machine coordinates", "both words of the plane")
    path = CenterPath(state, block, cutter, move)
    there = frames.to_program(control)
    start, target = path.in_plane(frames.to_program(frames.position)), path.in_plane(there)
    programmed = None if move.arc is None else path.programmed(move.arc)
    rows = len(state.recorder.recent)
    direction, step = (target[0] - start[0], target[1] - start[1]), None
    try:
        if cutter.position is None:
            step, direction = compensation.enter(cutter, start, target, programmed)
            cutter.position, cutter.anchor = frames.to_program(frames.from_setup(move.start)), start
        elif programmed is not None or math.dist(start, target) >= SAME_PLACE:  # else the corner is still to come
            step = compensation.go_on(cutter, start, target, programmed)
            path.go_round_corner(step, start, there)
    except geometry.ArcError as error:
        raise block.fail(None, error.found, error.expected) from None
    if step is not None and step.center is not None and programmed is not None:
        programmed = OffsetArc(step.center, programmed.turn, programmed.turns)
    end = path.moved(there, cutter.center if step is None else step.end)
    recorded = path.add(move.motion, end, move.from_machine, programmed)
    if programmed is not None and not programmed.programmed and recorded is not None:
        programmed.programmed = recorded.arc.sweep if recorded.arc else 0.0
    cutter.pending.append(Pending(end, direction, programmed, recorded))
    return len(state.recorder.recent) > rows


@dataclass(frozen=True)
class CenterPath:
    """The path of the tool centre in a block, as it is recorded.

    Attributes
    ----------
    state, block, cutter
        Of the control; the block that moves; its compensation.
    programmed_move
        Where one is made.
    """

    state: State
    block: CurrentBlock
    cutter: Cutter
    programmed_move: Move | None = None

    def in_plane(self, point: list[float]) -> Point2:
        """A point's two coordinates of the plane."""
        return point[self.cutter.axes[0]], point[self.cutter.axes[1]]

    def moved(self, point: list[float], to: Point2) -> list[float]:
        """A point with other coordinates in the plane."""
        point = list(point)
        point[self.cutter.axes[0]], point[self.cutter.axes[1]] = to
        return point

    def go_round_corner(self, step: CenterMove, start: Point2, there: list[float]) -> None:
        """End the moves before the corner, and go round it if it is convex; rotary axes turn on the way round.

        Straight moves round it are at the feed of the block; rotary axes have turned at the first one's end.
        """
        cutter, move = self.cutter, self.programmed_move
        assert move is not None
        assert cutter.position is not None
        rapid, bound = move.motion == RAPID, (move.from_machine[0], move.from_machine[0])
        if step.trim is not None:
            self.settle(step.trim)
        cutter.pending.clear()
        if step.outside:
            self.state.assume(compensation.STRAIGHT)
        beside = [*cutter.position[:3], *there[3:]]
        for place in step.way:
            self.add(RAPID if rapid else FEED, self.moved(beside, place), bound, None)
        if step.corner is not None:
            round_it = None if rapid else OffsetArc(start, -cutter.side)
            cutter.anchor = cutter.center
            self.add(RAPID if rapid else ARC, self.moved(beside, step.corner), bound, round_it)
        cutter.anchor = cutter.center

    def add(self, motion: int, end: list[float], bound: tuple[bool, bool], arc: OffsetArc | None) -> Move | None:
        """Record a move of the tool centre to a point in program coordinates; None if it goes nowhere."""
        here, programmed_move = self.cutter.position, self.programmed_move
        assert here is not None
        assert programmed_move is not None
        start = self.to_setup(here)
        there = standing(start, self.to_setup(end))
        recorded = None if arc is None else self._recorded(arc, here, end)
        move = replace(programmed_move, motion=motion, start=start, end=there, from_machine=bound, arc=recorded)
        self.cutter.position = end
        return move if self.state.recorder.add(move) else None

    def settle(self, to: Point2) -> None:
        """Move the end of the pending moves; raises `InputError` where the tool would have to go back."""
        cutter = self.cutter
        assert cutter.position is not None
        for pending in cutter.pending:
            if self._gouges(pending, to):
                raise self.block.fail(None, compensation.GOUGE, compensation.SMALLER)
            pending.end[:] = self.moved(pending.end, to)
            self._rewrite(pending)
        cutter.position = self.moved(cutter.position, to)
        for pending in reversed(cutter.pending):
            move = pending.move
            if move is not None and move.arc is None and move.start == move.end:
                self.state.recorder.drop(self._row(move))

    def _row(self, move: Move) -> int:
        recent = self.state.recorder.recent
        return next(row for row in range(len(recent) - 1, -1, -1) if recent[row] is move)

    def _gouges(self, move: Pending, to: Point2) -> bool:
        anchor, arc = self.cutter.anchor, move.arc
        if arc is None:
            return move.direction[0] * (to[0] - anchor[0]) + move.direction[1] * (to[1] - anchor[1]) < 0.0
        sweep = geometry.arc_sweep(anchor, to, arc.center, arc.turn < 0, arc.turns)
        apart = abs(math.dist(self.in_plane(move.end), arc.center) - math.dist(to, arc.center))
        longer = abs(sweep) > abs(arc.programmed) + compensation.SHORTENED
        return apart > compensation.MATCHING * self.cutter.unit or (arc.programmed != 0.0 and longer)

    def _rewrite(self, pending: Pending) -> None:
        """The recorded move of one whose end has changed."""
        move, offset, recent = pending.move, pending.arc, self.state.recorder.recent
        if move is None:
            return
        move.end = standing(move.start, self.to_setup(pending.end))
        row = self._row(move)
        if row + 1 < len(recent):
            recent[row + 1].start = move.end
        if offset is not None and move.arc is not None:
            to = self.in_plane(pending.end)
            sweep = geometry.arc_sweep(self.cutter.anchor, to, offset.center, offset.turn < 0, offset.turns)
            move.arc = replace(move.arc, sweep=sweep)

    def to_setup(self, program: list[float]) -> list[float]:
        """Set-up coordinates of a point in program coordinates."""
        return self.state.frames.to_setup(self.state.frames.to_control(program))

    def programmed(self, arc: Arc) -> OffsetArc:
        """The programmed arc in program coordinates."""
        center = self.state.frames.to_program(self.state.frames.from_setup([*arc.center, 0.0, 0.0, 0.0]))
        turns = 1 + int((abs(arc.sweep) - 1e-9) / math.tau)
        return OffsetArc(self.in_plane(center), 1 if arc.sweep > 0.0 else -1, turns, arc.sweep)

    def _recorded(self, arc: OffsetArc, start: list[float], end: list[float]) -> Arc:
        """An arc of the tool centre as it is recorded."""
        x, y, z = self.to_setup(self.moved(start, arc.center))[:3]
        sweep = geometry.arc_sweep(self.in_plane(start), self.in_plane(end), arc.center, arc.turn < 0, arc.turns)
        return Arc((x, y, z), self.state.frames.turn_direction(geometry.normal_of(self.state.plane)), sweep)
