"""The placements as a page: click a point of the front, see the path there. One file, no network."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np

from toolpath_stiff.analysis import Analysis
from toolpath_stiff.path.rotations import rotation_matrices
from toolpath_stiff.report.page import json_for_script
from toolpath_stiff.units import mm_from_m

MOST_POINTS = 6000  # of the outline; more would not be seen from above


def place_page(summary: dict[str, Any], best: Analysis) -> str:
    """The page's text."""
    keys = ("program", "machine", "load", "objective", "recommended", "before", "before_reason", "front")
    data = {key: summary[key] for key in keys} | {"path": _outline(best)}
    template = (resources.files("toolpath_stiff") / "report" / "assets" / "place.html").read_text(encoding="utf-8")
    return template.replace("__DATA__", json_for_script(data))


def _outline(best: Analysis) -> list[list[list[float]]]:
    """The cutting path in program axes, seen from above in mm, one polyline between two rapids."""
    samples = best.samples
    cutting = np.flatnonzero(samples.cutting)
    turn = rotation_matrices(best.origin[3:])
    flat = mm_from_m(((samples.position - np.array(best.origin[:3])) @ turn)[:, :2])
    pieces = np.split(cutting, np.flatnonzero(np.diff(cutting) > 1) + 1)
    step = max(1, len(cutting) // MOST_POINTS)
    kept = [np.unique([*piece[::step], piece[-1]]) for piece in pieces if len(piece)]
    return [np.round(flat[piece], 3).tolist() for piece in kept]
