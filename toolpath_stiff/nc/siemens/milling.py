"""Milling cycles of Siemens' language, expanded to their moves: pockets, spigots, faces.

SIEMENS, SINUMERIK 840D, Programming Guide Cycles (11/2002), "Milling cycles" (POCKET1 to POCKET4, CYCLE71, CYCLE76,
CYCLE77); 840D sl, Job Planning, "External programming of cycles" (CYCLE61, the digits of GMODE, DMODE and AMODE).
Walls, floors and their allowances are the cycle's; the way over what lies between is ours, which is said once.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator

from toolpath_stiff.nc.contouring.contour import mill, tool_radius
from toolpath_stiff.nc.contouring.points import in_plane, outside_contour, present
from toolpath_stiff.nc.pockets import Cut, Outline, edge, layers, pocket
from toolpath_stiff.nc.siemens.cycles import parameters
from toolpath_stiff.nc.state import CurrentBlock, State, Values

OUR_WAY = (
    "milling cycles: walls, floors and allowances are the program's; the way of the tool between them and the heights "
    "of the infeeds (equal ones, from the safety distance on) are assumed, since the manual does not give them"
)
STEP_SHARE = 0.8  # of the diameter: the step to the side where MIDA is not given
LEAD_MM = 2.0  # radius on which a finishing cut reaches the wall of a pocket, if there is space
BOTH, ROUGH, FINISH, WALL = 0, 1, 2, 4  # units of VARI
OLD = ("POCKET1", "POCKET2")
PLUNGES = ("", "", "helix", "ramp")  # tens of VARI of pockets: at rapid, at feed, and on the way down


def digit(value: float, place: int) -> int:
    """A decimal digit, counted from the last."""
    return int(f"{int(abs(value)):09d}"[-1 - place])


def begin(state: State, block: CurrentBlock, code: str) -> tuple[Values, float]:
    """Values of a milling cycle, 0 where not given, and the tool's radius; FLOOR: DP with its allowance."""
    block.refuse_if("MCALL" in block.codes, None, f"{code} behind MCALL", "a call at each place")
    values: Values = defaultdict(float, parameters(state, block, code))
    missing = next((name for name in ("RTP", "RFP", "VARI") if name not in values), None)
    block.refuse_if(missing, None, f"{code} without {missing}", "its parameters up to VARI")
    if values["DPR"] or digit(values["AMODE"], 0) == 1:
        values["DP"] = values["RFP"] - abs(values["DPR"] or values["DP"])
    values |= {"TOP": values["RFP"] + abs(values["SDIS"]), "FLOOR": values["DP"] + values["FALD"]}
    heights = [values[name] for name in ("RTP", "TOP", "FLOOR", "DP")]
    crossed = heights != sorted(heights, reverse=True) or values["DP"] > values["RFP"]
    block.refuse_if(crossed, None, f"{code}: RTP, RFP, SDIS, DP and FALD cross", "RTP at the top, DP at the bottom")
    kind, kinds = digit(values["VARI"], 0), (ROUGH, FINISH, WALL)
    known = values["VARI"] in (BOTH, ROUGH, FINISH) if code in OLD else kind in kinds
    block.refuse_if(not known, "VARI", "is no roughing (1) or finishing (2, 4)", "one of them")
    corners = any(digit(values["GMODE"], place) > 1 for place in range(6))
    block.refuse_if(corners, "GMODE", "measures from a corner, or mills what another tool has left", "11100")
    outside_contour(state, block, code, state.plain.side)
    radius = tool_radius(state, block, code) / state.plain.scale
    block.refuse_if(not radius, None, f"{code} with a tool of no radius", "D1 before it, and its diameter")
    state.warn_once(OUR_WAY, block.line)
    return values, radius


def approached(state: State, values: Values, start: complex) -> list[Cut]:
    """Rapids at the retraction plane to above the start of a path, and down to the safety distance."""
    known = [] if state.plain.unknown else [(in_plane(state, present(state)), "RTP")]
    return [(place, values[height], None, None, 0) for place, height in (*known, (start, "RTP"), (start, "TOP"))]


