"""A small reader of Heidenhain's plain language, written for the tests from the manuals alone.

It shares nothing with the package, and reads the programs of `random_program`, one statement a line, to moves: kind,
points along the way, tool axis.
"""

import math
import random
import re

import numpy as np

from tests.nc import milled_areas

NAMES = {"SIN": lambda d: math.sin(math.radians(d)), "COS": lambda d: math.cos(math.radians(d)), "SQRT": math.sqrt}
SHARES = (0.25, 0.5, 0.75, 1.0)


def turn_about(axis: int, degrees: float) -> np.ndarray:
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    matrix, t = np.eye(4), math.radians(degrees)
    matrix[a, a] = matrix[b, b] = math.cos(t)
    matrix[a, b], matrix[b, a] = -math.sin(t), math.sin(t)
    return matrix


class Reader:
    """Reads a program; `moves` are (kind, points (4, 3) in mm, tool axis).

    A milling cycle, whose inner way no manual gives, is one: ("M", line, (claim, frame, end or None)). "E" is a rapid
    from where such a cycle ended, of which only the end is known.
    """

    def __init__(self, text: str) -> None:
        self.lines = [re.sub(r"^\d+ ", "", line) for line in text.splitlines()]
        self.q: dict[str, float] = {}
        self.at, self.pole, self.heading = np.zeros(3), None, None  # program coordinates
        self.axes = [0, 1]  # of the pole
        self.where = np.zeros(3)  # of the part
        self.moves: list = []
        self.shift, self.inner, self.angle, self.mirror, self.factor = np.zeros(3), np.zeros(3), 0.0, set(), 1.0
        self.tilt = np.eye(4)
        self.cycle, self.modal, self.ended = None, False, False
        self.radius, self.data, self.labels, self.pattern, self.lost = 0.0, {}, [], [], False
        self.run(0, len(self.lines))

    @property
    def frame(self) -> np.ndarray:
        first, second = np.eye(4), np.eye(4)
        first[:3, 3], second[:3, 3] = self.shift, self.inner
        inside = np.diag([-1.0 if axis in self.mirror else 1.0 for axis in range(3)] + [1.0])
        return first @ self.tilt @ second @ turn_about(2, self.angle) @ inside @ np.diag([self.factor] * 3 + [1.0])

    def number(self, text: str) -> float:
        text = text.strip()
        sign = -1.0 if text[0] == "-" else 1.0
        return sign * (self.q[text.lstrip("+-")] if "Q" in text else float(text.lstrip("+-")))

    def words(self, line: str) -> dict[str, str]:
        return dict(
            re.findall(
                r"(?<![A-Z])(IPA|IPR|PA|PR|I?[XYZ]|R|F|Q\d+(?==)|ROT|SCL|SP[ABC])\s*=?([+-]?(?:Q\d+|[\d.]+))", line
            )
        )

    def run(self, first: int, last: int, till_zero: bool = False) -> None:
        row, left = first, {}
        while row < last and not self.ended:
            line = self.lines[row]
            if till_zero and line == "LBL 0":
                return
            call, jump = (
                re.match(r"CALL LBL (\d+)(?: REP(\d+))?", line),
                re.match(r"FN 12: IF (\S+) LT (\S+) GOTO LBL (\d+)", line),
            )
            if call and not call[2]:
                self.run(self.label(call[1]) + 1, len(self.lines), True)
            elif call:
                left.setdefault(row, int(call[2]))
                left[row] -= 1
                if left[row] >= 0:
                    row = self.label(call[1])
                else:
                    del left[row]
            elif jump and self.number(jump[1]) < self.number(jump[2]) - 1e-9:
                row = self.label(jump[3])
            elif not jump:
                self.statement(line, row)
            row += 1

    def label(self, number: str) -> int:
        return self.lines.index(f"LBL {number}")

    def statement(self, line: str, row: int) -> None:
        head = line.split(maxsplit=1)[0] if line else ""
        words, self.row = self.words(line), row
        if line.startswith("TOOL DEF"):
            self.radius = self.number(words["R"])
        elif line.startswith("CYCL DEF 14.1"):
            self.labels = re.findall(r"\d+", line.split("LABEL")[1])
        elif line.startswith("PATTERN DEF"):
            self.pattern = [point for form in re.findall(r"([A-Z]+)\d \(([^)]*)\)", line) for point in points_of(*form)]
        elif line.startswith("CYCL CALL PAT"):
            self.visit()
        elif head in ("FL", "FLT", "FCT"):
            self.free(head, line)
        elif head.startswith("Q") and "=" in line:
            name, formula = line.split("=", 1)
            values = {f"v{k[1:]}": v for k, v in self.q.items()}
            self.q[name.strip()] = eval(re.sub(r"Q(\d+)", r"v\1", formula).replace("^", "**"), {**NAMES, **values})
        elif line.startswith("CYCL DEF 7."):
            target = self.inner if not np.array_equal(self.tilt, np.eye(4)) else self.shift
            for axis, letter in enumerate("XYZ"):
                if letter in words:
                    target[axis] = self.number(words[letter])
                if f"I{letter}" in words:
                    target[axis] += self.number(words[f"I{letter}"])
            self.moved()
        elif line.startswith("CYCL DEF 8."):
            self.mirror = {"XYZ".index(letter) for letter in line.split()[3:]}
            self.moved()
        elif line.startswith("CYCL DEF 10."):
            self.angle = self.number(words["ROT"])
            self.moved()
        elif line.startswith("CYCL DEF 11."):
            self.factor = self.number(words["SCL"])
            self.moved()
        elif line.startswith("PLANE"):
            a, b, c = (self.number(words[f"SP{letter}"]) for letter in "ABC") if "SPATIAL" in line else (0.0, 0.0, 0.0)
            new = turn_about(2, c) @ turn_about(1, b) @ turn_about(0, a)
            if not np.allclose(new[:3, 2], self.tilt[:3, 2], atol=1e-14):
                self.moves.append(("R", np.array([self.where] * 4), new[:3, 2]))
            self.tilt = new
            self.moved()
        elif line.startswith("CYCL DEF 2"):
            values = {k: self.number(v) for k, v in re.findall(r"(Q\d+)=(\S+)", line)}
            self.q |= values
            if line.startswith("CYCL DEF 20 "):
                self.data = values
            else:
                self.cycle, self.modal = (int(line.split()[2]), values), False
        elif head in ("L", "LP", "C", "CP", "CR", "CT"):
            self.contour(head, line, words, row)
        elif head == "CC":
            named = {axis for axis in range(3) if {"XYZ"[axis], "I" + "XYZ"[axis]} & words.keys()}
            self.axes = next((list(pair) for pair in ((2, 0), (1, 2)) if {*pair} == named), [0, 1])
            self.pole = np.array([self.coordinate(words, axis) for axis in self.axes])
        elif line.startswith("CYCL CALL"):
            self.drill()
        elif head == "M30":
            self.ended = True

    def moved(self) -> None:
        self.at = (np.linalg.inv(self.frame) @ [*self.where, 1.0])[:3]
        self.pole = self.heading = None

    def coordinate(self, words: dict[str, str], axis: int) -> float:
        letter = "XYZ"[axis]
        if letter in words:
            return self.number(words[letter])
        return self.at[axis] + (self.number(words[f"I{letter}"]) if f"I{letter}" in words else 0.0)

    def contour(self, head: str, line: str, words: dict[str, str], row: int) -> None:
        end = np.array([self.coordinate(words, axis) for axis in range(3)])
        axes = self.axes if head in ("LP", "C", "CP") else [0, 1]
        start, sweep, middle = self.at[axes], 0.0, None
        if head in ("LP", "CP"):
            away = start - self.pole
            radius = self.number(words["PR"]) if "PR" in words else math.hypot(*away)
            radius += self.number(words["IPR"]) if "IPR" in words else 0.0
            heading = self.number(words["PA"]) if "PA" in words else math.degrees(math.atan2(away[1], away[0]))
            heading += self.number(words["IPA"]) if "IPA" in words else 0.0
            end[axes] = self.pole + radius * np.array(
                [math.cos(math.radians(heading)), math.sin(math.radians(heading))]
            )
        left = "DR+" in line
        if head in ("C", "CP"):
            middle = self.pole
        if head == "CR":  # of the two centres that with the wanted side
            radius, chord = self.number(words["R"]), end[:2] - start
            across = np.array([-chord[1], chord[0]]) / math.hypot(*chord)
            height = math.sqrt(max(radius**2 - chord @ chord / 4.0, 0.0))
            centers = [(start + end[:2]) / 2.0 + sign * height * across for sign in (1.0, -1.0)]
            spans = [self.span(start, end[:2], center, left) for center in centers]
            middle = centers[int(np.argmin(np.abs(spans)) if radius > 0.0 else np.argmax(np.abs(spans)))]
        if head == "CT":  # the centre is as far from both ends, across the heading
            across, chord = np.array([-self.heading[1], self.heading[0]]), end[:2] - start
            middle = start + across * (chord @ chord) / (2.0 * (across @ chord))
            left = bool(across @ chord > 0.0)
        if middle is not None:
            sweep = self.span(start, end[axes], middle, left)
            if head == "CP" and "IPA" in words:
                sweep = math.radians(self.number(words["IPA"]))
        follow = self.lines[row + 1] if row + 1 < len(self.lines) else ""
        corner = re.match(r"(RND R|CHF )([\d.]+)", follow)
        begin = self.at
        if getattr(self, "cut", None) is not None:
            begin, self.cut = self.cut, None
        if corner:  # generated between straight lines alone
            after = self.lines[row + 2]
            kept, self.at = self.at, end
            beyond = np.array([self.coordinate(self.words(after), axis) for axis in range(3)])
            self.at = kept
            u, v = (end - self.at) / np.linalg.norm(end - self.at), (beyond - end) / np.linalg.norm(beyond - end)
            turned = math.atan2(u[0] * v[1] - u[1] * v[0], u @ v)
            size = float(corner[2])
            back = size * math.tan(abs(turned) / 2.0) if corner[1] == "RND R" else size
            self.add("F", [begin + share * (end - back * u - begin) for share in SHARES])
            first, last = end - back * u, end + back * v
            if corner[1] == "CHF ":
                self.add("F", [first + share * (last - first) for share in SHARES])
            else:
                center = first + math.copysign(size, turned) * np.array([-u[1], u[0], 0.0])
                self.add(
                    "F", [center + (turn_about(2, math.degrees(turned * s))[:3, :3] @ (first - center)) for s in SHARES]
                )
            self.cut = last
        elif middle is None:
            self.add("R" if "FMAX" in line else "F", [begin + share * (end - begin) for share in SHARES])
        else:
            points = []
            for share in SHARES:
                out = turn_about(2, math.degrees(sweep * share))[:2, :2] @ (start - middle)
                points.append(self.at + share * (end - self.at))
                points[-1][axes] = middle + out
            self.add("F", points)
        ahead = (
            end[:2] - self.at[:2]
            if middle is None
            else np.sign(sweep) * np.array([-(end[:2] - middle)[1], (end[:2] - middle)[0]])
        )
        self.heading = ahead / math.hypot(*ahead) if math.hypot(*ahead) > 0.0 and axes == [0, 1] else None
        self.at = end
        if "M99" in line or (self.modal and head == "L") or "M89" in line:
            self.modal = ("M89" in line or self.modal) and "M99" not in line
            self.drill()

    def span(self, start, end, center, left) -> float:
        a, b = start - center, end - center
        sweep = (math.atan2(b[1], b[0]) - math.atan2(a[1], a[0])) % (2.0 * math.pi)
        sweep = 2.0 * math.pi if sweep < 1e-9 or sweep > 2.0 * math.pi - 1e-9 else sweep
        return sweep if left else sweep - 2.0 * math.pi if sweep < 2.0 * math.pi - 1e-12 else -2.0 * math.pi

    def add(self, kind: str, points: list) -> None:
        placed = np.array([(self.frame @ [*point, 1.0])[:3] for point in points])
        if self.lost:
            kind, self.lost = "E", False
        if np.abs(placed - self.where).max() > 1e-9:
            self.moves.append((kind, placed, self.tilt[:3, 2]))
        self.where = placed[-1]

    def to(self, kind: str, height: float) -> None:
        top = np.array([*self.at[:2], height])
        self.add(kind, [self.at + share * (top - self.at) for share in SHARES])
        self.at = top

    def drill(self) -> None:
        number, q = self.cycle
        if number not in (200, 201, 207):
            self.mill(number, q)
            return
        top, floor, clear = q["Q203"], q["Q203"] + q["Q201"], q["Q203"] + q["Q200"]
        self.to("R", clear)
        depth = top
        if number == 200:
            while depth - q["Q202"] > floor + 1e-9:
                depth -= q["Q202"]
                self.to("F", depth)
                self.to("R", clear)
                self.to("R", depth + q["Q200"])
        self.to("F", floor)
        self.to("F" if number in (201, 207) else "R", clear)
        if q["Q204"] > q["Q200"]:
            self.to("R", top + q["Q204"])
        self.heading = None

    def mill(self, number: int, q: dict[str, float]) -> None:
        """A milling cycle: what it says of its path, and where the tool stands after it."""
        end = None
        if number in (22, 24, 25):
            named = self.labels if number != 25 else self.labels[:1]
            claim = milled_areas.contour_cycle(number, self.data | q, [self.chain(name) for name in named], self.radius)
            self.lost, self.at = True, np.array([*self.at[:2], (self.data | q)["Q7"]])
        else:
            claim, end = milled_areas.form(number, q, complex(*self.at[:2]), self.radius)
            self.at = np.array(end)
        self.moves.append(("M", self.row + 1, (claim, self.frame, end)))
        self.where, self.heading = (self.frame @ [*self.at, 1.0])[:3], None

    def chain(self, label: str) -> tuple[list[complex], int]:
        """Corners of a contour of straight lines, and +1 for RL."""
        first = self.label(label) + 1
        lines = self.lines[first : self.lines.index("LBL 0", first)]
        words = [self.words(line) for line in lines]
        return [complex(float(w["X"]), float(w["Y"])) for w in words], 1 if "RL" in lines[0] else -1

    def visit(self) -> None:
        """CYCL CALL PAT: the cycle at each point, the tool not below where it stands."""
        (number, q), least = self.cycle, self.at[2]
        for place, more in self.pattern:
            top = q["Q203"] + more
            self.to("R", max(top + q["Q200"], top + q["Q204"], least))
            there = np.array([*place, self.at[2]])
            self.add("R", [self.at + share * (there - self.at) for share in SHARES])
            self.at, self.cycle = there, (number, q | {"Q203": top})
            self.drill()
        self.cycle = number, q

    def free(self, head: str, line: str) -> None:
        """An element of a free contour that its own data determine."""
        w = {k: float(v) for k, v in re.findall(r"(?<![A-Z])(AN|LEN|CCA|R|X|Y)([+-]?[\d.]+)", line)}
        here, ahead = complex(*self.at[:2]), complex(*self.heading)
        if head == "FCT":
            turn = 1.0 if "DR+" in line else -1.0
            center = here + 1j * turn * w["R"] * ahead
            spins = [np.exp(1j * turn * math.radians(w["CCA"]) * share) for share in SHARES]
            points, ahead = [center + (here - center) * spin for spin in spins], ahead * spins[-1]
        else:
            ahead = np.exp(1j * math.radians(w["AN"])) if "AN" in w else ahead
            end = complex(w["X"], w["Y"]) if "X" in w else here + w["LEN"] * ahead
            points, ahead = [here + share * (end - here) for share in SHARES], (end - here) / abs(end - here)
        self.add("F", [np.array([p.real, p.imag, self.at[2]]) for p in points])
        self.at, self.heading = np.array([points[-1].real, points[-1].imag, self.at[2]]), [ahead.real, ahead.imag]


