"""Drilling cycles of Siemens' language (CYCLE81 to CYCLE89, CYCLE840), expanded to their moves; MCALL, HOLES1, HOLES2.

SIEMENS, SINUMERIK 840D, Programming Guide Cycles (11/2002), "Drilling cycles", "Drilling patterns". Heights are mm of
the tool axis, feeds mm/min, dwells s; a stroke without a feed is a rapid.
"""

import cmath
import math
from collections.abc import Iterator

from toolpath_stiff.nc.contouring.contour import Stroke, check_known, go, plunge
from toolpath_stiff.nc.contouring.points import in_plane, outside_contour, present
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State, Values
from toolpath_stiff.nc.strokes import MOST_STROKES, SAME_HEIGHT_MM, SHIFT
from toolpath_stiff.nc.words import Word
from toolpath_stiff.units import SECONDS_PER_DAY

_HEIGHTS, _MODES = "RTP RFP SDIS DP DPR", "GMODE DMODE AMODE"
_THREAD = f"AXN PITA TECHNO VARI DAM VRT PITM PTAB PTABA {_MODES}"
_OLD = "FFD FFP1 MID CDIR FAL VARI MIDF FFP2 SSF"
_MILL, _SIGNS = "MID FAL FALD FFP1 FFD CDIR", f"UMODE FS ZFS {_MODES}"
SIGNATURES = {
    "CYCLE81": f"{_HEIGHTS} DTB {_MODES}", "CYCLE82": f"{_HEIGHTS} DTB {_MODES}",
    "CYCLE83": f"{_HEIGHTS} FDEP FDPR DAM DTB DTS FRF VARI AXN MDEP VRT DTD DIS1 {_MODES}",
    "CYCLE84": f"{_HEIGHTS} DTB SDAC MPIT PIT POSS SST SST1 {_THREAD}",
    "CYCLE840": f"{_HEIGHTS} DTB SDR SDAC ENC MPIT PIT {_THREAD.replace('VARI DAM VRT ', '')}",
    "CYCLE85": f"{_HEIGHTS} DTB FFR RFF {_MODES}", "CYCLE86": f"{_HEIGHTS} DTB SDIR RPA RPO RPAP POSS {_MODES}",
    "CYCLE87": f"{_HEIGHTS} SDIR", "CYCLE88": f"{_HEIGHTS} DTB SDIR", "CYCLE89": f"{_HEIGHTS} DTB {_MODES}",
    "POCKET1": f"{_HEIGHTS} LENG WID CRAD _PA _PO STA {_OLD}", "POCKET2": f"{_HEIGHTS} PRAD _PA _PO {_OLD}",
    "POCKET3": f"RTP RFP SDIS DP LENG WID CRAD _PA _PO STA {_MILL} VARI MIDA AP1 AP2 AD RAD1 DP1 {_SIGNS}",
    "POCKET4": f"RTP RFP SDIS DP PRAD _PA _PO {_MILL} VARI MIDA AP1 AD RAD1 DP1 {_SIGNS}",
    "CYCLE76": f"{_HEIGHTS} LENG WID CRAD _PA _PO STA {_MILL} VARI AP1 AP2 {_SIGNS.removeprefix('UMODE ')}",
    "CYCLE77": f"{_HEIGHTS} PRAD _PA _PO {_MILL} VARI AP1 {_SIGNS.removeprefix('UMODE ')}",
    "CYCLE71": "RTP RFP SDIS DP _PA _PO LENG WID STA MID MIDA FDP FALD FFP1 VARI FDP1",
    "CYCLE61": "RTP RFP SDIS DP _PA _PO LENG WID MID MIDA FALD FFP1 VARI LIM DMODE AMODE",
    "CYCLE72": f"KNAME RTP RFP SDIS DP MID FAL FALD FFP1 FFD VARI RL AS1 LP1 FF3 AS2 LP2 {_SIGNS}",
    "CYCLE62": "KNAME TYPE LAB1 LAB2",
    "CYCLE801": "SPCA SPCO STA1 DIS1 DIS2 NUM1 NUM2 VARI UMODE ANG1 ANG2 HIDE NSP DMODE",
    "HOLES1": "SPCA SPCO STA1 FDIS DBH NUM VARI UMODE HIDE NSP DMODE",
    "HOLES2": "CPA CPO RAD STA1 INDA NUM VARI UMODE HIDE NSP DMODE",
    "CYCLE802": f"XA YA {' '.join(f'X{n} Y{n}' for n in range(9))} VARI UMODE DMODE",
    "CYCLE800": "FR TC ST MODE X0 Y0 Z0 A B C X1 Y1 Z1 DIR FRI DMODE",
    "WORKPIECE": "WP REF HOLD FORM MODE Z0 Z1 ZB X0 Y0 X1 Y1",
}  # fmt: skip
TEXTS = ("KNAME", "LAB1", "LAB2", "TC", "WP", "REF", "HOLD", "FORM", "HIDE", "PITM", "PTAB", "PTABA")
TAPS = ("CYCLE84", "CYCLE840")
LENGTHS = frozenset((
    "RTP", "RFP", "SDIS", "DP", "DPR", "FDEP", "FDPR", "DAM", "PIT", "MDEP", "VRT", "DIS1", "FFR", "RFF", "SPCA",
    "SPCO", "FDIS", "DBH", "CPA", "CPO", "RAD", "LENG", "WID", "CRAD", "_PA", "_PO", "MID", "FAL", "FALD", "FFP1",
    "FFD", "AP1", "AP2", "AD", "DP1", "PRAD", "FDP", "FDP1", "LP1", "LP2", "FF3", "DIS1", "DIS2", "MIDF", "FFP2",
))  # fmt: skip
# Pitches of coarse threads (ISO 261) by their size, mm.
COARSE = {3: 0.5, 4: 0.7, 5: 0.8, 6: 1.0, 8: 1.25, 10: 1.5, 12: 1.75, 14: 2.0, 16: 2.0, 18: 2.5, 20: 2.5, 22: 2.5,
          24: 3.0, 27: 3.0, 30: 3.5, 33: 3.5, 36: 4.0, 39: 4.0, 42: 4.5, 45: 4.5, 48: 5.0}  # fmt: skip
