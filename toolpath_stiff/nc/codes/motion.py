"""G0 to G3, G53, G28, G30, G80: moves along lines and arcs, from the words of a block. mm, degrees.

A move is recorded with its ends in the set-up frame, its feed and its tool; beside it stands whether the present height
is known.
"""

import math
from collections.abc import Collection, Iterable
from dataclasses import replace

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.center_path import arc_about, offset_move
from toolpath_stiff.nc.codes.code import FANUC, Code, g_codes
from toolpath_stiff.nc.codes.corner import cut_corner
from toolpath_stiff.nc.codes.feeds import feed_of_move
from toolpath_stiff.nc.codes.points import (
    XY,
    axis_words,
    cartesian,
    control_point,
    destination,
    forget_polar,
    know_place,
    point_words,
    refuse_while_rotated,
    target,
)
from toolpath_stiff.nc.frames import STILL, shifted, shifted_back, standing
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Arc, Move
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, Word

ARCS = ("G2", "G3")
MOST_TURNS = 10_000
Stroke = tuple[float, int, float | None, float]  # height, motion, feed (None: that in force), dwell
INCREMENTAL_AXES = "UVW"  # X, Y, Z in steps, on lathes and as G28 U0 W0 on mills


def record(
    state: State,
    block: CurrentBlock,
    motion: int,
    control: list[float],
    work: Collection[int] = (),
    machine: Collection[int] = (),
    arc: Arc | None = None,
) -> None:
    """Record a move to a point in control coordinates; `work`, `machine`: axes given in work or machine coordinates."""
    frames = state.frames
    state.length_changed = state.rotation_changed = False
    if state.height_lost:
        find_height(state, block, motion, (2 in work and state.absolute) or 2 in machine)
    start, was = frames.to_setup(frames.position), frames.bound
    for axis in work:
        frames.from_machine[axis] = False
    for axis in machine:
        frames.from_machine[axis] = True
    # An axis that was not told to move keeps its number to the last digit, whatever rounding the frames add.
    end = standing(start, frames.to_setup(control))
    feed = math.nan if motion == RAPID else feed_of_move(state, block, start, end, arc)
    if state.beside is not None:  # the tool centre is still where compensation left it
        start, state.beside = [s + b for s, b in zip(start, state.beside, strict=True)], None
    flags = (was, frames.bound)
    move = Move(block.line, motion, start, end, feed, state.tool, state.tool_length, state.spindle, flags, arc)
    if state.cutter is not None and state.cutter.radius:
        added = offset_move(state, state.cutter, move, control)
    else:
        added = state.recorder.add(move)
    if state.trace is not None:
        state.trace.append(replace(move, start=list(frames.position), end=list(control), arc=arc))
    frames.position = control
    if added:
        state.note_tool()


def record_strokes(state: State, block: CurrentBlock, axis: int, path: Iterable[Stroke], same: float = 0.0) -> None:
    """Record moves along one axis to heights in program coordinates; one that differs by up to `same` is no move."""
    frames = state.frames
    control = frames.to_control(frames.to_program(frames.position))
    told = frames.reference is None or frames.rotated or frames.bound or control != frames.position
    if not (told or state.height_lost or state.beside or state.cutter or state.trace is not None):
        _record_steps(state, block, axis, path, same)
        return
    for height, motion, feed, wait in path:
        place = frames.to_program(frames.position)
        if abs(place[axis] - height) > same:
            _set_feed(state, block, feed)
            place[axis] = height
            record(state, block, motion, frames.to_control(place), (axis,))
        if wait:
            state.recorder.add_dwell(wait)


def _record_steps(state: State, block: CurrentBlock, axis: int, path: Iterable[Stroke], same: float) -> None:
    """`record_strokes` where nothing but the number of the axis changes, in a third of the time."""
    frames, recorder, moved, added = state.frames, state.recorder, False, False
    shift, offset = frames.g92[axis], frames.offsets.at(frames.active).axes[axis]
    level, zero = frames.position[axis], frames.fix_reference()[axis]
    tool, still = (state.tool, state.tool_length, state.spindle), (False, False)
    for height, motion, feed, wait in path:
        if abs(shifted_back(level, shift, offset) - height) > same:
            _set_feed(state, block, feed)
            start = frames.to_setup(frames.position)
            frames.position, level = [*frames.position], shifted(height, shift, offset)
            frames.position[axis] = level
            end = [*start]
            if abs(level - zero - start[axis]) >= STILL * max(1.0, abs(start[axis])):
                end[axis] = level - zero
            rate = math.nan if motion == RAPID else feed_of_move(state, block, start, end, None)
            moved, added = True, recorder.add(Move(block.line, motion, start, end, rate, *tool, still)) or added
        if wait:
            recorder.add_dwell(wait)
    if moved:
        state.length_changed = state.rotation_changed = frames.from_machine[axis] = False
    if added:
        state.note_tool()


