"""Figures with heading, positions in inches, axis figures in thousands, colour scales."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from toolpath_stiff.documents import number
from toolpath_stiff.report import colours

DPI, POINTS = 100, 72.0  # per inch
Look = dict[str, Any]  # arguments of matplotlib by name


def new_figure(width: float, height: float, title: str = "", note: str = "", left: float = 0.3) -> Figure:
    """An empty figure in inches, without pyplot or display; a heading and, below it, how to read it."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    figure.text(left / width, 1.0 - 0.4 / height, title, size=14, weight="bold")
    figure.text(left / width, 1.0 - 0.68 / height, note, size=9.5, color=colours.MUTED)
    return figure


def panel(figure: Figure, left: float, bottom: float, width: float, height: float, **options: Any) -> Axes:
    """Axes at a position in inches."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up), **options)


def in_thousands(*axes: Axis) -> None:
    """Write the figures along axes as a page does, "45 123"."""
    for axis in axes:
        axis.set_major_formatter(lambda value, _: number(value))


def round_ticks(axis: Axis, low: float, high: float) -> None:
    """Put round figures along a logarithmic axis, few enough not to touch, in thousands."""
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    steps = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if high < 12.0 * low else (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
    axis.set_major_locator(FixedLocator([v for p in powers for s in steps if low <= (v := s * p) <= high]))
    axis.set_minor_locator(NullLocator())
    in_thousands(axis)


def open_frame(axes: Axes, *sides: str) -> None:
    """Remove the frame at the top, to the right and at `sides`."""
    axes.spines[["top", "right", *sides]].set_visible(False)


def colour_scale(drawn: Any, bar: Axes, label: str) -> None:
    """Draw the colour scale of `drawn` into axes of its own."""
    bar.figure.colorbar(drawn, cax=bar, label=label)
    in_thousands(bar.yaxis)
    bar.grid(visible=False)
