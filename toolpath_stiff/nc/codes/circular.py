"""G2 and G3: arcs, full circles, helices, from the words of a block. mm."""

from __future__ import annotations

from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.blocks import POINT_WORDS, CurrentBlock
from toolpath_stiff.nc.codes.contract import MOTION, Code, g_codes
from toolpath_stiff.nc.codes.moving import record
from toolpath_stiff.nc.codes.points import control_point, destination, point_words
from toolpath_stiff.nc.moves import ARC
from toolpath_stiff.nc.recorder import Arc
from toolpath_stiff.nc.state import State

ARCS = ("G2", "G3")
MOST_TURNS = 10_000


def arc(state: State, block: CurrentBlock, code: str) -> None:
    """G2, G3: clockwise and counter-clockwise in the plane in force, to the point that the axis words name."""
    if not (any(block.has(letter) for letter in (*POINT_WORDS, *arcs.CENTER_LETTERS)) or MOTION in block.groups):
        return
    first, second, _ = arcs.PLANES[state.plane]
    frames = state.frames
    here = frames.to_program(frames.position)
    words = point_words(state, block)
    target = destination(state, block, here, words)
    start, end = (here[first], here[second]), (target[first], target[second])
    turns = _turns(block)
    clockwise = code == "G2"
    try:
        center = _center(state, block, start, end, clockwise, words)
        sweep = sweep_about(center, start, end, clockwise, turns)
    except arcs.ArcError as error:
        raise block.fail(None, error.found, error.expected) from None
    middle = list(here)
    middle[first], middle[second] = center
    x, y, z = frames.to_setup(frames.to_control(middle))[:3]
    turned = frames.turn_direction(normal_of(state.plane))
    record(state, block, ARC, control_point(state, block, here, words), words, arc=Arc((x, y, z), turned, sweep))


def normal_of(plane: str) -> tuple[float, float, float]:
    """Unit normal of a plane, in program axes."""
    normal = arcs.PLANES[plane][2]
    return (float(normal == 0), float(normal == 1), float(normal == 2))


def sweep_about(center: arcs.Point2, start: arcs.Point2, end: arcs.Point2, clockwise: bool, turns: int = 1) -> float:
    """Signed angle of an arc in rad. Raises `ArcError` unless start and end lie on one circle about the centre."""
    arcs.check_radii(start, end, center)
    return arcs.arc_sweep(start, end, center, clockwise, turns)


def center_by_offsets(start: arcs.Point2, offsets: tuple[float, float], scale: float) -> arcs.Point2:
    """Centre that lies at I, J or K (in units of `scale` mm) from the start."""
    return (start[0] + offsets[0] * scale, start[1] + offsets[1] * scale)


def center_by_radius(start: arcs.Point2, end: arcs.Point2, radius: float, scale: float, clockwise: bool) -> arcs.Point2:
    """Centre of an arc given by R (in units of `scale` mm). Raises `ArcError`."""
    return arcs.center_from_radius(start, end, radius * scale, clockwise)


def _turns(block: CurrentBlock) -> int:
    turns = block.take("P")
    if turns is None:
        return 1
    if turns != int(turns) or not 1 <= turns <= MOST_TURNS:
        raise block.fail(block.values["P"], "is no number of turns", "a whole number from 1")
    return int(turns)


def _center(
    state: State, block: CurrentBlock, start: arcs.Point2, end: arcs.Point2, clockwise: bool, words: dict[int, float]
) -> arcs.Point2:
    """Centre by R, or by the two of I, J, K that belong to the plane. Raises `InputError`, `ArcError`."""
    first, second, normal = arcs.PLANES[state.plane]
    radius = block.take("R")
    off_plane = arcs.CENTER_WORDS[normal]
    in_plane = (arcs.CENTER_WORDS[first], arcs.CENTER_WORDS[second])
    if block.has(off_plane):
        raise block.fail(block.values[off_plane], f"is off the plane {state.plane}", " and ".join(sorted(in_plane)))
    offsets = [block.take(letter) for letter in in_plane]
    if state.polar is not None and offsets != [None, None]:
        raise arcs.ArcError("an arc with I, J or K in polar mode (G16)", "R")
    if radius is not None:
        if offsets != [None, None]:
            raise block.fail(block.values["R"], "and a centre (I, J, K) are both given", "one of them")
        if not {first, second} & words.keys():
            raise arcs.ArcError("an arc with R and without an end point", "an axis word of the plane")
        return center_by_radius(start, end, radius, state.length_scale, clockwise)
    if offsets == [None, None]:
        raise arcs.ArcError("an arc without a centre", f"{in_plane[0]}, {in_plane[1]} or R")
    if state.arc_absolute:
        if None in offsets:
            raise arcs.ArcError("an absolute centre (G90.1) with one word", f"{in_plane[0]} and {in_plane[1]}")
        a, b = (v * state.length_scale for v in offsets if v is not None)
        return (a, b)
    return center_by_offsets(start, (offsets[0] or 0.0, offsets[1] or 0.0), state.length_scale)


CODES = (
    Code("G2", MOTION, arc, "clockwise arc", g_codes("G2 G3"), many=True),
    Code("G3", MOTION, arc, "counter-clockwise arc", g_codes("G2 G3"), many=True),
)
