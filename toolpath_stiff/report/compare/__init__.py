"""The results of a comparison with measurements: page, files and text.

Residuals against everything that the model does not use, and the load path as a waterfall.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.files import Content
from toolpath_stiff.report import (
    DEVIATION,
    MINUS_IS_SOFTER,
    bullets,
    markup,
    picture,
    plain,
    readings_page,
    section,
    shortened,
    table,
)
from toolpath_stiff.report.compare.pictures import (
    RESIDUAL_AXIS,
    count_of,
    heading,
    machine_png,
    measured_modelled_png,
    planes_png,
    strips_png,
)
from toolpath_stiff.report.figure import (
    BLUE,
    INK,
    LIGHT_BLUE,
    MUTED,
    SECOND_ORANGE,
    UNREACHABLE_RED,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.readings import DIRECTION_COLOURS, history_section, history_text, loops_section, loops_text
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m
from toolpath_stiff.updating.comparison import Comparison
from toolpath_stiff.updating.comparison.residuals import directions, planes
from toolpath_stiff.updating.comparison.structure import SIGNIFICANT
from toolpath_stiff.updating.inference.fits import deviation_percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.updating.comparison.document import ComparisonDocument, Figures
    from toolpath_stiff.updating.comparison.residuals import Label, Variable


# Picture -> the question that it answers, and how it is read.
QUESTIONS = {
    "measured_modelled.png": (
        "How wrong is the model, biased or scattered?",
        "A cloud beside the line is a bias; as wide as its bars, scatter; one direction off alone points to a gauge, "
        "a table or a spindle.",
    ),
    "planes.png": (
        "Z against X and Y? Upper against lower plane?",
        "Standard errors hold the scatter of readings, clampings and struts, and what scatters more than these from "
        "place to place. They are taken one by one; the findings above are corrected for looking at many places.",
    ),
    "machine.png": (
        "Where does the model fail? Alike all around, or on one side?",
        "Three times the same around the axis: geometry or the law of all struts. One side only: one strut, one joint, "
        "the table, or a cable.",
    ),
    "strips.png": (
        "Drift, a bad clamping, one bad reading?",
        "A slope is drift, a step is a clamping, a lone bar is a reading to take again.",
    ),
    "variables.png": (
        "Which variable is missing?",
        "The strongest first. A trend in one direction of load alone says more than one in all: compare with what "
        "every effect of the catalogue would do with tps diagnose.",
    ),
    "load_path.png": (
        "Which link takes what share of the compliance?",
        "A missing compliance must fit between the model's bar and the measured one; a link that takes little "
        "cannot be the cause unless it is badly wrong.",
    ),
}
MOST_ROWS = 40  # of patterns; all are in compare.json
MOST_FAR_OFF = 20
ACROSS = 5  # panels in a row
PITCH = 2.15  # inches from one row of panels to the next
MOST_NAMES = 8  # levels of a label that are written out
WIDE = 7.5  # median deviations, some 5 standard deviations: readings further off stand at the edge
NM_PER_N = 1e9
LONG_NAME = 10  # letters of a link from which its name, turned, needs more room below
LINKS = (BLUE, LIGHT_BLUE)  # struts, alternating
EFFECT = SECOND_ORANGE


def compare_pictures(found: Comparison) -> dict[str, bytes]:
    """All pictures, by file name."""
    return {
        "measured_modelled.png": measured_modelled_png(found),
        "planes.png": planes_png(found),
        "machine.png": machine_png(found),
        "strips.png": strips_png(found),
        "variables.png": variables_png(found),
        "load_path.png": load_path_png(found),
    }


def compare_html(found: Comparison, pictures: Mapping[str, bytes]) -> str:
    """The page's text, the pictures within."""
    document = found.document
    sections = [
        section("Findings" if document["findings"] else "No pattern stands out from scatter", _findings(document)),
        picture("measured_modelled.png", pictures, QUESTIONS),
        section("Errors by direction, plane and set-up", _errors(document)),
        picture("planes.png", pictures, QUESTIONS),
        picture("machine.png", pictures, QUESTIONS),
        picture("strips.png", pictures, QUESTIONS),
        section("Readings far off", _far_off(document)),
        *loops_section(document["loops"]),
        *history_section(document["history"]),
        picture("variables.png", pictures, QUESTIONS),
        section("Checks without a model", _model_free(document)),
        picture("load_path.png", pictures, QUESTIONS),
        section("All patterns looked for", _tests(document)),
        section("How much readings scatter", _noise(document)),
        section("Not tested", bullets(document["not_tested"])),
        section("Assumptions", bullets([*document["assumptions"], *document["notes"]])),
    ]
    question = "Where does the model fail?"
    return readings_page("Comparison", "compare", document, question, _headline(document), _figures(document), sections)


