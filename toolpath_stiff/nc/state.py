"""The state of the interpreter: the current block, and all that a control keeps between blocks.

mm, degrees, mm/min.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field, replace
from enum import Enum
from typing import Literal, get_args

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.compensation import RadiusCompensation
from toolpath_stiff.nc.controller import GENERIC, Dialect
from toolpath_stiff.nc.elements import Element
from toolpath_stiff.nc.frames import UNIT, Frames, Matrix
from toolpath_stiff.nc.geometry import GeometryError
from toolpath_stiff.nc.moves import Move, Recorder, Remark, Unsupported
from toolpath_stiff.nc.tables import LARGEST_MM, LARGEST_WORD, ToolEntry, tool_of
from toolpath_stiff.nc.words import AXES, Block, Word
from toolpath_stiff.units import MM_PER_INCH, SECONDS_PER_DAY

# Modal groups in the order in which the codes and words of a block act: both are LinuxCNC's (manual, "G-Code Overview",
# "Modal Groups" and "Order of Execution"), because its interpreter is what the results are compared with. Groups of M
# codes begin with "M ", since a G code may have a group of that name too. "dwell" is a step of G4 alone; F, S and T act
# without a code.
#
# Units first, so that an F beside G20 is in inches; the moves last. Up to `LAST_MODE`, a group may be executed ahead of
# the rest of the block: doing so twice changes nothing but dwells.
Group = Literal[
    "units", "feed mode", "F", "S", "T", "M tool change", "dwell", "plane", "polar", "tool length", "M subprogram",
    "work offset", "path control", "exact stop", "look-ahead", "dynamic offset", "spindle mode", "distance",
    "arc distance", "cycle return", "cutter compensation", "lathe diameter", "scaling", "mirror image", "stroke check",
    "speed watch", "polar interpolation", "M spindle", "M coolant", "M overrides", "M saved modes", "M rigid tapping",
    "rotation", "non-modal", "M stop", "motion", "corner",
]  # fmt: skip
STEPS: dict[Group, int] = {group: place for place, group in enumerate(get_args(Group))}
LAST_MODE = STEPS["M rigid tapping"]
LATHE_HINT = "this reads the programs of mills: post it for a mill, with X as a position"


class Flow(Enum):
    """The block that runs after this one, unless that is a `Call`."""

    NEXT = "the next one"
    RETURN = "the one after the call (M99)"
    END = "none: the program has ended"


@dataclass(frozen=True)
class Call:
    """A subprogram call: its number, its L (None: not given), the column of its code; `local`: by an N number.

    `arguments`: the local variables that a macro call gives; `modal`: G66.
    """

    number: int
    repeats: int | None
    column: int
    local: bool = False
    arguments: dict[int, float | None] | None = None
    modal: bool = False


Then = Flow | Call | Word  # what runs after a block; a `Word` is the P of M99: the caller's block with that N number


@dataclass
class CurrentBlock:
    """The block being executed.

    Attributes
    ----------
    name
        Of the program, for errors.
    block
        As it was read.
    codes
        Code -> its word, of the codes that are known.
    groups
        Modal group -> code; no two codes of a group are in one block.
    values
        Letter -> word, of the other words; `free` are the letters that nothing has taken yet.
    flow
        What it asks of whoever runs the blocks, once its own moves are made.
    """

    name: str
    block: Block
    codes: dict[str, Word] = field(default_factory=dict)
    groups: dict[Group, str] = field(default_factory=dict)
    values: dict[str, Word] = field(default_factory=dict)
    free: set[str] = field(default_factory=set)
    flow: Then = Flow.NEXT

    @property
    def line(self) -> int:
        """Line number, from 1."""
        return self.block.line

    def code(self, group: Group) -> tuple[str, Word] | None:
        """The block's code of a modal group, and its word; None if there is none."""
        name = self.groups.get(group)
        return None if name is None else (name, self.codes[name])

    def has(self, letter: str) -> bool:
        """True if the block has this word and it is not yet used."""
        return letter in self.free

    def take(self, letter: str) -> float | None:
        """The value of a word, now counted as used; None if the block does not have it."""
        if letter not in self.free:
            return None
        self.free.discard(letter)
        return self.values[letter].value

    def as_written(self, letter: str) -> Word:
        """A word with its number as written, before the decimal-point rule."""
        return next(word for word in self.block.words if word.letter == letter)

    def whole(self, letter: str, word: Word, least: int = 1) -> int | None:
        """The whole number of a word beside a code, now used; None without the word. Raises `InputError`."""
        value = self.take(letter)
        if value is None:
            return None
        if value != int(value) or value < least:
            raise self.fail(self.values[letter], f"beside {word.text} is not a count", f"a whole number from {least}")
        return int(value)

    def refuse_if(
        self, wrong: object, culprit: Word | str | None, problem: str, expected: str = "", hint: str = ""
    ) -> None:
        """Raise the error of `fail` if `wrong`."""
        if wrong:
            raise self.fail(culprit, problem, expected, hint)

    def add(self, letter: str, word: Word) -> None:
        """Add a word under its letter: each letter once, and values only up to a control's limit."""
        self.refuse_if(letter in self.values, word, "repeats a word of its block", "each word once")
        if abs(word.value) > LARGEST_MM:
            of_axis = letter.lstrip("I@") in {*AXES}
            largest = LARGEST_MM if of_axis else LARGEST_WORD
            problem = "is beyond 100 m" if of_axis else "is beyond any number that a control takes"
            self.refuse_if(abs(word.value) > largest, word, problem, f"at most {largest:.0f}")
        self.values[letter] = word
        self.free.add(letter)

    @contextmanager
    def placing(self) -> Iterator[None]:
        """Add the block's place to errors of geometry (`GeometryError`)."""
        try:
            yield
        except GeometryError as error:
            raise self.fail(None, error.found, error.expected) from None

    def fail(self, culprit: Word | str | None, problem: str, expected: str = "", hint: str = "") -> InputError:
        """An error at a word of the block (given itself, or by code or letter), or at the block."""
        word = self.codes.get(culprit) or self.values.get(culprit) if isinstance(culprit, str) else culprit
        head = self.block.words[0]  # for a statement in plain language: its name
        text = f"{word.text} {problem}" if word else problem if head.letter else f"{head.text}: {problem}"
        column = word.column if word else head.column
        return ProgramError(text, expected=expected, hint=hint, file=self.name, line=self.line, column=column)


