"""The load path as a waterfall: compliance link by link, and what the measurements add or take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.report.compare.pictures import count_of, heading
from toolpath_stiff.report.figure import (
    BLUE,
    INK,
    LIGHT_BLUE,
    MUTED,
    SECOND_ORANGE,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.residuals import DIRECTION_COLOURS
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, plain, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


NM_PER_N = 1e9


LONG_NAME = 10  # letters of a link from which its name, turned, needs more room below


LINKS = (BLUE, LIGHT_BLUE)  # struts, alternating


EFFECT = SECOND_ORANGE


@drawn
def load_path_png(comparison: Comparison) -> Figure:
    """PNG: compliance of the tip along X, Y, Z, link by link, and what the measurements add or take."""
    shares = comparison.shares
    compliance = shares.compliance * NM_PER_N
    along = directions(comparison.data)
    ratio = np.array([_measured_over_modelled(comparison, along == axis) for axis in "XYZ"])
    with house_style():
        longest = max(len(name) for name in shares.links)
        below = 0.95 if longest <= LONG_NAME else 1.45
        width, height = 13.0, 4.25 + below
        figure = new_figure(width, height)
        top = 1.18 * float(np.nanmax(compliance.sum(axis=1) * np.fmax(ratio, 1.0)))
        for i, axis in enumerate("XYZ"):
            axes = figure.add_axes(((0.75 + 4.1 * i) / width, below / height, 3.8 / width, 3.05 / height))
            _waterfall(axes, compliance[i], shares.links, float(ratio[i]))
            axes.set_ylim(0.0, top)
            axes.set_title(f"{axis}: {compliance[i].sum():.1f} nm/N modelled", color=DIRECTION_COLOURS[axis])
            if i:
                axes.set_yticklabels([])
            else:
                axes.set_ylabel("compliance of the tip, nm/N")
        poses = count_of(shares.poses, "measured pose")
        heading(
            figure,
            "Which link takes what share of the compliance?",
            f"mean over {poses}; last bars: the model's sum and what was measured along that direction, with "
            f"{DEVIATION} of its stiffness, {MINUS_IS_SOFTER}",
        )
        return figure


def _measured_over_modelled(comparison: Comparison, rows: NDArray[np.bool_]) -> float:
    """Mean measured compliance over the modelled one; nan without readings along it."""
    if not rows.any():
        return float("nan")
    return float(np.mean(1.0 / comparison.data.stiffness[rows]) / np.mean(np.exp(-comparison.log_model[rows])))


def stiffness_deviation_percent(compliance_ratio: float) -> float:
    """Of a ratio of compliances, measured over modelled: (measured - modelled) / modelled of the stiffness, %."""
    return 100.0 * (1.0 / compliance_ratio - 1.0)


def _waterfall(axes: Axes, parts: FloatArray, links: tuple[str, ...], ratio: float) -> None:
    total = float(parts.sum())
    below = np.concatenate([[0.0], np.cumsum(parts)])
    colours = [LINKS[i % 2] if name.startswith("strut ") else EFFECT for i, name in enumerate(links)]
    names = [name.removeprefix("strut ").replace("_", " ") for name in links]
    for i, (size, colour) in enumerate(zip(parts, colours, strict=True)):
        axes.bar(i, size, 0.8, bottom=below[i], color=colour)
        axes.plot([i + 0.4, i + 1.4], [below[i + 1]] * 2, color=MUTED, lw=0.7)
        axes.text(i, below[i + 1] + 0.012 * total, f"{100 * size / total:.0f} %", ha="center", va="bottom", fontsize=8)
    place = len(parts)
    axes.bar(place, total, 0.8, color=INK)
    names.append("model")
    if np.isfinite(ratio):
        axes.bar(place + 1, total * ratio, 0.8, color="white", edgecolor=INK, hatch="////", linewidth=1.0)
        off = f"stiffness\n{stiffness_deviation_percent(ratio):+.0f} %"
        axes.text(
            place + 1, total * (ratio + 0.012), off, ha="center", va="bottom", fontsize=8.5,
            weight="bold", zorder=4, bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"},
        )  # fmt: skip
        names.append("measured")
    axes.set_xticks(range(len(names)), [shortened(plain(name), 22) for name in names], fontsize=8.5)
    for label, name in zip(axes.get_xticklabels(), names, strict=True):
        if len(name) > 2:
            label.set(rotation=35, ha="right", rotation_mode="anchor")
    axes.grid(visible=False, axis="x")
    axes.annotate(
        "strut", (2.5, 0.0), xycoords=("data", "axes fraction"), xytext=(0, -19), textcoords="offset points",
        ha="center", va="top", fontsize=8.5, color=MUTED,
    )  # fmt: skip
