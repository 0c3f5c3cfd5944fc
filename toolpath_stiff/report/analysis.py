"""Views of an analysis: terminal text, page and files."""

import textwrap
from collections.abc import Iterator, Sequence

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.analysis.statistics import sample_columns, table_rows
from toolpath_stiff.column_files import check_parquet, csv_pieces, parquet_pieces
from toolpath_stiff.documents import Document
from toolpath_stiff.path.table import PATH_COLUMNS, decimals_of
from toolpath_stiff.report import analysis_page, cut, cut_files
from toolpath_stiff.report.analysis_tables import (
    TITLES,
    and_more,
    comparison,
    facts,
    only_plunges,
    operation_table,
    required,
    tool_table,
)
from toolpath_stiff.report.tables import LABEL
from toolpath_stiff.report.words import WIDTH, labelled
from toolpath_stiff.results import one_of

# Columns of `samples.csv`, Parquet and the DataFrame, with their decimals; joints have those of lengths, or 6.
COLUMNS: dict[str, int | None] = {
    **PATH_COLUMNS,
    "stiffness_N_per_mm": 4,
    "stiffness_sd_N_per_mm": 4,
    "deflection_um": 6,
    "margin": 6,
    **dict.fromkeys(("margin_limit", "operation", "cut")),
}
MOST_OPERATIONS = 12  # on the terminal; all are in summary.json


def unwritten(table: str, cut: bool) -> tuple[str, ...]:
    """Files that are not written. Raises `InputError` if the format is unknown or not installed."""
    if one_of("table", table, ("csv", "parquet")) == "parquet":
        check_parquet()
    others = tuple(name for name in ("samples.csv", "samples.parquet") if not name.endswith(table))
    return others if cut else (*others, *OF_CUT)


def samples_csv(analysis: Analysis) -> Iterator[bytes]:
    """`samples.csv` in pieces: the heading, then blocks of rows. A missing value is an empty cell."""
    names = sample_columns(analysis, slice(0))
    decimals = {name: COLUMNS.get(name, decimals_of(name)) for name in names}
    rows = table_rows(analysis)
    return csv_pieces(lambda some: sample_columns(analysis, rows[some]), len(rows), decimals)


def samples_parquet(analysis: Analysis) -> Iterator[bytes]:
    """`samples.parquet` in pieces, full precision. A missing value is null."""
    rows = table_rows(analysis)
    return parquet_pieces(lambda some: sample_columns(analysis, rows[some]), len(rows))


DATA = {
    "samples.csv": samples_csv,
    "samples.parquet": samples_parquet,
    "summary.json": Analysis.to_json,
    "cut.csv": cut_files.stations_csv,
    "cut_lines.csv": cut_files.lines_csv,
    "surface.vtk": cut_files.surface_vtk,
}
OF_CUT = ("cut.csv", "cut_lines.csv", "surface.vtk", "cut.png")
PAGE, page = "report.html", analysis_page.page


def text(analysis: Analysis) -> str:
    """Text for the terminal: the figures, the other machine beside them, the lines below the required stiffness."""
    summary = analysis.to_dict()
    lines = [terminal_text(summary)]
    if analysis.on_other is not None:
        lines += comparison(summary, analysis.on_other.to_dict()).lines()
    if "required" in summary and summary["required"]["below"]:
        sentence, below = required(analysis)
        lines += [sentence, *below.lines(2, 0)[1:]]
    if analysis.cut is not None:
        lines += cut.text(analysis)
    return "\n".join(lines)


def terminal_text(summary: Document) -> str:
    """Figures of one analysis, from its `summary.json`."""
    tools, operations = tool_table(summary["per_tool"]), operation_table(summary["per_operation"], MOST_OPERATIONS)
    lines = [line for label, words in facts(summary) for line in labelled(label, words, LABEL) or [label]]
    if len(tools.rows) > 1:
        lines += tools.columns("tool", "length mm", "cutting mm", *TITLES[:3], "remark").lines()
        lines += _only_plunges(summary["per_tool"], [f"T{row['tool']}" for row in summary["per_tool"]])
    if len(operations.rows) > 1:
        lines += operations.columns("operation", "tool", "lines", "cutting mm", "time", *TITLES[:2], "in line").lines()
        shown = summary["per_operation"][:MOST_OPERATIONS]
        lines += _only_plunges(shown, [f"operation {row['operation']}" for row in shown])
        lines += and_more(summary["per_operation"], MOST_OPERATIONS, "operations")
    if count := len(summary["unsupported"]):
        words = ", ".join(sorted({str(entry["word"]) for entry in summary["unsupported"]}))
        lines += labelled("not acted upon", f"{count} words (in summary.json): {words}", LABEL)
    lines += labelled("assumptions", f"{len(summary['assumptions'])}, listed in summary.json", LABEL)
    return "\n".join(lines + [line for warning in summary["warnings"] for line in labelled("warning", warning, LABEL)])


def _only_plunges(parts: Sequence[Document], names: Sequence[str]) -> list[str]:
    """Note on the parts that only plunge, if not all do."""
    plunging = [name for part, name in zip(parts, names, strict=True) if only_plunges(part)]
    if not plunging or len(plunging) == len(parts):
        return []
    return textwrap.wrap(f"{', '.join(plunging)}: figures of plunges, there is no other cut", WIDTH)
