"""Many programs side by side: the figures kept of each, `summary.csv`, and the table on the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.report.words import duration, number, only_plunges, plain, shortened

WIDTH = 100  # columns of the terminal
MOST_NAME = 36  # of them for the name

# First columns of summary.csv -> what of the outcome they show.
TOLD = {"program": "name", "file": "file", "status": "status", "reason": "reason", "report": "opens"}
# Its further columns, keys of the figures -> decimals; the units are in the names.
COLUMNS: Mapping[str, int | None] = {
    "machine": None,
    "load": None,
    "force_N": 3,
    "samples": 0,
    "cutting_length_mm": 3,
    "rapid_length_mm": 3,
    "time_s": 3,
    "mean_N_per_mm": 4,
    "min_N_per_mm": 4,
    "max_N_per_mm": 4,
    "range_N_per_mm": 4,
    "mean_deflection_um": 4,
    "headline": None,
    "plunge_length_mm": 3,
    "plunge_mean_N_per_mm": 4,
    "plunge_min_N_per_mm": 4,
    "plunge_max_N_per_mm": 4,
    "weakest_line": 0,
    "weakest_text": None,
    "weakest_x_mm": 4,
    "weakest_y_mm": 4,
    "weakest_z_mm": 4,
    "weakest_a_deg": 5,
    "weakest_b_deg": 5,
    "weakest_c_deg": 5,
    "min_margin": 5,
    "min_margin_line": 0,
    "out_of_reach_samples": 0,
    "extrapolated_share": 5,
    "warnings": 0,
    "not_acted_upon": 0,
    "required_N_per_mm": 4,
    "lines_below_required": 0,
    "compare_machine": None,
    "compare_mean_N_per_mm": 4,
    "compare_min_N_per_mm": 4,
    "compare_mean_difference_percent": 3,
}
PLUNGE_KEYS = ("length_mm", "mean_N_per_mm", "min_N_per_mm", "max_N_per_mm")
SAME_NAME = (
    "machine", "load", "force_N", "samples", "cutting_length_mm", "rapid_length_mm", "time_s", "mean_N_per_mm",
    "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "mean_deflection_um", "headline", "min_margin", "min_margin_line",
    "out_of_reach_samples", "extrapolated_share",
)  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What became of a program.

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
    figures: Mapping[str, Any] | None = None

    @property
    def status(self) -> str:
        """Failed; partial, with samples out of reach left out; or done."""
        if self.figures is None:
            return "failed"
        return "partial" if self.figures["out_of_reach_samples"] else "done"


def figures_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """The values of `COLUMNS` from a `summary.json`: small, however long the program."""
    found = {name: summary[name] for name in SAME_NAME}
    place = summary["weakest"]
    if place is not None:
        keys = ("line", "text", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
        found |= {f"weakest_{key}": place[key] for key in keys}
    plunges = summary["plunges"]
    if plunges is not None:
        found |= {f"plunge_{key}": plunges[key] for key in PLUNGE_KEYS}
    found |= {"warnings": len(summary["warnings"]), "not_acted_upon": len(summary["unsupported"])}
    if "required" in summary:
        found["required_N_per_mm"] = summary["required"]["required_N_per_mm"]
        found["lines_below_required"] = len(summary["required"]["below"])
    if "compare" in summary:
        other = summary["compare"]
        found |= {
            "compare_machine": other["machine"],
            "compare_mean_N_per_mm": other["mean_N_per_mm"],
            "compare_min_N_per_mm": other["min_N_per_mm"],
            "compare_mean_difference_percent": other["difference_percent"]["mean"],
        }
    return found


def summary_csv(outcomes: Sequence[Outcome]) -> str:
    """`summary.csv`: one row a program, failures too; a figure that does not exist is an empty cell."""
    rows = []
    for one in outcomes:
        figures = one.figures or {}
        told = [plain(getattr(one, of)) for of in TOLD.values()]
        rows.append([*told, *(_cell(figures.get(name), digits) for name, digits in COLUMNS.items())])
    return csv_text([*TOLD, *COLUMNS], rows)


def columns_of(outcomes: Sequence[Outcome]) -> dict[str, list[Any]]:
    """The same as values, column by column; None for a figure that does not exist."""
    told = {name: [getattr(one, of) for one in outcomes] for name, of in TOLD.items()}
    return {**told, **{name: [_figure(one, name) for one in outcomes] for name in COLUMNS}}


def _cell(value: Any, digits: int | None) -> str:
    if value is None:
        return ""
    return plain(str(value)) if digits is None else f"{value:.{digits}f}"


def terminal_summary(outcomes: Sequence[Outcome]) -> str:
    """One line a program that was analyzed, then the failures with their reasons; at most 100 columns but for these."""
    good = [one for one in outcomes if one.figures is not None]
    failed = [one for one in outcomes if one.figures is None]
    lines = _table(good) if good else []
    plunging = [plain(one.name) for one in good if only_plunges(one.figures or {})]
    if plunging:
        lines += textwrap.wrap(f"figures of plunges, nothing else is cut: {', '.join(plunging)}", WIDTH)
    partial = [one for one in good if one.status == "partial"]
    if partial:
        lines.append("cutting samples out of reach, left out:")
        lines += [f"  {plain(one.name)}: {number(_figure(one, 'out_of_reach_samples'))}" for one in partial]
    below = [one for one in good if _figure(one, "lines_below_required")]
    if below:
        lines.append(f"below the required {_figure(below[0], 'required_N_per_mm'):g} N/mm:")
        lines += [f"  {plain(one.name)}: {_lines(_figure(one, 'lines_below_required'))}" for one in below]
    if failed:
        lines.append(f"{len(failed)} of {len(outcomes)} programs failed:")
        lines += [f"  {plain(one.reason)}" for one in failed]
    return "\n".join(lines)


def _lines(count: float) -> str:
    return f"{number(count)} line{'' if count == 1 else 's'}"


def _figure(one: Outcome, name: str) -> Any:
    return (one.figures or {}).get(name)


def _table(good: Sequence[Outcome]) -> list[str]:
    """Names and program text to the left, figures to the right."""
    heads = ["program", "cutting mm", "time", "mean N/mm", "min N/mm"]
    compared = _figure(good[0], "compare_machine") is not None
    if compared:
        heads += ["other mean", "change"]
    heads += ["weakest line", ""]
    rows = [heads]
    for one in good:
        rows.append(
            [
                shortened(plain(one.name), MOST_NAME),
                number(_figure(one, "cutting_length_mm"), 1),
                duration(_figure(one, "time_s")),
                number(_figure(one, "mean_N_per_mm")),
                number(_figure(one, "min_N_per_mm")),
                *(_compared(one) if compared else ()),
                number(_figure(one, "weakest_line")).replace(" ", ""),
                plain(_figure(one, "weakest_text") or ""),
            ]
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    last = len(heads) - 1
    aligned = (
        "  ".join(
            f"{c:<{w}}" if i in (0, last) else f"{c:>{w}}" for i, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )
    return [shortened(line.rstrip(), WIDTH) for line in aligned]


def _compared(one: Outcome) -> list[str]:
    change = _figure(one, "compare_mean_difference_percent")
    return [number(_figure(one, "compare_mean_N_per_mm")), "-" if change is None else f"{change:+.1f} %"]
