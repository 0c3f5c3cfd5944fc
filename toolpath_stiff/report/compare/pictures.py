"""Pictures of a comparison: measured against modelled, residuals in measuring order, by plane, on the machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.report import DEVIATION, MINUS_IS_SOFTER, number, plain, shortened
from toolpath_stiff.report.figure import (
    FAINT,
    GRID,
    INK,
    MUTED,
    PALE_RED,
    UNREACHABLE_RED,
    WITHIN,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.readings import BAND, DIRECTION_COLOURS, RESIDUAL_MAP
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m
from toolpath_stiff.updating.comparison.residuals import directions, planes
from toolpath_stiff.updating.inference.fits import deviation_percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from toolpath_stiff.updating.comparison import Comparison

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
MOST_CHANGES = 12  # of set-up or file that are marked
WIDTH = 14.0  # inches
OPAQUEST = 1.8  # times the largest residual would be drawn opaque: figures stay legible on it
SIDES = 2.0  # standard deviations of the bars and bands: 95 %
RESIDUAL_AXIS = f"{DEVIATION}, %; {MINUS_IS_SOFTER}"
Place = tuple[float, float, float, float]  # x, y, width, height
BAR, GAP = 5.0, 1.0  # points, width of a bar and space between two
TALLEST = 30.0  # points, of the largest residual
MERGED = 0.03  # of the picture's width: poses closer than this in the view share a glyph
LEFT, PANEL, WIDEST, NARROWEST = 0.8, 3.65, 15.0, 8.6  # inches: margin, a square panel, the picture


def heading(figure: Figure, question: str, remark: str) -> None:
    """What the picture answers, and how it is read."""
    width, height = figure.get_size_inches()
    figure.text(0.3 / width, 1.0 - 0.4 / height, question, size=14, weight="bold")
    figure.text(0.3 / width, 1.0 - 0.66 / height, remark, size=9.5, color=MUTED)


def near_rows(found: Comparison) -> NDArray[np.bool_]:
    """(n,) readings that are not far off."""
    near = np.ones(len(found.residual), dtype=bool)
    near[[one["reading"] - 1 for one in found.document["outliers"]]] = False
    return near


def count_of(count: float, thing: str) -> str:
    """So many of a thing."""
    return f"{count:.0f} {thing}{'' if count == 1 else 's'}"


def markers(setup: NDArray[np.str_]) -> dict[str, str]:
    """Set-up -> marker; with many, markers come again."""
    return {name: MARKERS[i % len(MARKERS)] for i, name in enumerate(dict.fromkeys(setup.tolist()))}


@drawn
def measured_modelled_png(found: Comparison) -> Figure:
    """PNG: measured against modelled stiffness, log-log, colour a direction, marker a set-up, with the 10 % band."""
    data = found.data
    along, shapes = directions(data), markers(data.setup)
    modelled = n_per_mm_from_n_per_m(np.exp(found.log_model))
    measured = n_per_mm_from_n_per_m(data.stiffness)
    spread = SIDES * found.scatter
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
        _legend(axes, found, along, shapes)
        _residuals(beside, found, modelled, along, shapes)
        name = found.noises[-1].name
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
    axes: Axes, found: Comparison, modelled: FloatArray, along: NDArray[np.str_], shapes: dict[str, str]
) -> None:
    """The same readings as residuals: what is within the line's width beside this."""
    residual = deviation_percent(found.residual)
    axes.axhspan(-100.0 * BAND, 100.0 * BAND, color=WITHIN, lw=0, zorder=0)
    axes.axhline(0.0, color=MUTED, lw=1.0, zorder=1)
    for axis, colour in DIRECTION_COLOURS.items():
        rows = along == axis
        if not rows.any():
            continue
        for setup, marker in shapes.items():
            chosen = rows & (found.data.setup == setup)
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


