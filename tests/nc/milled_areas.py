"""Random milling cycles of Heidenhain's language, and what the cycles alone say of their paths: walls, floors, ends.

Written from the manuals, for `plain_language`; shares nothing with the package. Claims are functions of the moves of a
cycle in program coordinates (kind, points), which return what is wrong, or "".
"""

import math
import random
from collections.abc import Callable
from itertools import pairwise

import numpy as np

NEAR = 1e-4
Moves = list[tuple[str, np.ndarray]]
Claim = Callable[[Moves], str]


def cuts(moves: Moves) -> list[np.ndarray]:
    """Points (x + iy, height) of level cuts, a row a move, with the point that each begins at."""
    levels, last = [], None
    for kind, points in moves:
        if kind == "F" and last is not None and np.ptp([last[2], *points[:, 2]]) < 1e-9:
            levels.append(np.array([last, *points]))
        last = points[-1]
    return levels


def floors_wrong(moves: Moves, top: float, bottom: float, infeed: float) -> str:
    """Heights of level cuts against infeeds from the top, the last one shorter."""
    heights, expected, height = {round(level[0, 2], 6) for level in cuts(moves) if level[0, 2] < top}, set(), top
    while height - infeed > bottom + 1e-9 and infeed > 0.0:
        height -= infeed
        expected.add(round(height, 6))
    return "" if heights == expected | {round(bottom, 6)} else f"floors {sorted(heights)}"


def rounded_rectangle(points: np.ndarray, half: complex, corner: float) -> np.ndarray:
    """How far points lie within a rectangle with rounded corners about 0 (negative: outside)."""
    x, y = np.abs(points.real) - half.real + corner, np.abs(points.imag) - half.imag + corner
    return corner - np.where((x > 0.0) & (y > 0.0), np.hypot(x, y), np.maximum(x, y))


def form(number: int, q: dict[str, float], here: complex, radius: float) -> tuple[Claim, tuple[float, float, float]]:
    """The claim of cycles 208, 251, 252, 253, 256, 257 called at a point, and where the tool stands after it."""
    diameter = q["Q335"] if number == 208 else q.get("Q223", 0.0)
    half = complex(q.get("Q218", diameter), q.get("Q219", diameter)) / 2.0
    corner = min(half.real, half.imag) if number in (208, 252, 253, 257) else q["Q220"]
    turn, spare = math.radians(q.get("Q374", q.get("Q224", 0.0))), q.get("Q368", 0.0)
    top, bottom = q["Q203"], q["Q203"] + q["Q201"] + q.get("Q369", 0.0)

    def claim(moves: Moves) -> str:
        if wrong := floors_wrong(moves, top, bottom, q.get("Q202", 0.0)):
            return wrong
        level = np.concatenate(cuts(moves))
        level = level[abs(level[:, 2] - bottom) < 1e-6]
        inside = rounded_rectangle((level[:, 0] + 1j * level[:, 1] - here) * np.exp(-1j * turn), half, corner)
        inside = -inside if number > 255 else inside
        return "" if abs(inside.min() - radius - spare) < NEAR else f"wall: {inside.min()} for {radius + spare}"

    return claim, (here.real, here.imag, top + max(q["Q204"], q["Q200"]))


def _to_edges(points: np.ndarray, corners: list[complex]) -> np.ndarray:
    """Signed distances (edge, point) to the left of a chain's edges, nan beside their ends."""
    rows = []
    for a, b in pairwise(corners):
        along = (points - a) / (b - a)
        rows.append(np.where((along.real > 0.0) & (along.real < 1.0), along.imag * abs(b - a), np.nan))
    return np.array(rows)


def _near(points: np.ndarray, corners: list[complex]) -> np.ndarray:
    """Distances of points from a chain."""
    sides = np.nan_to_num(abs(_to_edges(points, corners)), nan=np.inf).min(axis=0)
    return np.minimum(sides, abs(points - np.array(corners)[:, None]).min(axis=0))


