"""The results of a case study, the paper's or one's own: text, files and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.files import Content
from toolpath_stiff.placement.case_study import FIGURES, HIGH_MM, LOW_MM, REGION_COLUMNS, CaseStudy
from toolpath_stiff.report.axes import colour_scale, heading, in_thousands
from toolpath_stiff.report.figure import BLUE, COLOUR_MAP, INK, MUTED, SECOND_ORANGE, new_figure, picture
from toolpath_stiff.stiffness.model import machine_words
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure


MOST_PANELS = 3
ABOVE, LEAST_ASPECT = 0.2, 0.6  # of a path of one's own: room for words above it; a panel's height over its width
BESIDE = 1.3  # inches
HOLDS = {True: "yes", False: "NO", None: "not tested"}
# As in the paper's Figure 10, mean and range first.
COLUMNS = ("region", *REGION_COLUMNS, *FIGURES)
NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six"}


@picture
def regions_picture(study: CaseStudy) -> Figure:
    """PNG of the regions, one panel a height, each path coloured by its stiffness, mean (range) beside it."""
    heights = _drawn_heights(study)
    # Plunges would stretch the scale of colours; the packaged square has none.
    shown = [a.headline if study.is_own else a.counted for a in study.regions.values()]
    stiffness = [
        n_per_mm_from_n_per_m(a.at.stiffness[rows]) for a, rows in zip(study.regions.values(), shown, strict=True)
    ]
    low, high = min(float(s.min()) for s in stiffness), max(float(s.max()) for s in stiffness)
    (left, right), (bottom, top) = _frame(study)
    panel = 5.9  # inches wide; as high as its scale asks for
    right_of = BESIDE if study.is_own else 1.0  # inches for the scale of colours
    width = 13.2 + right_of + (panel + 0.35) * (len(heights) - 2)
    tall = panel * (top - bottom) / (right - left)
    above = tall + 1.65
    figure = new_figure(width, above)
    drawn = None
    for column, height in enumerate(heights):
        place = ((0.75 + (panel + 0.35) * column) / width, 0.6 / above, panel / width, tall / above)
        axes = figure.add_axes(place)
        for row in study.summary["regions"]:
            if row["z_mm"] == height:
                drawn = _path(axes, study, row, low, high)
        axes.set_title(f"z = {height:g} mm")
        axes.set_xlim(left, right)
        axes.set_ylim(bottom, top)
        axes.set_xlabel("X mm")
        axes.set_ylabel("" if column else "Y mm")
        axes.tick_params(labelleft=not column)
        axes.plot(0, 0, "+", color=MUTED, ms=10)
    if drawn is not None:
        box = (1.0 - right_of / width, 0.6 / above, 0.18 / width, tall / above)
        colour_scale(figure, drawn, box, "tangential stiffness, N/mm")
    count = len(study.regions)
    regions = f"{NUMBERS.get(count, count)} region{'s' if count > 1 else ''}"
    title = f"One path in {regions}: mean (range) of stiffness, N/mm"
    text = f"{study.summary['program']} on {study.summary['machine']}"
    text += _left_out(study, heights) if study.is_own else "; path and regions are ours, as Figure 10"
    heading(figure, 0.25 / width, 1.0 - 0.4 / above, title, 0.28 / above, text)
    return figure


def _drawn_heights(study: CaseStudy) -> list[float]:
    """The heights of the regions, or the lowest and the highest where there are many."""
    heights = sorted({float(row["z_mm"]) for row in study.summary["regions"]})
    return heights if len(heights) <= MOST_PANELS else [heights[0], heights[-1]]


def _left_out(study: CaseStudy, drawn: list[float]) -> str:
    hidden = sum(row["z_mm"] not in drawn for row in study.summary["regions"])
    return f"; {hidden} regions at heights between are not drawn" if hidden else ""


def _frame(study: CaseStudy) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits of X and Y in mm that hold the paths of all regions and the machine's axis, with room around them."""
    points = [mm_from_m(a.samples.position[a.counted, :2]) for a in study.regions.values()]
    points.append(np.zeros((1, 2)))
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    pad = 0.08 * float((high - low).max())
    if study.is_own:  # room for the words above each path, and for the scale of colours
        high[1] += ABOVE * float((high - low).max())
        flat = max(0.0, LEAST_ASPECT * float(high[0] - low[0]) - float(high[1] - low[1]))
        low[1], high[1] = low[1] - 0.5 * flat, high[1] + 0.5 * flat
    return (float(low[0]) - pad, float(high[0]) + pad), (float(low[1]) - pad, float(high[1]) + pad)


def _path(axes: Axes, study: CaseStudy, row: dict[str, float | str], low: float, high: float) -> LineCollection:
    from matplotlib.collections import LineCollection

    analysis = study.regions[str(row["region"])]
    rows = np.flatnonzero(analysis.counted)
    together = np.diff(rows) == 1  # no line across the rapids between two cuts
    points = mm_from_m(analysis.samples.position[rows, :2])
    values = n_per_mm_from_n_per_m(analysis.at.stiffness[rows])
    segments = np.stack([points[:-1], points[1:]], axis=1)[together]
    lines = LineCollection(list(segments), cmap=COLOUR_MAP, linewidths=5, capstyle="round")
    lines.set_array(0.5 * (values[:-1] + values[1:])[together])
    lines.set_clim(low, high)
    axes.add_collection(lines)
    text = f"region {row['region']}\n{number(float(row['mean_N_per_mm']))}\n({number(float(row['range_N_per_mm']))})"
    if study.is_own:
        middle = 0.5 * float(points[:, 0].min() + points[:, 0].max())
        axes.annotate(
            text, (middle, float(points[:, 1].max())), xytext=(0, 6), textcoords="offset points", ha="center",
            va="bottom", color=INK, fontsize=11,
        )  # fmt: skip
    else:
        axes.text(float(row["x_mm"]), float(row["y_mm"]), text, ha="center", va="center", color=INK, fontsize=11)
    return lines


