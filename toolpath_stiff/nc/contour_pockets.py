"""Paths of pockets with contours and islands: beside a contour, and over the area that contours enclose. mm, rad.

A contour is a chain of elements; a pocket or an island is a closed one. The path beside a contour is exact: lines,
arcs, inside corners where both paths meet, outside ones rounded. How a control clears the area is not published: rings
parallel to the contours, from the inside out, are ours (polygons that differ from arcs by at most `FLAT_MM`; Shapely).
"""

import cmath
import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING

from toolpath_stiff.nc.compensation import GOUGE, SMALLER, TURNED
from toolpath_stiff.nc.elements import Element, cut_off, direction, meetings
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.geometry import PLANES, ArcError, refuse_arc_if, turn_between
from toolpath_stiff.nc.pockets import LEAST_MM, MOST_LAYERS, Cut, Feeds, Heights
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import Offsets

if TYPE_CHECKING:
    from shapely import Polygon

Contour = list[Element]
FLAT_MM = 2e-3  # chords of arcs
QUARTER = 32  # chords of a quarter of a circle round corners
CLOSED_MM = 0.016  # between start and end; as far as an arc's end may lie off its circle


def drawing(state: State) -> State:
    """A state in which statements draw a contour, in program axes: it has to say where it begins."""
    drawn = State(state.name, frames=Frames(Offsets(), None, (0.0,) * 6), dialect=state.dialect, feed=1.0, trace=[])
    drawn.plane, drawn.inch, drawn.motion = state.plane, state.inch, "G1"
    for axis in PLANES[state.plane][:2]:
        drawn.frames.position[axis] = math.nan
    return drawn


def elements_of(drawn: State, block: CurrentBlock, what: str) -> Contour:
    """Contour elements from the trace of moves that its blocks made; the first goes to where the contour begins.

    `what` goes along it, for errors.
    """
    first, second, normal = PLANES[drawn.plane]
    contour, trace = Contour(), drawn.trace or []
    for move in trace[1:]:
        begins, ends = (complex(point[first], point[second]) for point in (move.start, move.end))
        unsaid = f"{what} along a contour that does not say where it begins"
        block.refuse_if(cmath.isnan(begins), None, unsaid, "both coordinates")
        level = abs(move.end[normal] - move.start[normal]) < LEAST_MM
        block.refuse_if(not level, None, f"{what} along a contour that leaves its plane", "moves in the plane")
        if move.arc is not None:
            turn = 1 if move.arc.sweep * move.arc.normal[normal] > 0.0 else -1
            contour.append((begins, ends, complex(move.arc.center[first], move.arc.center[second]), turn))
        elif abs(ends - begins) > LEAST_MM:
            contour.append((begins, ends, None, 0))
    arc = not contour or trace[0].arc is not None
    block.refuse_if(arc, None, f"{what} along no contour", "a straight move to its start, and its elements")
    return contour


def backward(contour: Contour) -> Contour:
    """The contour from its end to its start."""
    return [(end, start, center, -turn) for start, end, center, turn in reversed(contour)]


def is_closed(contour: Contour) -> bool:
    """True if a contour ends where it begins."""
    return abs(contour[-1][1] - contour[0][0]) < CLOSED_MM


def _swept(element: Element) -> float:
    """Signed angle of an arc."""
    start, end, center, turn = element
    assert center is not None
    return turn_between(cmath.phase(start - center), cmath.phase(end - center), turn < 0)


def points_along(path: Sequence[Element]) -> list[complex]:
    """Points of a polygon that goes along a path, with both its ends."""
    points = [path[0][0]]
    for element in path:
        start, end, center, _ = element
        if center is not None and abs(start - center) > FLAT_MM:
            sweep = _swept(element)
            count = math.ceil(abs(sweep) / (2.0 * math.acos(1.0 - FLAT_MM / abs(start - center))))
            points += [center + (start - center) * cmath.rect(1.0, sweep * i / count) for i in range(1, count)]
        points.append(end)
    return points


def orientation(contour: Contour) -> int:
    """+1 for a closed contour that runs counter-clockwise, -1 for one that runs clockwise."""
    points = points_along(contour)
    return 1 if sum((a.conjugate() * b).imag for a, b in pairwise(points)) > 0.0 else -1