def contour_cycle(number: int, q: dict[str, float], contours: list[tuple[list[complex], int]], radius: float) -> Claim:
    """The claim of cycles 22, 24 and 25 on chains of lines with their sides (+1: the tool to the left)."""
    reach = radius + q["Q14" if number == 24 else "Q3"]
    top, bottom = q["Q5"], q["Q5"] + q["Q1"] + (q["Q4"] if number == 22 else 0.0)
    way = q["Q15"] if number == 25 else q["Q9"]

    def claim(moves: Moves) -> str:
        if wrong := floors_wrong(moves, top, bottom, abs(q["Q10"])):
            return wrong
        levels = cuts(moves)
        dense = np.concatenate([row[0] + np.linspace(0, 1, 9)[:, None] * (row[-1] - row[0]) for row in levels])
        exact = np.concatenate(levels)
        for corners, side in contours:
            where = exact[:, 0] + 1j * exact[:, 1]
            if abs(_near(where, corners).min() - reach) > NEAR:
                return f"distance {_near(where, corners).min()} for {reach}"
            lines = dense[:, 0] + 1j * dense[:, 1]
            for edge in side * _to_edges(lines, corners):
                if not (abs(edge - reach) < NEAR).any():
                    return "an edge that is not milled"
            ahead = [(row[-1] - row[0]) @ (1, 1j, 0) for row in levels]
            middle = [(row[-1] + row[0]) @ (1, 1j, 0) / 2.0 for row in levels]
            beside = side * _to_edges(np.array(middle), corners)
            for edge, a, b in zip(beside, corners, corners[1:], strict=False):
                goes = {
                    int(np.sign(((v / (b - a)) * side).real))
                    for v, apart in zip(ahead, edge, strict=True)
                    if abs(apart - reach) < NEAR and abs(v) > 1.0 and abs((v / (b - a)).imag) < 1e-6
                }
                if number != 22 and way and goes != {int(way)}:
                    return f"direction {goes}"
        return ""

    return claim


def random_form(chance: random.Random) -> list[str]:
    """A bore, pocket, slot or stud at a point."""
    number, top, deep = chance.choice((208, 251, 252, 253, 256, 257)), chance.randrange(-3, 4), chance.randrange(2, 12)
    wide, narrow = chance.randrange(24, 40), chance.randrange(12, 22)
    spare, low = chance.choice((0, 0.5)), chance.choice((0, 0.25))
    own = {
        208: f"Q334={chance.randrange(1, 4)} Q335={chance.randrange(7, 12)}",
        251: f"Q215=1 Q218={wide} Q219={narrow} Q220=4 Q224={chance.randrange(-90, 90)} Q368={spare} Q369={low}",
        252: f"Q215=1 Q223={narrow} Q368={spare} Q369={low}",
        253: f"Q215=1 Q218={wide} Q219={narrow} Q374={chance.randrange(-90, 90)} Q368={spare} Q369={low}",
        256: f"Q218={wide} Q219={narrow} Q220=4 Q224={chance.randrange(-90, 90)} Q424={wide + 8} Q425={narrow + 8}",
        257: f"Q223={narrow} Q222={narrow + 9}",
    }[number]
    own += "" if number == 208 else f" Q202={chance.randrange(1, 6)} Q207=300 Q351={chance.choice('+-')}1"
    return [
        f"CYCL DEF {number} FORM Q200=2 Q201=-{deep} Q203={top} Q204={chance.choice((0, 15))} Q206=100 {own}",
        f"L X{chance.uniform(-9, 9):+.3f} Y{chance.uniform(-9, 9):+.3f} R0 FMAX M99",
    ]


