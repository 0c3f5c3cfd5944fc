"""A stiffness map as a page: its slices in 3-D, to turn and to point at. One file, no network."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.analysis.poses import StiffnessMap
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.report.page import json_for_script
from toolpath_stiff.report.sections import escaped
from toolpath_stiff.report.template import asset, filled, script_hash, style
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

MOST_CELLS = 120  # along a side; a finer grid is thinned for the page, the CSV file has all of it


def map_page(machine: Machine, found: StiffnessMap, warnings: Sequence[str] = ()) -> str:
    """The page's text."""
    step = max(1, -(-max(len(found.x), len(found.y)) // MOST_CELLS))
    stiffness = n_per_mm_from_n_per_m(found.stiffness[:, ::step, ::step])
    data = {
        "x": np.round(mm_from_m(found.x[::step]), 3).tolist(),
        "y": np.round(mm_from_m(found.y[::step]), 3).tolist(),
        "z": np.round(mm_from_m(found.z), 3).tolist(),
        "values": [[None if np.isnan(v) else round(float(v)) for v in layer.ravel()] for layer in stiffness],
    }
    script = '\n"use strict";\n(() => {\n' + asset("map.js") + "})();\n"
    tilt = ", ".join(f"{deg_from_rad(v):g}" for v in found.abc)
    about = [
        machine.title,
        f"slices at z = {', '.join(f'{z:g}' for z in data['z'])} mm",
        *([f"roll, pitch, yaw {tilt} degrees"] if any(found.abc) else []),
    ]
    return filled(
        asset("map.html"),
        {
            "title": escaped(f"Stiffness map, load {found.load}"),
            "about": escaped(" · ".join(about)),
            "warnings": "\n".join(f'<p class="warning">Warning: {escaped(text)}</p>' for text in warnings),
            "style": style("map.css"),
            "script": script,
            "script_hash": script_hash(script),
            "data": json_for_script(data),
        },
    )
