"""Canned drilling cycles, expanded to their moves as LinuxCNC does (manual, "Canned cycles"; interp_cycles.cc). mm."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

PECK_CLEARANCE_MM = 0.254  # G73, G83: how far above the last depth the rapid ends (0.010 in; LinuxCNC's default)

SAME_HEIGHT_MM = 1e-9  # a peck that ends at the bottom but for rounding is the last one


@dataclass(frozen=True)
class Drilling:
    """One hole along the plane's normal: heights in mm, `dwell` in s."""

    code: str
    bottom: float
    retract: float  # the R plane
    clear: float  # where the cycle ends: the R plane (G99) or where it began (G98)
    peck: float
    dwell: float


@dataclass(frozen=True)
class Stroke:
    """One move along the normal: to which height, at feed or rapid, how long to wait there in s."""

    height: float
    feed: bool
    dwell: float = 0.0


def strokes(hole: Drilling) -> Iterator[Stroke]:
    """Moves of one hole, from the R plane."""
    if hole.code in ("G73", "G83"):
        yield from _pecks(hole)
    dwell = hole.dwell if hole.code in ("G82", "G89") else 0.0
    yield Stroke(hole.bottom, feed=True, dwell=dwell)
    if hole.code == "G85":  # out to the R plane at feed, from there at rapid
        yield Stroke(hole.retract, feed=True)
    yield Stroke(hole.clear, feed=hole.code == "G89")


def _pecks(hole: Drilling) -> Iterator[Stroke]:
    """The pecks above the bottom. G73 breaks the chip at depth, G83 clears it at the R plane."""
    count = 1
    while hole.retract - count * hole.peck > hole.bottom + SAME_HEIGHT_MM:
        depth = hole.retract - count * hole.peck
        yield Stroke(depth, feed=True)
        if hole.code == "G83":
            yield Stroke(hole.retract, feed=False)
        yield Stroke(depth + PECK_CLEARANCE_MM, feed=False)
        count += 1
