"""Moves to sampled poses: arc length, time, tangents, weights; rigid turns of the work."""

from toolpath_stiff.nc.curves import move_lengths
from toolpath_stiff.path.samples import Samples
from toolpath_stiff.path.sampling import sample_moves
from toolpath_stiff.path.turns import place, place_orientations

__all__ = ["Samples", "move_lengths", "place", "place_orientations", "sample_moves"]
