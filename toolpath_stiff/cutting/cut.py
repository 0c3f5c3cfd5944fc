"""A cut along a program: engagement, forces, what gives way, and the error of the surface that is left."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.engagement import engage, headings
from toolpath_stiff.cutting.final_surface import final_strip, final_walls
from toolpath_stiff.cutting.forces import mean_force, peak_force
from toolpath_stiff.cutting.patches import Patches
from toolpath_stiff.cutting.setup import CutSetup, cutters_of, spindle_of, stock_of
from toolpath_stiff.cutting.stock import Stock
from toolpath_stiff.cutting.surface_error import floor_error, shares, wall_error
from toolpath_stiff.cutting.tip import machine_deviation, station_axes, tip_compliances
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.path.sampling import Samples, sample_moves
from toolpath_stiff.poses import Pose
from toolpath_stiff.stiffness.model import StiffnessModel

Progress = Callable[[int, int], None]
NOT_A_CUT = 0.0


@dataclass(frozen=True, repr=False, eq=False)
class Cut:
    """What is cut at n samples of a program, and the error of the surface that they leave. SI.

    Vectors are in the station's frame: x along the horizontal feed, y to its left, z up; forces act on the tool. Errors
    count out of the part: + material is left, - it is cut too deep. nan: there is no such thing at that sample.

    Attributes
    ----------
    samples
        In the set-up frame, row for row those of the analysis.
    cutters, stock
        By tool number; in the set-up frame.
    feed_per_tooth
        (n,) m.
    ap, ae, entry, exit, removed
        (n,) m, m, rad, rad, m3: depth along the tool, width across the feed, first and last angle in the stock (0 left,
        90 degrees ahead), volume removed since the sample before.
    mean_force, peak_force
        (n, 3) N of a turn.
    deflection
        (n, 3) m of tip and tool under the mean force.
    wall_heights
        (n, 2, 2) m above the tip: of the left and right wall that stays, lowest and highest point.
    wall_mean, wall_low, wall_high
        (n, 2) m, error of the left and right wall: mean over its height, smallest and largest.
    floor, floor_low, floor_high
        (n,) m, error of the floor, or of a ball's contact: mean over its width, smallest and largest.
    deviation
        (n, 3) m, standard deviation of left and right wall and floor, from the coefficients and the machine.
    assumptions, warnings
        Sentences.
    """

    samples: Samples
    cutters: Mapping[int, Cutter]
    stock: Stock
    feed_per_tooth: FloatArray
    ap: FloatArray
    ae: FloatArray
    entry: FloatArray
    exit: FloatArray
    removed: FloatArray
    mean_force: FloatArray
    peak_force: FloatArray
    deflection: FloatArray
    wall_heights: FloatArray
    wall_mean: FloatArray
    wall_low: FloatArray
    wall_high: FloatArray
    floor: FloatArray
    floor_low: FloatArray
    floor_high: FloatArray
    deviation: FloatArray
    assumptions: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def errors(self) -> FloatArray:
        """(n, 3) m: mean error of left wall, right wall, floor."""
        return np.concatenate([self.wall_mean, self.floor[:, None]], axis=1)

    @property
    def machine_only(self) -> bool:
        """Whether a tool's own compliance is not known, so that the errors are too small."""
        return any(np.isnan(cutter.lateral_compliance) for cutter in self.cutters.values())
