"""G0 to G3, G33, G53, G28, G30: straight moves, arcs, full circles, helices, threads, from the words of a block.

A move is recorded with its ends in the set-up frame, its feed and its tool; beside it stands whether the present height
is known.

G33 and G33.1 are moves whose feed the spindle's turns give, as LinuxCNC has them (manual, "G-Codes", G33, G33.1).
mm, degrees.

Drilling, tapping and boring cycles (G73 G74 G76 G81 to G86, G89), expanded to their moves; G98 and G99.

Sources: LinuxCNC's manual ("G80-G89 Canned Cycles", "G73") and interp_cycles.cc; Fanuc's operator's manuals ("Canned
cycle") where a dialect follows them.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes import CORNER, DISTANCE, MOTION, ONCE, RETRACT, Code, g_codes
from toolpath_stiff.nc.codes.cutter import offset_move
from toolpath_stiff.nc.codes.modes import SLOWEST, feed_of_move, time_word
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
    xy_of_polar_words,
)
from toolpath_stiff.nc.geometry import MOST_STROKES, SAME_HEIGHT_MM, Drilling, Point2, strokes
from toolpath_stiff.nc.moves import ARC, CYCLE, FEED, RAPID, Arc, ToolUse
from toolpath_stiff.nc.state import POINT_WORDS, Corner, CurrentBlock, Segment, State
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import AXES, CORNERS, Word
from toolpath_stiff.units import SECONDS_PER_DAY, m_from_mm

# -- a move recorded ---------------------------------------------------------------------------------------------------

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
    if state.tool in state.used_tools:
        return
    entry = (state.tools or {}).get(state.tool, ToolEntry(state.tool))
    state.used_tools[state.tool] = ToolUse(
        state.tool,
        m_from_mm(entry.length),
        m_from_mm(entry.diameter),
        entry.remark,
        m_from_mm(entry.stick_out),
        entry.material,
    )


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


# -- straight moves ----------------------------------------------------------------------------------------------------


def straight(state: State, block: CurrentBlock, code: str) -> None:
    """G0, G1: straight to the point that the axis words name."""
    if any(block.has(letter) for letter in POINT_WORDS):
        words = point_words(state, block)
        target = control_point(state, block, state.frames.to_program(state.frames.position), words)
        if state.corner is not None and code == "G1":
            cut_corner(state, block, target)
        record(state, block, RAPID if code == "G0" else FEED, target, words)
    elif MOTION in block.groups and state.beside is not None:  # to the programmed point, as LinuxCNC does
        record(state, block, RAPID if code == "G0" else FEED, list(state.frames.position))
    elif MOTION in block.groups and code == "G1" and state.height_lost:  # rs274 moves then
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
    return block.groups.get(ONCE) in ("G28", "G30") and block.values[letter].value == 0.0


def go_home(state: State, block: CurrentBlock, code: str) -> None:
    """G28, G30: rapid to the intermediate point, then the axes named there, or all, to the reference point."""
    standing = {axis for axis, letter in enumerate(INCREMENTAL_AXES) if block.take(letter) is not None}
    words = axis_words(state, block)
    if code == "G30" and state.dialect.increments and block.take("P") not in (None, 2):  # P2: as G30 alone (Fanuc)
        raise block.fail(block.values["P"], "is a reference point that nothing gives", "P2")
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
    Code("G0", MOTION, straight, "rapid", g_codes("G0"), many=True),
    Code("G1", MOTION, straight, "feed", g_codes("G1"), many=True),
    Code(
        "G80",
        MOTION,
        motion_off,
        "motion mode off; on Fanuc's and Haas' controls the cycle alone",
        f"{g_codes('G80')}; Fanuc, operator's manuals, Canned cycle cancel (G80)",
    ),
    Code("G53", ONCE, machine_move, "machine coordinates", g_codes("G53"), step=MOTION),
    Code("G28", ONCE, go_home, "to the first reference point", _G28, takes_axes=True),
    Code("G30", ONCE, go_home, "to the second reference point", _G30, takes_axes=True),
    Code("G28.1", ONCE, set_home, "set the first reference point", _G28, label=ONCE),
    Code("G30.1", ONCE, set_home, "set the second reference point", _G30, label=ONCE),
)

# -- corners to the next block -----------------------------------------------------------------------------------------

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
    asked, frames, recorder = state.corner, state.frames, state.recorder
    assert asked is not None
    others = block.groups.keys() - {MOTION, DISTANCE, *(group for group in block.groups if group.startswith("M "))}
    if others or recorder.dwell[-1]:
        raise block.fail(
            None, f"the second move of a corner ({asked.letter}, line {asked.line}) beside other codes", "G1"
        )
    state.corner = None
    begin, at, end = recorder.start[-1], frames.to_setup(frames.position), frames.to_setup(target)
    normal = frames.turn_direction(geometry.normal_of(state.plane))
    try:
        if begin[3:] != at[3:] or at[3:] != end[3:]:
            raise geometry.ArcError("a corner while the rotary axes turn", "X, Y and Z alone")
        ends = geometry.corner(begin[:3], at[:3], end[:3], normal, asked.size, asked.letter == ",R")
    except geometry.ArcError as error:
        raise block.fail(None, f"{error.found} ({asked.letter} of line {asked.line})", error.expected) from None
    if ends is None:  # the path goes straight on
        return
    first, last, center, sweep = ends
    recorder.end[-1] = [*first, *at[3:]]
    added = Arc(center, normal, sweep) if asked.letter == ",R" else None
    feed, bound = recorder.feed[-1], recorder.from_machine[-1]
    recorder.add(
        asked.line, ARC if added else FEED, recorder.end[-1], [*last, *at[3:]], feed, state.tool, state.tool_length,
        (bound[1], bound[1]), added,
    )  # fmt: skip
    frames.position = [p + new - old for p, new, old in zip(frames.position, [*last, *at[3:]], at, strict=True)]


CORNER_CODES = (
    Code(",C", CORNER, corner, "chamfer to the next block", _CORNER, ("generic", "fanuc", "haas")),
    Code(",R", CORNER, corner, "rounding to the next block", _CORNER, ("generic", "fanuc", "haas")),
)

# -- arcs --------------------------------------------------------------------------------------------------------------

ARCS = ("G2", "G3")
MOST_TURNS = 10_000


def arc(state: State, block: CurrentBlock, code: str) -> None:
    """G2, G3: clockwise and counter-clockwise in the plane in force, to the point that the axis words name."""
    if not (any(block.has(letter) for letter in (*POINT_WORDS, *geometry.CENTER_LETTERS)) or MOTION in block.groups):
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


def center_by_offsets(start: Point2, offsets: tuple[float, float], scale: float) -> Point2:
    """Centre that lies at I, J or K (in units of `scale` mm) from the start."""
    return (start[0] + offsets[0] * scale, start[1] + offsets[1] * scale)


def center_by_radius(start: Point2, end: Point2, radius: float, scale: float, clockwise: bool) -> Point2:
    """Centre of an arc given by R (in units of `scale` mm). Raises `ArcError`."""
    return geometry.center_from_radius(start, end, radius * scale, clockwise)


def _turns(block: CurrentBlock) -> int:
    turns = block.take("P")
    if turns is None:
        return 1
    if turns != int(turns) or not 1 <= turns <= MOST_TURNS:
        raise block.fail(block.values["P"], "is not a number of turns", "a whole number from 1")
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
        raise block.fail(block.values[off_plane], f"is off the plane {state.plane}", " and ".join(sorted(in_plane)))
    offsets = [block.take(letter) for letter in in_plane]
    if state.polar is not None and offsets != [None, None]:
        raise geometry.ArcError("an arc with I, J or K in polar mode (G16)", "R")
    if radius is not None:
        if offsets != [None, None]:
            raise block.fail(block.values["R"], "and a centre (I, J, K) are both given", "one of them")
        if not {first, second} & words.keys():
            raise geometry.ArcError("an arc with R and without an end point", "an axis word of the plane")
        return center_by_radius(start, end, radius, state.length_scale, clockwise)
    if offsets == [None, None]:
        raise geometry.ArcError("an arc without a centre", f"{in_plane[0]}, {in_plane[1]} or R")
    if state.arc_absolute:
        if None in offsets:
            raise geometry.ArcError("an absolute centre (G90.1) with one word", f"{in_plane[0]} and {in_plane[1]}")
        a, b = (v * state.length_scale for v in offsets if v is not None)
        return (a, b)
    return center_by_offsets(start, (offsets[0] or 0.0, offsets[1] or 0.0), state.length_scale)


ARC_CODES = (
    Code("G2", MOTION, arc, "clockwise arc", g_codes("G2 G3"), many=True),
    Code("G3", MOTION, arc, "counter-clockwise arc", g_codes("G2 G3"), many=True),
)
ROTARY = (3, 4, 5)


def synchronised(state: State, block: CurrentBlock, code: str) -> None:
    """G33: straight, K mm a turn of the spindle; G33.1: so to the point, and back with the spindle reversed."""
    if not (MOTION in block.groups or any(block.has(letter) for letter in (*POINT_WORDS, "K"))):
        return
    first = block.block.words[0]
    if state.dialect.name != "linuxcnc":
        raise block.fail(
            first,
            f"is under {code}, spindle-synchronised motion, whose words differ from control to control",
            hint="leave threading and rigid tapping out, or name the control with --dialect linuxcnc",
        )
    pitch = block.take("K")
    words = point_words(state, block)
    if pitch is None or not words:
        raise block.fail(first, f"under {code} without its point or its pitch", "X, Y, Z and K")
    feed = abs(pitch) * state.length_scale * state.speed
    if feed < SLOWEST:
        raise block.fail(first, f"under {code} with K{pitch:g} and the spindle at S{state.speed:g}", "both above 0")
    if any(axis in words for axis in ROTARY):
        raise block.fail(first, f"moves rotary axes under {code}", "X, Y and Z")
    frames = state.frames
    here = list(frames.position)
    target = control_point(state, block, frames.to_program(here), words)
    mode, kept, state.feed_mode, state.feed = state.feed_mode, state.feed, "G94", feed
    record(state, block, FEED if code == "G33" else CYCLE, target, words)
    if code == "G33.1":
        record(state, block, CYCLE, here, words)
    state.feed_mode, state.feed = mode, kept


SYNCHRONISED_CODES = (
    Code("G33", MOTION, synchronised, "straight, K a turn of the spindle", g_codes("G33"), ("linuxcnc",)),
    Code("G33.1", MOTION, synchronised, "rigid tapping, in and out", g_codes("G33.1"), ("linuxcnc",)),
)
CYCLES = ("G73", "G74", "G76", "G81", "G82", "G83", "G84", "G85", "G86", "G89")
TAPS = ("G74", "G84")
PECKS, DWELLS = ("G73", "G83"), ("G82", "G89")
MOST_REPEATS = 10_000
RENEWED = ("level", "unit")  # what one cycle leaves to another one of its run


def return_level(state: State, block: CurrentBlock, code: str) -> None:
    """G98: cycles end at the level from which they began; G99: at their R plane."""
    state.retract = code


def begin_cycle(state: State, code: str) -> None:
    """Another cycle than the one in force forgets its words; within a run the level and the unit stay."""
    if code != state.motion:
        kept = RENEWED if state.motion in CYCLES else ()
        state.sticky = {name: state.sticky[name] for name in kept if name in state.sticky}


def cycle(state: State, block: CurrentBlock, code: str) -> None:
    """One block of a canned cycle: its holes, expanded."""
    given = MOTION in block.groups
    if not given and not any(block.has(letter) for letter in POINT_WORDS):
        return
    if code == "G76" and not state.dialect.increments:
        if state.dialect.name == "linuxcnc":
            raise block.fail(block.codes.get(code), "is a lathe's threading cycle on LinuxCNC", hint="this is a mill")
        raise block.fail(
            block.codes.get(code),
            "is a threading cycle on LinuxCNC, fine boring on Fanuc's and Haas' controls",
            hint="name the control with --dialect, or leave threading out",
        )
    if code in TAPS and state.plane != "G17" and not state.dialect.increments:
        found = f"{code} in {state.plane}: LinuxCNC's rs274 taps along another axis"
        raise block.fail(
            None, found, "G17", "" if state.dialect.name == "linuxcnc" else "name the control with --dialect"
        )
    normal = geometry.PLANES[state.plane][2]
    repeats = _repeats(state, block)
    _keep_heights(state, block, code, normal)
    words = _cycle_words(state, block, code, normal, given)
    frames = state.frames
    here = frames.to_program(frames.position)[normal]
    # The level from which a run of cycles began: G91's R counts from it, G98 returns to it.
    initial = state.sticky.setdefault("level", here)
    retract, bottom = _heights(state, block, code, initial)
    if not repeats:  # L0, or Fanuc's K0: the words are kept for the blocks that follow, and nothing moves
        return
    # As measured on LinuxCNC: a run that began below R goes to R first; otherwise a tool at or below R goes to the
    # level above the holes on its way to the next one.
    if initial < retract:
        _along_normal(state, block, normal, retract, RAPID)
        here = retract
    clear = max(initial, retract) if state.retract == "G98" else retract
    level = here if here > retract + SAME_HEIGHT_MM else clear
    _check_pecks(state, block, code, retract - bottom, repeats)
    peck, dwell, first, less, least = (state.sticky.get(letter, 0.0) for letter in "QPIJK")
    out_at_r = code in TAPS and state.dialect.increments
    hole = Drilling(code, bottom, retract, clear, peck, dwell, first, less, least, out_at_r)
    for number in range(repeats):
        if number and block.polar_words is not None:  # each hole's polar words count from the one before
            words |= xy_of_polar_words(state, block)
        place = destination(state, block, frames.to_program(frames.position), words)
        place[normal] = level
        record(state, block, RAPID, frames.to_control(place), words)
        level = clear
        _drill(state, block, normal, hole)


def _drill(state: State, block: CurrentBlock, normal: int, hole: Drilling) -> None:
    """The strokes of one hole, from above it."""
    _along_normal(state, block, normal, hole.retract, RAPID)
    for stroke in strokes(hole):
        _along_normal(state, block, normal, stroke.height, CYCLE if stroke.feed else RAPID, stroke.dwell)


def _along_normal(
    state: State, block: CurrentBlock, normal: int, height: float, motion: int, dwell: float = 0.0
) -> None:
    frames = state.frames
    place = frames.to_program(frames.position)
    if place[normal] != height:
        place[normal] = height
        record(state, block, motion, frames.to_control(place), (normal,))
    if dwell:
        state.recorder.add_dwell(dwell)


def _repeats(state: State, block: CurrentBlock) -> int:
    letter = next((letter for letter in state.dialect.cycle_repeats if block.has(letter)), None)
    if letter is None:
        return 1
    block.take(letter)
    word = block.as_written(letter)  # a count, whatever a bare K length is
    if word.value != int(word.value) or not 0 <= word.value <= MOST_REPEATS:
        raise block.fail(word, "is not a number of repeats", "a whole number from 0")
    return int(word.value)


def _keep_heights(state: State, block: CurrentBlock, code: str, normal: int) -> None:
    """G90 or G91 since Z and R were given: Fanuc's hole stays where it is, LinuxCNC reads the numbers again."""
    absolute, retract, bottom = state.heights
    if absolute == state.absolute or not {"R", "Z", "level"} <= state.sticky.keys():
        return
    renewed = [letter for letter in ("R", AXES[normal]) if block.has(letter)]
    keeps = True if state.polar is not None else state.dialect.keeps_heights
    if len(renewed) == 2 or keeps is False:
        return
    if keeps is None or renewed:
        raise block.fail(
            None,
            f"{code} after a change between G90 and G91: controls differ in whether the hole keeps its heights",
            f"R and {AXES[normal]} in the block",
            "" if renewed else "name the control with --dialect",
        )
    level = state.sticky["level"]
    heights = (retract, bottom) if state.absolute else (retract - level, bottom - retract)
    state.sticky["R"], state.sticky["Z"] = heights


