"""The line of progress on a terminal, where someone watches."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from toolpath_stiff.errors import harmless

if TYPE_CHECKING:
    from toolpath_stiff.results import Progress

REDRAW_SECONDS = 0.5  # work shorter than this shows nothing


def say(text: str) -> None:
    """Replace the line of progress, where someone watches; "" takes it away."""
    if sys.stderr.isatty():
        # The one text that steers the terminal, past what takes control characters out of all others.
        stream = getattr(sys.stderr, "stream", sys.stderr)
        stream.write(f"\r\x1b[K{harmless(text)}")
        stream.flush()


@contextmanager
def progress_line(quiet: bool = False) -> Iterator[Progress | None]:
    """Yield what functions of the library call with (text, done, in all), or None where nobody watches.

    The line is taken away at the end.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    last = time.monotonic()

    def draw(text: str, done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if not total or now - last > REDRAW_SECONDS:
            last = now
            say(f"{text} {done}/{total} " if total else text)

    try:
        yield draw
    finally:
        say("")
