"""Pictures of a comparison: measured against modelled, residuals in measuring order, by plane and direction."""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import directions, planes
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.colours import DIRECTIONS, FAINT, INK, MUTED, RED, RESIDUAL, WITHIN
from toolpath_stiff.report.pictures.before_after import BAND, MAPS, maps, one_to_one, panels
from toolpath_stiff.report.pictures.load_path import load_path
from toolpath_stiff.report.pictures.style import Look, new_figure, panel, round_ticks
from toolpath_stiff.report.pictures.variables import variables
from toolpath_stiff.report.words import RESIDUAL_AXIS, counted, plain, shortened
from toolpath_stiff.units import n_per_mm_from_n_per_m

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
MOST_CHANGES = 12  # of set-up or file that are marked
WIDTH = 14.0  # inches
OPAQUEST = 1.8  # times the largest residual would be drawn opaque: figures stay legible on it
SIDE = 2.6  # inches, of a map
SIDES = 2.0  # standard deviations of the bars and bands: 95 %


def markers(setup: NDArray[np.str_]) -> dict[str, str]:
    """Set-up -> marker; with many, markers come again."""
    return {name: MARKERS[i % len(MARKERS)] for i, name in enumerate(dict.fromkeys(setup.tolist()))}


def measured_modelled(comparison: Comparison) -> Figure:
    """Measured against modelled stiffness, log-log, colour a direction, marker a set-up, with the 10 % band."""
    data = comparison.data
    along, shapes = directions(data), markers(data.setup)
    modelled = n_per_mm_from_n_per_m(np.exp(comparison.log_model))
    measured = n_per_mm_from_n_per_m(data.stiffness)
    spread = SIDES * comparison.scatter
    bars = np.stack([measured * -np.expm1(-spread), measured * np.expm1(spread)])
    low = 0.9 * float(min(modelled.min(), (measured - bars[0]).min()))
    high = 1.1 * float(max(modelled.max(), (measured + bars[1]).max()))
    size, line = (4.0, 0.7) if len(data) > 100 else (6.5, 1.1)
    name = comparison.noises[-1].name
    figure = new_figure(
        WIDTH, 7.3, "How wrong is the model, biased or scattered?",
        f"as given; below the line: softer than modelled; bars: {SIDES:g} standard deviations of scatter "
        f"({'the high guess' if name == 'high' else f'noise {name}'})",
    )  # fmt: skip
    axes = panel(figure, 0.95, 0.65, 5.6, 5.6)
    one_to_one(axes, low, high)
    axes.set_aspect("equal")
    beside = panel(figure, 7.75, 0.65, 5.95, 5.6)
    residual = deviation_percent(comparison.residual)
    beside.axhspan(-100.0 * BAND, 100.0 * BAND, color=WITHIN, lw=0, zorder=0)
    beside.axhline(0.0, color=MUTED, lw=1.0, zorder=1)
    for axis, colour in DIRECTIONS.items():
        look: Look = {"ms": size, "mec": "white", "mew": 0.5, "color": colour, "zorder": 3}
        for setup, marker in shapes.items():
            rows = (along == axis) & (data.setup == setup)
            if rows.any():
                pale = (*to_rgb(colour), 0.35)
                axes.errorbar(
                    modelled[rows], measured[rows], yerr=bars[:, rows], fmt=marker, ecolor=pale, elinewidth=line, **look
                )
                beside.plot(modelled[rows], residual[rows], marker, **look)
        if (rows := along == axis).any():
            ends = [float(modelled[rows].min()), float(modelled[rows].max())]
            beside.plot(ends, [float(np.mean(residual[rows]))] * 2, color=colour, lw=1.6, ls="--", zorder=2)
    beside.set_xscale("log")
    round_ticks(beside.xaxis, *beside.get_xlim())
    beside.set(xlabel="modelled stiffness, N/mm", ylabel=RESIDUAL_AXIS)
    beside.set_title("the difference; dashed: mean of a direction", fontsize=10)
    _legend(axes, comparison, shapes)
    return figure