def _set_feed(state: State, block: CurrentBlock, feed: float | None) -> None:
    block.refuse_if(feed is not None and not feed > 0.0, None, "cuts without a feed", "its feed above 0")
    state.feed = state.feed if feed is None else feed


def find_height(state: State, block: CurrentBlock, motion: int, named: bool) -> None:
    """Handle a move while the present height is unknown: a cut is refused, a Z makes it known again."""
    if motion != RAPID:
        know_height(state, block, None)
    state.height_lost = not named


def know_height(state: State, block: CurrentBlock, word: Word | None) -> None:
    """Refuse words that depend on the present height if that is unknown."""
    if state.height_lost:
        reason = "the tool length changed between the last move and M6, and LinuxCNC's interpreter forgets that"
        raise block.fail(
            word, "a cut before any Z" if word is None else "takes the present height", f"G0 with Z before it: {reason}"
        )


def know_position(state: State, block: CurrentBlock, word: Word, axes: Collection[int]) -> None:
    """Refuse a code that uses present coordinates of axes that LinuxCNC's interpreter may have differently."""
    if 2 in axes:
        know_height(state, block, word)
    if XY & set(axes):
        know_place(state, block, word)


def straight(state: State, block: CurrentBlock, code: str) -> None:
    """G0, G1: straight to the point that the axis words name."""
    motion = RAPID if code == "G0" else FEED
    if any(block.has(letter) for letter in AXES):
        point, words = target(state, block)
        if state.corner is not None and code == "G1":
            cut_corner(state, block, point)
        record(state, block, motion, point, words)
    elif "motion" in block.groups and state.beside is not None:  # to the programmed point, as LinuxCNC does
        record(state, block, motion, list(state.frames.position))
    elif "motion" in block.groups and code == "G1" and state.height_lost:  # rs274 moves then
        find_height(state, block, FEED, named=False)


def arc(state: State, block: CurrentBlock, code: str) -> None:
    """G2, G3: clockwise and counter-clockwise in the plane in force, to the point that the axis words name."""
    if not (any(block.has(letter) for letter in (*AXES, *geometry.CENTER_LETTERS)) or "motion" in block.groups):
        return
    if state.beside is not None:
        raise block.fail(block.block.words[0], "is an arc as the first move after cutter compensation", "G0 or G1")
    first, second, _ = geometry.PLANES[state.plane]
    frames, clockwise = state.frames, code == "G2"
    here = frames.to_program(frames.position)
    words = point_words(state, block)
    there = destination(state, block, here, words)
    start, end = (here[first], here[second]), (there[first], there[second])
    turns = block.whole("P", block.block.words[0]) or 1
    block.refuse_if(turns > MOST_TURNS, "P", "is not a number of turns", f"a whole number from 1 to {MOST_TURNS}")
    center = _center(state, block, start, end, clockwise, words)
    sweep = geometry.sweep_about(center, start, end, clockwise, state.inch, turns)
    about = arc_about(state, here, complex(*center), sweep)
    record(state, block, ARC, control_point(state, block, here, words), words, arc=about)


def _center(
    state: State,
    block: CurrentBlock,
    start: geometry.Point2,
    end: geometry.Point2,
    clockwise: bool,
    words: dict[int, float],
) -> geometry.Point2:
    """Centre by R, or by the two of I, J, K that belong to the plane. Raises `InputError`, `geometry.GeometryError`."""
    first, second, normal = geometry.PLANES[state.plane]
    radius = block.take("R")
    off_plane = geometry.CENTER_WORDS[normal]
    in_plane = (geometry.CENTER_WORDS[first], geometry.CENTER_WORDS[second])
    if block.has(off_plane) and block.values[off_plane].value == 0.0:
        block.take(off_plane)  # posts write all three
    block.refuse_if(block.has(off_plane), off_plane, f"is off the plane {state.plane}", " and ".join(sorted(in_plane)))
    offsets = [block.take(letter) for letter in in_plane]
    geometry.refuse_if(state.polar and offsets != [None, None], "an arc with I, J or K in polar mode (G16)", "R")
    if radius is not None:
        block.refuse_if(offsets != [None, None], "R", "and a centre (I, J, K) are both given", "one of them")
        ends = {first, second} & words.keys()
        geometry.refuse_if(not ends, "an arc with R and without an end point", "an axis word of the plane")
        return geometry.center_from_radius(start, end, radius * state.length_scale, clockwise)
    if offsets == [None, None] or (state.arc_absolute and None in offsets):
        problem = "an arc without a centre, or with one word of an absolute one (G90.1)"
        raise geometry.GeometryError(problem, f"{in_plane[0]} and {in_plane[1]}, or R")
    a, b = ((offset or 0.0) * state.length_scale for offset in offsets)
    return (a, b) if state.arc_absolute else (start[0] + a, start[1] + b)


