"""Pockets and lines of contours (SL cycles 14, 20, 22 to 25): contours of labels, milled layer by layer.

HEIDENHAIN, user's manual "Cycles" of the iTNC 530, "Fixed cycles: contour pocket, contour trains".
"The TNC recognizes a pocket if the tool path lies inside the contour, an island if it lies outside." Walls, floors,
infeeds, feeds and directions are the cycles'; rings that clear the inside, and all leads, are ours (`contour_pockets`).
"""

from collections import defaultdict
from collections.abc import Iterator

from toolpath_stiff.nc.contour_pockets import (
    Contour,
    area_of,
    backward,
    clear_area,
    is_closed,
    lead_within,
    orientation,
    path_beside,
    walls_of,
)
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.heidenhain.contour import mill, tool_radius
from toolpath_stiff.nc.heidenhain.milling import AUTO, BESIDE_MM, MAX, MOST_ROUNDS, Values, floors_of, note_inside
from toolpath_stiff.nc.heidenhain.points import in_plane, inch_tenths, present
from toolpath_stiff.nc.pockets import Cut, along
from toolpath_stiff.nc.state import CurrentBlock, State

DATA = ("Q1", "Q2", "Q3", "Q4", "Q5", "Q6", "Q7", "Q8", "Q9")
CYCLES = {
    20: DATA, 22: ("Q10", "Q11", "Q12"), 23: ("Q11", "Q12"), 24: ("Q9", "Q10", "Q11", "Q12", "Q14"),
    25: ("Q1", "Q3", "Q5", "Q7", "Q10", "Q11", "Q12", "Q15"),
}  # fmt: skip
# What may stand beside them: Q18, Q438 tools that have roughed before, Q19 feed of the way down, Q208 of the way up,
# Q401 feed in full cuts, Q404 how what a larger tool left is cleared.
MORE = {"Q18", "Q19", "Q208", "Q401", "Q404", "Q438"}
ROUGH, FLOOR, SIDE, TRAIN = 22, 23, 24, 25


