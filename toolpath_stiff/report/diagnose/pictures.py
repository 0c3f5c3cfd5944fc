"""Pictures of a diagnosis: the candidate ladder, what cannot be told apart, what could hide, is the fit good enough.

Each takes the content of `diagnose.json`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.documents import Document
from toolpath_stiff.report.explanations import (
    AS_GIVEN,
    NONE,
    explanations,
    figure_of,
    floor_text,
    hidden_name,
    is_offered,
    is_plausible,
    model_rows,
    noise_floor_percent,
    parameter_texts,
    percent,
    probability_text,
    remark_text,
    row_name,
    significant,
    size_text,
)
from toolpath_stiff.report.figure import (
    BLUE,
    CHOSEN,
    FAINT,
    INK,
    MUTED,
    RAPID_GREY,
    SECOND_ORANGE,
    UNREACHABLE_RED,
    Drawing,
    drawing,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.words import plain, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ROW = 0.47  # inch a candidate
OUTSIDE = "outside the catalogue"
OPAQUE = 0.75  # from here on a cell is dark on a light page, and light on a dark one
MOST_PAIRS = 5  # of the ladder; all are in diagnose.json
BEYOND = 1.7  # times the base model's error: where the ladder's axis ends, and arrows stand for more


@drawn
def ladder_png(document: Document) -> Figure:
    """PNG: every explanation with its error at left-out points and its probability, best first."""
    rows = ladder_rows(document)
    height = 1.75 + ROW * len(rows)
    with house_style():
        figure = new_figure(14.0, height)
        _title(figure, "Which effect explains the data, and how surely?", _ladder_note(document))
        bottom, top = 0.62 / height, 1.0 - 1.1 / height
        shade = figure.add_axes((0.01, bottom, 0.985, top - bottom))
        labels = figure.add_axes((0.02, bottom, 0.34, top - bottom))
        errors = figure.add_axes((0.35, bottom, 0.31, top - bottom))
        chances = figure.add_axes((0.69, bottom, 0.13, top - bottom))
        words = figure.add_axes((0.845, bottom, 0.15, top - bottom))
        for axes in (shade, labels, words):
            axes.set_axis_off()
            axes.set_xlim(0.0, 1.0)
        for axes in (shade, labels, errors, chances, words):
            axes.set_ylim(len(rows) - 0.5, -0.5)
        for axes in (errors, chances):
            axes.patch.set_visible(False)
            axes.set_yticks([])
            axes.grid(visible=False, axis="y")
            axes.spines[["top", "right", "left"]].set_visible(False)
        _ladder_labels(labels, rows, document)
        _ladder_errors(errors, rows, document)
        _ladder_chances(chances, rows, document)
        _ladder_words(words, rows, document)
        for y, row in enumerate(rows):
            if is_plausible(row, document):
                shade.axhspan(y - 0.5, y + 0.5, color=CHOSEN, lw=0)
        return figure


def ladder_rows(document: Document) -> list[Document]:
    """As given, strut law refitted, what no effect describes (if it was weighed), then pairs and effects."""
    models = model_rows(document)
    outside = figure_of(models[-1], "probability_outside")
    beyond = [{"effect": OUTSIDE, "title": "a smooth unknown", "probability": outside}] if outside else []
    return [*models, *beyond, *document["pairs"][:MOST_PAIRS], *document["candidates"]]


def _ladder_note(document: Document) -> str:
    standing = len(explanations(document))
    shown = f"shaded: {standing} explanation{'s' if standing > 1 else ''} left standing" if standing else "none left"
    return (
        f"verdict: {document['verdict']}   ·   {shown}   ·   bar at a dot: standard error "
        "of its fall from the refitted strut law   ·   grey: not offered"
    )


def _ladder_labels(axes: Axes, rows: list[Document], document: Document) -> None:
    for y, row in enumerate(rows):
        name = row_name(row)
        small = ", ".join(parameter_texts(row, intervals=False)) or plain(str(row.get("title") or ""))
        offered = is_offered(row, document)
        colour = INK if offered else RAPID_GREY
        weight = "bold" if is_plausible(row, document) else "normal"
        axes.text(0.0, y - 0.16, shortened(name, 58), va="center", color=colour, weight=weight)
        axes.text(0.0, y + 0.21, shortened(small, 76), va="center", color=MUTED if offered else RAPID_GREY, size=8)


def _ladder_errors(axes: Axes, rows: list[Document], document: Document) -> None:
    base = figure_of(document["baseline"], "held_out_error_percent")
    held = [figure_of(row, "held_out_error_percent") for row in rows]
    inside = [figure_of(row, "mean_abs_error_percent") for row in rows]
    known = [value for value in (*held, *inside) if value is not None]
    end = 1.08 * max(known, default=1.0)
    if base is not None:
        end = min(end, BEYOND * base)
    floor = noise_floor_percent(document)
    end = max(end, 1.3 * floor if floor is not None else 0.0, 1e-6)
    axes.set_xlim(0.0, end)
    for value, other, text, colour, style in (
        (floor, base, f"noise floor {floor_text(document)}", SECOND_ORANGE, ":"),
        (base, floor, f"strut law refitted {percent(base)}", INK, "--"),
    ):
        if value is not None:
            axes.axvline(value, color=colour, lw=1.3, ls=style, zorder=1)
            leftwards = other is not None and value < other  # two labels turn away from each other
            axes.annotate(
                text, (value, 1.0), xycoords=("data", "axes fraction"),
                xytext=(4 if leftwards else -4, 3), textcoords="offset points", size=8.5, color=colour,
                ha="right" if leftwards else "left",
            )  # fmt: skip
    for y, row in enumerate(rows):
        colour = _row_colour(row, document)
        within, outside = inside[y], held[y]
        if within is not None and within <= end:
            axes.plot(within, y, "|", color=colour, ms=11, mew=1.6, zorder=3)
        if outside is None:
            continue
        if outside > end:
            axes.annotate(
                f"{percent(outside)} \N{RIGHTWARDS ARROW}", (end, y), ha="right", va="center", size=9, color=colour
            )
            continue
        axes.plot(outside, y, "o", color=colour, mfc=colour if is_offered(row, document) else "white", ms=8, zorder=4)
        if (error := standard_error(base, outside, figure_of(row, "held_out_gain_in_se"))) is not None:
            axes.plot([max(outside - error, 0.0), outside + error], [y, y], color=colour, lw=2.0, zorder=3)
    axes.set_xlabel("mean |modelled - measured| / measured, %; dot: left out, tick: in sample", size=9)


def standard_error(base: float | None, outside: float | None, gain_in_se: float | None) -> float | None:
    """Standard error of the fall of the held-out error, from the fall in standard errors; None where unknown."""
    if base is None or outside is None or not gain_in_se or base == outside:
        return None
    return abs((base - outside) / gain_in_se)


def _row_colour(row: Document, document: Document) -> str:
    if not is_offered(row, document):
        return RAPID_GREY
    if is_plausible(row, document):
        return BLUE
    return INK if row.get("effect") in (AS_GIVEN, NONE) else MUTED


def _ladder_chances(axes: Axes, rows: list[Document], document: Document) -> None:
    axes.set_xlim(0.0, 1.0)
    for y, row in enumerate(rows):
        value = figure_of(row, "probability")
        axes.barh(y, value or 0.0, height=0.5, color=BLUE if is_offered(row, document) else RAPID_GREY, zorder=2)
        inside = (value or 0.0) > 0.6
        axes.text(
            (value or 0.0) + (-0.03 if inside else 0.03), y, probability_text(value), va="center",
            ha="right" if inside else "left", size=9, color="white" if inside else INK, zorder=3,
        )  # fmt: skip
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "50", "100 %"])
    axes.set_xlabel("probability", size=9)


def _ladder_words(axes: Axes, rows: list[Document], document: Document) -> None:
    import textwrap

    for y, row in enumerate(rows):
        lines = textwrap.wrap(remark_text(row).split(":")[0], 31, max_lines=2, placeholder=" ...")
        axes.text(0.0, y, "\n".join(lines), va="center", size=8.5, color=INK if is_offered(row, document) else MUTED)


@drawn
def confounding_png(document: Document) -> Figure:
    """PNG: how alike the effects' signatures are on this design; effects that cannot be told apart stand in boxes."""
    from matplotlib.colors import to_rgb

    given = document["confounding"]
    names, matrix, sets = confounding_in_order(given)
    count = max(len(names), 1)
    with house_style():
        width, left, overhang = 14.0, 2.3, 1.25  # inches; the last name leans over the matrix by the overhang
        wide, tall = min(width - left - overhang, 1.6 * count), 0.42 * max(count, 3)
        height = tall + 2.9
        figure = new_figure(width, height)
        _title(
            figure, "What can these data not tell apart?", "1: the same after refitting the strut law; boxed: one set"
        )
        axes = figure.add_axes((left / width, 0.3 / height, wide / width, tall / height))
        if not names:
            _nothing(axes, "nothing to compare")
            return figure
        # Blue, the more opaque the more alike: on a dark page the cells of what is unlike are dark.
        cells = np.zeros((*matrix.shape, 4))
        cells[..., :3], cells[..., 3] = to_rgb(BLUE), np.clip(np.nan_to_num(matrix), 0.0, 1.0) ** 1.5
        edges = np.arange(count + 1) - 0.5
        axes.pcolormesh(edges, edges, cells, edgecolors="none")
        axes.set_xlim(-0.5, count - 0.5)
        axes.set_ylim(count - 0.5, -0.5)
        axes.set_xticks(range(len(names)), names, rotation=50, ha="left", rotation_mode="anchor", color=INK, size=9)
        axes.xaxis.tick_top()
        axes.set_yticks(range(len(names)), names, color=INK, size=9)
        axes.tick_params(length=0)
        axes.grid(visible=False)
        axes.spines[:].set_visible(False)
        for i, j in np.ndindex(matrix.shape):
            value = matrix[i, j]
            if i != j and np.isfinite(value) and value > 0.5:
                axes.text(
                    j, i, f"{value:.2f}".replace("0.", ".", 1), ha="center", va="center", size=9,
                    color="white" if value > OPAQUE else INK,
                )  # fmt: skip
        for start, count in sets:
            axes.add_patch(_box(start - 0.5, count))
        return figure


