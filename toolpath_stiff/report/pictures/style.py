"""The house style of pictures, places in inches, and how a figure becomes a file."""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from toolpath_stiff.report import colours
from toolpath_stiff.units import MM_PER_INCH, m_from_mm, number

DPI, SHARP, POINTS = 100, 150, 72.0  # per inch; of what a page shows, on screens of many pixels too
DEFLATE = 3
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


def picture_file(name: str, draw: Callable[..., Figure | None], result: Any, dpi: int = DPI, **look: Any) -> bytes:
    """A picture as PNG or, as its name says, PDF, without metadata; b"" where there is nothing to show."""
    with house_style():
        figure = draw(result, **look)
        if figure is None:
            return b""
        figure.set_dpi(dpi)
        canvas: Any = FigureCanvasAgg(figure)
        if name.endswith(".pdf"):
            content, no_data = io.BytesIO(), dict.fromkeys(("CreationDate", "Producer", "Creator"))
            canvas.print_figure(content, format="pdf", metadata=no_data)
            return content.getvalue()
        canvas.draw()
    return _packed(np.asarray(canvas.buffer_rgba())[:, :, :3], dpi)


def _packed(pixels: NDArray[np.uint8], dpi: int) -> bytes:
    """Rows of pixels as PNG.

    No filter, and a quick level of deflate; a third of the time of the general writer, which tries every filter on
    every row, for as many bytes. ISO/IEC 15948, "Portable Network Graphics".
    """
    height, width, channels = pixels.shape
    rows = np.zeros((height, 1 + channels * width), dtype=np.uint8)  # the first byte of a row names its filter
    for channel in range(channels):  # much faster than all bytes of a pixel at a time
        rows[:, 1 + channel :: channels] = pixels[:, :, channel]
    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    size = struct.pack(">2IB", *(2 * [round(dpi / m_from_mm(MM_PER_INCH))]), 1)
    chunks = {b"IHDR": header, b"pHYs": size, b"IDAT": zlib.compress(rows.data, DEFLATE), b"IEND": b""}
    framed = (
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks.items()
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)
