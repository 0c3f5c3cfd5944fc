"""Drilling, tapping and boring cycles (200 to 203, 205 to 207, 209, 240), expanded to their moves; patterns 220, 221.

HEIDENHAIN, user's manual "Cycles" of the iTNC 530 and the TNC 640, "Fixed cycles: drilling", "Fixed cycles: tapping",
"Fixed cycles: pattern definitions". Heights are mm of the tool axis, feeds mm/min, dwells s; a stroke without a feed is
a rapid.
"""

import math
from collections.abc import Iterable, Iterator

from toolpath_stiff.nc.codes.motion import record
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.heidenhain.contour import check_known, go
from toolpath_stiff.nc.heidenhain.points import inch_tenths, named
from toolpath_stiff.nc.moves import CYCLE, RAPID
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.strokes import MOST_STROKES, SAME_HEIGHT_MM
from toolpath_stiff.units import SECONDS_PER_DAY

Values = dict[str, float]
Stroke = tuple[float, float | None, float]  # height, feed, dwell after it

_ALL, _DRILL = ("Q200", "Q201", "Q203"), ("Q200", "Q201", "Q206", "Q203")
NEEDED = {
    200: (*_DRILL, "Q202"), 201: _DRILL, 202: _DRILL, 203: (*_DRILL, "Q202"), 205: (*_DRILL, "Q202"), 206: _DRILL,
    207: (*_ALL, "Q239"), 209: (*_ALL, "Q239", "Q257", "Q256"), 240: _DRILL,
    220: ("Q216", "Q217", "Q244", "Q245", "Q246", "Q247", "Q241"),
    221: ("Q225", "Q226", "Q237", "Q238", "Q242", "Q243", "Q224"),
}  # fmt: skip
KNOWN = {"Q200", "Q201", "Q202", "Q203", "Q204", "Q205", "Q206", "Q208", "Q210", "Q211", "Q212", "Q213", "Q214", "Q239",
         "Q256", "Q257", "Q258", "Q259", "Q253", "Q336", "Q343", "Q344", "Q351", "Q379", "Q395", "Q403", "Q301", "Q365",
         "Q357", "Q359", "Q350"}  # fmt: skip
FEEDS, MAX, AUTO = ("Q206", "Q208", "Q253"), -1.0, -2.0
HAVE_NO_SHIFT = "the shift off the wall before the tool leaves the hole"