CHIP_BREAK_MM, AHEAD_MM, AHEAD_SHARE, MOST_AHEAD_MM = 1.0, 0.6, 1.0 / 50.0, 7.0  # of CYCLE83
GRID = "the holes of CYCLE801 are drilled row by row, to and fro"
SHORTER = "the pecks of CYCLE83 that are a share of the one before (DAM) end as those shortened by an amount"


def modal(state: State, block: CurrentBlock, code: str) -> None:
    """MCALL: the cycle beside it runs after each block that moves; MCALL alone: cancel."""
    state.plain.modal, state.plain.cycle = False, None


def parameters(state: State, block: CurrentBlock, code: str) -> Values:
    """The parameters that a cycle's call gives, lengths in mm; now taken. If they name a plane, it is in force."""
    plane = round(block.values["DMODE"].value) % 10 if block.has("DMODE") else 0
    block.refuse_if(plane not in (0, int(state.plane[1:]) - 16), "DMODE", "names another plane", "the one in force")
    given, scale = [name for name in SIGNATURES[code].split() if block.has(name)], state.length_scale
    return {name: (block.take(name) or 0.0) * (scale if name in LENGTHS else 1.0) for name in given}


def cycle(state: State, block: CurrentBlock, code: str) -> None:
    """A drilling cycle, run here or, after MCALL, wherever a block moves to."""
    values = parameters(state, block, code)
    missing = next((name for name in ("RTP", "RFP") if name not in values), None)
    block.refuse_if(missing, None, f"{code} without {missing}", SIGNATURES[code].replace(" ", ", "))
    values |= {"number": float(code.removeprefix("CYCLE")), "TOP": values["RFP"] + abs(values.get("SDIS", 0.0))}
    bottom = values["RFP"] - abs(values["DPR"]) if values.get("DPR") else values.get("DP")
    if bottom is None or bottom >= values["RFP"]:
        raise block.fail(None, f"{code} whose depth is not below its reference plane RFP", "DP or DPR")
    values["DP"] = bottom
    block.refuse_if(values["RTP"] < values["TOP"], None, f"{code}: RTP is below RFP and SDIS", "a higher RTP")
    for name in ("DTB", "DTS", "DTD"):
        block.refuse_if(not 0.0 <= values.get(name, 0.0) <= SECONDS_PER_DAY, name, "is no time in seconds", "0 or more")
    units = f"{round(values.get('AMODE', 0.0)):09d}"  # digits from the last: of the depth, of dwells, of pecks
    dwells = units[-4 if code == "CYCLE83" else -2 : -1]
    block.refuse_if("2" in dwells, "AMODE", "counts dwells in revolutions", "seconds")
    shank = values.get("GMODE", 0.0) // 10 % 10
    block.refuse_if(shank, "GMODE", "counts the depth from a diameter or the shank", "0: from the tip")
    block.refuse_if(values.get("AXN", 3.0) not in (0.0, 3.0), "AXN", "is another axis than that of the tool", "none")
    if code == "CYCLE83":
        counted = units[-5] == "1" and "FDPR" not in values and "FDEP" in values
        block.refuse_if(counted, "FDEP", "counts from RFP", "FDPR")
        first = values["RFP"] - abs(values["FDPR"]) if values.get("FDPR") else values.get("FDEP", bottom)
        block.refuse_if(not bottom <= first < values["RFP"], None, "CYCLE83 whose first depth does not fit", "FDPR")
        less = values.get("DAM", 0.0)
        if less < 0.0 or (less and units[-6] == "2"):  # the share of the stroke before
            share = -less / state.length_scale if less < 0.0 else less / state.length_scale / 100.0
            values |= {"SHARE": share, "DAM": 0.0, "MDEP": values.get("MDEP", 0.0) if share < 1.0 else 0.0}
            wrong = not 0.0 < share <= 1.0 or (share < 1.0 and (values["MDEP"] <= 0.0 or units[-7] == "2"))
            block.refuse_if(wrong, "DAM", "shortens the pecks without a least one in mm", "MDEP, or 100 per cent")
            state.assume(SHORTER)
        least = min(values.get("MDEP") or values.get("DAM") or math.inf, values["RFP"] - first)
        block.refuse_if((first - bottom) / least > MOST_STROKES, None, "CYCLE83 with too many strokes", "a larger FDPR")
        values |= {"FIRST": first, "LEAST": least}
    if code in TAPS:
        values["PIT"] = abs(values.get("PIT", 0.0)) or COARSE.get(round(abs(values.get("MPIT", 0.0))), 0.0)
        block.refuse_if(values.get("PITA", 0.0) > 1.0, "PITA", "is a pitch in other units than mm", "0, 1")
        by_feed = code == "CYCLE840" and values.get("ENC") == 1.0  # without encoder the feed has to fit the speed
        block.refuse_if(not values["PIT"] and not by_feed, None, f"{code} without a pitch", "PIT, or MPIT of 3 to 48")
        block.refuse_if(values.get("VARI"), "VARI", "taps in pecks", "0")
    for name in ("RPA", "RPO", "RPAP"):
        if values.get(name):
            state.note(block.line, block.values[name], SHIFT)
    if "MCALL" in block.codes:
        state.plain.modal, state.plain.cycle = True, (int(values["number"]), values)
    else:
        drill(state, block, values)


