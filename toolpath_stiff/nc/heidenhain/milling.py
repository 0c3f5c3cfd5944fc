"""Milled bores, pockets, slots and studs (cycles 4, 5, 208, 251, 252, 253, 256, 257), by the rings of `pockets`.

HEIDENHAIN, user's manual "Cycles" of the iTNC 530 and the TNC 640, "Fixed cycles: pocket milling, stud milling, slot
milling", "Bore milling (cycle 208)"; of the TNC 426, "Pocket milling (cycle 4)", "Circular pocket (cycle 5)". Walls,
floors, infeeds and feeds are theirs. Units of the program, mm/min.
"""

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

from toolpath_stiff.nc.contouring.contour import mill, tool_radius
from toolpath_stiff.nc.contouring.points import in_plane, inch_tenths, present
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.pockets import LEAST_MM, Cut, Feeds, Outline, edge, pocket, sink
from toolpath_stiff.nc.state import CurrentBlock, State, Values

MAX, AUTO = -1.0, -2.0  # FMAX and FAUTO as values of a parameter
_ALL = ("Q200", "Q201", "Q203", "Q202", "Q206", "Q207")
MILLED = {
    4: (*_ALL, "Q218", "Q219", "Q351"), 5: (*_ALL, "Q220", "Q351"),
    208: ("Q200", "Q201", "Q203", "Q206", "Q334", "Q335"),
    251: (*_ALL, "Q218", "Q219"), 252: (*_ALL, "Q223"), 253: (*_ALL, "Q218", "Q219"),
    256: (*_ALL, "Q218", "Q219", "Q424", "Q425"), 257: (*_ALL, "Q222", "Q223"),
}  # fmt: skip
OLD, BORE, SLOT, STUDS = (4, 5), 208, 253, (256, 257)
# Where the tool stands at the call (Q367), from the middle: half lengths and half widths along, half widths across; in
# slots 2 and 3 are the centres of the ends.
PLACES = ((0, 0, 0), (-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1))
SLOT_PLACES = ((0, 0, 0), (-1, 0, 0), (-1, 1, 0), (1, -1, 0), (1, 0, 0))
BESIDE_MM = 2.0  # from the blank of a stud to the tool (manual, cycle 256: "2 mm to the right of the unmachined stud")
OLD_OVERLAP = 1.4  # of cycles 4 and 5, in radii of the tool (machine parameter 7430, at most 1.414)
MOST_ROUNDS = 10_000
INSIDE = "the way into and within milled bores, pockets and slots, and to studs, is assumed: manuals only draw it"


def mill_form(state: State, block: CurrentBlock, number: int, values: Values) -> None:
    """Carry out a milling cycle at the present point; in units of the program."""
    unit, stud, tenths = state.length_scale, number in STUDS, inch_tenths(state)
    radius, given = tool_radius(state, block, None) / unit / state.plain.scale, defaultdict(float, values)
    place, high = in_plane(state, present(state)) / unit, present(state)[PLANES[state.plane][2]] / unit
    path = _form(block, number, given, place).grown(radius if stud else -radius)
    infeed, hole = given["Q334" if number == BORE else "Q202"], given["Q342"]
    overlap = given["Q370"] or (OLD_OVERLAP if number in OLD else 1.0)
    rings = max(path.width, given["Q424"], given["Q425"], given["Q222"]) / (overlap * radius or math.inf)
    rounds = -given["Q201"] * max(rings, 1.0) / (infeed or 1.0)
    core = number == BORE and given["Q335"] > 4.0 * radius and not hole
    several = number == BORE and given["Q370"] and 2.0 * path.width > hole + 2.0 * given["Q370"] * radius
    for name, wrong, problem, expected in (
        ("", radius and min(path.length, path.width) < 0.0, "is narrower than its tool", "a smaller tool"),
        ("", state.turn < 0 or state.plain.mirrored, "under M4 or cycle 8: where climb milling goes then", "M3"),
        ("", not 0.0 <= rounds <= MOST_ROUNDS, "makes too many rounds", "larger infeeds and steps"),
        ("Q215", stud and "Q215" in values and (given["Q368"] or given["Q369"]), "finishes a stud", "no allowances"),
        ("Q439", given["Q439"], "gives feeds of the cutting edge", "0"),
        ("Q335", radius and core, "is more than two tools: a core would be left", "Q342, the hole before it"),
        ("Q370", radius and several, "mills several helices, in an order that is not published", "0"),
        ("Q370", given["Q370"] < 0.0, "is no overlap", "0.1 to 1.999"),
        ("", given["Q206" if number == BORE else "Q207"] == MAX, "mills at FMAX", "a feed"),
    ):
        block.refuse_if(wrong, name, problem, expected)
    if not radius:  # in a check, behind the error that it is not known
        return
    state.warn_once(INSIDE, block.line)
    known = {MAX: None, AUTO: state.plain.tool_feed or 0.0}
    down, feed, fine = (known.get(given[name], given[name] * tenths) for name in ("Q206", "Q207", "Q385"))
    turn = (1 if given["Q351"] >= 0.0 else -1) * (-1 if stud else 1)
    safe, far = (given["Q203"] + v for v in (given["Q200"], max(given["Q204"], given["Q200"])))
    ways = ((place, max(high, safe)), (path.middle, max(high, safe)), (path.middle, safe))
    cuts: list[Cut] = [(*way, None, None, 0) for way in ways]
    cuts += _cuts(number, given, path, radius, overlap * radius, (feed or 0.0, down), fine or feed or 0.0, turn)
    cuts.append((path.middle, far, None, None, 0))
    mill(state, block, ((p * unit, h * unit, rate, None if c is None else c * unit, t) for p, h, rate, c, t in cuts))