def points_of(kind: str, text: str) -> list[tuple[tuple[float, float], float]]:
    """Points of a form of PATTERN DEF, with what each adds to the surface."""
    w = {k: float(v) for k, v in re.findall(r"([A-Z]+)([+-]?[\d.]+)", text)}
    start, count = complex(w["X"], w["Y"]), int(w.get("NUM", 1))
    steps = [w.get("D", 0.0) * k * np.exp(1j * math.radians(w.get("ROT", 0.0))) for k in range(count)]
    if kind == "CIRC":
        steps = [w["D"] / 2.0 * np.exp(1j * math.radians(w["START"] + 360.0 * k / count)) for k in range(count)]
    return [((place.real, place.imag), w["Z"]) for place in (start + step for step in steps)]


def random_program(seed: int) -> str:
    """A program of statements whose path both readers must find; coordinates of a thousandth of a millimetre."""
    chance = random.Random(seed)
    reader_free = [f"{k} {line}" for k, line in enumerate(_statements(chance))]
    return "\n".join(reader_free) + "\n"


def _number(chance: random.Random, size: float = 40.0) -> str:
    if chance.random() < 0.1:
        return chance.choice(("+Q1", "-Q2", "+Q3"))
    return f"{chance.uniform(-size, size):+.{chance.randrange(4)}f}"


