"""Drilling, tapping and boring cycles (G73 G74 G76 G81 to G86, G89), expanded to their moves; G98 and G99. mm.

Sources: LinuxCNC's manual ("G80-G89 Canned Cycles", "G73") and interp_cycles.cc; Fanuc's operator's manuals ("Canned
cycle") where a dialect follows them.
"""

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.code import FANUC, Code, family, g_codes
from toolpath_stiff.nc.codes.feeds import time_word
from toolpath_stiff.nc.codes.motion import record
from toolpath_stiff.nc.codes.points import destination, point_words
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.strokes import MOST_STROKES, SAME_HEIGHT_MM, Drilling, strokes
from toolpath_stiff.nc.words import AXES
from toolpath_stiff.units import SECONDS_PER_DAY

CYCLES = ("G73", "G74", "G76", "G81", "G82", "G83", "G84", "G85", "G86", "G89")
TAPS = ("G74", "G84")
PECKS, DWELLS = ("G73", "G83"), ("G82", "G89")
MOST_REPEATS = 10_000
RENEWED = ("level", "unit")  # state that one cycle passes on to the next in its run


def return_level(state: State, block: CurrentBlock, code: str) -> None:
    """G98: cycles end at the level from which they began; G99: at their R plane."""
    state.retract = code


def begin_cycle(state: State, code: str) -> None:
    """Forget the words of the cycle in force when another begins; within a run the level and the unit stay."""
    if code != state.motion:
        kept = RENEWED if state.motion in CYCLES else ()
        state.sticky = {name: state.sticky[name] for name in kept if name in state.sticky}


def cycle(state: State, block: CurrentBlock, code: str) -> None:
    """Execute one block of a canned cycle: its holes, expanded."""
    given = "motion" in block.groups
    if not given and not any(block.has(letter) for letter in AXES):
        return
    elsewhere = code in TAPS and state.plane != "G17" and not state.dialect.increments
    block.refuse_if(elsewhere, None, f"{code} in {state.plane}: LinuxCNC's rs274 taps along another axis", "G17")
    normal = geometry.PLANES[state.plane][2]
    repeats = _repeats(state, block)
    _keep_heights(state, block, code, normal)
    words = _cycle_words(state, block, code, normal, given)
    frames = state.frames
    here = frames.to_program(frames.position)[normal]
    # The level from which a run of cycles began: G91's R counts from it, G98 returns to it.
    initial = state.sticky.setdefault("level", here)
    retract, bottom = _heights(state, block, code, initial)
    if not repeats:  # L0, or Fanuc's K0: the words are kept for the blocks that follow, and nothing moves
        return
    # As observed on LinuxCNC: a run that began below R goes to R first; otherwise a tool at or below R goes to the
    # level above the holes on its way to the next one.
    if initial < retract:
        _along_normal(state, block, normal, retract, RAPID)
        here = retract
    clear = max(initial, retract) if state.retract == "G98" else retract
    level = here if here > retract + SAME_HEIGHT_MM else clear
    _check_pecks(state, block, code, retract - bottom, repeats)
    peck, dwell, first, less, least = (state.sticky.get(letter, 0.0) for letter in "QPIJK")
    out_at_r = code in TAPS and state.dialect.increments
    hole = Drilling(code, bottom, retract, clear, peck, dwell, first, less, least, out_at_r)
    for _ in range(repeats):
        place = destination(state, block, frames.to_program(frames.position), words)
        place[normal] = level
        record(state, block, RAPID, frames.to_control(place), words)
        level = clear
        _along_normal(state, block, normal, hole.retract, RAPID)
        for height, motion, wait in strokes(hole):
            _along_normal(state, block, normal, height, motion)
            if wait:
                state.recorder.add_dwell(wait)


def _along_normal(state: State, block: CurrentBlock, normal: int, height: float, motion: int) -> None:
    frames = state.frames
    place = frames.to_program(frames.position)
    if place[normal] != height:
        place[normal] = height
        record(state, block, motion, frames.to_control(place), (normal,))


def _repeats(state: State, block: CurrentBlock) -> int:
    letter = next((letter for letter in state.dialect.cycle_repeats if block.has(letter)), None)
    if letter is None:
        return 1
    block.take(letter)
    word = block.as_written(letter)  # a count, whatever a K without a point means as a length
    wrong = word.value != int(word.value) or not 0 <= word.value <= MOST_REPEATS
    block.refuse_if(wrong, word, "is not a number of repeats", "a whole number from 0")
    return int(word.value)


def _keep_heights(state: State, block: CurrentBlock, code: str, normal: int) -> None:
    """Handle G90 or G91 after Z and R were given: Fanuc's hole stays where it is, LinuxCNC reads the numbers again."""
    absolute, retract, bottom = state.heights
    if absolute == state.absolute or not {"R", "Z", "level"} <= state.sticky.keys():
        return
    renewed = [letter for letter in ("R", AXES[normal]) if block.has(letter)]
    keeps = True if state.polar is not None else state.dialect.keeps_heights
    if len(renewed) == 2 or keeps is False:
        return
    if keeps is None or renewed:
        problem = "after a change between G90 and G91: controls differ in whether the hole keeps its heights"
        raise block.fail(None, f"{code} {problem}", f"R and {AXES[normal]} in the block, or --dialect")
    level = state.sticky["level"]
    heights = (retract, bottom) if state.absolute else (retract - level, bottom - retract)
    state.sticky["R"], state.sticky["Z"] = heights


