"""Plans as measurement files: one row a reading, the stiffness left empty."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from toolpath_stiff.units import deg_from_rad, mm_from_m
from toolpath_stiff.updating.planning.plan_menu import AXES, VECTORS, Visits

POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
VECTOR = ("dx", "dy", "dz")


def plan_rows(
    visits: Visits, chosen: Sequence[int], taken: Iterable[str] = (), repeats: Sequence[int] = ()
) -> list[dict[str, Any]]:
    """Rows of a measurement file in shop units, in measuring order.

    Parameters
    ----------
    visits, chosen
        The visits in measuring order; each is one clamping.
    taken
        Names of points that new points must not bear.
    repeats
        Which repeat of its place each visit is, where places are clamped several times; else the rounds of a visit.
    """
    names = _point_names(visits, chosen, set(taken))
    timed = not np.isnan(visits.readings.time).any()
    axes_only = all(visits.names[row] in AXES for visit in chosen for row in visits.rows(visit))
    found = []
    for clamp, visit in enumerate(chosen, 1):
        for row in visits.rows(visit):
            pose = [*mm_from_m(visits.pose[visit, :3]), *deg_from_rad(visits.pose[visit, 3:])]
            entry: dict[str, Any] = dict(zip(POSE, (_round(value) for value in pose), strict=True))
            name = str(visits.names[row])
            if axes_only:
                entry["direction"] = name
            else:
                entry |= zip(VECTOR, _whole(name), strict=True)
            entry["stiffness_N_per_mm"] = ""
            entry["force_N"] = _round(visits.readings.force[row])
            entry["setup"] = str(visits.setup[visit])
            entry["clamp"] = clamp
            entry["repeat"] = repeats[clamp - 1] if len(repeats) else int(visits.rounds[row])
            entry["point"] = names[clamp - 1]
            if timed:
                entry["time_min"] = _round(visits.readings.time[row] / 60.0)
            entry["tool_extension_mm"] = _round(mm_from_m(visits.extension[visit]))
            found.append(entry)
    if not (visits.setup[list(chosen)] != "").any():
        for entry in found:
            del entry["setup"]
    return found


def _point_names(visits: Visits, chosen: Sequence[int], taken: set[str]) -> list[str]:
    """The name that a pose had before, or a new one; one name a pose."""
    known: dict[tuple[float, ...], str] = {}
    number, names = 0, []
    for visit in chosen:
        pose = tuple(visits.pose[visit].tolist())
        if pose not in known:
            name = str(visits.label[visit])
            while not name or (not visits.label[visit] and name in taken):
                number += 1
                name = f"plan {number}"
            known[pose] = name
        names.append(known[pose])
    return names


def _round(value: float) -> float:
    """To ten digits after the unit's point at most: 0.30000000000000004 is 0.3 to whoever keys it in."""
    return round(float(value), 6) + 0.0


def _whole(name: str) -> list[int]:
    """A direction in whole numbers: files allow vectors of any length."""
    return [int(component != 0.0) for component in VECTORS[name]]


def plan_csv(rows: Sequence[dict[str, Any]]) -> str:
    """The rows as CSV."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(rows[0])
    for row in rows:
        writer.writerow([value if isinstance(value, str) else f"{value:.10g}" for value in row.values()])
    return stream.getvalue()
