"""Codes that set what holds from here on, and which block runs next.

Units, plane, distance modes (G20 G21, G17 G18 G19, G90 G91, G90.1 G91.1); F and S, feed and spindle modes (G93 G94 G95,
G96 G97), G4, the feed of a move; subprogram calls (M97, M98), M99, the end (M2, M30), which `interpreter` carries out.
mm/min inside.
"""

from __future__ import annotations

import math

from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.codes.code import Alias, Code, g_codes, holds_anyway, m_codes
from toolpath_stiff.nc.codes.points import forget_polar, refuse_while_rotated
from toolpath_stiff.nc.controller import GENERIC, MILLISECONDS, SECONDS
from toolpath_stiff.nc.frames import Numbers
from toolpath_stiff.nc.moves import Arc
from toolpath_stiff.nc.state import POINT_WORDS, Call, CurrentBlock, Flow, GoTo, State
from toolpath_stiff.nc.words import Word
from toolpath_stiff.units import MM_PER_INCH, SECONDS_PER_DAY

_FANUC, _HAAS = "Fanuc, operator's manuals", "Haas, mill operator's manual"


_OURS = ("generic", "fanuc")


def units(state: State, block: CurrentBlock, code: str) -> None:
    """G20: lengths and feeds in inches; G21: in millimetres."""
    inch = code == "G20"
    if inch != state.inch and state.frames.tool:
        raise block.fail(
            code,
            "while a tool length is in force: LinuxCNC would read its number in the new unit",
            "G49 before it",
        )
    state.inch = inch


def plane(state: State, block: CurrentBlock, code: str) -> None:
    """G17, G18, G19: the plane of arcs, drilling cycles and polar words."""
    if code != state.plane:
        refuse_while_rotated(state, block, block.codes[code], "takes another plane")
        state.plane = code
        forget_polar(state)


def distance(state: State, block: CurrentBlock, code: str) -> None:
    """G90: axis words name points; G91: steps from the present one."""
    state.absolute = code == "G90"


def arc_distance(state: State, block: CurrentBlock, code: str) -> None:
    """G90.1: I, J, K name the centre; G91.1: its distance from the start."""
    state.arc_absolute = code == "G90.1"


_UNITS, _PLANE, _DISTANCE = g_codes("G20 G21"), g_codes("G17 - G19.1"), g_codes("G90 G91")


_FANUC_INCH = "Fanuc, operator's manuals, Inch/metric conversion (G20 G21, in G-code system C G70 G71)"


MODE_CODES = (
    Code("G17", "plane", plane, "plane XY", _PLANE),
    Code("G18", "plane", plane, "plane ZX", _PLANE),
    Code("G19", "plane", plane, "plane YZ", _PLANE),
    Code("G20", "units", units, "inch", _UNITS),
    Code("G21", "units", units, "mm", _UNITS),
    Code("G90", "distance", distance, "absolute", _DISTANCE),
    Code("G91", "distance", distance, "incremental", _DISTANCE),
    Code("G90.1", "arc distance", arc_distance, "absolute arc centres", g_codes("G90.1 G91.1")),
    Code("G91.1", "arc distance", arc_distance, "incremental arc centres", g_codes("G90.1 G91.1")),
)


MODE_ALIASES = (
    Alias("G70", "G20", "inch", _FANUC_INCH, ("fanuc",)),
    Alias("G71", "G21", "mm", _FANUC_INCH, ("fanuc",)),
)


SLOWEST = 1e-6  # mm/min, or 1/min: slower is a slip, and its time beyond all numbers


def feed_mode(state: State, block: CurrentBlock, code: str) -> None:
    """G93: F is one over the minutes of the move; G94: per minute; G95: per revolution."""
    if code != state.feed_mode:
        state.feed = None  # the old number means something else now
    state.feed_mode = code
    if code == "G95":
        state.turning.setdefault("feed per revolution (G95)", block.line)


def feed_word(state: State, block: CurrentBlock, code: str) -> None:
    """F: the feed from here on; F0 takes it away."""
    feed = block.take("F")
    assert feed is not None
    word = block.values["F"]
    if feed < 0.0:
        raise block.fail(word, "is a negative feed", "F above 0")
    if 0.0 < feed * state.feed_scale < SLOWEST:
        raise block.fail(word, "is slower than a nanometre a minute", "a feed that moves")
    if "." not in word.text and feed and bare_feed_is_open(state):
        units = "inch" if state.inch else "mm"
        raise block.fail(
            word,
            f"without a decimal point is a feed that depends on the control's parameters ({state.dialect.name})",
            f"{word.text}. if it is that many {units} per {'revolution' if state.feed_mode == 'G95' else 'minute'}",
        )
    state.feed = feed * state.feed_scale if feed > 0.0 else None


def bare_feed_is_open(state: State) -> bool:
    """Whether a control's parameters say what F without a decimal point counts."""
    if state.feed_mode == "G93":
        return False
    per_revolution = state.dialect.increments and state.feed_mode == "G95"
    return per_revolution or ("inch" if state.inch else "mm") in state.dialect.feed_needs_point