def motion_off(state: State, block: CurrentBlock, code: str) -> None:
    """G80: no motion mode, so axis words are not allowed. On Fanuc's and Haas' controls G0 or G1 stay in force."""
    state.motion = state.group_01 if state.group_01 in ("G0", "G1") else None


def machine_move(state: State, block: CurrentBlock, code: str) -> None:
    """G53: the axis words are machine coordinates, for this block only."""
    word, frames = block.codes[code], state.frames
    straight = state.motion in ("G0", "G1") and state.absolute
    block.refuse_if(not straight, word, f"with {state.motion}, or in incremental mode (G91)", "G0 or G1, in G90")
    words = axis_words(state, block)
    turned = any(axis > 2 for axis in words) and any(frames.origin[3:])
    block.refuse_if(turned, word, "with rotary axes, while the work is turned", "X, Y, Z alone")
    if words:
        _leave_program_coordinates(state, block, word, words)
    point = frames.machine_position()
    for axis, value in words.items():
        point[axis] = value
    record(state, block, RAPID if state.motion == "G0" else FEED, frames.control_of_machine(point), machine=words)


def homes_standing(block: CurrentBlock, letter: str) -> bool:
    """True if U, V or W is 0 beside G28 or G30: X, Y or Z goes home from its present position."""
    return block.groups.get("non-modal") in ("G28", "G30") and block.values[letter].value == 0.0


def go_home(state: State, block: CurrentBlock, code: str) -> None:
    """G28, G30: rapid to the intermediate point, then the axes named there, or all, to the reference point."""
    at_rest = {axis for axis, letter in enumerate(INCREMENTAL_AXES) if block.take(letter) is not None}
    words = axis_words(state, block)
    if code == "G30" and state.dialect.increments and block.take("P") not in (None, 2):  # P2: as G30 alone (Fanuc)
        raise block.fail("P", "is a reference point that nothing gives", "P2")
    frames = state.frames
    _leave_program_coordinates(state, block, block.codes[code], at_rest | words.keys())
    if words:
        between = cartesian(state, frames.to_program(frames.position), words)
        record(state, block, RAPID, frames.to_control(between), words)
    home = frames.offsets.home_g28 if code == "G28" else frames.offsets.home_g30
    if not any(home):
        state.assume(f"the reference point of {code}, not given by any offsets file, is machine 0, 0, 0")
    going = at_rest | words.keys() or set(range(6))
    # Axis by axis in program coordinates, as LinuxCNC does, which makes a difference with a rotation in force.
    there = frames.to_program(frames.control_of_machine(list(home)))
    here = frames.to_program(frames.position)
    point = [there[axis] if axis in going else here[axis] for axis in range(6)]
    record(state, block, RAPID, frames.to_control(point), machine=going)


def set_home(state: State, block: CurrentBlock, code: str) -> None:
    """G28.1, G30.1: the present point is the reference point from here on."""
    know_position(state, block, block.codes[code], range(6))
    offsets = state.frames.offsets
    (offsets.home_g28 if code == "G28.1" else offsets.home_g30)[:] = state.frames.machine_position()


def _leave_program_coordinates(state: State, block: CurrentBlock, word: Word, axes: Collection[int]) -> None:
    """Prepare a move of `axes` (none: all) by machine coordinates: under G68 only off the rotated plane."""
    block.refuse_if(state.frames.tip_held, word, "while tool centre point control is on (G43.4)", "G49 before it")
    both = not axes or set(axes) >= XY
    if not both:
        know_place(state, block, word)
    if both or XY & set(axes):
        refuse_while_rotated(state, block, word, "moves X and Y in machine coordinates")
        forget_polar(state)
    if both:
        state.unsettled = None


_G28, _G30 = g_codes("G28 - G28.1"), g_codes("G30 - G30.1")
_OFF = "motion mode off; on Fanuc's and Haas' controls the cycle alone"
MOTION_CODES = (
    Code("G0", "motion", straight, "rapid", g_codes("G0"), many=True),
    Code("G1", "motion", straight, "feed", g_codes("G1"), many=True),
    Code("G2", "motion", arc, "clockwise arc", g_codes("G2 G3"), many=True),
    Code("G3", "motion", arc, "counter-clockwise arc", g_codes("G2 G3"), many=True),
    Code("G80", "motion", motion_off, _OFF, f"{g_codes('G80')}; {FANUC}, Canned cycle cancel (G80)"),
    Code("G53", "non-modal", machine_move, "machine coordinates", g_codes("G53"), step="motion"),
    Code("G28", "non-modal", go_home, "to the first reference point", _G28, takes_axes=True),
    Code("G30", "non-modal", go_home, "to the second reference point", _G30, takes_axes=True),
    Code("G28.1", "non-modal", set_home, "set the first reference point", _G28),
    Code("G30.1", "non-modal", set_home, "set the second reference point", _G30),
)
