"""Pictures of an update: the error step by step, and the paper's Figure 3."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.report.figure import BLUE, INK, MUTED, SECOND_ORANGE, WITHIN, drawn, house_style, new_figure
from toolpath_stiff.report.words import percent, plain, shortened, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_of(step: Mapping[str, Any], name: str) -> float | None:
    """A finite number of a step, or None."""
    value = step.get(name)
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


@drawn
def error_ladder_png(
    steps: Sequence[Mapping[str, Any]],
    noise_floor_percent: float | None = None,
    title: str = "How the error falls",
    turned_down: Sequence[Mapping[str, Any]] = (),
) -> Figure:
    """PNG: mean error from the first model to the last, in sample and at left-out points, with the noise floor.

    Parameters
    ----------
    steps
        Each with `name`, `mean_abs_error_percent`, `held_out_error_percent`; optionally `held_out_se_percent`, the
        standard error of the fall from the step before, and `remark`.
    noise_floor_percent
        Mean absolute error that scatter alone would leave: 0.80 times its standard deviation.
    title
        Heading.
    turned_down
        Further steps that were tried from the last one and not taken; keys as of `steps`.
    """
    taken = len(steps)
    steps = [*steps, *turned_down]
    with house_style():
        figure = new_figure(max(11.0, 2.4 + 1.9 * len(steps)), 5.2)
        width, height = figure.get_size_inches()
        figure.text(0.25 / width, 1.0 - 0.4 / height, plain(title), size=14, weight="bold")
        axes = figure.add_axes((0.85 / width, 0.95 / height, 1.0 - 1.15 / width, 1.0 - 1.75 / height))
        at = np.arange(len(steps))
        held, inside = (
            np.array(
                [figure_of(step, key) if figure_of(step, key) is not None else np.nan for step in steps], dtype=float
            )
            for key in ("held_out_error_percent", "mean_abs_error_percent")
        )
        _draw_steps(axes, held, inside, taken)
        spread = np.array([figure_of(step, "held_out_se_percent") or 0.0 for step in steps])
        if spread.any():
            axes.errorbar(at, held, yerr=spread, fmt="none", ecolor=BLUE, elinewidth=1.5, capsize=4, zorder=4)
        if noise_floor_percent is not None:
            axes.axhline(
                noise_floor_percent, color=SECOND_ORANGE, ls=":", lw=1.5,
                label=f"noise floor {percent(noise_floor_percent)}",
            )  # fmt: skip
        known = np.array([*held, *inside, noise_floor_percent or 0.0])
        top = float(np.nanmax(known)) if np.isfinite(known).any() else 1.0
        _name_values(axes, held, {"xytext": (9, 7), "color": BLUE})
        _name_values(axes, inside, {"xytext": (-9, -14), "color": MUTED, "size": 9, "ha": "right"})
        axes.set_ylim(0.0, 1.25 * top or 1.0)
        axes.set_xlim(-0.4, len(steps) - 0.3)
        axes.set_xticks(at, [_step_text(step) for step in steps], color=INK, size=9)
        axes.set_ylabel("mean |modelled - measured| / measured, %", size=9.5)
        axes.grid(visible=False, axis="x")
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, ncol=3, loc="lower left", bbox_to_anchor=(-0.01, 1.0))
        return figure


def _draw_steps(axes: Axes, held: FloatArray, inside: FloatArray, taken: int) -> None:
    """Errors at left-out points and in sample: the first `taken` joined, those that were not taken apart."""
    at = np.arange(len(held))
    axes.plot(at[:taken], held[:taken], "o-", color=BLUE, lw=2.0, ms=9, label="at points left out", zorder=4)
    axes.plot(at[:taken], inside[:taken], "s--", color=MUTED, lw=1.3, ms=6, mfc="white", label="in sample", zorder=3)
    if taken < len(held):
        axes.axvspan(taken - 0.5, len(held) - 0.3, color=WITHIN, lw=0, zorder=0)
        axes.text(taken - 0.45, 0.97, "tried from there, not taken", color=MUTED, size=9, va="top",
                  transform=axes.get_xaxis_transform())  # fmt: skip
        axes.plot(at[taken:], held[taken:], "o", color=BLUE, ms=9, mfc="white", zorder=4)
        axes.plot(at[taken:], inside[taken:], "s", color=MUTED, ms=6, mfc="white", zorder=3)


def _name_values(axes: Axes, values: FloatArray, style: dict[str, Any]) -> None:
    """The figures beside the points."""
    for x, value in enumerate(values.tolist()):
        if np.isfinite(value):
            axes.annotate(percent(value), (x, value), textcoords="offset points", **style)


def _step_text(step: Mapping[str, Any]) -> str:
    lines = [shortened(plain(str(step.get("name") or "-")), 24)]
    if step.get("remark"):
        lines.append(shortened(plain(str(step["remark"])), 28))
    return "\n".join(lines)


@drawn
def figure3_png(
    bars_N_per_m: Sequence[float] | FloatArray,
    error_percent: Sequence[float] | FloatArray,
    printed_points: Sequence[tuple[float, float]] = (),
    refitted_percent: Sequence[float] | FloatArray = (),
) -> Figure:
    """PNG of the paper's Figure 3: mean error against the stiffness of the platform's bars.

    Parameters
    ----------
    bars_N_per_m
        (n,) stiffness of each bar.
    error_percent
        (n,) mean error of the model with the machine's own strut law.
    printed_points
        (bar stiffness N/m, error %) that the paper prints or draws.
    refitted_percent
        (n,) with the strut law that makes the error smallest for each platform, if known.
    """
    bars, errors = np.asarray(bars_N_per_m, dtype=float), np.asarray(error_percent, dtype=float)
    with house_style():
        figure = new_figure(11.0, 5.2)
        figure.text(0.03, 0.93, "How stiff must the platform be taken?", size=14, weight="bold")
        figure.text(0.03, 0.88, "Figure 3 of Clinton, Zhang and Wavering (1997), computed here", size=9.5, color=MUTED)
        axes = figure.add_axes((0.09, 0.13, 0.87, 0.68))
        axes.plot(bars, errors, color=BLUE, lw=2.0, label="with the machine file's strut law")
        if len(refitted_percent):
            axes.plot(
                bars, refitted_percent, color=MUTED, lw=1.5, ls="--", label="strut law refitted for each platform"
            )
        if len(printed_points):
            printed = np.asarray(printed_points, dtype=float)
            axes.plot(
                printed[:, 0], printed[:, 1], "o", ms=8, mfc="white", mec=SECOND_ORANGE, mew=2.0, label="the paper"
            )
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: significant(value, 1))
        axes.set_xlabel("stiffness of each platform bar, N/m")
        axes.set_ylabel("mean |modelled - measured| / measured, %")
        axes.legend(frameon=False)
        return figure