def _box(corner: float, count: int) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle(
        (corner, corner), count, count, fill=False, edgecolor=SECOND_ORANGE, lw=2.6, zorder=5, clip_on=False
    )


def confounding_in_order(
    given: Document,
) -> tuple[list[str], np.ndarray[Any, np.dtype[np.float64]], list[tuple[int, int]]]:
    """Names and matrix with the sets beside each other, the largest first, and (first place, size) of each set.

    Within a set and after the sets, each effect follows the one that it is most like. An effect in several sets stands
    with the first.
    """
    names = [plain(name) for name in given["effects"]]
    matrix = np.array(given["matrix"], dtype=float).reshape(len(names), len(names))
    order: list[int] = []
    boxes = []
    for members in sorted(given["sets"], key=len, reverse=True):
        places = [place for member in members if (place := names.index(member)) not in order]
        if len(places) > 1:
            boxes.append((len(order), len(places)))
            order += _chain(places, matrix)
    order += _chain([place for place in range(len(names)) if place not in order], matrix)
    return [names[place] for place in order], matrix[np.ix_(order, order)], boxes


def _chain(places: list[int], matrix: np.ndarray[Any, np.dtype[np.float64]]) -> list[int]:
    """Each next to the one most like it, from the pair that is most alike."""
    left = list(places)
    if len(left) < 3:
        return left
    alike = np.nan_to_num(matrix)
    inside = alike[np.ix_(left, left)] - np.eye(len(left)) * 2.0
    chain = [left.pop(int(np.argmax(inside.max(axis=1))))]
    while left:
        chain.append(left.pop(int(np.argmax([alike[chain[-1], place] for place in left]))))
    return chain


