"""The tool table and the parameter file that `rs274` gets. Lengths of both are inches to it, whatever G21 says."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from toolpath_stiff.nc.linuxcnc.copy import Line
from toolpath_stiff.nc.tables import FIRST_OFFSET, HOME_G28, HOME_G30, OFFSET_STRIDE, ROTATION, Offsets, ToolEntry
from toolpath_stiff.units import MM_PER_INCH

# LinuxCNC's manual, "Parameters": the persistent ones must all be there, in order.
G92_ENABLED, G92_FIRST, ACTIVE_SYSTEM = 5210, 5211, 5220
MOST_TOOLS = 900  # of the 1000 pockets that LinuxCNC has
UNKNOWN_LENGTH_MM = -1e5  # stands for a length that the table does not give; a move with it is refused
TOOL_WORDS = re.compile(r"[THD]0*(\d+)(?![\d.])")
COMPUTED_TOOL = re.compile(r"[THD](?:[#\[]|[A-Z]{2})")


def parameter_file(offsets: Offsets, shift: tuple[float, float, float] = (0.0, 0.0, 0.0), active: int = 0) -> str:
    """Text of the parameter file: offsets and reference points (mm, degrees), all offsets moved by `shift` (mm)."""
    values: dict[int, float] = {G92_ENABLED: 0.0, ACTIVE_SYSTEM: active + 1.0}
    values |= {G92_FIRST + place: 0.0 for place in range(9)}
    for first, home in ((HOME_G28, offsets.home_g28), (HOME_G30, offsets.home_g30)):
        values |= {first + place: 0.0 for place in range(9)}
        values |= {first + place: _inches(value, place) for place, value in enumerate(home)}
    for index, offset in enumerate(offsets.table):
        first = FIRST_OFFSET + OFFSET_STRIDE * index
        values |= {first + place: 0.0 for place in range(ROTATION)}
        axes = [a + s for a, s in zip(offset.axes, (*shift, 0.0, 0.0, 0.0), strict=True)]
        values |= {first + place: _inches(value, place) for place, value in enumerate(axes)}
        values[first + ROTATION] = offset.rotation
    return "".join(f"{number}\t{values[number]:.9f}\n" for number in sorted(values))


def _inches(value: float, place: int) -> float:
    return value / MM_PER_INCH if place < 3 else value


def first_offset(text: str) -> tuple[list[float], float]:
    """G54 of a parameter file that rs274 wrote: six axes in mm and degrees, and the rotation."""
    found = {int(number): float(value) for number, value in re.findall(r"^(\d+)\s+(\S+)", text, re.MULTILINE)}
    axes = [found.get(FIRST_OFFSET + place, 0.0) * (MM_PER_INCH if place < 3 else 1.0) for place in range(6)]
    return axes, found.get(FIRST_OFFSET + ROTATION, 0.0)


def tool_numbers(tools: dict[int, ToolEntry] | None, lines: Iterable[Line]) -> list[int]:
    """The tools known and those that the program names, in the order of `tool_file`: rs274 prints places in it."""
    numbers = set(tools or {})
    for line in lines:
        numbers |= {int(found) for found in TOOL_WORDS.findall(line.plain)}
        if COMPUTED_TOOL.search(line.words):
            numbers |= set(range(1, 100))
    return sorted(numbers - {0})[:MOST_TOOLS]


def tool_file(numbers: Iterable[int], tools: dict[int, ToolEntry] | None) -> str:
    """Text of the tool table for these tools; a T word without an entry is an error in rs274."""
    rows = []
    for pocket, number in enumerate(numbers, 1):
        tool = (tools or {}).get(number, ToolEntry(number))
        length = UNKNOWN_LENGTH_MM if math.isnan(tool.length) else tool.length
        diameter = 0.0 if math.isnan(tool.diameter) else tool.diameter
        rows.append(f"T{number} P{pocket} Z{length / MM_PER_INCH:.9f} D{diameter / MM_PER_INCH:.9f} ;\n")
    return "".join(rows)