def _headline(document: ComparisonDocument) -> str:
    """The strongest finding, or that there is none."""
    if document["findings"]:
        return str(document["findings"][0]["text"])
    return f"{document['baseline']['mean_abs_error_percent']:.2f} % off in the mean as given, without a pattern"


def _figures(document: ComparisonDocument) -> list[tuple[str, str]]:
    """The few figures that say it all."""
    base, noise = document["baseline"], document["noise"]
    refit = base["strut_law_refitted"]
    scatter = " to ".join(f"{base['scatter_rms_percent'][one['name']]:.1f}" for one in noise)
    share = " to ".join(f"{base['explained_by_scatter_percent'][one['name']]:.0f}" for one in noise)
    return [
        (f"{base['mean_abs_error_percent']:.2f} %", "mean |modelled - measured| / measured, as given"),
        *([(f"{refit['mean_abs_error_percent']:.2f} %", "the same, strut law refitted")] if refit else []),
        (f"{base['bias_percent']:+.1f} %", f"bias: {DEVIATION}, {MINUS_IS_SOFTER}"),
        (f"{base['rms_percent']:.1f} %", "rms error"),
        (f"{scatter} %", "rms that scatter alone would leave"),
        (f"{share} %", "of the mean square is scatter"),
    ]


def _findings(document: ComparisonDocument) -> Markup:
    """Findings with their probabilities, or the strongest hints."""
    if not document["findings"]:
        hints = [("out", (*_said(one), _alike(one))) for one in document["hints"]]
        return table(("the strongest hints", "t", "p, corrected", "looks the same in these data"), hints, (1, 2))
    rows = []
    for one in document["findings"]:
        after = one.get("after_strut_law_refit")
        rows.append(("finding", (*_said(one), f"{after['p_adjusted']:.2g}" if after else "-", _alike(one))))
    head = ("finding", "t", "p, corrected", "p if the strut law is refitted", "looks the same in these data")
    return table(head, rows, range(1, 4))


def _said(one: Mapping[str, Any]) -> tuple[str, str, str]:
    return one["text"], f"{one['statistic']:+.1f}", f"{one['p_adjusted']:.2g}"


def _alike(one: Mapping[str, Any]) -> str:
    return ", ".join(one["indistinguishable_from"]) or "-"


def _groups(document: ComparisonDocument) -> list[tuple[str, Mapping[str, Figures]]]:
    """Readings by direction, plane and set-up; planes have a name that needs no title."""
    return [("direction", document["by_direction"]), ("", document["by_plane"]), ("set-up", document["by_setup"])]


def _errors(document: ComparisonDocument) -> Markup:
    """Errors by direction, plane and set-up, beside those of scatter alone."""
    levels: list[tuple[str, Figures]] = [("all readings", document["baseline"])]
    for title, by in _groups(document):
        if len(by) > 1:
            levels += [(f"{title} {name or '(none)'}".strip(), figures) for name, figures in by.items()]
    names = [one["name"] for one in document["noise"]]
    rows = [
        (
            "",
            (
                name,
                str(one["readings"]),
                f"{one['mean_abs_error_percent']:.2f} %",
                f"{one['bias_percent']:+.1f} %",
                f"{one['rms_percent']:.1f} %",
                *(f"{one['scatter_rms_percent'][noise]:.1f} %" for noise in names),
            ),
        )
        for name, one in levels
    ]
    head = ["", "readings", "mean error", "bias", "rms", *(f"rms of scatter alone ({name})" for name in names)]
    remark = f"Machine file as given. Bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}."
    return table(head, rows, range(1, len(head))) + markup('<p class="muted">{}</p>', remark)


