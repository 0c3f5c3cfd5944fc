"""The paper's Figure 3: mean error against the stiffness of the platform's bars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.report.diagnose_words import significant
from toolpath_stiff.report.figure import BLUE, MUTED, SECOND_ORANGE, house_style, new_figure
from toolpath_stiff.report.vector import Drawing, drawing

FloatArray = NDArray[np.float64]


def figure3_png(
    bars_N_per_m: Sequence[float] | FloatArray,
    error_percent: Sequence[float] | FloatArray,
    printed_points: Sequence[tuple[float, float]] = (),
    refitted_percent: Sequence[float] | FloatArray = (),
) -> Drawing:
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
        return drawing(figure)
