"""Labels beside places of a picture, and the heading and legend of pictures of a path."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import IdentityTransform

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.report.analysis_tables import headline_text
from toolpath_stiff.report.colours import INK, MUTED
from toolpath_stiff.report.pictures.style import Look
from toolpath_stiff.report.words import plain, shortened

Box = tuple[float, float, float, float]  # left, low, right, high in pixels

REACHES = (16.0, 30.0, 48.0, 70.0)  # pixels between a place and its label
CHARACTER, LINE = 7.2, 17.0  # pixels of a label: width of a character, height
RING, RING_EDGE = 8.0, 7.0  # pixels around a place that no label covers; where the line to its label begins


def label_places(axes: Axes, places: Sequence[tuple[float, float]], texts: Sequence[str], below: bool = False) -> None:
    """Ring places and write beside each, where no other label or ring nor the edge of the axes is in the way.

    `below`: rather below the place (a low point of a curve) than beside it.
    """
    spots = np.reshape(places, (-1, 2))
    pixels = axes.transData.transform(spots)
    taken = [(x - RING, y - RING, x + RING, y + RING) for x, y in pixels.tolist()]
    ground = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    leaders = []
    for place, text in zip(pixels, texts, strict=True):
        box = _free_box(axes, (float(place[0]), float(place[1])), CHARACTER * len(text) + 6.0, taken, below)
        taken.append(box)
        middle, half = np.add(box[:2], box[2:]) / 2.0, np.subtract(box[2:], box[:2]) / 2.0
        axes.text(
            middle[0], middle[1], text, transform=IdentityTransform(), ha="center", va="center", zorder=10, bbox=ground
        )
        way = middle - place
        edge = np.min(half / np.maximum(np.abs(way), 1e-9))  # where the way meets the box
        start = RING_EDGE / np.hypot(*way)
        if start + edge < 1.0:
            leaders += [place + start * way, middle - edge * way, (np.nan, np.nan)]
    axes.plot(*np.reshape(leaders, (-1, 2)).T, color=INK, linewidth=0.8, transform=IdentityTransform(), zorder=10)
    for colour, width in (("white", 3.5), (INK, 1.6)):
        ring: Look = {"markeredgecolor": colour, "markeredgewidth": width, "markerfacecolor": "none"}
        axes.plot(*spots.T, marker="o", markersize=9.0, linestyle="none", zorder=10, **ring)


def _free_box(axes: Axes, place: tuple[float, float], width: float, taken: Sequence[Box], below: bool) -> Box:
    """Where a label of this width, in pixels, covers nothing that is taken."""
    x, y = place
    sides = [(1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1)]
    if below:
        sides.sort(key=lambda side: (side[1], abs(side[0])))
    edge = axes.get_window_extent()
    for reach in REACHES:
        for dx, dy in sides:
            left = x + dx * reach - (width if dx < 0 else width / 2 if dx == 0 else 0.0)
            low = y + dy * reach - LINE / 2
            right, high = left + width, low + LINE
            inside = edge.x0 < left and right < edge.x1 and edge.y0 < low and high < edge.y1
            free = all(right < box[0] or box[2] < left or high < box[1] or box[3] < low for box in taken)
            if free and (inside or reach == REACHES[-1]):
                return left, low, right, high
    return x + 16.0, y + 16.0 - LINE / 2, x + 16.0 + width, y + 16.0 + LINE / 2


def add_heading(figure: Figure, analysis: Analysis) -> None:
    """Program, machine, load, mean and range, and those of the plunges, above everything."""
    width, height = figure.get_size_inches()
    name = shortened(plain(analysis.program.name), 70)
    text = (
        f"machine {shortened(plain(analysis.machine.name), 40)}   ·   load {analysis.load}   ·   "
        f"{headline_text(analysis.figures, '   ·   ')}"
    )
    figure.text(0.35 / width, 1.0 - 0.42 / height, name, size=15.0, weight="bold")
    figure.text(0.35 / width, 1.0 - 0.70 / height, text, size=10.5, color=MUTED)


def add_legend(figure: Figure, keys: Sequence[tuple[Artist, str]], corner: tuple[float, float], **layout: Any) -> None:
    """What lines, markers and surfaces mean; `corner` in parts of the figure, the rest as of matplotlib's legend."""
    if keys:
        artists, texts = zip(*keys, strict=True)
        figure.legend(artists, texts, bbox_to_anchor=corner, borderaxespad=0.0, frameon=False, **layout)