def _far_off(document: ComparisonDocument) -> Markup:
    rows = [
        (
            "",
            (
                f"{one['file']}:{one['line']}",
                one["direction"],
                one["point"],
                f"{one['deviation_percent']:+.0f} %",
                f"{one['standard_deviations']:+.1f}",
            ),
        )
        for one in document["outliers"][:MOST_FAR_OFF]
    ]
    head = ("line", "direction", "point", "with the findings taken out", "standard deviations")
    return table(head, rows, (3, 4))


def _model_free(document: ComparisonDocument) -> Markup:
    """Checks that need no stiffness model, and why others cannot be made."""
    found = document["model_free"]
    rows = [
        (
            "" if one["holds"] else "finding",
            (one["check"], one["text"], f"{one['statistic']:+.1f}", f"{one['p_adjusted']:.2g}"),
        )
        for one in found["checks"]
    ]
    rows += [("out", (one["check"], f"not checked: {one['reason']}", "", "")) for one in found["cannot_check"]]
    return table(("principle", "result", "t", "p, corrected"), rows, (2, 3))


def _tests(document: ComparisonDocument) -> Markup:
    """The strongest patterns, each on its own."""
    tests = document["tests"]
    rows = [
        (
            "",
            (
                one["pattern"],
                one["kind"],
                str(one["readings"]),
                f"{one['statistic']:+.1f}",
                f"{one['p_adjusted']:.2g}",
            ),
        )
        for one in tests[:MOST_ROWS]
    ]
    listed = table(("pattern", "kind", "readings", "t", "p, corrected"), rows, (2, 3, 4))
    if not listed:
        return Markup()
    remark = f"{len(tests)} patterns were looked for, each on its own here"
    remark += f"; the strongest {MOST_ROWS} are shown, all are in compare.json." if len(tests) > MOST_ROWS else "."
    return markup("<details><summary>{}</summary>{}</details>", remark, listed)


def _noise(document: ComparisonDocument) -> Markup:
    base = document["baseline"]
    rows = [
        (
            "",
            (
                one["name"],
                f"{one['repeat_percent']:.2g} %",
                f"{one['clamping_percent']:.2g} %",
                f"{one['strut_spread_percent']:.2g} %",
                f"{base['excess_scatter_percent'][one['name']]:.2g} %",
                f"{base['probability'][one['name']]:.2g}",
                one["origin"],
            ),
        )
        for one in document["noise"]
    ]
    head = ("noise", "reading", "clamping", "struts", "beyond it, place to place", "p of residuals this large",
            "origin")  # fmt: skip
    return table(head, rows, range(1, 6))


MOST_NAMED = 5  # readings far off, on the terminal


def text(document: ComparisonDocument) -> str:
    """Errors, findings, checks, in lines."""
    lines = [document["text"], ""]
    lines += _table(document)
    base, refit = document["baseline"], document["baseline"]["strut_law_refitted"]
    if refit:
        gain = round(base["mean_abs_error_percent"] - refit["mean_abs_error_percent"], 2)
        law = " / ".join(f"{stiffness:.1f}" for stiffness in refit["strut_law"]["N_per_um"])
        lines += [
            "",
            f"strut law refitted: {refit['mean_abs_error_percent']:.2f} % mean error, "
            f"{refit['bias_percent']:+.1f} % bias, rms {refit['rms_percent']:.1f} % "
            f"({law} N/um)" + ("" if gain > 0.0 else ": nothing gained"),
        ]
    lines += ["", "findings"]
    lines += [f"  {plain(one['text'])} (p = {one['p_adjusted']:.2g})" for one in document["findings"]]
    if not document["findings"]:
        lines.append("  none: no pattern stands out from scatter. The strongest hints:")
        lines += [f"  - {plain(one['text'])} (p = {one['p_adjusted']:.2g})" for one in document["hints"]]
    for one in document["findings"]:
        if one["indistinguishable_from"]:
            others = ", ".join(one["indistinguishable_from"])
            lines.append(f"  ({plain(one['pattern'])} looks the same here as: {plain(others)})")
    lines += loops_text(document["loops"])
    lines += history_text(document["history"])
    lines += ["", "checks without a model"]
    lines += [f"  {plain(one['text'])}" for one in document["model_free"]["checks"]]
    lines += [f"  {one['check']}: {one['reason']}" for one in document["model_free"]["cannot_check"]]
    if document["outliers"]:
        lines += ["", "readings far off"]
        lines += [
            f"  {plain(one['file'])}:{one['line']}: {one['direction']} at point {plain(one['point'])}, "
            f"{one['deviation_percent']:+.0f} % with the findings taken out "
            f"({one['standard_deviations']:+.1f} standard deviations)"
            for one in document["outliers"][:MOST_NAMED]
        ]
        if len(document["outliers"]) > MOST_NAMED:
            lines.append(f"  and {len(document['outliers']) - MOST_NAMED} more, in compare.json")
    lines += [""] + [f"warning: {plain(text)}" for text in document["warnings"]]
    lines += [f"note: {plain(text)}" for text in document["notes"]]
    return "\n".join(line for i, line in enumerate(lines) if line or lines[i - 1 : i] != [""]).rstrip() + "\n"


