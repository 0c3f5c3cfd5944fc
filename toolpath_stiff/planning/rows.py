"""A plan's visits as a measurement file whose stiffness is left empty."""

from collections.abc import Iterable, Sequence
from itertools import count

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.documents import Document
from toolpath_stiff.planning.visits import AXES, VECTORS, Visits
from toolpath_stiff.units import deg_from_rad, min_from_s, mm_from_m

POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
VECTOR = ("dx", "dy", "dz")
PlanRow = dict[str, float | str]  # a reading, by the columns of a measurement file


def plan_rows(visits: Visits, chosen: Sequence[int], taken: Iterable[str] = ()) -> list[PlanRow]:
    """Rows of a measurement file in shop units, in measuring order.

    Parameters
    ----------
    visits, chosen
        The visits in measuring order; each is one clamping.
    taken
        Names of points that new points must not have.
    """
    names = _point_names(visits, chosen, set(taken))
    readings = visits.readings
    planned = np.concatenate([visits.rows(visit) for visit in chosen])
    timed, beside = not np.isnan(readings.time).any(), bool((readings.loop[planned] != "").any())
    axes_only = set(visits.names[planned].tolist()) <= set(AXES)
    named = bool((visits.setup[list(chosen)] != "").any())
    rows: list[PlanRow] = []
    for clamp, visit in enumerate(chosen, 1):
        pose = [*mm_from_m(visits.pose[visit, :3]), *deg_from_rad(visits.pose[visit, 3:])]
        for row in visits.rows(visit):
            name = str(visits.names[row])
            # Files allow vectors of any length: directions in whole numbers.
            vector = [int(component != 0.0) for component in VECTORS[name]]
            rows.append(
                dict(zip(POSE, map(_round, pose), strict=True))
                | ({"direction": name} if axes_only else dict(zip(VECTOR, vector, strict=True)))
                | {"stiffness_N_per_mm": ""}
                | ({"loop": str(readings.loop[row]), "displacement_um": ""} if beside else {})
                | {"force_N": _round(readings.force[row])}
                | ({"setup": str(visits.setup[visit])} if named else {})
                | {"clamp": clamp, "repeat": int(visits.rounds[row]), "point": names[clamp - 1]}
                | ({"time_min": _round(min_from_s(readings.time[row]))} if timed else {})
                | {"tool_extension_mm": _round(mm_from_m(visits.extension[visit]))}
            )
    return rows


def _point_names(visits: Visits, chosen: Sequence[int], taken: set[str]) -> list[str]:
    """The name that a pose had before, or a new one; one name a pose."""
    fresh = (name for name in map("plan {}".format, count(1)) if name not in taken)
    poses = [tuple(pose) for pose in visits.pose[list(chosen)].tolist()]
    names: dict[tuple[float, ...], str] = {}
    for visit, pose in zip(chosen, poses, strict=True):
        if pose not in names:
            names[pose] = str(visits.label[visit]) or next(fresh)
    return [names[pose] for pose in poses]


def _round(value: float) -> float:
    """To ten digits after the unit's point at most: 0.30000000000000004 is 0.3 to whoever keys it in."""
    return round(float(value), 6) + 0.0


def visit_entries(
    visits: Visits, chosen: Sequence[int], rows: Sequence[PlanRow], kinds: Sequence[str], why: Sequence[str]
) -> list[Document]:
    """One entry a clamping: where, how, what is read, why."""
    first, entries = {row["clamp"]: row for row in reversed(rows)}, list[Document]()
    for clamp, (visit, kind, reason) in enumerate(zip(chosen, kinds, why, strict=True), 1):
        taken = visits.rows(visit)
        loops = dict.fromkeys(visits.readings.loop[taken].tolist())
        entries.append(
            {key: first[clamp][key] for key in ("clamp", "point", *POSE, "tool_extension_mm")}
            | {
                "setup": str(visits.setup[visit]),
                "forces_N": sorted(set(map(_round, visits.readings.force[taken]))),
                "directions": list(dict.fromkeys(visits.names[taken].tolist())),
                "loops": [loop for loop in loops if loop],
                "kind": kind,
                "why": reason,
            }
        )
    return entries


def plan_csv(rows: Sequence[PlanRow]) -> str:
    """The rows as CSV."""
    cells = [[value if isinstance(value, str) else f"{value:.10g}" for value in row.values()] for row in rows]
    return csv_text(rows[0], cells)
