"""Machines of six struts: files, model, kinematics with symmetry, limits."""
