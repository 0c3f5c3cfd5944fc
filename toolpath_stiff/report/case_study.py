"""Views of a case study, the paper's or one's own: text and table."""

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.documents import Document, number
from toolpath_stiff.placement.case_study import FIGURES, HIGH_MM, LOW_MM, REGION_COLUMNS, CaseStudy
from toolpath_stiff.report.words import counted
from toolpath_stiff.stiffness.model import machine_words

HOLDS = {True: "yes", False: "NO", None: "not tested"}
# As in the paper's Figure 10, mean and range first.
COLUMNS = ("region", *REGION_COLUMNS, *FIGURES)


def _table(study: CaseStudy) -> str:
    return csv_text(COLUMNS, ([str(row[key]) for key in COLUMNS] for row in study.summary["regions"]))


def text(study: CaseStudy) -> str:
    """The case study in words and numbers, Markdown."""
    summary = study.summary
    path = f"One path ({summary['program']}, {summary['note']}) in four regions, as the paper's Figure 10"
    if study.is_own:
        path = f"{summary['program']} in {counted(len(summary['regions']), 'region')}"
    lines = [
        f"# Case study on {machine_words(summary)}",
        "",
        *(line for warning in summary["warnings"] for line in (f"Warning: {warning}.", "")),
        f"{path}: mean stiffness under a load along the motion, and in parentheses its range, N/mm.",
        "",
        "| region | program zero, mm | turned | mean (range), N/mm |",
        "| --- | --- | --- | --- |",
    ]
    for row in summary["regions"]:
        lines.append(
            f"| {row['region']} | {row['x_mm']:g}, {row['y_mm']:g}, {row['z_mm']:g} | {row['rotation_deg']:g} deg | "
            f"{number(row['mean_N_per_mm'])} ({number(row['range_N_per_mm'])}) |"
        )
    lines += ["", "## The paper's conclusions", ""]
    for row_number, conclusion in enumerate(summary["conclusions"], 1):
        lines.append(f"{row_number}. {conclusion['statement']}: {HOLDS[conclusion['holds']]}. {conclusion['numbers']}.")
    lines += ["", "## Where they stop holding", "", *_limits_words(summary, study.is_own)]
    if study.is_own:
        return "\n".join([*lines, ""])
    lines += [
        "",
        "Non-planar cuts, of which the paper warns: the square with its height going up and down along every side.",
        "The means of two places at one height stay as close as before; it is the range that grows, several times,",
        "because the machine is twice as stiff along Z as along X and Y.",
        "",
        f"| waves, mm | means apart at z = {LOW_MM:g} mm | at z = {HIGH_MM:g} mm | ranges in regions 1 to 4, N/mm |",
        "| --- | --- | --- | --- |",
    ]
    for wave in summary["non_planar"]:
        low, high = wave["means_apart_at_one_height_percent"]
        ranges = ", ".join(number(row["range_N_per_mm"]) for row in wave["regions"])
        lines.append(f"| {wave['amplitude_mm']:g} | {low:.2f} % | {high:.2f} % | {ranges} |")
    return "\n".join([*lines, ""])


def _limits_words(summary: Document, custom: bool) -> list[str]:
    limits, heights, first = summary["limits_of_the_conclusions"], summary["heights"], summary["regions"][0]
    turned = f", turned {first['rotation_deg']:g} deg," if first["rotation_deg"] else ","
    moved = f"Moved up and down at ({first['x_mm']:g}, {first['y_mm']:g}) mm{turned}"
    mean, widest = (f"{limits[f'largest_{what}_at_z_mm']:g}" for what in ("mean", "range"))
    if not custom:
        return [
            f"{moved} the same path has its largest mean at z = {mean} mm and its largest range at z = {widest} mm: "
            "beyond, both fall again."
        ]
    return [
        f"{moved} as region {first['region']}, from z = {heights[0]['z_mm']:g} to {heights[-1]['z_mm']:g} mm (where it "
        f"is within reach), the path has its largest mean at z = {mean} mm and its largest range at z = {widest} mm."
    ]


DATA = {"case_study.csv": _table, "case_study.json": CaseStudy.to_json, "case_study.md": text}
