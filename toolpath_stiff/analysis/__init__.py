"""A sampled path on a machine: loads, reach, stiffness, statistics."""

from toolpath_stiff.analysis.evaluate import PoseStiffness, evaluate
from toolpath_stiff.analysis.loads import LOADS, Load, parse_load
from toolpath_stiff.analysis.path_analysis import Analysis, analyse

__all__ = ["LOADS", "Analysis", "Load", "PoseStiffness", "analyse", "evaluate", "parse_load"]
