"""Figures in the house style, the colour scale of stiffness, and how a figure becomes PNG or SVG.

Pictures for pages: as PNG for a file, and as SVG whose colours are those of the page, light or dark.

The colours that pictures are drawn in stand for those of `page.css`; those that show data (colour maps) stay as they
are. Letters are outlines, so that nothing moves with the fonts of whoever reads the page.
"""

from __future__ import annotations

import io
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, update_wrapper
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, TypeVar

import numpy as np

from toolpath_stiff.units import MM_PER_INCH, m_from_mm

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure


P = ParamSpec("P")
Made = TypeVar("Made", bound=bytes)

DPI = 100
POINTS = 72.0  # per inch
DEFLATE = 3
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
    "axes.titley": 1.0,  # where it stands by itself as well; looking for what is in its way takes a tenth of a drawing
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

    settings = _settings()
    held: Any = mpl.rcParams  # a dict that checks each value: these have been
    before = {name: value for name, value in dict.items(held) if name in settings}
    try:
        dict.update(held, settings)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
            yield
    finally:
        dict.update(held, before)


@cache
def _settings() -> dict[str, Any]:
    """Every setting of matplotlib in the house style, the backend left out, checked once and not for each picture."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        return {name: value for name, value in dict.items(mpl.rcParams) if name != "backend"}


def new_figure(width: float, height: float) -> Figure:
    """An empty figure in inches, drawn without pyplot and without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG, without metadata.

    An opaque picture of lines: no alpha, no filter, and a quick level of deflate; a third of the time of the general
    writer, which tries every filter on every row, for as many bytes. ISO/IEC 15948, "Portable Network Graphics".
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())
    height, width, _ = pixels.shape
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)  # the first byte of a row names its filter
    for channel in range(3):  # much faster than three bytes at a time
        rows[:, 1 + channel :: 3] = pixels[:, :, channel]
    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    size = struct.pack(">2IB", *(2 * [round(DPI / m_from_mm(MM_PER_INCH))]), 1)
    chunks = {b"IHDR": header, b"pHYs": size, b"IDAT": zlib.compress(rows.data, DEFLATE), b"IEND": b""}
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, content) for kind, content in chunks.items())


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


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


CLASSES = 32  # colours; more cannot be told apart along a line, and each costs a drawing call


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
