"""Figures of an analysis in words and tables, the same on the terminal, in pictures and on pages."""

from collections.abc import Mapping, Sequence

from toolpath_stiff.analysis.results import Analysis, compare_summaries
from toolpath_stiff.analysis.statistics import FIGURES, PLUNGES_ONLY
from toolpath_stiff.documents import Document, number
from toolpath_stiff.report.pages import markup
from toolpath_stiff.report.tables import LABEL, ShownTable
from toolpath_stiff.report.words import WIDTH, counted, duration, machine_text, shortened

# Interpreter that read a program (`Program.interpreter`) -> words for headings.
READERS = {"builtin": "the built-in reader", "linuxcnc": "LinuxCNC's interpreter (rs274)"}
SOURCES = {"option": "as asked for", "program": "from the program", "default": "the machine's default"}
TITLES = ("mean N/mm", "min N/mm", "max N/mm", "range N/mm", "deflection um")
PLUNGES, ONLY_PLUNGES = "plunges N/mm", "only plunges"
OPERATION = '<button type="button" class="operation" data-operation="{}">{}</button>'
MOST_ROWS = 200  # of any table


def facts(summary: Document) -> list[tuple[str, str]]:
    """Figures of one analysis in words, each with its label."""
    origin = [f"{axis}{value:.10g}" for axis, value in zip("XYZABC", summary["origin_mm_deg"], strict=True)]
    origin = origin if any(summary["origin_mm_deg"][3:]) else origin[:3]
    mean, low, high, span = (number(summary[name]) for name in FIGURES[:4])
    cutting, rapid = (number(summary[f"{kind}_length_mm"], 1) for kind in ("cutting", "rapid"))
    limit = f"nearest in line {summary['min_margin_line']}: {summary['min_margin_limit']}"
    if summary["out_of_reach_samples"]:
        limit += f"; {number(summary['out_of_reach_samples'])} cutting samples are out of reach and left out"
    reader, posted = summary["interpreter"], summary["kinematics"]
    return [
        ("program", summary["program"]),
        *([("read by", READERS[reader])] if reader != "builtin" else []),
        *([("posted for", f"{posted}, tool tip and axis recovered")] if posted else []),
        ("machine", machine_text(summary)),
        ("load", f"{summary['load']}, {summary['force_N']:g} N"),
        ("program zero", f"{' '.join(origin)} ({SOURCES.get(summary['origin_source'], summary['origin_source'])})"),
        ("samples", f"{number(summary['samples'])}, at most {summary['step_mm']:g} mm apart"),
        ("path", f"{cutting} mm cutting, {rapid} mm rapid, {duration(summary['time_s'])}"),
        ("stiffness", f"mean {mean} N/mm, min {low}, max {high}, range {span} N/mm"),
        *_plunges(summary),
        *_band(summary),
        *_weakest(summary["weakest"]),
        ("limits", limit),
        *_of_kind(summary),
    ]


def _of_kind(summary: Document) -> list[tuple[str, str]]:
    """Fact on the range of a strut law, or on the configuration of joints."""
    if "extrapolated_share" in summary:
        share = summary["extrapolated_share"]
        return [("extrapolated", f"{share:.1%} of the cutting samples are outside the strut law")]
    return [("configuration", f"{name}, kept")] if (name := summary["configuration"]) else []


def _plunges(summary: Document) -> list[tuple[str, str]]:
    if only_plunges(summary):
        return [("plunges", "this program only plunges: every figure is of cuts along the tool axis")]
    if (plunges := beside(summary)) is None:
        return []
    mean, low, high = (number(plunges[name]) for name in FIGURES[:3])
    lowest = summary["min_N_per_mm"]
    weaker = lowest is not None and plunges["min_N_per_mm"] < lowest
    length = f"{number(plunges['length_mm'], 1)} mm in {number(plunges['moves'])} move{'s' * (plunges['moves'] != 1)}"
    text = f"{length}: mean {mean} N/mm, min {low}, max {high}; not counted above"
    return [("plunges", text + (", though weaker than all other cuts" if weaker else ""))]


def _band(summary: Document) -> list[tuple[str, str]]:
    if not (band := summary.get("parameter_uncertainty")):
        return []
    mean, lowest = (" to ".join(map(number, band[f"{name}_95_N_per_mm"])) for name in ("mean", "min"))
    alone = "" if band["form_known"] else ", from the fitted parameters alone"
    few = band["few_readings_share"]
    here = f"few readings near here: {few:.0%} of the path{', its weakest place' * band['few_readings_at_min']}"
    return [("95 % band", f"mean {mean}, min {lowest} N/mm{alone}"), *([("", here)] if few else [])]


def _weakest(place: Document | None) -> list[tuple[str, str]]:
    if place is None:
        return [("weakest", "-")]
    stiffness, text = number(place["stiffness_N_per_mm"]), shortened(place["text"], WIDTH - LABEL - 2)
    where = f"{stiffness} N/mm in line {place['line']} at {position(place, 3)}"
    return [("weakest", where), *([("", text)] if text else [])]


def position(place: Document, decimals: int) -> str:
    """Position of a weakest place, with angles if there are any: "X10.00 Y0.00 Z-2.00"."""
    axes = "xyzabc" if any(place[f"{axis}_deg"] for axis in "abc") else "xyz"
    values = [place[f"{axis}_mm" if axis in "xyz" else f"{axis}_deg"] for axis in axes]
    return " ".join(f"{axis.upper()}{value:.{decimals}f}" for axis, value in zip(axes, values, strict=True))


