"""Miscellaneous functions (M) of Heidenhain's controls, and statements that change no path.

HEIDENHAIN, user's manual of the iTNC 530, "Programming: miscellaneous functions".
"""

from toolpath_stiff.nc.codes.feeds import feed_mode
from toolpath_stiff.nc.codes.registry import CODES
from toolpath_stiff.nc.contouring.contour import go
from toolpath_stiff.nc.contouring.points import feed, present
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.heidenhain.coordinates import hold_tip
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES

# M functions that are those of the common table of codes.
SHARED = ("M0", "M1", "M2", "M3", "M4", "M5", "M7", "M8", "M9", "M13", "M14", "M19", "M30")
# Other M functions that leave the programmed path alone, and those that do not, with what they do.
PASSIVE = {
    name: what
    for what, names in {
        "tool change by hand: TOOL CALL is what counts": "M6",
        "how the control plans ahead: the path is taken as programmed": "M90 M112 M113 M120 M124 M132 M133 M134 M135",
        "replacement tools": "M101 M102 M107 M108",
        "feeds in plunging, on arcs, of rotary axes": "M103 M109 M110 M111 M116 M117 M131",
        "moves by the handwheel": "M118",
        "which axes tilt": "M138",
        "monitoring, data of the program, lift-off at a stop": "M141 M142 M145 M148 M149 M150",
    }.items()
    for name in names.split()
}
REFUSED = {
    "M94": "other numbers of the rotary axes", "M97": "small contour steps", "M98": "open contour corners",
    "M104": "the datum set last", "M114": "compensation for tilting axes", "M130": "points in the untilted system",
    "M136": "feed per revolution", "M143": "a basic rotation deleted", "M144": "compensation of the kinematics",
    "M197": "corner rounding",
}  # fmt: skip
RETRACT = (
    "M140 MB MAX retracts the tool to the end of its travel, which the program does not say: it is left out of the path"
)
OF_M = ("F", "LA", "T", "E", "P")  # parameters of M103, M120, M112, M124


def miscellaneous(state: State, block: CurrentBlock) -> None:
    """Carry out the M functions of a statement that act at its beginning, or leave the path alone."""
    for letter in [letter for letter in block.values if letter[0] == "M" and letter[1:].isdigit()]:
        word = block.values[letter]
        if letter in ("M89", "M91", "M92", "M99", "M140"):
            continue
        block.take(letter)
        block.refuse_if(
            letter in REFUSED and (letter not in ("M97", "M98") or state.cutter), word, f"is {REFUSED.get(letter)}"
        )
        if letter in ("M126", "M127"):
            state.plain.shorter = letter == "M126"
        elif letter in ("M128", "M129"):
            hold_tip(state, block, letter)
        elif letter == "M137":
            feed_mode(state, block, "G94")
        elif letter in SHARED:
            CODES[letter].act(state, block, letter)
            if CODES[letter].listed:
                state.note(block.line, word, CODES[letter].listed)
        elif letter in PASSIVE or letter in REFUSED:
            state.note(block.line, word, PASSIVE.get(letter) or REFUSED[letter])
            if letter in ("M103", "M112", "M118", "M120", "M124", "M101", "M138"):
                for other in (*OF_M, *(AXES if letter == "M118" else [f"{axis}!" for axis in AXES])):
                    block.take(other)
        else:
            state.note_unknown(block.line, word)


def retract(state: State, block: CurrentBlock) -> None:
    """M140 MB: away from the work along the tool, by a distance or to the end of the travel."""
    block.take("M140")
    axis = next((letter for letter in block.values if letter.lstrip("I") in AXES), None)
    block.refuse_if(axis, axis, "beside M140", "a statement of its own for it")
    feed_given, rapid = block.has("F"), feed(state, block)
    normal, distance = PLANES[state.plane][2], block.take("MB")
    leans = state.plain.tilt is None and any(state.frames.position[3:5])
    if distance is None:
        block.refuse_if(block.take("MBMAX") is None, "M140", "without its distance", "MB50 or MB MAX")
        state.warn_once(RETRACT, block.line)
        state.plain.unknown |= {0, 1, 2} if leans else {normal}
        return
    block.refuse_if(leans, "M140", "along a tool that leans", "X, Y and Z in an L statement")
    there = present(state)[normal] + distance * state.length_scale
    go(state, block, {normal: there}, rapid=rapid or not feed_given)


def dwell(state: State, block: CurrentBlock, code: str) -> None:
    """CYCL DEF 9.1, FUNCTION DWELL TIME: a pause in seconds."""
    state.pause(block, "", block.take("#"), f"{code} 1.5")


def units(state: State, block: CurrentBlock, code: str) -> None:
    """BEGIN PGM: mm or inch."""
    state.inch = block.take("INCH") is not None
    if state.inch:
        state.assume("F counts tenths of an inch a minute, in cycles too (inch programs of Heidenhain's controls)")


def nothing(state: State, block: CurrentBlock, code: str) -> None:
    """Do nothing: a heading or a label, or a statement that `run` carries out."""
    block.free.clear()


def listed(state: State, block: CurrentBlock, code: str) -> None:
    """List a statement that leaves the path alone, with its words."""
    block.free.clear()
    state.note(block.line, block.block.words[0], "leaves the path as it is")


def left_out(state: State, block: CurrentBlock, code: str) -> None:
    """Leave out a cycle without cuts, whose moves are the control's: after probing, the tool's position is unknown."""
    probes, shown = code.startswith("TCH"), block.block.words[0].text
    block.free.clear()
    what = "probing; where it sets the datum, that is program zero" if probes else "a cycle of the machine builder's"
    state.warnings.append(Remark(f"{shown} is left out of the path: {what}", block.line))
    if probes:
        state.plain.unknown |= {0, 1, 2}
