"""Feed, speed and time: F and S, G93 G94 G95, G96 G97, the feed of a move; G4 and time words. mm/min, s inside."""

from toolpath_stiff.nc.codes.code import FANUC, Code, family, g_codes
from toolpath_stiff.nc.controller import GENERIC, MILLISECONDS, SECONDS
from toolpath_stiff.nc.courses import length_of_move
from toolpath_stiff.nc.frames import Numbers
from toolpath_stiff.nc.moves import Arc, Remark
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES
from toolpath_stiff.units import MM_PER_INCH

LONG_PAUSE = 100.0  # s; a longer one may count milliseconds
SLOWEST = 1e-6  # mm/min, or 1/min: slower is a mistake, and its time would overflow


def feed_mode(state: State, block: CurrentBlock, code: str) -> None:
    """G93: F is one over the minutes of the move; G94: per minute; G95: per revolution."""
    if code != state.feed_mode:
        state.feed = None  # the old number has another meaning now
    state.feed_mode = code
    if code == "G95":
        state.turning.setdefault("feed per revolution (G95)", block.line)


def feed_word(state: State, block: CurrentBlock, code: str) -> None:
    """F: the feed from here on; F0 takes it away."""
    if dwells_by(state, block) == "F":
        return
    feed, word = block.take("F") or 0.0, block.values["F"]
    slow = feed < 0.0 or 0.0 < feed * state.feed_scale < SLOWEST
    block.refuse_if(slow, word, "is no feed that moves", "F above 0, a nanometre a minute or more")
    bare = "." not in word.text and feed and bare_feed_is_open(state)
    problem = f"without a decimal point depends on the control's parameters ({state.dialect.name})"
    block.refuse_if(bare, word, problem, f"{word.text}. if it is that many units")
    state.feed = feed * state.feed_scale or None


def bare_feed_is_open(state: State) -> bool:
    """True if a control's parameters decide what F without a decimal point counts."""
    if state.feed_mode == "G93":
        return False
    per_revolution = state.dialect.increments and state.feed_mode == "G95"
    return per_revolution or ("inch" if state.inch else "mm") in state.dialect.feed_needs_point


def speed_word(state: State, block: CurrentBlock, code: str) -> None:
    """S: the spindle speed, 1/min."""
    if dwells_by(state, block) == "S":
        return
    state.speed = block.take("S") or 0.0
    block.refuse_if(state.speed < 0.0, "S", "is a negative speed", "S of 0 or more")


def surface_speed(state: State, block: CurrentBlock, code: str) -> None:
    """G96: D, the greatest spindle speed, is not used; G97: S is revolutions again, unknown until the next S."""
    if code == "G97":
        state.speed = state.speed if "S" in block.values or not state.surface_speed else 0.0
        state.surface_speed = False
        return
    block.take("D")
    state.surface_speed = True
    state.turning.setdefault("constant surface speed (G96)", block.line)


def turn_spindle(state: State, block: CurrentBlock, code: str) -> None:
    """M3: clockwise, M4: the other way, M5, M19: it stands; M13, M14: as M3, M4, with coolant."""
    state.turn = {"M3": 1, "M13": 1, "M4": -1, "M14": -1}.get(code, 0)


def feed_of_move(state: State, block: CurrentBlock, start: list[float], end: list[float], arc: Arc | None) -> float:
    """Feed of a move in mm/min, or deg/min if only rotary axes move."""
    if state.feed is None:
        word = next((word for word in block.block.words if word.letter == "G"), block.block.words[0])
        block.refuse_if(state.feed_mode == "G93", word, "is a feed move without F under G93", "F above 0")
        hint = ", or --feed MM_PER_MIN for such moves" if state.feed_mode == "G94" else ""
        raise block.fail(word, "is a feed move before any feed", f"F above 0{hint}")
    if state.feed_mode == "G93":
        feed, state.feed = state.feed, None  # every move needs its own F
        # For rotary axes alone, the degrees of the axis that turns most.
        return feed * (
            length_of_move(start, end, arc) or max(abs(e - s) for s, e in zip(start[3:], end[3:], strict=True))
        )
    if state.feed_mode == "G95":
        if state.feed * state.speed < SLOWEST:
            raise block.fail(None, f"feed per revolution (G95) with the spindle at S{state.speed:g}", "S above 0")
        return state.feed * state.speed
    return state.feed if arc is not None or start[:3] != end[:3] else rotary_feed(state, state.feed)


