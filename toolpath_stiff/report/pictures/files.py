"""House style of pictures, and conversion of figures to files."""

import io
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from toolpath_stiff.report import colours
from toolpath_stiff.report.pictures.drawing import pixels
from toolpath_stiff.report.pictures.style import DPI, Look
from toolpath_stiff.units import MM_PER_INCH, m_from_mm

SHARP = 150  # pixels per inch of what a page shows, on screens of many pixels too
DEFLATE = 3
STYLE: Look = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same glyphs on every machine
    "font.size": 10.0,
    "axes.edgecolor": colours.GREY,
    "axes.labelcolor": colours.INK,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # its default place, fixed: the search for obstacles takes a tenth of the drawing time
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-99, 99),
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
    """Set matplotlib's defaults to our style, whatever the user's own settings; undone at the end."""
    # `mpl.rcdefaults` would read every style that comes with matplotlib first.
    defaults: Look = {name: value for name, value in mpl.rcParamsDefault.items() if not name.startswith("backend")}
    with mpl.rc_context(), warnings.catch_warnings():
        mpl.rcParams.update(defaults | STYLE)  # type: ignore[arg-type]
        warnings.filterwarnings("ignore", message="Glyph .* missing", category=UserWarning)
        yield


def picture_file(name: str, draw: Callable[..., Figure | None], result: Any, dpi: int = DPI, **look: Any) -> bytes:
    """A picture as PNG or, by its name, PDF, without metadata; b"" if there is nothing to show."""
    with house_style():
        figure = draw(result, **look)
        if figure is None:
            return b""
        figure.set_dpi(dpi)
        if name.endswith(".pdf"):
            content, no_data = io.BytesIO(), dict.fromkeys(("CreationDate", "Producer", "Creator"))
            figure.savefig(content, format="pdf", metadata=no_data)
            return content.getvalue()
        return _packed(pixels(figure), dpi)


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
