"""The result of a run: moves, warnings, assumptions, the blank."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from toolpath_stiff.nc.codes.increments import point_warning
from toolpath_stiff.nc.languages import lathe_warning
from toolpath_stiff.nc.moves import Blank, Jump, ReadProgram, Remark
from toolpath_stiff.nc.request import ORIGIN_WINS, Request
from toolpath_stiff.nc.state import START, State
from toolpath_stiff.poses import pose_in_si
from toolpath_stiff.units import m_from_mm


def program_of(
    state: State, request: Request, lines: Sequence[str], jumps: Sequence[Jump], ending: Sequence[Remark]
) -> ReadProgram:
    """The program made of a run, with the warnings of its end; a posted one has moves of its own machine."""
    frames, warnings = state.frames, [*ending]
    if frames.source == "option" and (request.work_offsets.table[0].given or frames.offsets.table[0].given):
        warnings.append(ORIGIN_WINS)
    program = request.program(
        state,
        origin=pose_in_si(frames.origin),
        origin_source=frames.source,
        assumptions=(START, *state.assumptions),
        dialect=request.controller.label,
        jumps=tuple(jumps),
        stock=blank_of(state.plain.stock),
    )
    lathe, points = lathe_warning(state.turning, program.moves), point_warning(state, lines)
    return replace(program, warnings=(*warnings, *state.warnings, *lathe, *points))


def blank_of(stock: Mapping[str, Sequence[float]]) -> Blank | None:
    """Corners of the blank (BLK FORM) in m, if both are complete."""
    corners = [[m_from_mm(v) for v in corner] for corner in stock.values()]
    if len(corners) != 2 or any(map(math.isnan, [*corners[0], *corners[1]])):
        return None
    (a, b, c), (d, e, f) = corners
    return (a, b, c), (d, e, f)