def _table(document: ComparisonDocument) -> list[str]:
    """Errors by direction, plane and set-up."""
    rows: list[tuple[str, Figures]] = [("all readings", document["baseline"])]
    for title, levels in _groups(document):
        if len(levels) > 1:
            rows += [(f"{title} {plain(name) or '(none)'}".strip(), figures) for name, figures in levels.items()]
    noise = document["noise"][-1]["name"]
    width = max(len(name) for name, _ in rows)
    head = f"{'':<{width}}  readings  mean error   bias    rms  scatter alone"
    lines = ["machine file as given; bias: mean of " + f"{DEVIATION}, {MINUS_IS_SOFTER}", head]
    return lines + [
        f"{name:<{width}}  {one['readings']:>8}  {one['mean_abs_error_percent']:>8.2f} % {one['bias_percent']:>+6.1f} "
        f"{one['rms_percent']:>6.1f}  {one['scatter_rms_percent'][noise]:>9.1f} rms"
        for name, one in rows
    ]


def _with_unit(name: str, unit: str) -> str:
    """A heading: "tilt_deg", unless the name says the unit already."""
    suffix = unit.replace("/", "_per_").replace("%", "percent")
    return name if name.endswith(suffix) else f"{name}_{suffix}"


def residuals_csv(found: Comparison) -> str:
    """One row a reading: measured, modelled, deviation, scatter, every variable that residuals were held against."""
    data = found.data
    own = [one for one in found.numbers if one.name not in ("x", "y", "height", "order")]
    head = [
        "file", "line", "point", "setup", "clamp", "plane", "direction", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg",
        "c_deg", "dx", "dy", "dz", "measured_N_per_mm", "modelled_N_per_mm", "deviation_percent", "scatter_percent",
        *(_with_unit(one.name, one.unit) for one in own),
    ]  # fmt: skip
    along, where = directions(data), planes(data)
    rows = []
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        modelled = float(n_per_mm_from_n_per_m(np.exp(found.log_model[i])))
        rows.append(
            [
                data.file[i], data.line[i], data.point[i], data.setup[i], data.clamp[i], where[i], along[i],
                *(f"{value + 0.0:.6g}" for value in pose),
                f"{measured:.1f}", f"{modelled:.1f}", f"{float(deviation_percent(found.residual[i])):.3f}",
                f"{100.0 * found.scatter[i]:.3f}",
                *("" if np.isnan(one.values[i]) else f"{one.values[i]:.6g}" for one in own),
            ]
        )  # fmt: skip
    return csv_text(head, rows)


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    data = ("compare.json", "residuals.csv")
    pictures = ("measured_modelled.png", "strips.png", "planes.png", "machine.png", "variables.png", "load_path.png")
    return (*data, "report.html", *pictures) if plots else data


