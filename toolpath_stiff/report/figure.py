"""What the pictures share: their style, PNG bytes that depend on nothing but the figure, the heading."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.analysis.statistics import class_figures
from toolpath_stiff.report.wording import headline_text, plain, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.analysis import Analysis

DPI = 100
INK, MUTED, GRID = "#1f2933", "#616e7c", "#e4e7eb"
PLUNGE_SLATE, RAPID_GREY, UNREACHABLE_RED, SECOND_ORANGE = "#52606d", "#9aa5b1", "#d64545", "#de6b12"
BLUE, LIGHT_BLUE, GREEN, PURPLE, PALE_RED = "#2457a6", "#7ea6d8", "#2f855a", "#7b4fa0", "#f7d9dd"
CHOSEN, WITHIN, FAINT = "#e3edfa", "#e9edf2", "#b8c1cc"  # behind what is chosen; within bounds; lines that only guide
COLOUR_MAP = "viridis"
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same glyphs on every machine
    "font.size": 10.0,
    "axes.edgecolor": "#9aa5b1",
    "axes.labelcolor": INK,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "text.color": INK,
    "text.parse_math": False,  # a dollar sign in a program's name is a dollar sign
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "agg.path.chunksize": 20000,
    "path.snap": False,  # lines along an axis would jump to whole pixels and leave gaps in a dense pattern
}


@contextmanager
def house_style() -> Iterator[None]:
    """Defaults of matplotlib with our style, whatever the user's own settings are; undone at the end."""
    import matplotlib as mpl

    with mpl.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """An empty figure in inches, drawn without pyplot and without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG without the metadata that would tell the version of matplotlib."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()


def add_heading(figure: Figure, analysis: Analysis) -> None:
    """Program, machine, load, mean and range, and those of the plunges, above everything."""
    width, height = figure.get_size_inches()
    figures = class_figures(analysis, np.arange(len(analysis.samples)))
    figure.text(
        0.35 / width,
        1.0 - 0.42 / height,
        shortened(plain(analysis.program.name), 70),
        fontsize=15,
        fontweight="bold",
    )
    figure.text(
        0.35 / width,
        1.0 - 0.70 / height,
        f"machine {shortened(plain(analysis.machine.name), 40)}   ·   load {analysis.load}   ·   "
        f"{headline_text(figures, '   ·   ')}",
        fontsize=10.5,
        color=MUTED,
    )


def label_places(axes: Axes, places: Sequence[tuple[float, float]], texts: Sequence[str], below: bool = False) -> None:
    """Ring places and write beside each, where no other label or ring nor the edge of the axes is in the way.

    `below`: rather below the place (a low point of a curve) than beside it.
    """
    taken = []
    for x, y in axes.transData.transform(np.reshape(places, (-1, 2))):
        taken.append((float(x) - 8.0, float(y) - 8.0, float(x) + 8.0, float(y) + 8.0))
    for at, text in zip(places, texts, strict=True):
        _label_place(axes, at, text, taken, below)


def _label_place(
    axes: Axes, at: tuple[float, float], text: str, taken: list[tuple[float, float, float, float]], below: bool
) -> None:
    """One ring and its label; `taken` holds boxes in pixels (x0, y0, x1, y1) to keep clear of, and gets the label's."""
    sides = [(1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1)]
    if below:
        sides.sort(key=lambda side: (side[1], abs(side[0])))
    x, y = axes.transData.transform(at)
    width, height = 7.2 * len(text) + 6.0, 17.0  # pixels, at 10 points and 100 dpi
    box = axes.get_window_extent()
    chosen = None
    for reach in (16.0, 30.0, 48.0, 70.0):
        for dx, dy in sides:
            left = x + dx * reach - (width if dx < 0 else width / 2 if dx == 0 else 0.0)
            base = y + dy * reach - height / 2
            spot = (left, base, left + width, base + height)
            inside = box.x0 < spot[0] and spot[2] < box.x1 and box.y0 < spot[1] and spot[3] < box.y1
            free = all(spot[2] < t[0] or t[2] < spot[0] or spot[3] < t[1] or t[3] < spot[1] for t in taken)
            if free and (inside or (chosen is None and reach > 60.0)):
                chosen = spot
                break
        if chosen:
            break
    chosen = chosen or (x + 16.0, y + 16.0 - height / 2, x + 16.0 + width, y + 16.0 + height / 2)
    taken.append(chosen)
    axes.plot(*at, "o", markersize=9, markerfacecolor="none", markeredgecolor="white", markeredgewidth=3.5, zorder=8)
    axes.plot(*at, "o", markersize=9, markerfacecolor="none", markeredgecolor=INK, markeredgewidth=1.6, zorder=9)
    points = 72.0 / DPI
    axes.annotate(
        text,
        at,
        xytext=(((chosen[0] + chosen[2]) / 2 - x) * points, ((chosen[1] + chosen[3]) / 2 - y) * points),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=10,
        zorder=10,
        bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
        arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.8, "shrinkB": 5.0},
    )
