"""Moves to sampled poses: arc length, time, tangents, weights; rigid turns of the work."""
