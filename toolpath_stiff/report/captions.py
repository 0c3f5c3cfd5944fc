"""Headings, words and legends, painted: matplotlib's own cost a small picture more than all its lines."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.report.figure import INK, MUTED
from toolpath_stiff.report.painting import new_pen, paint, word_extent, word_font, write_word
from toolpath_stiff.report.words import headline_text, plain, shortened

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

    from toolpath_stiff.analysis.results import Analysis


# Of a legend, in sizes of its letters, as matplotlib lays one out.
PAD, HANDLE_HEIGHT, HANDLE_PAD, BETWEEN_ROWS = 0.4, 0.7, 0.8, 0.5


def add_words(
    figure: Figure, x: float, y: float, text: str, *, size: float = 10.0, weight: str = "normal", colour: str = INK
) -> None:
    """Words whose baseline begins at x, y (parts of the figure); `size` in points."""
    paint(figure, partial(_paint_words, x=x, y=y, text=text, size=size, weight=weight, colour=colour), zorder=3.0)


def _paint_words(
    renderer: Any, figure: Figure, x: float, y: float, text: str, size: float, weight: str, colour: str
) -> None:
    with new_pen(renderer, None, colour, 0.0) as pen:
        font = word_font(size, weight)
        write_word(renderer, pen, x * figure.bbox.width, y * figure.bbox.height, text, font)


def add_heading(figure: Figure, analysis: Analysis) -> None:
    """Program, machine, load, mean and range, and those of the plunges, above everything."""
    width, height = figure.get_size_inches()
    name = shortened(plain(analysis.program.name), 70)
    text = (
        f"machine {shortened(plain(analysis.machine.name), 40)}   ·   load {analysis.load}   ·   "
        f"{headline_text(analysis.figures, '   ·   ')}"
    )
    add_words(figure, 0.35 / width, 1.0 - 0.42 / height, name, size=15.0, weight="bold")
    add_words(figure, 0.35 / width, 1.0 - 0.70 / height, text, size=10.5, colour=MUTED)


def add_legend(
    figure: Figure,
    keys: Sequence[tuple[Artist, str]],
    corner: tuple[float, float],
    *,
    right: bool = False,
    rows: bool = False,
    size: float = 10.0,
    colour: str = INK,
    between: float = 2.0,
    wide: float = 2.0,
) -> None:
    """What lines, markers and surfaces mean, below `corner` (parts of the figure).

    Parameters
    ----------
    figure
        Where it stands.
    keys
        Artists (lines, or collections with a face) and their meaning.
    corner
        Upper left of the legend.
    right
        It is the upper right.
    rows
        One below the other, else side by side.
    size
        Points.
    colour
        Of the words.
    between
        Of keys side by side, in sizes of the letters.
    wide
        A line or surface, likewise.
    """
    how = partial(
        _paint_legend, keys=keys, corner=corner, right=right, rows=rows, size=size, colour=colour, between=between,
        wide=wide,
    )  # fmt: skip
    paint(figure, how, zorder=5.0)


def _paint_legend(
    renderer: Any, figure: Figure, keys: Sequence[tuple[Artist, str]], corner: tuple[float, float], right: bool,
    rows: bool, size: float, colour: str, between: float, wide: float,
) -> None:  # fmt: skip
    em, font = renderer.points_to_pixels(size), word_font(size)
    _, tall, below = word_extent(renderer, "lp", font)
    widths = [(wide + HANDLE_PAD) * em + word_extent(renderer, text, font)[0] for _, text in keys]
    total = max(widths, default=0.0) if rows else sum(widths) + between * em * max(len(keys) - 1, 0)
    x = corner[0] * figure.bbox.width + (-PAD * em - total if right else PAD * em)
    y = corner[1] * figure.bbox.height - PAD * em - (tall - below)
    for (artist, text), width in zip(keys, widths, strict=True):
        _paint_key(renderer, figure, artist, (x, y, wide * em, HANDLE_HEIGHT * em))
        with new_pen(renderer, None, colour, 0.0) as pen:
            write_word(renderer, pen, x + (wide + HANDLE_PAD) * em, y, text, font)
        if rows:
            y -= tall + BETWEEN_ROWS * em
        else:
            x += width + between * em


def _paint_key(renderer: Any, figure: Figure, artist: Artist, box: tuple[float, float, float, float]) -> None:
    """A short piece of a line with its marker in the middle, or a small surface; the box in pixels."""
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D, IdentityTransform

    x, y, wide, tall = box
    if isinstance(artist, Collection):
        face = tuple(np.reshape(artist.get_facecolor(), (-1, 4))[0])
        with new_pen(renderer, None, face, 0.0) as pen:
            pen.set_alpha(face[3])
            renderer.draw_path(pen, Path.unit_rectangle(), Affine2D().scale(wide, tall).translate(x, y), face)
        return
    if not isinstance(artist, Line2D):
        raise TypeError(f"no key for {type(artist).__name__}")
    middle = y + tall / 2.0
    for across, off in (([x, x + wide], {"marker": "none"}), ([x + wide / 2.0], {"linestyle": "none"})):
        if (artist.get_marker() if "linestyle" in off else artist.get_linestyle()) in ("None", "none", None, "", " "):
            continue
        piece = Line2D(across, [middle] * len(across))
        piece.update_from(artist)
        piece.set(**off, transform=IdentityTransform(), figure=figure, clip_path=None, clip_on=False)
        piece.draw(renderer)