def _point(chance: random.Random, letters: str = "XYZ") -> str:
    named = [letter for letter in letters if chance.random() < 0.8] or [letters[0]]
    return " ".join(("I" if chance.random() < 0.25 else "") + letter + _number(chance) for letter in named)


def _statements(chance: random.Random) -> list[str]:
    lines = [
        "BEGIN PGM HUNT MM",
        "BLK FORM 0.1 Z X-50 Y-50 Z-50",
        "BLK FORM 0.2 X+50 Y+50 Z+0",
        "TOOL DEF 1 L+0 R+3",
        "TOOL CALL 1 Z S1000 F500",
    ]
    lines += [
        f"Q1 = {chance.uniform(-9, 9):.3f}",
        "Q2 = Q1 * (2 - 3 ^ 2) / 4 + SQRT(9)",
        "Q3 = 5 * SIN(30) + COS(60) - Q1",
    ]
    lines += ["L X+1 Y+2 Z+30 R0 FMAX M3"]
    tilted, subs, labels = False, [], 10
    for _ in range(chance.randrange(3, 14)):
        kind = chance.randrange(16)
        if kind > 11:
            place = [f"CYCL DEF 7.1 {_point(chance)}", f"CYCL DEF 10.1 ROT{chance.uniform(-180, 180):+.2f}"]
            lines += [*RESET, *(place if chance.random() < 0.7 else []), "L X+1 Y+2 Z+30 FMAX"]
            if kind == 12:
                lines += milled_areas.random_form(chance)
            elif kind == 13:
                labels += 2
                milled, drawn = milled_areas.random_contours(chance, labels - 1)
                lines, subs = [*lines, *milled], [*subs, *drawn]
            else:
                lines += (milled_areas.random_free if kind == 14 else milled_areas.random_pattern)(chance)
        elif kind == 0:
            lines += _frame(chance)
        elif kind == 6:
            lines += _cam(chance)
        elif kind == 1 and not tilted:
            angles = [chance.choice((0, 90, -90, round(chance.uniform(-80, 80), 2))) for _ in range(3)]
            lines += ["CYCL DEF 10.1 ROT+0", "CYCL DEF 8.1", "CYCL DEF 11.1 SCL 1", "CYCL DEF 7.1 X+0 Y+0 Z+0"]
            lines += [
                "PLANE SPATIAL SPA{:+} SPB{:+} SPC{:+} TURN FMAX".format(*angles),
                "L X+0 Y+0 FMAX",
                "L Z+40 FMAX",
            ]
            lines += [*_run(chance), "PLANE RESET STAY", f"L {_point(chance, 'XY')} FMAX", "L X+0 Y+0 Z+50 FMAX"]
        elif kind == 2:
            q = [
                chance.randrange(1, 4),
                -chance.randrange(1, 20),
                chance.randrange(50, 300),
                round(chance.uniform(1, 6), 1),
            ]
            number = chance.choice((200, 201, 207))
            own = {200: f" Q202={q[3]}", 201: " Q208=100 Q211=0", 207: " Q239=1.5"}[number]
            feed = "" if number == 207 else f" Q206={q[2]}"
            high = chance.choice((0, 15))
            lines.append(
                f"CYCL DEF {number} HOLE Q200={q[0]} Q201={q[1]}{feed}{own} Q203={chance.randrange(-3, 4)} Q204={high}"
            )
            lines += [f"L {_point(chance, 'XY')} R0 FMAX M99" for _ in range(chance.randrange(1, 4))]
            if chance.random() < 0.3:
                lines += [
                    f"L {_point(chance, 'XY')} FMAX M89",
                    f"L {_point(chance, 'XY')} FMAX",
                    f"L {_point(chance, 'XY')} FMAX M99",
                ]
        elif kind == 3:
            labels += 1
            lines += [f"LBL {labels}", *_run(chance, steps=True), f"CALL LBL {labels} REP{chance.randrange(1, 4)}"]
        elif kind == 4:
            labels += 1
            lines.append(f"CALL LBL {labels}")
            subs += [f"LBL {labels}", *_run(chance), "LBL 0"]
        elif kind == 5:
            labels += 1
            lines += [
                "Q9 = 0",
                f"LBL {labels}",
                "Q9 = Q9 + 1",
                f"L IX{_number(chance, 9)} F200",
                f"FN 12: IF +Q9 LT +{chance.randrange(1, 5)} GOTO LBL {labels}",
            ]
        else:
            lines += _run(chance)
    return [*lines, "M30", *subs, "END PGM HUNT MM"]


