"""A table in one form: lines on a terminal, or part of a page."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

from markupsafe import Markup

from toolpath_stiff.report.words import WIDTH, plain, shortened

LABEL = 14  # columns of the left-hand words
LEAST_NAME = 24  # columns for the first column, however wide the others are


@dataclass(frozen=True)
class ShownTable:
    """Rows under titles; ">" before a title aligns its column to the right.

    Attributes
    ----------
    head
        Titles; without any, a page shows none.
    rows
        Cells: what is not text is shown as `str` does, `Markup` as it is on a page.
    kinds
        On a page the class of each row; none unless given.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    kinds: Sequence[str] = ()

    @property
    def titles(self) -> list[str]:
        """Titles without their marks."""
        return [title.removeprefix(">") for title in self.head]

    @property
    def right(self) -> list[int]:
        """Columns aligned to the right."""
        return [i for i, title in enumerate(self.head) if title.startswith(">")]

    def columns(self, *titles: str) -> Self:
        """Table of some of the columns."""
        places = [self.titles.index(title) for title in titles]
        return replace(self, head=[self.head[i] for i in places], rows=[[row[i] for i in places] for row in self.rows])

    def lines(self, indent: int = 0, least: int = LABEL, width: int = WIDTH) -> list[str]:
        """Lines for a terminal; the first column, of width `least` or more, gives way to the others."""
        rows = [[_plain(cell) for cell in row] for row in (self.titles, *self.rows)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        room = width - indent - sum(other + 2 for other in widths[1:])
        widths[0] = max(min(widths[0], max(room, LEAST_NAME)), least)
        return [shortened(" " * indent + self._line(row, widths), width) for row in rows]

    def _line(self, row: Iterable[str], widths: Sequence[int]) -> str:
        cells = [
            f"{shortened(cell, width):{'>' if i in self.right else '<'}{width}}"
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()


def _plain(cell: object) -> str:
    return plain(cell.striptags() if isinstance(cell, Markup) else str(cell))
