"""Pictures of a diagnosis: what cannot be told apart, what could hide, is the fit good enough."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.diagnosis.rows import percent_of
from toolpath_stiff.inference.confounding import Confounding
from toolpath_stiff.inference.gates import Gate
from toolpath_stiff.report.explanations import hidden_name, smallest_text
from toolpath_stiff.report.figure import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    SECOND_ORANGE,
    UNREACHABLE_RED,
    Drawing,
    drawing,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.words import percent, plain, shortened, significant
from toolpath_stiff.units import json_number

if TYPE_CHECKING:
    from matplotlib.figure import Figure


OPAQUE = 0.75  # from here on a cell is dark on a light page, and light on a dark one


def titled_figure(height: float, title: str, note: str) -> Figure:
    """A figure 14 inches wide with a question and how it is read."""
    figure = new_figure(14.0, height)
    figure.text(0.25 / 14.0, 1.0 - 0.4 / height, title, fontsize=14, weight="bold")
    figure.text(0.25 / 14.0, 1.0 - 0.68 / height, note, fontsize=9.5, color=MUTED)
    return figure


@drawn
def confounding_png(diagnosis: Diagnosis) -> Figure:
    """PNG: how alike the effects' signatures are on this design; effects that cannot be told apart stand in boxes."""
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Rectangle

    names, matrix, sets = confounding_in_order(diagnosis.confounding)
    count = max(len(names), 1)
    with house_style():
        width, left, overhang = 14.0, 2.3, 1.25  # inches; the last name leans over the matrix by the overhang
        wide, tall = min(width - left - overhang, 1.6 * count), 0.42 * max(count, 3)
        height = tall + 2.9
        note = "1: the same after refitting the strut law; boxed: one set"
        figure = titled_figure(height, "What can these data not tell apart?", note)
        axes = figure.add_axes((left / width, 0.3 / height, wide / width, tall / height))
        # Blue, the more opaque the more alike: on a dark page the cells of what is unlike are dark.
        cells = np.zeros((*matrix.shape, 4))
        cells[..., :3], cells[..., 3] = to_rgb(BLUE), np.clip(matrix, 0.0, 1.0) ** 1.5
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
            if i != j and value > 0.5:
                axes.text(
                    j, i, f"{value:.2f}".replace("0.", ".", 1), ha="center", va="center", size=9,
                    color="white" if value > OPAQUE else INK,
                )  # fmt: skip
        for start, size in sets:
            axes.add_patch(
                Rectangle((start - 0.5, start - 0.5), size, size, fill=False, edgecolor=SECOND_ORANGE, lw=2.6,
                          zorder=5, clip_on=False)
            )  # fmt: skip
        return figure


def confounding_in_order(given: Confounding) -> tuple[list[str], FloatArray, list[tuple[int, int]]]:
    """Names and matrix with the sets beside each other, the largest first, and (first place, size) of each set.

    Within a set and after the sets, each effect follows the one that it is most like.
    """
    names = [plain(name) for name in given.names]
    matrix = np.array(given.rounded, dtype=float).reshape(len(names), len(names))
    order: list[int] = []
    boxes = []
    for members in sorted(given.sets, key=len, reverse=True):
        boxes.append((len(order), len(members)))
        order += _chain([given.names.index(member) for member in members], matrix)
    order += _chain([place for place in range(len(names)) if place not in order], matrix)
    return [names[place] for place in order], matrix[np.ix_(order, order)], boxes


def _chain(places: Sequence[int], matrix: FloatArray) -> list[int]:
    """Each next to the one most like it, from the pair that is most alike."""
    left = list(places)
    if len(left) < 3:
        return left
    inside = matrix[np.ix_(left, left)] - np.eye(len(left)) * 2.0
    chain = [left.pop(int(np.argmax(inside.max(axis=1))))]
    while left:
        chain.append(left.pop(int(np.argmax([matrix[chain[-1], place] for place in left]))))
    return chain


