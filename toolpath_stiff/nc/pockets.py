"""Paths of milled pockets, slots and studs in their plane: layers, plunges, rings, finishing. mm, mm/min, rad.

Points are complex numbers of the plane. An outline is a rectangle with rounded corners (a circle, a slot where these
meet); set off by a distance it stays one. How a control clears a pocket inside is not published: the rings are ours,
walls, floors and layers are those of the cycle.
"""

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from toolpath_stiff.nc.elements import Element, direction
from toolpath_stiff.nc.geometry import refuse_if

LEAST_MM = 1e-9  # a side or a step of less is none
MOST_LAYERS = 10_000  # or rings in a layer
Leg = tuple[complex, complex | None]  # end, and the centre of an arc
Cut = tuple[complex, float, float | None, complex | None, int]  # place, height, feed (None: rapid), centre, turn
Heights = tuple[list[float], float, float]  # of the layers, safe above all, ahead of a cut
Feeds = tuple[float, float | None]  # in the plane, down
Plunge = tuple[str, float, float]  # "", "helix" with radius and pitch, "ramp" with half its length and its angle


@dataclass(frozen=True)
class Outline:
    """A rectangle with rounded corners about `middle`, its length turned by `angle` from the first axis."""

    middle: complex
    length: float
    width: float
    corner: float
    angle: float = 0.0

    def grown(self, by: float) -> "Outline":
        """The outline set off outward by a distance, inward by a negative one; corners get sharp at the least."""
        corner = max(self.corner + by, 0.0)
        return replace(self, length=self.length + 2.0 * by, width=self.width + 2.0 * by, corner=corner)

    def at(self, along: float, across: float) -> complex:
        """A point by its distances from the middle along the length and across it."""
        return self.middle + cmath.rect(1.0, self.angle) * complex(along, across)

    def around(self, turn: int) -> list[Leg]:
        """Legs of one way round, +1 counter-clockwise or -1, from and to `at(0, -width / 2)`.

        Examples
        --------
        >>> Outline(0j, 4.0, 4.0, 2.0).around(1)
        [(-2j, 0j)]
        >>> [end for end, _ in Outline(0j, 6.0, 4.0, 0.0).around(1)]
        [(3-2j), (3+2j), (-3+2j), (-3-2j), -2j]
        """
        x, y = self.length / 2.0, self.width / 2.0
        a, b, legs = x - self.corner, y - self.corner, list[Leg]()
        ends = [(a, -y), (x, -b), (x, b), (a, y), (-a, y), (-x, b), (-x, -b), (-a, -y), (0.0, -y)]
        centers = [None, (a, -b), None, (a, b), None, (-a, b), None, (-a, -b), None]
        here = self.at(0.0, -y)
        for end, center in zip(ends, centers, strict=True):
            place = self.at(turn * end[0], end[1])
            about = None if center is None else self.at(turn * center[0], center[1])
            if abs(place - here) < LEAST_MM:
                continue
            if legs and about is not None and legs[-1][1] is not None and abs(legs[-1][1] - about) < LEAST_MM:
                legs.pop()
            legs.append((place, about))
            here = place
        return legs


def layers(top: float, bottom: float, most: float) -> list[float]:
    """Heights of equal infeeds of at most `most` from the top down; 0: one infeed.

    Examples
    --------
    >>> layers(1.0, -5.0, 4.0)
    [-2.0, -5.0]
    """
    count = max(1, math.ceil((top - bottom) / most - LEAST_MM)) if most > 0.0 else 1
    refuse_if(count > MOST_LAYERS, "infeeds in too many steps", "larger ones")
    return [top + (bottom - top) * index / count for index in range(1, count + 1)]


