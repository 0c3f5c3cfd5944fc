"""Machines of every kind: files, models, kinematics, limits."""
