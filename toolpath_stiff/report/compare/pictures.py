"""Pictures of a comparison: measured against modelled, residuals in measuring order, by plane and direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions, planes
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.figure import FAINT, INK, MUTED, UNREACHABLE_RED, WITHIN, drawn, house_style, new_figure
from toolpath_stiff.report.residuals import BAND, DIRECTION_COLOURS, RESIDUAL_MAP
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, plain, shortened
from toolpath_stiff.units import n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from toolpath_stiff.comparison.compare import Comparison


MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


MOST_CHANGES = 12  # of set-up or file that are marked


WIDTH = 14.0  # inches


OPAQUEST = 1.8  # times the largest residual would be drawn opaque: figures stay legible on it


SIDES = 2.0  # standard deviations of the bars and bands: 95 %


RESIDUAL_AXIS = f"{DEVIATION}, %; {MINUS_IS_SOFTER}"


def heading(figure: Figure, question: str, remark: str) -> None:
    """What the picture answers, and how it is read."""
    width, height = figure.get_size_inches()
    figure.text(0.3 / width, 1.0 - 0.4 / height, question, size=14, weight="bold")
    figure.text(0.3 / width, 1.0 - 0.66 / height, remark, size=9.5, color=MUTED)


def near_rows(comparison: Comparison) -> NDArray[np.bool_]:
    """(n,) readings that are not far off."""
    near = np.ones(len(comparison.residual), dtype=bool)
    near[[reading.reading - 1 for reading in comparison.summary.outliers]] = False
    return near


def count_of(count: float, thing: str) -> str:
    """So many of a thing."""
    return f"{count:.0f} {thing}{'' if count == 1 else 's'}"


def markers(setup: NDArray[np.str_]) -> dict[str, str]:
    """Set-up -> marker; with many, markers come again."""
    return {name: MARKERS[i % len(MARKERS)] for i, name in enumerate(dict.fromkeys(setup.tolist()))}


@drawn
def measured_modelled_png(comparison: Comparison) -> Figure:
    """PNG: measured against modelled stiffness, log-log, colour a direction, marker a set-up, with the 10 % band."""
    data = comparison.data
    along, shapes = directions(data), markers(data.setup)
    modelled = n_per_mm_from_n_per_m(np.exp(comparison.log_model))
    measured = n_per_mm_from_n_per_m(data.stiffness)
    spread = SIDES * comparison.scatter
    bars = np.stack([measured * -np.expm1(-spread), measured * np.expm1(spread)])
    low = 0.9 * float(min(modelled.min(), (measured - bars[0]).min()))
    high = 1.1 * float(max(modelled.max(), (measured + bars[1]).max()))
    many = len(data) > 100
    from matplotlib.colors import to_rgb

    with house_style():
        figure = new_figure(WIDTH, 7.3)
        axes = figure.add_axes((0.95 / WIDTH, 0.65 / 7.3, 5.6 / WIDTH, 5.6 / 7.3))
        beside = figure.add_axes((7.75 / WIDTH, 0.65 / 7.3, 5.95 / WIDTH, 5.6 / 7.3))
        line = np.array([low, high])
        axes.fill_between(line, (1 - BAND) * line, (1 + BAND) * line, color=WITHIN, zorder=0, label="within 10 %")
        axes.plot(line, line, color=MUTED, lw=1.0, zorder=1)
        for axis, colour in DIRECTION_COLOURS.items():
            for setup, marker in shapes.items():
                rows = (along == axis) & (data.setup == setup)
                if rows.any():
                    axes.errorbar(
                        modelled[rows], measured[rows], yerr=bars[:, rows], fmt=marker, ms=4.0 if many else 6.5,
                        color=colour, ecolor=(*to_rgb(colour), 0.35), elinewidth=0.7 if many else 1.1, mec="white",
                        mew=0.5, zorder=3,
                    )  # fmt: skip
        _log_axes(axes, low, high)
        _legend(axes, comparison, along, shapes)
        _residuals(beside, comparison, modelled, along, shapes)
        name = comparison.noises[-1].name
        heading(
            figure,
            "How wrong is the model, biased or scattered?",
            f"as given; below the line: softer than modelled; bars: {SIDES:g} standard deviations of scatter "
            f"({'the high guess' if name == 'high' else f'noise {name}'})",
        )
        return figure


def _log_axes(axes: Axes, low: float, high: float) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    for axis in (axes.xaxis, axes.yaxis):
        _log_axis(axis, low, high)
    axes.set_aspect("equal")
    axes.set_xlabel("modelled stiffness, N/mm")
    axes.set_ylabel("measured stiffness, N/mm")


def _log_axis(axis: Axis, low: float, high: float) -> None:
    """Round figures along a logarithmic axis, not so many that they touch."""
    from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator

    steps = [1, 2, 5] if high / low > 12.0 else [1, 1.5, 2, 3, 5, 7]
    axis.set_major_locator(
        FixedLocator([s * 10.0**e for e in range(2, 8) for s in steps if low <= s * 10.0**e <= high])
    )
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(lambda value, _: number(value))


def _residuals(
    axes: Axes, comparison: Comparison, modelled: FloatArray, along: NDArray[np.str_], shapes: dict[str, str]
) -> None:
    """The same readings as residuals: what is within the line's width beside this."""
    residual = deviation_percent(comparison.residual)
    axes.axhspan(-100.0 * BAND, 100.0 * BAND, color=WITHIN, lw=0, zorder=0)
    axes.axhline(0.0, color=MUTED, lw=1.0, zorder=1)
    for axis, colour in DIRECTION_COLOURS.items():
        rows = along == axis
        if not rows.any():
            continue
        for setup, marker in shapes.items():
            chosen = rows & (comparison.data.setup == setup)
            axes.plot(
                modelled[chosen], residual[chosen], marker, color=colour, ms=4.0 if len(residual) > 100 else 6.5,
                mec="white", mew=0.5, zorder=3,
            )  # fmt: skip
        ends = [float(modelled[rows].min()), float(modelled[rows].max())]
        axes.plot(ends, [float(np.mean(residual[rows]))] * 2, color=colour, lw=1.6, ls="--", zorder=2)
    axes.set_xscale("log")
    _log_axis(axes.xaxis, *axes.get_xlim())
    axes.set_xlabel("modelled stiffness, N/mm")
    axes.set_ylabel(RESIDUAL_AXIS)
    axes.set_title("the difference; dashed: mean of a direction", fontsize=10)


