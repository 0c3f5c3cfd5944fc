"""A program as what it shall do, and writers that say the same in other words. mm and degrees, program coordinates.

Nothing here is the reader's or the rewriter's: the writer keeps its own account of where the tool is.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from hypothesis import strategies as st

AXES = "XYZABC"
PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
LETTER = {0: "I", 1: "J", 2: "K"}
SYSTEMS = {"G54": (0.0, 0.0, 0.0), "G55": (30.0, -20.0, 5.0), "G59.1": (-7.0, 11.0, 2.5)}


@dataclass(frozen=True)
class Line:
    """A straight move; `to` are the axes that go somewhere, by index, in coordinates of the work offset in force."""

    rapid: bool
    to: dict[int, float]
    feed: float | None = None


@dataclass(frozen=True)
class Turn:
    """An arc from where the tool stands: centre from there, angle (positive: counter-clockwise), climb, whole turns."""

    plane: str
    center: tuple[float, float]
    angle: float
    climb: float
    turns: int


@dataclass(frozen=True)
class Holes:
    """A drilling cycle at several places, XY plane."""

    code: str
    places: tuple[tuple[float, float], ...]
    bottom: float
    retract: float
    back: str


@dataclass(frozen=True)
class System:
    """Another work offset."""

    name: str


@dataclass(frozen=True)
class Shift:
    """A shift by G52; the axes named get that shift."""

    by: dict[int, float]


@dataclass(frozen=True)
class Length:
    """A tool length from its table, or none."""

    tool: int | None


@dataclass(frozen=True)
class Pause:
    """G4."""

    seconds: float


Step = Line | Turn | Holes | System | Shift | Length | Pause
TOOLS = {1: 50.0, 2: 75.5}


def coordinate(low: float = -60.0, high: float = 60.0) -> st.SearchStrategy[float]:
    """Numbers of a tenth of a millimetre, so that three decimals say them in full."""
    return st.integers(round(low * 10), round(high * 10)).map(lambda n: n / 10)


lines = st.builds(
    Line,
    rapid=st.booleans(),
    to=st.dictionaries(st.integers(0, 5), coordinate(), min_size=1, max_size=4),
    feed=st.one_of(st.none(), st.sampled_from([60.0, 400.0, 1250.0])),
)
turns = st.builds(
    Turn,
    plane=st.sampled_from(["G17", "G18", "G19"]),
    center=st.sampled_from([(5.0, 0.0), (-3.0, 4.0), (0.0, -12.5), (20.0, 21.0), (-8.0, -6.0)]),
    angle=st.sampled_from([-350.0, -270.0, -120.0, -45.0, -10.0, 15.0, 90.0, 200.0, 300.0, 360.0, -360.0]),
    climb=st.sampled_from([0.0, 0.0, 3.0, -7.5]),
    turns=st.sampled_from([1, 1, 1, 2, 4]),
)
holes = st.builds(
    Holes,
    code=st.sampled_from(["G81", "G82 P0.5", "G85", "G89 P1", "G83", "G73"]),
    places=st.lists(st.tuples(coordinate(), coordinate()), min_size=1, max_size=3).map(tuple),
    bottom=coordinate(-20, -10),
    retract=coordinate(-5, 5),
    back=st.sampled_from(["G98", "G99"]),
)
steps = st.lists(
    st.one_of(
        lines,
        lines,
        lines,
        turns,
        turns,
        holes,
        st.sampled_from(sorted(SYSTEMS)).map(System),
        st.dictionaries(st.integers(0, 2), coordinate(), min_size=1, max_size=3).map(Shift),
        st.sampled_from([None, 1, 2]).map(Length),
        st.sampled_from([0.5, 2.0]).map(Pause),
    ),
    min_size=1,
    max_size=14,
)


@dataclass(frozen=True)
class Style:
    """How to write: units, distance mode, arcs, and looks by the seed (0: plain)."""

    inch: bool = False
    incremental: bool = False
    radius: bool = False
    absolute_centers: bool = False
    looks: int = 0


@dataclass
class Writer:
    """Writes steps in a style; `origin[n]` is the step that line n (from 1) is of, -1 for lines between them."""

    style: Style
    lines: list[str] = field(default_factory=list)
    origin: list[int] = field(default_factory=list)
    here: list[float] = field(default_factory=lambda: [0.0] * 6)
    zero: list[float] = field(default_factory=lambda: [0.0] * 3)
    shift: list[float] = field(default_factory=lambda: [0.0] * 3)
    length: float = 0.0
    step: int = -1

    def __post_init__(self) -> None:
        self.random = random.Random(self.style.looks)

    def write(self, steps: list[Step]) -> str:
        """The program."""
        self._emit(["G20" if self.style.inch else "G21", "G90", "G17", "G94"], feed=300.0)
        for name, zero in SYSTEMS.items():
            number = {"G54": 1, "G55": 2, "G59.1": 7}[name]
            self._emit(["G10", "L2", f"P{number}", *(self._axis(axis, value) for axis, value in enumerate(zero))])
        self._emit(["G90.1" if self.style.absolute_centers else "G91.1"])
        if self.style.incremental:
            self._emit(["G91"])
        for self.step, step in enumerate(steps):
            getattr(self, STEP_METHODS[type(step)])(step)
        self.step = -1
        self._emit(["G80"])
        self._emit(["M2"])
        return "\n".join(self.lines) + "\n"

    # -- steps -----------------------------------------------------------------------------------------------------

    def _line(self, step: Line) -> None:
        self._emit(["G0" if step.rapid else "G1", *self._to(step.to)], feed=step.feed)

    def _turn(self, step: Turn) -> None:
        first, second, normal = PLANES[step.plane]
        (i, j), sweep = step.center, math.radians(step.angle)
        radius = math.hypot(i, j)
        begin = math.atan2(-j, -i)
        full = abs(step.angle) == 360.0
        to: dict[int, float] = {}
        if not full:
            to[first] = self.here[first] + i + radius * math.cos(begin + sweep)
            to[second] = self.here[second] + j + radius * math.sin(begin + sweep)
        if step.climb:
            to[normal] = self.here[normal] + step.climb
        start = list(self.here)
        words = [step.plane, "G3" if step.angle > 0 else "G2", *self._to(to)]
        # Near a half circle R leaves the centre to the last digits.
        if self.style.radius and not full and step.turns == 1 and abs(abs(step.angle) - 180.0) > 5.0:
            words.append("R" + self._length(math.copysign(radius, 180.0 - abs(step.angle))))
        else:
            at = (start[first], start[second]) if self.style.absolute_centers else (0.0, 0.0)
            words += [LETTER[first] + self._length(at[0] + i), LETTER[second] + self._length(at[1] + j)]
            words += [f"P{step.turns}"] if step.turns > 1 else []
        self._emit(words)

    def _holes(self, step: Holes) -> None:
        level = self.here[2]
        retract, bottom = (max(step.retract, step.bottom + 1.0), step.bottom)
        first = True
        for x, y in step.places:
            words = self._to({0: x, 1: y})
            if first:
                heights = (retract - level, bottom - retract) if self.style.incremental else (retract, bottom)
                peck = ["Q" + self._length(4.2)] if step.code in ("G83", "G73") else []
                words = [
                    "G17", step.back, *step.code.split(), *words, "Z" + self._length(heights[1]),
                    "R" + self._length(heights[0]), *peck,
                ]  # fmt: skip
            self._emit(words)
            first = False
        self.here[2] = max(level, retract) if step.back == "G98" else retract
        self._emit(["G80"])

    def _system(self, step: System) -> None:
        new = SYSTEMS[step.name]
        for axis in range(3):
            self.here[axis] += self.zero[axis] - new[axis]
        self.zero = list(new)
        self._emit([step.name])

    def _shift(self, step: Shift) -> None:
        for axis, value in step.by.items():
            self.here[axis] += self.shift[axis] - value
            self.shift[axis] = value
        self._emit(["G52", *(self._axis(axis, value) for axis, value in step.by.items())])

    def _tool_length(self, step: Length) -> None:
        new = 0.0 if step.tool is None else TOOLS[step.tool]
        self.here[2] += self.length - new
        self.length = new
        self._emit(["G49"] if step.tool is None else ["G43", f"H{step.tool}"])

    def _pause(self, step: Pause) -> None:
        self._emit(["G4", f"P{step.seconds:g}"])

    # -- words -----------------------------------------------------------------------------------------------------

    def _to(self, to: dict[int, float]) -> list[str]:
        words = [
            self._axis(axis, value - (self.here[axis] if self.style.incremental else 0.0)) for axis, value in to.items()
        ]
        for axis, value in to.items():
            self.here[axis] = value
        return words

    def _axis(self, axis: int, value: float) -> str:
        return AXES[axis] + (self._length(value) if axis < 3 else f"{value:.6f}")

    def _length(self, mm: float) -> str:
        return f"{mm / 25.4:.9f}" if self.style.inch else f"{mm:.7f}"

    def _emit(self, words: list[str], feed: float | None = None) -> None:
        if feed is not None:
            words = [*words, f"F{feed / 25.4:.9f}" if self.style.inch else f"F{feed:g}"]
        text = " ".join(words)
        if self.style.looks:
            if self.random.random() < 0.2:
                self._add(self.random.choice(["", "(between)", "; between", "N77", "/"]), -1)
            text = self._look(words)
        self._add(text, self.step)

    def _add(self, text: str, step: int) -> None:
        self.lines.append(text)
        self.origin.append(step)

    def _look(self, words: list[str]) -> str:
        """The same words otherwise: order, case, zeros, signs, blanks, comments, line numbers."""
        r = self.random
        written = []
        for word in words:
            letter, number = word[0], word[1:]
            sign = "-" if number.startswith("-") else ""
            number = number.lstrip("-")
            if "." in number and letter not in "GM" and r.random() < 0.5:
                number = number.rstrip("0").rstrip(".") or "0"
            if number.startswith("0.") and r.random() < 0.3 and len(number) > 2:
                number = number[1:]
            if letter not in "GM" and r.random() < 0.2:
                number = ("0" if letter in "XYZABCIJKRF" else "") + number
            if letter in "GM" and number.isdigit() and r.random() < 0.3:
                number = number.zfill(2)
            if not sign and letter in "XYZABCIJKR" and r.random() < 0.2:
                sign = "+"
            blank = r.choice(["", "", "", " ", "\t"])
            written.append(f"{letter.lower() if r.random() < 0.3 else letter}{blank}{sign}{number}")
        if r.random() < 0.3:
            r.shuffle(written)
        text = r.choice(["", " ", "  "]).join(written)
        if r.random() < 0.3:
            text = r.choice(["N10 ", "n0", "N 99999 ", "  "]) + text
        if r.random() < 0.3:
            text += r.choice([" (end)", ";end", " (a) (b)", "  "])
        return text


STEP_METHODS = {
    Line: "_line",
    Turn: "_turn",
    Holes: "_holes",
    System: "_system",
    Shift: "_shift",
    Length: "_tool_length",
    Pause: "_pause",
}
