"""Pockets and lines of contours (SL cycles 14, 20, 22 to 25): contours of labels, milled layer by layer.

HEIDENHAIN, user's manual "Cycles" of the iTNC 530, "Fixed cycles: contour pocket, contour trains".
"The TNC recognizes a pocket if the tool path lies inside the contour, an island if it lies outside." Walls, floors,
infeeds, feeds and directions are the cycles'; rings that clear the inside, and all leads, are ours
(`contour_pockets`).
"""

import math
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress

from toolpath_stiff.nc import contour_pockets as areas
from toolpath_stiff.nc.compensation import GOUGE, SMALLER
from toolpath_stiff.nc.contouring.contour import mill, tool_radius
from toolpath_stiff.nc.contouring.drawing import backward, is_closed, path_beside
from toolpath_stiff.nc.contouring.points import in_plane, inch_tenths, present
from toolpath_stiff.nc.elements import Contour
from toolpath_stiff.nc.geometry import PLANES, GeometryError
from toolpath_stiff.nc.heidenhain.milling import AUTO, BESIDE_MM, INSIDE, MAX, MOST_ROUNDS, floors_of
from toolpath_stiff.nc.pockets import Cut, Feeds, along
from toolpath_stiff.nc.state import CurrentBlock, State, Values
from toolpath_stiff.nc.tables import tool_of

Contours = list[tuple[Contour, int]]  # with +1 of RL, -1 of RR, 0
Radii = tuple[float, float]  # of the tool, and of the one that milled before it (Q18); nan: not known
ROUGH, FLOOR, SIDE, TRAIN = 22, 23, 24, 25


def mill_contours(state: State, block: CurrentBlock, number: int, own: Values) -> None:
    """Carry out cycle 22, 23, 24 or 25 on the contours of cycle 14; in mm."""
    plain, unit = state.plain, state.length_scale
    radius = tool_radius(state, block, None) / plain.scale
    v = defaultdict(float, own if number == TRAIN else plain.contour_data | own)
    changed = next((name for name, value in v.items() if plain.parameters.get(name, value) != value), None)
    block.refuse_if(changed, None, f"after {changed} was set again behind the cycle", "its value in CYCL DEF")
    block.refuse_if("Q5" not in v or not plain.labels, None, "calls a cycle of contours", "cycles 14 and 20 before it")
    coarse = tool_of(state.tools, int(v["Q18"])).diameter / 2.0 / plain.scale
    for name, wrong, problem, expected in (
        ("Q1", v["Q1"] >= 0.0, "is not below the surface", "a negative depth"),
        ("Q2", number in (ROUGH, FLOOR) and not 0.1 <= v["Q2"] < 2.0, "is no overlap", "0.1 to 1.999"),
        ("Q7", v["Q7"] < v["Q5"] + v["Q6"], "is below the surface and its clearance", "a safe height"),
        ("Q12", v["Q12"] == MAX, "mills at FMAX", "a feed"),
        ("Q18", v["Q18"] and math.isnan(coarse), "names a tool of unknown radius", "it in a tool table (--tools FILE)"),
        ("Q10", v["Q1"] < -MOST_ROUNDS * abs(v["Q10"] or v["Q1"]), "makes too many infeeds", "a larger one"),
        ("M4 or cycle 8", state.turn < 0 or plain.mirrored, "decides where climb milling goes", "M3"),
    ):
        block.refuse_if(wrong, None, f"{name} {problem}", expected)
    if not radius:  # in a check, behind the error that it is not known
        return
    state.warn_once(INSIDE, block.line)
    rates = {MAX: None, AUTO: plain.tool_feed or 0.0}
    down, feed = (rates.get(v[name], v[name] * inch_tenths(state)) for name in ("Q11", "Q12"))
    v |= {name: v[name] * unit for name in ("Q1", "Q3", "Q4", "Q5", "Q6", "Q7", "Q8", "Q10", "Q14")}
    with block.placing():
        assert plain.drawn is not None
        contours = [plain.drawn(block, label) for label in (plain.labels[:1] if number == TRAIN else plain.labels)]
        how = (radius, coarse), (feed or 0.0, down), contours
        cuts = list(_train(state, block, v, *how) if number == TRAIN else _pocket(state, block, number, v, *how))
    (*_, normal), here = PLANES[state.plane], present(state)
    above = [(place, max(here[normal], v["Q7"]), None, None, 0) for place in (in_plane(state, here), cuts[0][0])]
    mill(state, block, [*above, *cuts])
    plain.unknown |= {*PLANES[state.plane][:2]}  # a machine parameter says whether the tool goes back to where it was


