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
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial, update_wrapper
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.report.words import headline_text, plain, shortened
from toolpath_stiff.units import MM_PER_INCH, m_from_mm

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.analysis import Analysis

FloatArray = NDArray[np.float64]

P = ParamSpec("P")
Made = TypeVar("Made", bound=bytes)

DPI = 100
TICK, GAP, NAME_GAP = 3.5, 3.5, 4.0  # points: a tick, from it to its figure, from the figures to the name
LABEL_SIZE = 10.0  # points
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
    """The figure as PNG, without metadata.

    An opaque picture of lines: no alpha, no filter, and a quick level of deflate; a third of the time of the general
    writer, which tries every filter on every row, for as many bytes. ISO/IEC 15948, "Portable Network Graphics".
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    height, width, _ = pixels.shape
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)  # the first byte of a row names its filter
    rows[:, 1:] = pixels.reshape(height, 3 * width)
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
    middle = ((chosen[0] + chosen[2]) / 2 - x) * POINTS / DPI, ((chosen[1] + chosen[3]) / 2 - y) * POINTS / DPI
    paint(axes, partial(_paint_label, at=at, middle=middle, text=text), zorder=10)


def _paint_label(renderer: Any, axes: Axes, at: tuple[float, float], middle: tuple[float, float], text: str) -> None:
    """A ring at `at` (data), a line to the words, their middle `middle` points away, on a pale box."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    pt, font = renderer.points_to_pixels(1.0), FontProperties(size=LABEL_SIZE)
    here = axes.transData.transform(at)
    width, height, descent = _extent(renderer, text, font)
    there, half = here + pt * np.array(middle), np.array([width, height]) / 2.0 + 2.0 * pt
    way = there - here
    length = float(np.hypot(*way)) or 1.0
    stop = min([float(h / abs(w)) for h, w in zip(half, way, strict=True) if w] or [1.0])  # where it meets the box
    ends = [here + way * 5.0 * pt / length, there - way * min(stop, 1.0)]
    if length * (1.0 - stop) > 5.0 * pt:
        with _pen(renderer, axes, INK, 0.8) as pen:
            renderer.draw_path(pen, Path(ends), Affine2D())
    for colour, wide in (("white", 3.5), (INK, 1.6)):
        with _pen(renderer, axes, colour, wide) as pen:
            renderer.draw_path(pen, Path.unit_circle(), Affine2D().scale(4.5 * pt).translate(*here))
    with _pen(renderer, axes, "white", 0.0) as pen:
        pen.set_alpha(0.85)
        box = Path.unit_rectangle(), Affine2D().scale(*(2.0 * half)).translate(*(there - half))
        renderer.draw_path(pen, *box, (1.0, 1.0, 1.0, 0.85))
    with _pen(renderer, None, INK, 0.0) as pen:
        _write(renderer, pen, there[0] - width / 2.0, there[1] - height / 2.0 + descent, text, font)


_EXTENTS: dict[tuple[Any, ...], tuple[float, float, float]] = {}
MOST_EXTENTS = 4096

# -- painted straight through the renderer: a fraction of the cost of an artist for each line, tick and word -----------


def paint(axes: Axes, how: Callable[[Any, Axes], None], zorder: float) -> None:
    """Add to the axes what `how(renderer, axes)` paints."""
    artist = _painting()(how)
    artist.set_zorder(zorder)
    axes.add_artist(artist)


@cache
def _painting() -> Any:
    from matplotlib.artist import Artist

    class Painting(Artist):
        """An artist that is one function."""

        def __init__(self, how: Callable[[Any, Axes], None]) -> None:
            super().__init__()
            self.how = how

        def draw(self, renderer: Any) -> None:
            if self.get_visible() and self.axes is not None:
                self.how(renderer, cast("Axes", self.axes))

        def get_window_extent(self, renderer: Any = None) -> Any:
            return self.axes.bbox if self.axes is not None else None

    return Painting


@contextmanager
def _pen(renderer: Any, clip: Axes | None, colour: Any, width: float, cap: str = "butt") -> Iterator[Any]:
    """A graphics context for lines of some points; clipped to the axes, if given."""
    pen = renderer.new_gc()
    pen.set_foreground(colour)
    pen.set_linewidth(width)
    pen.set_snap(False)
    pen.set_joinstyle("round")
    pen.set_capstyle(cap)
    if clip is not None:
        pen.set_clip_rectangle(clip.bbox)
    yield pen
    pen.restore()


def _write(renderer: Any, pen: Any, x: float, y: float, text: str, font: Any, angle: float = 0.0) -> None:
    """Words whose baseline begins at x, y, in pixels from below."""
    renderer.draw_text(
        pen, x, renderer.get_canvas_width_height()[1] - y if renderer.flipy() else y, text, font, angle, ismath=False
    )


