"""Views of the cut of an analysis in words and tables, on the terminal and on its page."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import IntArray
from toolpath_stiff.documents import Document, number
from toolpath_stiff.report.analysis_tables import MOST_ROWS, lines_listed
from toolpath_stiff.report.pages import Part, markup
from toolpath_stiff.report.tables import LABEL, ShownTable
from toolpath_stiff.report.words import labelled


def text(analysis: Analysis) -> list[str]:
    """Lines for the terminal."""
    document = analysis.to_dict()["cut"]
    lines = [line for label, words in facts(document) for line in labelled(label, words, LABEL)]
    for label, table in (("material left", "worst_material_left"), ("cut too deep", "worst_cut_too_deep")):
        if document[table]:
            lines += [f"{label}, worst lines:", *places(document[table]).lines(2, 0)]
    if "tolerance" in document:
        sentence, beyond = tolerance(analysis)
        lines += [sentence, *(beyond.lines(2, 0)[1:] if beyond.rows else ())]
    return lines


def facts(document: Document) -> list[tuple[str, str]]:
    """Figures of a cut in words, each with its label; from the entry `cut` of `summary.json`."""
    tools = [
        f"T{tool['tool']} D{tool['diameter_mm']:g}, {number(tool['lateral_nm_per_N'], 1)} nm/N"
        for tool in document["tools"]
    ]
    removed, force = number(document["removed_mm3"]), number(document["largest_force_N"])
    return [
        ("cut", f"{document['coefficients']['material'] or 'stated coefficients'}, stock {document['stock']}"),
        ("tools", f"{'; '.join(tools)} (at the tip, of the tool alone)"),
        ("removed", f"{removed} mm3, largest force along an axis {force} N"),
        ("walls", errors_in_words(document["walls"])),
        ("floors", errors_in_words(document["floors"])),
    ]


def errors_in_words(errors: Document | None) -> str:
    """Mean, limits that 95 % keep, and extremes; + is material left."""
    if errors is None:
        return "none is finished"
    mean, least, most = (f"{errors[name]:+.1f}" for name in ("mean_um", "least_um", "most_um"))
    length = number(errors["length_mm"])
    extremes = f"from {least} to {most} um on {length} mm (+ material left, - cut too deep)"
    return f"error mean {mean} um, 95 % within {errors['p95_um']:.1f}, {extremes}"


def places(entries: Sequence[Document], rows: Sequence[int] = ()) -> ShownTable:
    """Table of the worst surfaces; with the page's `rows` of their samples, a button each."""
    button = '<button type="button" class="place" data-line="{}" data-sample="{}">line {}</button>'
    shown = [
        (
            markup(button, entry["line"], rows[i], entry["line"]) if rows else f"line {entry['line']}",
            entry["surface"],
            f"{entry['mean_um']:+.1f}",
            f"{entry['sd_um']:.1f}",
            f"{entry['least_um']:+.1f} to {entry['most_um']:+.1f}",
            markup("<code>{}</code>", entry["text"]),
        )
        for i, entry in enumerate(entries)
    ]
    return ShownTable(("", "surface", ">mean um", ">sd um", ">over the height", "program"), shown)


def tolerance(analysis: Analysis) -> tuple[str, ShownTable]:
    """Sentence on whether every surface is within tolerance, and the lines that leave it, worst first."""
    entry = analysis.to_dict()["cut"]["tolerance"]
    level, beyond = f"{entry['tolerance_um']:g} um", {row["line"]: f"{row['worst_um']:+.1f}" for row in entry["beyond"]}
    if not beyond:
        return f"Every surface that is finished is within {level}.", ShownTable((), ())
    return lines_listed(analysis, beyond, f"beyond {level}", ">worst um")


PART = (
    ">removed mm3",
    ">largest N",
    ">walls mean um",
    ">95 % um",
    ">walls from",
    ">to",
    ">floors mean um",
    ">from",
    ">to",
)


def part_table(heading: str, names: Sequence[str], parts: Sequence[Document]) -> ShownTable:
    """Table with one row for each operation or tool."""

    def cells(errors: Document | None, *keys: str) -> list[str]:
        return [f"{errors[f'{key}_um']:+.1f}" if errors else "-" for key in keys]

    rows = [
        (
            name,
            number(part["removed_mm3"]),
            number(part["largest_force_N"]),
            *cells(part["walls"], "mean", "p95", "least", "most"),
            *cells(part["floors"], "mean", "least", "most"),
        )
        for name, part in zip(names, parts, strict=True)
    ]
    return ShownTable((heading, *PART), rows)


def cut_tables(analysis: Analysis, rows: IntArray) -> list[tuple[str, Sequence[Part], bool]]:
    """Title, content and True if wide, of the page's tables; `rows` are the samples on the page."""
    if analysis.cut is None:
        return []
    summary = analysis.to_dict()
    document = summary["cut"]
    names = [f"{row['operation']} {row['name']}" for row in summary["per_operation"]]
    operations = part_table("operation", names[:MOST_ROWS], document["per_operation"][:MOST_ROWS])
    tools = part_table("tool", [f"T{part['tool']}" for part in document["per_tool"]], document["per_tool"])
    worst = [
        places(document[key], [int(np.searchsorted(rows, entry["sample"])) for entry in document[key]])
        for key in ("worst_material_left", "worst_cut_too_deep")
    ]
    return [
        ("Cut by operation and tool", [operations, tools], True),
        ("Cut", [ShownTable((), facts(document))], False),
        ("Surface error: material left", [worst[0]] if worst[0].rows else [], False),
        ("Surface error: cut too deep", [worst[1]] if worst[1].rows else [], False),
        ("Tolerance", [*tolerance(analysis)] if "tolerance" in document else [], False),
        ("Cut: assumptions", [document["assumptions"]], False),
    ]