def _legend(axes: Axes, comparison: Comparison, shapes: dict[str, str]) -> None:
    """Directions with their errors; set-ups if there are several."""
    errors = comparison.summary.by_direction
    texts = {
        axis: f"{axis}: mean error {of.mean_abs_error_percent:.1f} %, bias {of.bias_percent:+.1f} %"
        for axis, of in errors.items()
    }
    keys = [Line2D([], [], marker="o", ls="", color=DIRECTIONS[axis], label=text) for axis, text in texts.items()]
    for setup, marker in list(shapes.items())[: len(MARKERS)] if len(shapes) > 1 else []:
        name = shortened(plain(setup) or "(no name)", 30)
        keys.append(Line2D([], [], marker=marker, ls="", color=MUTED, label=f"set-up {name}"))
    axes.legend(handles=keys, loc="upper left", framealpha=0.9, edgecolor="none", fontsize=9, title="grey: within 10 %")


def strips(comparison: Comparison) -> Figure:
    """Residuals in measuring order, one strip a direction, changes of set-up and file marked."""
    data, residual = comparison.data, deviation_percent(comparison.residual)
    along, shapes = directions(data), markers(data.setup)
    present = [axis for axis in DIRECTIONS if (along == axis).any()]
    order = np.arange(1, len(data) + 1)
    scatter = [deviation_percent(side * comparison.scatter) for side in (-SIDES, SIDES)]
    edges = np.concatenate([residual, *scatter])
    margin = 0.12 * float(np.ptp(edges))
    figure = new_figure(
        WIDTH, 1.3 + 1.9 * len(present), "Drift, a bad clamping, one bad reading?",
        f"{RESIDUAL_AXIS}, in measuring order; grey: {SIDES:g} standard deviations of scatter; "
        "dashed: another set-up or file",
    )  # fmt: skip
    for i, axis in enumerate(present):
        axes = panel(figure, 0.065 * WIDTH, 0.55 + 1.9 * (len(present) - 1 - i), 0.92 * WIDTH, 1.65)
        rows = along == axis
        low, high = (end[rows] for end in scatter)
        axes.fill_between(order[rows], low, high, color=WITHIN, step="mid", lw=0, zorder=0)
        axes.axhline(0.0, color=MUTED, lw=0.9, zorder=1)
        axes.vlines(order[rows], 0.0, residual[rows], color=DIRECTIONS[axis], lw=0.8, alpha=0.5, zorder=2)
        look: Look = {"color": DIRECTIONS[axis], "ms": 5, "mec": "white", "mew": 0.5, "zorder": 3}
        for setup, marker in shapes.items():
            chosen = rows & (data.setup == setup)
            axes.plot(order[chosen], residual[chosen], marker, **look)
        _changes(axes, data.setup, data.file, i == 0)
        axes.set(xlim=(0.0, len(data) + 1.0), ylim=(edges.min() - margin, edges.max() + margin))
        axes.set_ylabel(f"{axis}, %", weight="bold", color=DIRECTIONS[axis])
        far = np.array(
            [reading.reading for reading in comparison.summary.outliers if reading.direction == axis], dtype=int
        )
        axes.plot(far, residual[far - 1], "o", ms=10, mfc="none", mec=RED, mew=1.4, zorder=4)
        last = i == len(present) - 1
        axes.tick_params(labelbottom=last)
        axes.set_xlabel("reading, in the order of the file" if last else "")
    return figure


def _changes(axes: Axes, setup: NDArray[np.str_], file: NDArray[np.str_], named: bool) -> None:
    """Dashed lines where set-up or file changes; named above the first strip unless there are many."""
    changed = np.flatnonzero((setup[1:] != setup[:-1]) | (file[1:] != file[:-1])) + 1
    starts = [0, *changed.tolist()]
    for start in changed.tolist() if len(changed) < MOST_CHANGES else []:
        axes.axvline(start + 0.5, color=FAINT, lw=0.8, ls="--", zorder=0)
    if named and 1 < len(starts) <= MOST_CHANGES:
        for start in starts:
            text = shortened(plain(str(setup[start])) or "(no name)", 18)
            look: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "fontsize": 8}
            axes.annotate(text, (start + 0.6, 1.0), xytext=(2, -3), va="top", color=MUTED, **look)


