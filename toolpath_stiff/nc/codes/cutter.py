"""G40, G41, G42: cutter compensation by the tool's radius, and the path of the tool centre as it is recorded. mm.

The path is that of `compensation`, as LinuxCNC or as Fanuc and Haas have it. The program keeps its own coordinates:
`Frames.position` is the programmed point. What is recorded is the path of the tool centre; the ends of the last moves
are set back in the recorder when the next corner is concave.
"""

import math
from dataclasses import replace

from toolpath_stiff.nc.codes.code import Code, family, g_codes
from toolpath_stiff.nc.compensation import (
    GOUGE,
    MATCHING,
    SHORTENED,
    SMALLER,
    STRAIGHT,
    TYPE_A,
    CenterMove,
    Cutter,
    OffsetArc,
    Pending,
    enter,
    go_on,
)
from toolpath_stiff.nc.frames import Frames, standing
from toolpath_stiff.nc.geometry import PLANES, ArcError, Point2, normal_of, refuse_arc_if
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Arc, Move
from toolpath_stiff.nc.state import CurrentBlock, State

LEFT, RIGHT = 1, -1
SIDES = {"G41": LEFT, "G41.1": LEFT, "G42": RIGHT, "G42.1": RIGHT}
# What may stand in a block while compensation is on: all that LinuxCNC allows there and that leaves its path defined.
GROUPS = frozenset(
    (
        "motion", "cutter compensation", "distance", "arc distance", "feed mode", "spindle mode", "lathe diameter",
        "M spindle", "M coolant", "M subprogram",
    )
)  # fmt: skip
SAME_PLACE = 1e-9  # mm; a step of less in the plane is none
MOTIONS = ("G0", "G1", "G2", "G3")
OTHER_CONTROLS = "cutter compensation, whose entry and corners differ from control to control"
NAME_CONTROL = "name the control with --dialect (linuxcnc, fanuc, haas), or post the path of the tool centre"


def switch_on(state: State, block: CurrentBlock, code: str) -> None:
    """G41, G42 D: the tool is left or right of the contour, by the diameter in the tool table; D of G41.1 is it."""
    word, frames = block.codes[code], state.frames
    straight = state.dialect.increments  # Fanuc, Haas
    unknown = state.dialect.name == "generic" or (straight and code.endswith(".1"))
    block.refuse_if(unknown, word, f"is {OTHER_CONTROLS}", hint=NAME_CONTROL)
    _check_codes(state, block, ("plane", "units", "M tool change"))
    turned = frames.rotation is not None or state.polar is not None or frames.tip_held
    block.refuse_if(state.cutter is not None, word, "while cutter compensation is on", "G40 in a block before it")
    block.refuse_if(
        state.plane == "G19" or turned, word, "in G19, or under G68, G16 or G43.4", "G17, G69, G15, G49 first"
    )
    block.refuse_if(
        straight and "D" not in block.values, word, "without D, whose last value the control would take", "D"
    )
    if straight and block.values["D"].value == 0:  # no offset: the programmed path is the tool centre's
        block.take("D")
        return
    diameter = _diameter(state, block, code)
    side = SIDES[code] if diameter >= 0.0 else -SIDES[code]
    state.cutter = Cutter(side, abs(diameter) / 2.0, PLANES[state.plane], state.length_scale, straight=straight)
    if straight:
        state.assume(TYPE_A)


def _diameter(state: State, block: CurrentBlock, code: str) -> float:
    """Diameter that G41, G42 name: D is a tool's number, in G41.1 and G42.1 the diameter."""
    word = block.codes[code]
    if code.endswith(".1"):
        diameter = block.take("D")
        if diameter is None:
            raise block.fail(word, "without the diameter", "D")
        return diameter * state.length_scale
    number = block.whole("D", word, 0)
    block.refuse_if(not number and state.renamed, word, "of the tool in the spindle after M61", f"D{state.tool}")
    tool = number or state.tool  # D0: of the tool in the spindle
    entry = (state.tools or {}).get(tool)
    if entry is None or math.isnan(entry.diameter):
        hint = "give it in a tool table (--tools FILE), or G41.1 D"
        raise block.fail(word, f"needs the diameter of tool {tool}", hint=hint)
    return entry.diameter


