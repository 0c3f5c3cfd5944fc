"""Fixed cycles (1, 2, 4, 5, 17, 200 to 209, 240, 241, 251 to 257), expanded to their moves; patterns 220, 221.

HEIDENHAIN, user's manual "Cycles" of the iTNC 530 and the TNC 640, "Fixed cycles: drilling", "Fixed cycles: tapping",
"Fixed cycles: pattern definitions"; of the TNC 407, "Pecking", "Tapping". Heights are mm of the tool axis, feeds
mm/min, dwells s; a stroke without a feed is a rapid.
"""

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator

from toolpath_stiff.nc.contouring.contour import Stroke, check_known, go, plunge, turn_of
from toolpath_stiff.nc.contouring.points import feed, inch_tenths, named, outside_contour, present
from toolpath_stiff.nc.geometry import PLANES, turned
from toolpath_stiff.nc.heidenhain.milling import AUTO, MAX, MILLED, mill_form
from toolpath_stiff.nc.state import CurrentBlock, State, Values
from toolpath_stiff.nc.strokes import MOST_STROKES, SAME_HEIGHT_MM, SHIFT
from toolpath_stiff.units import SECONDS_PER_DAY

_ALL, _DRILL = ("Q200", "Q201", "Q203"), ("Q200", "Q201", "Q206", "Q203")
CONTOURS = {
    20: tuple(f"Q{number}" for number in range(1, 10)), 22: ("Q10", "Q11", "Q12"), 23: ("Q11", "Q12"),
    24: ("Q9", "Q10", "Q11", "Q12", "Q14"), 25: ("Q1", "Q3", "Q5", "Q7", "Q10", "Q11", "Q12", "Q15"),
}  # fmt: skip
NEEDED = {
    200: (*_DRILL, "Q202"), 201: _DRILL, 202: _DRILL, 203: (*_DRILL, "Q202"), 205: (*_DRILL, "Q202"), 206: _DRILL,
    207: (*_ALL, "Q239"), 209: (*_ALL, "Q239", "Q257", "Q256"), 240: _DRILL, 241: _DRILL,
    220: ("Q216", "Q217", "Q244", "Q245", "Q246", "Q247", "Q241"),
    221: ("Q225", "Q226", "Q237", "Q238", "Q242", "Q243", "Q224"), **MILLED, **CONTOURS,
}  # fmt: skip
PECKS, TAPS = (200, 203, 205), (207, 209)
# Cycles of older controls, with parameters in statements -> the cycle whose moves they make, and the parameters of each
# part by their words ("#": a number behind a name).
OLDER = {
    "1": (205, ("#Q200", "#Q201", "#Q202", "#Q211", "FQ206")), "2": (206, ("#Q200", "#Q201", "#Q211", "FQ206")),
    "4": (4, ("#Q200", "#Q201", "#Q202 FQ206", "XQ218", "YQ219", "FQ207 #Q220")),
    "5": (5, ("#Q200", "#Q201", "#Q202 FQ206", "#Q220", "FQ207")), "17": (207, ("#Q200", "#Q201", "#Q239")),
}  # fmt: skip
KNOWN = {"Q200", "Q201", "Q202", "Q203", "Q204", "Q205", "Q206", "Q208", "Q210", "Q211", "Q212", "Q213", "Q214", "Q239",
         "Q256", "Q257", "Q258", "Q259", "Q253", "Q336", "Q343", "Q344", "Q351", "Q379", "Q395", "Q403", "Q301", "Q365",
         "Q357", "Q359", "Q350", "Q426", "Q427", "Q428", "Q429", "Q430", "Q435", "Q401", "Q207", "Q215", "Q220", "Q224",
         "Q334", "Q338", "Q342", "Q366", "Q367", "Q368", "Q369", "Q370", "Q374", "Q385", "Q437", "Q439",
         "Q18", "Q19", "Q404", "Q438"}  # fmt: skip
FEEDS = ("Q206", "Q207", "Q208", "Q253", "Q385")
LEAST_AHEAD_MM, MOST_AHEAD_MM = 0.6, 7.0  # end of the older pecking's rapids above the last depth
MOST_POINTS = 1000
_WORD = re.compile(r"(I?[A-Z]+)\s*([^A-Z\s]\S*|Q[LR]?\d+)")
FORMS = {"POS": "X Y", "ROW": "X Y D NUM", "PAT": "X Y DX DY NUMX NUMY", "CIRC": "X Y D NUM",
         "PITCHCIRC": "X Y D NUM STEP"}  # fmt: skip
UNASKED = {"Z", "ROT", "ROTX", "ROTY", "START"}  # words of PATTERN DEF that may be missing: 0
_FORM = re.compile(rf"({'|'.join(FORMS)})\d+\s*\(([^)]*)\)")


