"""A rewritten program against the placed one: what the stiffness along it says of the rewriting."""

from __future__ import annotations

from typing import Any

from toolpath_stiff.analysis.path_analysis import Analysis, analyse
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.rewriting import Rewritten
from toolpath_stiff.units import Pose

FIGURES = {"mean": "mean_N_per_mm", "range": "range_N_per_mm", "min": "min_N_per_mm"}


def rewriting_differences(
    placed: Analysis, rewritten: Rewritten, original_origin: Pose, **reading: Any
) -> dict[str, float]:
    """Relative differences of mean, range and smallest stiffness: the rewritten program against the placed one.

    Parameters
    ----------
    placed
        The untouched program, analysed at the placement.
    rewritten
        Is read and analysed at the original origin with the same load, force and step.
    original_origin
        m and rad, as it was given to `rewrite_program`.
    **reading
        `offsets`, `tools`, `block_delete`, as for `parse_program`.
    """
    program = parse_program(rewritten.text, placed.program.name, origin=original_origin, **reading)
    again = analyse(
        placed.model, program, origin=original_origin, load=placed.load, step=placed.step, force=placed.force
    )
    wanted, found = (stiffness_figures(analysis, analysis.counted) for analysis in (placed, again))
    scale = {"range": wanted["range_N_per_mm"] or wanted["mean_N_per_mm"]}  # a path of one point has no range
    return {name: abs(found[key] - wanted[key]) / scale.get(name, wanted[key]) for name, key in FIGURES.items()}