def _cycle_words(state: State, block: CurrentBlock, code: str, normal: int, given: bool) -> dict[int, float]:
    """Take the block's words; R, Q, P and the bottom stay in force, the place of the hole is returned."""
    for letter in "RQ":
        value = block.take(letter)
        if value is not None:
            state.sticky[letter] = value * state.length_scale
    if block.has("P"):
        state.sticky["P"] = time_word(state, block, "P") or 0.0
    _words_of_one_control(state, block, code)
    words = point_words(state, block)
    if not words and given:
        raise block.fail(None, f"{code} without axis words", "X, Y, Z")
    if any(axis > 2 for axis in words):
        raise block.fail(None, f"{code} with rotary axes", "the rotary axes in a block before it")
    if normal in words:
        state.sticky["Z"] = words.pop(normal)
    if state.dialect.name == "haas" and "R" not in state.sticky:  # Haas, mill operator's manual, G81: R is optional
        frames = state.frames
        state.sticky["R"] = frames.to_program(frames.position)[normal] if state.absolute else 0.0
        state.assume("a drilling cycle without R begins where the tool stands (Haas: R is optional)")
    _check_cycle(state, block, code, normal)
    return words


def _words_of_one_control(state: State, block: CurrentBlock, code: str) -> None:
    """I, J, K of Haas' pecks; what taps and fine boring have besides, which changes no cut."""
    haas = state.dialect.name == "haas"
    if code in PECKS and haas:
        _shallower_pecks(state, block)
    if code in TAPS and haas and block.take("J") is not None:
        state.note(block.line, block.values["J"], "how much faster the tap comes out")
    if code in TAPS and state.sticky.get("Q"):
        raise block.fail(block.values.get("Q"), "is a tap in pecks, which depends on the control's parameters", "no Q")
    for letter in "QIJ" if code == "G76" else "":
        block.take(letter)
        if letter in block.values:
            state.note(block.line, block.values[letter], "the shift off the wall before the rapid out")


