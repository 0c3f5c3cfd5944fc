"""Random contours under cutter compensation, and arcs whose radii differ by about LinuxCNC's tolerance, for `hunt`."""

import math

from benchmarks.hunt_programs import Harsh

PLANES = {"G17": ("X", "Y", "Z", "I", "J"), "G18": ("Z", "X", "Y", "K", "I")}
ANGLES = (0, 0, 1, 2, 3, 5, 30, 45, 60, 90, 120, 150, 170, 178, 180)
MODES = ("F77", "S300", "M8", "G4 P.1", "M3 S100", "(cut)", "N5", "G90.1", "G91.1", "M0", "M48", "G17", "G43 H1")


class Beside(Harsh):
    """Contours of lines and arcs beside which a tool of 6.35 mm goes: in G17 and G18, inch and mm, G90 and G91."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.inch = self.often(0.25)
        self.incremental = False
        self.plane = self.one("G17", "G17", "G17", "G18")
        self.at = [0.0, 0.0]
        self.heading = 0.0  # rad
        self.height = 5.0

    def text(self, mm: float) -> str:
        """A length in the program's unit."""
        return f"{mm / 25.4:.6f}" if self.inch else f"{mm:.5f}"

    def word(self, letter: str, here: float, there: float) -> str:
        """An axis word."""
        return f"{letter}{self.text(there - here if self.incremental else there)}"

    def turn(self) -> None:
        """Another direction, often by a round angle."""
        angle = self.random.choice(ANGLES) if self.often(0.7) else self.random.uniform(-180, 180)
        self.heading += math.radians(angle) * self.random.choice([-1, 1])

    def go(self, there: tuple[float, float], code: str, more: str = "") -> str:
        """A block to a point of the plane."""
        first, second = PLANES[self.plane][:2]
        words = [code, self.word(first, self.at[0], there[0]), self.word(second, self.at[1], there[1]), more]
        self.at = list(there)
        return " ".join(filter(None, words))

    def line(self, longest: float = 40.0) -> str:
        """A straight move, sometimes also along the tool or about an axis."""
        self.turn()
        length = self.random.choice([1.0, 2.0, 3.175, 5.0, 10.0, 20.0, longest, self.random.uniform(0.5, longest)])
        there = (
            self.at[0] + length * math.cos(self.heading),
            self.at[1] + length * math.sin(self.heading),
        )
        more = self.down() if self.often(0.1) else "A5" if self.often(0.03) else ""
        return self.go(there, self.one("G1", "G1", "G1", "G1", "G1", "G0"), more)

    def arc(self, tangent: bool = False) -> str:
        """An arc, by its centre or its radius, a full circle too."""
        if not tangent and self.often(0.6):
            self.turn()
        way = self.random.choice([-1, 1])
        radius = self.random.choice([2.0, 3.175, 4.0, 6.35, 10.0, 25.0, self.random.uniform(1.0, 30.0)])
        sweep = math.radians(self.random.choice([10, 45, 90, 180, 270, 360, self.random.uniform(2, 359)]))
        start = self.heading - way * math.pi / 2.0  # from the centre to the start
        center = (self.at[0] - radius * math.cos(start), self.at[1] - radius * math.sin(start))
        stop = start + way * sweep
        there = (center[0] + radius * math.cos(stop), center[1] + radius * math.sin(stop))
        here = self.at
        self.heading = stop + way * math.pi / 2.0
        code, (i, j) = "G3" if way > 0 else "G2", PLANES[self.plane][3:]
        if sweep < 6.0 and self.often(0.25):
            by = f"R{self.text(radius if sweep <= math.pi else -radius)}"
        else:
            by = f"{i}{self.text(center[0] - here[0])} {j}{self.text(center[1] - here[1])}"
            by += " P2" if self.often(0.03) else ""
        more = f"{self.down()} {by}" if self.often(0.15) else by
        return self.go(there, code, more)

    def down(self) -> str:
        """A step along the tool."""
        was, self.height = self.height, self.height + self.random.choice([-1.0, 0.5, 2.0])
        return self.word(PLANES[self.plane][2], was, self.height)

    def contour(self) -> list[str]:
        """Compensation on, moves, compensation off, a way out."""
        side = self.one("G41", "G42")
        diameter = self.random.choice([2.0, 6.35, 8.0])
        on = self.one(side, f"{side} D1", f"{side} D2", f"{side}.1 D{self.text(diameter)}")
        entry = self.arc() if self.often(0.25) else self.line()
        lines = [f"{on} {entry}" if self.often(0.3) else f"{on}\n{entry}"]
        for _ in range(self.random.randint(1, 9)):
            kind = self.random.random()
            if kind < 0.06:
                lines.append(self.one("G0", "G1", "G1") + " " + self.down())
            elif kind < 0.12:
                lines.append(self.one(*MODES))
            elif kind < 0.16:
                self.incremental = not self.incremental
                lines.append("G91" if self.incremental else "G90")
            else:
                lines.append(self.arc() if self.often(0.45) else self.line())
        if self.often(0.1):
            return lines
        after = self.one("", "", "", "T2 M6", "G43 H2", "G92 X3", "G28 X1", "G81 X3 Y4 Z-9 R9", "G1", "G0", "G54")
        return [*lines, self.one("G40", "G40", f"G40 {self.line()}"), after, self.line()]

    def program(self) -> str:
        """One to three contours."""
        lines = [f"{'G20' if self.inch else 'G21'} G90 F{self.one('20', '300')}", self.plane, "T1 M6", "G0 X0 Y0 Z0"]
        lines += [f"G10 L2 P1 R{self.one('30', '-45')}\nG0 X1 Y2 Z3\nG0 X0 Y0 Z0"] if self.often(0.1) else []
        lines.append(f"G0 {self.word(PLANES[self.plane][2], 0.0, self.height)}")
        for _ in range(self.random.randint(1, 3)):
            lines += self.contour()
        return "\n".join([*filter(None, lines), "G90", "M2", ""])


