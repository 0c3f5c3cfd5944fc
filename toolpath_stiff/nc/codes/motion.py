"""G0 to G3, G53, G28, G30: straight moves, arcs, full circles, helices, from the words of a block. mm, degrees.

A move is recorded with its ends in the set-up frame, its feed and its tool; beside it stands whether the present height
is known.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.code import Code, g_codes
from toolpath_stiff.nc.codes.cutter import offset_move
from toolpath_stiff.nc.codes.modes import feed_of_move
from toolpath_stiff.nc.codes.points import (
    XY,
    axis_words,
    cartesian,
    control_point,
    destination,
    forget_polar,
    increments_hint,
    know_place,
    point_words,
    refuse_while_rotated,
)
from toolpath_stiff.nc.geometry import Point2
from toolpath_stiff.nc.moves import ARC, FEED, RAPID, Arc
from toolpath_stiff.nc.state import POINT_WORDS, Corner, CurrentBlock, Segment, State
from toolpath_stiff.nc.tables import tool_of
from toolpath_stiff.nc.words import CORNERS, Word

STILL = 1e-12  # of a coordinate, or of 1 mm if that is more: what frames' sums leave of an axis that stands


def record(
    state: State,
    block: CurrentBlock,
    motion: int,
    control: list[float],
    work: Collection[int] = (),
    machine: Collection[int] = (),
    arc: Arc | None = None,
) -> None:
    """Move to a point in control coordinates; `work`, `machine`: axes that were given in each."""
    frames = state.frames
    state.length_changed = state.rotation_changed = False
    if state.height_lost:
        find_height(state, block, motion, (2 in work and state.absolute) or 2 in machine)
    start, was = frames.to_setup(frames.position), frames.bound
    for axis in work:
        frames.from_machine[axis] = False
    for axis in machine:
        frames.from_machine[axis] = True
    end = frames.to_setup(control)
    # An axis that was not asked to move keeps its number to the last digit, whatever the frames' sums say.
    for axis in range(6):
        if abs(end[axis] - start[axis]) < STILL * max(1.0, abs(start[axis])):
            end[axis] = start[axis]
    feed = math.nan if motion == RAPID else feed_of_move(state, block, start, end, arc)
    bound = (was, frames.bound)
    if state.beside is not None:  # the tool centre still stands where compensation left it
        start, state.beside = [s + b for s, b in zip(start, state.beside, strict=True)], None
    if state.cutter is not None and state.cutter.radius:
        added = offset_move(state, block, motion, (start, control), feed, bound, arc)
    else:
        added = state.recorder.add(block.line, motion, start, end, feed, state.tool, state.tool_length, bound, arc)
    if state.trace is not None:
        state.trace.append(Segment(motion, list(frames.position), list(control), arc))
    frames.position = control
    if added:
        note_tool(state)


def note_tool(state: State) -> None:
    """Keep the tool in the spindle among those that moved."""
    if state.tool not in state.used_tools:
        state.used_tools[state.tool] = tool_of(state.tools, state.tool).in_use()


def find_height(state: State, block: CurrentBlock, motion: int, named: bool) -> None:
    """A move where the present height is lost: a cut is refused, a Z finds it again."""
    if motion != RAPID:
        know_height(state, block, None)
    state.height_lost = not named


def know_height(state: State, block: CurrentBlock, word: Word | None) -> None:
    """Refuse what depends on the present height, if that is lost."""
    if state.height_lost:
        raise block.fail(
            word,
            "a cut before any Z" if word is None else "takes the present height",
            "G0 with Z before it: the tool length changed between the last move and M6, and LinuxCNC's interpreter "
            "forgets that",
        )


def know_position(state: State, block: CurrentBlock, word: Word, axes: Collection[int]) -> None:
    """Refuse a code that takes the present numbers of axes that LinuxCNC's interpreter may have otherwise."""
    if 2 in axes:
        know_height(state, block, word)
    if XY & set(axes):
        know_place(state, block, word)