START = "before its first move the tool stands at 0, 0, 0 of the control, as LinuxCNC assumes"


Values = dict[str, float]  # parameters of a cycle, by their names


@dataclass
class Conversational:
    """State kept only by controls with words of their own (Heidenhain, Siemens); mm, degrees, program axes.

    Attributes
    ----------
    pole, heading
        Circle centre (CC) with its plane, and the direction in which the last contour element ended; None: not known.
    held, corner
        A contour element that waits for the corner behind it, with its feed, and that corner's statement (CHF, RND).
    approach
        The contour point of an APPR, and what it does once the direction of the first element is known.
    free, closes
        Elements of a free contour (FK) not determined yet, with whether a corner follows; where CLSD+ began it.
    fast
        Whether the last positioning was a rapid.
    to_corner
        Whether the next statement is a corner.
    cycle, modal, pattern
        The cycle defined last with its parameters, whether M89 calls it after each positioning, and the points of
        PATTERN DEF with what each adds to the surface, in the program's unit.
    shift, outer, angle, mirrored, scale, tilt
        Cycle 7 (in the tilted plane; before the tilting), 10, 8 (axes), 11, and PLANE or cycle 19; None: not tilted.
    doubt
        Why the order of those is uncertain, until a reset settles it.
    unknown
        Axes of the plane whose position is not known until they are named.
    tool_feed, radius, held_tip, shorter
        F of TOOL CALL (mm/min), the tool's radius with its DR, M128 and M126 in force.
    led_to
        Angles to which vectors (LN) led the tool last: under M128 it keeps them while X, Y, Z move; None: none have.
    preset, names, stock, parameters
        The datum of cycle 247; numbers given to tools of a name; the corners of the blank; Q parameters.
    inner
        Siemens' programmable frame without its shift: turn, mirror image, scale.
    renumbered
        Axes whose numbers changed while they stood, until they are named.
    side, entry, rounding, feed_place
        G40, G41, G42 that waits for the next straight move; KONT or G451 in force, "" for NORM and G450; CFC (F holds
        on arcs of contours), CFIN (on inside ones) or CFTCP in force, "": F is always the tool centre's.
    base
        G500 in force: "machine", or "zero" where the program takes no other offset; "": it is not.
    contour
        Elements of the contour that CYCLE72 mills.
    labels, contour_data, drawn
        Cycles 14 and 20, and what draws the contour of a label, with its side: +1 RL, -1 RR, 0.
    offsets_named, changes_by_t, transformed
        Whether the program takes settable offsets, and changes tools by T alone; TRAORI in force.
    """

    pole: tuple[str, complex] | None = None
    heading: complex | None = None
    held: tuple[CurrentBlock, Element, float | None] | None = None
    corner: CurrentBlock | None = None
    approach: tuple[dict[int, float], Callable[[complex], None]] | None = None
    free: list[tuple[CurrentBlock, str, bool]] = field(default_factory=list)
    closes: complex = complex(math.nan, math.nan)
    fast: bool = False
    to_corner: bool = False
    cycle: tuple[int, Values] | None = None
    modal: bool = False
    pattern: list[tuple[complex, float]] = field(default_factory=list)
    shift: list[float] = field(default_factory=lambda: [0.0] * 3)
    outer: list[float] = field(default_factory=lambda: [0.0] * 3)
    angle: float = 0.0
    mirrored: frozenset[int] = frozenset()
    scale: float = 1.0
    tilt: Matrix | None = None
    doubt: str = ""
    unknown: set[int] = field(default_factory=set)
    tool_feed: float | None = None
    radius: float = math.nan
    held_tip: bool = False
    led_to: list[float] | None = None
    shorter: bool = False
    preset: float | None = None
    names: dict[str, int] = field(default_factory=dict)
    stock: dict[str, list[float]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    inner: Matrix = field(default_factory=lambda: [list(row) for row in UNIT])
    renumbered: set[int] = field(default_factory=set)
    side: str = ""
    entry: str = ""
    rounding: float = 0.0
    feed_place: str = ""
    base: str = ""
    contour: list[Element] = field(default_factory=list)
    labels: list[float] = field(default_factory=list)
    contour_data: Values = field(default_factory=dict)
    drawn: Callable[[CurrentBlock, float], tuple[list[Element], int]] | None = None
    offsets_named: bool = False
    changes_by_t: bool = False
    transformed: bool = False


@dataclass
class Record:
    """State that a program of any language sets, and the results of its run; mm.

    Attributes
    ----------
    name
        Of the program, for errors.
    tools
        The tool table; None: there is none.
    feed
        F in force: mm/min, mm per revolution or, in G93, one over minutes; None before there is one.
    speed
        S in force, 1/min.
    tool, tool_length
        The tool in the spindle, and its length in force; nan: none, the machine's reference tool.
    recorder, used_tools
        The moves found so far; the tools that moved, by number.
    unsupported, warnings, assumptions
        As in `ReadProgram`.
    """

    name: str
    _: KW_ONLY
    tools: dict[int, ToolEntry] | None = None
    feed: float | None = None
    speed: float = 0.0
    tool: int = 0
    tool_length: float = math.nan
    recorder: Recorder = field(default_factory=Recorder)
    used_tools: dict[int, ToolEntry] = field(default_factory=dict)
    unsupported: list[Unsupported] = field(default_factory=list)
    warnings: list[Remark] = field(default_factory=list)
    assumptions: list[str] = field(default_factory=list)

    def note_tool(self) -> None:
        """Add the tool in the spindle to those that moved."""
        if self.tool not in self.used_tools:
            self.used_tools[self.tool] = replace(tool_of(self.tools, self.tool))

    def warn_once(self, sentence: str, line: int) -> None:
        """Warn of what a line does, unless an earlier one does it too."""
        if all(remark.text != sentence for remark in self.warnings):
            self.warnings.append(Remark(sentence, line))

    def assume(self, sentence: str) -> None:
        """Note an assumption, once."""
        if sentence not in self.assumptions:
            self.assumptions.append(sentence)


@dataclass
class State(Record):
    """The state of a control, at the start as LinuxCNC's unless the dialect says otherwise.

    Attributes
    ----------
    frames, dialect
        Its coordinates (with the present point), what its words mean.
    motion
        The motion mode: "G0", "G1", "G2", "G3" or a drilling cycle; None after G80, and at the start.
    group_01
        On Fanuc's and Haas' controls, whose cycles are of another group (09): the last of G0 to G3, which G80 leaves.
    plane
        "G17", "G18" or "G19".
    absolute, arc_absolute, inch
        G90, G90.1, G20 in force.
    feed_mode
        "G93", "G94" or "G95".
    turn, surface_speed
        1 after M3, -1 after M4, 0 while the spindle stands; whether S is of the surface (G96).
    retract
        "G98" or "G99", once the program or the dialect says; LinuxCNC starts as in G99.
    polar
        G16: the last programmed radius (mm) and angle (degrees), nan before there is one; None: G15.
    selected
        The tool that T names for the next M6.
    renamed
        Whether the tool in the spindle is M61's.
    sticky
        What a run of drilling cycles keeps: R, Z, Q, P, the unit, the level from which it began.
    heights
        Of the last hole: whether in G90, R plane, bottom.
    unsettled
        "G68", "G69" or "G10", whichever turned the numbers of the present X and Y last, until both are programmed.
    length_changed, rotation_changed, height_lost
        LinuxCNC's rs274 forgets at M6 that tool length or rotation changed since the last move: the next begins
        elsewhere. `height_lost`: it did, and no Z was named since.
    tip_held
        Tool centre point control, by the number of moves before it is switched (G43.4) on or off.
    trace
        Each move of the current block, those of no length too, with its ends in control coordinates, for whoever starts
        the list.
    corner
        The block whose ,C or ,R the next block has to make with it; None: there is none.
    cutter
        Cutter compensation in force (G41, G42); None: G40.
    beside
        After G40, until the next move: from the programmed point to where the tool centre stands (6, set-up frame).
    named_length
        H of a block without G43, which a later G43 without H may mean.
    turning
        What makes the program look like a lathe's, with its line.
    plain
        What controls with words of their own keep besides.
    keep
        What a check does with an error after which the run can go on; None: it is raised.
    """

    frames: Frames
    dialect: Dialect = GENERIC
    motion: str | None = None
    group_01: str | None = None
    plane: str = "G17"
    absolute: bool = True
    arc_absolute: bool = field(init=False)
    inch: bool = False
    feed_mode: str = "G94"
    turn: int = 0
    surface_speed: bool = False
    retract: str | None = field(init=False)
    polar: list[float] | None = None
    selected: int = 0
    renamed: bool = False
    sticky: dict[str, float] = field(default_factory=dict)
    heights: tuple[bool, float, float] = (True, 0.0, 0.0)
    unsettled: str | None = None
    length_changed: bool = False
    rotation_changed: bool = False
    height_lost: bool = False
    tip_held: list[tuple[int, bool]] = field(default_factory=list)
    trace: list[Move] | None = None
    corner: CurrentBlock | None = None
    cutter: RadiusCompensation | None = None
    beside: list[float] | None = None
    named_length: float | None = None
    turning: dict[str, int] = field(default_factory=dict)
    saved: list[tuple[str, "State", int, float] | None] = field(default_factory=lambda: [None])
    plain: Conversational = field(default_factory=Conversational)
    keep: Callable[[InputError], None] | None = None

    def __post_init__(self) -> None:
        self.arc_absolute, self.retract = self.dialect.arc_absolute, self.dialect.retract

    @property
    def length_scale(self) -> float:
        """Millimetres per length unit of the program."""
        return MM_PER_INCH if self.inch else 1.0

    @property
    def feed_scale(self) -> float:
        """Millimetres per length unit of F."""
        return MM_PER_INCH if self.inch and self.feed_mode != "G93" else 1.0

    @property
    def spindle(self) -> float:
        """Spindle speed, 1/min, negative after M4; nan: unknown."""
        return math.nan if self.turn and self.surface_speed else self.turn * self.speed

    def fault(self, error: InputError) -> None:
        """Raise an error, unless a check keeps it and goes on."""
        if self.keep is None:
            raise error
        self.keep(error)

    def note_unknown(self, line: int, word: Word) -> None:
        """List an M code of unknown effect, with a warning."""
        self.note(line, word, "an M code of one control, not acted upon")
        self.warnings.append(Remark(f"what {word.text} does on its control is not known", line))

    def pause(self, block: CurrentBlock, code: str, seconds: float | None, expected: str) -> None:
        """A pause after the last move."""
        if seconds is None or not 0.0 <= seconds <= SECONDS_PER_DAY:
            raise block.fail(code, "needs its time", expected)
        self.recorder.add_dwell(seconds)

    def note(self, line: int, word: Word, reason: str) -> None:
        """List a word that is ignored."""
        self.unsupported.append(Unsupported(line, word.column, word.text, reason))
