"""The results of one analysis: files and text."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from toolpath_stiff.analysis.statistics import FIGURES, samples_csv, samples_parquet
from toolpath_stiff.column_files import check_parquet
from toolpath_stiff.files import Content
from toolpath_stiff.report.analysis.page import page_pieces
from toolpath_stiff.report.analysis.path import path_picture
from toolpath_stiff.report.figure_words import (
    READERS,
    compared_rows,
    length_in_moves,
    only_plunges,
    place_words,
    plunges_beside,
)
from toolpath_stiff.report.profile import profile_picture
from toolpath_stiff.report.words import (
    LABEL,
    WIDTH,
    aligned,
    duration,
    first_column_fitted,
    labelled,
    machine_text,
    plain,
    shortened,
)
from toolpath_stiff.results import one_of
from toolpath_stiff.units import number

if TYPE_CHECKING:
    from toolpath_stiff.analysis.results import Analysis


def names(plots: bool = True, table: str = "csv") -> tuple[str, ...]:
    """Names of the files that `files` makes. Raises `InputError` where there is no such table."""
    check_table(table)
    return (f"samples.{table}", "summary.json", *(("path.png", "profile.png", "report.html") if plots else ()))


def check_table(table: str) -> str:
    """The format of a table of samples. Raises `InputError` where it is unknown, or what it needs is not installed."""
    if one_of("table", table, tuple(TABLES)) == "parquet":
        check_parquet()
    return table


def files(analysis: Analysis, plots: bool, table: str, show_plunges: bool) -> dict[str, Callable[[], Content]]:
    """Name of each file -> what makes it: samples as "csv" or "parquet", summary, with `plots` pictures and page.

    With `show_plunges` axes and colour scales hold the plunges beside the headline figures too.
    """
    samples = TABLES[check_table(table)]
    contents: dict[str, Callable[[], Content]] = {
        f"samples.{table}": lambda: samples(analysis),
        "summary.json": analysis.to_json,
    }
    if plots:
        contents["path.png"] = lambda: path_picture(analysis, show_plunges=show_plunges)
        contents["profile.png"] = lambda: profile_picture(analysis, show_plunges=show_plunges)
        contents["report.html"] = lambda: page_pieces(analysis, show_plunges=show_plunges)
    return contents


def text(analysis: Analysis) -> str:
    """What the terminal shows: the figures, the other machine beside them, the lines below the required stiffness."""
    summary, source = analysis.to_dict(), analysis.program.source
    lines = [terminal_table(summary)]
    if analysis.on_other is not None:
        lines.append(comparison_table(summary, analysis.on_other.to_dict()))
    required = summary.get("required") or {"below": []}
    if required["below"]:
        lines.append(f"below the required {required['required_N_per_mm']:g} N/mm:")
        for entry in required["below"]:
            shown = source[entry["line"] - 1].strip() if source else ""
            lowest = entry["min_N_per_mm"]
            stiffness = "no stiffness (out of reach, or no motion)" if lowest is None else f"{lowest:.0f} N/mm"
            lines.append(f"  line {entry['line']}: {stiffness}  {shown}")
    return "\n".join(lines)


TABLES = {"csv": samples_csv, "parquet": samples_parquet}
MOST_OPERATIONS = 12  # rows; all are in summary.json


TITLES = ("mean N/mm", "min N/mm", "max N/mm", "range N/mm", "deflection um")


def terminal_table(summary: Mapping[str, Any]) -> str:
    """The figures of one analysis.

    Parameters
    ----------
    summary
        As in `summary.json`.
    """
    lines = [
        *_entry("program", summary["program"]),
        *(_entry("read by", READERS[summary["interpreter"]]) if summary["interpreter"] != "builtin" else ()),
        *(_entry("posted for", f"{summary['kinematics']}, recovered") if summary["kinematics"] else ()),
        *_entry("machine", machine_text(summary)),
        *_entry("load", f"{summary['load']}, {summary['force_N']:g} N"),
        *_entry("program zero", _origin(summary)),
        *_entry("samples", f"{number(summary['samples'])}, at most {summary['step_mm']:g} mm apart"),
        *_entry("path", _path(summary)),
        *_entry("stiffness", _stiffness(summary)),
        *_plunges(summary),
        *_band(summary),
        *_weakest(summary),
        *_entry("limits", _limits(summary)),
        *_entry(
            "extrapolated", f"{summary['extrapolated_share']:.1%} of the cutting samples are outside the strut law"
        ),
    ]
    if len(summary["per_tool"]) > 1:
        lines += _tools(summary["per_tool"])
    if len(summary["per_operation"]) > 1:
        lines += _operations(summary["per_operation"])
    if count := len(summary["unsupported"]):
        words = ", ".join(sorted({str(entry["word"]) for entry in summary["unsupported"]}))
        lines += _entry("not acted upon", f"{count} word{'s' if count > 1 else ''} (in summary.json): {words}")
    lines += _entry("assumptions", f"{len(summary['assumptions'])}, listed in summary.json")
    for warning in summary["warnings"]:
        lines += _entry("warning", warning)
    return "\n".join(lines)


def comparison_table(summary: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """Two machines side by side, the difference in percent of the first."""
    figures, plunges = compared_rows(summary, other, TITLES, "plunges N/mm")
    rows = [["", *(shortened(machine_text(one), 32) for one in (summary, other)), "difference"], *figures, *plunges]
    places = [s["weakest"] for s in (summary, other)]
    rows.append(["weakest line", *(str(place["line"]) if place else "-" for place in places), ""])
    rows.append(["extrapolated", *(f"{s['extrapolated_share']:.1%}" for s in (summary, other)), ""])
    if any(s["out_of_reach_samples"] for s in (summary, other)):
        rows.append(["out of reach", *(number(s["out_of_reach_samples"]) for s in (summary, other)), ""])
    return "\n".join(aligned(rows))


def _entry(label: str, text: str) -> list[str]:
    """A labelled entry, of nothing its label."""
    return labelled(label, text) or [label]


def _origin(summary: Mapping[str, Any]) -> str:
    says = {"option": "as asked for", "program": "from the program", "default": "the machine's default"}
    words = [f"{axis}{value:.10g}" for axis, value in zip("XYZABC", summary["origin_mm_deg"], strict=True)]
    shown = words if any(summary["origin_mm_deg"][3:]) else words[:3]
    return f"{' '.join(shown)} ({says.get(summary['origin_source'], summary['origin_source'])})"


def _path(summary: Mapping[str, Any]) -> str:
    cutting, rapid = number(summary["cutting_length_mm"], 1), number(summary["rapid_length_mm"], 1)
    return f"{cutting} mm cutting, {rapid} mm rapid, {duration(summary['time_s'])}"


def _stiffness(summary: Mapping[str, Any]) -> str:
    mean, low, high, span = (number(summary[name]) for name in FIGURES[:4])
    return f"mean {mean} N/mm, min {low}, max {high}, range {span} N/mm"


def _plunges(summary: Mapping[str, Any]) -> list[str]:
    """The plunges beside the headline figures, or that these are of plunges."""
    if only_plunges(summary):
        return _entry("plunges", "this program only plunges: every figure is of cuts along the tool axis")
    plunges = plunges_beside(summary)
    if plunges is None:
        return []
    text = f"{length_in_moves(plunges)}: mean {number(plunges['mean_N_per_mm'])} N/mm, "
    text += f"min {number(plunges['min_N_per_mm'])}, max {number(plunges['max_N_per_mm'])}"
    lowest = summary["min_N_per_mm"]
    weaker = lowest is not None and plunges["min_N_per_mm"] < lowest
    return _entry("plunges", f"{text}; not counted above{', though weaker than all other cuts' if weaker else ''}")


def _band(summary: Mapping[str, Any]) -> list[str]:
    """What the uncertainty of fitted parameters leaves open, where the machine file tells of it."""
    band = summary.get("parameter_uncertainty")
    if not band:
        return []
    low, high = (number(end) for end in band["mean_95_N_per_mm"])
    lowest, highest = (number(end) for end in band["min_95_N_per_mm"])
    return _entry(
        "95 % band",
        f"mean {low} to {high}, min {lowest} to {highest} N/mm, from the fitted parameters alone; widest on line "
        f"{band['largest_sd_line']} (sd {band['largest_sd_percent']:.1f} %)",
    )


def _weakest(summary: Mapping[str, Any]) -> list[str]:
    place = summary["weakest"]
    if place is None:
        return _entry("weakest", "-")
    stiffness, where = number(place["stiffness_N_per_mm"]), place_words(place, 3)
    lines = _entry("weakest", f"{stiffness} N/mm in line {place['line']} at {where}")
    if place["text"]:
        lines.append(" " * (LABEL + 2) + shortened(plain(place["text"]), WIDTH - LABEL - 2))
    return lines


def _limits(summary: Mapping[str, Any]) -> str:
    text = f"nearest in line {summary['min_margin_line']}: {summary['min_margin_limit']}"
    if summary["out_of_reach_samples"]:
        text += f"; {number(summary['out_of_reach_samples'])} cutting samples are out of reach and left out"
    return text


def _tools(per_tool: Sequence[Mapping[str, Any]]) -> list[str]:
    rows = [["tool", "length mm", "cutting mm", "mean N/mm", "min", "max", "remark"]]
    for row in per_tool:
        rows.append(
            [
                f"T{row['tool']}",
                "reference" if row["length_mm"] is None else number(row["length_mm"], 2),
                number(row["cutting_length_mm"], 1),
                *(number(row[name]) for name in FIGURES[:3]),
                shortened(plain(row["remark"]), 30),
            ]
        )
    return aligned(rows, left_last=True) + _only_plunges(per_tool, [f"T{row['tool']}" for row in per_tool])


def _only_plunges(parts: Sequence[Mapping[str, Any]], names: Sequence[str]) -> list[str]:
    """A note on the parts whose figures are of plunges, where not all are."""
    plunging = [name for part, name in zip(parts, names, strict=True) if only_plunges(part)]
    if not plunging or len(plunging) == len(parts):
        return []
    return textwrap.wrap(f"{', '.join(plunging)}: figures of plunges, there is no other cut", WIDTH)


def _operations(per_operation: Sequence[Mapping[str, Any]]) -> list[str]:
    shown = per_operation[:MOST_OPERATIONS]
    digits = len(str(shown[-1]["operation"]))
    rows = [["operation", "tool", "lines", "cutting mm", "time", "mean N/mm", "min", "in line"]]
    for row in shown:
        rows.append(
            [
                f"{row['operation']:>{digits}} {plain(row['name'])}",
                f"T{row['tool']}" if row["tool"] else "-",
                f"{row['first_line']}-{row['last_line']}",
                number(row["cutting_length_mm"], 1),
                duration(row["time_s"]),
                *(number(row[name]) for name in FIGURES[:2]),
                str(row["weakest"]["line"]) if row["weakest"] else "-",
            ]
        )
    more = len(per_operation) - len(shown)
    notes = _only_plunges(shown, [f"operation {row['operation']}" for row in shown])
    return (
        aligned(first_column_fitted(rows)) + notes + ([f"and {more} more operations in summary.json"] if more else [])
    )
