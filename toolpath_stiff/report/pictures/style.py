"""The house style of pictures, places in inches, and how a figure becomes PNG, and SVG in the colours of a page."""

from __future__ import annotations

import io
import re
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from toolpath_stiff.report import colours
from toolpath_stiff.report.pages import Drawing
from toolpath_stiff.units import MM_PER_INCH, m_from_mm, number

DPI, POINTS = 100, 72.0  # per inch
DEFLATE = 3
MOST_MARKS = 4000  # of a picture; beyond, a page shows its PNG: the browser would toil
Look = dict[str, Any]  # arguments of matplotlib by name
STYLE: Look = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same glyphs on every machine
    "font.size": 10.0,
    "axes.edgecolor": colours.GREY,
    "axes.labelcolor": colours.INK,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # where it stands by itself as well; looking for what is in its way takes a tenth of a drawing
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": colours.GRID,
    "grid.linewidth": 0.8,
    "text.color": colours.INK,
    "text.parse_math": False,  # a dollar sign in a program's name is a dollar sign
    "xtick.color": colours.MUTED,
    "ytick.color": colours.MUTED,
    "agg.path.chunksize": 20000,
    "svg.hashsalt": "tps",  # the same picture gives the same text
    "svg.fonttype": "path",
    "path.snap": False,  # lines along an axis would jump to whole pixels and leave gaps in a dense pattern
}


@contextmanager
def house_style() -> Iterator[None]:
    """Defaults of matplotlib with our style, whatever the user's own settings are; undone at the end."""
    with mpl.rc_context(), warnings.catch_warnings():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)  # type: ignore[arg-type]
        warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
        yield


def new_figure(width: float, height: float, title: str = "", note: str = "", left: float = 0.3) -> Figure:
    """An empty figure in inches, without pyplot and without a display; a heading and, below, how it is read."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    figure.text(left / width, 1.0 - 0.4 / height, title, size=14, weight="bold")
    figure.text(left / width, 1.0 - 0.68 / height, note, size=9.5, color=colours.MUTED)
    return figure


def panel(figure: Figure, left: float, bottom: float, width: float, height: float, **options: Any) -> Axes:
    """Axes at a place in inches."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up), **options)


def in_thousands(*axes: Axis) -> None:
    """Write the figures along some axes as a page does, "45 123"."""
    for axis in axes:
        axis.set_major_formatter(lambda value, _: number(value))


def round_ticks(axis: Axis, low: float, high: float) -> None:
    """Round figures along a logarithmic axis, not so many that they touch, in thousands."""
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    steps = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if high < 12.0 * low else (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
    axis.set_major_locator(FixedLocator([v for p in powers for s in steps if low <= (v := s * p) <= high]))
    axis.set_minor_locator(NullLocator())
    in_thousands(axis)


def open_frame(axes: Axes, *sides: str) -> None:
    """Take away the frame at the top, to the right and at `sides`."""
    axes.spines[["top", "right", *sides]].set_visible(False)


def colour_scale(drawn: Any, bar: Axes, label: str, thousands: bool = True) -> None:
    """Put the scale of what was drawn in colours into axes of its own."""
    bar.figure.colorbar(drawn, cax=bar, label=label)
    if thousands:
        in_thousands(bar.yaxis)
    bar.grid(visible=False)


def picture_file(name: str, draw: Callable[..., Figure], result: Any, look: Mapping[str, Any]) -> bytes:
    """A picture as PNG or, as its name says, PDF, without metadata."""
    with house_style():
        canvas: Any = FigureCanvasAgg(draw(result, **look))
        if name.endswith(".pdf"):
            content = io.BytesIO()
            canvas.print_figure(
                content, format="pdf", metadata={"CreationDate": None, "Producer": None, "Creator": None}
            )
            return content.getvalue()
        canvas.draw()
    return _packed(np.asarray(canvas.buffer_rgba())[:, :, :3])


def drawing(draw: Callable[..., Figure | None], result: Any) -> Drawing | None:
    """A picture as it is written to a file and as it stands in a page; None where there is nothing to show.

    One drawing makes both: laying out axes and words takes most of the time.
    """
    with house_style():
        figure = draw(result)
        if figure is None:
            return None
        renderer = Both(*figure.canvas.get_width_height(), _marks(figure) <= MOST_MARKS)
        figure.patch.draw(renderer.pixels)  # a page has its own ground
        figure.patch.set_visible(False)
        figure.draw(renderer)  # type: ignore[arg-type]
        both = Drawing(_packed(np.asarray(renderer.pixels.buffer_rgba())[:, :, :3]))
        both.svg = renderer.vectors.text(*figure.get_size_inches()) if renderer.vectors else ""
        return both


def _marks(figure: Figure) -> int:
    """How many marks a figure has."""
    lines = sum(np.size(line.get_xdata()) for axes in figure.axes for line in axes.lines)
    return int(lines + sum(np.shape(many.get_offsets())[0] for axes in figure.axes for many in axes.collections))


def _packed(pixels: NDArray[np.uint8]) -> bytes:
    """Rows of pixels as PNG.

    No filter, and a quick level of deflate; a third of the time of the general writer, which tries every filter on
    every row, for as many bytes. ISO/IEC 15948, "Portable Network Graphics".
    """
    height, width, channels = pixels.shape
    rows = np.zeros((height, 1 + channels * width), dtype=np.uint8)  # the first byte of a row names its filter
    for channel in range(channels):  # much faster than all bytes of a pixel at a time
        rows[:, 1 + channel :: channels] = pixels[:, :, channel]
    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    size = struct.pack(">2IB", *(2 * [round(DPI / m_from_mm(MM_PER_INCH))]), 1)
    chunks = {b"IHDR": header, b"pHYs": size, b"IDAT": zlib.compress(rows.data, DEFLATE), b"IEND": b""}
    framed = (
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks.items()
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)


def _twice(name: str) -> Callable[..., None]:
    def draw(renderer: Both, *arguments: Any, **named: Any) -> None:
        getattr(renderer.pixels, name)(*arguments, **named)
        if renderer.vectors:
            getattr(renderer.vectors, name)(*arguments, **named)

    return draw


class Both:
    """A renderer of matplotlib that draws pixels and vectors in the same coordinates, pixels of the PNG.

    It answers as the renderer of the pixels does, as matplotlib's own `MixedModeRenderer` stands for another.
    """

    def __init__(self, width: float, height: float, vectors: bool) -> None:
        kind: Any = RendererAgg
        self.pixels = kind(width, height, DPI)
        self.vectors = Vectors(width, height) if vectors else None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.pixels, name)

    draw_path, draw_markers, draw_path_collection = map(_twice, ("draw_path", "draw_markers", "draw_path_collection"))
    draw_quad_mesh, draw_image, draw_text = map(_twice, ("draw_quad_mesh", "draw_image", "draw_text"))


