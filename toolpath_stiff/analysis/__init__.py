"""Analysis of a sampled path on a machine: loads, reach, stiffness, statistics."""