def _legend(axes: Axes, found: Comparison, along: NDArray[np.str_], shapes: dict[str, str]) -> None:
    """Directions with their mean error; set-ups if there are several."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys: list[Line2D | Patch] = []
    for axis, colour in DIRECTION_COLOURS.items():
        if (along == axis).any():
            figures = found.document["by_direction"][axis]
            mean, bias = figures["mean_abs_error_percent"], figures["bias_percent"]
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
def strips_png(found: Comparison) -> Figure:
    """PNG: residuals in measuring order, one strip a direction, changes of set-up and file marked."""
    data, residual = found.data, deviation_percent(found.residual)
    along, shapes = directions(data), markers(data.setup)
    present = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    order = np.arange(1, len(data) + 1)
    edges = np.concatenate(
        [residual, deviation_percent(-SIDES * found.scatter), deviation_percent(SIDES * found.scatter)]
    )
    margin = 0.12 * float(np.ptp(edges))
    with house_style():
        height = 1.3 + 1.9 * len(present)
        figure = new_figure(WIDTH, height)
        for i, axis in enumerate(present):
            axes = figure.add_axes((0.065, (0.55 + 1.9 * (len(present) - 1 - i)) / height, 0.92, 1.65 / height))
            rows = along == axis
            spread = SIDES * found.scatter[rows]
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
            _name_far_off(axes, found, axis, residual)
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


def _name_far_off(axes: Axes, found: Comparison, axis: str, residual: FloatArray) -> None:
    """File lines of the readings that are far off."""
    for one in found.document["outliers"][:12]:
        if one["direction"] != axis:
            continue
        i = one["reading"] - 1
        axes.plot(i + 1, residual[i], "o", ms=10, mfc="none", mec=UNREACHABLE_RED, mew=1.4, zorder=4)
        axes.annotate(
            f"line {one['line']}", (i + 1, residual[i]), xytext=(8, 0), textcoords="offset points", va="center",
            fontsize=8, color=UNREACHABLE_RED, zorder=5,
        )  # fmt: skip


@drawn
def planes_png(found: Comparison) -> Figure:
    """PNG: mean residual by plane and direction, a signed percentage a cell with its standard error."""
    data = found.data
    along, where = directions(data), planes(data)
    columns = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    columns += ["all"] if len(columns) > 1 else []
    rows = [*reversed(found.document["by_plane"])]
    rows += ["all"] if len(rows) > 1 else []
    near = near_rows(found)
    cells = np.full((len(rows), len(columns), 3), np.nan)
    for i, plane in enumerate(rows):
        for j, axis in enumerate(columns):
            chosen = near & ((where == plane) | (plane == "all")) & ((along == axis) | (axis == "all"))
            if chosen.any():
                weights = chosen / chosen.sum()
                error = 100.0 * float(np.sqrt(found.variance(weights)))
                cells[i, j] = deviation_percent(weights @ found.residual), error, chosen.sum()
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


@drawn
def machine_png(found: Comparison) -> Figure:
    """PNG: glyphs on the machine from above, plane by plane, and from the front and the right."""
    data = found.data
    where = planes(data)
    order = [*reversed(found.document["by_plane"])]
    along = directions(data)
    axes_shown = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    largest = _largest(found)
    with house_style():
        pitch = min(PANEL, WIDEST / (len(order) + 1))
        width = max(LEFT + pitch * (len(order) + 1), NARROWEST)
        pitch = (width - LEFT) / (len(order) + 1)
        height = 1.55 + pitch + 4.1
        figure = new_figure(width, height)
        for i, plane in enumerate(order):
            place = (LEFT + i * pitch, 4.75, pitch - 0.45, pitch - 0.45)
            axes = figure.add_axes(_relative(place, width, height))
            _from_above(axes, found)
            z = found.document["by_plane"][plane]["z_mm"]
            axes.set_title("from above" if len(order) == 1 else _plane_title(plane, z), fontsize=10)
            axes.set_xlabel("X mm", fontsize=9)
            if i == 0:
                axes.set_ylabel("Y mm", fontsize=9)
            _glyphs(axes, found, mm_from_m(data.position[:, :2]), where == plane, axes_shown, largest)
        place = (LEFT + len(order) * pitch, 4.75, pitch - 0.45, pitch - 0.45)
        _whole_machine(figure.add_axes(_relative(place, width, height)), found)
        half = (width - LEFT) / 2.0
        for i, across in enumerate((0, 1)):
            axes = figure.add_axes(_relative((LEFT + i * half, 0.55, half - 0.45, 3.3), width, height))
            axes.set_xlim(*mm_from_m(_margins(data.position[:, across], 0.18)))
            axes.set_ylim(*mm_from_m(_margins(data.position[:, 2], 0.26)))
            axes.tick_params(labelsize=8)
            axes.set_title(f"from the {'front' if across == 0 else 'right'}", fontsize=10)
            axes.set_xlabel(f"{'XY'[across]} mm", fontsize=9)
            if i == 0:
                axes.set_ylabel("Z mm", fontsize=9)
            flat = mm_from_m(data.position[:, [across, 2]])
            _glyphs(axes, found, flat, np.ones(len(data), dtype=bool), axes_shown, largest)
        heading(
            figure,
            "Where does the model fail? Alike all around, or on one side?",
            f"{DEVIATION}: bar down: softer than modelled, up: stiffer; the tallest is {largest:.0f} %; "
            "poses that fall together in a view: their mean",
        )
        _key(figure, axes_shown, width, height)
        return figure


def _relative(place: Place, width: float, height: float) -> Place:
    x, y, w, h = place
    return x / width, y / height, w / width, h / height


def _plane_title(plane: str, z_mm: float) -> str:
    """A plane and its height, unless its name says it."""
    return plane if "=" in plane else f"{plane}, {'mean ' if 'third' in plane else ''}z {z_mm:.0f} mm"


def _margins(values: FloatArray, share: float) -> FloatArray:
    """Range of values with a share of it on both sides, m."""
    low, high = float(values.min()), float(values.max())
    pad = share * max(high - low, 0.15)
    return np.array([low - pad, high + pad])


def _key(figure: Any, axes_shown: list[str], width: float, height: float) -> None:
    for i, axis in enumerate(axes_shown):
        x, y = (0.35 + 0.55 * i) / width, 1.0 - 0.93 / height
        figure.text(x, y, "\u25ae " + axis, color=DIRECTION_COLOURS[axis], size=11, weight="bold")


def _largest(found: Comparison) -> float:
    """Residual of the tallest bar, %: few extreme readings do not take the contrast."""
    size = np.abs(deviation_percent(found.residual))
    near = near_rows(found)
    return max(float(np.quantile(size[near] if near.any() else size, 0.98)), 0.5)


def _from_above(axes: Axes, found: Comparison) -> None:
    """The machine's axis in the middle, the directions of the frame's joints, numbered, and circles of distance."""
    from matplotlib.patches import Circle

    half = 1.36 * max(float(np.abs(found.data.position[:, :2]).max()), 0.1)
    axes.set_xlim(*mm_from_m(np.array([-half, half])))
    axes.set_ylim(*mm_from_m(np.array([-half, half])))
    axes.set_aspect("equal")
    axes.grid(visible=False)
    for share in (0.37, 0.74):
        axes.add_patch(Circle((0.0, 0.0), mm_from_m(share * half), fc="none", ec=GRID, lw=1.0, zorder=0))
    frame = found.predictor.base.machine.frame_joints[:, :2]
    azimuths = np.round(np.degrees(np.arctan2(frame[:, 1], frame[:, 0])), 1)
    for azimuth in np.unique(azimuths):
        direction = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))])
        axes.plot(*mm_from_m(np.outer(direction, [0.0, 0.8 * half])), color=GRID, lw=1.0, zorder=0)
        name = "+".join(str(i + 1) for i in np.flatnonzero(azimuths == azimuth))
        x, y = mm_from_m(0.9 * half * direction)
        axes.annotate(name, (x, y), ha="center", va="center", fontsize=7.5, color=MUTED, zorder=0.5)
    axes.plot(0.0, 0.0, "+", color=MUTED, ms=9, zorder=0.5)
    axes.tick_params(labelsize=8)


def _whole_machine(axes: Axes, found: Comparison) -> None:
    """Struts and platform with the tool at the middle of the measured poses, which are boxed, from the front."""
    from matplotlib.patches import Rectangle

    machine, position = found.predictor.base.machine, found.data.position
    low, high = position.min(axis=0), position.max(axis=0)
    tip = ((low + high) / 2.0)[None]
    joints = tip[0] + solve_struts(machine, tip).arms[0]
    for joint, vertex in zip(joints, machine.frame_joints, strict=True):
        axes.plot(*mm_from_m(np.stack([joint, vertex])[:, [0, 2]]).T, color=FAINT, lw=1.6, zorder=1)
        axes.plot(*mm_from_m(vertex[[0, 2]]), "o", color=MUTED, ms=4, zorder=2)
        axes.plot(*mm_from_m(np.stack([joint, tip[0]])[:, [0, 2]]).T, color=MUTED, lw=1.6, zorder=2)
    size = mm_from_m(np.maximum(high - low, 0.06))
    corner = mm_from_m((low + high) / 2.0) - size / 2.0
    axes.add_patch(
        Rectangle((corner[0], corner[2]), size[0], size[2], fc=PALE_RED, ec=UNREACHABLE_RED, lw=1.2, zorder=0.5)
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.tick_params(labelsize=8)
    axes.set_title("the machine, from the front", fontsize=10)
    axes.locator_params(axis="x", nbins=4)
    axes.set_xlabel("X mm; red: measured", fontsize=9)


def _glyphs(
    axes: Axes, found: Comparison, flat: FloatArray, rows: NDArray[np.bool_], axes_shown: list[str], largest: float
) -> None:
    """One glyph a place in the view (n, 2) mm."""
    from matplotlib.offsetbox import AnnotationBbox, DrawingArea
    from matplotlib.patches import Rectangle

    along = directions(found.data)
    span = abs(axes.get_xlim()[1] - axes.get_xlim()[0])
    cells = np.round(flat / (MERGED * span)).astype(int)
    wide = (BAR + GAP) * len(axes_shown)
    for cell in np.unique(cells[rows], axis=0):
        here = rows & (cells == cell).all(axis=1)
        area = DrawingArea(wide, 2.0 * TALLEST + 8.0)
        middle = TALLEST + 4.0
        area.add_artist(Rectangle((-1.0, middle - 0.5), wide + 1.0, 1.0, fc=INK, ec="none"))
        for j, axis in enumerate(axes_shown):
            chosen = here & (along == axis)
            if not chosen.any():
                continue
            size = float(deviation_percent(found.residual[chosen].mean()))
            tall = float(np.clip(size / largest, -1.15, 1.15)) * TALLEST
            area.add_artist(
                Rectangle((j * (BAR + GAP), middle), BAR, tall, fc=DIRECTION_COLOURS[axis], ec="none", alpha=0.9)
            )
        box = AnnotationBbox(area, tuple(flat[here].mean(axis=0)), frameon=False, pad=0.0, zorder=4)
        axes.add_artist(box)