class Vectors:
    """SVG of the same size; what matplotlib gives in points (dashes, letters, lines of a collection) grows to it."""

    GROWTH = DPI / POINTS

    def __init__(self, width: float, height: float) -> None:
        kind: Any = RendererSVG
        self._written = io.StringIO()
        self._svg = kind(width, height, self._written, image_dpi=int(POINTS))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._svg, name)

    def draw_path(self, gc: Any, *others: Any) -> None:
        """A path."""
        self._svg.draw_path(self._pen(gc), *others)

    def draw_markers(self, gc: Any, *others: Any) -> None:
        """Markers along a path."""
        self._svg.draw_markers(self._pen(gc), *others)

    def _pen(self, gc: Any) -> Any:
        style = gc.get_dashes()
        if style[1] is None:
            return gc
        pen = self._svg.new_gc()
        pen.copy_properties(gc)
        pen.set_dashes(*self._grown(style))
        return pen

    def _grown(self, style: tuple[float, Any]) -> tuple[float, Any]:
        offset, dashes = style
        return self.GROWTH * offset, None if dashes is None else [self.GROWTH * dash for dash in dashes]

    def draw_path_collection(self, gc: Any, *others: Any, **named: Any) -> None:
        """Paths at places, with colours and lines of their own."""
        wide, styles = [self.GROWTH * width for width in others[7]], [self._grown(style) for style in others[8]]
        self._svg.draw_path_collection(gc, *others[:7], wide, styles, *others[9:], **named)

    def draw_text(self, gc: Any, x: float, y: float, words: str, font: Any, *others: Any, **named: Any) -> None:
        """A line of words."""
        larger = font.copy()
        larger.set_size(self.GROWTH * font.get_size_in_points())
        self._svg.draw_text(gc, x, y, words, larger, *others, **named)

    def text(self, width: float, height: float) -> str:
        """The drawing as an element of a page in its colours, inches wide and high; the same gives the same."""
        self._svg.finalize()
        text = self._written.getvalue()
        text = re.sub(r"<metadata>.*?</metadata>|<style .*?</style>|<!--.*?-->", "", text, flags=re.S)
        size = f'viewBox="0 0 {DPI * width:g} {DPI * height:g}" style="--natural:{DPI * width:.0f}px"'
        opening = f'<svg {size} xmlns:xlink="http://www.w3.org/1999/xlink" aria-hidden="true">'
        text = re.sub(r"<svg [^>]*>", opening, text[text.index("<svg") :], count=1)
        units = 'patternUnits="userSpaceOnUse"'  # of a hatch, which matplotlib gives in points
        text = text.replace(units, f'{units} patternTransform="scale({self.GROWTH:.4g})"')
        text = re.sub(r"#[0-9a-f]{6}\b", lambda match: _page_colour(match[0]), text)
        return re.sub(r"\s*\n\s*", "\n", text).strip()


def _page_colour(colour: str) -> str:
    name = colours.ON_PAGE.get(colour)
    return f"var(--{name})" if name else colour