def straight(state: State, block: CurrentBlock, code: str) -> None:
    """G0, G1: straight to the point that the axis words name."""
    if any(block.has(letter) for letter in POINT_WORDS):
        words = point_words(state, block)
        target = control_point(state, block, state.frames.to_program(state.frames.position), words)
        if state.corner is not None and code == "G1":
            cut_corner(state, block, target)
        record(state, block, RAPID if code == "G0" else FEED, target, words)
    elif "motion" in block.groups and state.beside is not None:  # to the programmed point, as LinuxCNC does
        record(state, block, RAPID if code == "G0" else FEED, list(state.frames.position))
    elif "motion" in block.groups and code == "G1" and state.height_lost:  # rs274 moves then
        find_height(state, block, FEED, named=False)


def motion_off(state: State, block: CurrentBlock, code: str) -> None:
    """G80: no motion mode; axis words have none to move in. On Fanuc's and Haas' controls G0 or G1 hold on."""
    state.motion = state.group_01 if state.group_01 in ("G0", "G1") else None


def machine_move(state: State, block: CurrentBlock, code: str) -> None:
    """G53: the axis words are machine coordinates, for this block only."""
    word = block.codes[code]
    if state.motion not in ("G0", "G1"):
        raise block.fail(word, f"with {state.motion}", "G0 or G1")
    if not state.absolute:
        raise block.fail(word, "in incremental mode (G91)", "G90")
    words = axis_words(state, block)
    frames = state.frames
    if any(axis > 2 for axis in words) and any(frames.origin[3:]):
        raise block.fail(word, "with rotary axes, while the work is turned", "X, Y, Z alone")
    if words:
        _leave_program_coordinates(state, block, word, words)
    point = frames.machine_position()
    for axis, value in words.items():
        point[axis] = value
    motion = RAPID if state.motion == "G0" else FEED
    record(state, block, motion, frames.control_of_machine(point), machine=words)


INCREMENTAL_AXES = "UVW"  # X, Y, Z in steps, on lathes and as G28 U0 W0 on mills


def homes_standing(block: CurrentBlock, letter: str) -> bool:
    """Whether U, V or W is 0 beside G28 or G30: X, Y or Z goes home from where it stands."""
    return block.groups.get("non-modal") in ("G28", "G30") and block.values[letter].value == 0.0


def go_home(state: State, block: CurrentBlock, code: str) -> None:
    """G28, G30: rapid to the intermediate point, then the axes named there, or all, to the reference point."""
    standing = {axis for axis, letter in enumerate(INCREMENTAL_AXES) if block.take(letter) is not None}
    words = axis_words(state, block)
    if code == "G30" and state.dialect.increments and block.take("P") not in (None, 2):  # P2: as G30 alone (Fanuc)
        raise block.fail("P", "is a reference point that nothing gives", "P2")
    frames = state.frames
    _leave_program_coordinates(state, block, block.codes[code], {**dict.fromkeys(standing, 0.0), **words})
    if words:
        between = cartesian(state, frames.to_program(frames.position), words)
        record(state, block, RAPID, frames.to_control(between), words)
    home = frames.offsets.home_g28 if code == "G28" else frames.offsets.home_g30
    if not any(home):
        state.assume(f"the reference point of {code}, not given by any offsets file, is machine 0, 0, 0")
    going = standing | words.keys() or set(range(6))
    # Axis by axis in program coordinates, as LinuxCNC does: with a rotation in force it is not the same.
    there = frames.to_program(frames.control_of_machine(list(home)))
    here = frames.to_program(frames.position)
    point = [there[axis] if axis in going else here[axis] for axis in range(6)]
    record(state, block, RAPID, frames.to_control(point), machine=going)


def set_home(state: State, block: CurrentBlock, code: str) -> None:
    """G28.1, G30.1: the present point is the reference point from here on."""
    know_position(state, block, block.codes[code], range(6))
    offsets = state.frames.offsets
    home = offsets.home_g28 if code == "G28.1" else offsets.home_g30
    home[:] = state.frames.machine_position()


def _leave_program_coordinates(state: State, block: CurrentBlock, word: Word, words: dict[int, float]) -> None:
    """A move of `words` (none: all axes) by machine coordinates: harmless under G68 only off the rotated plane."""
    if state.frames.tip_held:
        raise block.fail(word, "while tool centre point control is on (G43.4)", "G49 before it")
    if words and not words.keys() >= XY:
        know_place(state, block, word)
    if not words or XY & words.keys():
        refuse_while_rotated(state, block, word, "moves X and Y in machine coordinates")
        forget_polar(state)
        if not words or words.keys() >= XY:
            state.unsettled = None


