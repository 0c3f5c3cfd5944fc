"""Corners to the next block: `,C` and `,R` behind a feed move cut or round the corner between it and the next one. mm.

Fanuc's operator's manuals, "Optional chamfering and corner R": both moves lie in the plane in force; C counts from the
corner that is cut off, both ways.
"""

import cmath
import math
from dataclasses import replace

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.center_path import arc_about, to_setup_of_program
from toolpath_stiff.nc.codes.code import FANUC, HAAS, family
from toolpath_stiff.nc.elements import cut_off
from toolpath_stiff.nc.moves import ARC, FEED
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import CORNERS

SAME_MM = 1e-9


def corner(state: State, block: CurrentBlock, code: str) -> None:
    """`,C` and `,R`: cut off or round the corner to the next block."""
    word, size, recent = block.values[code], block.take(code) or 0.0, state.recorder.recent
    block.refuse_if(state.dialect.name == "linuxcnc", word, "is not a word of the dialect linuxcnc", "fanuc or haas")
    block.refuse_if(size <= 0.0, word, "is the size of a corner", "more than 0")
    after_feed = recent and recent[-1].line == block.line and recent[-1].motion == FEED
    alone = after_feed and len(block.values.keys() & {*CORNERS}) == 1 and state.feed_mode != "G93"
    block.refuse_if(not alone, word, "beside another corner, under G93, or without a feed move", "one beside a G1")
    state.corner = block


def cut_corner(state: State, block: CurrentBlock, target: list[float]) -> None:
    """Shorten the move before this one and add the corner between them, where the tool then stands."""
    pending, frames, before = state.corner, state.frames, state.recorder.recent[-1]
    assert pending is not None
    others = [group for group in block.groups if group not in ("motion", "distance") and not group.startswith("M ")]
    block.refuse_if(
        others or before.dwell, None, f"the move behind the corner of line {pending.line} beside other codes", "G1"
    )
    state.corner = None
    begin, vertex, end = before.start, frames.to_setup(frames.position), frames.to_setup(target)
    first, second, normal = geometry.PLANES[state.plane]
    points = [frames.to_program(frames.from_setup(point)) for point in (begin, vertex, end)]
    geometry.refuse_if(
        any(math.dist(point[3:], vertex[3:]) or abs(point[normal] - points[1][normal]) > SAME_MM for point in points),
        "a corner between moves that do not lie in the plane, or while rotary axes turn",
        "X, Y and Z alone, in the plane",
    )
    rounded = ",R" in pending.values
    size = pending.values[",R" if rounded else ",C"].value * state.length_scale
    before_corner, corner_point, after_corner = (complex(point[first], point[second]) for point in points)
    lines = ((before_corner, corner_point, None, 0), (corner_point, after_corner, None, 0))
    cut = cut_off(*lines, size, rounded)
    if cut is None:  # no corner: the path goes straight on
        return

    def in_setup(place: complex) -> list[float]:
        point = list(points[1])
        point[first], point[second] = place.real, place.imag
        return to_setup_of_program(frames, point)

    start, stop, center, _ = cut
    before.end = in_setup(start)
    arc = None
    if center is not None:
        arc = arc_about(state, points[1], center, cmath.phase((stop - center) / (start - center)))
    bound, motion, beyond = before.from_machine[1], ARC if arc else FEED, in_setup(stop)
    state.recorder.add(
        replace(before, motion=motion, start=before.end, end=beyond, from_machine=(bound, bound), arc=arc)
    )
    frames.position = [p + new - old for p, new, old in zip(frames.position, beyond, vertex, strict=True)]


_CORNERS = {",C": "chamfer to the next block", ",R": "rounding to the next block"}
_SOURCE = f"{FANUC}, Optional chamfering and corner R; {HAAS}, G01"
CORNER_CODES = family(_CORNERS, "corner", corner, _SOURCE, ("generic", "fanuc", "haas"))