def random_contours(chance: random.Random, label: int) -> tuple[list[str], list[str]]:
    """A cycle of contours, and the subprograms that draw them."""
    number, spare, side = chance.choice((22, 24, 25)), chance.choice((0, 0.4)), chance.choice(("RL", "RR"))
    count, way = chance.randrange(5, 8), chance.choice((1, -1))
    angles = [(index + chance.uniform(0.0, 0.4)) * math.tau / count for index in range(count)]
    outer = [complex(r * math.cos(a), r * math.sin(a)) for a in angles for r in [chance.uniform(34, 46)]]
    inner = [complex(r * math.cos(a), r * math.sin(a)) for a in angles for r in [chance.uniform(9, 14)]]
    drawn = [outer, inner] if number != 25 else [outer[:-1]]
    q = f"Q1=-{chance.randrange(2, 9)} Q3={spare} Q5={chance.randrange(-2, 3)}"
    if number == 25:
        lines = [
            f"CYCL DEF 25 TRAIN {q} Q7=20 Q10={chance.randrange(2, 6)} Q11=90 Q12=300 Q15={chance.choice((1, -1))}"
        ]
    else:
        lines = [f"CYCL DEF 20 DATA {q} Q2=1 Q4={chance.choice((0, 0.3))} Q6=2 Q7=20 Q8=0 Q9={way}"]
        own = "" if number == 22 else f" Q9={way} Q14={spare}"
        lines.append(f"CYCL DEF {number} CONTOURS Q10={chance.randrange(2, 6)} Q11=90 Q12=300{own}")
    subs = []
    for index, corners in enumerate(drawn):
        closed = [*corners, corners[0]] if number != 25 else corners
        run = closed if chance.random() < 0.5 else closed[::-1]
        inside = run == closed  # counter-clockwise: the inside is to the left
        word = side if number == 25 else "RL" if inside == (index == 0) else "RR"
        steps = [f"L X{p.real:+.6f} Y{p.imag:+.6f}{' ' + word if i < 2 else ''}" for i, p in enumerate(run)]
        subs += [f"LBL {label + index}", *steps, "LBL 0"]
    named = " /".join(str(label + index) for index in range(len(drawn)))
    lines = [f"CYCL DEF 14.1 LABEL {named}", *lines, "L X+0 Y+0 Z+25 FMAX", "CYCL CALL"]
    return [*lines, f"L X{chance.uniform(-9, 9):+.3f} Y{chance.uniform(-9, 9):+.3f} FMAX"], subs


def random_free(chance: random.Random) -> list[str]:
    """Elements of a free contour, each determined by its own data."""
    x, y = (round(chance.uniform(-20, 20), 3) for _ in "xy")
    lines = [f"L X{x:+} Y{y:+} F300", f"L X{x + 5:+.3f} Y{y + 3:+.3f}"]
    for _ in range(chance.randrange(1, 5)):
        kind, size, sign = chance.randrange(4), chance.uniform(4, 15), chance.choice("+-")
        lines.append((
            f"FL X{chance.uniform(-30, 30):+.3f} Y{chance.uniform(-30, 30):+.3f}",
            f"FL AN{chance.uniform(-180, 180):+.3f} LEN{size:.3f}",
            f"FLT LEN{size:.3f}",
            f"FCT DR{sign} R{size:.3f} CCA{chance.uniform(20, 300):.3f}",
        )[kind])  # fmt: skip
    return [*lines, "L IX+4 IY+5"]


def random_pattern(chance: random.Random) -> list[str]:
    """Holes at the points of a pattern."""
    x, y, d = (round(chance.uniform(-20, 20), 2) for _ in "xyd")
    form_ = chance.choice((
        f"POS1 (X{x:+} Y{y:+} Z+0) POS2 (X{y:+} Y{d:+} Z-1)",
        f"ROW1 (X{x:+} Y{y:+} D{d:+} NUM{chance.randrange(1, 4)} ROT{chance.randrange(-90, 90):+} Z+0)",
        f"CIRC1 (X{x:+} Y{y:+} D{abs(d)} START{chance.randrange(-90, 90):+} NUM{chance.randrange(1, 5)} Z-2)",
    ))  # fmt: skip
    hole = f"CYCL DEF 201 HOLE Q200=2 Q201=-{chance.randrange(1, 9)} Q206=100 Q208=100 Q211=0 Q203=0"
    return [f"PATTERN DEF {form_}", f"{hole} Q204={chance.choice((0, 12))}", "L Z+14 FMAX", "CYCL CALL PAT FMAX"]