def _shallower_pecks(state: State, block: CurrentBlock) -> None:
    """I: the first peck; J: how much less each further one is; K: the least (Haas' manual, G83)."""
    given = [letter for letter in "IJK" if block.has(letter)]
    if not given:
        if "Q" in block.values:
            state.sticky |= dict.fromkeys("IJK", 0.0)
        return
    if "Q" in block.values or "I" not in given or ("J" in given and "K" not in given):
        raise block.fail(block.values[given[0]], "beside Q, or without I or K", "Q, or I, J and K")
    for letter in "IJK":
        state.sticky[letter] = abs(block.take(letter) or 0.0) * state.length_scale
    state.sticky["Q"] = state.sticky["K"] or state.sticky["I"]


def _check_cycle(state: State, block: CurrentBlock, code: str, normal: int) -> None:
    axis = AXES[normal]
    for letter, what in (("Z", axis), ("R", "R")):
        if letter not in state.sticky:
            raise block.fail(None, f"{code} without {what}", f"{what} in the cycle's first block")
    if code in PECKS and not state.sticky.get("Q", 0.0) > 0.0:
        raise block.fail(None, f"{code} without a peck", "Q above 0")
    if code in DWELLS:
        dwell = state.sticky.get("P")
        if dwell is None or not 0.0 <= dwell <= SECONDS_PER_DAY:
            raise block.fail(None, f"{code} without its dwell", "P with the seconds, 0 or more")
    if state.sticky.setdefault("unit", state.length_scale) != state.length_scale:
        raise block.fail(
            None,
            f"{code} after a change between G20 and G21: controls differ in whether the run keeps its heights",
            "G80 before it, and R and Z again",
        )


