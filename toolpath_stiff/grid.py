"""Cells of a table before anybody has asked what they mean."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

SPREADSHEET_ERROR = re.compile(r"#[A-ZÄÖÜ][A-ZÄÖÜ0-9/_]*[!?]|#N/A|#N/?V")

Rows = list[tuple[int, list[str]]]  # line (row of a sheet) and cells


@dataclass(frozen=True)
class Grid:
    """Line (row of a sheet) and cells of every row that is neither empty nor a comment.

    `separator` is "" for a sheet; `merged` are cells that are merged side by side, row -> which.
    """

    rows: Rows
    separator: str
    notes: tuple[str, ...] = ()
    merged: Mapping[int, str] = field(default_factory=dict)


def typed(cell: str) -> str:
    """A cell without space around it; the printer's minus as a keyboard's.

    The apostrophe that keeps spreadsheets from running a word (`column_files.csv_text`) is no part of the word.
    """
    text = cell.strip().replace("\u2212", "-")
    return text[1:] if text[:2] in ("'=", "'+", "'-", "'@") else text


def counts(cells: list[str]) -> bool:
    """Whether a row is neither empty nor a comment; an error of the spreadsheet begins like one."""
    return any(cells) and (not cells[0].startswith("#") or bool(SPREADSHEET_ERROR.fullmatch(cells[0])))