@drawn
def detectable_png(document: Document) -> Figure:
    """PNG: the smallest size of each effect that these data would show, as the change of stiffness that it makes."""
    from matplotlib.ticker import LogLocator, NullLocator

    given = document["detectable"]
    seen = sorted(
        (e for e in given if e["detectable"] and e["rms_percent"] is not None), key=lambda e: float(e["rms_percent"])
    )
    never = [e for e in given if e not in seen]
    rows = [*seen, *never]
    height = 1.7 + 0.32 * max(len(rows), 3)
    with house_style():
        figure = new_figure(14.0, height)
        _title(
            figure,
            "What could be there unseen?",
            "smallest size seen with 80 % power at 5 % family-wise, and the change it makes; less stays unseen",
        )
        axes = figure.add_axes((3.6 / 14.0, 0.58 / height, 9.9 / 14.0, 1.0 - 1.55 / height))
        if not rows:
            _nothing(axes, "not computed")
            return figure
        sizes = [value for e in seen if (value := figure_of(e, "rms_percent") or 0.0) > 0.0] or [1.0]
        # From a tenth of a per cent to far beyond the readings: equal steps of the logarithm.
        start, reach = 0.7 * min(sizes), 4.0 * max(sizes)
        axes.set_xscale("log")
        axes.set_xlim(start, reach)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_ylim(len(rows) - 0.4, -0.6)
        for y, entry in enumerate(rows):
            if entry in seen:
                value = max(figure_of(entry, "rms_percent") or 0.0, start)
                axes.plot([start, value], [y, y], color=BLUE, lw=1.5, alpha=0.5, zorder=2)
                axes.plot(value, y, "o", color=BLUE, ms=7, zorder=3)
                axes.annotate(size_text(entry), (value, y), (9, 0), textcoords="offset points", va="center", size=9.5)
            else:
                largest = figure_of(entry, "rms_percent")
                text = "hardly seen at any size within its bounds"
                if largest is not None:
                    text += f", which change the stiffness by {percent(largest)}"
                axes.annotate(
                    text, (start, y), (6, 0), textcoords="offset points", va="center", size=9.5, color=UNREACHABLE_RED
                )
        axes.set_yticks(range(len(rows)), [shortened(hidden_name(e), 42) for e in rows], color=INK)
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False, axis="y")
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlabel("change of stiffness that this size makes, rms over the readings, %")
        return figure