def path_beside(contour: Contour, left: float, rounding: float = 0.0) -> Contour:
    """Path of the tool's centre at a distance to the left of a contour, to the right where that is negative.

    Of a closed contour from the middle of its first element and to it. `rounding`: radius of the path itself in inside
    corners, where there is room. Raises `ArcError` where the tool does not fit.

    Examples
    --------
    >>> path_beside([(0j, 9 + 0j, None, 0), (9 + 0j, 9 + 9j, None, 0)], 2.0)
    [(2j, (7+2j), None, 0), ((7+2j), (7+9j), None, 0)]
    """
    if is_closed(contour):
        start, end, center, turn = contour[0]
        middle = (start + end) / 2.0
        if center is not None:
            middle = center + (start - center) * cmath.rect(1.0, _swept(contour[0]) / 2.0)
        contour = [(middle, end, center, turn), *contour[1:], (contour[-1][1], middle, center, turn)]
    path, side = Contour(), 1.0 if left > 0.0 else -1.0
    begin, rounded = contour[0][0] + 1j * left * direction(contour[0], contour[0][0]), False
    for element, following in zip(contour, [*contour[1:], None], strict=True):
        apex, corner, was_rounded, rounded = element[1], list[Element](), rounded, False
        end = after = apex + 1j * left * direction(element, apex)
        turned = cmath.phase(direction(following, apex) / direction(element, apex)) if following else 0.0
        refuse_arc_if(abs(turned) > math.pi - TURNED, "a contour that turns back on itself", "another contour")
        if following and left * turned > 0.0 and abs(turned) > TURNED:
            places = meetings(element, following, left)
            refuse_arc_if(not places, GOUGE, SMALLER)
            end = after = min(places, key=lambda place: abs(place - end))
            rounded = rounding > 0.0
        elif following and left and abs(turned) > TURNED:
            after = apex + 1j * left * direction(following, apex)
            corner = [(end, after, apex, -int(side))]
        beside = (begin, end, *element[2:])
        refuse_arc_if(not _goes_on(element, beside, left), GOUGE, SMALLER)
        if was_rounded:
            beside = _rounded(path, beside, rounding)
        path += [beside, *corner]
        begin = after
    return path


def _goes_on(element: Element, beside: Element, left: float) -> bool:
    """True if a path beside an element goes the same way, and no further on an arc."""
    start, _, center, turn = element
    if center is None:
        return ((beside[1] - beside[0]) / direction(element, start)).real > -LEAST_MM
    if abs(start - center) - turn * left < LEAST_MM:
        return False
    return abs(beside[1] - beside[0]) < LEAST_MM or abs(_swept(beside)) < abs(_swept(element)) + TURNED


def _rounded(path: Contour, element: Element, radius: float) -> Element:
    """Round the corner between the last element of a path and the next one, where there is room; the rest of that."""
    try:
        cut = cut_off(path[-1], element, radius, rounded=True)
    except ArcError:
        return element
    if cut is None:
        return element
    path[-1] = (path[-1][0], cut[0], *path[-1][2:])
    path.append(cut)
    return (cut[1], *element[1:])


def area_of(pockets: Sequence[Contour], islands: Sequence[Contour]) -> "Polygon":
    """The area that pockets enclose without their islands. Raises `ArcError` where it is not clear what that is."""
    import shapely

    contours = (*pockets, *islands)
    shapes = [shapely.Polygon([(p.real, p.imag) for p in points_along(contour)]) for contour in contours]
    closed = all(is_closed(contour) for contour in contours) and all(shape.is_valid for shape in shapes)
    refuse_arc_if(not closed, "a contour that is not closed, or crosses itself", "one that ends where it begins")
    outer, inner = (shapely.union_all(part) for part in (shapes[: len(pockets)], shapes[len(pockets) :]))
    overlap = outer.area < sum(shape.area for shape in shapes[: len(pockets)]) - FLAT_MM
    refuse_arc_if(overlap, "pockets that overlap: their order decides what is milled", "one contour for both")
    return outer.difference(inner)


def _outlines(area: "Polygon", turn: int) -> Iterator[Contour]:
    """Edges of an area, its outer ones counter-clockwise where `turn` is +1, and around its holes the other way."""
    import shapely
    from shapely.geometry.polygon import orient

    for part in shapely.get_parts(area) if not area.is_empty else ():
        shape = orient(part, turn)
        for ring in (shape.exterior, *shape.interiors):
            yield [(complex(*a), complex(*b), None, 0) for a, b in pairwise(ring.coords)]


