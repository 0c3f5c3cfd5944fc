"""G40, G41, G42: cutter compensation by the tool's radius, as LinuxCNC or as Fanuc and Haas have it. mm."""

import math

from toolpath_stiff.nc.codes.center_path import settle, to_setup_of_program
from toolpath_stiff.nc.codes.code import Code, family, g_codes
from toolpath_stiff.nc.compensation import TYPE_A, RadiusCompensation
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State

LEFT, RIGHT = 1, -1
SIDES = {"G41": LEFT, "G41.1": LEFT, "G42": RIGHT, "G42.1": RIGHT}
# Codes allowed in a block while compensation is on: those that LinuxCNC allows and that leave the path defined.
GROUPS = {
    "motion", "cutter compensation", "distance", "arc distance", "feed mode", "spindle mode", "lathe diameter",
    "M spindle", "M coolant", "M subprogram",
}  # fmt: skip
MOTIONS = ("G0", "G1", "G2", "G3")


def switch_on(state: State, block: CurrentBlock, code: str) -> None:
    """G41, G42 D: the tool is left or right of the contour, by its diameter in the tool table; G41.1: by D itself."""
    word, frames = block.codes[code], state.frames
    straight = state.dialect.increments  # Fanuc, Haas
    _check_codes(state, block, ("plane", "units", "M tool change"))
    turned = frames.rotation or state.polar or frames.tip_held or state.plane == "G19"
    block.refuse_if(state.cutter is not None, word, "while cutter compensation is on", "G40 in a block before it")
    block.refuse_if(turned, word, "in G19, or under G68, G16 or G43.4", "G17, G69, G15, G49 first")
    block.refuse_if(straight and "D" not in block.values, word, "without D, whose last value would hold", "D")
    if straight and block.values["D"].value == 0:  # no offset: the programmed path is the tool centre's
        block.take("D")
        return
    diameter = _diameter(state, block, code)
    side = SIDES[code] if diameter >= 0.0 else -SIDES[code]
    state.cutter = RadiusCompensation(
        side, abs(diameter) / 2.0, PLANES[state.plane], state.length_scale, straight=straight
    )
    if straight:
        state.assume(TYPE_A)


def _diameter(state: State, block: CurrentBlock, code: str) -> float:
    """Diameter for G41, G42: D is a tool's number, in G41.1 and G42.1 the diameter itself."""
    word = block.codes[code]
    if code.endswith(".1"):
        diameter = block.take("D")
        if diameter is None:
            raise block.fail(word, "without the diameter", "D")
        return diameter * state.length_scale
    number = block.whole("D", word, 0)
    block.refuse_if(not number and state.renamed, word, "of the tool in the spindle after M61", f"D{state.tool}")
    tool = number or state.tool  # D0 means the tool in the spindle
    entry = (state.tools or {}).get(tool)
    if entry is None or math.isnan(entry.diameter):
        hint = "give it in a tool table (--tools FILE), or G41.1 D"
        state.fault(block.fail(word, f"needs the diameter of tool {tool}", hint=hint))
        return 0.0
    return entry.diameter


def switch_off(state: State, block: CurrentBlock, code: str) -> None:
    """G40: the next move goes from where the tool centre stands to its own end."""
    cutter, state.cutter, frames = state.cutter, None, state.frames
    if cutter is None or cutter.position is None:
        return
    block.refuse_if(cutter.entering, code, "right after the first move of cutter compensation", "a contour between")
    with block.placing():
        settle(state, cutter, cutter.center)
    there, here = to_setup_of_program(frames, cutter.position), frames.to_setup(frames.position)
    state.beside = [t - h for t, h in zip(there, here, strict=True)]


def check_block(state: State, block: CurrentBlock) -> None:
    """Refuse codes that change coordinates or the tool while compensation is on."""
    if state.cutter is not None:
        _check_codes(state, block, ())


def _check_codes(state: State, block: CurrentBlock, also: tuple[str, ...]) -> None:
    # A stop ends the move before it, without a corner.
    harmless = (state.plane, "G20" if state.inch else "G21", "G4", "M2", "M30", *MOTIONS)
    for group, name in block.groups.items():
        wrong = name not in harmless and (group == "motion" or group not in GROUPS | {*also})
        block.refuse_if(wrong, name, "while cutter compensation is on (G41, G42)", "G40 in a block before it")


_ON = {"G41": "cutter compensation, tool on the left", "G42": "cutter compensation, tool on the right"}
_DYNAMIC = {
    "G41.1": "cutter compensation by the diameter in D, on the left",
    "G42.1": "cutter compensation by the diameter in D, on the right",
}  # fmt: skip
_CUTTER = f"{g_codes('G41 G42')}; Fanuc, operator's manuals, Details of cutter compensation"
CUTTER_CODES = (
    Code("G40", "cutter compensation", switch_off, "cutter compensation off", g_codes("G40")),
    *family(_ON, "cutter compensation", switch_on, _CUTTER, ("linuxcnc", "fanuc", "haas")),
    *family(_DYNAMIC, "cutter compensation", switch_on, g_codes("G41.1 G42.1"), ("linuxcnc",)),
)
