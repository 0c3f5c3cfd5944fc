"""Contours drawn beside the run of a program, for cycles that mill along them, and paths of the tool beside these. mm.

A contour is a chain of elements in the plane.
"""

import cmath
import math
from contextlib import suppress

from toolpath_stiff.nc.compensation import RadiusCompensation
from toolpath_stiff.nc.contouring.contour import mill
from toolpath_stiff.nc.elements import Contour, cut_off, swept
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.geometry import PLANES, GeometryError
from toolpath_stiff.nc.pockets import LEAST_MM
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import Offsets

CLOSED_MM = 0.016  # between start and end: as far as an arc's end may lie off its circle


def drawing(state: State) -> State:
    """A state in which statements draw a contour, in program axes: it has to say where it begins."""
    drawn = State(state.name, frames=Frames(Offsets(), None, (0.0,) * 6), dialect=state.dialect, feed=1.0, trace=[])
    drawn.plane, drawn.inch, drawn.motion = state.plane, state.inch, "G1"
    for axis in PLANES[state.plane][:2]:
        drawn.frames.position[axis] = math.nan
    return drawn


def elements_of(drawn: State, block: CurrentBlock, what: str) -> Contour:
    """Contour elements from the trace of moves that its blocks made; the first goes to where the contour begins.

    `what` goes along it, for errors.
    """
    first, second, normal = PLANES[drawn.plane]
    contour, trace = Contour(), drawn.trace or []
    for move in trace[1:]:
        begins, ends = (complex(point[first], point[second]) for point in (move.start, move.end))
        unsaid = f"{what} along a contour that does not say where it begins"
        block.refuse_if(cmath.isnan(begins), None, unsaid, "both coordinates")
        level = abs(move.end[normal] - move.start[normal]) < LEAST_MM
        block.refuse_if(not level, None, f"{what} along a contour that leaves its plane", "moves in the plane")
        if move.arc is not None:
            turn = 1 if move.arc.sweep * move.arc.normal[normal] > 0.0 else -1
            contour.append((begins, ends, complex(move.arc.center[first], move.arc.center[second]), turn))
        elif abs(ends - begins) > LEAST_MM:
            contour.append((begins, ends, None, 0))
    arc = not contour or trace[0].arc is not None
    block.refuse_if(arc, None, f"{what} along no contour", "a straight move to its start, and its elements")
    return contour


def is_closed(contour: Contour) -> bool:
    """True if a contour ends where it begins."""
    return abs(contour[-1][1] - contour[0][0]) < CLOSED_MM


def backward(contour: Contour) -> Contour:
    """The contour from its end to its start."""
    return [(end, start, center, -turn) for start, end, center, turn in reversed(contour)]


def path_beside(state: State, block: CurrentBlock, contour: Contour, left: float, rounding: float = 0.0) -> Contour:
    """Path of the tool's centre at a distance to the left of a contour: cutter compensation as in RL, RR.

    Of a closed contour from the middle of its first element and to it. `rounding`: radius of the path itself in inside
    corners, where there is room. Raises `GeometryError` where the tool does not fit.
    """
    if is_closed(contour):
        (start, end, center, turn), last = contour[0], contour[-1][1]
        middle = (start + end) / 2.0
        if center is not None:
            middle = center + (start - center) * cmath.rect(1.0, swept(contour[0]) / 2.0)
        contour = [(middle, end, center, turn), *contour[1:], (last, middle, center, turn)]
    drawn, (first, second, _) = drawing(state), PLANES[state.plane]
    start, side = contour[0][0], 1 if left > 0.0 else -1
    drawn.frames.position[first], drawn.frames.position[second] = start.real + 1.0, start.imag
    drawn.cutter = RadiusCompensation(side, abs(left), PLANES[state.plane], 1.0, straight=True, rounded=True)
    mill(drawn, block, [(start, 0.0, 1.0, None, 0), *((end, 0.0, 1.0, about, way) for _, end, about, way in contour)])
    drawn.trace, path = drawn.recorder.recent, Contour()
    for element in elements_of(drawn, block, "a cycle"):
        path.append(element)
        with suppress(GeometryError):
            if rounding and len(path) > 1 and (cut := cut_off(path[-2], element, rounding, rounded=True)):
                path[-2:] = [(path[-2][0], cut[0], *path[-2][2:]), cut, (cut[1], *element[1:])]
    return path
