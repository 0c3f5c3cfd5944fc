"""Where a cutter touches the stock: rectangles on its envelope, height above the tip over the angle of the edge."""

from dataclasses import dataclass

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
