"""Contact of a cutter with the stock: rectangles on its envelope, height above the tip over the angle of the edge."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, FloatArray, IntArray, numbered
from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cutters import Cutter

BLOCK, ROUND_BLOCK = 2048, 128  # stations computed at once: their arrays stay in the processor's cache
LEAST_LAG = 1e-3  # rad/m: straight flutes lag by this, some microradians over a cut, which avoids a division by 0
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Patches(ArrayColumns):
    """Rectangles of contact on the envelopes of the cutters at n stations.

    Angles count clockwise seen from above, from the left of the feed (90 degrees ahead, 180 right), however the
    spindle turns.

    Attributes
    ----------
    station
        (p,) the station that each belongs to, ascending.
    low, high
        (p,) m above the tip.
    entry, exit
        (p,) rad, 0 <= entry < exit <= 2 pi: an arc across the left of the feed is two rows.
    """

    station: IntArray
    low: FloatArray
    high: FloatArray
    entry: FloatArray
    exit: FloatArray


def of_stations(patches: Patches, stations: IntArray) -> Patches:
    """Patches of stations (n,), renumbered by their place in `stations`; a station may occur more than once."""
    first, last = (np.searchsorted(patches.station, stations, side) for side in ("left", "right"))
    station, place = numbered(last - first)
    return replace(patches.take(first[station] + place), station=station)


@dataclass(frozen=True)
class Contact(ArrayColumns):
    """The cut of one cutter at n stations: its contact with the stock, feed, direction of rotation, coefficients.

    Attributes
    ----------
    patches
        Counted among these stations.
    cutter, coefficients
        Of all of them.
    feed
        (n, 2) m per tooth: along x and along z, up positive.
    turning
        (n,) 1 where the spindle turns clockwise (M3), -1 (M4).
    """

    patches: Patches
    cutter: Cutter
    coefficients: Coefficients
    feed: FloatArray
    turning: FloatArray

    @property
    def lag(self) -> FloatArray:
        """(n,) rad/m by which a flute lags per height above the tip, counted clockwise; negative: it leads."""
        angle = float(np.tan(self.cutter.helix)) / self.cutter.radius
        return self.cutter.hand * max(angle, LEAST_LAG) * self.turning

    def of(self, rows: IntArray) -> "Contact":
        """The contact of the stations `rows`, renumbered."""
        return replace(self.take(rows), patches=of_stations(self.patches, rows))

    def blocks(self) -> Iterator[tuple[slice, "Contact"]]:
        """Slices of stations, with their contact."""
        size, count = ROUND_BLOCK if self.cutter.corner_radius else BLOCK, len(self.feed)
        for start in range(0, count, size):
            yield slice(start, start + size), self.of(np.arange(start, min(start + size, count)))

    def seen_clockwise(self) -> "Contact":
        """The contact without stations of a stopped spindle, counter-clockwise ones mirrored across the feed."""
        patches = self.patches.take(self.feed[self.patches.station, 0] > 0.0)
        other = self.turning[patches.station] < 0.0
        if other.any():
            width = patches.exit - patches.entry
            entry = np.where(other, (np.pi - patches.exit) % TURN, patches.entry)
            leave = entry + width
            across = leave > TURN + 1e-12
            first = replace(patches, entry=entry, exit=np.minimum(leave, TURN))
            rest = replace(patches, entry=np.zeros_like(entry), exit=leave - TURN).take(across)
            patches = Patches.joined([first, rest])
            patches = patches.take(np.argsort(patches.station, kind="stable"))
        return replace(self, patches=patches)

    def above(self, height: float) -> Patches:
        """Patches above a height (m): those on the cylinder."""
        return replace(self.patches, low=np.maximum(self.patches.low, height)).take(self.patches.high > height)

    def below(self, height: float) -> Patches:
        """Patches below a height (m): those on the corner."""
        return replace(self.patches, high=np.minimum(self.patches.high, height)).take(self.patches.low < height)
