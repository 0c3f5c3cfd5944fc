"""Pictures for pages: as PNG for a file, and as SVG whose colours are those of the page, light or dark.

The colours that pictures are drawn in stand for those of `page.css`; those that show data (colour maps) stay as they
are. Letters are outlines, so that nothing moves with the fonts of whoever reads the page.
"""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.report.figure import (
    BLUE,
    CHOSEN,
    DPI,
    FAINT,
    GREEN,
    GRID,
    INK,
    LIGHT_BLUE,
    MUTED,
    PALE_RED,
    PURPLE,
    RAPID_GREY,
    SECOND_ORANGE,
    UNREACHABLE_RED,
    WITHIN,
    png_bytes,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

# Colour that is drawn -> property of page.css. Behind text, a colour of data is more opaque the larger its figure: the
# text may follow the page.
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
