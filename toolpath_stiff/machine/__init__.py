"""Machines of six struts: their files here; model, kinematics with symmetry, and limits in the modules beside."""
