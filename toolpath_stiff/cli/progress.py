"""A progress bar on standard error for long work; nothing at all where no one watches."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

QUIET_SECONDS = 0.5  # work shorter than this shows no bar
REDRAW_SECONDS = 0.1
WIDTH = 30


def say(text: str) -> None:
    """Replace the line of progress, where someone watches; "" takes it away."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")
        sys.stderr.flush()


@contextmanager
def progress_bar(label: str, quiet: bool = False) -> Iterator[Callable[[int, int], None] | None]:
    """Yield a function (done, total) that draws the bar, or None where standard error is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    start = time.monotonic()
    drawn = start + QUIET_SECONDS
    shown = False

    def draw(done: int, total: int) -> None:
        nonlocal drawn, shown
        now = time.monotonic()
        if now < drawn:
            return
        drawn, shown = now + REDRAW_SECONDS, True
        filled = WIDTH * done // max(total, 1)
        left = (now - start) * (total - done) / max(done, 1)
        bar = "#" * filled + "." * (WIDTH - filled)
        sys.stderr.write(f"\r{label} [{bar}] {done}/{total}, {left:.0f} s left ")
        sys.stderr.flush()

    try:
        yield draw
    finally:
        if shown:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()