def clear(outer: Outline, step: float, height: float, feed: float, turn: int) -> Iterator[Cut]:
    """Clear what an outer path of the tool's centre encloses, from the middle out, in rings at most `step` apart.

    Steps of more than sqrt(2) radii of the tool leave something between the sharp corners of rings.
    """
    half, apart = min(outer.length, outer.width) / 2.0, (outer.length - outer.width) / 2.0
    for way in (turn, -turn, 0) if abs(apart) > LEAST_MM else ():
        yield outer.at(way * max(apart, 0.0), way * max(-apart, 0.0)), height, feed, None, 0
    count = math.ceil(half / step - LEAST_MM)
    refuse_if(count > MOST_LAYERS, "a pocket in too many rings", "a larger step")
    for index in range(count - 1, -1, -1):
        ring = outer.grown(-half * index / count)
        yield ring.at(0.0, -ring.width / 2.0), height, feed, None, 0
        for end, center in ring.around(turn):
            yield end, height, feed, center, turn


def sink(outer: Outline, heights: tuple[float, float], feed: float | None, turn: int, way: Plunge) -> Iterator[Cut]:
    """From the middle down between two heights: straight, on a helix (radius, pitch), to and fro (half length, angle).

    The last turn or stroke is level. Without a feed: a rapid.
    """
    (kind, size, slope), (top, bottom) = way, heights
    if kind and size > LEAST_MM:
        helix, right, left = kind == "helix", outer.at(size, 0.0), outer.at(-size, 0.0)
        yield right, top, feed, None, 0
        strokes = layers(top, bottom, slope if helix else 2.0 * size * math.tan(slope))
        for index, height in enumerate((*strokes, bottom)):
            yield (
                (right, height, feed, outer.middle, turn)
                if helix
                else ((left, right)[index % 2], height, feed, None, 0)
            )
    yield outer.middle, bottom, feed, None, 0


def pocket(outer: Outline, step: float, heights: Heights, feeds: Feeds, turn: int, way: Plunge) -> Iterator[Cut]:
    """Clear layer by layer what an outer path of the tool's centre encloses; from and to a place above the middle."""
    floors, safe, ahead = heights
    above = safe
    for floor in floors:
        start, place = min(above + ahead, safe), outer.middle
        yield place, start, None, None, 0
        yield from sink(outer, (start, floor), feeds[1], turn, way)
        for cut in clear(outer, step, floor, feeds[0], turn):
            place = cut[0]
            yield cut
        yield place, safe, None, None, 0
        yield outer.middle, safe, None, None, 0
        above = floor


def along(
    path: list[Element],
    free: int,
    heights: Heights,
    feeds: Feeds,
    size: float,
    half: bool = False,
    top: float = math.inf,
) -> Iterator[Cut]:
    """Along a path at each height, led in and out on quarters of circles (or halves) from its free side: +1 left.

    `free` 0 or `size` 0: from above straight down. `top`: of the work, where that is not just below the safe height.
    """
    (floors, safe, ahead), (feed, down) = heights, feeds
    above, leads = min(safe, top), list[tuple[complex, complex]]()
    for element, place, way in ((path[0], path[0][0], -1), (path[-1], path[-1][1], 1)):
        center = place + free * 1j * direction(element, place) * size
        leads.append((center + (place - center) * (-1.0 if half else free * way * 1j), center))
    (start, into), (end, out) = leads
    for floor in floors:
        yield start, safe, None, None, 0
        yield start, min(above + ahead, safe), None, None, 0
        yield start, floor, down, None, 0
        if free and size:
            yield path[0][0], floor, feed, into, free
        for _, to, about, turn in path:
            yield to, floor, feed, about, turn
        if free and size:
            yield end, floor, feed, out, free
        yield end, safe, None, None, 0
        above = floor


def edge(path: Outline, heights: Heights, feeds: Feeds, turn: int, lead: float) -> Iterator[Cut]:
    """Once round at each height, led in and out on quarter circles; outside, where `lead` is negative, on half ones."""
    legs, begin = path.around(turn), path.at(0.0, -path.width / 2.0)
    starts = [begin, *(end for end, _ in legs)]
    ring = [(start, end, center, turn) for start, (end, center) in zip(starts, legs, strict=False)]
    yield from along(ring, turn if lead > 0.0 else -turn, heights, feeds, abs(lead), half=lead < 0.0)
