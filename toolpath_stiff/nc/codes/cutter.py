"""G40, G41, G42: cutter compensation by the tool's radius, as LinuxCNC has it (`compensation`), or Fanuc and Haas. mm.

The program keeps its own coordinates: `Frames.position` is the programmed point. What is recorded is the path of the
tool centre; the ends of the last moves are set back in the recorder when the next corner is concave.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from toolpath_stiff.nc import compensation, geometry
from toolpath_stiff.nc.codes.code import Code, g_codes
from toolpath_stiff.nc.compensation import CenterMove, Cutter, OffsetArc, Pending
from toolpath_stiff.nc.geometry import Point2
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Arc
from toolpath_stiff.nc.state import CurrentBlock, State

LEFT, RIGHT = 1, -1
SIDES = {"G41": LEFT, "G41.1": LEFT, "G42": RIGHT, "G42.1": RIGHT}
# What may stand in a block while compensation is on: all that LinuxCNC allows there and that leaves its path defined.
GROUPS = frozenset(
    {
        "motion",
        "cutter compensation",
        "distance",
        "arc distance",
        "feed mode",
        "spindle mode",
        "lathe diameter",
        "M spindle",
        "M coolant",
        "M subprogram",
    }
)
MOTIONS = ("G0", "G1", "G2", "G3")
OTHER_CONTROLS = "cutter compensation, whose entry and corners differ from control to control"
NAME_CONTROL = "name the control with --dialect (linuxcnc, fanuc, haas), or post the path of the tool centre"


def switch_on(state: State, block: CurrentBlock, code: str) -> None:
    """G41, G42 D: the tool is left or right of the contour, by the diameter in the tool table; D of G41.1 is it."""
    word = block.codes[code]
    straight = state.dialect.increments  # Fanuc, Haas
    if state.dialect.name == "generic" or (straight and code.endswith(".1")):
        raise block.fail(word, f"is {OTHER_CONTROLS}", hint=NAME_CONTROL)
    if state.cutter is not None:
        raise block.fail(word, "while cutter compensation is on", "G40 before it")
    _check_codes(state, block, ("plane", "units", "M tool change"))
    frames = state.frames
    if state.plane == "G19":
        raise block.fail(word, "in the plane G19", "G17 or G18")
    if frames.rotation is not None or state.polar is not None or frames.tip_held:
        raise block.fail(word, "under G68, G16 or G43.4, which is not supported", "G69, G15 or G49 before it")
    if straight and "D" not in block.values:
        raise block.fail(word, "without D, whose last value the control would take", "D with the tool's number")
    if straight and block.values["D"].value == 0:  # no offset: the programmed path is the tool centre's
        block.take("D")
        return
    diameter = _diameter(state, block, code)
    side = SIDES[code] if diameter >= 0.0 else -SIDES[code]
    state.cutter = Cutter(
        side, abs(diameter) / 2.0, geometry.PLANES[state.plane], state.length_scale, straight=straight
    )
    if straight:
        state.assume(compensation.TYPE_A)


def _diameter(state: State, block: CurrentBlock, code: str) -> float:
    """Diameter that G41, G42 name: D is a tool's number, in G41.1 and G42.1 the diameter."""
    word, number = block.codes[code], block.take("D")
    if code.endswith(".1"):
        if number is None:
            raise block.fail(word, "without the diameter", "D")
        return number * state.length_scale
    if number is not None and (number < 0 or number != int(number)):
        raise block.fail("D", "is not the number of a tool", "a whole number")
    if not number and state.renamed:
        raise block.fail(word, "of the tool in the spindle after M61", f"D{state.tool}")
    tool = int(number) if number else state.tool  # D0: of the tool in the spindle
    entry = (state.tools or {}).get(tool)
    if entry is None or math.isnan(entry.diameter):
        raise block.fail(
            word, f"needs the diameter of tool {tool}", hint="give it in a tool table (--tools FILE), or G41.1 D"
        )
    return entry.diameter


def switch_off(state: State, block: CurrentBlock, code: str) -> None:
    """G40: the next move goes from where the tool centre stands to its own end."""
    cutter, state.cutter = state.cutter, None
    if cutter is None or cutter.position is None:
        return
    if cutter.entering:
        raise block.fail(code, "right after the first move of cutter compensation", "a contour between")
    CenterPath(state, block, cutter).settle(cutter.center)
    frames = state.frames
    there, here = frames.to_setup(frames.to_control(cutter.position)), frames.to_setup(frames.position)
    state.beside = [t - h for t, h in zip(there, here, strict=True)]


def check_block(state: State, block: CurrentBlock) -> None:
    """Refuse what changes coordinates or the tool while compensation is on."""
    if state.cutter is not None:
        _check_codes(state, block, ())