_G28, _G30 = g_codes("G28 - G28.1"), g_codes("G30 - G30.1")


STRAIGHT_CODES = (
    Code("G0", "motion", straight, "rapid", g_codes("G0"), many=True),
    Code("G1", "motion", straight, "feed", g_codes("G1"), many=True),
    Code(
        "G80",
        "motion",
        motion_off,
        "motion mode off; on Fanuc's and Haas' controls the cycle alone",
        f"{g_codes('G80')}; Fanuc, operator's manuals, Canned cycle cancel (G80)",
    ),
    Code("G53", "non-modal", machine_move, "machine coordinates", g_codes("G53"), step="motion"),
    Code("G28", "non-modal", go_home, "to the first reference point", _G28, takes_axes=True),
    Code("G30", "non-modal", go_home, "to the second reference point", _G30, takes_axes=True),
    Code("G28.1", "non-modal", set_home, "set the first reference point", _G28, label="non-modal"),
    Code("G30.1", "non-modal", set_home, "set the second reference point", _G30, label="non-modal"),
)


# Fanuc's operator's manuals, "Optional chamfering and corner R": `,C` and `,R` behind a feed move cut or round the
# corner between it and the next one, both in the plane in force; C counts from the corner that is cut off, both ways.
_CORNER = "Fanuc, operator's manuals, Optional chamfering and corner R; Haas, mill operator's manual, G01"


def corner(state: State, block: CurrentBlock, code: str) -> None:
    """`,C` and `,R`: the corner to the next block is cut off or rounded."""
    word = block.values[code]
    if state.dialect.name == "linuxcnc":
        raise block.fail(word, "is not a word of the dialect linuxcnc", "generic, fanuc or haas")
    size = block.take(code)
    assert size is not None
    if size <= 0.0:
        raise block.fail(word, "is the size of a corner", "more than 0")
    recorder = state.recorder
    if not (recorder.line and recorder.line[-1] == block.line and recorder.motion[-1] == FEED):
        raise block.fail(word, "beside anything but a feed move (G1)", "G1 with X, Y or Z")
    if len(block.values.keys() & {*CORNERS}) > 1 or state.feed_mode == "G93":
        raise block.fail(word, "beside another corner, or under G93", "one of ,C and ,R, in G94 or G95")
    state.corner = Corner(code, size * state.length_scale, block.line)


def cut_corner(state: State, block: CurrentBlock, target: list[float]) -> None:
    """Shorten the move before this one, and add the corner between them; the tool then stands at its end."""
    pending, frames, recorder = state.corner, state.frames, state.recorder
    assert pending is not None
    others = block.groups.keys() - {
        "motion",
        "distance",
        *(group for group in block.groups if group.startswith("M ")),
    }
    if others or recorder.dwell[-1]:
        raise block.fail(
            None, f"the second move of a corner ({pending.letter}, line {pending.line}) beside other codes", "G1"
        )
    state.corner = None
    begin, vertex, end = recorder.start[-1], frames.to_setup(frames.position), frames.to_setup(target)
    normal = frames.turn_direction(geometry.normal_of(state.plane))
    try:
        if begin[3:] != vertex[3:] or vertex[3:] != end[3:]:
            raise geometry.ArcError("a corner while the rotary axes turn", "X, Y and Z alone")
        ends = geometry.corner(begin[:3], vertex[:3], end[:3], normal, pending.size, pending.letter == ",R")
    except geometry.ArcError as error:
        raise block.fail(None, f"{error.found} ({pending.letter} of line {pending.line})", error.expected) from None
    if ends is None:  # the path goes straight on
        return
    first, last, center, sweep = ends
    recorder.end[-1] = [*first, *vertex[3:]]
    added = Arc(center, normal, sweep) if pending.letter == ",R" else None
    feed, bound = recorder.feed[-1], recorder.from_machine[-1]
    recorder.add(
        pending.line, ARC if added else FEED, recorder.end[-1], [*last, *vertex[3:]], feed, state.tool,
        state.tool_length, (bound[1], bound[1]), added,
    )  # fmt: skip
    frames.position = [p + new - old for p, new, old in zip(frames.position, [*last, *vertex[3:]], vertex, strict=True)]


CORNER_CODES = (
    Code(",C", "corner", corner, "chamfer to the next block", _CORNER, ("generic", "fanuc", "haas")),
    Code(",R", "corner", corner, "rounding to the next block", _CORNER, ("generic", "fanuc", "haas")),
)