def _form(block: CurrentBlock, number: int, given: Values, here: complex) -> Outline:
    """Outline of a form by its parameters, about its middle."""
    diameter = 2.0 * given["Q220"] if number == 5 else given["Q335"] if number == BORE else given["Q223"]
    length, width = (abs(given[name]) or diameter for name in ("Q218", "Q219"))
    corner = min(length, width) / 2.0 if diameter or number == SLOT else min(given["Q220"], length / 2.0, width / 2.0)
    block.refuse_if(number == SLOT and length < width, "Q218", "is shorter than the slot is wide", "the length")
    place = given["Q367"]
    block.refuse_if(place not in range(len(PLACES)), "Q367", "is no position", "0 to 4")
    lengths, widths, across = (SLOT_PLACES if number == SLOT else PLACES)[int(place)]
    form = Outline(here, length, width, corner, math.radians(given["Q374" if number == SLOT else "Q224"]))
    return replace(form, middle=form.at(-(lengths * length + widths * width) / 2.0, -across * width / 2.0))


def floors_of(top: float, bottom: float, most: float) -> list[float]:
    """Heights of infeeds, the last one shorter; 0: one infeed."""
    count = math.ceil((top - bottom) / most - LEAST_MM) if most > 0.0 else 1
    return [top - index * most for index in range(1, count)] + [bottom]


def _cuts(
    number: int, given: Values, path: Outline, radius: float, step: float, feeds: Feeds, fine: float, turn: int
) -> Iterator[Cut]:
    """Cuts of a form: of pockets roughing (Q215 0 and 1), then what has allowances (0 and 2), walls first."""
    top, bottom, ahead, part = given["Q203"], given["Q203"] + given["Q201"], given["Q200"], given["Q215"]
    half, side = path.width / 2.0, given["Q368"]
    floors = floors_of(top, bottom + given["Q369"], given["Q202"])
    if number == BORE:
        yield from sink(path, (top + ahead, bottom), feeds[1], turn, ("helix", half, given["Q334"]))
        yield path.middle, top + ahead, None, None, 0
    elif number in STUDS:
        path = path.grown(side)
        blank = [(given[name] or given["Q222"]) + 2.0 * radius for name in ("Q424", "Q425")]
        more = [max(size - own, 0.0) for size, own in zip(blank, (path.length, path.width), strict=True)]
        rounds = max(1, math.ceil(max(more) / 2.0 / step - LEAST_MM))
        for floor, index in ((floor, index) for floor in floors for index in range(rounds - 1, -1, -1)):
            along, across = (share * index / rounds for share in more)
            ring = replace(path, length=path.length + along, width=path.width + across)
            lead = (max(blank[1], path.width) / 2.0 + BESIDE_MM - ring.width / 2.0) / 2.0
            yield from edge(ring, ([floor], top + ahead, 0.0), feeds, turn, -lead)
    else:
        if part != 2.0:
            rough = path.grown(-min(side, path.length / 2.0, half))
            yield from pocket(rough, step, (floors, top + ahead, ahead), feeds, turn, ("", 0.0, 0.0))
        lead = min(radius, path.length / 2.0, half)
        if part != 1.0 and side and lead > LEAST_MM:
            heights = floors_of(top, bottom, given["Q338"]), top + ahead, ahead
            yield from edge(path, heights, (fine, feeds[1]), turn, lead)
        if part != 1.0 and given["Q369"]:
            yield from pocket(path, step, ([bottom], top + ahead, ahead), (fine, feeds[1]), turn, ("", 0.0, 0.0))