def _cam(chance: random.Random) -> list[str]:
    """A long stretch as CAM systems write it, arcs with their centres among it."""
    lines, x, y = ["L X+0 Y+0 Z+5 FMAX"], 0.0, 0.0
    for _ in range(chance.randrange(8, 30)):
        kind = chance.randrange(6)
        if kind == 0:
            a, radius, sign = chance.uniform(-3, 3), chance.uniform(1, 20), chance.choice("+-")
            cx, cy = round(x + radius * math.cos(a), 4), round(y + radius * math.sin(a), 4)
            b, radius = chance.uniform(-3, 3), math.hypot(cx - x, cy - y)
            x, y = round(cx + radius * math.cos(b), 4), round(cy + radius * math.sin(b), 4)
            lines += [f"CC X{cx:+} Y{cy:+}", f"C X{x:+} Y{y:+} DR{sign}"]
        elif kind == 1:
            step = round(chance.uniform(-5, 5), 3)
            y = round(y + step, 4)
            lines.append(f"L IY{step:+} IZ{chance.choice('+-')}1 F{chance.randrange(100, 900)}")
        else:
            x, y = round(chance.uniform(-60, 60), 3), round(chance.uniform(-60, 60), 3)
            end = chance.choice(("", "", " R0 FMAX", " F400", f" Z{chance.randrange(-9, 9):+}", " FMAX M3"))
            lines.append(f"L X{x:+} Y{y:+}" + end.replace(" Z", " Z", 1))
    return [
        *lines,
        f"CP IPA{chance.choice('+-')}90 DR+".replace("-90 DR+", "-90 DR-") if "CC" in "".join(lines) else "L IX+1",
        "L IX+3 IY+1",
        "CT IX+2 IY+7",
    ]


