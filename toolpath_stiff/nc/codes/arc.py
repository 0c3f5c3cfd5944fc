"""G2, G3: arcs, full circles, helices, by I J K or by R. mm, degrees."""

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.code import Code, g_codes
from toolpath_stiff.nc.codes.increments import increments_hint
from toolpath_stiff.nc.codes.motion import record
from toolpath_stiff.nc.codes.points import control_point, destination, point_words
from toolpath_stiff.nc.geometry import ArcError, Point2
from toolpath_stiff.nc.moves import ARC, Arc
from toolpath_stiff.nc.state import POINT_WORDS, CurrentBlock, State

ARCS = ("G2", "G3")
MOST_TURNS = 10_000


def arc(state: State, block: CurrentBlock, code: str) -> None:
    """G2, G3: clockwise and counter-clockwise in the plane in force, to the point that the axis words name."""
    if not (any(block.has(letter) for letter in (*POINT_WORDS, *geometry.CENTER_LETTERS)) or "motion" in block.groups):
        return
    if state.beside is not None:
        raise block.fail(block.block.words[0], "is an arc as the first move after cutter compensation", "G0 or G1")
    first, second, _ = geometry.PLANES[state.plane]
    frames, clockwise = state.frames, code == "G2"
    here = frames.to_program(frames.position)
    words = point_words(state, block)
    target = destination(state, block, here, words)
    start, end = (here[first], here[second]), (target[first], target[second])
    turns = block.whole("P", block.block.words[0]) or 1
    if turns > MOST_TURNS:
        raise block.fail("P", "is not a number of turns", f"a whole number from 1 to {MOST_TURNS}")
    try:
        center = _center(state, block, start, end, clockwise, words)
        sweep = geometry.sweep_about(center, start, end, clockwise, state.inch, turns)
    except ArcError as error:
        raise block.fail(None, error.found, error.expected, increments_hint(state)) from None
    middle = list(here)
    middle[first], middle[second] = center
    x, y, z = frames.to_setup(frames.to_control(middle))[:3]
    turned = frames.turn_direction(geometry.normal_of(state.plane))
    record(state, block, ARC, control_point(state, block, here, words), words, arc=Arc((x, y, z), turned, sweep))


def _center(
    state: State, block: CurrentBlock, start: Point2, end: Point2, clockwise: bool, words: dict[int, float]
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
        raise ArcError("an arc with I, J or K in polar mode (G16)", "R")
    if radius is not None:
        if offsets != [None, None]:
            raise block.fail("R", "and a centre (I, J, K) are both given", "one of them")
        if not {first, second} & words.keys():
            raise ArcError("an arc with R and without an end point", "an axis word of the plane")
        return geometry.center_from_radius(start, end, radius * state.length_scale, clockwise)
    if offsets == [None, None] or (state.arc_absolute and None in offsets):
        expected = f"{in_plane[0]} and {in_plane[1]}, or R"
        raise ArcError("an arc without a centre, or with one word of an absolute one (G90.1)", expected)
    a, b = ((offset or 0.0) * state.length_scale for offset in offsets)
    return (a, b) if state.arc_absolute else (start[0] + a, start[1] + b)


ARC_CODES = (
    Code("G2", "motion", arc, "clockwise arc", g_codes("G2 G3"), many=True),
    Code("G3", "motion", arc, "counter-clockwise arc", g_codes("G2 G3"), many=True),
)
