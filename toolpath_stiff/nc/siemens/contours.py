"""Contour milling (CYCLE72): a contour of labelled blocks or of a subprogram, milled layer by layer beside its line.

SIEMENS, SINUMERIK 840D, Programming Guide Cycles (11/2002), "Milling cycles", "Path milling - CYCLE72".
"""

from toolpath_stiff.nc.codes.cutter import switch_off
from toolpath_stiff.nc.contouring.contour import go_beside, mill
from toolpath_stiff.nc.elements import direction
from toolpath_stiff.nc.pockets import Cut, layers
from toolpath_stiff.nc.siemens.milling import FINISH, approached, begin, digit
from toolpath_stiff.nc.state import CurrentBlock, State

SIDES = {0.0: 0, 40.0: 0, 41.0: 1, 42.0: -1}  # of RL
NAMED, LABELLED = 1.0, 2.0  # TYPE of CYCLE62: by the labels that the control makes of its name, by two labels
STRAIGHT, HALF = 1.0, 3.0  # AS1, AS2; 2: a quarter of a circle


def contour_call(state: State, block: CurrentBlock, code: str) -> None:
    """CYCLE62: names the contour of the cycles behind it; the run finds its blocks."""
    for word in ("KNAME", "TYPE", "LAB1", "LAB2"):
        block.take(word)


def contour_ends(block: CurrentBlock) -> tuple[str, str]:
    """Subprogram of a contour and "", or its labels: of CYCLE72 ("NAME", "BEGIN:END"), or as CYCLE62 says by TYPE."""
    given = {name: block.values[name].text.upper() for name in ("KNAME", "LAB1", "LAB2") if name in block.values}
    first, _, last = (part.strip() for part in given.get("KNAME", "").partition(":"))
    kind = block.values["TYPE"].value if "TYPE" in block.values else 0.0
    block.refuse_if(kind not in (0.0, NAMED, LABELLED), "TYPE", "calls labels of a subprogram", "0, 1, 2")
    if kind == NAMED and first:
        first, last = f"E_LAB_A_{first}", f"E_LAB_E_{first}"
    elif kind == LABELLED and not first:
        first, last = given.get("LAB1", ""), given.get("LAB2", "")
    block.refuse_if(not first, None, "CYCLE72 or CYCLE62 without its contour", "its name, or labels")
    return first, last


def mill_contour(state: State, block: CurrentBlock, code: str) -> None:
    """CYCLE72: at each depth lead in on a line or an arc, along the contour, lead out; up to TOP in between."""
    values, radius = begin(state, block, code)
    contour, finish = state.plain.contour, digit(values["VARI"], 0) == FINISH
    block.refuse_if(values["RL"] not in SIDES, "RL", "is no side", "40, 41, 42")
    block.refuse_if(values["VARI"] >= 1000.0, "VARI", "goes along the contour backward", "up to 332")
    side, leads = SIDES[values["RL"]], list[tuple[complex, complex, complex | None]]()
    apart = abs(side) * (radius + (0.0 if finish else values["FAL"]))
    for name, way, place, element in (("1", -1, contour[0][0], contour[0]), ("2", 1, contour[-1][1], contour[-1])):
        kind, size = (values[f"{word}{name}"] or values[f"{word}1"] for word in ("AS", "LP"))  # out as in, if not given
        ahead = direction(element, place)
        wrong = kind not in (1.0, 2.0, 3.0) or size <= 0.0 or (kind > STRAIGHT and not side)
        block.refuse_if(wrong, f"AS{name}", "is no lead in the plane with a length (LP1, LP2)", "1; 2, 3 beside a side")
        beside = place + side * apart * 1j * ahead
        center = None if kind == STRAIGHT else beside + side * size * 1j * ahead
        turned = -1.0 if kind == HALF else side * way * 1j
        away = beside + way * size * ahead if center is None else center + (beside - center) * turned
        leads.append((away, beside, center))
    (start, into, before), (stop, out, after) = leads
    down, feed, above = values["FFD"], values["FFP1"], values["TOP"]
    mill(state, block, approached(state, values, start))
    for floor in layers(above, values["DP" if finish else "FLOOR"], values["MID"]):
        way_in: list[Cut] = [
            (start, above, None, None, 0),
            (start, floor, down, None, 0),
            (into, floor, feed, before, side),
        ]
        mill(state, block, way_in)
        if side:
            go_beside(state, side, apart)
        mill(state, block, [(contour[0][0], floor, feed, None, 0)])
        mill(state, block, [(end, floor, feed, center, turn) for _, end, center, turn in contour])
        switch_off(state, block, code)
        mill(
            state, block, [(out, floor, feed, None, 0), (stop, floor, feed, after, side), (stop, above, None, None, 0)]
        )
    mill(state, block, [(stop, values["RTP"], None, None, 0)])
