"""Circles of the plain language about a centre (CC): C, CP; poles, those of free contours (FPOL) too. mm, degrees.

HEIDENHAIN, user's manuals of the TNC 426, the iTNC 530 and the TNC 640, "Programming contours" ("Path contours:
Cartesian coordinates", "Polar coordinates").
"""

import math

from toolpath_stiff.nc.contouring.contour import arc_to, turn_of
from toolpath_stiff.nc.contouring.points import FREE_POLE, named, plane_of_pole, polar, present
from toolpath_stiff.nc.geometry import PLANES
from toolpath_stiff.nc.state import CurrentBlock, State


def pole(state: State, block: CurrentBlock, code: str) -> None:
    """CC, FPOL: circle centre, pole, perhaps in another plane than the tool's; without coordinates the present one."""
    point = named(state, block)
    plane = next((name for name, axes in PLANES.items() if point.keys() == {*axes[:2]}), None) if point else state.plane
    if plane is None:
        raise block.fail(code, "with other coordinates than two of a plane", "two of X, Y, Z, or none")
    first, second, _ = PLANES[plane]
    point = point or dict(enumerate(present(state)))
    state.plain.pole = FREE_POLE if code == FREE_POLE else plane, complex(point[first], point[second])


def circle(state: State, block: CurrentBlock, code: str) -> None:
    """C: about CC to a point; CP: about CC by or to a polar angle, with a height a helix."""
    step, turns = block.values.get("IPA"), 1
    block.refuse_if(code == "CP" and not block.has("PA") and step is None, code, "without an angle", "PA or IPA")
    block.refuse_if(block.has("PR") or block.has("IPR"), code, "with a radius", "the radius of its start")
    turn = turn_of(block, step.value if step else 0.0)
    if step is not None:
        block.refuse_if(step.value * turn <= 0.0, step, "is against the direction of rotation DR", "the same sign")
        turns = max(1, math.ceil(abs(step.value) / 360.0 - 1e-9))
    with plane_of_pole(state, block) as center:
        there = polar(state, block, center) if code == "CP" else named(state, block)
        arc_to(state, block, there, (center, turn, turns))