def drill(state: State, block: CurrentBlock, values: Values) -> None:
    """Drill at the present point by a cycle's values."""
    plain = state.plain
    outside_contour(state, block, "a cycle", plain.side)
    check_known(state, block, {PLANES[state.plane][2]: 0.0}, rapid=True)
    block.refuse_if(plain.unknown, None, "a cycle where X or Y is not known", "X and Y before it")
    turns = state.speed if state.feed_mode == "G95" and state.speed else 1.0  # feeds of taps are then per revolution
    plunge(state, block, strokes(values, state.feed, state.speed, turns))


def strokes(values: Values, feed: float | None, speed: float, turns: float = 1.0) -> Iterator[Stroke]:
    """The heights of a hole in order, each with its feed (0: none) and its dwell.

    `turns`: 1/min that feeds are counted by, 1 where they are mm/min.

    Examples
    --------
    >>> hole = {"number": 81.0, "RTP": 10.0, "TOP": 2.0, "DP": -5.0}
    >>> list(strokes(hole, 100.0, 0.0))
    [(2.0, None, 0.0), (-5.0, 100.0, 0.0), (2.0, None, 0.0), (10.0, None, 0.0)]
    """
    number, top, bottom = int(values["number"]), values["TOP"], values["DP"]
    down = feed or 0.0
    out: float | None = None
    if number == 840 and values.get("ENC") == 1.0:
        out = down
    elif number in (84, 840):
        speed = values.get("SST") or speed
        down, out = (values["PIT"] * rate / turns for rate in (speed, values.get("SST1") or speed))
    elif number == 85:
        down = values.get("FFR") or down
        out = values.get("RFF") or down
    elif number == 89:
        out = down
    yield top, None, 0.0
    if number == 83:
        yield from _pecks(values, down)
    else:
        yield bottom, down, values.get("DTB", 0.0) if number != 81 else 0.0
    yield top, out, 0.0
    yield values["RTP"], None, 0.0


