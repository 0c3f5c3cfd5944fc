"""Lines, ticks, words and labels painted straight through a figure's renderer.

A fraction of the cost of an artist for each line, tick and word.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.report.figure import DPI, GRID, INK, MUTED, POINTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


TICK, GAP, NAME_GAP = 3.5, 3.5, 4.0  # points: a tick, from it to its figure, from the figures to the name


LABEL_SIZE = 10.0  # points


MOST_EXTENTS, MOST_WORDS = 4096, 1024


_EXTENTS: dict[tuple[Any, ...], tuple[float, float, float]] = {}


_WORDS: dict[tuple[Any, ...], tuple[NDArray[np.uint8], int, int]] = {}


def painted_axes(figure: Figure, box: tuple[float, float, float, float]) -> Axes:
    """Axes at `box` (left, bottom, width, height as parts of the figure) for `add_scales`: they make no ticks."""
    axes = figure.add_axes(_tickless()(figure, box))
    for spine in axes.spines.values():
        spine.set_position(("outward", 0.0))  # its default, which only making a tick would put in force
    return axes


@cache
def _tickless() -> Any:
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis, YAxis

    nothing = property(lambda axis: [], lambda axis, ticks: None, lambda axis: None)
    ticks = {"majorTicks": nothing, "minorTicks": nothing}
    axis_x, axis_y = (cast("Any", type(kind.__name__, (kind,), ticks)) for kind in (XAxis, YAxis))

    class Tickless(Axes):
        """Axes whose ticks are none: making them, to be hidden, takes half the time of making axes."""

        def _init_axis(self) -> None:
            self.xaxis, self.yaxis = axis_x(self, clear=False), axis_y(self, clear=False)
            for side, axis in (
                ("bottom", self.xaxis),
                ("top", self.xaxis),
                ("left", self.yaxis),
                ("right", self.yaxis),
            ):
                self.spines[side].register_axis(axis)

    return Tickless


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
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    pt, font = renderer.points_to_pixels(1.0), word_font(LABEL_SIZE)
    here = axes.transData.transform(at)
    width, height, descent = word_extent(renderer, text, font)
    there, half = here + pt * np.array(middle), np.array([width, height]) / 2.0 + 2.0 * pt
    way = there - here
    length = float(np.hypot(*way)) or 1.0
    stop = min([float(h / abs(w)) for h, w in zip(half, way, strict=True) if w] or [1.0])  # where it meets the box
    ends = [here + way * 5.0 * pt / length, there - way * min(stop, 1.0)]
    if length * (1.0 - stop) > 5.0 * pt:
        with new_pen(renderer, axes, INK, 0.8) as pen:
            renderer.draw_path(pen, Path(ends), Affine2D())
    for colour, wide in (("white", 3.5), (INK, 1.6)):
        with new_pen(renderer, axes, colour, wide) as pen:
            renderer.draw_path(pen, Path.unit_circle(), Affine2D().scale(4.5 * pt).translate(*here))
    with new_pen(renderer, axes, "white", 0.0) as pen:
        pen.set_alpha(0.85)
        box = Path.unit_rectangle(), Affine2D().scale(*(2.0 * half)).translate(*(there - half))
        renderer.draw_path(pen, *box, (1.0, 1.0, 1.0, 0.85))
    with new_pen(renderer, None, INK, 0.0) as pen:
        write_word(renderer, pen, there[0] - width / 2.0, there[1] - height / 2.0 + descent, text, font)


def paint(home: Axes | Figure, how: Callable[[Any, Any], None], zorder: float) -> None:
    """Add to axes or a figure what `how(renderer, home)` paints."""
    artist = _painting()(how)
    artist.set_zorder(zorder)
    home.add_artist(artist)


@cache
def _painting() -> Any:
    from matplotlib.artist import Artist

    class Painting(Artist):
        """An artist that is one function."""

        def __init__(self, how: Callable[[Any, Any], None]) -> None:
            super().__init__()
            self.how = how

        def draw(self, renderer: Any) -> None:
            if self.get_visible():
                self.how(renderer, self.axes or self.get_figure())

        def get_window_extent(self, renderer: Any = None) -> Any:
            home = self.axes or self.get_figure()
            return None if home is None else home.bbox

    return Painting


@contextmanager
def new_pen(renderer: Any, clip: Axes | None, colour: Any, width: float, cap: str = "butt") -> Iterator[Any]:
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


def write_word(renderer: Any, pen: Any, x: float, y: float, text: str, font: Any, angle: float = 0.0) -> None:
    """Words whose baseline begins at x, y, in pixels from below."""
    from matplotlib.backends.backend_agg import RendererAgg

    if isinstance(renderer, RendererAgg) and text:
        image, left, below = _word(renderer, pen, text, font, angle)
        # No half a pixel: which way it is rounded would hang on the last digit.
        column, row = (int(np.floor(at + 0.501)) for at in (x, y))
        renderer.draw_image(pen, column - left, row - below, image)
        return
    renderer.draw_text(
        pen, x, renderer.get_canvas_width_height()[1] - y if renderer.flipy() else y, text, font, angle, ismath=False
    )


def _word(renderer: Any, pen: Any, text: str, font: Any, angle: float) -> tuple[NDArray[np.uint8], int, int]:
    """A word as an image, lowest row first, and where in it, in pixels from the left and from below, it begins.

    The figures of ticks come again and again, in one picture and in those of many programs.
    """
    about = renderer.dpi, text, font.get_size_in_points(), font.get_weight(), pen.get_rgb(), angle
    if about not in _WORDS:
        wide, high, deep = (int(np.ceil(size)) for size in word_extent(renderer, text, font))
        upright, rise, edge = angle == 0.0, high - deep, 2
        width, height = (wide, high) if upright else (high, wide)
        left, below = edge + (0 if upright else rise), edge + (deep if upright else 0)
        canvas = type(renderer)(width + 2 * edge, height + 2 * edge, renderer.dpi)
        canvas.draw_text(pen, left, canvas.height - below, text, font, angle, ismath=False)
        if len(_WORDS) >= MOST_WORDS:
            _WORDS.clear()
        _WORDS[about] = np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[::-1]), left, below
    return _WORDS[about]


@cache
def word_font(size: float, weight: str = "normal") -> Any:
    """The house's font, `size` in points; made once, in the house style."""
    from matplotlib.font_manager import FontProperties

    return FontProperties(size=size, weight=weight)