def envelope_png(document: Document) -> Drawing | None:
    """PNG: the base model's weighted sum of squares among simulated ones; None where `gates` does not hold them."""
    from matplotlib.ticker import MaxNLocator, NullLocator

    gates = document["gates"]
    simulated = np.asarray(gates["simulated_squares"], dtype=float)
    if not (simulated > 0.0).any():
        return None
    observed = figure_of(gates, "squares")
    with house_style():
        figure = new_figure(14.0, 4.2)
        _title(
            figure,
            "Is the model without a further effect good enough?",
            "weighted sum of squares: simulated as if the model were right (grey), and observed (orange)",
        )
        axes = figure.add_axes((0.04, 0.1, 0.92, 0.62))
        shown = simulated[simulated > 0.0]
        ends = [*shown, observed] if observed is not None and observed > 0.0 else [*shown]
        # Wild readings and a noise that is itself uncertain give a long tail: equal steps of the logarithm.
        axes.hist(shown, bins=np.geomspace(0.98 * min(ends), 1.02 * max(ends), 41).tolist(), color=FAINT, zorder=2)
        axes.set_xscale("log")
        low, high = axes.get_xlim()
        ticks = MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
        axes.set_xticks([tick for tick in ticks if low < tick < high], minor=False)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        if observed is not None and observed > 0.0:
            axes.axvline(observed, color=SECOND_ORANGE, lw=2.2, zorder=3)
            right = observed > np.sqrt(min(ends) * max(ends))
            axes.annotate(
                f"{observed:.4g}", (observed, 0.97), xycoords=("data", "axes fraction"), xytext=(-6 if right else 6, 0),
                textcoords="offset points", ha="right" if right else "left", va="top", color=SECOND_ORANGE,
            )  # fmt: skip
        chances = [
            (name, figure_of(gates, f"{key}_probability"))
            for name, key in (("all", "baseline"), ("squares", "squares"), ("structure", "structure"), ("gain", "gain"))
        ]
        said = [f"{name} {significant(value, 2)}" for name, value in chances if value is not None]
        figure.text(0.25 / 14.0, 1.0 - 0.93 / 4.2, f"p values: {', '.join(said) or '-'}", size=9.5, color=MUTED)
        axes.set_yticks([])
        axes.grid(visible=False, axis="y")
        axes.spines[["top", "right", "left"]].set_visible(False)
        return drawing(figure)


def _title(figure: Figure, text: str, note: str) -> None:
    width, height = figure.get_size_inches()
    figure.text(0.25 / width, 1.0 - 0.4 / height, text, fontsize=14, weight="bold")
    figure.text(0.25 / width, 1.0 - 0.68 / height, note, fontsize=9.5, color=MUTED)


def _nothing(axes: Axes, text: str) -> None:
    axes.set_axis_off()
    axes.text(0.0, 1.0, text, transform=axes.transAxes, va="top", color=MUTED, size=11)
