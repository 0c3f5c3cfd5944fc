"""Random programs for `benchmarks.hunt`: lines at odds with each other, zeros that move, variables and flow."""

# ruff: noqa: SIM905 (long lists of words are easier to read as one text)

import random
from collections.abc import Callable

KNOWN_G = (
    "0 1 2 3 4 10 17 18 19 20 21 28 28.1 30 30.1 40 43 43.1 49 52 53 54 55 56 57 58 59 59.1 59.2 59.3 61 61.1 64 73 "
    "80 81 82 83 85 89 90 91 90.1 91.1 92 92.1 92.2 92.3 93 94 95 96 97 98 99"
).split()
OTHER_G = (
    "5 5.1 5.2 5.3 7 8 12 13 15 16 33 33.1 38.2 41 41.1 42 42.1 43.2 43.4 50 51 54.1 60 62 63 65 66 67 68 69 70 71 "
    "72 74 76 84 86 87 88 4.1 0.1 1.5 17.1 84.2 100 -1 53.1 05 0.05 2.0 01. .1"
).split()
# Never M100 to M199: LinuxCNC would run them.
M_CODES = (*range(20), 30, *range(47, 54), *range(60, 69), 70, 71, 72, 73, 97, 98, 99, 200, 3.0, 5.1, 2.5, 1.5)
ODD_NUMBERS = (
    "|.|-|+|-.5|.5|+.5|1e1|1E1|--1|+-1|1.2.3|1,5|- 1|1 0|0x10|1_0|\u0661|1 .5|5-|-0|00.5|1e|[1]|#1|*2|1/2|1.5+1|"
    "99999|1e30|0.00001|.0"
).split("|")
MODES = (
    "G90|G91|G17|G18|G19|G20|G21|G80|G90.1|G91.1|G98|G99|G0|G1|G2|G3|G40|G61|G64|G64 P.1|G64 P.1 Q.1|G61.1|G64 Q1|G8|"
    "G7|G50|G15|G16|G69|G90 G91|G0 G1|G80 G0|G0 G80|G80 G81|G1 G90 G91 X2|G20 X1|G21 X2|G91 X1 G90|G20 G1 F3 X.5|"
    "G80 G1 X3|G1 X4 G80|G80 X5|G80 G2 X5 I2.5"
).split("|")
FEEDS = (
    "G93|G94|G95|G93 F2|G95 F.1|G95 S100 F.1|G94 F60|F0|F-1|S1000|S0|S-5|G96 S100|G97 S500|G96 D500 S100|G97|M3|"
    "M4 S10|M5|G93 G1 X1 F2|G93 G1 X5|G94 G1 X2 F33|G93 G2 X5 I2.5 F1|M3 S100 $0|G93 G0 X5|G93 G81 X1 Z-1 R2 F3|"
    "G95 G81 X1 Z-1 R2 F.3"
).split("|")
ODDITIES = (
    "M0|M1|M2|M30|M60|%|O100|O 5|o200 sub|N5|N-1|N1.5|N 7 G1 X2|N99999999|N5 N6 X1|X1 N5|M98 P5|M99|M97 P5|M98|"
    "/ G1 X7|/1 X3|/2 G0 X9|/|// X1|X1 / Y2|/ N5 X1|N5 / X1|( a ) X1 ( b )|X1 (c (d)|X1 )|(open|X3 ; c ( d|"
    "X3 ;(x) Y4|X( c )4|X(1)5 Y1|G(x)1 X3|\tX1\tY 2|; only|()|;|X 1 2|g 1 x 3|x1Y2z3|G1X2Y3|G01 X2|G1.0 X1|G0001 X4|"
    "G 0 1 X3|G1. X1|G +1 X1|G-1 X1|M3 M5|M3 M8|M7 M8|M8 M9|M0 M1|M6 M6|M3 M3|M62 P1|M64 P1|M66 P1 L0|M66 P0 L3 Q1|"
    "M67 E1 Q2|M68 E0 Q1|M50 P1|M51 P0|M52|M53 P1|M48|M49|M19 R10|M19 R10 Q2 P1|M70|M72|M73|M71|M200|M999|G4 P1|G4|"
    "G4 P-1|G4 X1|G4 P.5 G1 X3|G4 P1 P2|X1 X2|G1 G1 X2|F10 F20|X1 Y1 X1|U1|W3|E5|D3|H2|H1 X1|L2|L2 X3|P3|P3 X1|Q2 X1|"
    "R3 X2|I2 X4|K1|J2|D1 X1|E1 X2|S10 X1|T2 X1|G1 X1 Y|X|G|M|G1 X*2|G1 X1,2|X1\0|X5=2|#1=5|X#1|X[1+2]|"
    "@5 ^30|G91 ^20|"
    "G33 K1 Z2|G33.1 K1 Z2|G38.2 X5|G5 X1 I1 J1|G5.1 X2 I1 J2|G5.2|G41|G42 D1|G41.1 D2|G40 X1|G76 P1 Z1|"
    "G68 X0 Y0 R30|G65 P1|G12 I3|G54 P1|G10|$1 M3 S5|M1 X3|M0 X3|M2 X3|M30 G1 X4|M6 T2 G43 H2 Z5|T3 M6 X1|F20 G20|"
    "G20 F20|S5 M3 G1 X1 F9|M9 X3 M5|G1 M8 X2 M3 Y4|:100|:5 X1|O5 X1|O<a>|o1 call|M01 X5|m02|G28 X0|G28 Z5 X1|G30 A5|"
    "G28.1 X1|!|~|?|X1 'a'|&|{1}|X1;Y2|X1%|% X1|%%|%foo|% (c)|%;c| %|X1 y2 ;%"
).split("|")
OPERATORS = " + |-|*| * |/| MOD |**| EQ | NE | GT |GE| LT |LE| AND | OR | XOR ".split("|")
POINTS = ((5, 0), (0, 5), (3, 4), (-4, 3), (0, -5), (-5, 0), (4, -3), (-3, -4))  # on a circle of 5
PLANES = (("G17", "X", "Y", "Z"), ("G18", "Z", "X", "Y"), ("G19", "Y", "Z", "X"))
CENTER = {"X": "I", "Y": "J", "Z": "K"}


