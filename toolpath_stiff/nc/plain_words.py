"""The words of plain lines, lexed many at a time by one regular expression (`plain_lines`)."""

from __future__ import annotations

import re
from collections.abc import Sequence

from toolpath_stiff.nc.geometry import CENTER_LETTERS
from toolpath_stiff.nc.words import AXES

CHUNK = 8192  # lines: their words fit into a processor's cache
LONGEST_PLAIN = 256  # characters; longer lines are left to `read_block`
LETTERS = AXES + CENTER_LETTERS
LENGTH_LETTERS = "XYZIJKR"
G_COLUMN, FIRST_F, FIRST_LETTER = 0, 1, 2
LAST_F = FIRST_LETTER + len(LETTERS)
LAST_S = LAST_F + 1
OTHER = LAST_S + 1  # the text of a line that is not plain

_NUMBER = r"[+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)"
_FEED = r"(?:F((?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)))?"
_SPEED = r"(?:S((?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)))?"
_WORDS = "".join(f"(?:{letter}({_NUMBER}))?" for letter in LETTERS)
_COMMENT = r"(?:\([^()\n]*+\))*+"
# The order of words is that of every CAM system, F in front or behind, S last; any other order is not plain.
_LINE = rf"^{_COMMENT}(?:N[0-9]++)?(?:G0?([0-3]))?{_FEED}{_WORDS}{_FEED}{_SPEED}{_COMMENT}%s$|^(.+)$"
_PATTERNS = {True: re.compile(_LINE % r"(?:;.*)?", re.MULTILINE), False: re.compile(_LINE % ";?", re.MULTILINE)}
_BARE = re.compile(r"^[+-]?0*[1-9][0-9]*$", re.MULTILINE)
_POINTED = re.compile(r"^[+-]?0*[1-9][0-9]*\.$", re.MULTILINE)

Row = tuple[str, ...]


class PlainLines:
    """The lines of a program, lexed a chunk at a time as they are asked for.

    Parameters
    ----------
    lines
        Of the program.
    semicolon
        Whether `;` begins a comment (else it may end a block).
    """

    def __init__(self, lines: Sequence[str], semicolon: bool) -> None:
        self.lines = lines
        self._pattern = _PATTERNS[semicolon]
        self._start, self._rows = 0, list[Row]()
        self._others: list[int] = []  # lines of the chunk that are not plain, and its end, in falling order

    def run(self, at: int) -> int:
        """How many lines from `at` (from 0) are plain; no more than the chunk's rest."""
        if not self._start <= at < self._start + len(self._rows):
            self._lex(at)
        while self._others[-1] < at:
            self._others.pop()
        return self._others[-1] - at

    def has(self, at: int) -> bool:
        """Whether a line is in the present chunk."""
        return self._start <= at < self._start + len(self._rows)

    def rows(self, at: int, count: int) -> list[Row]:
        """The words of lines that `run` has counted, as texts: G, F, `LETTERS`, F, S; "" where there is none."""
        return self._rows[at - self._start : at - self._start + count]

    def _lex(self, at: int) -> None:
        chunk = self.lines[at : at + CHUNK]
        if max(map(len, chunk)) > LONGEST_PLAIN:
            chunk = [line if len(line) <= LONGEST_PLAIN else "!" for line in chunk]
        text = "\n".join(chunk).replace(" ", "").replace("\t", "")
        if text.isascii():  # of other scripts some letters become ASCII ones in upper case
            text = text.upper()
        rows = self._pattern.findall(text)
        self._start, self._rows = at, rows
        end = at + len(rows)
        self._others = [end, *(at + i for i in range(len(rows) - 1, -1, -1) if rows[i][OTHER])]


def is_place(row: Row) -> bool:
    """Whether a plain line names X or Y and nothing else."""
    named = row[FIRST_LETTER : FIRST_LETTER + 2]
    return any(named) and not any(row[:FIRST_LETTER]) and not any(row[FIRST_LETTER + 2 :])


def is_bare(text: str) -> bool:
    """Whether a number other than 0 stands without a decimal point."""
    return _BARE.match(text) is not None


def has_pointed(column: Sequence[str]) -> bool:
    """Whether a number other than 0 ends with its decimal point."""
    return _POINTED.search("\n".join(column)) is not None


def first_bare(columns: Sequence[Sequence[str]]) -> int | None:
    """The first row in which a number other than 0 has no decimal point."""
    found = None
    for column in columns:
        text = "\n".join(column)
        match = _BARE.search(text)
        if match is not None:
            row = text.count("\n", 0, match.start())
            found = row if found is None else min(found, row)
    return found
