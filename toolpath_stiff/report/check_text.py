"""The tables of tools and operations that `tps check` prints: plain text, at most 98 columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from toolpath_stiff.report.terminal import aligned, first_column_fitted
from toolpath_stiff.report.wording import duration, number, plain

INDENT = 2  # columns to the left of the tables
MOST_ROWS = 40  # all are in --json
FIGURES = ("cutting mm", "time", "X", "Y", "Z")


def check_tables(tools: Sequence[Mapping[str, Any]], operations: Sequence[Mapping[str, Any]]) -> list[str]:
    """One row a tool that cuts, one row an operation, with the extents of the cuts; no table of a single row."""
    cutting = [row for row in tools if row["extents_mm"]]
    tables: list[str] = []
    if len(cutting) > 1:
        rows = [[_tool(row) + f" {plain(row['remark'])}".rstrip(), *_figures(row)] for row in cutting]
        tables += _table(["tool", *FIGURES], rows)
    if len(operations) > 1:
        shown = operations[:MOST_ROWS]
        digits = len(str(len(shown)))
        rows = [
            [
                f"{row['operation']:>{digits}} {plain(row['name'])}",
                _tool(row),
                f"{row['first_line']}-{row['last_line']}",
                *_figures(row),
            ]
            for row in shown
        ]
        tables += _table(["operation", "tool", "lines", *FIGURES], rows)
        if len(operations) > MOST_ROWS:
            tables.append(f"and {len(operations) - MOST_ROWS} more operations in --json")
    return tables


def _tool(row: Mapping[str, Any]) -> str:
    return f"T{row['tool']}" if row["tool"] else "-"


def _figures(row: Mapping[str, Any]) -> list[str]:
    extents = (row["extents_mm"].get(axis) for axis in "xyz")
    return [
        number(row["lengths_mm"]["cutting"], 1),
        duration(row["times_s"]["total"]),
        *("-" if ends is None else f"{number(ends[0], 1)}..{number(ends[1], 1)}" for ends in extents),
    ]


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    return aligned(first_column_fitted([head, *rows], INDENT))