def define(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 200 and on: keeps the cycle for its calls; 220 and 221 call the one before at their points."""
    number = int(code.removeprefix("CYCL DEF "))
    values = {letter: block.take(letter) or 0.0 for letter in list(block.free)}
    missing = next((name for name in NEEDED[number] if name not in values), None)
    block.refuse_if(missing, None, f"without {missing}", f"{', '.join(NEEDED[number])}")
    unknown = next((name for name in values if name not in KNOWN and name not in NEEDED[number]), None)
    block.refuse_if(unknown, unknown, f"is no parameter of {code} that is known")
    wrong = number < 220 or number == 240
    if wrong:
        _check(block, number, values)
    if number in (220, 221):
        _pattern(state, block, number, values)
        return
    if values.get("Q214"):
        state.note(block.line, block.values["Q214"], HAVE_NO_SHIFT)
    state.plain.cycle, state.plain.modal = (number, values, block.line), False


def _check(block: CurrentBlock, number: int, values: Values) -> None:
    depth, clear, peck = values["Q201"], values["Q200"], values.get("Q202", 0.0)
    block.refuse_if(depth > 0.0, "Q201", "is above the surface", "0 or a negative depth")
    block.refuse_if(clear < 0.0, "Q200", "is below the surface", "0 or more")
    pecks = number in (200, 203, 205)
    block.refuse_if(pecks and depth and peck <= 0.0, "Q202", "is no peck", "more than 0")
    least = values.get("Q205", 0.0) or peck
    block.refuse_if(
        pecks and depth and -depth / max(min(peck, least), 1e-9) > MOST_STROKES, "Q202", "makes too many strokes"
    )
    for name in FEEDS:
        slow = name in values and values[name] not in (MAX, AUTO) and values[name] < 0.0
        block.refuse_if(slow, name, "is no feed", "a feed above 0")
    for name in ("Q210", "Q211"):
        block.refuse_if(not 0.0 <= values.get(name, 0.0) <= SECONDS_PER_DAY, name, "is no time", "seconds")
    block.refuse_if(values.get("Q395"), "Q395", "counts the depth from the tool's edge", "0")
    block.refuse_if(values.get("Q343"), "Q343", "takes the depth from a diameter and the tool's tip", "0 and a depth")
    block.refuse_if(values.get("Q379"), "Q379", "begins inside the hole", "0")
    refused = number == 205 and values.get("Q257")
    block.refuse_if(refused, "Q257", "breaks chips between pecks", "0")
    taps = number in (207, 209)
    block.refuse_if(taps and not values["Q239"], "Q239", "is no pitch", "a pitch")
    block.refuse_if(number == 209 and values["Q257"] <= 0.0, "Q257", "is no depth for chip breaking", "more than 0")


def call(state: State, block: CurrentBlock) -> None:
    """The cycle defined last, at the present point (CYCL CALL, M99, M89)."""
    plain, normal = state.plain, PLANES[state.plane][2]
    if plain.cycle is None:
        raise block.fail(None, "calls a cycle, and none is defined", "CYCL DEF before it")
    waits = state.cutter is not None or plain.held is not None or plain.approach is not None
    block.refuse_if(waits, None, "calls a cycle inside a contour", "R0 before it")
    number, values, _ = plain.cycle
    if not values["Q201"]:  # a depth of 0: the cycle is not carried out
        return
    check_known(state, block, {normal: 0.0}, rapid=True)
    block.refuse_if(plain.unknown, None, "calls a cycle where X or Y is not known", "X and Y before it")
    block.refuse_if(number in (207, 209) and state.speed <= 0.0, None, "taps without a speed", "S above 0")
    unit, pitch = state.length_scale, state.length_scale if number in (207, 209) else inch_tenths(state)
    auto = plain.tool_feed or 0.0
    plunge(
        state,
        block,
        (
            (height * unit, None if rate in (None, MAX) else auto if rate == AUTO else rate * pitch, wait)
            for height, rate, wait in strokes(number, values, state.speed)
        ),
    )


def plunge(state: State, block: CurrentBlock, path: Iterable[Stroke]) -> None:
    """Carry out strokes at the present point, in mm and mm/min; a feed of 0 is none that was given."""
    frames, normal, modal = state.frames, PLANES[state.plane][2], state.feed
    for height, rate, wait in path:
        place = frames.to_program(frames.position)
        if abs(place[normal] - height) > SAME_HEIGHT_MM:
            place[normal] = height
            block.refuse_if(rate is not None and not rate > 0.0, None, "cuts without a feed", "its feed above 0")
            state.feed = rate
            record(state, block, RAPID if rate is None else CYCLE, frames.to_control(place), (normal,))
        if wait:
            state.recorder.add_dwell(wait)
    state.feed, state.plain.heading = modal, None


def strokes(number: int, values: Values, speed: float) -> Iterator[Stroke]:
    """Heights of a hole one after another, each with its feed and the dwell there.

    Examples
    --------
    >>> hole = {"Q200": 2.0, "Q201": -5.0, "Q206": 100.0, "Q202": 3.0, "Q203": 0.0, "Q204": 50.0}
    >>> [(height, feed) for height, feed, _ in strokes(200, hole, 0.0)]
    [(2.0, None), (-3.0, 100.0), (2.0, None), (-1.0, None), (-5.0, 100.0), (2.0, None), (50.0, None)]
    """
    surface, clear = values["Q203"], values["Q203"] + values["Q200"]
    bottom, down, wait = surface + values["Q201"], values.get("Q206"), values.get("Q211", 0.0)
    back = values.get("Q208", 0.0) or (down or 0.0)
    out: float | None = None if number in (200, 205, 240) else back if number in (201, 202, 203) else down
    yield clear, None, 0.0
    if number in (200, 203, 205):
        yield from _pecks(number, values, out)
    if number in (207, 209):
        down = out = abs(values["Q239"]) * speed
    if number == 209:
        yield from _broken_taps(values, down or 0.0)
    yield bottom, down, wait
    yield clear, out, 0.0
    if values.get("Q204", 0.0) > values["Q200"]:
        yield surface + values["Q204"], None, 0.0


def _pecks(number: int, values: Values, out: float | None) -> Iterator[Stroke]:
    """Strokes of the pecks above the bottom, and of what is between them."""
    surface, clear, down = values["Q203"], values["Q203"] + values["Q200"], values["Q206"]
    bottom, peck, pause = surface + values["Q201"], values["Q202"], values.get("Q210", 0.0)
    depth, breaks, count = surface - peck, values.get("Q213", 0.0) if number == 203 else 0.0, 0
    less, least = values.get("Q212", 0.0) if number != 200 else 0.0, values.get("Q205", 0.0)
    while depth > bottom + SAME_HEIGHT_MM:
        yield depth, down, 0.0
        count += 1
        if breaks and count % (int(breaks) + 1):
            yield depth + (values.get("Q256", 0.0) or 0.2), out, 0.0
        else:
            yield clear, out, pause
            ahead = values["Q200"] if number != 205 else _ahead(values, depth)
            yield depth + ahead, None, 0.0
        peck = max(peck - less, min(least, peck)) if less else peck
        depth -= peck


def _ahead(values: Values, depth: float) -> float:
    """205: the stop before the last depth, from Q258 at the first peck to Q259 at the last, in proportion."""
    first, last = values.get("Q258", 0.2), values.get("Q259", 0.2)
    surface, whole = values["Q203"], -values["Q201"] - values["Q202"]
    share = (surface - values["Q202"] - depth) / whole if whole > 0.0 else 0.0
    return first + (last - first) * min(share, 1.0)


def _broken_taps(values: Values, rate: float) -> Iterator[Stroke]:
    surface, step, clear = values["Q203"], values["Q257"], values["Q203"] + values["Q200"]
    depth, bottom = surface - step, surface + values["Q201"]
    while depth > bottom + SAME_HEIGHT_MM:
        yield depth, rate, 0.0
        yield (depth + abs(values["Q239"] * values["Q256"]) if values["Q256"] else clear), rate, 0.0
        depth -= step


def _pattern(state: State, block: CurrentBlock, number: int, values: Values) -> None:
    """220: points on a circle; 221: on lines to and fro; between them at the set-up clearance, or the second one."""
    plain, unit, normal = state.plain, state.length_scale, PLANES[state.plane][2]
    if plain.cycle is None:
        raise block.fail(None, "without a cycle to call", "CYCL DEF before it")
    kept, cycle = plain.cycle, dict(plain.cycle[1])
    cycle |= {name: values[name] for name in ("Q200", "Q203", "Q204") if name in values}
    clear = cycle["Q203"] + cycle["Q200"]
    second = max(clear, cycle["Q203"] + cycle.get("Q204", 0.0))
    first, other, _ = PLANES[state.plane]
    block.refuse_if(values.get("Q365"), "Q365", "goes from point to point on arcs", "0")
    points = list(_points(block, number, values))
    for count, (x, y) in enumerate(points):
        between = not values.get("Q301", 1.0) and count + 1 < len(points)
        plain.cycle = (kept[0], cycle | {"Q204": 0.0} if between else cycle, kept[2])
        height = second if count == 0 or values.get("Q301", 1.0) else clear
        go(state, block, {normal: height * unit}, rapid=True)
        go(state, block, {first: x * unit, other: y * unit}, rapid=True)
        call(state, block)
    plain.cycle = kept


def _points(block: CurrentBlock, number: int, values: Values) -> Iterator[tuple[float, float]]:
    if number == 220:
        count, first, last, step = (values[name] for name in ("Q241", "Q245", "Q246", "Q247"))
        block.refuse_if(count != int(count) or not 1 <= count <= 10_000, "Q241", "is no number of points")
        if not step and count > 1:
            step = (last - first) / (count if abs(last - first) == 360.0 else count - 1)
        for index in range(int(count)):
            angle = math.radians(first + index * step)
            radius = values["Q244"] / 2.0
            yield values["Q216"] + radius * math.cos(angle), values["Q217"] + radius * math.sin(angle)
        return
    columns, rows, turn = values["Q242"], values["Q243"], math.radians(values["Q224"])
    for name in ("Q242", "Q243"):
        block.refuse_if(
            values[name] != int(values[name]) or not 1 <= values[name] <= 1000, name, "is no number of points"
        )
    for row in range(int(rows)):
        for column in range(int(columns)):
            along = (column if row % 2 == 0 else int(columns) - 1 - column) * values["Q237"]
            across = row * values["Q238"]
            x, y = math.cos(turn) * along - math.sin(turn) * across, math.sin(turn) * along + math.cos(turn) * across
            yield values["Q225"] + x, values["Q226"] + y


def call_statement(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL CALL: at the present point; CYCL CALL POS: at a point of the plane."""
    if code == "CYCL CALL POS":
        normal, there = PLANES[state.plane][2], named(state, block)
        block.take("F"), block.take("FMAX")
        block.refuse_if(normal in there, None, "with the tool axis", "X and Y alone")
        block.refuse_if(not there, None, "without its point", "X and Y")
        go(state, block, there, rapid=True)
    call(state, block)
