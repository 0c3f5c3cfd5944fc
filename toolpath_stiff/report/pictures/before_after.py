"""Differences of model and measurements before and after a fit, seen from above; measured against modelled."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions, planes
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED, deviation_percent
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.report.colours import DIRECTIONS, GREY, INK, MUTED, RESIDUAL, WITHIN
from toolpath_stiff.report.pictures.style import Look, new_figure, panel, round_ticks
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, percent, plain, shortened
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

SHOWN = 0.98  # share of the residuals that the colour scale holds
BAND = 0.10  # relative band drawn about measured = modelled
MAP = 2.05  # inch
MAPS = "maps from above, X to the right; a point: mean of its readings"
LEFT = 0.95  # inch
EDGE = 0.035  # around a map, of its side


def before_after(
    data: Readings,
    halves: tuple[FloatArray, FloatArray],
    last: str,
    held_out_percent: float | None,
    refitted_percent: float | None,
) -> Figure:
    """Differences of model and measurements, seen from above, before and after, and measured against modelled.

    Parameters
    ----------
    data, halves
        Readings, and ln(measured / modelled) (n,) of the machine file as given and of the last model.
    last, held_out_percent
        What the last model is called, and its error at left-out points.
    refitted_percent
        The error of the refitted strut law alone, where that is not the last model.
    """
    limit, (rows, columns) = _limit(halves), panels(data)
    block = MAP * len(columns) + 1.1
    width, height = max(1.1 + 2 * block, 11.0), 1.35 + MAP * len(rows) + 0.4 + 4.0
    step = "" if refitted_percent is None else f"{LAW_REFITTED} alone: {percent(refitted_percent, 2)}; "
    note = f"{step}{DEVIATION}, {MINUS_IS_SOFTER}; {MAPS}, {2.4 * _reach(data):.0f} mm wide"
    figure = new_figure(width, height, "Did the error fall, and what remains?", note)
    titles = _half_title(AS_GIVEN, None, halves[0]), _half_title(last, held_out_percent, halves[1])
    for half, residual in enumerate(halves):
        figure.text((LEFT + half * block) / width, 1.0 - 1.0 / height, titles[half], size=10.5, weight="bold")
        maps(figure, data, residual, (LEFT + half * block, height - 1.35, MAP), limit)
    _scatter_pair(figure, data, halves, directions(data))
    return figure


def panels(data: Readings) -> tuple[list[str], list[str]]:
    """Planes, the highest first, and directions of the readings."""
    along, levels = directions(data), planes(data)
    rows = sorted(set(levels.tolist()), key=lambda name: -float(data.position[levels == name, 2].mean()))
    return rows, [direction for direction in DIRECTIONS if (along == direction).any()]


def maps(
    figure: Figure, data: Readings, residual: FloatArray, place: tuple[float, float, float], limit: float = 0.0
) -> None:
    """Residuals seen from above, a row per plane, a column per direction, with their scale.

    `place`: left and upper edge of the maps, and the side of one, in inches. `limit`: end of the scale, %; else
    as the residuals need it.
    """
    (rows, columns), (left, top, side) = panels(data), place
    along, levels, limit = directions(data), planes(data), limit or _limit([residual])
    across, up = side * len(columns), side * len(rows)
    # All maps share one frame, which takes a fraction of the time of a frame each.
    axes = panel(figure, left, top - up, across, up, xlim=(0.0, len(columns)), ylim=(len(rows), 0.0))
    axes.set_axis_off()
    style: Look = {"rotation": 90, "ha": "right", "va": "center", "size": 9}
    drawn = []
    for i, row in enumerate(rows):
        here = levels == row
        low, high = (f"{end:.0f}" for end in mm_from_m(np.quantile(data.position[here, 2], (0.0, 1.0))))
        axes.text(-0.01, i + 0.5, f"z {low} mm" if low == high else f"z {low} to {high} mm", **style)
        drawn += [_map(axes, data, residual, here & (along == name), (j, i)) for j, name in enumerate(columns)]
    for j, name in enumerate(columns):
        axes.text(j + EDGE, -0.03, name, size=9.5, weight="bold", color=MUTED)
    spots, values = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
    colour: Look = {"cmap": RESIDUAL, "vmin": -limit, "vmax": limit, "edgecolors": INK, "linewidths": 0.5, "zorder": 3}
    points = axes.scatter(spots[:, 0], spots[:, 1], c=values, s=78, **colour)
    bar = panel(figure, left + across, top - up + EDGE * side, 0.12, up - 2 * EDGE * side)
    figure.colorbar(points, cax=bar, extend="both").set_label(f"{DEVIATION}, %", size=9)
    bar.grid(visible=False)


def _half_title(name: str, held_out: float | None, residual: FloatArray) -> str:
    relative = np.expm1(-residual[np.isfinite(residual)])
    text = f"{shortened(plain(name), 44)}   mean error {100 * float(np.mean(np.abs(relative))):.2f} %"
    return text + (f" (at points left out {percent(held_out, 2)})" if held_out is not None else "")


def _limit(halves: Sequence[FloatArray]) -> float:
    """End of the common colour scale, %, from both halves together, without a few extreme readings."""
    sizes = np.abs(deviation_percent(np.concatenate(halves)))
    sizes = sizes[np.isfinite(sizes)]
    return max(float(np.quantile(sizes, SHOWN)), 1e-3) if len(sizes) else 1.0


def _map(
    axes: Axes, data: Readings, residual: FloatArray, chosen: NDArray[np.bool_], corner: tuple[int, int]
) -> tuple[FloatArray, FloatArray]:
    """Draw the frame of a map in the unit square at `corner`; its discs (m, 2) there and their residuals (m,), %.

    A disc a pose, readings of one pose averaged; poses above each other stand side by side.
    """
    everywhere, reach = mm_from_m(data.position[:, :2]), _reach(data)
    every = np.round(np.concatenate([data.position, data.angles], axis=1)[chosen], 6)
    poses, which = np.unique(every, axis=0, return_inverse=True)
    values = np.bincount(which.ravel(), deviation_percent(residual[chosen])) / np.bincount(which.ravel())
    centre = 0.5 * (everywhere.min(axis=0) + everywhere.max(axis=0))
    scale, middle = np.array([1.0, -1.0]) * (0.5 - EDGE) / (1.2 * reach), np.add(corner, 0.5)
    axes.plot(*(middle - scale * centre), "+", color=MUTED, ms=8, zorder=2)
    size = 1.0 - 2.0 * EDGE
    axes.add_patch(
        Rectangle((corner[0] + EDGE, corner[1] + EDGE), size, size, fill=False, edgecolor=GREY, linewidth=0.8)
    )
    return middle + scale * (_spread(mm_from_m(poses[:, :2]), 0.09 * reach) - centre), values


def _reach(data: Readings) -> float:
    """Half the larger extent of the measured positions in X and Y, mm."""
    return 0.5 * float(np.ptp(mm_from_m(data.position[:, :2]), axis=0).max()) or 100.0


def _spread(places: FloatArray, step: float) -> FloatArray:
    """Points at one place moved onto a ring around it, so that each is visible."""
    out = places.astype(float).copy()
    _, which, count = np.unique(np.round(places, 1), axis=0, return_inverse=True, return_counts=True)
    for group in np.flatnonzero(count > 1):
        members = np.flatnonzero(which.ravel() == group)
        angle = 2.0 * np.pi * np.arange(len(members)) / len(members)
        out[members] += step * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return out


def _scatter_pair(figure: Figure, data: Readings, halves: Sequence[FloatArray], along: NDArray[np.str_]) -> None:
    across = (figure.get_figwidth() - 1.6) / 2.0  # inches
    measured = n_per_mm_from_n_per_m(data.stiffness)
    modelled = [measured * np.exp(-residual) for residual in halves]
    values = np.concatenate([measured, *modelled])
    values = values[np.isfinite(values)]
    for half, stiffness in enumerate(modelled):
        axes = panel(figure, LEFT + half * across, 0.55, across - 0.75, 3.2)
        one_to_one(axes, 0.93 * float(values.min()), 1.07 * float(values.max()))
        for direction, colour in DIRECTIONS.items():
            chosen = along == direction
            if chosen.any():
                axes.plot(stiffness[chosen], measured[chosen], "o", ms=4.5, mfc="none", mec=colour, label=direction)
        axes.set_title(("before", "after")[half], size=10)
        axes.legend(frameon=False, loc="upper left", title="grey: +-10 %", title_fontsize=8, fontsize=9)


def one_to_one(axes: Axes, low: float, high: float) -> None:
    """Set up logarithmic axes of measured against modelled stiffness, N/mm, with the line where they are equal."""
    line = np.array([low, high])
    axes.fill_between(line, line * (1.0 - BAND), line * (1.0 + BAND), color=WITHIN, lw=0, zorder=0)
    axes.plot(line, line, color=MUTED, lw=1.0, zorder=1)
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high))
    for axis in (axes.xaxis, axes.yaxis):
        round_ticks(axis, low, high)
    axes.set(xlabel="modelled stiffness, N/mm", ylabel="measured stiffness, N/mm")