def files(found: Comparison, *, plots: bool = True) -> dict[str, Content]:
    """Everything as JSON, one row a reading, and with `plots` pictures and page."""
    contents: dict[str, Content] = {
        "compare.json": json.dumps(found.document, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        "residuals.csv": residuals_csv(found),
    }
    if plots:
        pictures = compare_pictures(found)
        contents |= {**pictures, "report.html": compare_html(found, pictures)}
    return contents


@drawn
def variables_png(found: Comparison) -> Figure:
    """PNG: residual against each variable, the strongest first; readings far off stand at the edge."""
    limits = _limits(found)
    panels: list[tuple[float, str, Variable | Label]] = []
    held_against: list[Variable | Label] = [*found.numbers, *found.names]
    for one in held_against:
        tests = [t for t in found.document["tests"] if _about(t, one.name)]
        p = min((t["p_adjusted"] for t in tests), default=1.0)
        strongest = max((abs(t["statistic"]) for t in tests), default=0.0)
        panels.append((-strongest, f"p = {p:.2g}" + ("" if p >= SIGNIFICANT else " *"), one))
    panels.sort(key=lambda panel: panel[0])
    rows = -(-len(panels) // ACROSS)
    with house_style():
        width, height = 15.0, 1.0 + PITCH * max(rows, 1)
        figure = new_figure(width, height)
        for k, (_, shown, one) in enumerate(panels):
            i, j = divmod(k, ACROSS)
            x, y = 0.6 + 2.88 * j, height - 1.0 - PITCH * (i + 1) + 0.42
            axes = figure.add_axes((x / width, y / height, 2.62 / width, 1.45 / height))
            _panel(axes, found, one, limits)
            axes.axhline(0.0, color=MUTED, lw=0.8, zorder=1)
            axes.set_ylim(*limits)
            axes.tick_params(labelsize=7.5, pad=2)
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_label_coords(0.5, 0.0)  # without a name: none is to be kept clear of the figures
            if j:
                axes.set_yticklabels([])
            unit = str(getattr(one, "unit", ""))
            name = plain(one.name.removesuffix(f"_{unit}").replace("_", " ")) + (f", {unit}" if unit else "")
            axes.set_title(shortened(name, 30), fontsize=9, pad=3)
            axes.set_title(
                shown, fontsize=8.5, pad=3, loc="right", weight="bold" if shown.endswith("*") else "normal",
                color=UNREACHABLE_RED if shown.endswith("*") else MUTED,
            )  # fmt: skip
        _key(figure, found)
        heading(
            figure,
            "Which variable is missing?",
            f"{RESIDUAL_AXIS}; lines: a direction's own trend; p: of the strongest pattern, corrected for all "
            "that were looked for; triangles: beyond the frame",
        )
        return figure


def _about(test: Mapping[str, Any], name: str) -> bool:
    """Whether a pattern is about this variable, or a level of this label, or the same as one that is."""
    about = [test["variable"], *(same.partition(": ")[2] for same in test["same"])]
    return any(variable == name or variable.startswith(f"{name} ") for variable in about)


def _limits(found: Comparison) -> tuple[float, float]:
    """Range shown: all, but a few wild readings do not squeeze the others."""
    values = deviation_percent(found.residual)
    middle = float(np.median(values))
    reach = WIDE * float(np.median(np.abs(values - middle)))
    kept = values[np.abs(values - middle) <= reach] if reach > 0.0 else values
    margin = 0.08 * max(float(np.ptp(kept)), 0.1)
    return float(kept.min()) - margin, float(kept.max()) + margin


def _key(figure: object, found: Comparison) -> None:
    from matplotlib.figure import Figure

    assert isinstance(figure, Figure)
    width, height = figure.get_size_inches()
    present = [axis for axis in DIRECTION_COLOURS if (directions(found.data) == axis).any()]
    for i, axis in enumerate(reversed(present)):
        figure.text(
            1.0 - (0.4 + 0.5 * i) / width, 1.0 - 0.4 / height, "\u25cf " + axis, color=DIRECTION_COLOURS[axis], size=11,
            weight="bold", ha="right",
        )  # fmt: skip


def _panel(axes: Axes, found: Comparison, one: Variable | Label, limits: tuple[float, float]) -> None:
    """Points by direction; a trend line a direction, or the means of levels."""
    residual, along = deviation_percent(found.residual), directions(found.data)
    x, names = _places(one)
    present = [axis for axis in DIRECTION_COLOURS if (along == axis).any()]
    for k, axis in enumerate(present):
        rows = (along == axis) & np.isfinite(x)
        if not rows.any():
            continue
        shift = 0.16 * (k - (len(present) - 1) / 2.0) if 0 < len(names) <= MOST_NAMES else 0.0
        _points(axes, x[rows] + shift, residual[rows], limits, DIRECTION_COLOURS[axis], 2.6 if len(x) > 100 else 4.0)
        held = np.clip(residual[rows], *limits)
        if not names:
            _trend(axes, x[rows], held, DIRECTION_COLOURS[axis])
        elif len(names) <= MOST_NAMES:
            _level_means(axes, x[rows], held, shift, DIRECTION_COLOURS[axis])
    _name_levels(axes, names)


def _places(one: Variable | Label) -> tuple[FloatArray, list[str]]:
    """Where the readings stand across a panel, and the names of the levels there, if it has any."""
    if one.values.dtype.kind == "f":
        return np.asarray(one.values, dtype=float), []
    names = sorted(set(one.values.tolist()), key=_rank)
    return np.array([names.index(level) for level in one.values.tolist()], dtype=float), names


def _points(
    axes: Axes, x: FloatArray, residual: FloatArray, limits: tuple[float, float], colour: str, size: float
) -> None:
    """Readings as dots; those beyond the axis as arrowheads at its edge."""
    off = np.sign(residual) * ((residual < limits[0]) | (residual > limits[1]))
    for side, marker in ((0, "o"), (1, "^"), (-1, "v")):
        chosen = off == side
        if not chosen.any():
            continue
        seen = np.clip(residual[chosen], limits[0] + 0.3, limits[1] - 0.3) if side else residual[chosen]
        # Arrowheads above all dots: dots that follow each other become one image of a page, not one a direction.
        axes.plot(
            x[chosen], seen, marker, color=colour, ms=size + abs(side), mew=0, alpha=0.55, zorder=2 + 0.1 * abs(side)
        )


def _level_means(axes: Axes, x: FloatArray, held: FloatArray, shift: float, colour: str) -> None:
    """A short bar at the mean of each level."""
    for level in np.unique(x):
        mean, at = float(held[x == level].mean()), float(level) + shift
        axes.plot([at - 0.09, at + 0.09], [mean, mean], color=colour, lw=2.4, zorder=4)


def _trend(axes: Axes, x: FloatArray, held: FloatArray, colour: str) -> None:
    """The straight line of least squares, where two places and more than two readings make one."""
    if float(np.ptp(x)) > 0.0 and len(x) > 2:
        slope, level = np.polyfit(x - x.mean(), held, 1)
        ends = np.array([x.min(), x.max()])
        axes.plot(ends, level + slope * (ends - x.mean()), color=colour, lw=1.3, zorder=4)


def _name_levels(axes: Axes, names: list[str]) -> None:
    """Ticks: the levels' names, the first and the last of many, or numbers."""
    if not names:
        axes.locator_params(axis="x", nbins=4)
    elif len(names) <= MOST_NAMES:
        room = max(int(46 / len(names)) - 2, 4)
        axes.set_xticks(range(len(names)), [shortened(plain(_brief(name)) or "(none)", room) for name in names])
        axes.set_xlim(-0.5, len(names) - 0.5)
    else:
        axes.set_xticks([0, len(names) - 1], ["first", f"last of {len(names)}"])
        axes.get_xticklabels()[1].set(ha="right")


def _rank(name: str) -> tuple[float, str]:
    """Order of levels: by number if they are numbers, else by letter."""
    try:
        return float(_brief(name)), name
    except ValueError:
        return float("inf"), name


def _brief(name: str) -> str:
    """A level's name without what the panel's title says."""
    for word in ("plane at z = ", " plane", " the axis", " third", "from", " mm"):
        name = name.replace(word, "")
    return name


@drawn
def load_path_png(found: Comparison) -> Figure:
    """PNG: compliance of the tip along X, Y, Z, link by link, and what the measurements add or take."""
    shares = found.shares
    compliance = shares.compliance * NM_PER_N
    along = directions(found.data)
    ratio = np.array([_measured_over_modelled(found, along == axis) for axis in "XYZ"])
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


def _measured_over_modelled(found: Comparison, rows: NDArray[np.bool_]) -> float:
    """Mean measured compliance over the modelled one; nan without readings along it."""
    if not rows.any():
        return float("nan")
    return float(np.mean(1.0 / found.data.stiffness[rows]) / np.mean(np.exp(-found.log_model[rows])))


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
    at = len(parts)
    axes.bar(at, total, 0.8, color=INK)
    names.append("model")
    if np.isfinite(ratio):
        axes.bar(at + 1, total * ratio, 0.8, color="white", edgecolor=INK, hatch="////", linewidth=1.0)
        off = f"stiffness\n{stiffness_deviation_percent(ratio):+.0f} %"
        axes.text(
            at + 1, total * (ratio + 0.012), off, ha="center", va="bottom", fontsize=8.5,
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