@picture
def heights_picture(study: CaseStudy) -> Figure:
    """PNG of mean and range of the path over its height, where they turn over marked."""
    rows = study.summary["heights"]
    z = [row["z_mm"] for row in rows]
    turns = study.summary["limits_of_the_conclusions"]
    figure = new_figure(10.0, 5.6)
    axes = figure.add_axes((0.09, 0.12, 0.82, 0.68))
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
    other.plot(z, spread, color=SECOND_ORANGE, lw=2.2, label="range (right scale)")
    other.set_ylabel("range, N/mm", color=SECOND_ORANGE)
    other.set_ylim(0, 1.25 * max(spread))
    in_thousands(axes.yaxis, other.yaxis)
    for panel, key, values in ((axes, "largest_mean_at_z_mm", mean), (other, "largest_range_at_z_mm", spread)):
        panel.plot(turns[key], max(values), "o", mfc="white", mec=INK, mew=1.6, ms=9)
        panel.annotate(
            f"z = {turns[key]:g} mm", (turns[key], max(values)), xytext=(0, 12), textcoords="offset points",
            ha="center", color=INK,
        )  # fmt: skip
    handles = [*axes.get_legend_handles_labels()[0], *other.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.08, 0.89), ncol=3, frameon=False)
    title = "Mean and range over z" if study.is_own else "Mean and range rise with z, until they turn over"
    heading(figure, 0.09, 0.92, title)
    return figure


def text(study: CaseStudy) -> str:
    """The case study in words and numbers, Markdown."""
    summary = study.summary
    count = len(summary["regions"])
    opening = [
        f"One path ({summary['program']}, {summary['note']}) in four regions, as the paper's Figure 10: mean stiffness",
        "under a load along the motion, and in parentheses its range, N/mm.",
    ]
    if study.is_own:
        opening = [
            f"{summary['program']} in {count} region{'s' if count > 1 else ''}: mean stiffness under a load along the",
            "motion, and in parentheses its range, N/mm.",
        ]
    lines = [
        f"# Case study on {machine_words(summary)}",
        "",
        *(line for warning in summary["warnings"] for line in (f"Warning: {warning}.", "")),
        *opening,
        "",
        "| region | program zero, mm | turned | mean (range), N/mm |",
        "| --- | --- | --- | --- |",
    ]
    for row in summary["regions"]:
        place = f"{row['x_mm']:g}, {row['y_mm']:g}, {row['z_mm']:g}"
        lines.append(
            f"| {row['region']} | {place} | {row['rotation_deg']:g} deg | "
            f"{number(row['mean_N_per_mm'])} ({number(row['range_N_per_mm'])}) |"
        )
    lines += ["", "## The paper's conclusions", ""]
    for row_number, conclusion in enumerate(summary["conclusions"], 1):
        lines.append(f"{row_number}. {conclusion['statement']}: {HOLDS[conclusion['holds']]}. {conclusion['numbers']}.")
    lines += ["", "## Where they stop holding", "", *_limits_words(summary, study.is_own)]
    if study.is_own:
        return "\n".join([*lines, ""])
    lines += [
        "",
        "Non-planar cuts, of which the paper warns: the square with its height going up and down along every side.",
        "The means of two places at one height stay as close as before; it is the range that grows, several times,",
        "because the machine is twice as stiff along Z as along X and Y.",
        "",
        f"| waves, mm | means apart at z = {LOW_MM:g} mm | at z = {HIGH_MM:g} mm | ranges in regions 1 to 4, N/mm |",
        "| --- | --- | --- | --- |",
    ]
    for wave in summary["non_planar"]:
        low, high = wave["means_apart_at_one_height_percent"]
        ranges = ", ".join(number(row["range_N_per_mm"]) for row in wave["regions"])
        lines.append(f"| {wave['amplitude_mm']:g} | {low:.2f} % | {high:.2f} % | {ranges} |")
    return "\n".join([*lines, ""])


def _limits_words(summary: Mapping[str, Any], custom: bool) -> list[str]:
    limits, heights, first = summary["limits_of_the_conclusions"], summary["heights"], summary["regions"][0]
    turned = f", turned {first['rotation_deg']:g} deg," if first["rotation_deg"] else ","
    moved = f"Moved up and down at ({first['x_mm']:g}, {first['y_mm']:g}) mm{turned}"
    mean, widest = (f"{limits[f'largest_{what}_at_z_mm']:g}" for what in ("mean", "range"))
    if not custom:
        return [
            f"{moved} the same path has its largest mean at z = {mean} mm and its largest range at z = {widest} mm: "
            "beyond, both fall again."
        ]
    return [
        f"{moved} as region {first['region']}, from z = {heights[0]['z_mm']:g} to {heights[-1]['z_mm']:g} mm (where it "
        f"is within reach), the path has its largest mean at z = {mean} mm and its largest range at z = {widest} mm."
    ]


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    data = ("case_study.csv", "case_study.json", "case_study.md")
    return (*data, "regions.png", "heights.png") if plots else data


def files(study: CaseStudy, *, plots: bool = True) -> dict[str, Content]:
    """Table, summary and text of the study, and with `plots` its two pictures."""
    contents: dict[str, Content] = {
        "case_study.csv": csv_text(COLUMNS, ([str(row[key]) for key in COLUMNS] for row in study.summary["regions"])),
        "case_study.json": study.to_json(),
        "case_study.md": text(study),
    }
    if plots:
        contents |= {"regions.png": regions_picture(study), "heights.png": heights_picture(study)}
    return contents