def define(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 200 and on: keep the cycle for its calls; 220 and 221 call the previous one at their points."""
    number = int(code.removeprefix("CYCL DEF "))
    values = {letter: block.take(letter) or 0.0 for letter in list(block.free)}
    missing = next((name for name in NEEDED[number] if name not in values), None)
    block.refuse_if(missing, None, f"without {missing}", f"{', '.join(NEEDED[number])}")
    unknown = next((name for name in values if name not in KNOWN and name not in NEEDED[number]), None)
    block.refuse_if(unknown, unknown, f"is no parameter of {code} that is known")
    plain = state.plain
    if number in (220, 221):
        _pattern(state, block, number, values)
        return
    if number == 20:
        plain.contour_data = values
        return
    if number not in CONTOURS:
        _check(block, number, values)
    if values.get("Q214"):
        state.note(block.line, block.values["Q214"], SHIFT)
    plain.cycle, plain.modal = (number, values), False


def define_older(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 1, 2, 4, 5, 17: parameters in statements; the surface is the set-up clearance below the tool."""
    cycle, part = code.removeprefix("CYCL DEF ").split(".")
    number, names = OLDER[cycle]
    values = dict(state.plain.cycle[1]) if state.plain.cycle else {"Q203": 0.0}
    block.refuse_if(part != "0" and "Q203" in values, None, "without its heading", f"CYCL DEF {cycle}.0 before it")
    if part == "0":
        state.plain.cycle, state.plain.modal = (number, {}), False
        return
    if block.has("DR+") or block.has("DR-"):
        values["Q351"] = turn_of(block)
    for word, name in ((item[0], item[1:]) for item in names[int(part) - 1].split()):
        value = block.take(word)
        if value is not None:
            values[name] = value if name == "Q201" else abs(value)
    state.plain.cycle = (number, values)


def _check(block: CurrentBlock, number: int, values: Values) -> None:
    depth, peck = values["Q201"], values.get("Q202", 0.0)
    least, pecks = min(peck, values.get("Q205", 0.0) or peck), number in PECKS and depth
    refused = (
        ("Q201", depth > 0.0, "is above the surface", "0 or a negative depth"),
        ("Q200", values["Q200"] < 0.0, "is below the surface", "0 or more"),
        ("Q202", pecks and peck <= 0.0, "is no peck", "more than 0"),
        ("Q202", pecks and -depth / max(least, 1e-9) > MOST_STROKES, "makes too many strokes", "a larger one"),
        *((name, values.get(name, 0.0) < 0.0 and values[name] not in (MAX, AUTO), "is no feed", "") for name in FEEDS),
        *((name, not 0.0 <= values.get(name, 0.0) <= SECONDS_PER_DAY, "is no time", "s") for name in ("Q210", "Q211")),
        ("Q395", values.get("Q395"), "counts the depth from the tool's edge", "0"),
        ("Q343", values.get("Q343"), "takes the depth from a diameter and the tool's tip", "0 and a depth"),
        ("Q379", number != 241 and values.get("Q379"), "begins inside the hole", "0"),
        ("Q202", number == 241 and 0.0 < peck < -depth, "drills in pecks", "cycle 200, 203 or 205"),
        ("Q257", number == 205 and values.get("Q257"), "breaks chips between pecks", "0"),
        ("Q239", number in TAPS and not values["Q239"], "is no pitch", "a pitch"),
        ("Q257", number == 209 and values["Q257"] <= 0.0, "is no depth for chip breaking", "more than 0"),
    )
    for name, wrong, problem, expected in refused:
        block.refuse_if(wrong, name, problem, expected)


def call(state: State, block: CurrentBlock, change: Values | None = None) -> None:
    """Run the last cycle defined, at the present point (CYCL CALL, M99, M89); `change`: parameters for this call."""
    plain, normal = state.plain, PLANES[state.plane][2]
    if plain.cycle is None:
        raise block.fail(None, "calls a cycle, and none is defined", "CYCL DEF before it")
    outside_contour(state, block, "calls a cycle")
    if plain.cycle[0] in CONTOURS:
        from toolpath_stiff.nc.heidenhain.contour_cycles import mill_contours  # which takes Shapely

        block.refuse_if(change, None, "calls a cycle of contours at a point", "CYCL CALL or M99")
        mill_contours(state, block, *plain.cycle)
        return
    unit, (number, values), change = state.length_scale, plain.cycle, change or {}
    if "Q203" in values:
        kept = (name for name, value in values.items() if plain.parameters.get(name, value) != value)
        changed = next((name for name in kept if name not in change), None)
        block.refuse_if(changed, None, f"after {changed} was set again behind the cycle", "its value in CYCL DEF")
        values = values | change
    else:  # an older one
        ahead = min(max(LEAST_AHEAD_MM, abs(values.get("Q201", 0.0) * unit) / 50.0), MOST_AHEAD_MM) / unit
        here = present(state)[normal] / unit
        values = {"Q258": ahead, "Q259": ahead, "Q203": here - values.get("Q200", 0.0)} | values
        missing = next((name for name in NEEDED[number] if name not in values), None)
        block.refuse_if(missing, None, "calls a cycle that is not whole", "all its statements (CYCL DEF 1.0 to 1.5)")
        _check(block, number, values)
    if not values["Q201"]:  # with a depth of 0 the cycle is not carried out
        return
    check_known(state, block, {normal: 0.0}, rapid=True)
    block.refuse_if(plain.unknown, None, "calls a cycle where X or Y is not known", "X and Y before it")
    if number in MILLED:
        mill_form(state, block, number, values)
        return
    block.refuse_if(number in TAPS and state.speed <= 0.0, None, "taps without a speed", "S above 0")
    pitch = unit if number in TAPS else inch_tenths(state)
    path = strokes(number, values, state.speed)
    feeds = {None: None, MAX: None, AUTO: plain.tool_feed or 0.0}
    plunge(state, block, ((at * unit, feeds.get(rate, (rate or 0.0) * pitch), wait) for at, rate, wait in path))


def strokes(number: int, values: Values, speed: float) -> Iterator[Stroke]:
    """Heights of a hole one after another, each with its feed and the dwell there.

    Examples
    --------
    >>> hole = {"Q200": 2.0, "Q201": -5.0, "Q206": 100.0, "Q202": 3.0, "Q203": 0.0, "Q204": 50.0}
    >>> [(height, feed) for height, feed, _ in strokes(200, hole, 0.0)]
    [(2.0, None), (-3.0, 100.0), (2.0, None), (-1.0, None), (-5.0, 100.0), (2.0, None), (50.0, None)]
    """
    surface, clear = values["Q203"], values["Q203"] + values["Q200"]
    down = abs(values["Q239"]) * speed if number in TAPS else values["Q206"]
    back = down if number in (206, *TAPS) else values.get("Q208", 0.0) or down
    out = None if number in (200, 205, 240) else back
    yield clear, None, 0.0
    if values.get("Q379"):
        yield clear - values["Q379"], values.get("Q253") or down, 0.0
    if number in PECKS or number == 209:
        yield from _pecks(number, values, down, out)
    yield surface + values["Q201"], down, values.get("Q211", 0.0)
    yield clear, out, 0.0
    if values.get("Q204", 0.0) > values["Q200"]:
        yield surface + values["Q204"], None, 0.0


def _pecks(number: int, values: Values, down: float, out: float | None) -> Iterator[Stroke]:
    """Strokes of the pecks above the bottom, and between them; 205 has different stops before the last depth.

    209 breaks the chip at each depth by its pitch, or clears it where it has no Q256.
    """
    tap, surface, clear = number == 209, values["Q203"], values["Q203"] + values["Q200"]
    peck, bottom, count = values["Q257" if tap else "Q202"], surface + values["Q201"], 0
    depth, breaks = surface - peck, values.get("Q213", 0.0) if number == 203 else 0.0
    back = abs(values["Q239"] * values["Q256"]) if tap else values.get("Q256", 0.0) or 0.2
    less, least = values.get("Q212", 0.0) if number in (203, 205) else 0.0, values.get("Q205", 0.0)
    near, far = values.get("Q258", 0.2), values.get("Q259", 0.2)
    while depth > bottom + SAME_HEIGHT_MM:
        yield depth, down, 0.0
        count += 1
        if (tap and back) or (breaks and count % (int(breaks) + 1)):
            yield depth + back, out, 0.0
        else:
            yield clear, out, values.get("Q210", 0.0)
            whole = -values["Q201"] - peck
            share = (surface - values.get("Q202", 0.0) - depth) / whole if whole > 0.0 else 0.0
            if not tap:
                yield depth + (near + (far - near) * min(share, 1.0) if number == 205 else values["Q200"]), None, 0.0
        peck = max(peck - less, min(least, peck)) if less else peck
        depth -= peck


def _pattern(state: State, block: CurrentBlock, number: int, values: Values) -> None:
    """220: points on a circle; 221: on lines to and fro; between them at the set-up clearance, or the second one."""
    block.refuse_if(values.get("Q365"), "Q365", "goes from point to point on arcs", "0")
    if number == 220:
        first, last, step = (values[name] for name in ("Q245", "Q246", "Q247"))
        count = _count(block, values["Q241"])
        if not step and count > 1:
            step = (last - first) / (count if abs(last - first) == 360.0 else count - 1)
        places = _circle(complex(values["Q216"], values["Q217"]), count, values["Q244"], first, step)
    else:
        columns, rows = (_count(block, values[name]) for name in ("Q242", "Q243"))
        along, across = values["Q237"] * turned(values["Q224"]), values["Q238"] * 1j * turned(values["Q224"])
        places = _lines(complex(values["Q225"], values["Q226"]), columns, rows, along, across, to_and_fro=True)
    change: Values = {name: values[name] for name in ("Q200", "Q203", "Q204") if name in values}
    _visit(state, block, [(place, 0.0) for place in places], change, far=bool(values.get("Q301", 1.0)))


def _visit(
    state: State, block: CurrentBlock, points: list[tuple[complex, float]], change: Values, far: bool = True,
    least: float = -math.inf, rapid: bool = True,
) -> None:  # fmt: skip
    """Call the cycle at points with what each adds to the surface; between them not below `least`."""
    plain, unit, (first, second, normal) = state.plain, state.length_scale, PLANES[state.plane]
    cycle = plain.cycle[1] | change if plain.cycle else {}
    block.refuse_if("Q203" not in cycle or not points, None, "without a cycle to call, or points", "CYCL DEF before it")
    for count, (place, more) in enumerate(points, 1):
        surface = cycle["Q203"] + more
        clear = surface + cycle["Q200"]
        high = max(clear, surface + cycle.get("Q204", 0.0), least) if count == 1 or far else clear
        go(state, block, {normal: high * unit}, rapid=True)
        go(state, block, {first: place.real * unit, second: place.imag * unit}, rapid=rapid)
        call(state, block, change | {"Q203": surface} | ({} if far or count == len(points) else {"Q204": 0.0}))


def pattern(state: State, block: CurrentBlock, text: str, number: Callable[[str], float]) -> None:
    """PATTERN DEF: points for CYCL CALL PAT, each with what it adds to the surface; `number` reads a value."""
    points, here, forms = list[tuple[complex, float]](), 0j, _FORM.findall(text)
    block.refuse_if(len(forms) != text.count("(") or not forms, None, "with a form that is not known", ", ".join(FORMS))
    for kind, words in forms:
        v = defaultdict(float, {name: number(value) for name, value in _WORD.findall(words)})
        wrong = ({name.removeprefix("I") for name in v} ^ set(FORMS[kind].split())) - UNASKED
        block.refuse_if(wrong or _WORD.sub("", words).strip(), None, f"{kind} with other words", FORMS[kind])
        here = complex(v["X"] if "X" in v else here.real + v["IX"], v["Y"] if "Y" in v else here.imag + v["IY"])
        count, rows = (_count(block, value or 1.0) for value in (v["NUMX"] or v["NUM"], v["NUMY"]))
        along, across = turned(v["ROT"] + v["ROTX"], v["DX"] or v["D"]), 1j * turned(v["ROT"] + v["ROTY"], v["DY"])
        circle = _circle(here, count, v["D"], v["START"], v["STEP"] or 360.0 / count)
        places = circle if "CIRC" in kind else _lines(here, count, rows, along, across)
        points += [(place, v["Z"]) for place in places]
    if "PAT" in dict(forms):
        state.assume("PATTERN DEF goes to the points of PAT line by line, each line in the same direction")
    state.plain.pattern = points


def _count(block: CurrentBlock, value: float) -> int:
    block.refuse_if(
        value != int(value) or not 1 <= value <= MOST_POINTS, None, f"with {value:g} for a number of points"
    )
    return int(value)


def _circle(middle: complex, count: int, diameter: float, first: float, step: float) -> list[complex]:
    return [middle + turned(first + index * step, diameter / 2.0) for index in range(count)]


def _lines(
    start: complex, columns: int, rows: int, along: complex, across: complex, to_and_fro: bool = False
) -> list[complex]:
    ways = range(columns), range(columns)[::-1]
    return [start + i * along + j * across for j in range(rows) for i in ways[j % 2 if to_and_fro else 0]]


def call_statement(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL CALL: at the present point; CYCL CALL POS: at a point, its height added to the surface's."""
    change, plain = None, state.plain
    if code == "CYCL CALL PAT":
        rapid, high = feed(state, block), present(state)[PLANES[state.plane][2]] / state.length_scale
        _visit(state, block, plain.pattern, {}, least=high, rapid=rapid)
        return
    if code == "CYCL CALL POS" and plain.cycle is not None:
        normal, there, unit = PLANES[state.plane][2], named(state, block), state.length_scale
        block.take("F"), block.take("FMAX")
        surface = plain.cycle[1].get("Q203", 0.0) + there.pop(normal, 0.0) / unit
        block.refuse_if(not there, None, "without its point", "X and Y")
        change = {"Q203": surface}
        if present(state)[normal] < surface * unit:  # below the surface: first up
            go(state, block, {normal: (surface + plain.cycle[1].get("Q200", 0.0)) * unit}, rapid=True)
        go(state, block, there, rapid=True)
    call(state, block, change)
