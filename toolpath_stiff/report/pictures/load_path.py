"""The load path as a waterfall: compliance link by link, and what the measurements add or take."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.report.colours import BLUE, DIRECTIONS, INK, LIGHT_BLUE, MUTED, ORANGE
from toolpath_stiff.report.pictures.style import Look, new_figure, panel
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, counted, plain, shortened

NM_PER_N = 1e9
LONG_NAME = 10  # letters of a link from which its name, turned, needs more room below
LINKS = (BLUE, LIGHT_BLUE)  # struts, alternating


def load_path(comparison: Comparison) -> Figure:
    """Compliance of the tip along X, Y, Z, link by link, and what the measurements add or take."""
    links = tuple(comparison.shares)
    compliance = np.array([*comparison.shares.values()]).T * NM_PER_N
    along = directions(comparison.data)
    ratio = np.array([_measured_over_modelled(comparison, along == axis) for axis in "XYZ"])
    below = 0.95 if max(len(name) for name in links) <= LONG_NAME else 1.45
    poses = counted(len(comparison.data.poses[0]), "measured pose")
    figure = new_figure(
        13.0, 4.25 + below, "Which link takes what share of the compliance?", f"mean over {poses}; last bars: the "
        f"model's sum and what was measured along that direction, with {DEVIATION} of its stiffness, {MINUS_IS_SOFTER}",
    )  # fmt: skip
    top = 1.18 * float(np.nanmax(compliance.sum(axis=1) * np.fmax(ratio, 1.0)))
    for i, axis in enumerate("XYZ"):
        axes = panel(figure, 0.75 + 4.1 * i, below, 3.8, 3.05)
        _waterfall(axes, compliance[i], links, float(ratio[i]))
        axes.set_ylim(0.0, top)
        axes.set_title(f"{axis}: {compliance[i].sum():.1f} nm/N modelled", color=DIRECTIONS[axis])
        axes.tick_params(labelleft=not i)
        axes.set_ylabel("" if i else "compliance of the tip, nm/N")
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
    colours = [LINKS[i % 2] if name.startswith("strut ") else ORANGE for i, name in enumerate(links)]
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
        ground = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"}
        style: Look = {"ha": "center", "va": "bottom", "fontsize": 8.5, "weight": "bold", "bbox": ground}
        axes.text(place + 1, total * (ratio + 0.012), off, zorder=4, **style)
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