def _pocket(
    state: State, block: CurrentBlock, number: int, v: Values, radii: Radii, feeds: Feeds, contours: Contours
) -> Iterator[Cut]:
    """Pockets and islands: RL and RR say on which side of its contour the tool is."""
    pockets, islands, walls = list[Contour](), list[Contour](), list[Contour]()
    turn, radius, apart = 1 if v["Q9"] >= 0.0 else -1, radii[0], radii[0] + v["Q14" if number == SIDE else "Q3"]
    for contour, side in contours:
        wrong = not side or not is_closed(contour)
        block.refuse_if(wrong, None, "mills a contour that is open, or has no side", "RL or RR, its end at its start")
        (pockets if side * areas.orientation(contour) > 0 else islands).append(contour)
        with suppress(GeometryError):  # climb milling has the tool to the left of its path
            directed = contour if side == turn else backward(contour)
            walls.append(path_beside(state, block, directed, turn * apart, v["Q8"]))
    block.refuse_if(not pockets, None, "mills islands without a pocket around them", "the pocket's label, its side")
    area, all_fit = areas.area_of(pockets, islands), len(walls) == len(contours)
    if number == ROUGH and v["Q18"]:  # what that tool has left, as far as this one reaches
        area, all_fit = areas.left_by(area, radii[1], radius, v["Q3"]), False
    walls, room = areas.walls_within(area, walls if all_fit else [], apart, turn), area.buffer(-apart)
    block.refuse_if(not walls, None, "mills a pocket narrower than its tool, or nothing left", "a smaller tool")
    bottom = v["Q5"] + v["Q1"]
    floors = [bottom] if number == FLOOR else floors_of(v["Q5"], bottom + v["Q4"] * (number == ROUGH), abs(v["Q10"]))
    heights = floors, v["Q7"], v["Q6"]
    if number != SIDE:
        yield from areas.clear_area(room, walls, v["Q2"] * radius, heights, feeds, turn, v["Q5"])
    for wall in walls if number == SIDE else ():
        yield from along(wall, turn, heights, feeds, areas.lead_within(room, wall, turn, radius), top=v["Q5"])


def _train(
    state: State, block: CurrentBlock, v: Values, radii: Radii, feeds: Feeds, contours: Contours
) -> Iterator[Cut]:
    """Along one contour, open or closed: in the direction of Q15 (0: to and fro); leads on quarters of a circle."""
    (contour, side), way = contours[0], v["Q15"]
    block.refuse_if(not side and way <= 0.0, None, "chooses the direction of a contour without a side", "Q15=+1")
    if side and side != (1 if way >= 0.0 else -1):
        contour, side = backward(contour), -side
    apart, above = radii[0] + v["Q3"], v["Q5"]
    for floor in floors_of(v["Q5"], v["Q5"] + v["Q1"], abs(v["Q10"])):
        path = path_beside(state, block, contour, side * apart) if side else contour
        gouges = side and areas.line_along(path).distance(areas.line_along(contour)) < apart - areas.NEAR_MM
        block.refuse_if(gouges, None, GOUGE, SMALLER)
        yield from along(path, side, ([floor], v["Q7"], BESIDE_MM), feeds, radii[0], top=above)
        above = floor
        if not way:
            contour, side = backward(contour), -side
