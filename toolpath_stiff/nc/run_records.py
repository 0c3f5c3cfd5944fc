"""Records of a run: its calls and, for a check, its errors and codes."""

import gc
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.words import Block

MOST_ERRORS = 100


@contextmanager
def collector_at_rest() -> Iterator[None]:
    """Context without Python's search for cycles of objects: a run leaves none, and would spend its time looking."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


@dataclass
class Subprogram:
    """A subprogram that runs.

    Attributes
    ----------
    name, first, back, again
        Its name, first line (from 0), where to go on, and how often it runs again.
    arguments
        The local variables with which each of its runs begins; None: it has those of its caller.
    modal
        Whether G66 calls it.
    stop
        Of a repeated section the line after it; -1: it is a call.
    references
        Parameter -> where the variable is kept that it stands for, and its name there.
    kept
        Modes and frames that its end brings back (SAVE).
    """

    name: str
    first: int
    back: int
    again: int
    arguments: Mapping[Any, float | None] | None = None
    modal: bool = False
    stop: int = -1
    references: Mapping[str, tuple[dict[Any, float | None], str]] = field(default_factory=dict)
    kept: Mapping[str, object] = field(default_factory=dict)


@dataclass
class Tally:
    """Results that a check collects during a run: errors, and for each code its first place and its count."""

    errors: list[InputError] = field(default_factory=list)
    met: int = 0  # number of errors, repeated ones included
    first: dict[str, tuple[int, int]] = field(default_factory=dict)
    count: Counter[str] = field(default_factory=Counter)

    def keep(self, error: InputError) -> None:
        """Keep an error, once; raise it from `MOST_ERRORS` on: the file is then not a program for this reader."""
        self.met += 1
        if str(error) not in map(str, self.errors):
            self.errors.append(error)
        if self.met >= MOST_ERRORS:
            raise error

    def add(self, code: str, line: int, column: int, times: int = 1) -> None:
        """Count a code, or a word, of a block."""
        self.first.setdefault(code, (line, column))
        self.count[code] += times

    def add_block(self, block: Block) -> None:
        """Count the codes of a block."""
        for word in block.words:
            if word.letter in "GM":
                self.add(code_name(word.letter, word.value), block.line, word.column)


def beyond_the_end(what: str, row: int, lines: int) -> list[Remark]:
    """The warning that lines follow the end of a program in line `row` (from 0), if any do."""
    return [Remark(f"what follows {what} is not part of the program (lines: {lines})", row + 1)] if lines else []