def _check_codes(state: State, block: CurrentBlock, also: tuple[str, ...]) -> None:
    for group, name in block.groups.items():
        harmless = (
            (group == "plane" and name == state.plane)
            or (group == "units" and name == ("G20" if state.inch else "G21"))
            or (group == "non-modal" and name == "G4")
            or (group == "M stop" and name in ("M2", "M30"))  # a stop ends the move before it, without a corner
        )
        moves = group == "motion" and name not in MOTIONS
        if moves or (group not in GROUPS and group not in also and not harmless):
            raise block.fail(name, "while cutter compensation is on (G41, G42)", "G40 in a block before it")
    polar = next((letter for letter in "@^" if block.has(letter)), None)
    if polar is not None:
        raise block.fail(polar, "while cutter compensation is on", "X and Y")


def offset_move(
    state: State,
    block: CurrentBlock,
    motion: int,
    ends: tuple[list[float], list[float]],
    feed: float,
    bound: tuple[bool, bool],
    arc: Arc | None,
) -> bool:
    """Record what a programmed move makes of the tool centre's path. Returns whether any move was added.

    `ends`: where the tool centre stands, set-up frame; the programmed end in control coordinates.
    """
    cutter, frames = state.cutter, state.frames
    assert cutter is not None
    if any(frames.from_machine[axis] for axis in cutter.axes[:2]):
        raise block.fail(None, "a move under cutter compensation from machine coordinates", "both words of the plane")
    path = CenterPath(state, block, cutter, motion, feed, bound)
    there = frames.to_program(ends[1])
    start, target = path.in_plane(frames.to_program(frames.position)), path.in_plane(there)
    programmed = None if arc is None else path.programmed(arc)
    rows = len(state.recorder.line)
    direction, step = (target[0] - start[0], target[1] - start[1]), None
    try:
        if cutter.position is None:
            step, direction = compensation.enter(cutter, start, target, programmed)
            cutter.position, cutter.anchor = frames.to_program(path.to_control(ends[0])), start
        elif programmed is not None or math.dist(start, target) >= SAME_PLACE:  # else the corner is still to come
            step = compensation.go_on(cutter, start, target, programmed)
            path.go_round_corner(step, start, there)
    except geometry.ArcError as error:
        raise block.fail(None, error.found, error.expected) from None
    if step is not None and step.center is not None and programmed is not None:
        programmed = OffsetArc(step.center, programmed.turn, programmed.turns)
    end = path.moved(there, cutter.center if step is None else step.end)
    row = path.add(motion, end, bound, programmed)
    if programmed is not None and not programmed.programmed and row >= 0:
        recorded = state.recorder.arc[row]
        programmed.programmed = 0.0 if recorded is None else recorded.sweep
    cutter.pending.append(Pending(end, direction, programmed, row))
    return len(state.recorder.line) > rows


