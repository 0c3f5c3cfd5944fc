"""Residuals over the workspace, before and after, and measured against modelled; colours of directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.errors import AS_GIVEN, LAW_REFITTED, deviation_percent
from toolpath_stiff.report.figure import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    PURPLE,
    SECOND_ORANGE,
    WITHIN,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, percent, plain, shortened
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.readings.measurements import Readings


RESIDUAL_MAP = "RdBu"  # red: measured softer than modelled, blue: stiffer


DIRECTION_COLOURS = {"X": BLUE, "Y": SECOND_ORANGE, "Z": GREEN, "oblique": PURPLE}


ALONG = 0.99  # cosine from which a direction counts as that axis: 8 degrees


MOST_LEVELS = 3  # rows of maps; more heights are put together


SHOWN = 0.98  # share of the residuals that the colour scale holds


BAND = 0.10  # drawn about measured = modelled


MAP = 2.05  # inch


@drawn
def before_after_png(
    data: Readings,
    before: FloatArray,
    after: FloatArray,
    last: str,
    held_out_percent: float | None = None,
    refitted_percent: float | None = None,
) -> Figure:
    """PNG: where model and measurements differ, seen from above, before and after, and measured against modelled.

    Parameters
    ----------
    data
        n readings.
    before, after
        (n,) ln(measured / modelled), of the machine file as given and of the last model.
    last, held_out_percent
        What the last model is called; its error at left-out points.
    refitted_percent
        Error of the refitted strut law alone, where that is not the last model.
    """
    halves = [np.asarray(before, dtype=float), np.asarray(after, dtype=float)]
    directions, levels = _directions(data), _levels(data)
    columns, rows = [d for d in DIRECTION_COLOURS if (directions == d).any()], np.unique(levels)
    limit = _limit(halves)
    block = MAP * len(columns) + 0.3
    width, height = max(1.1 + len(halves) * block + 0.9, 11.0), 1.35 + MAP * len(rows) + 0.4 + 4.0
    wide = f"{2.4 * _reach(data):.0f} mm wide"
    step = f"{LAW_REFITTED} alone: {percent(refitted_percent, 2)}; " if refitted_percent is not None else ""
    note = (
        f"{step}{DEVIATION}, {MINUS_IS_SOFTER}; maps from above, X to the right, {wide}; a point: mean of its readings"
    )
    with house_style():
        figure = new_figure(width, height)
        figure.text(0.25 / width, 1.0 - 0.4 / height, "Did the error fall, and what remains?", size=14, weight="bold")
        figure.text(0.25 / width, 1.0 - 0.66 / height, note, size=9.5, color=MUTED)
        for half, residual in enumerate(halves):
            left = 0.95 + half * block
            title = _half_title((AS_GIVEN, last)[half], held_out_percent if half else None, residual)
            figure.text(left / width, 1.0 - 1.0 / height, title, size=10.5, weight="bold")
            points = _half(figure, data, residual, left, limit)
        bar = figure.add_axes(
            ((0.95 + len(halves) * block) / width, (height - 1.35 - MAP * len(rows) + 0.1) / height, 0.16 / width,
             (MAP * len(rows) - 0.3) / height)
        )  # fmt: skip
        figure.colorbar(points, cax=bar, extend="both").set_label(f"{DEVIATION}, %", size=9)
        bar.grid(visible=False)
        _scatter_pair(figure, data, halves, directions)
        return figure


def _half(figure: Figure, data: Readings, residual: FloatArray, left: float, limit: float) -> Any:
    """The maps of one model, `left` inches from the edge: a row a height, a column a direction; its points."""
    width, height = figure.get_size_inches()
    directions, levels = _directions(data), _levels(data)
    for i, level in enumerate(np.unique(levels)):
        for j, direction in enumerate(d for d in DIRECTION_COLOURS if (directions == d).any()):
            bottom = height - 1.35 - MAP * (i + 1) + 0.1
            axes = figure.add_axes(
                ((left + MAP * j) / width, bottom / height, (MAP - 0.15) / width, (MAP - 0.3) / height),
                xticks=[],
                yticks=[],
            )
            points = _map(axes, data, residual, (levels == level) & (directions == direction), limit)
            axes.set_title(direction if i == 0 else "", size=9.5, color=MUTED)
            if left < 1.0 and j == 0:  # of the first half
                text = _level_text(data, levels == level)
                axes.text(-0.04, 0.5, text, transform=axes.transAxes, rotation=90, ha="right", va="center", size=9)
    return points


def _half_title(name: str, held_out: float | None, residual: FloatArray) -> str:
    """Name and errors: the mean as the paper counts it, and at left-out points where it is known."""
    relative = np.expm1(-residual[np.isfinite(residual)])
    text = f"{shortened(plain(name), 44)}   mean error {100 * float(np.mean(np.abs(relative))):.2f} %"
    return text + (f" (at points left out {percent(held_out, 2)})" if held_out is not None else "")


def _directions(data: Readings) -> NDArray[np.str_]:
    """(n,) X, Y, Z, or oblique."""
    along = np.abs(data.direction)
    names = np.array(["X", "Y", "Z"])[np.argmax(along, axis=1)]
    return np.where(along.max(axis=1) > ALONG, names, "oblique")


def _levels(data: Readings) -> NDArray[np.int64]:
    """(n,) number of the height group, the highest first: each height its own, or as many equal bands as are shown."""
    height = np.round(data.position[:, 2], 3)
    heights = np.unique(height)
    if len(heights) > MOST_LEVELS:
        edges = np.linspace(heights[0], heights[-1], MOST_LEVELS + 1)[1:-1]
        return np.asarray(MOST_LEVELS - np.digitize(height, edges), dtype=np.int64)
    return np.asarray(len(heights) - np.searchsorted(heights, height), dtype=np.int64)


def _level_text(data: Readings, chosen: NDArray[np.bool_]) -> str:
    heights = mm_from_m(data.position[chosen, 2])
    low, high = float(heights.min()), float(heights.max())
    return f"z {low:.0f} mm" if high - low < 1.0 else f"z {low:.0f} to {high:.0f} mm"


def _limit(halves: Sequence[FloatArray]) -> float:
    """End of the common colour scale, %: of both halves together, few extreme readings not taking the contrast."""
    sizes = np.abs(deviation_percent(np.concatenate(halves)))
    sizes = sizes[np.isfinite(sizes)]
    return max(float(np.quantile(sizes, SHOWN)), 1e-3) if len(sizes) else 1.0


def _map(axes: Axes, data: Readings, residual: FloatArray, chosen: NDArray[np.bool_], limit: float) -> Any:
    """One map: a disc a pose, readings of one pose averaged; poses above each other stand side by side."""
    everywhere = mm_from_m(data.position[:, :2])
    poses, which = np.unique(
        np.round(np.concatenate([data.position, data.angles], axis=1)[chosen], 6), axis=0, return_inverse=True
    )
    percent_ = deviation_percent(residual[chosen])
    places, values = (
        mm_from_m(poses[:, :2]),
        np.array([np.mean(percent_[which.ravel() == k]) for k in range(len(poses))]),
    )
    reach = _reach(data)
    centre = 0.5 * (everywhere.min(axis=0) + everywhere.max(axis=0))
    places = _spread(places, 0.09 * reach)
    drawn = axes.scatter(
        places[:, 0], places[:, 1], c=values, cmap=RESIDUAL_MAP, vmin=-limit, vmax=limit, s=78, edgecolors=INK,
        linewidths=0.5, zorder=3,
    )  # fmt: skip
    axes.plot(0.0, 0.0, "+", color=MUTED, ms=8, zorder=2)
    axes.set_xlim(centre[0] - 1.2 * reach, centre[0] + 1.2 * reach)
    axes.set_ylim(centre[1] - 1.2 * reach, centre[1] + 1.2 * reach)
    axes.set_aspect("equal")
    return drawn


def _reach(data: Readings) -> float:
    """Half the larger extent of the measured positions in X and Y, mm."""
    return 0.5 * float(np.ptp(mm_from_m(data.position[:, :2]), axis=0).max()) or 100.0


def _spread(places: FloatArray, step: float) -> FloatArray:
    """Points at one place moved onto a ring about it, so that each is seen."""
    out = places.astype(float).copy()
    _, which, count = np.unique(np.round(places, 1), axis=0, return_inverse=True, return_counts=True)
    for group in np.flatnonzero(count > 1):
        members = np.flatnonzero(which.ravel() == group)
        angle = 2.0 * np.pi * np.arange(len(members)) / len(members)
        out[members] += step * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return out


def _scatter_pair(
    figure: Figure,
    data: Readings,
    halves: Sequence[FloatArray],
    directions: NDArray[np.str_],
) -> None:
    """Measured against modelled, both on the same scales, beside each other below the maps."""
    width, height = figure.get_size_inches()
    across = (width - 1.6) / len(halves)  # inches
    measured = n_per_mm_from_n_per_m(data.stiffness)
    modelled = [measured * np.exp(-residual) for residual in halves]
    values = np.concatenate([measured, *modelled])
    values = values[np.isfinite(values)]
    low, high = 0.93 * float(values.min()), 1.07 * float(values.max())
    for half, stiffness in enumerate(modelled):
        left = 0.95 + half * across
        axes = figure.add_axes((left / width, 0.55 / height, (across - 0.75) / width, 3.2 / height))
        line = np.array([low, high])
        axes.fill_between(line, line * (1.0 - BAND), line * (1.0 + BAND), color=WITHIN, lw=0, zorder=1)
        axes.plot(line, line, color=MUTED, lw=1.0, zorder=2)
        for direction, colour in DIRECTION_COLOURS.items():
            chosen = directions == direction
            if chosen.any():
                axes.plot(stiffness[chosen], measured[chosen], "o", ms=4.5, mfc="none", mec=colour, label=direction)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlim(low, high)
        axes.set_ylim(low, high)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(_round_ticks(low, high))
            axis.set_minor_locator(_no_ticks())
            axis.set_major_formatter(lambda value, _: number(value))
        axes.set_xlabel("modelled, N/mm")
        if half == 0:
            axes.set_ylabel("measured, N/mm")
        axes.set_title(("before", "after")[half], size=10)
        axes.legend(frameon=False, loc="upper left", title="grey: +-10 %", title_fontsize=8, fontsize=9)


def _round_ticks(low: float, high: float) -> Any:
    """1, 2, 3, 5, 7 times powers of ten within the axis."""
    from matplotlib.ticker import FixedLocator

    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    steps = (1.0, 2.0, 3.0, 5.0, 7.0) if high < 12.0 * low else (1.0, 3.0)
    return FixedLocator(sorted(v for p in powers for s in steps if low <= (v := s * p) <= high))


def _no_ticks() -> Any:
    from matplotlib.ticker import NullLocator

    return NullLocator()