def _near_rows(comparison: Comparison) -> NDArray[np.bool_]:
    """(n,) readings that are not far off."""
    near = np.ones(len(comparison.residual), dtype=bool)
    near[[reading.reading - 1 for reading in comparison.summary.outliers]] = False
    return near


def by_plane(comparison: Comparison) -> Figure:
    """Mean residual by plane and direction, a signed percentage a cell with its standard error."""
    data, near = comparison.data, _near_rows(comparison)
    along, where = directions(data), planes(data)
    columns = [axis for axis in DIRECTIONS if (along == axis).any()]
    columns += ["all"] if len(columns) > 1 else []
    rows = [*reversed(comparison.summary.by_plane)]
    rows += ["all"] if len(rows) > 1 else []
    cells = np.full((len(rows), len(columns), 3), np.nan)
    for i, j in np.ndindex(cells.shape[:2]):
        chosen = near & ((where == rows[i]) | (rows[i] == "all")) & ((along == columns[j]) | (columns[j] == "all"))
        if chosen.any():
            weights = chosen / chosen.sum()
            error = 100.0 * float(np.sqrt(comparison.variance(weights)))
            cells[i, j] = deviation_percent(weights @ comparison.residual), error, chosen.sum()
    height, left_out = 1.5 + 0.85 * len(rows), int((~near).sum())
    figure = new_figure(
        WIDTH, height, "Z against X and Y? Upper against lower plane?",
        f"{RESIDUAL_AXIS} (red), blue: stiffer; bold: beyond {SIDES:g} standard errors"
        + (f"; without {counted(left_out, 'reading')} far off" if left_out else ""),
    )  # fmt: skip
    axes = panel(figure, 2.2, 0.25, WIDTH - 2.5, 0.85 * len(rows))
    means = np.nan_to_num(cells[..., 0])
    # Red or blue, the more opaque the further from zero: on a dark page a cell near zero is dark.
    colours = colormaps[RESIDUAL](np.where(means < 0.0, 0.12, 0.88))
    colours[..., 3] = np.abs(means) / (OPAQUEST * max(float(np.abs(means).max()), 1.0))
    edges = (np.arange(count + 1) - 0.5 for count in (len(columns), len(rows)))
    axes.pcolormesh(*edges, colours, edgecolors="white", lw=3)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    for (i, j), mean in np.ndenumerate(cells[..., 0]):
        if np.isfinite(mean):
            weight = "bold" if abs(mean) > SIDES * cells[i, j, 1] else "normal"
            axes.text(j, i - 0.1, f"{mean:+.1f} %", ha="center", va="center", fontsize=13, weight=weight)
            text = f"\u00b1 {cells[i, j, 1]:.1f},  {counted(cells[i, j, 2], 'reading')}"
            axes.text(j, i + 0.27, text, ha="center", va="center", fontsize=8)
    axes.set_xticks(range(len(columns)), columns, fontsize=11, weight="bold")
    axes.set_yticks(range(len(rows)), [shortened(row, 26) for row in rows], fontsize=10.5)
    axes.xaxis.tick_top()
    axes.tick_params(length=0, colors=INK)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    return figure


def where_it_fails(comparison: Comparison) -> Figure:
    """The residuals seen from above, plane by plane, direction by direction."""
    rows, columns = panels(comparison.data)
    width, height = max(1.9 + SIDE * len(columns), 11.0), 1.4 + SIDE * len(rows)
    question = "Where does the model fail? Alike all around, or on one side?"
    figure = new_figure(width, height, question, f"{RESIDUAL_AXIS}; {MAPS}")
    maps(figure, comparison.data, comparison.residual, (0.95, height - 1.2, SIDE))
    return figure


PICTURES = {
    "measured_modelled.png": measured_modelled,
    "planes.png": by_plane,
    "machine.png": where_it_fails,
    "strips.png": strips,
    "variables.png": variables,
    "load_path.png": load_path,
}