def define(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 20: what the next cycles share; 22 to 25: keep the cycle for its calls."""
    number = int(code.removeprefix("CYCL DEF "))
    values = {letter: block.take(letter) or 0.0 for letter in list(block.free)}
    missing = next((name for name in CYCLES[number] if name not in values), None)
    block.refuse_if(missing, None, f"without {missing}", ", ".join(CYCLES[number]))
    unknown = next((name for name in values if name not in CYCLES[number] and name not in MORE), None)
    block.refuse_if(unknown, unknown, f"is no parameter of {code} that is known")
    if number == 20:
        state.plain.contour_data = values
    else:
        state.plain.cycle, state.plain.modal = (number, values), False


def mill_contours(state: State, block: CurrentBlock, number: int, own: Values) -> None:
    """Carry out cycle 22, 23, 24 or 25 on the contours of cycle 14; in mm."""
    plain, unit = state.plain, state.length_scale
    data = {} if number == TRAIN else plain.contour_data
    radius, v = tool_radius(state, block, None) / plain.scale, defaultdict(float, data | own)
    changed = next((name for name, value in v.items() if plain.parameters.get(name, value) != value), None)
    block.refuse_if(changed, None, f"after {changed} was set again behind the cycle", "its value in CYCL DEF")
    block.refuse_if("Q5" not in v or not plain.labels, None, "calls a cycle of contours", "cycles 14 and 20 before it")
    for name, wrong, problem, expected in (
        ("Q1", v["Q1"] >= 0.0, "is not below the surface", "a negative depth"),
        ("Q2", number in (ROUGH, FLOOR) and not 0.1 <= v["Q2"] < 2.0, "is no overlap", "0.1 to 1.999"),
        ("Q7", v["Q7"] < v["Q5"] + v["Q6"], "is below the surface and its clearance", "a safe height"),
        ("Q12", v["Q12"] == MAX, "mills at FMAX", "a feed"),
        ("Q18", v["Q18"] > 0.0, "mills what another tool has left, which the control finds out", "0"),
        (
            "",
            v["Q1"] and abs(v["Q1"]) > MOST_ROUNDS * abs(v["Q10"] or v["Q1"]),
            "makes too many infeeds",
            "larger ones",
        ),
        ("", state.turn < 0 or plain.mirrored, "under M4 or cycle 8: where climb milling goes then", "M3"),
    ):
        block.refuse_if(wrong, name if name in block.values else None, f"{name} {problem}".strip(), expected)
    if not radius:  # in a check, behind the error that it is not known
        return
    note_inside(state, block)
    rates = {MAX: None, AUTO: plain.tool_feed or 0.0}
    down, feed = (rates.get(v[name], v[name] * inch_tenths(state)) for name in ("Q11", "Q12"))
    lengths = {name: v[name] * unit for name in ("Q1", "Q3", "Q4", "Q5", "Q6", "Q7", "Q8", "Q10", "Q14")}
    with block.placing():
        cuts = list(_cuts(state, block, number, v | lengths, radius, (feed or 0.0, down)))
    (*_, normal), here, safe = PLANES[state.plane], present(state), lengths["Q7"]
    way: list[Cut] = [(place, max(here[normal], safe), None, None, 0) for place in (in_plane(state, here), cuts[0][0])]
    mill(state, block, [*way, *cuts])
    plain.unknown |= {*PLANES[state.plane][:2]}  # a machine parameter says whether the tool goes back to where it was


def _cuts(
    state: State, block: CurrentBlock, number: int, v: Values, radius: float, feeds: tuple[float, float | None]
) -> Iterator[Cut]:
    drawn, bottom = state.plain.drawn, v["Q5"] + v["Q1"]
    assert drawn is not None
    contours = [drawn(block, label) for label in (state.plain.labels[:1] if number == TRAIN else state.plain.labels)]
    if number == TRAIN:
        yield from _train(block, *contours[0], v, radius, feeds)
        return
    block.refuse_if(any(not side for _, side in contours), None, "mills a contour without a side", "RL or RR")
    pockets, islands = (
        [contour for contour, side in contours if is_closed(contour) and side * orientation(contour) == way]
        for way in (1, -1)
    )
    block.refuse_if(len(pockets + islands) < len(contours), None, "mills a pocket that is not closed", "its end")
    block.refuse_if(not pockets, None, "mills islands without a pocket around them", "the pocket's label, its side")
    turn, area = 1 if v["Q9"] >= 0.0 else -1, area_of(pockets, islands)
    apart = radius + v["Q14" if number == SIDE else "Q3"]
    walls, room = walls_of(area, pockets, islands, apart, turn, v["Q8"]), area.buffer(-apart)
    if number == SIDE:
        heights = floors_of(v["Q5"], bottom, abs(v["Q10"])), v["Q7"], v["Q6"]
        for wall in walls:
            yield from along(wall, turn, heights, feeds, lead_within(room, wall, turn, radius), top=v["Q5"])
        return
    floors = floors_of(v["Q5"], bottom + v["Q4"], abs(v["Q10"])) if number == ROUGH else [bottom]
    yield from clear_area(room, walls, v["Q2"] * radius, (floors, v["Q7"], v["Q6"]), feeds, turn, v["Q5"])


def _train(
    block: CurrentBlock, contour: Contour, side: int, v: Values, radius: float, feeds: tuple[float, float | None]
) -> Iterator[Cut]:
    """Along one contour, open or closed: in the direction of Q15 (0: to and fro); leads on quarters of a circle."""
    way = 1 if v["Q15"] >= 0.0 else -1
    block.refuse_if(not side and v["Q15"] <= 0.0, None, "chooses the direction of a contour without a side", "Q15=+1")
    if side and side != way:  # climb milling has the tool to the left of its path
        contour, side = backward(contour), -side
    apart, above = radius + v["Q3"], v["Q5"]
    for floor in floors_of(v["Q5"], v["Q5"] + v["Q1"], abs(v["Q10"])):
        path = path_beside(contour, side * apart) if side else contour
        yield from along(path, side, ([floor], v["Q7"], BESIDE_MM), feeds, radius, top=above)
        above = floor
        if not v["Q15"]:
            contour, side = backward(contour), -side
