"""Blind simulator of a measuring campaign on a machine that hides something.

It judges the model and therefore shares no code with it but units, errors and files: its own machine reader, its own
kinematics, its own mechanics (assembled elements, displacement method).

>>> rows, truth = make_case(seed=7, layout="paper", hidden="weak_strut")
>>> truth["hidden"], len(rows["stiffness_N_per_mm"])
(['weak_strut'], 42)
"""

from toolpath_stiff.rig.case import Case, draw_case, effects_of_layout, make_case
from toolpath_stiff.rig.effects import CATALOGUE
from toolpath_stiff.rig.exercise import csv_text, measure_again, new_exercise, reveal
from toolpath_stiff.rig.hidden import OUTSIDE, Nuisances
from toolpath_stiff.rig.unknowns import UNKNOWNS

__all__ = [
    "CATALOGUE",
    "OUTSIDE",
    "UNKNOWNS",
    "Case",
    "Nuisances",
    "csv_text",
    "draw_case",
    "effects_of_layout",
    "make_case",
    "measure_again",
    "new_exercise",
    "reveal",
]