def _pecks(values: Values, feed: float) -> Iterator[Stroke]:
    """CYCLE83: pecks that get shorter, the last two alike; retract out, or by 1 mm, in between."""
    depth, bottom, less, part = values["FIRST"], values["DP"], values.get("DAM", 0.0), values.get("SHARE", 1.0)
    stroke, share, last = values["RFP"] - depth, values.get("FRF") or 1.0, values.get("DTD") or values.get("DTB", 0.0)
    ahead = values.get("DIS1") or min(max(AHEAD_MM, AHEAD_SHARE * (values["RFP"] - bottom)), MOST_AHEAD_MM)
    rate = feed * (share / 100.0 if share > 1.0 else share)  # above 1 it is per cent
    yield depth, rate, values.get("DTB", 0.0) if depth > bottom + SAME_HEIGHT_MM else last
    while depth > bottom + SAME_HEIGHT_MM:
        if values.get("VARI"):
            yield values["TOP"], None, values.get("DTS", 0.0)
            yield min(depth + ahead, values["TOP"]), None, 0.0
        else:
            yield depth + (values.get("VRT") or CHIP_BREAK_MM), feed, 0.0
        left = depth - bottom
        if less or part < 1.0:
            stroke = max(stroke * part - less, values["LEAST"])
            stroke = left / 2.0 if stroke < left < 2.0 * stroke and stroke <= (less or values["LEAST"]) else stroke
        depth -= min(stroke, left)
        yield depth, feed, values.get("DTB", 0.0) if depth > bottom + SAME_HEIGHT_MM else last


def pattern(state: State, block: CurrentBlock, code: str) -> None:
    """HOLES1: holes on a line, from the nearer end; HOLES2: on a circle; CYCLE801, CYCLE802: grids, points."""
    plain, (first, second, _) = state.plain, PLANES[state.plane]
    values = parameters(state, block, code)
    if plain.cycle is None:
        raise block.fail(None, f"{code} without a cycle", "MCALL CYCLE81(...) before it")
    number = values.get
    block.refuse_if(
        "HIDE" in values and block.values["HIDE"].text, None, f"{code} with hidden positions", "all of them"
    )
    block.refuse_if(code == "HOLES2" and number("VARI", 0.0) // 10 % 10, "VARI", "goes from hole to hole on the circle")
    count, start = round(number("NUM", 1.0)), math.radians(number("STA1", 0.0))
    block.refuse_if(not 1 <= count <= 10_000, None, f"{code} with {count} holes", "1 or more")
    if code == "CYCLE802":
        steps = any({*f"{number(name, 0.0):.0f}"} != {"1"} for name in ("XA", "YA"))
        block.refuse_if(steps, None, f"{code} with steps", "111111111: absolute points")
        pairs = [(f"X{index}", f"Y{index}") for index in range(9)]
        points = [complex(values[x], values[y]) * state.length_scale for x, y in pairs if {x, y} <= values.keys()]
    elif code == "CYCLE801":
        sheared = number("VARI", 0.0) or number("ANG1", 0.0) or number("ANG2", 0.0)
        block.refuse_if(sheared, None, "CYCLE801 of a frame, or of a sheared grid", "VARI, ANG1 and ANG2 of 0")
        columns, rows = round(number("NUM1", 1.0)), round(number("NUM2", 1.0))
        block.refuse_if(
            not 1 <= columns * rows <= 10_000, None, f"CYCLE801 with {columns} times {rows} holes", "1 or more"
        )
        state.assume(GRID)
        ways = [range(columns)[:: (-1) ** row] for row in range(rows)]
        grid = [complex(x * number("DIS1", 0.0), y * number("DIS2", 0.0)) for y, way in enumerate(ways) for x in way]
        points = [complex(number("SPCA", 0.0), number("SPCO", 0.0)) + cmath.rect(1.0, start) * point for point in grid]
    elif code == "HOLES1":
        along, base = cmath.rect(1.0, start), complex(number("SPCA", 0.0), number("SPCO", 0.0))
        points = [base + (number("FDIS", 0.0) + index * number("DBH", 0.0)) * along for index in range(count)]
        here = in_plane(state, present(state))
        if abs(here - points[-1]) < abs(here - points[0]):
            points.reverse()
    else:
        step = math.radians(number("INDA", 0.0) or 360.0 / count)
        middle, radius = complex(number("CPA", 0.0), number("CPO", 0.0)), number("RAD", 0.0)
        points = [middle + cmath.rect(radius, start + index * step) for index in range(count)]
    kept = plain.cycle[1]
    for point in points:
        go(state, block, {first: point.real, second: point.imag}, rapid=True)
        drill(state, block, kept)


def repeated(state: State, block: CurrentBlock) -> None:
    """Run the cycle of MCALL after a block that moved."""
    if state.plain.modal and state.plain.cycle is not None:
        word = block.block.words[0] if block.block.words else Word("", 0.0, 1, "MCALL")
        drill(state, CurrentBlock(block.name, type(block.block)(block.line, (word,))), state.plain.cycle[1])
