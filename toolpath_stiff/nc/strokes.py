"""Strokes of drilling cycles along the tool, as LinuxCNC expands them ("Canned cycles"; interp_cycles.cc). mm."""

from collections.abc import Iterator
from dataclasses import dataclass

from toolpath_stiff.nc.moves import CYCLE, RAPID

FEEDS_OUT = ("G89", "G84", "G74")
PECK_CLEARANCE_MM = 0.254  # G73, G83: how far above the last depth the rapid ends (0.010 in; LinuxCNC's default)
SAME_HEIGHT_MM = 1e-9  # a peck that ends at the bottom but for rounding is the last one
SHIFT = "the shift off the wall before the tool leaves the hole"  # of boring cycles: changes no cut
MOST_STROKES = 100_000  # in one block; more means a mistaken peck depth or number of repeats


@dataclass(frozen=True)
class Drilling:
    """One hole along the plane's normal: heights in mm, `dwell` in s."""

    code: str
    bottom: float
    retract: float  # the R plane
    clear: float  # where the cycle ends: the R plane (G99) or where it began (G98)
    peck: float
    dwell: float
    first: float = 0.0  # of the pecks that get shallower (Haas' I, J, K): the first, its reduction, the least
    less: float = 0.0
    least: float = 0.0
    out_at_r: bool = False  # a tap feeds out to R, and from there at rapid (Fanuc, Haas); else to `clear`


def strokes(hole: Drilling) -> Iterator[tuple[float, int, float]]:
    """Moves of one hole along the normal, from the R plane: the height to reach, RAPID or CYCLE, the dwell there.

    Examples
    --------
    >>> hole = Drilling("G83", bottom=-5.0, retract=2.0, clear=10.0, peck=4.0, dwell=0.0)
    >>> [(height, "feed" if motion == CYCLE else "rapid") for height, motion, dwell in strokes(hole)]
    [(-2.0, 'feed'), (2.0, 'rapid'), (-1.746, 'rapid'), (-5.0, 'feed'), (10.0, 'rapid')]
    """
    if hole.code in ("G73", "G83"):  # G73 breaks the chip at depth, G83 clears it at the R plane
        for depth in _depths(hole):
            yield depth, CYCLE, 0.0
            if hole.code == "G83":
                yield hole.retract, RAPID, 0.0
            yield depth + PECK_CLEARANCE_MM, RAPID, 0.0
    yield hole.bottom, CYCLE, 0.0 if hole.code in ("G81", "G73", "G83", "G85") else hole.dwell
    if hole.code == "G85" or hole.out_at_r:  # out to the R plane at feed, from there at rapid
        yield hole.retract, CYCLE, 0.0
    yield hole.clear, CYCLE if hole.code in FEEDS_OUT and not hole.out_at_r else RAPID, 0.0


def _depths(hole: Drilling) -> Iterator[float]:
    """Heights of the pecks above the bottom."""
    count, depth = 1, hole.retract - (hole.first or hole.peck)
    while depth > hole.bottom + SAME_HEIGHT_MM:
        yield depth
        if hole.first:
            depth -= max(hole.first - count * hole.less, hole.least)
        else:
            depth = hole.retract - (count + 1) * hole.peck
        count += 1
