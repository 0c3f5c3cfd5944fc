"""Figures as written for people, the same on the terminal, in the pictures and on the page."""

import math
import textwrap

from toolpath_stiff.documents import Document, number
from toolpath_stiff.stiffness.model import machine_words

WIDTH = 100  # columns of the terminal
# Sign of all residuals shown, for axes and legends.
DEVIATION = "(measured - modelled) / modelled"
MINUS_IS_SOFTER = "minus: softer than modelled"
RESIDUAL_AXIS = f"{DEVIATION}, %; {MINUS_IS_SOFTER}"


def counted(count: float, thing: str) -> str:
    """A number of things: "1 line", "1 405 lines"."""
    return f"{number(count)} {thing}{'' if count == 1 else 's'}"


def significant(value: float | None, digits: int = 3) -> str:
    """Figure with three significant digits, thousands as usual, with an exponent instead of rows of zeros."""
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 < size < 5:
        return f"{float(f'{value:.{digits - 1}e}'):.{max(digits - 1 - size, 0)}f}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def figure(value: object) -> str:
    """A cell of a table of micrometres: a float with two decimals, "-" for nan."""
    return f"{value:.2f}".replace("nan", "-") if isinstance(value, float) else str(value)


def percent(value: float | None, digits: int = 1) -> str:
    """Text of a figure that is already in per cent."""
    return "-" if value is None else f"{value:.{digits}f} %"


def duration(seconds: float) -> str:
    """Time as h:mm:ss, or in seconds below a minute."""
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def plain(text: str) -> str:
    """Text from a program or file name without control characters, so that it cannot steer a terminal."""
    if text.isprintable():  # the common case, quick for the hundred thousand characters of a picture in a page
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def shortened(text: str, width: int) -> str:
    """Text of at most `width` characters, a cut marked by three dots."""
    return text if len(text) <= width else text[: max(width - 3, 0)] + "..."


def machine_text(document: Document) -> str:
    """Machine of a result for headings, with its active effects and the set-up."""
    return plain(machine_words(document))


def labelled(label: str, text: str, column: int) -> list[str]:
    """Entry of a list on the terminal, wrapped and indented; the label is `column` wide."""
    return textwrap.wrap(
        plain(text),
        WIDTH,
        initial_indent=f"{label:<{column}}  ",
        subsequent_indent=" " * (column + 2),
        break_on_hyphens=False,
    )