def mill_area(state: State, block: CurrentBlock, code: str) -> None:
    """POCKET1 to POCKET4, CYCLE61, CYCLE71, CYCLE76, CYCLE77: at the place that their parameters give."""
    values, radius = begin(state, block, code)
    path = list(PATHS[code](state, block, code, values, radius))
    mill(state, block, [*approached(state, values, path[0][0]), *path, (path[-1][0], values["RTP"], None, None, 0)])


def _outline(block: CurrentBlock, code: str, values: Values) -> Outline:
    """The rectangle or circle of a pocket or spigot."""
    length, width, corner = values["LENG"], values["WID"], values["CRAD"]
    if values["PRAD"]:  # of a spigot its diameter
        length = width = values["PRAD"] * (2.0 if code in ("POCKET2", "POCKET4") else 1.0)
        corner = length / 2.0
    fits = 0.0 <= corner <= min(length, width) / 2.0 + 1e-9 and min(length, width) > 0.0
    block.refuse_if(not fits, None, f"{code} measured from a corner, or of no size", "sizes above 0, from the middle")
    return Outline(complex(values["_PA"], values["_PO"]), length, width, corner, math.radians(values["STA"]))


def _turn(state: State, block: CurrentBlock, values: Values, inside: int = 1) -> int:
    """The way round a pocket (`inside`) or a spigot (-1) by CDIR: 0 climb milling, 1 conventional, 2 as G2, 3 as G3."""
    climb, way = -inside if state.turn < 0 else inside, values["CDIR"]
    block.refuse_if(way not in (0.0, 1.0, 2.0, 3.0), "CDIR", "is no milling direction", "0 to 3")
    return (climb, -climb, -1, 1)[int(way)]


def _step(state: State, block: CurrentBlock, values: Values, radius: float) -> float:
    """Step to the side: MIDA in mm or per cent of the diameter, else four fifths of it."""
    unit = 2.0 * radius / 100.0 if digit(values["AMODE"], 1) else state.length_scale
    block.refuse_if(values["MIDA"] * unit > 2.0 * radius, "MIDA", "is more than the tool's diameter", "less")
    return abs(values["MIDA"]) * unit or STEP_SHARE * 2.0 * radius


def _pocket(state: State, block: CurrentBlock, code: str, values: Values, radius: float) -> Iterator[Cut]:
    """Rough with the allowances, or finish the wall (where FAL was left) and the floor (FALD)."""
    outline, turn = _outline(block, code, values), _turn(state, block, values)
    step, kind, way = _step(state, block, values, radius), digit(values["VARI"], 0), digit(values["VARI"], 1)
    inner, wall = (outline.grown(-radius - values["FAL"] * share) for share in (kind == ROUGH, 0.0))
    size, slope, least = values["RAD1"] * state.length_scale, values["DP1"], min(inner.length, inner.width)
    if PLUNGES[way % len(PLUNGES)] == "ramp":
        size, slope = inner.length / 2.0, math.radians(min(values["RAD1"], 80.0))
    for name, wrong, problem, expected in (
        ("AP1", not digit(values["GMODE"], 4) and values["AP1"] + values["AP2"] + values["AD"], "is of a pocket", "0"),
        ("DMODE", code == "POCKET4" and digit(values["DMODE"], 2), "counts PRAD otherwise", "a radius"),
        ("VARI", way > 3 or values["VARI"] >= 100.0, "plunges in a way that is not known", "1 to 34"),
        ("VARI", kind == FINISH and not values["FAL"] + values["FALD"], "finishes nothing", "FAL, FALD"),
        ("VARI", way > 1 and not (size > 0.0 < slope), "plunges without its sizes", "RAD1, DP1"),
        (None, least < 0.0, f"{code} narrower than the tool", "a smaller tool"),
    ):
        block.refuse_if(wrong, name, problem, expected)
    heights = layers(values["TOP"], values["FLOOR"], values["MID"]), values["TOP"], values["TOP"] - values["RFP"]
    feed, down = values["FFP1"], values["FFD"]
    yield outline.middle, values["TOP"], None, None, 0
    if kind == ROUGH:
        yield from pocket(inner, step, heights, (feed, down if way else None), turn, (PLUNGES[way], size, slope))
    elif kind == WALL or values["FAL"]:
        yield from edge(wall, heights, (feed, None), turn, min(max(LEAD_MM, values["FAL"]), least / 2.0))
    if kind == FINISH and values["FALD"]:
        yield from pocket(wall, step, ([values["DP"]], *heights[1:]), (feed, down), turn, ("", 0.0, 0.0))