def speed_word(state: State, block: CurrentBlock, code: str) -> None:
    """S: the spindle speed, 1/min."""
    if _dwells_by(state, block) == "S":
        return
    speed = block.take("S")
    assert speed is not None
    if speed < 0.0:
        raise block.fail("S", "is a negative speed", "S of 0 or more")
    state.speed = speed


def surface_speed(state: State, block: CurrentBlock, code: str) -> None:
    """G96: D is its greatest spindle speed, which does not enter."""
    block.take("D")
    state.turning.setdefault("constant surface speed (G96)", block.line)


def _dwells_by(state: State, block: CurrentBlock) -> str:
    """The word that holds the time of a block's G4: P; X on Fanuc's controls, S in Marlin; "" for no such word."""
    if "G4" not in block.codes:
        return ""
    letters = {"linuxcnc": "P", "generic": "PXS"}.get(state.dialect.name, "XP")
    return next((letter for letter in letters if letter in block.values), "")


def dwell(state: State, block: CurrentBlock, code: str) -> None:
    """G4: a pause, before the block's own moves."""
    letter = _dwells_by(state, block)
    seconds = time_word(state, block, letter) if letter else None
    if not letter and state.dialect.name in _OURS and "F" not in block.values:  # F: seconds on Siemens' controls
        state.assume("G4 without a time is no pause: an exact stop (Fanuc), the end of the moves before it (Marlin)")
        seconds = 0.0
    if state.dialect.name == GENERIC.name and letter in ("X", "S"):
        word = block.values[letter]
        if letter == "X" and ("." not in word.text or any(block.has(axis) for axis in POINT_WORDS)):
            raise block.fail(
                word,
                "beside G4 is not certainly a time: without a point it counts milliseconds on Fanuc's controls",
                f"{word.text.rstrip('.')}. alone, for seconds",
                "name the control with --dialect",
            )
        state.assume(f"the {letter} of G4 is a time in seconds, as {'Fanuc' if letter == 'X' else 'Marlin'} means it")
    if seconds is None or not 0.0 <= seconds <= SECONDS_PER_DAY:
        raise block.fail(code, "needs its time", "P with the seconds, 0 or more")
    state.recorder.add_dwell(seconds)


def time_word(state: State, block: CurrentBlock, letter: str) -> float | None:
    """A time word in s; what its number counts is the dialect's."""
    value = block.take(letter)
    if value is None or state.dialect.dwell == SECONDS:
        return value
    written = block.as_written(letter)
    if "." not in written.text:
        return written.value / 1e3
    if letter == "P" and state.dialect.dwell == MILLISECONDS:
        raise block.fail(written, f"has a decimal point, which {state.dialect.name} does not allow", "milliseconds")
    return value


def feed_of_move(state: State, block: CurrentBlock, start: list[float], end: list[float], arc: Arc | None) -> float:
    """Feed of a move in mm/min, or deg/min for one of the rotary axes alone."""
    if state.feed is None:
        words: list[Word] = [w for w in block.block.words if w.letter == "G"]
        raise block.fail(
            words[0] if words else block.block.words[0],
            "is a feed move before any feed" if state.feed_mode != "G93" else "is a feed move without F under G93",
            "F above 0"
            if state.feed_mode != "G94"
            else f"F above 0, or {both_names('--feed', 'MM_PER_MIN')} for such moves",
        )
    if state.feed_mode == "G93":
        feed, state.feed = state.feed, None  # every move needs its own
        return feed * length_of_move(start, end, arc)
    if state.feed_mode == "G95":
        if state.feed * state.speed < SLOWEST:
            raise block.fail(None, f"feed per revolution (G95) with the spindle at S{state.speed:g}", "S above 0")
        return state.feed * state.speed
    linear = math.dist(start[:3], end[:3]) if arc is None else arc_length(arc, start, end)
    return rotary_feed(state, state.feed) if linear == 0.0 else state.feed


def rotary_feed(state: State, feed: Numbers) -> Numbers:
    """G94's feed of the rotary axes alone, deg/min: degrees are degrees in inch programs too."""
    return feed / (MM_PER_INCH if state.inch else 1.0)


def length_of_move(start: list[float], end: list[float], arc: Arc | None) -> float:
    """Millimetres of a move or, of the rotary axes alone, degrees of the one that turns most."""
    linear = math.dist(start[:3], end[:3]) if arc is None else arc_length(arc, start, end)
    if linear > 0.0:
        return linear
    return max(abs(e - s) for s, e in zip(start[3:], end[3:], strict=True))


def arc_length(arc: Arc, start: list[float], end: list[float]) -> float:
    """Length of an arc or helix as `path.move_lengths` has it, so that G93's F is one over the move's time."""
    climb = sum((e - s) * n for s, e, n in zip(start, end, arc.normal, strict=False))
    first = math.dist(start[:3], arc.center)
    last = math.sqrt(max(math.dist(end[:3], arc.center) ** 2 - climb**2, 0.0))
    return math.hypot(arc.sweep * (first + last) / 2.0, climb, last - first)


