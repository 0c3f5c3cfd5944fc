"""What a block of the program does, and whether the written block does the same at its place. mm, degrees."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.nc.recorder import Arc, Recorder
from toolpath_stiff.path.rotations import rotation_matrices
from toolpath_stiff.rewriting.turn import Turn, angle_between

# In units of the last decimal written. Ends: half a unit per axis, three axes, and the same of the start; a centre
# given by I, J, K adds that of its own words, one given by R what `blocks.NEAR` allows.
END_UNITS, CENTER_UNITS = 2.0, 6.0
SHORTEST_UNITS = 4.0


class Row(NamedTuple):
    """A recorded cutting move: ends (6), arc."""

    start: list[float]
    end: list[float]
    arc: Arc | None


def cutting_rows(recorder: Recorder, first: int) -> list[Row]:
    """Cutting moves recorded from `first` on."""
    return [
        Row(recorder.start[i], recorder.end[i], recorder.arc[i])
        for i in range(first, len(recorder.line))
        if recorder.motion[i] != RAPID
    ]


def differences(turn: Turn, wanted: list[Row], found: list[Row], unit: float) -> str:
    """How the written cutting moves of a block differ from the placed ones beyond the rounding to `unit` mm, or "".

    Straight moves of a few units may vanish by rounding, or come to be.
    """
    left, right = list(wanted), list(found)
    while left and right:
        what = difference(turn, left[0], right[0], unit)
        if not what:
            del left[0], right[0]
        elif _short(left[0], unit):
            del left[0]
        elif _short(right[0], unit):
            del right[0]
        else:
            return what
    if all(_short(row, unit) for row in (*left, *right)):
        return ""
    return f"would be {len(found)} moves and not {len(wanted)}"


def _short(row: Row, unit: float) -> bool:
    return row.arc is None and max(abs(e - s) for s, e in zip(row.start, row.end, strict=True)) < SHORTEST_UNITS * unit


def difference(turn: Turn, wanted: Row, found: Row, unit: float) -> str:
    """How a written cutting move differs from the placed one beyond the rounding to `unit` mm, or "".

    For the steps of one word, as those of a cycle with L in G91, `unit` is that of all of them.
    """
    ends = ((wanted.start, found.start, "starts"), (wanted.end, found.end, "ends"))
    for placed, written, name in ends:
        target, point = turn.point(placed[:3]), written[:3]
        apart = math.dist(target, point)
        if apart > END_UNITS * unit:
            return f"{name} {apart:.4g} mm off"
    for placed, written, _ in ends:
        if placed[3:] == written[3:] and turn.keeps(placed[3:]):
            continue
        goal = turn.rotations(np.array([placed[3:]]))[0]
        angle = angle_between(goal, rotation_matrices(np.radians(written[3:])))
        if angle > END_UNITS * unit:
            return f"leans {angle:.4g} degrees otherwise"
    if wanted.arc is None or found.arc is None:
        return "" if wanted.arc is found.arc else "is another kind of move"
    return _arc_difference(turn, wanted.arc, found, unit)


def _arc_difference(turn: Turn, arc: Arc, found: Row, unit: float) -> str:
    assert found.arc is not None
    normal = turn.turn @ np.array(arc.normal)
    sense = float(normal @ np.array(found.arc.normal))
    if abs(abs(sense) - 1.0) > 1e-9:
        return "lies in another plane"
    apart = np.array(turn.point(arc.center)) - np.array(found.arc.center)
    off = float(np.linalg.norm(apart - (apart @ normal) * normal))
    if off > CENTER_UNITS * unit:
        return f"has its centre {off:.4g} mm off"
    radius = math.dist(found.start[:3], found.arc.center)
    swept = abs(arc.sweep - math.copysign(1.0, sense) * found.arc.sweep)
    if swept * radius > 4.0 * CENTER_UNITS * unit:
        return f"turns {math.degrees(swept):.4g} degrees otherwise"
    return ""
