"""Figures in the house style, the colour scale of stiffness, and how a figure becomes PNG or SVG.

Pictures for pages: as PNG for a file, and as SVG whose colours are those of the page, light or dark.

The colours that pictures are drawn in stand for those of `page.css`; those that show data (colour maps) stay as they
are. Letters are outlines, so that nothing moves with the fonts of whoever reads the page.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import update_wrapper
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.report.words import headline_text, plain, shortened
from toolpath_stiff.units import n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.analysis import Analysis

P = ParamSpec("P")
Made = TypeVar("Made", bound=bytes)

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


class Picture(Generic[P, Made]):
    """A picture: called it is the bytes of a file, `figure` gives it as a matplotlib figure."""

    def __init__(self, draw: Callable[P, Figure], make: Callable[[Figure], Made]) -> None:
        self._draw, self._make = draw, make
        update_wrapper(self, draw)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> Made:
        """The picture as a file."""
        with house_style():
            return self._make(self._draw(*args, **kwargs))

    def figure(self, *args: P.args, **kwargs: P.kwargs) -> Figure:
        """The picture as a figure."""
        with house_style():
            return self._draw(*args, **kwargs)


def picture(draw: Callable[P, Figure]) -> Picture[P, bytes]:
    """Decorate a function that draws a figure: it makes a PNG."""
    return Picture(draw, png_bytes)


def drawn(draw: Callable[P, Figure]) -> Picture[P, Drawing]:
    """Decorate a function that draws a figure: it makes a PNG and, for pages, an SVG."""
    return Picture(draw, drawing)


def add_heading(figure: Figure, analysis: Analysis) -> None:
    """Program, machine, load, mean and range, and those of the plunges, above everything."""
    from toolpath_stiff.analysis.statistics import class_figures

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


FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CLASSES = 32  # colours; more cannot be told apart along a line, and each costs a drawing call
FENCE = 3.0  # interquartile ranges beyond the quartiles; Tukey, Exploratory Data Analysis, 1977: "far out"
UNREACHABLE, PLUNGE = -1, CLASSES  # without a colour of the scale; a lower class wins where segments are joined


def scale_limits(analysis: Analysis, show_plunges: bool = False) -> tuple[float, float]:
    """Ends of the colour scale in N/mm: lowest and highest of the headline, values far out (`FENCE`) set aside.

    A few short cuts, stiffer by far than the rest, would otherwise take all the contrast. The legend marks an end
    that values lie beyond. With `show_plunges` the plunges beside the headline are on the scale, all of them.
    """
    stiffness, weight = _scaled_samples(analysis)
    order = np.argsort(stiffness, kind="stable")
    length = np.cumsum(weight[order])
    lower, upper = stiffness[order[np.searchsorted(length, [0.25 * length[-1], 0.75 * length[-1]])]]
    reach = FENCE * (upper - lower)
    inside = stiffness[(stiffness >= lower - reach) & (stiffness <= upper + reach)]
    values = inside if np.ptp(inside) > 0.0 else stiffness
    low, high = float(values.min()), float(values.max())
    if show_plunges and analysis.set_aside.any():
        plunges = n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.set_aside])
        low, high = min(low, float(plunges.min())), max(high, float(plunges.max()))
    if high - low < 1e-6 * high:  # a constant: keep the scale from collapsing
        low, high = low * (1.0 - 1e-3), high * (1.0 + 1e-3)
    return low, high


def _scaled_samples(analysis: Analysis) -> tuple[FloatArray, FloatArray]:
    """Stiffness in N/mm and length of the headline samples.

    A program that only turns rotary axes has none: then every reachable cutting sample counts alike.
    """
    about, weight = analysis.headline, analysis.samples.weight
    if not about.any():
        about, weight = analysis.samples.cutting & analysis.at.reachable, np.ones(len(weight))
    return n_per_mm_from_n_per_m(analysis.at.stiffness[about]), weight[about]


def segment_classes(stiffness: FloatArray, limits: tuple[float, float]) -> IntArray:
    """(n,) class 0 to CLASSES - 1 of segments of the path.

    `stiffness` and `limits` in N/mm; values beyond the limits take the end classes; UNREACHABLE where there is none.
    """
    low, high = limits
    missing = np.isnan(stiffness)
    part = (np.where(missing, low, stiffness) - low) / (high - low)
    classes = np.clip((part * CLASSES).astype(np.int64), 0, CLASSES - 1)
    return np.where(missing, UNREACHABLE, classes)


def legend_extend(analysis: Analysis, limits: tuple[float, float]) -> str:
    """Which ends of the scale headline values lie beyond: "neither", "min", "max" or "both" (matplotlib's words)."""
    stiffness = _scaled_samples(analysis)[0]
    below, above = bool(stiffness.min() < limits[0]), bool(stiffness.max() > limits[1])
    return {(False, False): "neither", (True, False): "min", (False, True): "max"}.get((below, above), "both")


# Colour that is drawn -> property of page.css. Behind text, a colour of data is more opaque the larger its figure: the
# text may follow the page.
def _class_colours(start: float, end: float) -> list[str]:
    """CSS colours of the classes, weakest first: a part of viridis, perceptually uniform."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colour) for colour in colormaps[COLOUR_MAP](np.linspace(start, end, CLASSES))]


def page_colours() -> dict[str, list[str]]:
    """The classes' colours for the script of a page, on light and on dark."""
    # The lightest yellow does not show on white, nor the darkest violet on black.
    return {"colours": _class_colours(0.0, 0.93), "colours_dark": _class_colours(0.22, 1.0)}


PAGE_COLOURS = {
    "#ffffff": "card",
    INK: "ink",
    MUTED: "muted",
    GRID: "line",
    RAPID_GREY: "grey",
    FAINT: "grey",
    WITHIN: "soft",
    CHOSEN: "chosen",
    BLUE: "blue",
    LIGHT_BLUE: "pale-blue",
    SECOND_ORANGE: "orange",
    GREEN: "green",
    PURPLE: "purple",
    UNREACHABLE_RED: "red",
    PALE_RED: "pale-red",
}
MOST_MARKS = 4000  # of a picture; beyond, the marks are put in as one image: the browser would toil
FEW_MARKS = 50  # of one artist: lines and letters stay sharp
SHARP = 2 * DPI  # of that image
POINTS = 72.0  # per inch


class Drawing(bytes):
    """A picture as PNG, and the same as SVG to stand in a page."""

    svg: str


def drawing(figure: Figure) -> Drawing:
    """The figure as it is written to a file and as it stands in a page. Within `house_style`."""
    found = Drawing(png_bytes(figure))
    found.svg = svg_text(figure)
    return found


def svg_text(figure: Figure) -> str:
    """The figure as an SVG element in the page's colours; the same figure gives the same text."""
    import matplotlib as mpl

    heavy = _rasterized(figure)
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "tps", "svg.fonttype": "path", "svg.image_inline": True}):
        nothing: dict[str, Any] = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(buffer, format="svg", facecolor="none", dpi=SHARP if heavy else DPI, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<style .*?</style>|<!--.*?-->", "", text, flags=re.S)
    width, height = (POINTS * inch for inch in figure.get_size_inches())
    size = f'viewBox="0 0 {width:g} {height:g}" style="--natural:{DPI * width / POINTS:.0f}px"'
    opening = f'<svg {size} xmlns:xlink="http://www.w3.org/1999/xlink" aria-hidden="true">'
    text = re.sub(r"<svg [^>]*>", opening, text, count=1)
    text = re.sub(r"#[0-9a-f]{6}\b", lambda match: _page_colour(match[0]), text)
    return re.sub(r"\s*\n\s*", "\n", text).strip()


def _page_colour(colour: str) -> str:
    name = PAGE_COLOURS.get(colour)
    return f"var(--{name})" if name else colour


def _rasterized(figure: Figure) -> bool:
    """Mark what has many marks to be put in as an image, where there are too many in all; whether that is so."""
    marks: list[tuple[Artist, int]] = []
    for axes in figure.axes:
        marks += [(line, np.size(line.get_xdata())) for line in axes.lines]
        marks += [(one, max(np.shape(one.get_offsets())[0], len(one.get_paths()))) for one in axes.collections]
    if sum(count for _, count in marks) <= MOST_MARKS:
        return False
    for artist, count in marks:
        if count > FEW_MARKS:
            artist.set_rasterized(True)
    return True