def _cycle_words(state: State, block: CurrentBlock, code: str, normal: int, given: bool) -> dict[int, float]:
    """Take the block's words: R, Q, P and the bottom stay in force, the position of the hole is returned."""
    for letter in "RQ":
        value = block.take(letter)
        if value is not None:
            state.sticky[letter] = value * state.length_scale
    if block.has("P"):
        state.sticky["P"] = time_word(state, block, "P") or 0.0
    _words_of_one_control(state, block, code)
    words = point_words(state, block)
    wrong = (not words and given) or any(axis > 2 for axis in words)
    block.refuse_if(wrong, None, f"{code} without axis words, or with rotary axes", "X, Y, Z; A, B, C before it")
    if normal in words:
        state.sticky["Z"] = words.pop(normal)
    if state.dialect.name == "haas" and "R" not in state.sticky:  # Haas, mill operator's manual, G81: R is optional
        frames = state.frames
        state.sticky["R"] = frames.to_program(frames.position)[normal] if state.absolute else 0.0
        state.assume("a drilling cycle without R begins where the tool stands (Haas: R is optional)")
    _check_cycle(state, block, code, normal)
    return words


def _words_of_one_control(state: State, block: CurrentBlock, code: str) -> None:
    """Take words of single controls: I, J, K of Haas' pecks; words of taps and fine boring that change no cut."""
    haas = state.dialect.name == "haas"
    if code in PECKS and haas:
        _shallower_pecks(state, block)
    if code in TAPS and haas and block.take("J") is not None:
        state.note(block.line, block.values["J"], "how much faster the tap comes out")
    block.refuse_if(code in TAPS and state.sticky.get("Q"), "Q", "is a tap in pecks: controls differ", "no Q")
    for letter in "QIJ" if code == "G76" else "":
        block.take(letter)
        if letter in block.values:
            state.note(block.line, block.values[letter], "the shift off the wall before the rapid out")


def _shallower_pecks(state: State, block: CurrentBlock) -> None:
    """I: the first peck; J: the decrease of each further one; K: the smallest (Haas' manual, G83)."""
    given = [letter for letter in "IJK" if block.has(letter)]
    if not given:
        if "Q" in block.values:
            state.sticky |= dict.fromkeys("IJK", 0.0)
        return
    if "Q" in block.values or "I" not in given or ("J" in given and "K" not in given):
        raise block.fail(given[0], "beside Q, or without I or K", "Q, or I, J and K")
    for letter in "IJK":
        state.sticky[letter] = abs(block.take(letter) or 0.0) * state.length_scale
    state.sticky["Q"] = state.sticky["K"] or state.sticky["I"]


def _check_cycle(state: State, block: CurrentBlock, code: str, normal: int) -> None:
    for letter, what in (("Z", AXES[normal]), ("R", "R")):
        block.refuse_if(letter not in state.sticky, None, f"{code} without {what}", f"{what} in its first block")
    block.refuse_if(code in PECKS and not state.sticky.get("Q", 0.0) > 0.0, None, f"{code} without a peck", "Q above 0")
    if code in DWELLS:
        dwell = state.sticky.get("P")
        wrong = dwell is None or not 0.0 <= dwell <= SECONDS_PER_DAY
        block.refuse_if(wrong, None, f"{code} without its dwell", "P with the seconds, 0 or more")
    other = state.sticky.setdefault("unit", state.length_scale) != state.length_scale
    block.refuse_if(other, None, f"{code} after a change between G20 and G21", "G80 before it, and R and Z again")


def _heights(state: State, block: CurrentBlock, code: str, initial: float) -> tuple[float, float]:
    """R plane and bottom of the hole, in program coordinates."""
    retract = state.sticky["R"] if state.absolute else state.sticky["R"] + initial
    bottom = state.sticky["Z"] if state.absolute else retract + state.sticky["Z"]
    state.heights = (state.absolute, retract, bottom)
    if retract < bottom:
        raise block.fail(None, f"{code}: R at {retract:g} mm is below the bottom at {bottom:g} mm", "R above it")
    if state.retract is None:
        state.assume("a drilling cycle before any G98 or G99 ends at its R plane (G99), as LinuxCNC starts")
    return retract, bottom


def _check_pecks(state: State, block: CurrentBlock, code: str, depth: float, repeats: int) -> None:
    many = (depth / state.sticky["Q"] if code in PECKS else 1.0) * repeats > MOST_STROKES
    block.refuse_if(many, None, f"{code} with more than {MOST_STROKES} strokes", "a larger Q, or fewer repeats")


_MANUAL = f"{FANUC}, Canned cycle for drilling"
_RETURNS = {"G98": "cycles return to their level", "G99": "cycles return to R"}
DRILLING_CODES = (
    Code("G73", "motion", cycle, "chip-breaking drilling", g_codes("G73")),
    Code("G81", "motion", cycle, "drilling", g_codes("G81")),
    Code("G82", "motion", cycle, "drilling with dwell", g_codes("G82")),
    Code("G83", "motion", cycle, "peck drilling", g_codes("G83")),
    Code("G74", "motion", cycle, "left-hand tapping", f"{g_codes('G74')}; {_MANUAL}, G74"),
    Code("G84", "motion", cycle, "right-hand tapping", f"{g_codes('G84')}; {_MANUAL}, G84"),
    Code("G76", "motion", cycle, "fine boring, rapid out", f"{_MANUAL}, Fine boring cycle (G76)", ("fanuc", "haas")),
    Code("G86", "motion", cycle, "boring, spindle stop, rapid out", g_codes("G86")),
    Code("G85", "motion", cycle, "boring, feed out", g_codes("G85")),
    Code("G89", "motion", cycle, "boring with dwell, feed out", g_codes("G89")),
    *family(_RETURNS, "cycle return", return_level, g_codes("G98 G99")),
)
