"""A stiffness map as a page: its slices in 3-D, to turn and to point at. One file, no network."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources

import numpy as np

from toolpath_stiff.analysis.stiffness_map import StiffnessMap
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.report.page import json_for_script
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

MOST_CELLS = 120  # along a side; a finer grid is thinned for the page, the CSV file has all of it


def map_page(machine: Machine, found: StiffnessMap, warnings: Sequence[str] = ()) -> str:
    """The page's text."""
    step = max(1, -(-max(len(found.x), len(found.y)) // MOST_CELLS))
    stiffness = n_per_mm_from_n_per_m(found.stiffness[:, ::step, ::step])
    data = {
        "title": f"Stiffness map, load {found.load}",
        "machine": machine.title,
        "warnings": list(warnings),
        "x": np.round(mm_from_m(found.x[::step]), 3).tolist(),
        "y": np.round(mm_from_m(found.y[::step]), 3).tolist(),
        "z": np.round(mm_from_m(found.z), 3).tolist(),
        "abc": [round(deg_from_rad(v), 6) for v in found.abc],
        "values": [[None if np.isnan(v) else round(float(v)) for v in layer.ravel()] for layer in stiffness],
    }
    template = (resources.files("toolpath_stiff") / "report" / "assets" / "map.html").read_text(encoding="utf-8")
    return template.replace("__DATA__", json_for_script(data))
