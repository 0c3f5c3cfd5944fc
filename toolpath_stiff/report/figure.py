"""Figures in the house style, the colour scale of stiffness, and how a figure becomes PNG or SVG.

Pictures for pages: as PNG for a file, and as SVG whose colours are those of the page, light or dark.

The colours that pictures are drawn in stand for those of `page.css`; those that show data (colour maps) stay as they
are. Letters are outlines, so that nothing moves with the fonts of whoever reads the page.
"""

from __future__ import annotations

import base64
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
from numpy.typing import NDArray

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
    "svg.hashsalt": "tps",  # the same picture gives the same text
    "svg.fonttype": "path",
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
    """The figure as PNG, without metadata."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return _png(np.asarray(canvas.buffer_rgba())[:, :, :3], DPI)


def _png(pixels: NDArray[np.uint8], dpi: int) -> bytes:
    """Rows of pixels, of three channels or with alpha as the fourth, as PNG.

    No filter, and a quick level of deflate; a third of the time of the general writer, which tries every filter on
    every row, for as many bytes. ISO/IEC 15948, "Portable Network Graphics".
    """
    height, width, channels = pixels.shape
    rows = np.zeros((height, 1 + channels * width), dtype=np.uint8)  # the first byte of a row names its filter
    for channel in range(channels):  # much faster than all bytes of a pixel at a time
        rows[:, 1 + channel :: channels] = pixels[:, :, channel]
    header = struct.pack(">2I5B", width, height, 8, 2 if channels == 3 else 6, 0, 0, 0)
    size = struct.pack(">2IB", *(2 * [round(dpi / m_from_mm(MM_PER_INCH))]), 1)
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
    """The figure as it is written to a file and as it stands in a page. Within `house_style`.

    One drawing makes both: laying out axes and words takes most of the time.
    """
    _rasterize(figure)
    renderer = Both(*figure.canvas.get_width_height())
    figure.patch.draw(renderer.pixels)  # a page has its own ground
    figure.patch.set_visible(False)
    figure.draw(renderer)  # type: ignore[arg-type]
    figure.patch.set_visible(True)
    both = Drawing(_png(np.asarray(renderer.pixels.buffer_rgba())[:, :, :3], DPI))
    both.svg = _svg_text(renderer.vectors.text(), *figure.get_size_inches())
    return both


def _twice(name: str) -> Callable[..., None]:
    def draw(renderer: Both, *arguments: Any, **named: Any) -> None:
        getattr(renderer.pixels, name)(*arguments, **named)
        getattr(renderer.beside, name)(*arguments, **named)

    return draw


class Both:
    """A renderer of matplotlib that draws pixels and vectors in the same coordinates, pixels of the PNG.

    It answers as the renderer of the pixels does, as matplotlib's own `MixedModeRenderer` stands for another.
    """

    def __init__(self, width: float, height: float) -> None:
        self.pixels = _pixels(width, height, DPI)
        self.vectors = Vectors(width, height)
        self.beside: Vectors | Marks = self.vectors

    def __getattr__(self, name: str) -> Any:
        return getattr(self.pixels, name)

    draw_path, draw_markers, draw_path_collection = map(_twice, ("draw_path", "draw_markers", "draw_path_collection"))
    draw_quad_mesh, draw_image, draw_text = map(_twice, ("draw_quad_mesh", "draw_image", "draw_text"))

    def start_rasterizing(self) -> None:
        """From here on marks are put into the vectors as an image."""
        self.beside = Marks(self.vectors)

    def stop_rasterizing(self) -> None:
        """From here on they are vectors again."""
        if isinstance(self.beside, Marks):
            self.beside.finish()
        self.beside = self.vectors


class Vectors:
    """SVG of the same size; what matplotlib gives in points (dashes, letters, lines of a collection) grows to it."""

    GROWTH = DPI / POINTS

    def __init__(self, width: float, height: float) -> None:
        from matplotlib.backends.backend_svg import RendererSVG

        self._text = io.StringIO()
        kind: Any = RendererSVG
        self._svg = kind(width, height, self._text, image_dpi=int(POINTS))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._svg, name)

    def text(self) -> str:
        """The end of the drawing, and all of it."""
        self._svg.finalize()
        return self._text.getvalue()

    def draw_path(self, gc: Any, *others: Any) -> None:
        """A path."""
        self._svg.draw_path(self._pen(gc), *others)

    def draw_markers(self, gc: Any, *others: Any) -> None:
        """Markers along a path."""
        self._svg.draw_markers(self._pen(gc), *others)

    def _pen(self, gc: Any) -> Any:
        offset, dashes = gc.get_dashes()
        return gc if dashes is None else _copied(gc, dashes=self._grown((offset, dashes)))

    def _grown(self, style: tuple[float, Any]) -> tuple[float, Any]:
        offset, dashes = style
        return self.GROWTH * offset, None if dashes is None else [self.GROWTH * dash for dash in dashes]

    def draw_path_collection(self, gc: Any, *others: Any, **named: Any) -> None:
        """Paths at places, with colours and lines of their own."""
        before, widths, styles, after = others[:7], others[7], others[8], others[9:]
        wide = [self.GROWTH * width for width in widths]
        self._svg.draw_path_collection(gc, *before, wide, [self._grown(style) for style in styles], *after, **named)

    def draw_text(self, gc: Any, x: float, y: float, words: str, font: Any, *others: Any, **named: Any) -> None:
        """A line of words."""
        larger = font.copy()
        larger.set_size(self.GROWTH * font.get_size_in_points())
        self._svg.draw_text(gc, x, y, words, larger, *others, **named)


class Marks:
    """What has many marks, put into the vectors as an image for each axes, sharper than the PNG."""

    FINER = SHARP / DPI

    def __init__(self, vectors: Vectors) -> None:
        self._vectors = vectors
        self._canvas: Any = None
        self._place: tuple[int, ...] = ()  # of the canvas in the picture: left, low, right, high

    def draw_path(self, gc: Any, path: Any, transform: Any, face: Any = None) -> None:
        """A path."""
        pen = self._pen(gc)
        self._canvas.draw_path(pen, path, transform + self._there(), face)

    def draw_markers(self, gc: Any, marker: Any, size: Any, path: Any, transform: Any, face: Any = None) -> None:
        """Markers along a path."""
        pen = self._pen(gc)
        placed = size + _scaled(self.FINER), path, transform + self._there()
        self._canvas.draw_markers(pen, marker, *placed, face)

    def draw_path_collection(self, gc: Any, *others: Any, **named: Any) -> None:
        """Paths at places, with colours and lines of their own."""
        pen, (master, paths, transforms, offsets, place), others = self._pen(gc), others[:5], others[5:]
        larger, there = (master + _scaled(self.FINER)).frozen(), place + self._there()
        self._canvas.draw_path_collection(pen, larger, paths, transforms, offsets, there, *others, **named)

    def draw_quad_mesh(self, gc: Any, master: Any, *others: Any) -> None:
        """Cells, across and up so many, at places."""
        pen, (across, up, corners, offsets, place), others = self._pen(gc), others[:5], others[5:]
        larger, there = (master + _scaled(self.FINER)).frozen(), place + self._there()
        self._canvas.draw_quad_mesh(pen, larger, across, up, corners, offsets, there, *others)

    def _pen(self, gc: Any) -> Any:
        """The context on the canvas of the axes that clip what is drawn."""
        clip = gc.get_clip_rectangle()
        ends = (0.0, 0.0, self._vectors.width, self._vectors.height) if clip is None else clip.extents
        place = (*(int(np.floor(end)) for end in ends[:2]), *(int(np.ceil(end)) for end in ends[2:]))
        if place != self._place:
            self.finish()
            self._place = place
            across, up = place[2] - place[0], place[3] - place[1]
            self._canvas = _pixels(self.FINER * across, self.FINER * up, SHARP)
        return _copied(gc, width=self.FINER * gc.get_linewidth(), clip=clip and self._there().transform_bbox(clip))

    def _there(self) -> Any:
        """From the picture to the canvas."""
        from matplotlib.transforms import Affine2D

        return Affine2D().translate(-self._place[0], -self._place[1]).scale(self.FINER)

    def finish(self) -> None:
        """Put the image in."""
        if self._canvas is None:
            return
        pixels = np.asarray(self._canvas.buffer_rgba())
        rows, columns = (np.flatnonzero(pixels[:, :, 3].any(axis=axis)) for axis in (1, 0))
        if len(rows):
            seen = pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            corner = self._place[0], self._vectors.height - self._place[3]
            box = {
                "x": corner[0] + columns[0] / self.FINER,
                "y": corner[1] + rows[0] / self.FINER,
                "width": seen.shape[1] / self.FINER,
                "height": seen.shape[0] / self.FINER,
            }
            image = "data:image/png;base64," + base64.b64encode(_png(seen, SHARP)).decode("ascii")
            text = {name: f"{value:g}" for name, value in box.items()}
            self._vectors.writer.element("image", attrib={**text, "xlink:href": image})
        self._canvas, self._place = None, ()


def _pixels(width: float, height: float, dpi: int) -> Any:
    from matplotlib.backends.backend_agg import RendererAgg

    kind: Any = RendererAgg
    return kind(width, height, dpi)


def _scaled(factor: float) -> Any:
    from matplotlib.transforms import Affine2D

    return Affine2D().scale(factor)


def _copied(gc: Any, *, width: float | None = None, clip: Any = None, dashes: Any = None) -> Any:
    """A context with other lines, or clipped elsewhere."""
    from matplotlib.backend_bases import GraphicsContextBase

    kind: Any = GraphicsContextBase
    copy = kind()
    copy.copy_properties(gc)
    if dashes is not None:
        copy.set_dashes(*dashes)
    if width is not None:
        copy.set_linewidth(width)
        copy.set_clip_rectangle(clip)
        copy.set_clip_path(None)
    return copy


def _svg_text(text: str, width: float, height: float) -> str:
    """An SVG as an element of a page in its colours, `width` and `height` in inches; the same gives the same."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<style .*?</style>|<!--.*?-->", "", text, flags=re.S)
    size = f'viewBox="0 0 {DPI * width:g} {DPI * height:g}" style="--natural:{DPI * width:.0f}px"'
    opening = f'<svg {size} xmlns:xlink="http://www.w3.org/1999/xlink" aria-hidden="true">'
    text = re.sub(r"<svg [^>]*>", opening, text, count=1)
    units = 'patternUnits="userSpaceOnUse"'  # of a hatch, which matplotlib gives in points
    text = text.replace(units, f'{units} patternTransform="scale({DPI / POINTS:.4g})"')
    text = re.sub(r"#[0-9a-f]{6}\b", lambda match: _page_colour(match[0]), text)
    return re.sub(r"\s*\n\s*", "\n", text).strip()


def _page_colour(colour: str) -> str:
    name = PAGE_COLOURS.get(colour)
    return f"var(--{name})" if name else colour


def _rasterize(figure: Figure) -> None:
    """Mark what has many marks to be put in as an image, where there are too many in all."""
    marks: list[tuple[Artist, int]] = []
    for axes in figure.axes:
        marks += [(line, np.size(line.get_xdata())) for line in axes.lines]
        marks += [
            (collection, max(np.shape(collection.get_offsets())[0], len(collection.get_paths())))
            for collection in axes.collections
        ]
    if sum(count for _, count in marks) > MOST_MARKS:
        for artist, count in marks:
            if count > FEW_MARKS:
                artist.set_rasterized(True)