def only_plunges(figures: Document) -> bool:
    """True if the figures of a program, a tool or an operation are those of plunges, as it does nothing else."""
    return bool(figures.get("headline") == PLUNGES_ONLY)


def beside(figures: Document) -> Document | None:
    """Figures of the plunges that the headline leaves out; None if there are none, or nothing else."""
    return None if only_plunges(figures) else figures["plunges"]


def headline_text(figures: Document, between: str) -> str:
    """Mean and range for a heading, and what they are about unless it is every cut; `between` separates the parts."""
    span, plunges = "{} N/mm ({} to {})", beside(figures)
    text = f"mean {span.format(*(number(figures[name]) for name in FIGURES[:3]))}"
    if plunges is None:
        return f"{text}, {ONLY_PLUNGES}" if only_plunges(figures) else text
    return f"{text} across the tool axis{between}plunges {span.format(*(number(plunges[n]) for n in FIGURES[:3]))}"


def _figures(figures: Document) -> list[str]:
    return [number(figures[name], 2 if name.endswith("_um") else 0) for name in FIGURES]


def _part_figures(row: Document) -> tuple[object, ...]:
    place, plunges = row["weakest"] or {"line": "-", "text": ""}, beside(row) or {}
    return (
        number(row["cutting_length_mm"], 1),
        duration(row["time_s"]),
        *_figures(row),
        ONLY_PLUNGES if only_plunges(row) else number(plunges.get("mean_N_per_mm")),
        place["line"],
        markup('<code class="cut">{}</code>', shortened(place["text"], 26)),
    )


PART_TITLES = (">cutting mm", ">time", *(f">{title}" for title in (*TITLES, PLUNGES, "in line")), "weakest")


def tool_table(per_tool: Sequence[Document]) -> ShownTable:
    """Table with one row per tool."""
    rows = [
        (
            f"T{row['tool']}",
            "reference" if row["length_mm"] is None else number(row["length_mm"], 2),
            *_part_figures(row),
            shortened(row["remark"], 30),
        )
        for row in per_tool
    ]
    return ShownTable(("tool", ">length mm", *PART_TITLES, "remark"), rows)


def operation_table(per_operation: Sequence[Document], most: int = MOST_ROWS) -> ShownTable:
    """Table with one row per operation."""
    digits = len(str(min(len(per_operation), most)))
    rows = [
        (
            markup(OPERATION, place, f"{row['operation']:>{digits}} {row['name']}"),
            f"T{row['tool']}" if row["tool"] else "-",
            f"{row['first_line']}-{row['last_line']}",
            *_part_figures(row),
            "-" if row["min_margin"] is None else f"{row['min_margin']:.3f}",
        )
        for place, row in enumerate(per_operation[:most])
    ]
    return ShownTable(("operation", ">tool", ">lines", *PART_TITLES, ">margin"), rows)


def and_more(entries: Sequence[object], most: int, things: str) -> list[str]:
    """Line that says how many entries are not shown."""
    return [f"and {len(entries) - most} more {things} in summary.json"] if len(entries) > most else []


def required(analysis: Analysis) -> tuple[str, ShownTable]:
    """Sentence on whether every cut has the required stiffness, and the lines that have not, weakest first."""
    entry = analysis.to_dict()["required"]
    level, lowest = number(entry["required_N_per_mm"]), {row["line"]: row["min_N_per_mm"] for row in entry["below"]}
    if not lowest:
        return f"Every cutting move has the required {level} N/mm.", ShownTable((), ())
    below = {line: "no stiffness" if value is None else number(value) for line, value in lowest.items()}
    return lines_listed(analysis, below, f"below the required {level} N/mm", ">lowest N/mm", "weakest")


def lines_listed(
    analysis: Analysis, figures: Mapping[int, str], fault: str, title: str, which: str = "worst"
) -> tuple[str, ShownTable]:
    """Sentence on the lines with a fault, and a table of the first of them with their figures."""
    source = analysis.program.source
    more = f", the {MOST_ROWS} {which} of them here" if len(figures) > MOST_ROWS else ""
    rows = [
        (f"line {line}", figure, markup("<code>{}</code>", source[line - 1].strip() if source else ""))
        for line, figure in [*figures.items()][:MOST_ROWS]
    ]
    return f"{counted(len(figures), 'line')} {fault}{more}:", ShownTable(("", title, "program"), rows)


def comparison(summary: Document, other: Document) -> ShownTable:
    """Table of two machines side by side, with the difference in percent of the first."""
    compared, sides = compare_summaries(summary, other), (summary, other)
    changes = [*compared["difference_percent"].values(), compared["plunges_difference_percent"]]
    shown = ["-" if change is None else f"{change:+.1f} %" for change in changes]
    rows = [list(row) for row in zip(TITLES, *map(_figures, sides), shown, strict=False)]
    if any(map(beside, sides)):
        rows.append([PLUNGES, *(number((beside(side) or {}).get("mean_N_per_mm")) for side in sides), shown[-1]])
    rows.append(["weakest line", *(str((side["weakest"] or {"line": "-"})["line"]) for side in sides), ""])
    if all("extrapolated_share" in side for side in sides):
        rows.append(["extrapolated", *(f"{side['extrapolated_share']:.1%}" for side in sides), ""])
    if any(side["out_of_reach_samples"] for side in sides):
        rows.append(["out of reach", *(number(side["out_of_reach_samples"]) for side in sides), ""])
    return ShownTable(("", *(f">{shortened(machine_text(side), 32)}" for side in sides), ">difference"), rows)
