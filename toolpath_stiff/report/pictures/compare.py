"""Pictures of a comparison: measured against modelled, residuals by place and against variables outside the model."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.residuals import ReadingNames, Variable, directions
from toolpath_stiff.comparison.structure import SIGNIFICANT
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.colours import DIRECTIONS, MUTED, RED
from toolpath_stiff.report.pictures.before_after import MAPS, maps, one_to_one, panels
from toolpath_stiff.report.pictures.style import Look, new_figure, panel
from toolpath_stiff.report.words import RESIDUAL_AXIS, plain, shortened
from toolpath_stiff.units import n_per_mm_from_n_per_m

SIDE = 2.2  # inches, of a map
SIDES = 2.0  # standard deviations of the bars and bands: 95 %
ACROSS = 5  # panels in a row
LEAST_SHOWN = ACROSS  # panels of `variables`: a row, or all that are significant
PITCH = 2.15  # inches from one row of panels to the next
MOST_NAMES = 8  # levels of a label that are written out
WIDE = 7.5  # median deviations, some 5 standard deviations: readings further off stand at the edge


def measured_modelled(comparison: Comparison) -> Figure:
    """Measured against modelled stiffness, log-log, one colour a direction, with the 10 % band."""
    data = comparison.data
    along = directions(data)
    modelled = n_per_mm_from_n_per_m(np.exp(comparison.log_model))
    measured = n_per_mm_from_n_per_m(data.stiffness)
    spread = SIDES * comparison.scatter
    bars = np.stack([measured * -np.expm1(-spread), measured * np.expm1(spread)])
    low = 0.9 * float(min(modelled.min(), (measured - bars[0]).min()))
    high = 1.1 * float(max(modelled.max(), (measured + bars[1]).max()))
    size, line = (4.0, 0.7) if len(data) > 100 else (6.5, 1.1)
    name = comparison.noises[-1].name
    figure = new_figure(
        8.6, 8.7, "How wrong is the model, biased or scattered?",
        f"as given; below the line: softer than modelled; bars: {SIDES:g} standard deviations of scatter "
        f"({'the high guess' if name == 'high' else f'noise {name}'})",
    )  # fmt: skip
    axes = panel(figure, 0.95, 0.65, 7.2, 7.2)
    one_to_one(axes, low, high)
    axes.set_aspect("equal")
    for axis, colour in DIRECTIONS.items():
        look: Look = {"ms": size, "mec": "white", "mew": 0.5, "color": colour, "zorder": 3}
        if (rows := along == axis).any():
            look |= {"ecolor": (*to_rgb(colour), 0.35), "elinewidth": line}
            axes.errorbar(modelled[rows], measured[rows], yerr=bars[:, rows], fmt="o", **look)
    texts = {
        axis: f"{axis}: mean error {of.mean_abs_error_percent:.1f} %, bias {of.bias_percent:+.1f} %"
        for axis, of in comparison.summary.by_direction.items()
    }
    keys = [Line2D([], [], marker="o", ls="", color=DIRECTIONS[axis], label=text) for axis, text in texts.items()]
    axes.legend(handles=keys, loc="upper left", framealpha=0.9, edgecolor="none", fontsize=9, title="grey: within 10 %")
    return figure


def where_it_fails(comparison: Comparison) -> Figure:
    """Residuals seen from above, plane by plane, direction by direction."""
    rows, columns = panels(comparison.data)
    width, height = max(1.9 + SIDE * len(columns), 11.0), 1.4 + SIDE * len(rows)
    question = "Where does the model fail? Alike all around, or on one side?"
    figure = new_figure(width, height, question, f"{RESIDUAL_AXIS}; {MAPS}")
    maps(figure, comparison.data, comparison.residual, (0.95, height - 1.2, SIDE))
    return figure


def variables(comparison: Comparison) -> Figure:
    """Residuals against the strongest variables, in order; readings far off are drawn at the edge."""
    limits = _limits(comparison)
    panels: list[tuple[float, float, Variable | ReadingNames]] = []
    held_against: list[Variable | ReadingNames] = [*comparison.numbers, *comparison.names]
    # What a pattern is about: its own variable, and those of patterns that are the same; or a level of this label.
    about = [(t, [t.pattern.variable, *(s.partition(": ")[2] for s in t.pattern.same)]) for t in comparison.tests]
    for variable in held_against:
        tests = [t for t, names in about if any(f"{name} ".startswith(f"{variable.name} ") for name in names)]
        strongest = max((abs(test.statistic) for test in tests), default=0.0)
        panels.append((-strongest, min((test.p_adjusted for test in tests), default=1.0), variable))
    panels.sort(key=lambda panel: panel[0])
    tried = len(panels)
    panels = panels[: max(LEAST_SHOWN, sum(p < SIGNIFICANT for _, p, _ in panels))]
    height = 1.0 + PITCH * max(-(-len(panels) // ACROSS), 1)
    figure = new_figure(
        15.0, height, "Which variable is missing?", f"{RESIDUAL_AXIS}; lines: a direction's own trend; p: of the "
        f"strongest pattern, corrected for all {tried} variables; triangles: beyond the frame",
    )  # fmt: skip
    for k, (_, p, variable) in enumerate(panels):
        i, j = divmod(k, ACROSS)
        axes = panel(figure, 0.6 + 2.88 * j, height - 1.0 - PITCH * (i + 1) + 0.42, 2.62, 1.45)
        _panel(axes, comparison, variable, limits)
        axes.axhline(0.0, color=MUTED, lw=0.8, zorder=1)
        axes.set_ylim(*limits)
        axes.tick_params(labelsize=7.5, pad=2, labelleft=not j)
        unit = str(getattr(variable, "unit", ""))
        name = plain(variable.name.removesuffix(f"_{unit}").replace("_", " ")) + (f", {unit}" if unit else "")
        axes.set_title(shortened(name, 30), fontsize=9, pad=3)
        star, weight, colour = (" *", "bold", RED) if p < SIGNIFICANT else ("", "normal", MUTED)
        axes.set_title(f"p = {p:.2g}{star}", fontsize=8.5, pad=3, loc="right", weight=weight, color=colour)
    _key(figure, comparison)
    return figure


def _key(figure: Figure, comparison: Comparison) -> None:
    width, height = figure.get_size_inches()
    present = [axis for axis in DIRECTIONS if (directions(comparison.data) == axis).any()]
    style: Look = {"size": 11, "weight": "bold", "ha": "right"}
    for i, axis in enumerate(reversed(present)):
        left, low = 1.0 - (0.4 + 0.5 * i) / width, 1.0 - 0.4 / height
        figure.text(left, low, f"\u25cf {axis}", color=DIRECTIONS[axis], **style)


def _limits(comparison: Comparison) -> tuple[float, float]:
    """Range of residuals shown: all, except that a few wild readings must not squeeze the others."""
    values = deviation_percent(comparison.residual)
    middle = float(np.median(values))
    reach = WIDE * float(np.median(np.abs(values - middle)))
    kept = values[np.abs(values - middle) <= reach] if reach > 0.0 else values
    margin = 0.08 * max(float(np.ptp(kept)), 0.1)
    return float(kept.min()) - margin, float(kept.max()) + margin


def _panel(axes: Axes, comparison: Comparison, variable: Variable | ReadingNames, limits: tuple[float, float]) -> None:
    residual, along = deviation_percent(comparison.residual), directions(comparison.data)
    x, names = _places(variable)
    present = [axis for axis in DIRECTIONS if (along == axis).any()]
    for k, axis in enumerate(present):
        rows = (along == axis) & np.isfinite(x)
        if not rows.any():
            continue
        shift = 0.16 * (k - (len(present) - 1) / 2.0) if 0 < len(names) <= MOST_NAMES else 0.0
        held = np.clip(residual[rows], *limits)
        beyond = np.sign(residual[rows] - held)
        for side, marker in ((0, "o"), (1, "^"), (-1, "v")):
            chosen = beyond == side
            look: Look = {"ms": 2.6 if len(x) > 100 else 4.0, "mew": 0, "alpha": 0.55, "color": DIRECTIONS[axis]}
            axes.plot(x[rows][chosen] + shift, held[chosen], marker, zorder=2, **look)
        if not names:
            _trend(axes, x[rows], held, DIRECTIONS[axis])
        elif len(names) <= MOST_NAMES:
            levels = np.unique(x[rows])
            means = [float(held[x[rows] == level].mean()) for level in levels]
            axes.plot(levels + shift, means, "_", color=DIRECTIONS[axis], ms=7, mew=2.4, zorder=4)
    _name_levels(axes, names)


def _places(variable: Variable | ReadingNames) -> tuple[FloatArray, list[str]]:
    if variable.values.dtype.kind == "f":
        return np.asarray(variable.values, dtype=float), []
    names = sorted(set(variable.values.tolist()), key=_rank)
    return np.array([names.index(level) for level in variable.values.tolist()], dtype=float), names


def _trend(axes: Axes, x: FloatArray, held: FloatArray, colour: str) -> None:
    if float(np.ptp(x)) > 0.0 and len(x) > 2:
        slope, level = np.polyfit(x - x.mean(), held, 1)
        ends = np.array([x.min(), x.max()])
        axes.plot(ends, level + slope * (ends - x.mean()), color=colour, lw=1.3, zorder=4)


def _name_levels(axes: Axes, names: list[str]) -> None:
    if not names:
        axes.locator_params(axis="x", nbins=4)
    elif len(names) <= MOST_NAMES:
        room = max(int(46 / len(names)) - 2, 4)
        axes.set_xticks(range(len(names)), [shortened(plain(_brief(name)) or "(none)", room) for name in names])
        axes.set_xlim(-0.5, len(names) - 0.5)
    else:
        axes.set_xticks([0.5 * (len(names) - 1)], [f"{len(names)} of them, in order"])


def _rank(name: str) -> tuple[float, str]:
    """Sort key of levels: numeric if they are numbers, otherwise alphabetic."""
    try:
        return float(_brief(name)), name
    except ValueError:
        return float("inf"), name


def _brief(name: str) -> str:
    """Name of a level without the words in the panel's title."""
    for word in ("plane at z = ", " plane", " the axis", " third", "from", " mm"):
        name = name.replace(word, "")
    return name


PICTURES = {
    "measured_modelled.png": measured_modelled,
    "machine.png": where_it_fails,
    "variables.png": variables,
}
