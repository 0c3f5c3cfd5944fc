"""Where a cutter touches the stock: rectangles on its envelope, height above the tip over the angle of the edge."""

from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, FloatArray, IntArray


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
    """The patches of some stations (n,), counted among these; a station may come more than once."""
    first, last = (np.searchsorted(patches.station, stations, side) for side in ("left", "right"))
    station = np.repeat(np.arange(len(stations)), last - first)
    rows = np.arange(len(station)) + np.repeat(last - np.cumsum(last - first), last - first)
    return replace(patches.take(rows), station=station)
