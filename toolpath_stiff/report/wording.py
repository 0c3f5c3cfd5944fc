"""How figures are written for people: the same on the terminal, in the pictures and on the page."""

from __future__ import annotations

import math

# Who read a program, for headings (`Program.interpreter`).
READERS = {"builtin": "the built-in reader", "linuxcnc": "LinuxCNC's interpreter (rs274)"}


def number(value: float | None, digits: int = 0) -> str:
    """A figure with thin groups of thousands ("45 123"), "-" where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    text = f"{value:,.{digits}f}".replace(",", " ")
    return text.replace("-", "", 1) if float(text.replace(" ", "")) == 0.0 else text


def duration(seconds: float) -> str:
    """Time as h:mm:ss, in seconds below a minute."""
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def plain(text: str) -> str:
    """Text from a program or a file name without control characters: it cannot steer a terminal."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def shortened(text: str, width: int) -> str:
    """At most `width` characters, the cut marked by three dots."""
    return text if len(text) <= width else text[: max(width - 3, 0)] + "..."