ARCS = ("G2", "G3")


MOST_TURNS = 10_000


def arc(state: State, block: CurrentBlock, code: str) -> None:
    """G2, G3: clockwise and counter-clockwise in the plane in force, to the point that the axis words name."""
    if not (any(block.has(letter) for letter in (*POINT_WORDS, *geometry.CENTER_LETTERS)) or "motion" in block.groups):
        return
    if state.beside is not None:
        raise block.fail(block.block.words[0], "is an arc as the first move after cutter compensation", "G0 or G1")
    first, second, _ = geometry.PLANES[state.plane]
    frames = state.frames
    here = frames.to_program(frames.position)
    words = point_words(state, block)
    target = destination(state, block, here, words)
    start, end = (here[first], here[second]), (target[first], target[second])
    turns = _turns(block)
    clockwise = code == "G2"
    try:
        center = _center(state, block, start, end, clockwise, words)
        sweep = sweep_about(center, start, end, clockwise, state.inch, turns)
    except geometry.ArcError as error:
        raise block.fail(None, error.found, error.expected, increments_hint(state)) from None
    middle = list(here)
    middle[first], middle[second] = center
    x, y, z = frames.to_setup(frames.to_control(middle))[:3]
    turned = frames.turn_direction(geometry.normal_of(state.plane))
    record(state, block, ARC, control_point(state, block, here, words), words, arc=Arc((x, y, z), turned, sweep))


def sweep_about(center: Point2, start: Point2, end: Point2, clockwise: bool, inch: bool, turns: int = 1) -> float:
    """Signed angle of an arc in rad. Raises `ArcError` unless start and end lie on one circle about the centre."""
    geometry.check_radii(start, end, center, inch)
    sweep = geometry.arc_sweep(start, end, center, clockwise, turns)
    geometry.check_bulge(math.dist(start, center), sweep)
    return sweep


def _turns(block: CurrentBlock) -> int:
    turns = block.take("P")
    if turns is None:
        return 1
    if turns != int(turns) or not 1 <= turns <= MOST_TURNS:
        raise block.fail("P", "is not a number of turns", "a whole number from 1")
    return int(turns)


def _center(
    state: State,
    block: CurrentBlock,
    start: Point2,
    end: Point2,
    clockwise: bool,
    words: dict[int, float],
) -> Point2:
    """Centre by R, or by the two of I, J, K that belong to the plane. Raises `InputError`, `ArcError`."""
    first, second, normal = geometry.PLANES[state.plane]
    radius = block.take("R")
    off_plane = geometry.CENTER_WORDS[normal]
    in_plane = (geometry.CENTER_WORDS[first], geometry.CENTER_WORDS[second])
    if block.has(off_plane) and block.values[off_plane].value == 0.0:
        block.take(off_plane)  # posts write all three
    if block.has(off_plane):
        raise block.fail(off_plane, f"is off the plane {state.plane}", " and ".join(sorted(in_plane)))
    offsets = [block.take(letter) for letter in in_plane]
    if state.polar is not None and offsets != [None, None]:
        raise geometry.ArcError("an arc with I, J or K in polar mode (G16)", "R")
    if radius is not None:
        if offsets != [None, None]:
            raise block.fail("R", "and a centre (I, J, K) are both given", "one of them")
        if not {first, second} & words.keys():
            raise geometry.ArcError("an arc with R and without an end point", "an axis word of the plane")
        return geometry.center_from_radius(start, end, radius * state.length_scale, clockwise)
    if offsets == [None, None]:
        raise geometry.ArcError("an arc without a centre", f"{in_plane[0]}, {in_plane[1]} or R")
    if state.arc_absolute:
        if None in offsets:
            raise geometry.ArcError("an absolute centre (G90.1) with one word", f"{in_plane[0]} and {in_plane[1]}")
        a, b = (v * state.length_scale for v in offsets if v is not None)
        return (a, b)
    a, b = ((offset or 0.0) * state.length_scale for offset in offsets)
    return (start[0] + a, start[1] + b)


ARC_CODES = (
    Code("G2", "motion", arc, "clockwise arc", g_codes("G2 G3"), many=True),
    Code("G3", "motion", arc, "counter-clockwise arc", g_codes("G2 G3"), many=True),
)
