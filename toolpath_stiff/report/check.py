"""The text of `tps check`, with its tables of tools and operations: plain text, at most 100 columns."""

from collections.abc import Sequence

from toolpath_stiff.analysis.program_check import Figures, OperationRow, ProgramCheck, ToolRow
from toolpath_stiff.documents import number
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import duration

MOST_ROWS = 40  # all are in --json
FIGURES = (">cutting mm", ">time", ">X", ">Y", ">Z")


def _by_part(tools: Sequence[ToolRow], operations: Sequence[OperationRow]) -> list[str]:
    """One row a tool that cuts, one row an operation, with the extents of the cuts; no table of a single row."""
    digits = len(str(min(len(operations), MOST_ROWS)))
    by_tool = [(f"{_tool(row.tool)} {row.remark}", *_figures(row)) for row in tools if row.extents_mm]
    by_operation = [
        (f"{row.operation:>{digits}} {row.name}", _tool(row.tool), f"{row.first_line}-{row.last_line}", *_figures(row))
        for row in operations[:MOST_ROWS]
    ]
    tables = [
        ShownTable(("tool", *FIGURES), by_tool),
        ShownTable(("operation", ">tool", ">lines", *FIGURES), by_operation),
    ]
    lines = [line for table in tables if len(table.rows) > 1 for line in table.lines(indent=2)]
    more = len(operations) - MOST_ROWS
    return lines + ([f"  and {more} more operations in --json"] if more > 0 else [])


def _tool(number: int) -> str:
    return f"T{number}" if number else "-"


def _figures(row: Figures) -> list[str]:
    extents = (row.extents_mm.get(axis) for axis in "xyz")
    return [
        number(row.lengths_mm["cutting"], 1),
        duration(row.times_s["total"]),
        *("-" if ends is None else f"{number(ends[0], 1)}..{number(ends[1], 1)}" for ends in extents),
    ]


def text(check: ProgramCheck) -> str:
    """The document of `--json`, for people."""
    lines = [f"{check.program}, read as {check.dialect}"]
    if check.kinematics:
        lines[0] += f", posted for {check.kinematics}"
    if check.interpreter != "builtin":
        lines.append("read by LinuxCNC's interpreter: codes are counted where they stand, modal states are not known")
    if not check.complete:
        lines.append("NOT READ TO ITS END AS IT STANDS: figures are those of the blocks that could be read")
    findings = []
    for finding in check.findings:
        place = f"{finding.line}:{finding.column}" if finding.column else f"{finding.line or '-'}"
        findings.append(f"{finding.severity:<7} {place:>9}  {finding.text}")
    extents = [
        f"{axis.upper()}  {low:10.3f} to {high:10.3f} {unit}"
        for unit, ends in (("mm", check.whole.extents_mm), ("deg", check.whole.extents_deg))
        for axis, (low, high) in ends.items()
    ]
    times, speed = check.whole.times_s, check.fastest_strut
    lengths = [f"{key:<8} {length:12.1f} mm {times[key]:10.1f} s" for key, length in check.whole.lengths_mm.items()]
    lengths.append(f"dwell    {'':12}    {times['dwell']:10.1f} s")
    if speed:
        lengths.append(f"fastest strut in a cut: {speed['mm_per_min']:.0f} mm/min, line {speed['line']}")
    ignored = [f"{word.code:<7} {word.line}:{word.column}  {word.text}" for word in check.unsupported]
    sections = {
        "findings": findings or ["none"],
        "not acted upon": ignored or ["nothing"],
        "codes used (times, first line)": [
            f"{code.code:<6} {code.count:>7}  {code.line:>7}  {code.text}" for code in check.used
        ],
        "extents of cuts": extents,
        "lengths and times": lengths,
        "extents of cuts in mm, by tool and operation": _by_part(check.tools, check.operations),
        "modal state at the start, at the end": [
            f"{key:<18} {value:<10} {check.modal_end[key]}" for key, value in check.modal_start.items()
        ],
    }
    for title, rows in sections.items():
        if rows:
            lines += [f"\n{title}:", *(f"  {row.removeprefix('  ')}" for row in rows)]
    return "\n".join(lines) + "\n"
