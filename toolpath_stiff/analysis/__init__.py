"""A sampled path on a machine: loads, reach, stiffness, statistics."""

from typing import TYPE_CHECKING

from toolpath_stiff.analysis.evaluation import Evaluation, evaluate
from toolpath_stiff.analysis.loads import LOADS, Load, parse_load

if TYPE_CHECKING:
    from toolpath_stiff.analysis.results import Analysis, analyze

__all__ = ["LOADS", "Analysis", "Evaluation", "Load", "analyze", "evaluate", "parse_load"]


def __getattr__(name: str) -> object:
    """`Analysis` and `analyze` on first use: they need NC programs, which single poses do without."""
    if name in ("Analysis", "analyze"):
        from toolpath_stiff.analysis import results

        return getattr(results, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