_FEEDS, _SPINDLE = g_codes("G93 G94 G95"), g_codes("G96 G97")


FEED_CODES = (
    Code("F", "F", feed_word, "feed", "LinuxCNC, Other Codes, F: Set Feed Rate"),
    Code("S", "S", speed_word, "spindle speed", "LinuxCNC, Other Codes, S: Set Spindle Speed"),
    Code("G4", "non-modal", dwell, "dwell", f"{g_codes('G4')}; {_FANUC}, Dwell (G04); Marlin, G004", step="dwell"),
    Code("G93", "feed mode", feed_mode, "inverse-time feed", _FEEDS),
    Code("G94", "feed mode", feed_mode, "feed per minute", _FEEDS),
    Code("G95", "feed mode", feed_mode, "feed per revolution", _FEEDS),
    Code(
        "G96", "spindle mode", surface_speed, "constant surface speed", _SPINDLE,
        listed="constant surface speed: the spindle speed does not enter",
    ),
    Code("G97", "spindle mode", holds_anyway, "spindle speed in revolutions", _SPINDLE, label="spindle mode"),
)  # fmt: skip


def call(state: State, block: CurrentBlock, code: str) -> None:
    """M98 P L: run a subprogram; M97 P L (Haas), M98 Q L (Fanuc): from that N number. The block's moves first."""
    word = block.codes[code]
    if code == "M97" and not state.dialect.local_calls:
        raise block.fail(
            word,
            "is Haas' call of a block by its N number",
            hint="give --dialect haas if it is that, or make it a subprogram (O number, M98, M99)",
        )
    if block.groups.get("non-modal") in ("G4", "G10"):
        raise block.fail(word, "beside a code that uses the P word too", "two blocks")
    local = code == "M97"
    if code == "M98" and block.has("Q"):
        if state.dialect.name != "fanuc" or block.has("P"):
            raise block.fail(
                "Q",
                "beside M98 names the block at which the call begins, as on Fanuc's controls with parameter 6005",
                hint="make what it calls a subprogram of its own (O, M99)"
                if block.has("P")
                else "name the control with --dialect fanuc if it is that",
            )
        local = True
        state.assume("M98 Q calls the block of that N number, as Fanuc's controls do with parameter 6005 #0")
    number = block.whole("Q" if local and code == "M98" else "P", word)
    if number is None:
        raise block.fail(word, "without P", "P with the number of what it calls")
    if state.dialect.name == "linuxcnc" and "L" in block.values and block.values["L"].value == 0:
        block.take("L")  # LinuxCNC's tests/interp/m98m99: L0 calls nothing
        return
    repeats = block.whole("L", word)
    block.flow = Call(number, repeats, word.column, local)


def macro_call(state: State, block: CurrentBlock, code: str) -> None:
    """G65, G66, G67: `parametric` carries them out; what comes here is of a control that has none."""
    raise block.fail(code, "is a macro call of Fanuc's and Haas' controls", hint="name the control with --dialect")


def end_of_subprogram(state: State, block: CurrentBlock, code: str) -> None:
    """M99: back to the block after the call; with P, to the block of the caller with that N number."""
    number = block.whole("P", block.codes[code])
    block.flow = Flow.RETURN if number is None else GoTo(number, block.values["P"].column)


def end_of_program(state: State, block: CurrentBlock, code: str) -> None:
    """M2, M30: nothing runs after this block."""
    block.flow = Flow.END


_CALLS = "LinuxCNC, O Codes, Fanuc-Style Programs; Fanuc, operator's manuals, Subprogram (M98, M99)"


_MACROS = "Fanuc, operator's manuals, Custom macro, Macro call (G65, G66, G67)"


FLOW_CODES = (
    Code("M0", "M stop", holds_anyway, "stop", m_codes("M0 M1")),
    Code("M1", "M stop", holds_anyway, "optional stop", m_codes("M0 M1")),
    Code("M60", "M stop", holds_anyway, "stop", m_codes("M60")),
    Code("M2", "M stop", end_of_program, "end", m_codes("M2 M30")),
    Code("M30", "M stop", end_of_program, "end", m_codes("M2 M30")),
    Code(
        "M97", "M subprogram", call, "call by line number (Haas)", "Haas, mill operator's manual, M97",
        controls=("haas",),
    ),
    Code("M98", "M subprogram", call, "subprogram call", _CALLS),
    *(
        Code(code, "non-modal", macro_call, meaning, _MACROS, controls=("generic", "fanuc", "haas"))
        for code, meaning in (("G65", "macro call"), ("G66", "macro call after moves"), ("G67", "no such call"))
    ),
    Code("M99", "M subprogram", end_of_subprogram, "subprogram end", _CALLS),
)  # fmt: skip