@dataclass(frozen=True)
class CenterPath:
    """The path of the tool centre in a block, as it is recorded.

    Attributes
    ----------
    state, block, cutter
        Of the control; the block that moves; its compensation.
    motion, feed, bound
        Of the programmed move.
    """

    state: State
    block: CurrentBlock
    cutter: Cutter
    motion: int = RAPID
    feed: float = math.nan
    bound: tuple[bool, bool] = (False, False)

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
        cutter, rapid = self.cutter, self.motion == RAPID
        if step.trim is not None:
            self.settle(step.trim)
        cutter.pending.clear()
        if step.outside:
            self.state.assume(compensation.STRAIGHT)
        bound = (self.bound[0], self.bound[0])
        for place in step.way:
            self.add(RAPID if rapid else FEED, self._around(place, there), bound, None)
        if step.corner is not None:
            round_it = None if rapid else OffsetArc(start, -cutter.side)
            cutter.anchor = cutter.center
            self.add(RAPID if rapid else ARC, self._around(step.corner, there), bound, round_it)
        cutter.anchor = cutter.center

    def _around(self, place: Point2, there: list[float]) -> list[float]:
        assert self.cutter.position is not None
        return self.moved([*self.cutter.position[:3], *there[3:]], place)

    def add(self, motion: int, end: list[float], bound: tuple[bool, bool], arc: OffsetArc | None) -> int:
        """Record a move of the tool centre to a point in program coordinates; its row, -1 if it has none."""
        state, recorder, here = self.state, self.state.recorder, self.cutter.position
        assert here is not None
        start = self.to_setup(here)
        added = recorder.add(
            self.block.line, motion, start, _standing(start, self.to_setup(end)), self.feed, state.tool,
            state.tool_length, bound, None if arc is None else self._recorded(arc, here, end),
        )  # fmt: skip
        self.cutter.position = end
        return len(recorder.line) - 1 if added else -1

    def settle(self, to: Point2) -> None:
        """Move the end of the pending moves; raises `InputError` where the tool would have to go back."""
        cutter, recorder = self.cutter, self.state.recorder
        assert cutter.position is not None
        for move in cutter.pending:
            if self._gouges(move, to):
                raise self.block.fail(None, compensation.GOUGE, compensation.SMALLER)
            move.end[:] = self.moved(move.end, to)
            self._rewrite(move)
        cutter.position = self.moved(cutter.position, to)
        for move in reversed(cutter.pending):
            row = move.row
            if row >= 0 and recorder.arc[row] is None and recorder.start[row] == recorder.end[row]:
                recorder.drop(row)

    def _gouges(self, move: Pending, to: Point2) -> bool:
        anchor, arc = self.cutter.anchor, move.arc
        if arc is None:
            return move.direction[0] * (to[0] - anchor[0]) + move.direction[1] * (to[1] - anchor[1]) < 0.0
        sweep = geometry.arc_sweep(anchor, to, arc.center, arc.turn < 0, arc.turns)
        apart = abs(math.dist(self.in_plane(move.end), arc.center) - math.dist(to, arc.center))
        longer = abs(sweep) > abs(arc.programmed) + compensation.SHORTENED
        return apart > compensation.MATCHING * self.cutter.unit or (arc.programmed != 0.0 and longer)

    def _rewrite(self, move: Pending) -> None:
        """The recorder's row of a move whose end has changed."""
        row, recorder = move.row, self.state.recorder
        if row < 0:
            return
        recorder.end[row] = _standing(recorder.start[row], self.to_setup(move.end))
        if row + 1 < len(recorder.line):
            recorder.start[row + 1] = recorder.end[row]
        arc, offset = recorder.arc[row], move.arc
        if offset is not None and arc is not None:
            to = self.in_plane(move.end)
            sweep = geometry.arc_sweep(self.cutter.anchor, to, offset.center, offset.turn < 0, offset.turns)
            recorder.arc[row] = Arc(arc.center, arc.normal, sweep)

    def to_setup(self, program: list[float]) -> list[float]:
        """Set-up coordinates of a point in program coordinates."""
        return self.state.frames.to_setup(self.state.frames.to_control(program))

    def to_control(self, setup: list[float]) -> list[float]:
        """Control coordinates of a point in set-up coordinates."""
        reference = self.state.frames.fix_reference()
        return [*(s + r for s, r in zip(setup[:3], reference, strict=True)), *setup[3:]]

    def programmed(self, arc: Arc) -> OffsetArc:
        """The programmed arc in program coordinates."""
        center = self.state.frames.to_program(self.to_control([*arc.center, 0.0, 0.0, 0.0]))
        turns = 1 + int((abs(arc.sweep) - 1e-9) / math.tau)
        return OffsetArc(self.in_plane(center), 1 if arc.sweep > 0.0 else -1, turns, arc.sweep)

    def _recorded(self, arc: OffsetArc, start: list[float], end: list[float]) -> Arc:
        """An arc of the tool centre as it is recorded."""
        x, y, z = self.to_setup(self.moved(start, arc.center))[:3]
        sweep = geometry.arc_sweep(self.in_plane(start), self.in_plane(end), arc.center, arc.turn < 0, arc.turns)
        return Arc((x, y, z), self.state.frames.turn_direction(geometry.normal_of(self.state.plane)), sweep)


STILL = 1e-12  # as in `motion.record`
SAME_PLACE = 1e-9  # mm; a step of less in the plane is none


def _standing(start: list[float], end: list[float]) -> list[float]:
    """The end, with the numbers of the start where an axis stands but for rounding."""
    return [s if abs(e - s) < STILL * max(1.0, abs(s)) else e for s, e in zip(start, end, strict=True)]


_CUTTER, _DYNAMIC = (
    f"{g_codes('G41 G42')}; Fanuc, operator's manuals, Details of cutter compensation",
    g_codes("G41.1 G42.1"),
)
_NAMED = ("linuxcnc", "fanuc", "haas")
CUTTER_CODES = (
    Code("G40", "cutter compensation", switch_off, "cutter compensation off", g_codes("G40")),
    Code("G41", "cutter compensation", switch_on, "cutter compensation, tool on the left", _CUTTER, _NAMED),
    Code("G42", "cutter compensation", switch_on, "cutter compensation, tool on the right", _CUTTER, _NAMED),
    Code(
        "G41.1", "cutter compensation", switch_on, "the same by the diameter in D, on the left", _DYNAMIC, ("linuxcnc",)
    ),
    Code(
        "G42.1",
        "cutter compensation",
        switch_on,
        "the same by the diameter in D, on the right",
        _DYNAMIC,
        ("linuxcnc",),
    ),
)
