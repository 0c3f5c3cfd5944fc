"""G40, G41, G42: cutter compensation by the tool's radius, as LinuxCNC has it (`compensation`), or Fanuc and Haas. mm.

The program keeps its own coordinates: `Frames.position` is the programmed point. What is recorded is the path of the
tool centre; the ends of the last moves are set back in the recorder when the next corner is concave.
"""

from __future__ import annotations

import math

from toolpath_stiff.nc import compensation, geometry
from toolpath_stiff.nc.codes.code import Code, g_codes
from toolpath_stiff.nc.compensation import Cutter, OffsetArc, Pending, Step
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

Ends = tuple[list[float], list[float]]


# -- on and off --------------------------------------------------------------------------------------------------------


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
    if cutter is None or cutter.at is None:
        return
    if cutter.entering:
        raise block.fail(code, "right after the first move of cutter compensation", "a contour between")
    _settle(state, block, cutter, cutter.center)
    frames = state.frames
    there, here = frames.to_setup(frames.to_control(cutter.at)), frames.to_setup(frames.position)
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


# -- moves -------------------------------------------------------------------------------------------------------------


def offset_move(
    state: State,
    block: CurrentBlock,
    motion: int,
    ends: Ends,
    feed: float,
    bound: tuple[bool, bool],
    arc: Arc | None,
) -> bool:
    """Record what a programmed move makes of the tool centre's path. Returns whether any move was added.

    `ends`: where the tool centre stands, set-up frame; the programmed end in control coordinates.
    """
    cutter, frames = state.cutter, state.frames
    assert cutter is not None
    first, second, _ = cutter.axes
    if any(frames.from_machine[axis] for axis in cutter.axes[:2]):
        raise block.fail(None, "a move under cutter compensation from machine coordinates", "both words of the plane")
    here, there = frames.to_program(frames.position), frames.to_program(ends[1])
    start, target = (here[first], here[second]), (there[first], there[second])
    own = None if arc is None else _programmed(state, arc)
    direction = (target[0] - start[0], target[1] - start[1])
    rows = len(state.recorder.line)
    try:
        if cutter.at is None:
            step, direction = _enter(cutter, start, target, own)
            cutter.at, cutter.anchor = frames.to_program(_to_control(state, ends[0])), start
        elif own is None and math.dist(start, target) < SAME_PLACE:  # along the tool alone: the corner is still to come
            step = None
        else:
            step = _go_on(cutter, start, target, own)
            _round_corner(state, block, cutter, step, motion, start, there, feed, bound)
    except geometry.ArcError as error:
        raise block.fail(None, error.found, error.expected) from None
    end = list(there)
    end[first], end[second] = cutter.center if step is None else step.end
    if step is not None and step.center is not None and own is not None:
        own = OffsetArc(step.center, own.turn, own.turns)
    row = _add(state, block, motion, cutter, end, feed, bound, own)
    if own is not None and not own.programmed and row >= 0:
        recorded = state.recorder.arc[row]
        own.programmed = 0.0 if recorded is None else recorded.sweep
    cutter.pending.append(Pending(end, direction, own, row))
    return len(state.recorder.line) > rows


def _enter(cutter: Cutter, start: Point2, target: Point2, own: OffsetArc | None) -> tuple[Step, Point2]:
    if cutter.straight:
        return compensation.enter_fanuc(cutter, target, own), (0.0, 0.0)
    if own is not None:
        return compensation.enter_arc(cutter, start, target, own.center, own.turn), (0.0, 0.0)
    return compensation.enter_straight(cutter, start, target)


def _go_on(cutter: Cutter, start: Point2, target: Point2, own: OffsetArc | None) -> Step:
    if cutter.straight:
        return compensation.go_on_fanuc(cutter, start, target, own)
    if own is not None:
        return compensation.go_round(cutter, start, target, own.center, own.turn)
    return compensation.go_straight(cutter, start, target)


def _round_corner(
    state: State,
    block: CurrentBlock,
    cutter: Cutter,
    step: Step,
    motion: int,
    start: Point2,
    there: list[float],
    feed: float,
    bound: tuple[bool, bool],
) -> None:
    """End the moves before the corner, and go round it if it is convex; rotary axes turn on the way round."""
    if step.trim is not None:
        _settle(state, block, cutter, step.trim)
    cutter.pending.clear()
    cutter.anchor = cutter.center
    if step.outside:
        _go_straight_round(state, block, cutter, step, motion, there, feed, bound)
    if step.corner is None:
        return
    assert cutter.at is not None
    around = [*cutter.at[:3], *there[3:]]
    around[cutter.axes[0]], around[cutter.axes[1]] = step.corner
    arc = None if motion == RAPID else OffsetArc(start, -cutter.side)
    _add(state, block, motion if motion == RAPID else ARC, cutter, around, feed, (bound[0], bound[0]), arc)
    cutter.anchor = cutter.center


def _go_straight_round(
    state: State,
    block: CurrentBlock,
    cutter: Cutter,
    step: Step,
    motion: int,
    there: list[float],
    feed: float,
    bound: tuple[bool, bool],
) -> None:
    """Straight moves round a corner, at the feed of the block; rotary axes have turned at the first one's end."""
    assert cutter.at is not None
    state.assume(compensation.STRAIGHT)
    for place in step.way:
        around = [*cutter.at[:3], *there[3:]]
        around[cutter.axes[0]], around[cutter.axes[1]] = place
        _add(state, block, motion if motion == RAPID else FEED, cutter, around, feed, (bound[0], bound[0]), None)
    cutter.anchor = cutter.center