class Harsh:
    """Short programs of lines that are valid, half valid, and not."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def one(self, *choices: str) -> str:
        """One of some texts."""
        return self.random.choice(choices)

    def often(self, share: float) -> bool:
        """Whether, in that share of cases."""
        return self.random.random() < share

    def number(self, low: float = -20, high: float = 20) -> str:
        """A number: round, with digits, sometimes odd."""
        r, kind = self.random, self.random.random()
        if kind < 0.5:
            value = max(low, min(high, r.choice([-20, -10, -5, -3, -2, -1, 0, 1, 2, 3, 4, 5, 7, 10, 12, 20])))
            return r.choice([f"{value}", f"{value}.", f"{value}.0", f"{value:+}", f"{value:03}"])
        if kind > 0.97:
            return r.choice(ODD_NUMBERS)
        value = r.uniform(low, high)
        return r.choice([f"{value:.3f}", f"{value:+.2f}", f"{value:.1f}", f"{value:.4f}", f"{value:.6f}"])

    def axes(self, letters: str = "XYZABC", count: int = 0) -> str:
        """Some axis words."""
        count = count or self.random.randint(1, min(3, len(letters)))
        return " ".join(f"{letter}{self.number()}" for letter in self.random.sample(letters, count))

    def move(self) -> str:
        """A straight move of any axes, with or without its code."""
        return f"{self.one('G0', 'G1', 'G1', '', '')} {self.axes()} {self.one('', '', '', 'F50', 'F0', 'F')}"

    def straight(self) -> str:
        """The same of X, Y, Z alone."""
        return f"{self.one('G0', 'G1', 'G1', '')} {self.axes('XYZ')}"

    def wild_arc(self) -> str:
        """Arc words that rarely fit."""
        r = self.random
        words = [self.one("G17", "G18", "G19")] if self.often(0.3) else []
        words += [self.one("G2", "G3")] if self.often(0.85) else []
        words += [self.axes("XYZABC" if self.often(0.15) else "XYZ")] if self.often(0.9) else []
        kind = r.random()
        if kind < 0.35:
            words.append(f"R{self.number()}")
        elif kind < 0.9:
            words.append(" ".join(f"{w}{self.number(-12, 12)}" for w in r.sample("IJK", r.choice([1, 1, 2, 2, 3]))))
        words += [self.one("P0", "P1", "P2", "P3", "P1.5", "P-1")] if self.often(0.15) else []
        words += [self.one("G90.1", "G91.1")] if self.often(0.1) else []
        r.shuffle(words)
        return " ".join(words)

    def arc(self) -> str:
        """An arc that fits in G91, or nearly."""
        (i, j), (a, b) = self.random.choice(POINTS), self.random.choice(POINTS)
        plane, first, second, normal = self.random.choice(PLANES)
        ends = [f"{first}{i + a}", f"{second}{j + b}"]
        ends = ends[:1] if self.often(0.2) else [] if self.often(0.1) else ends
        if self.often(0.4):
            center = [self.one("R5", "R-5", "R5.001", "R4.99", "R6", "R-7")]
        else:
            center = [f"{CENTER[first]}{i}", f"{CENTER[second]}{j}"]
            center = [word for word in center if word[1:] != "0"] if self.often(0.2) else center
        extra = [f"{normal}{self.number(-5, 5)}"] if self.often(0.3) else []
        extra += [self.one("P1", "P2", "P3")] if self.often(0.15) else []
        extra += [self.one("A5", "B3", "F77", "S5", "M3", "M8")] if self.often(0.1) else []
        head = f"{self.one('G91', 'G91', 'G91', '')} {self.one(plane, plane, plane, '')} {self.one('G2', 'G3')}"
        return f"{head} {' '.join(ends + center + extra)}"

    def cycle(self) -> str:
        """A block of a drilling cycle, or of what follows one."""
        parts = (
            (0.25, lambda: self.one("G17", "G17", "G18", "G19")),
            (0.4, lambda: self.one("G98", "G99")),
            (0.1, lambda: self.one("G90", "G91")),
            (0.7, lambda: self.one(*"G73 G81 G81 G82 G83 G85 G89 G80 G84 G86 G87 G88 G74 G76".split())),
            (0.8, lambda: f"Z{self.number(-20, 2)}"),
            (0.7, lambda: f"R{self.number(-3, 15)}"),
            (0.9, lambda: self.axes("XY")),
            (0.4, lambda: self.one("Q1", "Q2", "Q0.7", "Q3", "Q0", "Q-1", "Q5")),
            (0.4, lambda: self.one("P0", "P.5", "P1", "P2", "P-1")),
            (0.15, lambda: self.one("L0", "L1", "L2", "L3", "L1.5", "L-1")),
            (
                0.05,
                lambda: self.one("A5", "F66", "G20", "G21", "K2", "I1", "G0", "G1", "G55", "M0", "G43 H1", "G52 X1"),
            ),
        )
        words = [word() for share, word in parts if self.often(share)]
        self.random.shuffle(words)
        return " ".join(words)

    def offset(self) -> str:
        """Zeros, shifts, machine coordinates, reference points."""
        turned = self.one("", "", "", "R30", "R0")
        level = self.one(*["L1", "L2", "L2", "L2", "L20", "L20", "L10", "L11", "L3"], "")
        number = self.one(*["P0", "P1", "P1", "P2", "P3", "P9", "P10", "P1.5"], "")
        home = self.one("G28", "G30", "G28.1", "G30.1", "G28 G91", "G28 G90", "G30 G1")
        system = self.one("G54", "G55", "G56", "G59.1", "G59.3", "G54.1", "G59.4")
        machine = self.one("G53", "G53 G0", "G53 G1", "G53 G2", "G1 G53", "G53 G90", "G53 G91")
        return self.one(
            f"G10 {level} {number} {self.axes()} {turned}",
            f"G10 {number} {level}",
            f"{system} {self.one('', 'G1 ' + self.axes('XYZ'))}",
            f"G92 {self.axes()}",
            f"G52 {self.axes()} {self.one('', '', 'G0', 'G1', 'G80', 'G90', 'G91', 'G55')}",
            self.one("G92", "G52", "G92.1", "G92.2", "G92.3", "G92.1 X1", "G92.2 Y2", "G92.3 Z3"),
            f"{machine} {self.axes()}",
            f"{home} {self.one('', self.axes(), self.axes('XYZ'))}",
        )

    def tool(self) -> str:
        """Tool changes and lengths."""
        return self.one(
            f"T{self.one('0', '1', '2', '3', '4', '1.5', '-1', '')} {self.one('', 'M6', 'M6', 'M6')}",
            f"M6 {self.one('', 'T2', self.axes('XYZ'))}",
            f"M61 {self.one('Q1', 'Q2', 'Q0', '', 'Q-1', 'Q1.5')}",
            f"G43 {self.one('', 'H1', 'H2', 'H0', 'H3', 'H4', 'H1.5', 'H-1')} {self.one('', '', self.axes('XYZ'))}",
            f"G43.1 {self.one('Z5', 'Z-3', '', 'X1 Z2', 'Z5 G1', 'K3')}",
            f"G49 {self.one('', self.axes('XYZ'), 'H1')}",
        )

    def soup(self) -> str:
        """Words at random."""
        words = []
        for _ in range(self.random.randint(1, 6)):
            kind = self.random.random()
            if kind < 0.42:
                words.append("G" + self.one(*(KNOWN_G if kind < 0.35 else OTHER_G)))
            elif kind < 0.5:
                words.append(f"M{self.random.choice(M_CODES)}")
            else:
                words.append(self.one(*("XYZXYZXYZABCIJKR" if kind < 0.85 else "PQLFSTHDEKNUVW")) + self.number())
        return " ".join(words)

    def mangled(self, line: str) -> str:
        """The line, sometimes in another spelling, sometimes with a slip."""
        r, kind = self.random, self.random.random()
        if kind < 0.9 or not line:
            return line
        words = line.split()
        r.shuffle(words)
        at = r.randrange(len(line))
        slip = r.choice(" .-+0123456789GMXYZABCIJKRPQLFSTHDN()/;%#[]")
        return r.choice(
            [
                line.lower(),
                line.replace(" ", ""),
                f"N{r.choice([0, 5, 100, 99999])} {line}",
                line + r.choice([" (c)", " ; c", " (a)(b)", "(msg)", " (a) ;b"]),
                "".join(character + (" " if r.random() < 0.3 else "") for character in line),
                r.choice(["/", "/ ", "  ", "\t"]) + line,
                " ".join(words),
                line[:at] + line[at + 1 :],
                line[:at] + line[at] + line[at:],
                line[:at] + slip + line[at + 1 :],
            ]
        )

    def program(self) -> str:
        """A program of a few such lines, with a plain beginning and moves at the end that show the modes."""
        r = self.random
        lines = ["%"] if self.often(0.15) else ["O1234"] if self.often(0.1) else []
        lines.append(self.one("G21 G17 G90 G94 F500", "G21 G17 G90 F200", "F100", "G21 G17 G40 G49 G80 G90 G54 F300"))
        lines += [self.one("G0 X1 Y2 Z30", "G1 X5 Y5 Z5", "G0 Z10", "G1 X2")] if self.often(0.8) else []
        topics: list[Callable[[], str]] = [
            self.move, self.straight, self.wild_arc, self.arc, self.arc, self.cycle, self.cycle, self.offset,
            self.offset, self.tool, lambda: self.one(*FEEDS), lambda: self.one(*MODES), lambda: self.one(*ODDITIES),
            self.soup,
        ]  # fmt: skip
        few = r.sample(topics, r.choice([1, 2, 3, 14]))
        for _ in range(r.choice([1, 2, 3, 4, 5, 6, 8, 12])):
            lines.append(self.mangled(r.choice(few)()))
            lines += [self.mangled(self.one(*MODES))] if self.often(0.15) else []
        lines += r.choice([["G1 X3 Y3 Z3"], ["G1 X3 Y3 Z3 F50"], ["G80", "G1 X4 Y4 F20", "Z3"], ["X4 Y5"], []])
        lines.append(self.one("M2", "M2", "M2", "M30", "%", "M2\n%", "M2\ngarbage here", "M30\n%\nX99"))
        return r.choice(["\n"] * 30 + ["\r\n"] * 3 + ["\n\n"]).join(lines) + "\n"


class Zeros(Harsh):
    """Programs of valid blocks that move the zero, the tool's length and the unit between a few moves."""

    def words(self, letters: str = "XYZ", count: int = 0) -> str:
        """Axis words of a few plain numbers."""
        r = self.random
        chosen = r.sample(letters, count or r.randint(1, len(letters)))
        return " ".join(f"{letter}{r.choice([-7, -3, 0, 1, 2, 5, 11, 4.25])}" for letter in chosen)

    def program(self) -> str:
        """A program of three to fourteen such blocks, of few kinds or many."""
        r = self.random
        kinds: list[Callable[[], str]] = [
            lambda: f"G10 L2 {self.one('P0', 'P1', 'P2')} {self.words()} {self.one('', '', 'R20', 'R-45', 'R0')}",
            lambda: f"G10 L20 {self.one('P0', 'P1', 'P2', 'P9')} {self.words()}",
            lambda: self.one("G54", "G55", "G59.3"),
            lambda: f"G92 {self.words()}",
            lambda: f"G52 {self.words()}",
            lambda: self.one("G92.1", "G92.2", "G92.3"),
            lambda: self.one("G28.1", "G30.1", "G28", "G30", f"G28 {self.words()}", f"G30 {self.words()}"),
            lambda: f"G53 {self.one('G0', 'G1')} {self.words()}",
            lambda: self.one("T1 M6", "T2 M6", "M6", "M61 Q1"),
            lambda: self.one("G43 H1", "G43 H2", "G49", "G43.1 Z4", "G43"),
            lambda: self.one("G90", "G91"),
            lambda: self.one("G20 F5", "G21 F90"),
            lambda: f"{self.one('G0', 'G1')} {self.words('XYZABC')}",
            lambda: f"{self.one('G0', 'G1')} {self.words()}",
            lambda: f"{self.one('G0', 'G1')} {self.words(count=3)}",
            lambda: self.one("G91 G2 X4 Y4 I4 J0", "G91 G3 X6 R5", "G91 G3 X8 R5"),
            lambda: f"{self.one('G81', 'G82 P1', 'G83 Q2')} {self.words('XY')} Z-9 R3",
            lambda: "G80",
            lambda: self.one("G17", "G18", "G19"),
        ]
        few = r.sample(kinds, r.randint(3, len(kinds)))
        lines = ["G21 F100", self.one("", "G0 X1 Y2 Z3", "T1 M6\nG43 H1\nG0 Z9")]
        lines += [r.choice(few)() for _ in range(r.randint(3, 14))]
        return "\n".join([*lines, "G80", "G1 X50 Y50 Z50", "M2", ""])


