"""F and S, feed and spindle modes (G93 G94 G95, G96 G97), G4; the feed of a move. mm/min inside."""

from __future__ import annotations

import math

from toolpath_stiff.nc.blocks import CurrentBlock
from toolpath_stiff.nc.codes.contract import (
    DWELL,
    FEED,
    FEED_MODE,
    ONCE,
    SPEED,
    SPINDLE_MODE,
    Code,
    g_codes,
    holds_anyway,
)
from toolpath_stiff.nc.dialects import MILLISECONDS, SECONDS
from toolpath_stiff.nc.frames import Numbers
from toolpath_stiff.nc.recorder import Arc
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.words import Word
from toolpath_stiff.units import MM_PER_INCH

SECONDS_PER_DAY = 86400.0


def feed_mode(state: State, block: CurrentBlock, code: str) -> None:
    """G93: F is one over the minutes of the move; G94: per minute; G95: per revolution."""
    if code != state.feed_mode:
        state.feed = None  # the old number means something else now
    state.feed_mode = code


def feed_word(state: State, block: CurrentBlock, code: str) -> None:
    """F: the feed from here on; F0 takes it away."""
    feed = block.take("F")
    assert feed is not None
    word = block.values["F"]
    if feed < 0.0:
        raise block.fail(word, "is a negative feed", "F above 0")
    if "." not in word.text and feed and bare_feed_is_open(state):
        units = "inch" if state.inch else "mm"
        raise block.fail(
            word,
            f"without a decimal point is a feed that hangs on the control's parameters ({state.dialect.name})",
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
    speed = block.take("S")
    assert speed is not None
    if speed < 0.0:
        raise block.fail(block.values["S"], "is a negative speed", "S of 0 or more")
    state.speed = speed


def surface_speed(state: State, block: CurrentBlock, code: str) -> None:
    """G96: D is its greatest spindle speed, which does not enter."""
    block.take("D")


def dwell(state: State, block: CurrentBlock, code: str) -> None:
    """G4: a pause, before the block's own moves."""
    seconds = time_word(state, block, "X" if state.dialect.dwell != SECONDS and block.has("X") else "P")
    if seconds is None or not 0.0 <= seconds <= SECONDS_PER_DAY:
        raise block.fail(block.codes[code], "needs its time", "P with the seconds, 0 or more")
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


# -- the feed of a move ----------------------------------------------------------------------------------------------


def feed_of_move(state: State, block: CurrentBlock, start: list[float], end: list[float], arc: Arc | None) -> float:
    """Feed of a move in mm/min, or deg/min for one of the rotary axes alone."""
    if state.feed is None:
        words: list[Word] = [w for w in block.block.words if w.letter == "G"]
        raise block.fail(
            words[0] if words else block.block.words[0],
            "is a feed move before any feed" if state.feed_mode != "G93" else "is a feed move without F under G93",
            "F above 0",
        )
    if state.feed_mode == "G93":
        feed, state.feed = state.feed, None  # every move needs its own
        return feed * length_of_move(start, end, arc)
    if state.feed_mode == "G95":
        if state.speed == 0.0:
            raise block.fail(None, "feed per revolution (G95) with the spindle at S0", "S above 0")
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
CODES = (
    Code("F", FEED, feed_word, "feed", "LinuxCNC, Other Codes, F: Set Feed Rate"),
    Code("S", SPEED, speed_word, "spindle speed", "LinuxCNC, Other Codes, S: Set Spindle Speed"),
    Code("G4", ONCE, dwell, "dwell", g_codes("G4"), step=DWELL),
    Code("G93", FEED_MODE, feed_mode, "inverse-time feed", _FEEDS),
    Code("G94", FEED_MODE, feed_mode, "feed per minute", _FEEDS),
    Code("G95", FEED_MODE, feed_mode, "feed per revolution", _FEEDS),
    Code(
        "G96", SPINDLE_MODE, surface_speed, "constant surface speed", _SPINDLE,
        listed="constant surface speed: the spindle speed does not enter",
    ),
    Code("G97", SPINDLE_MODE, holds_anyway, "spindle speed in revolutions", _SPINDLE, label=SPINDLE_MODE),
)  # fmt: skip