def _extent(renderer: Any, text: str, font: Any) -> tuple[float, float, float]:
    """Width, height and descent of a word in pixels; the figures of a tick come again and again."""
    about = type(renderer), renderer.points_to_pixels(1.0), font.get_size_in_points(), text
    if about not in _EXTENTS:
        if len(_EXTENTS) >= MOST_EXTENTS:
            _EXTENTS.clear()
        _EXTENTS[about] = renderer.get_text_width_height_descent(text, font, False)
    return _EXTENTS[about]


def add_strokes(axes: Axes, strokes: Sequence[tuple[FloatArray, Any]], width: float, zorder: float) -> None:
    """Lines (n, 2), broken by nan, each of its colour, in order; all of them one width in points."""
    paint(axes, partial(_paint_strokes, strokes=strokes, width=width), zorder)


def _paint_strokes(renderer: Any, axes: Axes, strokes: Sequence[tuple[FloatArray, Any]], width: float) -> None:
    from matplotlib.path import Path

    at = axes.transData.frozen()
    for points, colour in strokes:
        with _pen(renderer, axes, colour, width, "round") as pen:
            renderer.draw_path(pen, Path(points), at)


def add_scales(axes: Axes) -> None:
    """Ticks, figures, grids and names of both axes, painted; locators, formatters and names stay the axes' own."""
    for side, axis in (("bottom", axes.xaxis), ("left", axes.yaxis)):
        axis.set_visible(False)
        paint(axes, partial(_paint_axis, side=side), zorder=0.5)


def _paint_axis(renderer: Any, axes: Axes, side: str) -> None:
    axis, (low, high) = (axes.xaxis, axes.get_xlim()) if side == "bottom" else (axes.yaxis, axes.get_ylim())
    values = np.asarray(axis.get_major_locator().tick_values(low, high), dtype=float)
    values = values[(values >= low - 1e-9 * (high - low)) & (values <= high + 1e-9 * (high - low))]
    words = axis.get_major_formatter().format_ticks(values.tolist())
    name = "  ".join(part for part in (axis.get_label_text(), axis.get_major_formatter().get_offset()) if part)
    grid = axis.get_tick_params()["gridOn"]
    paint_scale(renderer, axes, side=side, values=values, words=words, name=name, grid=grid)


def paint_scale(
    renderer: Any, axes: Axes, *, side: str, values: FloatArray, words: Sequence[str], name: str, grid: bool = False,
    size: float = 10.0, colour: str = INK, edge: float = 0.0,
) -> None:  # fmt: skip
    """Ticks at values (data) of one side of the axes, their words, a grid, and the name in `colour`.

    `side` is "bottom", "left" or "top"; of "top" `edge` says where, in heights of the axes.
    """
    from matplotlib.font_manager import FontProperties
    from matplotlib.path import Path
    from matplotlib.transforms import IdentityTransform

    pt, font, box = renderer.points_to_pixels(1.0), FontProperties(size=size), axes.bbox
    upright, along = side != "left", np.zeros((len(values), 2))
    along[:, 0 if upright else 1] = values
    at = axes.transData.transform(along)[:, 0 if upright else 1]
    ends = {
        "bottom": (box.y0, box.y1, -1.0),
        "left": (box.x0, box.x1, -1.0),
        "top": (box.y0 + edge * box.height, 0.0, 1.0),
    }
    start, stop, out = ends[side]

    def lines(first: float, last: float, pen: Any) -> None:
        across = np.tile([first, last], len(at))
        both = (np.repeat(at, 2), across) if upright else (across, np.repeat(at, 2))
        codes = np.tile([Path.MOVETO, Path.LINETO], len(at))
        renderer.draw_path(pen, Path(np.column_stack(both), codes), IdentityTransform())

    if grid and len(at):
        with _pen(renderer, axes, GRID, 0.8, "projecting") as pen:
            lines(start, stop, pen)
    if len(at):
        with _pen(renderer, None, MUTED, 0.8) as pen:
            lines(start, start + out * TICK * pt, pen)
    _, tall, below = _extent(renderer, "lp", font)
    room, widest = (TICK + GAP) * pt, 0.0
    with _pen(renderer, None, MUTED, 0.0) as pen:
        for where, text in zip(at.tolist(), words, strict=True):
            wide, high, deep = _extent(renderer, text, font)
            widest = max(widest, wide)
            if not upright:
                _write(renderer, pen, start - room - wide, where - (high - deep) / 2.0, text, font)
            else:
                base = start + room + below if out > 0.0 else start - room - (tall - below)
                _write(renderer, pen, where - wide / 2.0, base, text, font)
    wide, *_ = _extent(renderer, name, font) if name else (0.0,)
    with _pen(renderer, None, colour, 0.0) as pen:
        if name and upright:
            base = start + out * (room + tall + NAME_GAP * pt) + (below if out > 0.0 else -(tall - below))
            _write(renderer, pen, box.x0 + (box.width - wide) / 2.0, base, name, font)
        elif name:
            _write(
                renderer,
                pen,
                start - room - widest - NAME_GAP * pt - below,
                box.y0 + (box.height - wide) / 2.0,
                name,
                font,
                90.0,
            )


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
