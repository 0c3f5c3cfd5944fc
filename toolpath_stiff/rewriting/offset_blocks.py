"""A placement as offsets to key in at the control.

`offset_blocks` returns LinuxCNC's `G10 L2` and, for Fanuc-style controls, G54 with G68. Both turn X and Y alone, about
the vertical. So they express a placement of vertical tools in an untilted set-up, and nothing else; for the rest the
program itself has to be rewritten.
"""

import re
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.controller import LANGUAGES
from toolpath_stiff.nc.moves import CUTTER_LOCATION, ReadProgram
from toolpath_stiff.nc.tables import ADDITIONAL_OFFSETS, WORK_OFFSETS
from toolpath_stiff.poses import Pose
from toolpath_stiff.units import deg_from_rad, mm_from_m

OTHER_OFFSETS = (*WORK_OFFSETS[1:], *ADDITIONAL_OFFSETS)
G_WORD, COMMENTS = re.compile(r"[Gg]\+?(0*1\d{1,2}|0*5\d(?:\.\d)?)"), re.compile(r"\([^)]*\)|;.*")
VERTICAL = 1e-9  # rad, and of a unit vector: what is left of a zero after conversions
NOT_POSTED = "a cutter-location file has no work offsets: place the program that is posted from it"
PRESET = (
    "Heidenhain's and Siemens' controls have no such blocks: set the preset or G54 (and its rotation) to the placement"
)
USE_WRITE = "use --write, which transforms the program itself"


@dataclass(frozen=True)
class OffsetBlocks:
    """Blocks to key in, each "" where that control cannot express the placement, with the reason beside it."""

    linuxcnc: str
    fanuc: str
    linuxcnc_reason: str = ""
    fanuc_reason: str = ""


def offset_blocks(program: ReadProgram, placement: Pose, *, decimals: int = 4) -> OffsetBlocks:
    r"""Offset blocks that put a program at a placement.

    Parameters
    ----------
    program
        The program; its own G10 and its work offsets decide whether a G54 of the operator's suffices.
    placement
        x, y, z in m, A, B, C in rad: where program zero shall sit, as `--origin` takes it.
    decimals
        Of the numbers, in mm and degrees.

    Notes
    -----
    `G10 L2 P1 R` turns X and Y about G54's zero (LinuxCNC manual, "G10 L2"); it goes before the first motion. `G68 X0
    Y0 R` turns the G17 plane about program zero (Fanuc's manuals, "Coordinate system rotation"); it goes after G54 and
    G17, and holds until G69. The numbers of G54 are millimetres.

    Examples
    --------
    >>> from math import pi
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> program = parse_program("G21 G90 F600\nG1 X40\nM30\n", "slot.nc")
    >>> blocks = offset_blocks(program, (0.1, 0.0, 0.8, 0.0, 0.0, pi / 2))
    >>> blocks.linuxcnc
    'G21 G10 L2 P1 X100 Y0 Z800 R90'
    >>> print(blocks.fanuc)
    G54: X100 Y0 Z800
    G17 G54 G68 X0 Y0 R90
    """
    posted = (
        f"the program is posted for another kinematics ({program.kinematics}), whose control its G54 belongs to: "
        "post it for this machine"
    )
    reason = NOT_POSTED if program.dialect == CUTTER_LOCATION else posted if program.kinematics else ""
    reason = reason or (PRESET if program.dialect in LANGUAGES else "")
    reason = reason or _not_about_z(program, placement) or _not_g54_alone(program)
    if reason:
        return OffsetBlocks("", "", reason, reason)
    x, y, z = (_number(mm_from_m(v), decimals) for v in placement[:3])
    turn = _number(deg_from_rad(placement[5]), decimals)
    linuxcnc, g54 = f"G21 G10 L2 P1 X{x} Y{y} Z{z} R{turn}", f"G54: X{x} Y{y} Z{z}"
    if turn == "0":
        return OffsetBlocks(linuxcnc, g54)
    if np.abs(program.moves.arc_normal[:, :2]).max(initial=0.0) >= VERTICAL:
        return OffsetBlocks(linuxcnc, "", "", f"G68 does not turn arcs of G18 and G19: {USE_WRITE}")
    return OffsetBlocks(linuxcnc, f"{g54}\nG17 G54 G68 X0 Y0 R{turn}")


def _not_about_z(program: ReadProgram, placement: Pose) -> str:
    """The reason why a turn of X and Y cannot express the placement, or ""."""
    if max(abs(placement[3]), abs(placement[4])) > VERTICAL:
        return f"the set-up is tilted, and work offsets turn X and Y alone: {USE_WRITE}"
    tilted = np.flatnonzero(np.hstack([program.moves.start[:, 3:], program.moves.end[:, 3:]]).any(axis=1))
    if placement[5] and len(tilted):
        line = program.moves.line[tilted[0]]
        return f"the tool is tilted (line {line}), and work offsets turn X and Y, not its axis: {USE_WRITE}"
    return ""


def _not_g54_alone(program: ReadProgram) -> str:
    """The reason why setting G54 would not move the whole program, or ""."""
    for number, text in enumerate(program.source, 1):
        for digits in G_WORD.findall("".join(COMMENTS.sub("", text).split())):
            code = code_name("G", float(digits))
            if code == "G10":
                return f"the program sets offsets itself (G10, line {number}): {USE_WRITE}"
            if code in OTHER_OFFSETS:
                return f"the program uses {code} beside G54 (line {number}), which would stay where it is: {USE_WRITE}"
    return ""


def _number(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".") if decimals else f"{value:.0f}"
    return "0" if text in ("-0", "") else text
