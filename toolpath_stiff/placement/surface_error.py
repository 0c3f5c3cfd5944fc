"""Error of final walls at other placements: the forces stay, the machine's compliance changes."""

from collections.abc import Callable

import numpy as np

from toolpath_stiff.arrays import FloatArray, product
from toolpath_stiff.cutting.cut import Cut
from toolpath_stiff.cutting.tip import station_axes, tip_compliances
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.poses import Pose
from toolpath_stiff.stiffness.model import StiffnessModel

STATIONS = 200  # stations on all final walls, evenly spaced
SHARE = 0.95  # share of the walls' length whose largest error counts

Errors = Callable[[FloatArray], FloatArray]  # placements (k, 6) to errors (k,) m, inf where there are none


def errors_of_walls(model: StiffnessModel, cut: Cut, present: Pose, name: str) -> Errors:
    """Function from placements (k, 6) to the error (k,) m that 95 % of the final walls' length stay below.

    `cut` is the program's at the present placement. Engagement and cutting forces belong to the program; of the error
    what the machine gives way, across the wall under the force at the wall's moment, is that of the placement.
    Raises `ProgramError` where no pass makes a final wall.
    """
    rows, side = np.nonzero(np.isfinite(cut.wall_mean) & np.isfinite(cut.wall_force[..., 1]))
    if not len(rows):
        raise ProgramError("no pass makes a wall of the finished part", file=name)
    along = np.cumsum(cut.samples.weight[rows])
    chosen = np.unique(np.searchsorted(along, (np.arange(STATIONS) + 0.5) / STATIONS * along[-1]))
    rows, side = rows[chosen], side[chosen]
    samples, force, outward = cut.samples.take(rows), cut.wall_force[rows, side], 2.0 * side - 1.0

    def of_machine(placement: FloatArray) -> FloatArray:
        compliance = tip_compliances(model, samples, placement, station_axes(samples, placement), force)
        return np.asarray(outward * product(compliance[:, 1, None], force[:, :, None])[:, 0, 0])

    rest = cut.wall_mean[rows, side] - of_machine(np.array(present))

    def errors(placements: FloatArray) -> FloatArray:
        sizes = [np.abs(rest + of_machine(placement)) for placement in placements]
        return np.array([np.quantile(size, SHARE) if np.isfinite(size).all() else np.inf for size in sizes])

    return errors