RESET = ("CYCL DEF 10.1 ROT+0", "CYCL DEF 8.1", "CYCL DEF 11.1 SCL 1")


def _frame(chance: random.Random) -> list[str]:
    inner = chance.choice(
        (
            ["CYCL DEF 10.1 ROT" + f"{chance.uniform(-180, 180):+.2f}"],
            ["CYCL DEF 8.1 " + chance.choice(("X", "Y", "X Y"))],
            [],
        )
    )
    scale = [f"CYCL DEF 11.1 SCL {chance.choice((0.5, 2, 1.25))}"] if chance.random() < 0.3 else []
    return [*RESET, f"CYCL DEF 7.1 {_point(chance)}", *inner, *scale, f"L {_point(chance)} FMAX"]


def _run(chance: random.Random, steps: bool = False) -> list[str]:
    """A stretch of contour that is valid wherever the tool stands."""
    lines = []
    for _ in range(chance.randrange(1, 6)):
        a, b = chance.uniform(3, 20), chance.uniform(-180, 180)
        sign, kind = chance.choice("+-"), chance.randrange(10)
        if kind == 0:
            lines += [f"CC IX{a:+.3f} IY{b / 9:+.3f}", f"CP IPA{sign}{abs(b) + 1:.2f} DR{sign}"]
        elif kind == 1:
            lines += [f"CC IX{a:+.3f} IY{b / 9:+.3f}", f"CP PA{b:+.3f} DR{sign} F100"]
        elif kind == 2:
            lines += [
                f"CC IX{a:+.3f} IY{b / 9:+.3f}",
                f"CP IPA{sign}{chance.randrange(370, 1000)} IZ{b / 40:+.2f} DR{sign}",
            ]
        elif kind == 3:
            lines += [
                f"CR IX{a:+.3f} IY{b / 9:+.3f} DR{sign}"
                f" R{chance.choice('+-')}{math.hypot(a, b / 9) * chance.uniform(0.6, 3):.3f}"
            ]
        elif kind == 4:
            lines += [f"L IX{a:+.2f} IY{b / 7:+.2f}", f"CT IX{b / 8 + 0.1:+.3f} IY{a + 1:+.3f}"]
        elif kind == 5:
            size = chance.uniform(0.1, 1.5)
            corner = chance.choice((f"RND R{size:.2f}", f"CHF {size:.2f}"))
            lines += [f"L IX{a + 5:+.2f} IY+0", corner, f"L IX{chance.uniform(-4, 9):+.2f} IY{sign}{a + 5:.2f}"]
        elif kind == 6:
            lines += [
                f"CC {'' if chance.random() < 0.3 else 'IX-5 IY+3'}".strip(),
                f"LP PR+{a:.2f} PA{b:+.2f}",
                f"LP IPA{b / 2:+.2f} F300",
                f"LP IPR{a / 5:+.2f}",
            ]
        elif kind == 8:
            lines += [f"CC I{chance.choice('XY')}{a:+.3f} IZ{b / 9:+.3f}", f"CP IPA{sign}{abs(b) + 1:.2f} DR{sign}"]
        elif kind == 7:
            lines += [f"L IX{a:+.3f} FMAX", "CC IX-4 IY+0", f"C IX-4 IY{sign}4 DR{chance.choice('+-')}"]
        else:
            lines += [f"L {_point(chance) if not steps else 'IX+1 IY-2'} F{chance.randrange(50, 900)}"]
    return lines