def walls_of(
    area: "Polygon", pockets: Sequence[Contour], islands: Sequence[Contour], apart: float, turn: int, rounding: float
) -> list[Contour]:
    """Paths beside all contours, `turn` +1 with the area to their left.

    Where one gouges another, as between an island and a wall with less room than the tool, they go round what the tool
    can reach, as polygons. Raises `ArcError` where that is nothing.
    """
    import shapely

    walls, reached = list[Contour](), area.buffer(-apart + 5.0 * FLAT_MM, QUARTER)
    for contour, way in (*((pocket, turn) for pocket in pockets), *((island, -turn) for island in islands)):
        with suppress(ArcError):
            directed = contour if orientation(contour) == way else backward(contour)
            walls.append(path_beside(directed, turn * apart, rounding))
    lines = [shapely.LineString([(p.real, p.imag) for p in points_along(wall)]) for wall in walls]
    if len(walls) < len(pockets) + len(islands) or not all(reached.covers(line) for line in lines):
        fine = math.ceil(math.pi / 4.0 / math.acos(1.0 - min(FLAT_MM / apart, 1.0)))
        walls = [path_beside(ring, 0.0) for ring in _outlines(area.buffer(-apart, fine), turn)]
    refuse_arc_if(not walls, "a pocket narrower than its tool", SMALLER)
    return walls


def lead_within(room: "Polygon", path: Contour, free: int, most: float) -> float:
    """Largest radius of the quarter circles on which `pockets.along` meets a closed path in the tool's room, or 0."""
    import shapely

    begin, ahead, way = path[0][0], direction(path[0], path[0][0]), room.buffer(5.0 * FLAT_MM)
    for size in (most, most / 2.0, most / 4.0):
        center = begin + free * 1j * ahead * size
        start, end = (center + (begin - center) * free * turned for turned in (-1j, 1j))
        points = points_along([(start, begin, center, free), (begin, end, center, free)])
        if way.covers(shapely.LineString([(p.real, p.imag) for p in points])):
            return size
    return 0.0


def _rings(room: "Polygon", step: float, turn: int) -> list[Contour]:
    """Rings within the tool's room, the innermost first, each from its corner nearest to the one before."""
    rings, inner, place, course = list[Contour](), room.buffer(-step, QUARTER), 0j, list[Contour]()
    while not inner.is_empty:
        rings += _outlines(inner.simplify(FLAT_MM), turn)
        refuse_arc_if(len(rings) > MOST_LAYERS, "a pocket in too many rings", "a larger step")
        inner = inner.buffer(-step, QUARTER)
    for ring in reversed(rings):
        near = min(range(len(ring)), key=lambda index: abs(ring[index][0] - place))
        place = ring[near][0]
        course.append([*ring[near:], *ring[:near]])
    return course


def clear_area(
    room: "Polygon", walls: list[Contour], step: float, heights: Heights, feeds: Feeds, turn: int, top: float = math.inf
) -> Iterator[Cut]:
    """Clear layer by layer: rings a step apart from the innermost one out, last the walls of the tool's `room`.

    The tool goes straight from ring to ring where that stays within its room, otherwise up to the safe height.
    `top`: of the work, where that is not just below the safe height.
    """
    import shapely

    course, way = [*_rings(room, step, turn), *walls], room.buffer(5.0 * FLAT_MM)
    links = [(before[-1][1], after[0][0]) for before, after in pairwise(course)]
    stays = [way.covers(shapely.LineString([(p.real, p.imag) for p in link])) for link in links]
    (floors, safe, ahead), (feed, down), above = heights, feeds, min(heights[1], top)
    for floor in floors:
        for ring, follows in zip(course, [False, *stays], strict=True):
            if follows:
                yield ring[0][0], floor, feed, None, 0
            else:
                yield ring[0][0], safe, None, None, 0
                yield ring[0][0], min(above + ahead, safe), None, None, 0
                yield ring[0][0], floor, down, None, 0
            for _, place, center, way_round in ring:
                yield place, floor, feed, center, way_round
            above_it = ring[-1][1]
        yield above_it, safe, None, None, 0
        above = floor