@drawn
def detectable_png(diagnosis: Diagnosis) -> Figure:
    """PNG: the smallest size of each effect that these data would show, as the change of stiffness that it makes."""
    from matplotlib.ticker import LogLocator, NullLocator

    seen = sorted(
        (smallest for smallest in diagnosis.detectable if smallest.seen),
        key=lambda smallest: percent_of(smallest.rms) or 0.0,
    )
    rows = [*seen, *(smallest for smallest in diagnosis.detectable if not smallest.seen)]
    height = 1.7 + 0.32 * max(len(rows), 3)
    note = "smallest size seen with 80 % power at 5 % family-wise, and the change it makes; less stays unseen"
    with house_style():
        figure = titled_figure(height, "What could be there unseen?", note)
        axes = figure.add_axes((3.6 / 14.0, 0.58 / height, 9.9 / 14.0, 1.0 - 1.55 / height))
        sizes = [percent_of(smallest.rms) or 0.0 for smallest in seen] or [1.0]
        # From a tenth of a per cent to far beyond the readings: equal steps of the logarithm.
        start, reach = 0.7 * min(sizes), 4.0 * max(sizes)
        axes.set_xscale("log")
        axes.set_xlim(start, reach)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_ylim(len(rows) - 0.4, -0.6)
        for y, (smallest, value) in enumerate(zip(seen, sizes, strict=False)):
            axes.plot([start, value], [y, y], color=BLUE, lw=1.5, alpha=0.5, zorder=2)
            axes.plot(value, y, "o", color=BLUE, ms=7, zorder=3)
            text = smallest_text(smallest)
            axes.annotate(text, (value, y), (9, 0), textcoords="offset points", va="center", size=9.5)
        for y, smallest in enumerate(rows[len(seen) :], start=len(seen)):
            change = percent(percent_of(smallest.rms))
            text = f"hardly seen at any size within its bounds, which change the stiffness by {change}"
            axes.annotate(
                text, (start, y), (6, 0), textcoords="offset points", va="center", size=9.5, color=UNREACHABLE_RED
            )
        axes.set_yticks(range(len(rows)), [shortened(hidden_name(smallest), 42) for smallest in rows], color=INK)
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False, axis="y")
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlabel("change of stiffness that this size makes, rms over the readings, %")
        return figure


def envelope_png(gate: Gate) -> Drawing | None:
    """PNG: the base model's weighted sum of squares among simulated ones; None where they are all 0."""
    from matplotlib.ticker import MaxNLocator, NullLocator

    simulated = np.array([json_number(square) for square in np.sort(gate.simulated).tolist()], dtype=float)
    shown, observed = simulated[simulated > 0.0], json_number(gate.squares) or 0.0
    if not len(shown):
        return None
    chances = (("all", gate.probability), ("squares", gate.squares_probability),
               ("structure", gate.structure_probability), ("gain", gate.gain_probability))  # fmt: skip
    p_values = ", ".join(f"{name} {significant(json_number(value, 3), 2)}" for name, value in chances)
    with house_style():
        note = "weighted sum of squares: simulated as if the model were right (grey), and observed (orange)"
        figure = titled_figure(4.2, "Is the model without a further effect good enough?", note)
        axes = figure.add_axes((0.04, 0.1, 0.92, 0.62))
        ends = [*shown, observed] if observed > 0.0 else [*shown]
        # Wild readings and a noise that is itself uncertain give a long tail: equal steps of the logarithm.
        axes.hist(shown, bins=np.geomspace(0.98 * min(ends), 1.02 * max(ends), 41).tolist(), color=FAINT, zorder=2)
        axes.set_xscale("log")
        low, high = axes.get_xlim()
        ticks = MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
        axes.set_xticks([tick for tick in ticks if low < tick < high], minor=False)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        if observed > 0.0:
            axes.axvline(observed, color=SECOND_ORANGE, lw=2.2, zorder=3)
            right = observed > np.sqrt(min(ends) * max(ends))
            axes.annotate(
                f"{observed:.4g}", (observed, 0.97), xycoords=("data", "axes fraction"), xytext=(-6 if right else 6, 0),
                textcoords="offset points", ha="right" if right else "left", va="top", color=SECOND_ORANGE,
            )  # fmt: skip
        figure.text(0.25 / 14.0, 1.0 - 0.93 / 4.2, f"p values: {p_values}", size=9.5, color=MUTED)
        axes.set_yticks([])
        axes.grid(visible=False, axis="y")
        axes.spines[["top", "right", "left"]].set_visible(False)
        return drawing(figure)
