"""The results of a stiffness map: figures, table, picture and page."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.analysis.grid import StiffnessMap
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_rows
from toolpath_stiff.files import Content
from toolpath_stiff.report.figure import COLOUR_MAP, INK, MUTED, house_style, new_figure, page_colours, picture
from toolpath_stiff.report.pages import render
from toolpath_stiff.report.words import machine_text, plain
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

MOST_CELLS = 120  # along a side; a finer grid is thinned for the page, the CSV file has all of it


def map_page(planes: StiffnessMap, heading: str) -> str:
    """The page's text; `heading` names the machine and what acts on it."""
    step = max(1, -(-max(len(planes.x), len(planes.y)) // MOST_CELLS))
    stiffness = n_per_mm_from_n_per_m(planes.stiffness[:, ::step, ::step])
    data = {
        "x": np.round(mm_from_m(planes.x[::step]), 3).tolist(),
        "y": np.round(mm_from_m(planes.y[::step]), 3).tolist(),
        "z": np.round(mm_from_m(planes.z), 3).tolist(),
        **page_colours(),
        "values": [[None if np.isnan(v) else round(float(v)) for v in layer.ravel()] for layer in stiffness],
    }
    tilt = ", ".join(f"{deg_from_rad(v):g}" for v in planes.abc)
    about = [
        heading,
        f"slices at z = {', '.join(f'{z:g}' for z in data['z'])} mm",
        *([f"roll, pitch, yaw {tilt} degrees"] if any(planes.abc) else []),
    ]
    return render(
        "map.html",
        styles=["viewer.css", "map.css"],
        scripts=["stage.js", "viewer.js", "map.js"],
        data=data,
        title=f"Stiffness map, load {planes.load}",
        about=" · ".join(about),
        warnings=[f"Warning: {text}" for text in planes.to_dict()["warnings"]],
    )


DECIMALS: dict[str, int | None] = {"x_mm": 6, "y_mm": 6, "z_mm": 6, "stiffness_N_per_mm": 4, "reachable": None}

CONTOURS = 9
ACROSS = 3  # panels in a row


@picture
def map_picture(planes: StiffnessMap, heading: str = "") -> Figure:
    """PNG of every slice, one colour scale for all."""
    slices = len(planes.z)
    rows = -(-slices // ACROSS)
    columns = -(-slices // rows)  # rows filled evenly: four slices are two and two
    wide = float(np.ptp(planes.x)) / float(np.ptp(planes.y))
    side = 7.6 if slices == 1 else 4.6
    width, height = columns * side * min(wide, 1.6) + 1.9, rows * side + 1.5
    stiffness = n_per_mm_from_n_per_m(planes.stiffness)
    low, high = float(np.nanmin(stiffness)), float(np.nanmax(stiffness))
    with house_style():
        figure = new_figure(width, height)
        top = 1.0 - 1.05 / height
        grid = figure.add_gridspec(
            rows,
            columns,
            left=0.75 / width,
            right=1 - 1.5 / width,
            bottom=0.6 / height,
            top=top,
            wspace=0.15,
            hspace=0.14,
        )
        drawn = None
        for i in range(slices):
            axes = figure.add_subplot(grid[i // columns, i % columns])
            drawn = _slice(axes, planes, i, stiffness[i], low, high)
            below, first = i + columns >= slices, i % columns == 0
            axes.set_xlabel("X mm" if below else "")
            axes.set_ylabel("Y mm" if first else "")
            axes.tick_params(labelbottom=below, labelleft=first)
        bar = figure.add_axes((1 - 1.2 / width, 0.6 / height, 0.2 / width, top - 0.6 / height))
        if drawn is not None:
            figure.colorbar(drawn, cax=bar, label="stiffness along the load, N/mm")
            bar.yaxis.set_major_formatter(lambda value, _: number(value))
            bar.grid(visible=False)
        figure.text(0.75 / width, 1 - 0.38 / height, f"Stiffness map, load {planes.load}", fontsize=14, weight="bold")
        a, b, c = (deg_from_rad(v) for v in planes.abc)
        tilt = f"   ·   roll {a:g}, pitch {b:g}, yaw {c:g} degrees" if any(planes.abc) else ""
        text = f"{heading or planes.model.machine.title}{tilt}   ·   {number(low)} to {number(high)} N/mm"
        figure.text(0.75 / width, 1 - 0.68 / height, text, fontsize=10, color=MUTED)
        return figure


def _slice(axes: Axes, planes: StiffnessMap, i: int, stiffness: FloatArray, low: float, high: float) -> Any:
    """One height: colours, contours, the edge of reach, the directions of the joints."""
    x, y = mm_from_m(planes.x), mm_from_m(planes.y)
    mesh = axes.pcolormesh(x, y, stiffness, cmap=COLOUR_MAP, vmin=low, vmax=high, shading="gouraud", rasterized=True)
    if not planes.reachable[i].all() and planes.reachable[i].any():
        axes.contour(x, y, planes.reachable[i].astype(float), levels=[0.5], colors="#d64545", linewidths=1.5)
    axes.set_facecolor("#eceff3")
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set_title(f"z = {mm_from_m(planes.z[i]):g} mm", fontsize=10)
    names = _directions(axes, mm_from_m(planes.model.machine.frame_joints), x, y)
    if np.nanmax(stiffness) > np.nanmin(stiffness):
        lines = axes.contour(x, y, stiffness, levels=CONTOURS, colors="white", linewidths=0.7, alpha=0.9)
        _keep_apart(axes, axes.clabel(lines, fontsize=7, fmt=number), names)
    return mesh


def _keep_apart(axes: Axes, figures: list[Text], names: list[Text]) -> None:
    """Take away a contour's figure that would lie on a name, on another figure or across the frame."""
    room = axes.get_window_extent()
    taken = [name.get_window_extent() for name in names]
    for figure_text in figures:
        box = figure_text.get_window_extent()
        inside = room.x0 < box.x0 and box.x1 < room.x1 and room.y0 < box.y0 and box.y1 < room.y1
        if not inside or any(box.overlaps(other) for other in taken):
            figure_text.remove()
        else:
            taken.append(box)


def _directions(axes: Axes, joints: FloatArray, x: FloatArray, y: FloatArray) -> list[Text]:
    """Where the struts meet the frame: at their place, or as arrows at the rim if that is outside; their names."""
    names: list[Text] = []
    seen: list[FloatArray] = []
    for i, joint in enumerate(joints[:, :2]):
        inside = x[0] <= joint[0] <= x[-1] and y[0] <= joint[1] <= y[-1]
        unit = joint / max(float(np.hypot(*joint)), 1e-9)
        if inside:
            axes.plot(*joint, "^", color=INK, ms=6)
            names.append(axes.annotate(f"strut {i + 1}", joint, fontsize=7, xytext=(4, 4), textcoords="offset points"))
            continue
        if any(float(unit @ other) > 0.999 for other in seen):
            continue
        seen.append(unit)
        same = [k + 1 for k in range(6) if float(joints[k, :2] @ unit) > 0.999 * float(np.hypot(*joints[k, :2]))]
        middle = np.array([(x[0] + x[-1]) / 2, (y[0] + y[-1]) / 2])
        half = np.array([(x[-1] - x[0]) / 2, (y[-1] - y[0]) / 2])
        reach = float(np.min(half / np.maximum(np.abs(unit), 1e-9)))
        tip, tail = middle + 0.985 * reach * unit, middle + 0.90 * reach * unit
        axes.annotate("", tip, tail, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.4})
        label = "struts " + ", ".join(map(str, same)) if len(same) > 1 else f"strut {same[0]}"
        spot = middle + 0.88 * reach * unit
        box = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.2}
        # Beside the arrow's tail, towards the middle: an arrow along X would lie beneath a centred name.
        side = "center" if abs(unit[0]) < 0.9 else "left" if unit[0] < 0.0 else "right"
        level = "center" if abs(unit[1]) < 0.4 else "bottom" if unit[1] < 0.0 else "top"
        names.append(
            axes.text(float(spot[0]), float(spot[1]), label, fontsize=7, ha=side, va=level, color=INK, bbox=box)
        )
    return names


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    return ("map.csv", "map.json", *(("map.png", "map.html") if plots else ()))


def files(planes: StiffnessMap, plots: bool) -> dict[str, Content]:
    """Table and summary, and with `plots` picture and page."""
    contents: dict[str, Content] = {
        "map.csv": map_csv(planes),
        "map.json": json.dumps(planes.to_dict(), indent=2) + "\n",
    }
    if plots:
        heading = machine_text({**planes.to_dict(), "machine": planes.model.machine.title})
        contents["map.png"] = map_picture(planes, heading)
        contents["map.html"] = map_page(planes, heading)
    return contents


def map_csv(planes: StiffnessMap) -> Iterator[str]:
    """`map.csv`, a slice at a time."""
    yield ",".join(DECIMALS) + "\n"
    for columns in planes.columns():
        yield csv_rows({**columns, "reachable": columns["reachable"].astype(int)}, DECIMALS)


def text(planes: StiffnessMap) -> str:
    """The extremes of each slice, for the terminal."""
    summary = planes.to_dict()
    lines = [f"machine {machine_text(summary)}, load {summary['load']}, {summary['points']} points"]
    for warning in summary["warnings"]:
        lines.append(f"warning: {plain(warning)}")
    for row in summary["slices"]:
        lines.append(f"z = {row['z_mm']:g} mm: {100 * row['reachable_share']:.0f} % within reach")
        for name in ("softest", "stiffest"):
            if name in row:
                spot = row[name]
                lines.append(
                    f"  {name:<9} {spot['stiffness_N_per_mm']:8.0f} N/mm at X{spot['x_mm']:g} Y{spot['y_mm']:g}"
                )
        circle = row.get("circle", {})
        if circle.get("maxima_deg"):
            maxima, minima = (", ".join(f"{v:g}" for v in circle[f"{k}_deg"]) for k in ("maxima", "minima"))
            lines.append(
                f"  on the circle of {circle['radius_mm']:g} mm: maxima at {maxima} degrees, minima at {minima} degrees"
            )
    return "\n".join(lines)
