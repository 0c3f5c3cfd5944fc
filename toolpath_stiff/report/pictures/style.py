"""Figures with their heading, places in inches, axes of figures in thousands, scales of colours."""

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
    """An empty figure in inches, without pyplot and without a display; a heading and, below, how it is read."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
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


def colour_scale(drawn: Any, bar: Axes, label: str) -> None:
    """Put the scale of what was drawn in colours into axes of its own."""
    bar.figure.colorbar(drawn, cax=bar, label=label)
    in_thousands(bar.yaxis)
    bar.grid(visible=False)