def switch_off(state: State, block: CurrentBlock, code: str) -> None:
    """G40: the next move goes from where the tool centre stands to its own end."""
    cutter, state.cutter, frames = state.cutter, None, state.frames
    if cutter is None or cutter.position is None:
        return
    block.refuse_if(cutter.entering, code, "right after the first move of cutter compensation", "a contour between")
    try:
        _settle(state, cutter, cutter.center)
    except ArcError as error:
        raise block.fail(None, error.found, error.expected) from None
    there, here = _to_setup(frames, cutter.position), frames.to_setup(frames.position)
    state.beside = [t - h for t, h in zip(there, here, strict=True)]


def check_block(state: State, block: CurrentBlock) -> None:
    """Refuse what changes coordinates or the tool while compensation is on."""
    if state.cutter is not None:
        _check_codes(state, block, ())


def _check_codes(state: State, block: CurrentBlock, also: tuple[str, ...]) -> None:
    # A stop ends the move before it, without a corner.
    harmless = (state.plane, "G20" if state.inch else "G21", "G4", "M2", "M30", *MOTIONS)
    for group, name in block.groups.items():
        wrong = name not in harmless and (group == "motion" or group not in GROUPS | {*also})
        block.refuse_if(wrong, name, "while cutter compensation is on (G41, G42)", "G40 in a block before it")
    polar = next((letter for letter in "@^" if block.has(letter)), None)
    block.refuse_if(polar is not None, polar, "while cutter compensation is on", "X and Y")


def offset_move(state: State, cutter: Cutter, move: Move, control: list[float]) -> bool:
    """Record what a programmed move makes of the tool centre's path. Returns whether any move was added.

    `move`: as programmed, from where the tool centre stands; `control`: its programmed end in control coordinates.
    Raises `ArcError`.
    """
    frames, rows, step = state.frames, len(state.recorder.recent), None
    refuse_arc_if(
        any(frames.from_machine[axis] for axis in cutter.axes[:2]),
        "a move under cutter compensation from machine coordinates",
        "both words of the plane",
    )
    there = frames.to_program(control)
    start, target = cutter.in_plane(frames.to_program(frames.position)), cutter.in_plane(there)
    direction = (target[0] - start[0], target[1] - start[1])
    programmed = None if move.arc is None else _programmed(frames, cutter, move.arc)
    if cutter.position is None:
        step, direction = enter(cutter, start, target, programmed)
        cutter.position, cutter.anchor = frames.to_program(frames.from_setup(move.start)), start
    elif programmed is not None or math.dist(start, target) >= SAME_PLACE:  # else the corner is still to come
        step = go_on(cutter, start, target, programmed)
        _go_round_corner(state, cutter, move, step, start, there)
    if step is not None and step.center is not None and programmed is not None:
        programmed = OffsetArc(step.center, programmed.turn, programmed.turns)
    end = cutter.moved(there, cutter.center if step is None else step.end)
    recorded = _add(state, cutter, replace(move), end, programmed)
    if programmed is not None and not programmed.programmed and recorded is not None:
        programmed.programmed = recorded.arc.sweep if recorded.arc else 0.0
    cutter.pending.append(Pending(end, direction, programmed, recorded))
    return len(state.recorder.recent) > rows


def _go_round_corner(
    state: State, cutter: Cutter, move: Move, step: CenterMove, start: Point2, there: list[float]
) -> None:
    """End the moves before the corner, and go round it if it is convex; rotary axes turn on the way round.

    Straight moves round it are at the feed of the block; rotary axes have turned at the first one's end.
    """
    assert cutter.position is not None
    rapid, bound = move.motion == RAPID, (move.from_machine[0], move.from_machine[0])
    if step.trim is not None:
        _settle(state, cutter, step.trim)
    cutter.pending.clear()
    if step.outside:
        state.assume(STRAIGHT)
    beside = [*cutter.position[:3], *there[3:]]
    straight = replace(move, motion=RAPID if rapid else FEED, from_machine=bound)
    for place in step.way:
        _add(state, cutter, replace(straight), cutter.moved(beside, place), None)
    if step.corner is not None:
        cutter.anchor = cutter.center
        round_it, motion = (None, RAPID) if rapid else (OffsetArc(start, -cutter.side), ARC)
        _add(state, cutter, replace(straight, motion=motion), cutter.moved(beside, step.corner), round_it)
    cutter.anchor = cutter.center


