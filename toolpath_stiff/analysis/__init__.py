"""A sampled path on a machine: loads, reach, stiffness, statistics."""