class Tolerances(Harsh):
    """Arcs whose start and end radius differ by about what LinuxCNC allows, by centres and by R, chained."""

    def program(self) -> str:
        """Ten arcs, each from where the one before should have ended."""
        r, inch = self.random, self.often(0.3)
        unit = 25.4 if inch else 1.0
        lines, at = [f"{'G20' if inch else 'G21'} G90 G91.1 F100", "G0 X0 Y0 Z1"], (0.0, 0.0)
        for _ in range(10):
            radius = r.choice([0.002, 0.05, 1.0, 5.0, 28.0, 29.0, 100.0, 3000.0, r.uniform(0.01, 60.0)])
            start, sweep = r.uniform(-math.pi, math.pi), r.choice([0.001, 0.5, 1.0, 2.0, math.pi, 3.3, math.tau])
            allowed = max(2 * math.sqrt(2) * (0.0254 if inch else 0.01), 1e-3 * radius)
            off = r.choice([0.0, 0.9, 0.99, 1.01, 1.1]) * allowed * r.choice([-1, 1])
            way = r.choice([-1, 1])
            center = (at[0] - radius * math.cos(start), at[1] - radius * math.sin(start))
            stop = start + way * sweep
            end = (center[0] + (radius + off) * math.cos(stop), center[1] + (radius + off) * math.sin(stop))
            code = "G3" if way > 0 else "G2"
            if self.often(0.3):
                half = math.dist(at, end) / 2.0
                size = max(half + r.choice([-1.3e-3, -1.2e-3, 0.0, 1e-4, 1.0]), 1e-4)
                by = f"R{(size if sweep < math.pi else -size) / unit:.7f}"
            else:
                by = f"I{(center[0] - at[0]) / unit:.7f} J{(center[1] - at[1]) / unit:.7f}"
            lines.append(f"{code} X{end[0] / unit:.7f} Y{end[1] / unit:.7f} {by}")
            at = end
        return "\n".join([*lines, "G1 X0 Y0", "M2", ""])
