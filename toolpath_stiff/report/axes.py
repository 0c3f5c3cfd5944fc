"""Parts that several pictures share: figures in groups of thousands, a scale of colours, headings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from toolpath_stiff.report.figure import MUTED
from toolpath_stiff.units import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def in_thousands(*axes: Any) -> None:
    """Write the figures along some axes as a page does, "45 123"."""
    for axis in axes:
        axis.set_major_formatter(lambda value, _: number(value))


def colour_scale(
    figure: Figure, drawn: Any, box: tuple[float, float, float, float], label: str, thousands: bool = True
) -> None:
    """Put the scale of what was drawn in colours into a box (left, bottom, width, height) of the figure."""
    bar = figure.add_axes(box)
    figure.colorbar(drawn, cax=bar, label=label)
    if thousands:
        in_thousands(bar.yaxis)
    bar.grid(visible=False)


def heading(figure: Figure, left: float, top: float, title: str, below: float = 0.0, text: str = "") -> None:
    """Write a title at a height of the figure, and so far below it what it is about."""
    figure.text(left, top, title, fontsize=14, weight="bold")
    if text:
        figure.text(left, top - below, text, fontsize=10, color=MUTED)
