"""A small reader of Siemens' language, written for the tests from the manuals alone.

It shares nothing with the package, and reads the programs of `random_program`, one statement a line, to moves: kind,
points along the way, tool axis.
"""

import math
import random
import re

import numpy as np

SHARES = (0.25, 0.5, 0.75, 1.0)
NUMBER = r"[-+]?\d+(?:\.\d+)?"
SCOPE = {
    "SIN": lambda d: math.sin(math.radians(d)), "COS": lambda d: math.cos(math.radians(d)), "SQRT": math.sqrt,
    "POT": lambda v: v * v, "ABS": abs,
}  # fmt: skip


def about(axis: int, degrees: float) -> np.ndarray:
    matrix, (a, b), t = np.eye(4), [(1, 2), (2, 0), (0, 1)][axis], math.radians(degrees)
    matrix[a, a] = matrix[b, b] = math.cos(t)
    matrix[a, b], matrix[b, a] = -math.sin(t), math.sin(t)
    return matrix


def shift(xyz) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = xyz
    return matrix


class Reader:
    """Reads a program; `moves` are (kind, points (4, 3) in mm, tool axis)."""

    def __init__(self, text: str) -> None:
        self.lines = [re.sub(r"^N\d+ ", "", line) for line in text.splitlines()]
        self.names: dict[str, float] = {}
        for row, line in enumerate(self.lines):  # macros
            macro = re.fullmatch(r"DEFINE (\w+) AS (.*)", line)
            if macro:
                self.lines[row:] = [
                    "LZ:",
                    *(re.sub(rf"\b{macro[1]}\b", macro[2], rest) for rest in self.lines[row + 1 :]),
                ]
        self.frame, self.tilt, self.place = np.eye(4), np.eye(4), np.zeros(3)
        self.mode, self.steps, self.pole, self.cycle, self.heading = "G1", False, np.zeros(2), None, None
        self.rounding = 0.0
        self.waiting = None  # of a corner: start, apex, kind, size
        self.moves: list = []
        self.ended = False
        self.run(0, len(self.lines))

    def value(self, text: str) -> float:
        text = re.sub(r"R\[(\w+)\]", lambda m: f"R{m[1] if m[1].isdigit() else int(self.names[m[1]])}", text)
        return float(eval(text.replace("<>", "!="), {"__builtins__": {}}, SCOPE | self.names))

    def run(self, row: int, stop: int) -> None:
        left: dict[int, int] = {}
        while row < stop and not self.ended:
            line, after = self.lines[row], row + 1
            word = line.split(" ")[0].split("(")[0]
            if word == "FOR":
                name, first, last = re.match(r"FOR (\w+)=(\S+) TO (\S+)", line).groups()
                end = self.closing(row, "FOR", "ENDFOR")
                for index in range(int(self.value(first)), int(self.value(last)) + 1):
                    self.names[name] = index
                    self.run(row + 1, end)
                after = end + 1
            elif word == "WHILE":
                end = self.closing(row, "WHILE", "ENDWHILE")
                while self.value(line[6:]):
                    self.run(row + 1, end)
                after = end + 1
            elif word == "IF" and "GOTO" in line:
                condition, label = re.match(r"IF (.*) GOTO[FB] (\w+)", line).groups()
                after = self.lines.index(f"{label}:") if self.value(condition) else after
            elif word == "IF":
                end = self.closing(row, "IF", "ENDIF")
                other = self.closing(row, "IF", "ENDIF", "ELSE")
                self.run(*((row + 1, other) if self.value(line[3:]) else (other + 1, end)))
                after = end + 1
            elif word == "REPEAT":
                label, count = re.match(r"REPEAT (\w+) P=(\d+)", line).groups()
                for _ in range(int(count)):
                    self.run(self.lines.index(f"{label}:"), row)
            elif word.startswith("SUB"):
                head = self.lines.index(f"%_N_{word}_SPF")
                values = re.match(r"\w+\((.*)\)", line)[1].split(",")
                kept, self.names = self.names, dict(self.names)
                for name, given in zip(re.findall(r"REAL (\w+)", self.lines[head + 1]), values, strict=True):
                    self.names[name] = self.value(given)
                self.run(head + 2, self.lines.index("M17", head))
                self.names = kept | {name: v for name, v in self.names.items() if name[0] == "R"}
            elif word == "CASE":
                given, choices, other = re.match(r"CASE (\S+) OF (.*) DEFAULT GOTOF (\w+)", line).groups()
                labels = {float(key): label for key, label in re.findall(r"(\S+) GOTOF (\w+)", choices)}
                after = self.lines.index(f"{labels.get(self.value(given), other)}:")
            elif line == "M30":
                self.ended = True
            elif not line.endswith(":"):
                self.statement(line)
            row = after
        assert not left

    def closing(self, row: int, opens: str, closes: str, other: str = "") -> int:
        depth = 0
        for i in range(row, len(self.lines)):
            begins = self.lines[i].startswith(opens + " ") and "GOTO" not in self.lines[i]
            depth += begins - (self.lines[i] == closes)
            if not depth or (depth == 1 and self.lines[i] == other):
                return i
        raise AssertionError(row)

    def statement(self, line: str) -> None:
        assigned = re.fullmatch(r"(R\d+|R\[\d+\])=(.*)", line)
        if assigned:
            self.names[re.sub(r"\W", "", assigned[1])] = self.value(assigned[2])
            return
        if re.match(r"MCALL|CYCLE|HOLES", line):
            self.drill(line)
            return
        codes = line.split()
        words = {}
        for key, inner, letter, plain in re.findall(r"(?<!\S)(?:([A-Z]+1?)=(\S+)|([A-Z]+)(-?\d[\d.]*))", line):
            words.setdefault(key or letter, inner or plain)
        if re.match(r"A?(TRANS|ROT|MIRROR|SCALE)\b", codes[0]):
            self.change(codes[0], words)
        elif codes[0] == "G111":
            self.pole = np.array([float(words["X"]), float(words["Y"])])
        else:
            for code in codes:
                if code in ("G90", "G91"):
                    self.steps = code == "G91"
                if code in ("G0", "G1", "G2", "G3", "CIP", "CT"):
                    self.mode = code
            self.motion(words)
            if self.cycle and words.keys() & {"X", "Y"}:
                self.hole()

    def change(self, code: str, words: dict[str, str]) -> None:
        kind, where = code.removeprefix("A"), self.world(self.place)
        if kind == code:
            self.frame = np.eye(4)
        x, y, z = (self.value(words.get(axis, "0")) for axis in "XYZ")
        if kind == "TRANS":
            new = shift((x, y, z))
        elif kind == "ROT":
            new = about(2, z + self.value(words.get("RPL", "0"))) @ about(1, y) @ about(0, x)
        elif kind == "SCALE":
            new = np.diag([x, y, z, 1.0])
        else:
            new = np.diag([-1.0 if axis in words else 1.0 for axis in "XYZ"] + [1.0])
        self.frame = self.frame @ new
        self.place = np.linalg.inv(self.tilt @ self.frame).dot([*where, 1.0])[:3]
        self.heading = None

    def world(self, point: np.ndarray) -> np.ndarray:
        return (self.tilt @ self.frame @ np.array([*point, 1.0]))[:3]

    def coordinate(self, text: str, here: float, steps: bool) -> float:
        inner = re.fullmatch(r"(IC|AC)\((.*)\)", text)
        if inner:
            return self.value(inner[2]) + (here if inner[1] == "IC" else 0.0)
        return self.value(text) + (here if steps else 0.0)

    def motion(self, words: dict[str, str]) -> None:
        start, end, mode = self.place, np.array(self.place), self.mode
        for axis, letter in enumerate("XYZ"):
            if letter in words:
                end[axis] = self.coordinate(words[letter], start[axis], self.steps)
        if "ANG" in words:  # by the sine rule, in the triangle of the line and its two legs
            known = 0 if "X" in words else 1
            angle = math.radians(self.value(words["ANG"]))
            leg = end[known] - start[known]
            legs = math.sin(math.pi / 2 - angle), math.sin(angle)
            end[1 - known] = start[1 - known] + leg * legs[1 - known] / legs[known]
        if {"RP", "AP"} & words.keys():
            out = start[:2] - self.pole
            radius = self.value(words["RP"]) if "RP" in words else np.hypot(*out)
            angle = math.degrees(math.atan2(out[1], out[0]))
            if "AP" in words:
                angle = self.coordinate(words["AP"], angle, False)
            end[:2] = self.pole + radius * np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
        if not words.keys() & {"X", "Y", "Z", "RP", "AP", "I", "J", "AR"}:
            return
        if mode in ("G0", "G1"):
            self.straight(start, end, mode, words)
        else:
            self.curve(start, end, mode, words)
        self.place = end if "AR" not in words or "I" not in words else self.place

    def straight(self, start, end, mode: str, words: dict[str, str]) -> None:
        if self.waiting:
            first, apex, kind, size = self.waiting
            u, v = (apex - first) / np.linalg.norm(apex - first), (end - apex) / np.linalg.norm(end - apex)
            turn = math.atan2(u[0] * v[1] - u[1] * v[0], u @ v)
            along = {"RND": size * math.tan(abs(turn) / 2), "CHR": size, "CHF": size / (2 * math.cos(turn / 2))}[kind]
            begin, leave = apex - along * u, apex + along * v
            self.line("G1", first, begin)
            if kind == "RND":
                left = np.array([-u[1], u[0], 0.0]) * math.copysign(size, turn)
                self.arc(begin, leave, begin + left, turn)
            else:
                self.line("G1", begin, leave)
            start, self.waiting = leave, None
        corner = next((kind for kind in ("RND", "CHR", "CHF") if kind in words), None)
        self.rounding = self.value(words.get("RNDM", str(self.rounding)))
        if corner or self.rounding:
            self.waiting = (start, end, corner or "RND", self.value(words[corner]) if corner else self.rounding)
        else:
            self.line(mode, start, end)
        self.heading = (end - start)[:2] if np.hypot(*(end - start)[:2]) and end[2] == start[2] else None

    def line(self, mode: str, start, end) -> None:
        if np.abs(end - start).max() > 1e-9:
            points = [self.world(start + share * (end - start)) for share in SHARES]
            self.moves.append(("R" if mode == "G0" else "F", np.array(points), self.tilt[:3, 2]))

    def arc(self, start, end, center, sweep: float) -> None:
        """In X and Y of the program, with a climb in Z."""
        points = []
        for share in SHARES:
            out = about(2, math.degrees(sweep * share))[:2, :2] @ (start - center)[:2]
            points.append(self.world(np.array([*(center[:2] + out), start[2] + share * (end[2] - start[2])])))
        self.moves.append(("F", np.array(points), self.tilt[:3, 2]))
        tangent = math.copysign(1.0, sweep) * np.array([-(end - center)[1], (end - center)[0]])
        self.heading = tangent if end[2] == start[2] else None

    def curve(self, start, end, mode: str, words: dict[str, str]) -> None:
        sign = -1.0 if mode == "G2" else 1.0
        chord = (end - start)[:2]
        length, across = np.hypot(*chord), np.array([-chord[1], chord[0]])
        center = np.array(start)
        if mode == "CIP":
            over = np.array(start)
            for axis, letter in enumerate("IJK"):
                if f"{letter}1" in words:
                    over[axis] = self.coordinate(words[f"{letter}1"], start[axis], self.steps)
            self.through(start, over, end)
            return
        if mode == "CT":
            u = self.heading / np.hypot(*self.heading)
            ahead, left = chord @ u, chord @ np.array([-u[1], u[0]])
            radius = length**2 / (2.0 * left)
            center[:2] += radius * np.array([-u[1], u[0]])
            self.arc(start, end, center, 2.0 * math.atan2(left, ahead))
            return
        if "I" in words or "J" in words:
            for axis, letter in enumerate("IJ"):
                center[axis] = self.coordinate(
                    words.get(letter, "IC(0)"), start[axis], letter in words and "AC" not in words[letter]
                )
            if "AR" in words:
                sweep = sign * math.radians(self.value(words["AR"]))
                end[:2] = center[:2] + about(2, math.degrees(sweep))[:2, :2] @ (start - center)[:2]
                self.arc(start, end, center, sweep)
                self.place = end
                return
        elif "AR" in words:
            half = math.radians(self.value(words["AR"])) / 2.0
            center[:2] = (start + end)[:2] / 2.0 + sign * across / (2.0 * math.tan(half))
        elif "CR" in words:
            radius = self.value(words["CR"])
            height = math.sqrt(max(radius**2 - length**2 / 4.0, 0.0)) * math.copysign(1.0, radius)
            center[:2] = (start + end)[:2] / 2.0 + sign * height * across / length
        else:
            center[:2] = self.pole
        a, b = (math.atan2(*(point - center)[1::-1]) for point in (start, end))
        sweep = sign * ((sign * (b - a)) % math.tau or math.tau)
        sweep += sign * math.tau * self.value(words.get("TURN", "0"))
        self.arc(start, end, center, sweep)

    def through(self, start, over, end) -> None:
        a, b, c = (self.world(point) for point in (start, over, end))
        x = (b - a) / np.linalg.norm(b - a)
        z = np.cross(b - a, c - a)
        z /= np.linalg.norm(z)
        y = np.cross(z, x)
        half, px, py = np.linalg.norm(b - a) / 2.0, (c - a) @ x, (c - a) @ y
        middle = a + half * x + ((px**2 + py**2 - 2.0 * half * px) / (2.0 * py)) * y
        first, last = (math.atan2((p - middle) @ y, (p - middle) @ x) for p in (a, c))
        radius, sweep = np.linalg.norm(a - middle), (last - first) % math.tau
        points = [middle + radius * (math.cos(first + sweep * s) * x + math.sin(first + sweep * s) * y) for s in SHARES]
        self.moves.append(("F", np.array(points), self.tilt[:3, 2]))
        self.heading = None

    def drill(self, line: str) -> None:
        name = re.search(r"(CYCLE\d+|HOLES2)?\(?", line.removeprefix("MCALL").strip())[1]
        if line == "MCALL":
            self.cycle = None
            return
        inner = line[line.index("(") + 1 : -1].split(",")
        if name == "CYCLE800":
            self.swivel([float(v or 0) for v in inner if '"' not in v])
        elif name == "HOLES2":
            x, y, radius, angle, step, count = (float(v) for v in inner)
            for index in range(int(count)):
                turn = math.radians(angle + index * (step or 360.0 / count))
                end = np.array([x + radius * math.cos(turn), y + radius * math.sin(turn), self.place[2]])
                self.line("G0", self.place, end)
                self.place = end
                self.hole()
        else:
            cycle = (name, [float(v or 0) for v in inner] + [0.0])
            kept, self.cycle = self.cycle, cycle
            if not line.startswith("MCALL"):
                self.hole()
                self.cycle = kept

    def hole(self) -> None:
        name, (back, plane, clear, depth, relative, *others) = self.cycle
        depth, top = plane - relative if relative else depth, plane + clear
        path = [("G0", top)]
        if name == "CYCLE83":
            at, stroke = plane - others[1], others[1]
            path.append(("G1", at))
            while at > depth + 1e-9:
                path += (
                    [("G0", top), ("G0", min(top, at + max(0.6, (plane - depth) / 50)))]
                    if others[6]
                    else [("G1", at + 1)]
                )
                at = max(depth, at - stroke)
                path.append(("G1", at))
        else:
            path.append(("G1", depth))
        path += [("G1" if name in ("CYCLE85", "CYCLE89") else "G0", top), ("G0", back)]
        for mode, height in path:
            end = np.array([*self.place[:2], height])
            self.line(mode, self.place, end)
            self.place = end

    def swivel(self, numbers: list[float]) -> None:
        _, _, mode, x, y, z, a, b, c, x1, y1, z1, _ = [*numbers, *[0.0] * (13 - len(numbers))]
        where, kept = self.world(self.place), self.tilt
        self.tilt = shift((x, y, z))
        for place, angle in enumerate((a, b, c)):
            if angle:
                self.tilt = self.tilt @ about((int(mode) >> 2 * place & 3) - 1, angle)
        self.tilt, self.frame = self.tilt @ shift((x1, y1, z1)), np.eye(4)
        self.place = np.linalg.inv(self.tilt).dot([*where, 1.0])[:3]
        if np.abs(self.tilt[:3, 2] - kept[:3, 2]).max() > 1e-9:
            self.moves.append(("R", np.array([where] * 4), self.tilt[:3, 2]))


