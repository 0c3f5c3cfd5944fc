"""Areas between contours, as Shapely's polygons: the room of the tool's centre in them, its walls, rings. mm.

How a control clears an area is not published: rings parallel to the contours, from the inside out, are ours. Polygons
differ from arcs by at most `FLAT_MM`.
"""

import cmath
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import shapely
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from toolpath_stiff.nc.elements import Contour, Element, direction, swept
from toolpath_stiff.nc.geometry import refuse_if
from toolpath_stiff.nc.pockets import MOST_LAYERS, Cut, Feeds, Heights

FLAT_MM, NEAR_MM = 2e-3, 1e-2  # chords of arcs; what two paths may differ by
ROUNDING_MM = 1e-5  # by which a way from ring to ring may leave the tool's room
QUARTER = 32  # chords of a quarter of a circle round corners


def line_along(path: Sequence[Element]) -> shapely.LineString:
    """Polygon that goes along a path, counter-clockwise or clockwise as it does."""
    points = [path[0][0]]
    for start, end, center, turn in path:
        if center is not None and abs(start - center) > FLAT_MM:
            sweep = swept((start, end, center, turn))
            count = math.ceil(abs(sweep) / (2.0 * math.acos(1.0 - FLAT_MM / abs(start - center))))
            points += [center + (start - center) * cmath.rect(1.0, sweep * i / count) for i in range(1, count)]
        points.append(end)
    return _line(points)


def _line(points: Iterable[complex]) -> shapely.LineString:
    return shapely.LineString([(point.real, point.imag) for point in points])


def orientation(contour: Contour) -> int:
    """+1 for a closed contour that runs counter-clockwise, -1 for one that runs clockwise."""
    return 1 if shapely.LinearRing(line_along(contour)).is_ccw else -1


def area_of(pockets: list[Contour], islands: list[Contour]) -> BaseGeometry:
    """The area that closed pockets enclose without their islands. Raises `GeometryError` where that is not clear."""
    outer, inner = ([shapely.Polygon(line_along(contour)) for contour in part] for part in (pockets, islands))
    crossed = not all(shape.is_valid for shape in (*outer, *inner))
    refuse_if(crossed, "a contour that crosses itself", "one that does not")
    area = shapely.union_all(outer)
    overlap = area.area < sum(shape.area for shape in outer) - FLAT_MM
    refuse_if(overlap, "pockets that overlap: their order decides what is milled", "one contour for both")
    return area.difference(shapely.union_all(inner))


def left_by(area: BaseGeometry, coarse: float, radius: float, spare: float) -> BaseGeometry:
    """The area for a tool that mills, up to an allowance, what one of the radius `coarse` could not reach in it."""
    rough = area.buffer(-spare, QUARTER)
    left = rough.difference(rough.buffer(-coarse, QUARTER).buffer(coarse + NEAR_MM, QUARTER))
    return (
        area.buffer(-spare - radius, QUARTER).intersection(left.buffer(radius, QUARTER)).buffer(spare + radius, QUARTER)
    )


def walls_within(area: BaseGeometry, walls: list[Contour], apart: float, turn: int) -> list[Contour]:
    """Paths beside the edges of an area if the tool fits along all of them, else round what it can reach."""
    room = area.buffer(NEAR_MM - apart, QUARTER)
    if walls and all(room.covers(line_along(wall)) for wall in walls):
        return walls
    fine = math.ceil(math.pi / 4.0 / math.acos(1.0 - FLAT_MM / max(apart, FLAT_MM)))
    return list(_edges(area.buffer(-apart, fine), turn))


def _edges(area: BaseGeometry, turn: int) -> Iterator[Contour]:
    """Edges of an area, its outer ones counter-clockwise where `turn` is +1, and around its holes the other way."""
    for part in shapely.get_parts(area) if not area.is_empty else ():
        shape = orient(part, turn)
        for ring in (shape.exterior, *shape.interiors):
            yield [(complex(*a), complex(*b), None, 0) for a, b in pairwise(ring.coords)]


def lead_within(room: BaseGeometry, path: Contour, free: int, most: float) -> float:
    """Radius of the quarter circles on which `pockets.along` meets a closed path: the largest that has room, or 0."""
    begin, ahead, way = path[0][0], direction(path[0], path[0][0]), room.buffer(NEAR_MM)
    for size in (most, most / 2.0, most / 4.0):
        center = begin + free * 1j * ahead * size
        arc = [(center - size * ahead, begin, center, free), (begin, center + size * ahead, center, free)]
        if way.covers(line_along(arc)):
            return size
    return 0.0


def clear_area(
    room: BaseGeometry, walls: list[Contour], step: float, heights: Heights, feeds: Feeds, turn: int, top: float
) -> Iterator[Cut]:
    """Clear layer by layer from the `top` of the work: rings a step apart from the inside out, last the room's walls.

    The tool goes straight from ring to ring where that stays within its room, otherwise up to the safe height.
    """
    rings, inner, way = list[Contour](), room.buffer(-step, QUARTER), room.buffer(ROUNDING_MM)
    while not inner.is_empty:
        rings += _edges(inner.simplify(FLAT_MM), turn)
        refuse_if(len(rings) > MOST_LAYERS, "a pocket in too many rings", "a larger step")
        inner = inner.buffer(-step, QUARTER)
    course, place = list[Contour](), 0j
    for ring in reversed(rings):  # each from its corner nearest to the one before
        near = min(range(len(ring)), key=lambda index: abs(ring[index][0] - place))
        place = ring[near][0]
        course.append(ring[near:] + ring[:near])
    course += walls
    stays = [way.covers(_line((before[-1][1], after[0][0]))) for before, after in pairwise(course)]
    (floors, safe, ahead), (feed, down), above = heights, feeds, top
    for floor in floors:
        here: complex | None = None
        for ring, follows in zip(course, [False, *stays], strict=True):
            start = ring[0][0]
            lifted = [(start if here is None else here, safe, None), (start, safe, None)]
            down_to = [(start, min(above + ahead, safe), None), (start, floor, down)]
            for place, height, rate in [(start, floor, feed)] if follows else [*lifted, *down_to]:
                yield place, height, rate, None, 0
            for _, place, center, way_round in ring:
                yield place, floor, feed, center, way_round
            here = ring[-1][1]
        yield course[-1][-1][1], safe, None, None, 0
        above = floor
