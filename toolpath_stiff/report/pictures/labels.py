"""Labels beside points of a picture, and the heading and legend of pictures of a path."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.report.analysis_tables import headline_text
from toolpath_stiff.report.colours import INK, MUTED
from toolpath_stiff.report.pictures.style import Look
from toolpath_stiff.report.words import plain, shortened

CHARACTER, LINE = 7.2, 17.0  # pixels of a label: width of a character, height
BESIDE = 12.0  # pixels from a place to its label


def label_places(axes: Axes, places: Sequence[tuple[float, float]], texts: Sequence[str], below: bool = False) -> None:
    """Ring points and write beside each, from the top down so that labels close together do not overlap.

    `below`: rather below the place (a low point of a curve) than above it.
    """
    spots, frame = np.reshape(places, (-1, 2)), axes.get_window_extent()
    ground = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    written: list[tuple[float, float]] = []  # the left end of a label and its height, in pixels
    in_data = axes.transData.inverted().transform
    for (x, y), text in sorted(
        zip(axes.transData.transform(spots).tolist(), texts, strict=True), key=lambda at: -at[0][1]
    ):
        wide = CHARACTER * len(text)
        side, near = ("left", x + BESIDE) if x + BESIDE + wide < frame.x1 else ("right", x - BESIDE)
        left = near if side == "left" else near - wide
        above = [height - LINE for other, height in written if abs(other - left) < wide]
        written.append((left, min([y + (-LINE if below else LINE), *above])))
        # A line and a text, as clipping an annotation's arrow at its text takes as long as drawing a view.
        ends = in_data([(x, y), (near, max(written[-1][1], frame.y0 + LINE / 2))])
        axes.plot(*ends.T, color=INK, linewidth=0.8, zorder=9.5, clip_on=False)
        axes.text(ends[1, 0], ends[1, 1], text, ha=side, va="center", zorder=10, bbox=ground)
    for colour, width in (("white", 3.5), (INK, 1.6)):
        ring: Look = {"markeredgecolor": colour, "markeredgewidth": width, "markerfacecolor": "none"}
        axes.plot(*spots.T, marker="o", markersize=9.0, linestyle="none", zorder=10, **ring)


def add_heading(figure: Figure, analysis: Analysis) -> None:
    """Write program, machine, load, mean and range, and those of the plunges, at the top."""
    width, height = figure.get_size_inches()
    name = shortened(plain(analysis.program.name), 70)
    text = (
        f"machine {shortened(plain(analysis.machine.name), 40)}   ·   load {analysis.load}   ·   "
        f"{headline_text(analysis.figures, '   ·   ')}"
    )
    figure.text(0.35 / width, 1.0 - 0.42 / height, name, size=15.0, weight="bold")
    figure.text(0.35 / width, 1.0 - 0.70 / height, text, size=10.5, color=MUTED)


def add_legend(figure: Figure, keys: Sequence[tuple[Artist, str]], corner: tuple[float, float], **layout: Any) -> None:
    """Add a legend of lines, markers, surfaces; `corner` in parts of the figure, the rest as in matplotlib's legend."""
    artists, texts = zip(*keys, strict=True)
    figure.legend(artists, texts, bbox_to_anchor=corner, borderaxespad=0.0, frameon=False, **layout)