def _add(
    state: State,
    block: CurrentBlock,
    motion: int,
    cutter: Cutter,
    end: list[float],
    feed: float,
    bound: tuple[bool, bool],
    arc: OffsetArc | None,
) -> int:
    """Record a move of the tool centre to a point in program coordinates; its row, -1 if it has none."""
    recorder = state.recorder
    assert cutter.at is not None
    start = _to_setup(state, cutter.at)
    added = recorder.add(
        block.line, motion, start, _standing(start, _to_setup(state, end)), feed, state.tool, state.tool_length, bound,
        None if arc is None else _recorded(state, cutter, arc, cutter.at, end),
    )  # fmt: skip
    cutter.at = end
    return len(recorder.line) - 1 if added else -1


def _settle(state: State, block: CurrentBlock, cutter: Cutter, to: Point2) -> None:
    """Move the end of the pending moves; raises `InputError` where the tool would have to go back."""
    assert cutter.at is not None
    first, second, _ = cutter.axes
    for move in cutter.pending:
        _check_gouge(block, cutter, move, to)
        move.end[first], move.end[second] = to
        _rewrite(state, cutter, move)
    cutter.at = [*cutter.at]
    cutter.at[first], cutter.at[second] = to
    for move in reversed(cutter.pending):
        row, recorder = move.row, state.recorder
        if row >= 0 and recorder.arc[row] is None and recorder.start[row] == recorder.end[row]:
            recorder.drop(row)


def _check_gouge(block: CurrentBlock, cutter: Cutter, move: Pending, to: Point2) -> None:
    if move.arc is None:
        back = move.direction[0] * (to[0] - cutter.anchor[0]) + move.direction[1] * (to[1] - cutter.anchor[1])
        gouges = back < 0.0
    else:
        arc = move.arc
        before = (move.end[cutter.axes[0]], move.end[cutter.axes[1]])
        sweep = geometry.arc_sweep(cutter.anchor, to, arc.center, arc.turn < 0, arc.turns)
        apart = abs(math.dist(before, arc.center) - math.dist(to, arc.center))
        longer = abs(sweep) > abs(arc.programmed) + compensation.SHORTENED
        gouges = apart > compensation.MATCHING * cutter.unit or (arc.programmed != 0.0 and longer)
    if gouges:
        raise block.fail(None, compensation.GOUGE, compensation.SMALLER)


def _rewrite(state: State, cutter: Cutter, move: Pending) -> None:
    """The recorder's row of a move whose end has changed."""
    if move.row < 0:
        return
    recorder, end = state.recorder, _to_setup(state, move.end)
    recorder.end[move.row] = _standing(recorder.start[move.row], end)
    if move.row + 1 < len(recorder.line):
        recorder.start[move.row + 1] = recorder.end[move.row]
    arc = recorder.arc[move.row]
    if move.arc is not None and arc is not None:
        to = (move.end[cutter.axes[0]], move.end[cutter.axes[1]])
        sweep = geometry.arc_sweep(cutter.anchor, to, move.arc.center, move.arc.turn < 0, move.arc.turns)
        recorder.arc[move.row] = Arc(arc.center, arc.normal, sweep)


# -- coordinates -------------------------------------------------------------------------------------------------------

STILL = 1e-12  # as in `motion.record`
SAME_PLACE = 1e-9  # mm; a step of less in the plane is none


def _standing(start: list[float], end: list[float]) -> list[float]:
    """The end, with the numbers of the start where an axis stands but for rounding."""
    return [s if abs(e - s) < STILL * max(1.0, abs(s)) else e for s, e in zip(start, end, strict=True)]


def _to_setup(state: State, program: list[float]) -> list[float]:
    return state.frames.to_setup(state.frames.to_control(program))


def _to_control(state: State, setup: list[float]) -> list[float]:
    reference = state.frames.fix_reference()
    return [*(s + r for s, r in zip(setup[:3], reference, strict=True)), *setup[3:]]


def _programmed(state: State, arc: Arc) -> OffsetArc:
    """The programmed arc in program coordinates."""
    first, second, _ = geometry.PLANES[state.plane]
    center = state.frames.to_program(_to_control(state, [*arc.center, 0.0, 0.0, 0.0]))
    turns = 1 + int((abs(arc.sweep) - 1e-9) / math.tau)
    return OffsetArc((center[first], center[second]), 1 if arc.sweep > 0.0 else -1, turns, arc.sweep)


def _recorded(state: State, cutter: Cutter, arc: OffsetArc, start: list[float], end: list[float]) -> Arc:
    """An arc of the tool centre as it is recorded."""
    first, second, _ = cutter.axes
    middle = list(start)
    middle[first], middle[second] = arc.center
    x, y, z = _to_setup(state, middle)[:3]
    ends = ((start[first], start[second]), (end[first], end[second]))
    sweep = geometry.arc_sweep(*ends, arc.center, arc.turn < 0, arc.turns)
    return Arc((x, y, z), state.frames.turn_direction(geometry.normal_of(state.plane)), sweep)


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
