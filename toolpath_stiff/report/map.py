"""Views of a stiffness map: figures, table and page."""

from collections.abc import Iterator

import numpy as np

from toolpath_stiff.analysis.grid import StiffnessMap
from toolpath_stiff.column_files import csv_rows
from toolpath_stiff.documents import number
from toolpath_stiff.report.pages import render
from toolpath_stiff.report.words import machine_text, plain
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

MOST_CELLS = 120  # along a side; a finer grid is thinned for the page, the CSV file has all of it
DECIMALS: dict[str, int | None] = {"x_mm": 6, "y_mm": 6, "z_mm": 6, "stiffness_N_per_mm": 4, "reachable": None}
PAGE = "map.html"


def heading(planes: StiffnessMap) -> list[str]:
    """The machine with its active effects, and the orientation of the platform."""
    machine = machine_text({**planes.to_dict(), "machine": planes.model.machine.title})
    tilt = "roll {:g}, pitch {:g}, yaw {:g} degrees".format(*map(deg_from_rad, planes.abc))
    return [machine, *([tilt] if any(planes.abc) else [])]


def page(planes: StiffnessMap, drawn: dict[str, bytes]) -> Iterator[str]:
    """The page, in pieces."""
    step = max(1, -(-max(len(planes.x), len(planes.y)) // MOST_CELLS))
    stiffness = n_per_mm_from_n_per_m(planes.stiffness[:, ::step, ::step])
    data = {
        "x": np.round(mm_from_m(planes.x[::step]), 3).tolist(),
        "y": np.round(mm_from_m(planes.y[::step]), 3).tolist(),
        "z": np.round(mm_from_m(planes.z), 3).tolist(),
        "values": [[None if np.isnan(v) else round(float(v)) for v in layer.ravel()] for layer in stiffness],
    }
    slices = ", ".join(f"{z:g}" for z in mm_from_m(planes.z))
    return render(
        "map.html",
        styles=["viewer.css", "map.css"],
        scripts=["stage.js", "viewer.js", "map.js"],
        data=data,
        title=f"Stiffness map, load {planes.load}",
        low=number(float(np.nanmin(stiffness))),
        high=number(float(np.nanmax(stiffness))),
        about=" · ".join([*heading(planes), f"slices at z = {slices} mm"]),
        warnings=[f"Warning: {text}" for text in planes.to_dict()["warnings"]],
    )


def map_csv(planes: StiffnessMap) -> str:
    """`map.csv`."""
    columns = planes.columns()
    return ",".join(DECIMALS) + "\n" + csv_rows({**columns, "reachable": columns["reachable"].astype(int)}, DECIMALS)


DATA = {"map.csv": map_csv, "map.json": StiffnessMap.to_json}


def text(planes: StiffnessMap) -> str:
    """Extremes of each slice, for the terminal."""
    summary = planes.to_dict()
    lines = [f"machine {machine_text(summary)}, load {summary['load']}, {summary['points']} points"]
    lines += [f"warning: {plain(warning)}" for warning in summary["warnings"]]
    for row in summary["slices"]:
        lines.append(f"z = {row['z_mm']:g} mm: {100 * row['reachable_share']:.0f} % within reach")
        for name in ("softest", "stiffest"):
            if spot := row.get(name):
                place = f"X{spot['x_mm']:g} Y{spot['y_mm']:g}"
                lines.append(f"  {name:<9} {spot['stiffness_N_per_mm']:8.0f} N/mm at {place}")
    return "\n".join(lines)
