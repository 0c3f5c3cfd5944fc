"""Pictures of an update: the error step by step, before and after, and the paper's Figure 3."""

import re

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.correction.result import Update
from toolpath_stiff.report.colours import BLUE, INK, MUTED, ORANGE, WITHIN
from toolpath_stiff.report.pictures.before_after import Fits, before_after
from toolpath_stiff.report.pictures.style import Look, new_figure, open_frame, panel
from toolpath_stiff.report.words import percent, plain, shortened, significant


def error_ladder(update: Update) -> Figure:
    """Mean error from the first model to the last, in sample and at left-out points, with the noise floor.

    What was tried from the last model and not taken stands beside it; bars are the standard errors of each fall.
    """
    document, floor = update.document, update.document["noise_floor_percent"]
    taken, down = document["steps"], document["rejected"]
    steps = [*taken, *down]
    width = max(11.0, 2.4 + 1.9 * len(steps))
    figure = new_figure(width, 5.2, "What does each step do to the error?")
    axes = panel(figure, 0.85, 0.95, width - 1.15, 3.45)
    places = np.arange(len(steps))
    held, inside = (
        np.array([step[key] for step in steps], dtype=float)
        for key in ("held_out_error_percent", "mean_abs_error_percent")
    )
    _draw_steps(axes, held, inside, len(taken))
    spread = np.array([step.get("held_out_se_percent") or 0.0 for step in steps])
    if spread.any():
        axes.errorbar(places, held, yerr=spread, fmt="none", ecolor=BLUE, elinewidth=1.5, capsize=4, zorder=4)
    axes.axhline(floor, color=ORANGE, ls=":", lw=1.5, label=f"noise floor {percent(floor)}")
    _name_values(axes, held, {"xytext": (9, 7), "color": BLUE})
    _name_values(axes, inside, {"xytext": (-9, -14), "color": MUTED, "size": 9, "ha": "right"})
    axes.set(ylim=(0.0, 1.25 * float(np.nanmax([*held, *inside, floor])) or 1.0), xlim=(-0.4, len(steps) - 0.3))
    names = [*(_step_text(step["name"]) for step in taken), *(shortened(step["effect"], 24) for step in down)]
    axes.set_xticks(places, names, color=INK, size=9)
    axes.set_ylabel("mean |modelled - measured| / measured, %", size=9.5)
    axes.grid(visible=False, axis="x")
    open_frame(axes)
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


def _name_values(axes: Axes, values: FloatArray, style: Look) -> None:
    """The figures beside the points."""
    for x, value in enumerate(values.tolist()):
        if np.isfinite(value):
            axes.annotate(percent(value), (x, value), textcoords="offset points", **style)


def _step_text(name: str) -> str:
    """The name of a step, with what its effect acts on below."""
    choices = ", ".join(re.findall(r"\(([^)]*)\)", name))
    lines = [shortened(plain(re.sub(r" \([^)]*\)", "", name)), 24), shortened(plain(choices), 28)]
    return "\n".join(filter(None, lines))


def figure3(update: Update) -> Figure | None:
    """The paper's Figure 3: mean error against the stiffness of the platform's bars.

    With the machine's own strut law, and with the one that makes the error smallest for each platform.
    """
    if (curve := update.bars) is None:
        return None
    bars, given, refitted = curve.bars[:-1], 100.0 * curve.error[:-1], 100.0 * curve.error_refitted[:-1]
    paper = "Figure 3 of Clinton, Zhang and Wavering (1997), computed here"
    figure = new_figure(11.0, 5.2, "How stiff must the platform be taken?", paper)
    axes = panel(figure, 0.99, 0.68, 9.57, 3.54)
    axes.plot(bars, given, color=BLUE, lw=2.0, label="with the machine file's strut law")
    axes.plot(bars, refitted, color=MUTED, lw=1.5, ls="--", label="strut law refitted for each platform")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(lambda value, _: significant(value, 1))
    axes.set(xlabel="stiffness of each platform bar, N/m", ylabel="mean |modelled - measured| / measured, %")
    axes.legend(frameon=False)
    return figure


def fits(update: Update) -> Figure:
    """Where model and measurements differ, before and after."""
    first, last = update.steps[0], update.steps[-1]
    held_out, refitted = update.document["steps"][-1]["held_out_error_percent"], 100.0 * update.refitted.error
    return before_after(Fits(update.task.data.of_tip, first.residual, last.residual, last.title, held_out, refitted))


PICTURES = {"ladder.png": error_ladder, "before_after.png": fits, "figure3.png": figure3}