def _heights(state: State, block: CurrentBlock, code: str, initial: float) -> tuple[float, float]:
    """R plane and bottom of the hole, in program coordinates."""
    retract = state.sticky["R"] if state.absolute else state.sticky["R"] + initial
    bottom = state.sticky["Z"] if state.absolute else retract + state.sticky["Z"]
    state.heights = (state.absolute, retract, bottom)
    if retract < bottom:
        raise block.fail(None, f"{code}: R at {retract:g} mm is below the bottom at {bottom:g} mm", "R above it")
    if state.retract is None:
        state.assume("a drilling cycle before any G98 or G99 ends at its R plane (G99), as LinuxCNC starts")
    return retract, bottom


def _check_pecks(state: State, block: CurrentBlock, code: str, depth: float, repeats: int) -> None:
    pecks = depth / state.sticky["Q"] if code in PECKS else 1.0
    if pecks * repeats > MOST_STROKES:
        raise block.fail(None, f"{code} with more than {MOST_STROKES} strokes", "a larger Q, or fewer repeats")


_FANUC = "Fanuc, operator's manuals, Canned cycle for drilling"
DRILLING_CODES = (
    Code("G73", MOTION, cycle, "chip-breaking drilling", g_codes("G73")),
    Code("G81", MOTION, cycle, "drilling", g_codes("G81")),
    Code("G82", MOTION, cycle, "drilling with dwell", g_codes("G82")),
    Code("G83", MOTION, cycle, "peck drilling", g_codes("G83")),
    Code("G74", MOTION, cycle, "left-hand tapping", f"{g_codes('G74')}; {_FANUC}, G74"),
    Code("G84", MOTION, cycle, "right-hand tapping", f"{g_codes('G84')}; {_FANUC}, G84"),
    Code(
        "G76", MOTION, cycle, "fine boring, rapid out", f"{_FANUC}, Fine boring cycle (G76)", controls=("fanuc", "haas")
    ),
    Code("G86", MOTION, cycle, "boring, spindle stop, rapid out", g_codes("G86")),
    Code("G85", MOTION, cycle, "boring, feed out", g_codes("G85")),
    Code("G89", MOTION, cycle, "boring with dwell, feed out", g_codes("G89")),
    Code("G98", RETRACT, return_level, "cycles return to their level", g_codes("G98 G99")),
    Code("G99", RETRACT, return_level, "cycles return to R", g_codes("G98 G99")),
)