def _add(state: State, cutter: Cutter, move: Move, end: list[float], arc: OffsetArc | None) -> Move | None:
    """Record a move of the tool centre to a point in program coordinates; None if it goes nowhere."""
    assert cutter.position is not None
    frames, here = state.frames, cutter.position
    move.start = _to_setup(frames, here)
    move.end, move.arc, cutter.position = standing(move.start, _to_setup(frames, end)), None, end
    if arc is not None:
        x, y, z = _to_setup(frames, cutter.moved(here, arc.center))[:3]
        sweep = arc.sweep_to(cutter.in_plane(here), cutter.in_plane(end))
        move.arc = Arc((x, y, z), frames.turn_direction(normal_of(state.plane)), sweep)
    return move if state.recorder.add(move) else None


def _settle(state: State, cutter: Cutter, to: Point2) -> None:
    """Move the end of the pending moves; raises `ArcError` where the tool would have to go back."""
    assert cutter.position is not None
    for pending in cutter.pending:
        refuse_arc_if(_gouges(cutter, pending, to), GOUGE, SMALLER)
        pending.end[:] = cutter.moved(pending.end, to)
        _rewrite(state, cutter, pending)
    cutter.position = cutter.moved(cutter.position, to)
    for pending in reversed(cutter.pending):
        move = pending.move
        if move is not None and move.arc is None and move.start == move.end:
            state.recorder.drop(_row(state, move))


def _row(state: State, move: Move) -> int:
    """Place of a move among the recent ones, of which it is one of the last."""
    recent = state.recorder.recent
    return next(row for row in range(len(recent) - 1, -1, -1) if recent[row] is move)


def _gouges(cutter: Cutter, move: Pending, to: Point2) -> bool:
    """Whether a move that ends at `to` would go back, or round the wrong way."""
    anchor, arc = cutter.anchor, move.arc
    if arc is None:
        return move.direction[0] * (to[0] - anchor[0]) + move.direction[1] * (to[1] - anchor[1]) < 0.0
    apart = abs(math.dist(cutter.in_plane(move.end), arc.center) - math.dist(to, arc.center))
    longer = abs(arc.sweep_to(anchor, to)) > abs(arc.programmed) + SHORTENED
    return apart > MATCHING * cutter.unit or (arc.programmed != 0.0 and longer)


def _rewrite(state: State, cutter: Cutter, pending: Pending) -> None:
    """The recorded move of one whose end has changed."""
    move, arc, recent = pending.move, pending.arc, state.recorder.recent
    if move is None:
        return
    move.end = standing(move.start, _to_setup(state.frames, pending.end))
    row = _row(state, move)
    if row + 1 < len(recent):
        recent[row + 1].start = move.end
    if arc is not None and move.arc is not None:
        move.arc = replace(move.arc, sweep=arc.sweep_to(cutter.anchor, cutter.in_plane(pending.end)))


def _to_setup(frames: Frames, program: list[float]) -> list[float]:
    """Set-up coordinates of a point in program coordinates."""
    return frames.to_setup(frames.to_control(program))


def _programmed(frames: Frames, cutter: Cutter, arc: Arc) -> OffsetArc:
    """The programmed arc in program coordinates."""
    center = frames.to_program(frames.from_setup([*arc.center, 0.0, 0.0, 0.0]))
    turns = 1 + int((abs(arc.sweep) - 1e-9) / math.tau)
    return OffsetArc(cutter.in_plane(center), 1 if arc.sweep > 0.0 else -1, turns, arc.sweep)


_ON = {"G41": "cutter compensation, tool on the left", "G42": "cutter compensation, tool on the right"}
_DYNAMIC = {
    "G41.1": "the same by the diameter in D, on the left", "G42.1": "the same by the diameter in D, on the right",
}  # fmt: skip
_CUTTER = f"{g_codes('G41 G42')}; Fanuc, operator's manuals, Details of cutter compensation"
CUTTER_CODES = (
    Code("G40", "cutter compensation", switch_off, "cutter compensation off", g_codes("G40")),
    *family(_ON, "cutter compensation", switch_on, _CUTTER, ("linuxcnc", "fanuc", "haas")),
    *family(_DYNAMIC, "cutter compensation", switch_on, g_codes("G41.1 G42.1"), ("linuxcnc",)),
)