def _legend(axes: Axes, comparison: Comparison, along: NDArray[np.str_], shapes: dict[str, str]) -> None:
    """Directions with their mean error; set-ups if there are several."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys: list[Line2D | Patch] = []
    for axis, colour in DIRECTION_COLOURS.items():
        if (along == axis).any():
            errors = comparison.summary.by_direction[axis]
            mean, bias = errors.mean_abs_error_percent, errors.bias_percent
            text = (
                f"{axis}: mean error {mean:.1f} %, {abs(bias):.1f} % {'softer' if bias < 0 else 'stiffer'} on balance"
            )
            keys.append(Line2D([], [], marker="o", ls="", color=colour, label=text))
    if len(shapes) > 1:
        for setup, marker in list(shapes.items())[: len(MARKERS)]:
            name = shortened(plain(setup) or "(no name)", 30)
            keys.append(Line2D([], [], marker=marker, ls="", color=MUTED, label=f"set-up {name}"))
    keys.append(Patch(color=WITHIN, label="within 10 %"))
    axes.legend(handles=keys, loc="upper left", frameon=True, framealpha=0.9, edgecolor="none", fontsize=9)


@drawn
def strips_png(comparison: Comparison) -> Figure:
    """PNG: residuals in measuring order, one strip a direction, changes of set-up and file marked."""
    data, residual = comparison.data, deviation_percent(comparison.residual)
    along, shapes = directions(data), markers(data.setup)
    present = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    order = np.arange(1, len(data) + 1)
    edges = np.concatenate(
        [residual, deviation_percent(-SIDES * comparison.scatter), deviation_percent(SIDES * comparison.scatter)]
    )
    margin = 0.12 * float(np.ptp(edges))
    with house_style():
        height = 1.3 + 1.9 * len(present)
        figure = new_figure(WIDTH, height)
        for i, axis in enumerate(present):
            axes = figure.add_axes((0.065, (0.55 + 1.9 * (len(present) - 1 - i)) / height, 0.92, 1.65 / height))
            rows = along == axis
            spread = SIDES * comparison.scatter[rows]
            axes.fill_between(
                order[rows],
                deviation_percent(-spread),
                deviation_percent(spread),
                color=WITHIN,
                step="mid",
                lw=0,
                zorder=0,
            )
            axes.axhline(0.0, color=MUTED, lw=0.9, zorder=1)
            axes.vlines(order[rows], 0.0, residual[rows], color=DIRECTION_COLOURS[axis], lw=0.8, alpha=0.5, zorder=2)
            for setup, marker in shapes.items():
                chosen = rows & (data.setup == setup)
                axes.plot(
                    order[chosen], residual[chosen], marker, color=DIRECTION_COLOURS[axis], ms=5, mec="white", mew=0.5,
                    zorder=3,
                )  # fmt: skip
            _changes(axes, data.setup, data.file, i == 0)
            axes.set_xlim(0.0, len(data) + 1.0)
            axes.set_ylim(edges.min() - margin, edges.max() + margin)
            axes.set_ylabel(f"{axis}, %", weight="bold", color=DIRECTION_COLOURS[axis])
            _name_far_off(axes, comparison, axis, residual)
            if i < len(present) - 1:
                axes.set_xticklabels([])
            else:
                axes.set_xlabel("reading, in the order of the file")
        heading(
            figure,
            "Drift, a bad clamping, one bad reading?",
            f"{RESIDUAL_AXIS}, in measuring order; grey: {SIDES:g} standard deviations of scatter; "
            "dashed: another set-up or file",
        )
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
            axes.annotate(
                text, (start + 0.6, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -3),
                textcoords="offset points", va="top", fontsize=8, color=MUTED,
            )  # fmt: skip


def _name_far_off(axes: Axes, comparison: Comparison, axis: str, residual: FloatArray) -> None:
    """File lines of the readings that are far off."""
    for far in comparison.summary.outliers[:12]:
        if far.direction != axis:
            continue
        i = far.reading - 1
        axes.plot(i + 1, residual[i], "o", ms=10, mfc="none", mec=UNREACHABLE_RED, mew=1.4, zorder=4)
        axes.annotate(
            f"line {far.line}", (i + 1, residual[i]), xytext=(8, 0), textcoords="offset points", va="center",
            fontsize=8, color=UNREACHABLE_RED, zorder=5,
        )  # fmt: skip


@drawn
def planes_png(comparison: Comparison) -> Figure:
    """PNG: mean residual by plane and direction, a signed percentage a cell with its standard error."""
    data = comparison.data
    along, where = directions(data), planes(data)
    columns = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    columns += ["all"] if len(columns) > 1 else []
    rows = [*reversed(comparison.summary.by_plane)]
    rows += ["all"] if len(rows) > 1 else []
    near = near_rows(comparison)
    cells = np.full((len(rows), len(columns), 3), np.nan)
    for i, plane in enumerate(rows):
        for j, axis in enumerate(columns):
            chosen = near & ((where == plane) | (plane == "all")) & ((along == axis) | (axis == "all"))
            if chosen.any():
                weights = chosen / chosen.sum()
                error = 100.0 * float(np.sqrt(comparison.variance(weights)))
                cells[i, j] = deviation_percent(weights @ comparison.residual), error, chosen.sum()
    from matplotlib import colormaps

    limit = max(float(np.nanmax(np.abs(cells[..., 0]), initial=0.0, where=np.isfinite(cells[..., 0]))), 1.0)
    with house_style():
        width, height = WIDTH, 1.5 + 0.85 * len(rows)
        figure = new_figure(width, height)
        axes = figure.add_axes((2.2 / width, 0.25 / height, (width - 2.5) / width, 0.85 * len(rows) / height))
        # Red or blue, the more opaque the further from zero: on a dark page a cell near zero is dark.
        colours = colormaps[RESIDUAL_MAP](np.where(np.nan_to_num(cells[..., 0]) < 0.0, 0.12, 0.88))
        colours[..., 3] = np.abs(np.nan_to_num(cells[..., 0])) / (OPAQUEST * limit)
        axes.pcolormesh(
            np.arange(len(columns) + 1) - 0.5, np.arange(len(rows) + 1) - 0.5, colours, edgecolors="white", lw=3
        )
        axes.set_ylim(len(rows) - 0.5, -0.5)
        for i in range(len(rows)):
            for j in range(len(columns)):
                mean, error, count = cells[i, j]
                if np.isfinite(mean):
                    sure = abs(mean) > SIDES * error
                    axes.text(j, i - 0.1, f"{mean:+.1f} %", ha="center", va="center", fontsize=13,
                              weight="bold" if sure else "normal")  # fmt: skip
                    text = f"\u00b1 {error:.1f},  {count_of(count, 'reading')}"
                    axes.text(j, i + 0.27, text, ha="center", va="center", fontsize=8, color=INK)
        axes.set_xticks(range(len(columns)), columns, fontsize=11, weight="bold")
        axes.set_yticks(range(len(rows)), [shortened(row, 26) for row in rows], fontsize=10.5)
        axes.xaxis.tick_top()
        axes.tick_params(length=0, colors=INK)
        axes.grid(visible=False)
        for side in axes.spines.values():
            side.set_visible(False)
        heading(
            figure,
            "Z against X and Y? Upper against lower plane?",
            f"{RESIDUAL_AXIS} (red), blue: stiffer; bold: beyond {SIDES:g} standard errors"
            + ("" if near.all() else f"; without {count_of(int((~near).sum()), 'reading')} far off"),
        )
        return figure
