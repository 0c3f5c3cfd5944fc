"""`cut.png`: the finished part, coloured by the error of its surface."""

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.report.colours import CLASSES, ERROR, FAINT, MUTED
from toolpath_stiff.report.cut import errors_in_words
from toolpath_stiff.report.pictures.labels import add_legend
from toolpath_stiff.report.pictures.style import new_figure, panel
from toolpath_stiff.report.surface import error_limit, surface_of
from toolpath_stiff.report.words import plain, shortened
from toolpath_stiff.units import mm_from_m, rad_from_deg, um_from_m

WIDTH, MOST_HEIGHT = 12.0, 9.0  # inches
TOP, BOTTOM, BESIDE = 1.35, 1.0, 0.4
YAW, PITCH = 30.0, 40.0  # deg, direction from which the part is seen
MOST_QUADS = 30_000  # of walls and of floors


def part(analysis: Analysis) -> Figure | None:
    """The finished part seen from in front and above; None without a cut."""
    cut = analysis.cut
    if cut is None:
        return None
    quads, error, _ = surface_of(cut, MOST_QUADS)
    across, up, near = _seen(mm_from_m(quads))
    order = np.argsort(near, kind="stable")
    limit = um_from_m(error_limit(cut))
    span = float(np.ptp(across)), float(np.ptp(up))
    scale = min((WIDTH - 2 * BESIDE) / span[0], (MOST_HEIGHT - TOP - BOTTOM) / span[1])
    height = TOP + BOTTOM + span[1] * scale
    document = analysis.to_dict()["cut"]
    title = f"{shortened(plain(analysis.program.name), 60)}: error of the finished surface"
    figure = new_figure(WIDTH, height, title, f"walls: {errors_in_words(document['walls'])}", BESIDE)
    floors = f"floors: {errors_in_words(document['floors'])}"
    figure.text(BESIDE / WIDTH, 1.0 - 0.92 / height, floors, size=9.5, color=MUTED)
    axes = panel(figure, (WIDTH - span[0] * scale) / 2.0, BOTTOM, span[0] * scale, span[1] * scale)
    colours = colormaps[ERROR].resampled(CLASSES)(Normalize(-limit, limit)(um_from_m(error)))
    colours[np.isnan(error)] = to_rgba(FAINT)
    shapes = np.stack([across, up], axis=2)[order]
    axes.add_collection(
        PolyCollection(list(shapes), facecolors=colours[order], edgecolors=colours[order], linewidths=0.4)
    )
    axes.set(xlim=(across.min(), across.max()), ylim=(up.min(), up.max()))
    axes.set_axis_off()
    bar = panel(figure, BESIDE + 0.2, 0.6, 5.0, 0.2)
    mappable = ScalarMappable(Normalize(-limit, limit), colormaps[ERROR].resampled(CLASSES))
    label = "error of the surface, um: + material left, - cut too deep"
    figure.colorbar(mappable, cax=bar, orientation="horizontal", extend="both", label=label)
    add_legend(figure, [(Patch(color=FAINT), "not cut, or plunged")], (0.55, 0.75 / height), loc="center left")
    return figure


def _seen(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m, 4) right and (m, 4) up on the picture, and (m,) nearness, of points (m, 4, 3); as the page sees them."""
    sa, ca = np.sin(rad_from_deg(YAW)), np.cos(rad_from_deg(YAW))
    sp, cp = np.sin(rad_from_deg(PITCH)), np.cos(rad_from_deg(PITCH))
    x, y, z = np.moveaxis(points, 2, 0)
    near = sa * cp * x - ca * cp * y + sp * z
    return ca * x + sa * y, -sa * sp * x + ca * sp * y + cp * z, near.mean(axis=1)
