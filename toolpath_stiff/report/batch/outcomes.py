"""Outcomes of many programs: the figures kept of each, as `summary.csv` and as a table on the terminal."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from toolpath_stiff.analysis.statistics import FIGURES
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.documents import Document, number
from toolpath_stiff.report.analysis_tables import only_plunges
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import WIDTH, counted, duration, plain, shortened

MOST_NAME = 36  # columns of the terminal for the name
# First columns of summary.csv -> attribute of the outcome.
TOLD = {"program": "name", "file": "file", "status": "status", "reason": "reason", "report": "opens"}
# Its further columns, keys of the figures; the units are in the names.
CUT = ("samples", "cutting_length_mm", "rapid_length_mm", "time_s", *FIGURES, "headline")
PLUNGES = ("plunge_length_mm", *(f"plunge_{name}" for name in FIGURES[:3]))
WEAKEST = tuple(f"weakest_{name}" for name in ("line", "text", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"))
STANDING = ("min_margin", "min_margin_line", "out_of_reach_samples", "extrapolated_share", "warnings", "not_acted_upon")
REQUIRED = ("required_N_per_mm", "lines_below_required")
COMPARED = tuple(f"compare_{name}" for name in ("machine", *FIGURES[:2], "mean_difference_percent"))
COLUMNS = ("machine", "load", "force_N", *CUT, *PLUNGES, *WEAKEST, *STANDING, *REQUIRED, *COMPARED)
DECIMALS = {"_N": 3, "_mm": 4, "_um": 4, "_s": 3, "_deg": 5, "_percent": 3, "_margin": 5, "_share": 5}  # of a unit


@dataclass(frozen=True)
class ProgramOutcome:
    """Outcome of the analysis of one program.

    Attributes
    ----------
    name
        Short, and no other program's.
    file
        Where it was read, as named.
    reason
        Why it failed, a sentence that begins with the file; "" if it did not.
    opens
        The file that shows most of it, seen from the folder of all reports; "" if it failed.
    figures
        One value for each of `COLUMNS` where there is one; nothing if it failed.
    """

    name: str
    file: str
    reason: str = ""
    opens: str = ""
    figures: Document = field(default_factory=dict)

    @property
    def status(self) -> str:
        """State of the program: "failed", "partial" (samples out of reach left out) or "done"."""
        if not self.figures:
            return "failed"
        return "partial" if self.figures["out_of_reach_samples"] else "done"

    @property
    def plunges_only(self) -> bool:
        """True if its figures are of plunges, as it does nothing else."""
        return only_plunges(self.figures)

    def figure(self, name: str) -> Any:
        """Figure by name; None if it is missing."""
        return self.figures.get(name)

    def number(self, name: str, digits: int = 0) -> str:
        """Figure as text; "-" if it is missing."""
        return number(self.figure(name), digits)


def good_and_failed(outcomes: Sequence[ProgramOutcome]) -> tuple[list[ProgramOutcome], list[ProgramOutcome]]:
    """Programs that have figures, and programs that failed."""
    return [outcome for outcome in outcomes if outcome.figures], [o for o in outcomes if not o.figures]


def figures_of(summary: Document) -> Document:
    """Values of `COLUMNS` from a `summary.json`: small, however long the program."""
    flat = {
        **summary,
        **{f"weakest_{key}": value for key, value in (summary["weakest"] or {}).items()},
        **{f"plunge_{key}": value for key, value in (summary["plunges"] or {}).items()},
        "warnings": len(summary["warnings"]),
        "not_acted_upon": len(summary["unsupported"]),
    }
    if required := summary.get("required"):
        flat |= {"required_N_per_mm": required["required_N_per_mm"], "lines_below_required": len(required["below"])}
    if other := summary.get("compare"):
        flat |= {f"compare_{key}": value for key, value in other.items()}
        flat["compare_mean_difference_percent"] = other["difference_percent"]["mean"]
    return {name: flat[name] for name in COLUMNS if name in flat}


def summary_csv(outcomes: Sequence[ProgramOutcome]) -> str:
    """`summary.csv`: one row per program, failures too; a missing figure is an empty cell."""

    def cell(name: str, value: object) -> str:
        if not isinstance(value, float):
            return "" if value is None else plain(str(value))
        return f"{value:.{next(digits for unit, digits in DECIMALS.items() if name.endswith(unit))}f}"

    columns = columns_of(outcomes)
    shown = ([cell(name, value) for value in values] for name, values in columns.items())
    return csv_text([*columns], zip(*shown, strict=True))


def columns_of(outcomes: Sequence[ProgramOutcome]) -> dict[str, list[Any]]:
    """`summary.csv` as values, column by column; None for a missing figure."""
    columns = {name: [getattr(outcome, of) for outcome in outcomes] for name, of in TOLD.items()}
    return columns | {name: [outcome.figure(name) for outcome in outcomes] for name in COLUMNS}


def terminal_summary(outcomes: Sequence[ProgramOutcome]) -> str:
    """One line per program analyzed, then the failures with reasons; at most 100 columns except for these."""
    good, failed = good_and_failed(outcomes)
    lines = _program_table(good).lines() if good else []
    plunging = [plain(outcome.name) for outcome in good if outcome.plunges_only]
    if plunging:
        lines += textwrap.wrap(f"figures of plunges, nothing else is cut: {', '.join(plunging)}", WIDTH)
    partial = [outcome for outcome in good if outcome.status == "partial"]
    if partial:
        lines.append("cutting samples out of reach, left out:")
        lines += [f"  {plain(outcome.name)}: {outcome.number('out_of_reach_samples')}" for outcome in partial]
    below = [(outcome, count) for outcome in good if (count := outcome.figure("lines_below_required"))]
    if below:
        lines.append(f"below the required {good[0].figure('required_N_per_mm'):g} N/mm:")
        lines += [f"  {plain(outcome.name)}: {counted(count, 'line')}" for outcome, count in below]
    if failed:
        lines.append(f"{len(failed)} of {len(outcomes)} programs failed:")
        lines += [f"  {plain(outcome.reason)}" for outcome in failed]
    return "\n".join(lines)


def _program_table(good: Sequence[ProgramOutcome]) -> ShownTable:
    compared = good[0].figure("compare_machine") is not None
    rows = []
    for outcome in good:
        change = outcome.figure("compare_mean_difference_percent")
        rows.append(
            [
                shortened(outcome.name, MOST_NAME),
                outcome.number("cutting_length_mm", 1),
                duration(outcome.figure("time_s")),
                outcome.number("mean_N_per_mm"),
                outcome.number("min_N_per_mm"),
                *([outcome.number("compare_mean_N_per_mm")] if compared else []),
                *(["-" if change is None else f"{change:+.1f} %"] if compared else []),
                outcome.number("weakest_line").replace(" ", ""),
                outcome.figure("weakest_text") or "",
            ]
        )
    other = (">other mean", ">change") if compared else ()
    return ShownTable(("program", ">cutting mm", ">time", ">mean N/mm", ">min N/mm", *other, ">weakest line", ""), rows)