def random_program(seed: int) -> str:
    """A program of statements that fit, most numbers of three decimals."""
    chance = random.Random(seed)
    lines, subs = ["%_N_HUNT_MPF", "G17 G40 G71 G90 G94", "G1 X1 Y1 Z1 F500"], []

    def n(least: float = -50.0, most: float = 50.0) -> str:
        return f"{chance.uniform(least, most):.3f}"

    def step(*axes: str) -> str:
        return " ".join(f"{axis}=IC({n(5, 30) if chance.random() < 0.5 else n(-30, -5)})" for axis in axes)

    def away() -> str:
        return f"G90 G0 X{n()} Y{n()} Z{n()}"

    def value() -> str:
        number = chance.choice(("R1", "R2", n(), f"SIN({n(0, 90)})*20", "R[1]/2+3", "R[R9]+R[R8]", "SQRT(POT(R1)+4)"))
        return f"{number}{chance.choice('+-*')}{n(1, 3)}"

    def arc() -> str:
        turn, i, j = chance.uniform(5, 355), chance.uniform(-20, 20), chance.uniform(3, 20)
        code, t = chance.choice((("G2", -1.0), ("G3", 1.0)))
        c, s = math.cos(math.radians(turn)), t * math.sin(math.radians(turn))
        x, y = i + c * -i - s * -j, j + s * -i + c * -j
        ends = f"X=IC({x:.9f}) Y=IC({y:.9f})"
        return chance.choice(
            (
                f"{code} {ends} I{i:.9f} J{j:.9f}",
                f"{code} {ends} Z=IC({n(-5, 5)}) I={i:.9f} J={j:.9f} TURN={chance.randrange(3)}",
                f"{code} I{i:.3f} J{j:.3f} AR={turn:.3f}",
                f"{code} {ends} CR={(-1 if turn > 180 else 1) * math.hypot(i, j):.9f}",
                f"{code} {step('X', 'Y')} AR={turn:.3f}",
                f"{code} I{i:.3f} J{j:.3f}",
                f"CIP {step('X', 'Y', 'Z')} I1=IC({n(1, 4)}) J1=IC({n(31, 40)}) K1=IC({n()})",
            )
        )

    def statements(depth: int = 0) -> list[str]:
        kind = chance.randrange(18 if depth < 2 else 9)
        if kind == 0:
            return [
                f"G1 X{n()} Y{n()}",
                f"X={value()} Y={value()} Z=AC({value()})",
                f"G91 X{n()}",
                "Y2 Z=AC(3.5)",
                "G90",
            ]
        if kind == 1:
            return [arc(), arc()]
        if kind == 2:
            corner = chance.choice(("RND", "CHR", "CHF"))
            signs = [chance.choice((-1, 1)) for _ in range(3)]
            return [
                f"G1 X=IC({signs[0] * 20}) Y=IC({n(-3, 3)}) {corner}={n(0.5, 3)}",
                f"X=IC({n(-5, 5)}) Y=IC({signs[1] * 20}) {chance.choice(('RND', 'CHR'))}={n(0.5, 3)}",
                f"X=IC({signs[2] * 20}) Y=IC({n(-3, 3)})",
            ]
        if kind == 3 and chance.random() < 0.5:
            axis, angle = chance.choice("XY"), chance.uniform(-180, 180)
            way = {"X": math.cos, "Y": math.sin}[axis](math.radians(angle))
            line = f"G1 {axis}=IC({math.copysign(chance.uniform(0.5, 2), way):.3f}) ANG={angle:.3f}"
            sign = chance.choice((-1, 1))
            return [
                *([line] if abs(way) > 0.1 else []),
                f"G1 X=IC(20) Y=IC({n(-3, 3)}) RNDM={n(0.5, 2)}",
                f"X=IC({n(-5, 5)}) Y=IC({sign * 20}){chance.choice((' CHR=1.5', ''))}",
                f"X=IC(-20) Y=IC({n(-3, 3)})",
                f"RNDM=0 X=IC({n(-5, 5)}) Y=IC({-sign * 20})",
            ]
        if kind == 3:
            return [f"G1 {step('X', 'Y')}", f"CT {step('X', 'Y')}", f"{step('X', 'Y')}", "G1"]
        if kind == 4:
            return [
                f"G111 X{n()} Y{n()}",
                f"G1 RP={n(5, 30)} AP={n(0, 360)}",
                f"G3 AP=IC({n(10, 90)})",
                f"G1 AP={n(0, 90)}",
            ]
        if kind == 5:
            frames = (
                *(f"TRANS X{n()} Y{n()}", f"ATRANS Z={n()}", f"ROT Z{n()}", f"AROT X{n()} Y{n()} Z{n()}"),
                *(f"ROT RPL={n()}", "MIRROR X0", "AMIRROR Y0", f"ASCALE X{n(1, 2)[:3]} Y1 Z1", "TRANS", "ROT"),
            )
            frame = chance.choice(frames)
            frame = re.sub(r"X(\S+) Y1 Z1", r"X\1 Y\1 Z\1", frame)
            return [frame, away()]
        if kind == 6:
            return [f"R1={n()}", f"R[2]={value()}", f"G1 X=R1 Y=R2/{n(2, 9)} Z=-R1"]
        if kind == 7:
            numbers = f"30,{n(-2, 2)},{n(1, 3)},{n(-20, -5)}"
            cycle = chance.choice(
                (
                    f"CYCLE81({numbers})",
                    f"CYCLE82({numbers},{n(1, 9)},0)",
                    f"CYCLE85({numbers},,0,100,100)",
                    f"CYCLE83({numbers},,,{n(1, 4)},0,0,0,1,{chance.randrange(2)})",
                    f"CYCLE89({numbers},,0)",
                )
            )
            if chance.random() < 0.4:
                return [away(), cycle]
            holes = f"HOLES2({n()},{n()},{n(5, 20)},{n()},{chance.choice(('0', '25'))},{chance.randrange(1, 5)})"
            return [away(), f"MCALL {cycle}", f"G0 X{n()} Y{n()}", f"X{n()}", holes, "MCALL"]
        if kind == 8:
            mode, angles = chance.choice((57, 27, 39)), [n() if chance.random() < 0.6 else "0" for _ in range(3)]
            points = ",".join(n() for _ in range(3)), ",".join(n(-3, 3) for _ in range(3))
            swivel = f'CYCLE800(1,"T",0,{mode},{points[0]},{",".join(angles)},{points[1]},-1)'
            return [swivel, away(), f"G1 X{n()} Y{n()}", arc(), "CYCLE800()", away()]
        inner = [line for _ in range(chance.randrange(1, 3)) for line in statements(depth + 1)]
        name = f"{chance.randrange(10**6)}"
        if kind < 11:
            return [f"FOR R{10 + depth}=1 TO {chance.randrange(0, 4)}", *inner, "ENDFOR"]
        if kind == 11:
            other = statements(depth + 1)
            return [f"IF R1{chance.choice(('<', '>', '==', '<>'))}{n()}", *inner, "ELSE", *other, "ENDIF", away()]
        if kind == 12:
            return [f"R{20 + depth}=0", f"WHILE R{20 + depth}<3", *inner, f"R{20 + depth}=R{20 + depth}+1", "ENDWHILE"]
        if kind == 13:
            return [f"LA{name}:", *inner, f"REPEAT LA{name} P={chance.randrange(1, 3)}"]
        if kind == 14:
            count = f"R{30 + depth}"
            return [f"{count}=0", f"LB{name}:", *inner, f"{count}={count}+1", f"IF {count}<2 GOTOB LB{name}"]
        if kind == 15:
            return [f"IF R1>{n()} GOTOF LC{name}", *inner, f"LC{name}:", away()]
        if kind == 16:
            choices = f"{chance.randrange(3)} GOTOF LD{name} 7 GOTOF LE{name} DEFAULT GOTOF LF{name}"
            return [
                *(f"CASE R9+R8-{chance.randrange(4)} OF {choices}", *inner, f"LD{name}:"),
                *(f"G1 X=SIDE_{chance.choice('AB')}", f"LE{name}:", away(), f"LF{name}:", away()),
            ]
        subs.append([f"%_N_SUB{name}_SPF", f"PROC SUB{name}(REAL P_A, REAL P_B)", "G1 X=P_A Y=P_B*2", *inner, "M17"])
        return [f"SUB{name}({n()},{value()})"]

    lines += ["R1=3.5", "R2=-2", "R8=2", "R9=1", f"DEFINE SIDE_A AS IC({n(5, 30)})", f"DEFINE SIDE_B AS {n()}"]
    for _ in range(chance.randrange(3, 9)):
        lines += statements()
    lines += ["M30", *(line for sub in subs for line in sub)]
    return "\n".join(lines)
