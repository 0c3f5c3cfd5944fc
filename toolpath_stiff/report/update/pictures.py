"""Pictures of an update: the error step by step, and the paper's Figure 3."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.report.figure import BLUE, INK, MUTED, SECOND_ORANGE, WITHIN, drawn, house_style, new_figure
from toolpath_stiff.report.words import percent, plain, shortened, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.correction.result import Update
    from toolpath_stiff.correction.strut_law import BarCurve


@drawn
def error_ladder_png(update: Update) -> Figure:
    """PNG: mean error from the first model to the last, in sample and at left-out points, with the noise floor.

    What was tried from the last model and not taken stands beside it; bars are the standard errors of each fall.
    """
    document, floor = update.document, update.document["noise_floor_percent"]
    taken, down = document["steps"], document["rejected"]
    steps = [*taken, *down]
    with house_style():
        figure = new_figure(max(11.0, 2.4 + 1.9 * len(steps)), 5.2)
        width, height = figure.get_size_inches()
        title = "What does each step do to the error?"
        figure.text(0.25 / width, 1.0 - 0.4 / height, title, size=14, weight="bold")
        axes = figure.add_axes((0.85 / width, 0.95 / height, 1.0 - 1.15 / width, 1.0 - 1.75 / height))
        places = np.arange(len(steps))
        held, inside = (
            np.array([step[key] for step in steps], dtype=float)
            for key in ("held_out_error_percent", "mean_abs_error_percent")
        )
        _draw_steps(axes, held, inside, len(taken))
        spread = np.array([step.get("held_out_se_percent") or 0.0 for step in steps])
        if spread.any():
            axes.errorbar(places, held, yerr=spread, fmt="none", ecolor=BLUE, elinewidth=1.5, capsize=4, zorder=4)
        axes.axhline(floor, color=SECOND_ORANGE, ls=":", lw=1.5, label=f"noise floor {percent(floor)}")
        _name_values(axes, held, {"xytext": (9, 7), "color": BLUE})
        _name_values(axes, inside, {"xytext": (-9, -14), "color": MUTED, "size": 9, "ha": "right"})
        axes.set_ylim(0.0, 1.25 * float(np.nanmax([*held, *inside, floor])) or 1.0)
        axes.set_xlim(-0.4, len(steps) - 0.3)
        names = [*(_step_text(step["name"]) for step in taken), *(shortened(step["effect"], 24) for step in down)]
        axes.set_xticks(places, names, color=INK, size=9)
        axes.set_ylabel("mean |modelled - measured| / measured, %", size=9.5)
        axes.grid(visible=False, axis="x")
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, ncol=3, loc="lower left", bbox_to_anchor=(-0.01, 1.0))
        return figure


def _draw_steps(axes: Axes, held: FloatArray, inside: FloatArray, taken: int) -> None:
    """Errors at left-out points and in sample: the first `taken` joined, those that were not taken apart."""
    x = np.arange(len(held))
    axes.plot(x[:taken], held[:taken], "o-", color=BLUE, lw=2.0, ms=9, label="at points left out", zorder=4)
    axes.plot(x[:taken], inside[:taken], "s--", color=MUTED, lw=1.3, ms=6, mfc="white", label="in sample", zorder=3)
    if taken < len(held):
        axes.axvspan(taken - 0.5, len(held) - 0.3, color=WITHIN, lw=0, zorder=0)
        axes.text(taken - 0.45, 0.97, "tried from there, not taken", color=MUTED, size=9, va="top",
                  transform=axes.get_xaxis_transform())  # fmt: skip
        axes.plot(x[taken:], held[taken:], "o", color=BLUE, ms=9, mfc="white", zorder=4)
        axes.plot(x[taken:], inside[taken:], "s", color=MUTED, ms=6, mfc="white", zorder=3)


def _name_values(axes: Axes, values: FloatArray, style: dict[str, Any]) -> None:
    """The figures beside the points."""
    for x, value in enumerate(values.tolist()):
        if np.isfinite(value):
            axes.annotate(percent(value), (x, value), textcoords="offset points", **style)


def _step_text(name: str) -> str:
    """The name of a step, with what its effect acts on below."""
    choices = ", ".join(re.findall(r"\(([^)]*)\)", name))
    lines = [shortened(plain(re.sub(r" \([^)]*\)", "", name)), 24), shortened(plain(choices), 28)]
    return "\n".join(filter(None, lines))


@drawn
def figure3_png(curve: BarCurve) -> Figure:
    """PNG of the paper's Figure 3: mean error against the stiffness of the platform's bars.

    With the machine's own strut law, and with the one that makes the error smallest for each platform.
    """
    bars, given, refitted = curve.bars[:-1], 100.0 * curve.error[:-1], 100.0 * curve.error_refitted[:-1]
    with house_style():
        figure = new_figure(11.0, 5.2)
        figure.text(0.03, 0.93, "How stiff must the platform be taken?", size=14, weight="bold")
        figure.text(0.03, 0.88, "Figure 3 of Clinton, Zhang and Wavering (1997), computed here", size=9.5, color=MUTED)
        axes = figure.add_axes((0.09, 0.13, 0.87, 0.68))
        axes.plot(bars, given, color=BLUE, lw=2.0, label="with the machine file's strut law")
        axes.plot(bars, refitted, color=MUTED, lw=1.5, ls="--", label="strut law refitted for each platform")
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: significant(value, 1))
        axes.set_xlabel("stiffness of each platform bar, N/m")
        axes.set_ylabel("mean |modelled - measured| / measured, %")
        axes.legend(frameon=False)
        return figure