def _old_pocket(state: State, block: CurrentBlock, code: str, values: Values, radius: float) -> Iterator[Cut]:
    """POCKET1, POCKET2: rough with FAL at the wall, then finish the wall; VARI 0: both."""
    kind, heights = values["VARI"], (values["TOP"], values["TOP"] - values["RFP"])
    block.refuse_if(values["CDIR"] not in (2.0, 3.0), "CDIR", "is no milling direction", "2, 3")
    block.refuse_if(values["SSF"], "SSF", "changes the speed within the cycle", "two calls: VARI 1, S, VARI 2")
    if kind != FINISH:
        yield from _pocket(state, block, code, values | {"VARI": 11.0}, radius)
    if kind != ROUGH:
        wall, feed = _outline(block, code, values).grown(-radius), values["FFP2"] or values["FFP1"]
        lead = min(max(LEAD_MM, values["FAL"]), wall.length / 2.0, wall.width / 2.0)
        block.refuse_if(lead < 0.0, None, f"{code} narrower than the tool", "a smaller tool")
        floors = layers(values["TOP"], values["DP"], values["MIDF"] or values["MID"])
        yield from edge(wall, (floors, *heights), (feed, values["FFD"]), _turn(state, block, values), lead)


def _spigot(state: State, block: CurrentBlock, code: str, values: Values, radius: float) -> Iterator[Cut]:
    """Once round it at each depth: what the blank has beyond the tool's width is taken to be gone."""
    rough, outline = digit(values["VARI"], 0) == ROUGH, _outline(block, code, values)
    floors = layers(values["TOP"], values["FLOOR" if rough else "DP"], values["MID"])
    heights, turn = (floors, values["TOP"], values["TOP"] - values["RFP"]), _turn(state, block, values, -1)
    path = outline.grown(radius + values["FAL"] * rough)
    yield from edge(path, heights, (values["FFP1"], values["FFD"]), turn, -radius)


def _face(state: State, block: CurrentBlock, code: str, values: Values, radius: float) -> Iterator[Cut]:
    """Rows over a rectangle from its corner, in one direction or to and fro, layer by layer."""
    rows, absolute = digit(values["VARI"], 1), [code == "CYCLE61" and digit(values["AMODE"], n) for n in (3, 4)]
    size = values["LENG"] - values["_PA"] * absolute[0], values["WID"] - values["_PO"] * absolute[1]
    block.refuse_if(not all(size), None, f"{code} without its size", "LENG and WID")
    block.refuse_if(values["LIM"], "LIM", "limits the face by walls", "0")
    block.refuse_if(rows not in (1, 2, 3, 4), "VARI", "names no direction of the rows", "11 to 42")
    run, across = size[::-1] if rows in (2, 4) else size
    over, count = radius + abs(values["FDP"]), math.ceil(abs(across) / _step(state, block, values, radius) - 1e-9)
    face = Outline(complex(values["_PA"], values["_PO"]), 0.0, 0.0, 0.0, math.radians(values["STA"]))
    rough = digit(values["VARI"], 0) == ROUGH
    for floor in layers(values["TOP"], values["FLOOR" if rough else "DP"], values["MID"] * rough):
        for index in range(count):
            ends = [math.copysign(end, end * run) for end in (-over, abs(run) + over)]
            row, way = across * (index + 0.5) / count, -1 if rows > 2 and index % 2 else 1
            first, last = (face.at(row, end) if rows in (2, 4) else face.at(end, row) for end in ends[::way])
            if rows < 3 or not index:  # from above, beside the face
                yield first, values["TOP"], None, None, 0
                yield first, floor, None, None, 0
            yield first, floor, values["FFP1"], None, 0
            yield last, floor, values["FFP1"], None, 0
            if rows < 3 or index + 1 == count:
                yield last, values["TOP"], None, None, 0


PATHS: dict[str, Callable[[State, CurrentBlock, str, Values, float], Iterator[Cut]]] = {
    "POCKET1": _old_pocket, "POCKET2": _old_pocket, "POCKET3": _pocket, "POCKET4": _pocket,
    "CYCLE61": _face, "CYCLE71": _face, "CYCLE76": _spigot, "CYCLE77": _spigot,
}  # fmt: skip
