"""Pixels of a figure, as matplotlib's Agg draws them but in less than half its time.

Most of that goes into letters, each of which it hints two or three times over, and into five artists a tick, some never
seen, each laid out several times. Here a text is made once, and an axis draws its grid, marks and figures itself.
"""

from functools import lru_cache, partial
from typing import Any

import numpy as np
from matplotlib.backends import backend_agg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.report import colours

MARK, WIDTH, GAP, APART = 3.5, 0.8, 3.5, 4.0  # points: a mark, its line, from it to its figure, and on to the name
SIZE = 10.0  # points
ASCENT = 0.76  # of the size, from the line on which DejaVu Sans stands to the top of its letters: its own figure
TEXTS = 4000  # kept: those of many programs are much the same
PIXELS = IdentityTransform()
AGG: Any = backend_agg  # its types are unknown


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """Colours (rows, columns, 3) of a figure."""
    renderer = AGG.RendererAgg(*figure.bbox.size, figure.dpi)
    renderer.draw_text = partial(_draw_text, renderer)
    renderer.get_text_width_height_descent = lambda text, font, _: _letters(text, font, figure.dpi)[1:4]
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            axis.draw = partial(_draw_scale, axis)  # type: ignore[method-assign]
    figure.draw(renderer)
    return np.asarray(renderer.buffer_rgba())[:, :, :3]


@lru_cache(TEXTS)
def _letters(text: str, font: FontProperties, dpi: float) -> tuple[NDArray[np.uint8], float, float, float, float]:
    """How opaque each pixel of a text is; pixels of its width, height, below its line, and before its first letter."""
    letters: Any = get_font(findfont(font))
    letters.set_size(font.get_size_in_points(), dpi)
    letters.set_text(text, flags=AGG.get_hinting_flag())
    letters.draw_glyphs_to_bitmap()
    sizes = *letters.get_width_height(), letters.get_descent(), letters.get_bitmap_offset()[0]
    width, height, below, before = (size / 64.0 for size in sizes)
    return np.array(letters.get_image()), width, height, below, before


def _draw_text(
    renderer: Any, gc: Any, x: float, y: float, text: str, font: FontProperties, angle: float, **more: Any
) -> None:
    """Draw a text, level or, at 90 degrees, upwards; `x` and `y`, which counts down, are where its line begins."""
    level, (upright, *_, below, before) = round(angle) == 0, _letters(text, font, renderer.dpi)
    opaque = upright if level else np.rot90(upright)
    across, up = (before, -1.0 - below) if level else (1.0 + below - opaque.shape[1], before)
    left, bottom = x + across, renderer.height - y + up
    coloured = np.empty((*opaque.shape, 4), dtype=np.uint8)
    coloured[..., :3] = np.round(255.0 * np.array(to_rgb(gc.get_rgb())))
    coloured[..., 3] = opaque
    renderer.draw_image(gc, round(left), round(bottom), coloured[::-1])


def _draw_scale(axis: Any, renderer: Any) -> None:
    """Draw grid, marks, figures and name of an axis."""
    if not axis.get_visible():
        return
    look, frame, upright = axis.get_tick_params(), axis.axes.bbox, axis.axis_name == "y"
    side = "right" if look.get("labelright") else "left" if upright else "bottom"
    edge = {"left": frame.x0, "right": frame.x1, "bottom": frame.y0}[side]
    low, high = frame.intervaly if upright else frame.intervalx
    point, gc = renderer.points_to_pixels(1.0), renderer.new_gc()
    out, mark = point if side == "right" else -point, look.get("length", MARK)
    values = np.asarray(axis.get_majorticklocs(), dtype=float)
    places = axis.axes.transData.transform(np.column_stack([values, values]))[:, int(upright)]
    shown = np.abs(places - 0.5 * (low + high)) < 0.5 * (high - low) + 0.1
    gc.set_linewidth(WIDTH)
    if look["gridOn"]:
        gc.set_foreground(colours.GRID)
        gc.set_snap(False)
        _strokes(renderer, gc, places[shown], frame.intervalx if upright else frame.intervaly, upright)
    gc.set_foreground(colours.MUTED)
    if look[side]:
        gc.set_snap(True)
        _strokes(renderer, gc, places[shown], (edge, edge + mark * out), upright)
    beside, reach = edge + out * (mark * look[side] + look.get("pad", GAP)), edge
    if look[f"label{side}"]:
        font = FontProperties(size=look.get("labelsize", SIZE))
        size = point * font.get_size_in_points()
        texts = axis.get_major_formatter().format_ticks(values.tolist())
        gc.set_foreground(look.get("labelcolor", colours.MUTED))
        widths = [0.0]
        for place, text in (pair for pair, seen in zip(zip(places, texts, strict=True), shown, strict=True) if seen):
            widths.append(wide := _letters(text, font, renderer.dpi)[1])
            left = place - 0.5 * wide if not upright else beside - wide if side == "left" else beside
            level = place - 0.5 * ASCENT * size if upright else beside - ASCENT * size
            renderer.draw_text(gc, left, renderer.height - level, text, font, 0.0)
        reach = beside + np.sign(out) * (max(widths) if upright else size)
    gc.restore()
    if axis.label.get_text():
        away = reach + APART * out
        axis.label.set_position((away, 0.5) if upright else (0.5, away))
        axis.label.draw(renderer)


def _strokes(renderer: Any, gc: Any, places: FloatArray, ends: tuple[float, float], level: bool) -> None:
    """Draw a line from one end to the other at each place, `level` or upright."""
    corners = np.stack([np.repeat(places, 2), np.tile(ends, len(places))][:: -1 if level else 1], axis=1)
    renderer.draw_path(gc, Path(corners, np.tile([Path.MOVETO, Path.LINETO], len(places))), PIXELS)