def rotary_feed(state: State, feed: Numbers) -> Numbers:
    """G94's feed if only rotary axes move, deg/min: degrees stay degrees in inch programs."""
    return feed / (MM_PER_INCH if state.inch else 1.0)


def dwells_by(state: State, block: CurrentBlock) -> str:
    """Word with the time of a block's G4: P; in generic programs those of `TIMES`; "" if there is none."""
    if "G4" not in block.codes:
        return ""
    letters = {"linuxcnc": "P", "generic": "PXSKF"}.get(state.dialect.name, "XP")
    return next((letter for letter in letters if letter in block.values), "")


# Letters that mean a time beside G4, by control, and the seconds of 1 (Fanuc, Dwell (G04); Marlin, G004; Fagor, 8055,
# programming manual, G04: hundredths of a second; Siemens, Fundamentals, Dwell time).
TIMES = {"X": ("Fanuc", 1.0), "S": ("Marlin", 1.0), "K": ("Fagor", 0.01), "F": ("Siemens", 1.0)}


def dwell(state: State, block: CurrentBlock, code: str) -> None:
    """G4: a pause, before the block's own moves."""
    letter = dwells_by(state, block)
    seconds = time_word(state, block, letter) if letter else None
    if not letter and state.dialect.name in ("generic", "fanuc"):
        state.assume("G4 without a time is no pause: an exact stop (Fanuc), the end of the moves before it (Marlin)")
        seconds = 0.0
    if state.dialect.name == GENERIC.name and letter in TIMES and seconds is not None:
        word, (control, unit) = block.values[letter], TIMES[letter]
        doubtful = any(block.has(axis) for axis in AXES) or (letter == "X" and "." not in word.text)
        expected = f"{word.text.rstrip('.')}. alone, for seconds"
        block.refuse_if(doubtful, word, "beside G4 may count milliseconds", expected, "name the control with --dialect")
        counts = "hundredths of a second" if letter == "K" else "seconds"
        state.assume(f"the {letter} of G4 is a time in {counts}, as {control} means it")
        seconds *= unit
    long = seconds is not None and seconds >= LONG_PAUSE and state.dialect.name == GENERIC.name and letter == "P"
    if long and "." not in block.values["P"].text:
        text = f"G4 {block.values['P'].text} is a pause of as many seconds; Marlin and Mach3 may count milliseconds"
        state.warnings.append(Remark(text, block.line))
    state.pause(block, code, seconds, "P with the seconds, 0 or more")


def time_word(state: State, block: CurrentBlock, letter: str) -> float | None:
    """A time word in s; its unit depends on the dialect."""
    value = block.take(letter)
    if value is None or state.dialect.dwell == SECONDS:
        return value
    written = block.as_written(letter)
    if "." not in written.text:
        return written.value / 1e3
    whole = letter == "P" and state.dialect.dwell == MILLISECONDS
    block.refuse_if(whole, written, f"has a decimal point, which {state.dialect.name} does not allow", "milliseconds")
    return value


_FEEDS = {"G93": "inverse-time feed", "G94": "feed per minute", "G95": "feed per revolution"}
_DWELL = f"{g_codes('G4')}; {FANUC}, Dwell; Marlin, G004; Fagor, G04; Siemens, G4"
_SPINDLE, _UNUSED = g_codes("G96 G97"), "constant surface speed: the spindle speed does not enter"
FEED_CODES = (
    Code("F", "F", feed_word, "feed", "LinuxCNC, Other Codes, F: Set Feed Rate"),
    Code("S", "S", speed_word, "spindle speed", "LinuxCNC, Other Codes, S: Set Spindle Speed"),
    *family(_FEEDS, "feed mode", feed_mode, g_codes("G93 G94 G95")),
    Code("G96", "spindle mode", surface_speed, "constant surface speed", _SPINDLE, listed=_UNUSED),
    Code("G4", "non-modal", dwell, "dwell", _DWELL, step="dwell"),
    Code("G97", "spindle mode", surface_speed, "spindle speed in revolutions", _SPINDLE),
)
