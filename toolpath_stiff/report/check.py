"""The tables of tools and operations that `tps check` prints: plain text, at most 98 columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from toolpath_stiff.analysis.program_check import ProgramCheck
from toolpath_stiff.report.words import aligned, duration, first_column_fitted, plain
from toolpath_stiff.units import number

INDENT = 2  # columns to the left of the tables


MOST_ROWS = 40  # all are in --json


CHECK_FIGURES = ("cutting mm", "time", "X", "Y", "Z")


def check_tables(tools: Sequence[Mapping[str, Any]], operations: Sequence[Mapping[str, Any]]) -> list[str]:
    """One row a tool that cuts, one row an operation, with the extents of the cuts; no table of a single row."""
    cutting = [row for row in tools if row["extents_mm"]]
    tables: list[str] = []
    if len(cutting) > 1:
        rows = [[_tool(row) + f" {plain(row['remark'])}".rstrip(), *_figures(row)] for row in cutting]
        tables += _table(["tool", *CHECK_FIGURES], rows)
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
        tables += _table(["operation", "tool", "lines", *CHECK_FIGURES], rows)
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


def text(check: ProgramCheck) -> str:
    """What `--json` prints, for people."""
    document = check.to_dict()
    posted = f", posted for {document['kinematics']}" if document["kinematics"] else ""
    lines = [f"{document['program']}, read as {document['dialect']}{posted}"]
    if document["interpreter"] != "builtin":
        lines.append("read by LinuxCNC's interpreter: codes are counted where they stand, modal states are not known")
    if not document["complete"]:
        lines.append("NOT READ TO ITS END AS IT STANDS: figures are those of the blocks that could be read")
    lines.append("\nfindings:")
    for finding in document["findings"]:
        place = f"{finding['line']}:{finding['column']}" if finding["column"] else f"{finding['line'] or '-'}"
        lines.append(f"  {finding['severity']:<7} {place:>9}  {finding['text']}")
    lines += ["  none"] if not document["findings"] else []
    lines.append("\nnot acted upon:")
    for word in document["unsupported"]:
        lines.append(f"  {word['code']:<7} {word['line']}:{word['column']}  {word['text']}")
    lines += ["  nothing"] if not document["unsupported"] else []
    lines.append("\ncodes used (times, first line):")
    lines += [f"  {code['code']:<6} {code['count']:>7}  {code['line']:>7}  {code['text']}" for code in document["used"]]
    lines.append("\nextents of cuts:")
    for unit, key in (("mm", "extents_mm"), ("deg", "extents_deg")):
        lines += [
            f"  {axis.upper()}  {low:10.3f} to {high:10.3f} {unit}" for axis, (low, high) in document[key].items()
        ]
    lines.append("\nlengths and times:")
    for key, length in document["lengths_mm"].items():
        lines.append(f"  {key:<8} {length:12.1f} mm {document['times_s'][key]:10.1f} s")
    if "dwell" in document["times_s"]:
        lines.append(f"  dwell    {'':12}    {document['times_s']['dwell']:10.1f} s")
    if document["fastest_strut"]:
        speed = document["fastest_strut"]
        lines.append(f"  fastest strut in a cut: {speed['mm_per_min']:.0f} mm/min, line {speed['line']}")
    tables = check_tables(document["tools"], document["operations"])
    lines += ["\nextents of cuts in mm, by tool and operation:", *(f"  {line}" for line in tables)] if tables else []
    lines.append("\nmodal state at the start, at the end:")
    for key, value in document["modal_start"].items():
        lines.append(f"  {key:<18} {value:<10} {document['modal_end'][key]}")
    return "\n".join(lines) + "\n"
