"""A sampled path on a machine: loads, reach, stiffness, statistics."""

from toolpath_stiff.analysis.loads import LOADS, Load, parse_load
from toolpath_stiff.analysis.poses import PoseStiffness, evaluate
from toolpath_stiff.analysis.results import Analysis, analyze

__all__ = ["LOADS", "Analysis", "Load", "PoseStiffness", "analyze", "evaluate", "parse_load"]
