"""Picture of cutting force coefficients: mean forces of slots over the feed, with the fitted lines."""

import numpy as np
from matplotlib.figure import Figure

from toolpath_stiff.arrays import product
from toolpath_stiff.cutting.identification import slot_responses
from toolpath_stiff.readings.forces import CoefficientFit
from toolpath_stiff.report.colours import BLUE, ORANGE
from toolpath_stiff.report.pictures.style import new_figure, panel
from toolpath_stiff.units import mm_from_m, um_from_m

NOTE = "Points: measured, over whole turns. Lines: fitted, with their band of 95 %; left of the points extrapolated."
TITLES = ("along the feed", "to its left", "along the tool")


def lines(fit: CoefficientFit) -> Figure:
    """Mean forces on the tool, one panel per direction, one line per depth with its 95 % band."""
    name = fit.coefficients.material or "cutting forces"
    figure = new_figure(12.0, 4.6, f"{name}: mean force of {len(fit.records)} slots on the tool", NOTE)
    panels = [panel(figure, 0.8 + 3.95 * k, 0.7, 3.1, 2.75) for k in range(3)]
    grid = np.linspace(0.0, 1.1 * fit.feed.max(), 45)[1:]
    for depth in np.unique(fit.depth):
        response = slot_responses(fit.cutter, grid, np.full(len(grid), depth))
        mean = product(response, fit.coefficients.values[:, None])[..., 0]
        variance = (product(response, fit.coefficients.covariance) * response).sum(axis=-1)
        half = fit.reach * np.sqrt(np.maximum(variance, 0.0))
        for axes, line, reach, points in zip(panels, mean.T, half.T, fit.force.T, strict=True):
            axes.fill_between(um_from_m(grid), line - reach, line + reach, color=BLUE, alpha=0.18, linewidth=0)
            axes.plot(um_from_m(grid), line, color=BLUE, linewidth=1.4)
            chosen = fit.depth == depth
            axes.plot(um_from_m(fit.feed[chosen]), points[chosen], "o", color=ORANGE, markersize=4.5)
            deep = f"{mm_from_m(float(depth)):.3g} mm deep"
            axes.annotate(
                deep, (um_from_m(grid[0]), line[0]), (6, 0), textcoords="offset points", fontsize=8, va="center"
            )
    for axes, title, points in zip(panels, TITLES, fit.force.T, strict=True):
        axes.set_title(title if np.isfinite(points).any() else f"{title}: not recorded")
        axes.set(xlabel="feed per tooth, \u00b5m", xlim=(0.0, None))
    panels[0].set_ylabel("force, N")
    return figure


PICTURES = {"forces.png": lines}
