"""Pictures of a case study: the path in its regions, mean and range over the height."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from toolpath_stiff.documents import Document, number
from toolpath_stiff.placement.case_study import CaseStudy
from toolpath_stiff.report.colours import BLUE, INK, MUTED, ORANGE, STIFFNESS
from toolpath_stiff.report.pictures.style import Look, colour_scale, in_thousands, new_figure, panel
from toolpath_stiff.report.words import counted
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

MOST_PANELS = 3
ABOVE, LEAST_ASPECT = 0.2, 0.6  # of a path of one's own: room for words above it; a panel's height over its width
BESIDE, PANEL = 1.3, 5.9  # inches: the scale of colours, the width of a panel


def regions(study: CaseStudy) -> Figure:
    """The regions, one panel per height, each path coloured by its stiffness, mean (range) beside it."""
    shown_heights = _drawn_heights(study)
    # Without plunges, which would stretch the colour scale; the packaged square has none.
    shown = [a.headline if study.is_own else a.counted for a in study.regions.values()]
    stiffness = [
        n_per_mm_from_n_per_m(a.at.stiffness[rows]) for a, rows in zip(study.regions.values(), shown, strict=True)
    ]
    ends = min(float(s.min()) for s in stiffness), max(float(s.max()) for s in stiffness)
    (left, right), (bottom, top) = _frame(study)
    right_of = BESIDE if study.is_own else 1.0  # inches for the scale of colours
    width = 13.2 + right_of + (PANEL + 0.35) * (len(shown_heights) - 2)
    tall = PANEL * (top - bottom) / (right - left)  # as high as its scale asks for
    note = f"{study.summary['program']} on {study.summary['machine']}"
    note += _left_out(study, shown_heights) if study.is_own else "; path and regions are ours, as Figure 10"
    title = f"One path in {counted(len(study.regions), 'region')}: mean (range) of stiffness, N/mm"
    figure = new_figure(width, tall + 1.65, title, note)
    for column, height in enumerate(shown_heights):
        axes = panel(figure, 0.75 + (PANEL + 0.35) * column, 0.6, PANEL, tall)
        for row in study.summary["regions"]:
            if row["z_mm"] == height:
                drawn = _path(axes, study, row, ends)
        axes.set(
            title=f"z = {height:g} mm",
            xlim=(left, right),
            ylim=(bottom, top),
            xlabel="X mm",
            ylabel="" if column else "Y mm",
        )
        axes.tick_params(labelleft=not column)
        axes.plot(0, 0, "+", color=MUTED, ms=10)
    colour_scale(drawn, panel(figure, width - right_of, 0.6, 0.18, tall), "tangential stiffness, N/mm")
    return figure


def _drawn_heights(study: CaseStudy) -> list[float]:
    heights = sorted({float(row["z_mm"]) for row in study.summary["regions"]})
    return heights if len(heights) <= MOST_PANELS else [heights[0], heights[-1]]


def _left_out(study: CaseStudy, drawn: list[float]) -> str:
    hidden = sum(row["z_mm"] not in drawn for row in study.summary["regions"])
    return f"; {hidden} regions at heights between are not drawn" if hidden else ""


def _frame(study: CaseStudy) -> tuple[tuple[float, float], tuple[float, float]]:
    points = [mm_from_m(a.samples.position[a.counted, :2]) for a in study.regions.values()]
    points.append(np.zeros((1, 2)))
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    pad = 0.08 * float((high - low).max())
    if study.is_own:  # room for the words above each path, and for the scale of colours
        high[1] += ABOVE * float((high - low).max())
        flat = max(0.0, LEAST_ASPECT * float(high[0] - low[0]) - float(high[1] - low[1]))
        low[1], high[1] = low[1] - 0.5 * flat, high[1] + 0.5 * flat
    return (float(low[0]) - pad, float(high[0]) + pad), (float(low[1]) - pad, float(high[1]) + pad)


def _path(axes: Axes, study: CaseStudy, row: Document, ends: tuple[float, float]) -> LineCollection:
    analysis = study.regions[str(row["region"])]
    rows = np.flatnonzero(analysis.counted)
    together = np.diff(rows) == 1  # draw no line across the rapids between two cuts
    points = mm_from_m(analysis.samples.position[rows, :2])
    values = n_per_mm_from_n_per_m(analysis.at.stiffness[rows])
    segments = np.stack([points[:-1], points[1:]], axis=1)[together]
    lines = LineCollection(list(segments), cmap=STIFFNESS, linewidths=5, capstyle="round")
    lines.set_array(0.5 * (values[:-1] + values[1:])[together])
    lines.set_clim(*ends)
    axes.add_collection(lines)
    text = f"region {row['region']}\n{number(float(row['mean_N_per_mm']))}\n({number(float(row['range_N_per_mm']))})"
    middle = 0.5 * float(points[:, 0].min() + points[:, 0].max())
    style: Look = {"ha": "center", "color": INK, "fontsize": 11}
    if study.is_own:
        place = (middle, float(points[:, 1].max()))
        axes.annotate(text, place, xytext=(0, 6), textcoords="offset points", va="bottom", **style)
    else:
        axes.text(float(row["x_mm"]), float(row["y_mm"]), text, va="center", **style)
    return lines


def heights(study: CaseStudy) -> Figure:
    """Mean and range of the path over its height, with their turning points marked."""
    rows = study.summary["heights"]
    z = [row["z_mm"] for row in rows]
    turns = study.summary["limits_of_the_conclusions"]
    title = "Mean and range over z" if study.is_own else "Mean and range rise with z, until they turn over"
    figure = new_figure(10.0, 5.6, title)
    axes = panel(figure, 0.9, 0.67, 8.2, 3.8)
    mean = [row["mean_N_per_mm"] for row in rows]
    axes.fill_between(
        z, [row["min_N_per_mm"] for row in rows], [row["max_N_per_mm"] for row in rows], color=BLUE, alpha=0.12,
        label="from weakest to stiffest sample", lw=0,
    )  # fmt: skip
    axes.plot(z, mean, color=BLUE, lw=2.2, label="mean")
    axes.set_xlabel("z of the path, mm")
    axes.set_ylabel("stiffness, N/mm", color=BLUE)
    other = axes.twinx()
    other.grid(visible=False)
    spread = [row["range_N_per_mm"] for row in rows]
    other.plot(z, spread, color=ORANGE, lw=2.2, label="range (right scale)")
    other.set_ylabel("range, N/mm", color=ORANGE)
    other.set_ylim(0, 1.25 * max(spread))
    in_thousands(axes.yaxis, other.yaxis)
    for scale, key, values in ((axes, "largest_mean_at_z_mm", mean), (other, "largest_range_at_z_mm", spread)):
        scale.plot(turns[key], max(values), "o", mfc="white", mec=INK, mew=1.6, ms=9)
        scale.annotate(
            f"z = {turns[key]:g} mm", (turns[key], max(values)), xytext=(0, 12), textcoords="offset points",
            ha="center", color=INK,
        )  # fmt: skip
    handles = [*axes.get_legend_handles_labels()[0], *other.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.08, 0.89), ncol=3, frameon=False)
    return figure


PICTURES = {"regions.png": regions, "heights.png": heights}