def word_extent(renderer: Any, text: str, font: Any) -> tuple[float, float, float]:
    """Width, height and descent of a word in pixels; the figures of a tick come again and again."""
    about = type(renderer), renderer.points_to_pixels(1.0), font.get_size_in_points(), font.get_weight(), text
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
        with new_pen(renderer, axes, colour, width, "round") as pen:
            renderer.draw_path(pen, Path(points), at)


def add_scales(axes: Axes, sides: Sequence[str] = ("bottom", "left")) -> None:
    """Ticks, figures, grids and names of the axes, painted; locators, formatters and names stay the axes' own."""
    for side, axis in (("bottom", axes.xaxis), ("left", axes.yaxis)):
        axis.set_visible(False)
        if side in sides:
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
    from matplotlib.path import Path
    from matplotlib.transforms import IdentityTransform

    pt, font, box = renderer.points_to_pixels(1.0), word_font(size), axes.bbox
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
        with new_pen(renderer, axes, GRID, 0.8, "projecting") as pen:
            lines(start, stop, pen)
    if len(at):
        with new_pen(renderer, None, MUTED, 0.8) as pen:
            lines(start, start + out * TICK * pt, pen)
    _, tall, below = word_extent(renderer, "lp", font)
    room, widest = (TICK + GAP) * pt, 0.0
    with new_pen(renderer, None, MUTED, 0.0) as pen:
        for where, text in zip(at.tolist(), words, strict=True):
            wide, high, deep = word_extent(renderer, text, font)
            widest = max(widest, wide)
            if not upright:
                write_word(renderer, pen, start - room - wide, where - (high - deep) / 2.0, text, font)
            else:
                base = start + room + below if out > 0.0 else start - room - (tall - below)
                write_word(renderer, pen, where - wide / 2.0, base, text, font)
    wide, *_ = word_extent(renderer, name, font) if name else (0.0,)
    with new_pen(renderer, None, colour, 0.0) as pen:
        if name and upright:
            base = start + out * (room + tall + NAME_GAP * pt) + (below if out > 0.0 else -(tall - below))
            write_word(renderer, pen, box.x0 + (box.width - wide) / 2.0, base, name, font)
        elif name:
            write_word(
                renderer,
                pen,
                start - room - widest - NAME_GAP * pt - below,
                box.y0 + (box.height - wide) / 2.0,
                name,
                font,
                90.0,
            )
