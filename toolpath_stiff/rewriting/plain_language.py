"""A program in Heidenhain's or Siemens' language written for another placement, by a frame before its first move.

The frame shifts, and turns about the tool axis Z: cycles 7 and 10, or TRANS and AROT; the program's own text stays. It
is read again, and refused where its path is not the placed one: it may set such frames itself, or take coordinates
from where the tool stands at the start.
"""

import math
import re
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.heidenhain.plain_statements import in_inches
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.moves import RAPID, Moves, ReadProgram
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.reader import read
from toolpath_stiff.nc.request import Request
from toolpath_stiff.rewriting.controls import DECIMALS_INCH, DECIMALS_MM
from toolpath_stiff.rewriting.turn import Turn
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import MM_PER_INCH, mm_from_m

FRAMES = {
    "heidenhain": ("CYCL DEF 7.0 SHIFT", "CYCL DEF 7.1 X{}", "CYCL DEF 7.2 Y{}", "CYCL DEF 7.3 Z{}",
                   "CYCL DEF 10.0 ROTATION", "CYCL DEF 10.1 ROT{}"),
    "siemens": ("TRANS X{} Y{} Z{}", "AROT RPL={}"),
}  # fmt: skip
TURN_BEGINS = re.compile(r"CYCL DEF 10|AROT")
INCH = re.compile(r"\bG70{1,2}\b")
ROUNDINGS = 2.0  # of the angle at the path's farthest point, of the shift
LEANS = 1e-5  # rad
HINT = "place it without --write, and set the datum or offset that is printed"


def write_placed(program: ReadProgram, text: str, turn: Turn, decimals: int | None, control: Controller) -> str:
    """Text of the program at its new place, read again to check it. Raises `InputError` where no frame can do it."""
    lines, moves, name = split_lines(text, program.name), program.moves, program.name
    inch = INCH.search(text) if program.dialect == "siemens" else in_inches(lines)
    unit, usual = (MM_PER_INCH, DECIMALS_INCH) if inch else (1.0, DECIMALS_MM)
    decimals = usual if decimals is None else decimals
    if turn.turn[2, 2] != 1.0:
        raise Place(name, 1).fail("a placement that tilts the work", "a turn about the tool axis Z", HINT)
    angle = math.degrees(math.atan2(turn.turn[1, 0], turn.turn[0, 0]))
    numbers = [f"{v:+.{decimals}f}" for v in (*(s / unit for s in turn.shift.tolist()), angle)]
    frame, first = "\n".join(FRAMES[program.dialect]).format(*numbers), int(moves.line[0]) - 1
    added = [line for line in frame.split("\n") if turn.turns or not TURN_BEGINS.match(line)]
    placed = [*lines[:first], *added, *lines[first:]]
    control = replace(control, dialect=DIALECTS[program.dialect])
    try:
        again = read(Request(tuple(placed), name, controller=control)).moves
    except InputError as error:
        shift = len(added) if error.line is not None and error.line > first + len(added) else 0
        place = Place(name, max(1, min((error.line or 1) - shift, len(lines))))
        raise place.fail(f"a frame before the program's first move: {error.found}", error.expected, HINT) from None
    reach = float(np.abs(moves.end[:, :3]).max()) * 1e3
    largest = ROUNDINGS * 10.0**-decimals * (unit + math.radians(reach))
    wrong = _differs(moves, again, turn, largest)
    if len(wrong):
        problem = "the frame written before the first move does not place this line"
        raise Place(name, int(moves.line[wrong[0]])).fail(problem, hint=HINT)
    return ("\r\n" if "\r\n" in text else "\n").join([*placed, ""])


def _differs(moves: Moves, again: Moves, turn: Turn, largest_mm: float) -> IntArray:
    """Rows of the cuts that end away from the placed point, or with another tool axis."""
    if len(again) != len(moves):  # a turned tool axis may take other parts to a move
        again, moves = (m.take(np.append(np.diff(m.line) != 0, True)) for m in (again, moves))
    if not np.array_equal(again.motion, moves.motion):
        return np.zeros(1, dtype=int)
    ends = np.array([turn.point(mm_from_m(end[:3]).tolist()) for end in moves.end])
    off = np.abs(mm_from_m(again.end[:, :3]) - ends).max(axis=1)
    axis, wanted = (rotation_matrices(m.end[:, 3:])[:, :, 2] for m in (again, moves))
    leans = np.abs(axis - wanted @ turn.turn.T).max(axis=1)
    return np.flatnonzero((moves.motion != RAPID) & ((off > largest_mm) | (leans > LEANS)))