class Parametric(Harsh):
    """Programs of LinuxCNC's language: variables, expressions, branches, loops and subprograms around plain moves."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.labels = 0
        self.subs: list[str] = []

    def label(self) -> str:
        """A label that no other O word has."""
        self.labels += 1
        return f"{self.labels}" if self.often(0.7) else f"<part {self.labels}>"

    def variable(self) -> str:
        """A variable that has been set, or the control's."""
        return self.one(
            "#1", "#2", "#3", "#31", "#[2+1]", "##4", "#<a>", "#<_B>", "#< a >", "#5420", "#5421", "#5422", "#<_x>",
            "#<_metric>", "#<_motion_mode>", "#5220", "#<_absolute>", "#7", "#4000",
        )  # fmt: skip

    def value(self, depth: int = 2) -> str:
        """What may follow a letter."""
        kind = self.random.random()
        if kind < 0.3:
            return self.one("1", "2", "0.5", "3.25", "-2", "7.", ".25", "+4", "-.5")
        if kind < 0.5 or depth == 0:
            return self.one("", "", "-") + self.variable()
        return self.one("", "", "", "-") + f"[{self.expression(depth)}]"

    def expression(self, depth: int) -> str:
        """Inside of brackets."""
        inner = depth - 1
        kind = self.random.random()
        if kind < 0.25:
            function = self.one("ABS", "COS", "SIN", "FIX", "FUP", "ROUND", "TAN")
            return f"{function}[{self.value(inner)}]"
        if kind < 0.3:
            return f"ATAN[{self.value(inner)}]/[{self.value(inner)}]"
        if kind < 0.34:
            return f"SQRT[ABS[{self.value(inner)}]]"
        if kind < 0.36:
            return self.one("EXISTS[#<a>]", "EXISTS[#<nothing>]", "EXP[1]", "LN[2]", "ACOS[0.5]", "ASIN[-.5]")
        count = self.random.choice([1, 2, 2, 3, 4])
        text = self.value(inner)
        for _ in range(count - 1):
            text += self.one(*OPERATORS) + self.value(inner)
        return text

    def bounded(self) -> str:
        """A number between -30 and 30."""
        return f"[[{self.expression(2)}] MOD 30]" if self.often(0.7) else self.value(1)

    def line(self) -> list[str]:
        """A block or two."""
        r = self.random
        kind = r.random()
        if kind < 0.3:
            return [f"{self.one('#1', '#2', '#3', '#31', '#<a>', '#<_b>', '#[1+1]')}={self.bounded()}"]
        if kind < 0.36:
            return [f"#1={self.bounded()} #2=#1 {self.one('', 'X#1', 'G1 Y#2')}"]
        if kind < 0.75:
            words = " ".join(f"{axis}{self.bounded()}" for axis in r.sample("XYZ", r.randint(1, 3)))
            return [f"{self.one('G1', 'G0', '', 'G[1]', 'G#6')} {words}"]
        if kind < 0.8:
            return [
                self.one(
                    "G91 G3 X[#2-#2+6] R[2+3] G90", "G90", "G17", "F[100+#6]", "G2 I[1+1] X#5420", "N10 (#1)", "G90"
                )
            ]
        if kind < 0.86 and self.subs:
            values = " ".join(f"[{self.expression(1)}]" for _ in range(r.randint(0, 3)))
            return [f"o{r.choice(self.subs)} call {values}"]
        return self.structure()

    def structure(self) -> list[str]:
        """A branch or a loop."""
        label = self.label()
        count = f"#{100 + self.labels}"
        body = self.body(2)
        kind = self.random.randrange(5)
        out = self.one("", "", f"o{label} break", f"o{label} continue")
        if kind == 0:
            return [f"o{label} if [{self.expression(1)}]", *body, f"o{label} endif"]
        if kind == 1:
            return [
                f"o{label} if [{self.expression(1)}]", *body, f"o{label} elseif [{self.expression(1)}]",
                *self.body(1), f"O{label} else", *self.body(1), f"o{label} ENDIF",
            ]  # fmt: skip
        if kind == 2:
            return [f"o{label} repeat [{self.random.randint(0, 3)}]", *body, out, f"o{label} endrepeat"]
        more = f"{count} LT {self.random.randint(0, 3)}"
        if kind == 3:
            return [f"{count}=0", f"o{label} while [{more}]", f"{count}=[{count}+1]", *body, out, f"o{label} endwhile"]
        return [f"{count}=0", f"o{label} do", f"{count}=[{count}+1]", *body, out, f"o{label} while [{more}]"]

    def body(self, most: int) -> list[str]:
        """Blocks within a structure."""
        if self.labels > 8:
            return ["X[#5420+1]"]
        return [line for _ in range(self.random.randint(1, most)) for line in self.line()]

    def program(self) -> str:
        """Subprograms, then a main part."""
        lines = ["G21 G90 F100", "#1=1 #2=2 #3=3 #4=2 #6=1 #31=5 #<a>=4 #<_b>=6", "G1 X1 Y2 Z3"]
        for _ in range(self.random.randint(0, 2)):
            label = self.label()
            end = self.one("endsub", "endsub [#1+1]", "endsub [5]")
            inside = ["#<a>=2 #4=1", *self.body(3), *([f"o{label} return [#2]"] if self.often(0.2) else [])]
            lines += [f"o{label} sub", *inside, f"o{label} {end}"]
            self.subs.append(label)
        for _ in range(self.random.randint(3, 10)):
            lines += [self.mangled(line) if self.often(0.1) else line for line in self.line()]
        return "\n".join([*lines, "G1 X#1 Y#2 Z#3", "M2", ""])
