"""The paper's case study: one tool path in four regions of the workspace, at two heights, displaced and turned.

Clinton, Zhang, Wavering (1997), Figure 10 and conclusion 3. The paper prints neither its path nor its figures; path and
regions are ours. What it concludes is checked one by one, and where it stops holding is shown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import resources
from itertools import pairwise
from typing import Any

from toolpath_stiff import defaults
from toolpath_stiff.analysis import Analysis, analyze
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.nc import Program, parse_program
from toolpath_stiff.stiffness.model import StiffnessModel, condition_warnings, effects_stated, machine_words
from toolpath_stiff.units import Pose, m_from_mm, mm_from_m, rad_from_deg

PROGRAM = "case_study.nc"
LOW_MM, HIGH_MM = 400.0, 1200.0
# Region -> x, y, z in mm, turn in degrees.
REGIONS: dict[str, tuple[float, float, float, float]] = {
    "1": (150.0, 100.0, LOW_MM, 0.0),
    "2": (-150.0, 100.0, LOW_MM, 45.0),
    "3": (150.0, 100.0, HIGH_MM, 0.0),
    "4": (-150.0, 100.0, HIGH_MM, 45.0),
}
PAIRS_IN_HEIGHT = (("1", "3"), ("2", "4"))
PAIRS_IN_PLANE = (("1", "2"), ("3", "4"))
HEIGHTS_MM = tuple(float(z) for z in range(300, 1401, 25))
MEANS_AGREE = 0.01  # the paper: "stiffnesses of the same magnitude"; we ask for one per cent
WAVES_MM = (10.0, 20.0, 40.0)  # how far the non-planar variants of the path go up and down
DECIMALS = 3  # N/mm: finer than anything that can be measured, coarser than the processor's last digits


@dataclass(frozen=True)
class CaseStudy:
    """Figures of the case study (`summary`, in mm and N/mm) and the analyses of its regions."""

    summary: dict[str, Any]
    regions: dict[str, Analysis]


def case_study_program() -> Program:
    """The packaged path."""
    text = (resources.files("toolpath_stiff") / "data" / "programs" / PROGRAM).read_text(encoding="ascii")
    return parse_program(text, PROGRAM)


def wavy_program(amplitude_mm: float) -> Program:
    """The square with its height going up and down once along every side: a non-planar cut of the same outline."""
    lines = ["G21 G90 F1200", "G0 X-100 Y-100 Z0"]
    corners = [(-100, -100), (100, -100), (100, 100), (-100, 100), (-100, -100)]
    for (x0, y0), (x1, y1) in pairwise(corners):
        for i in range(1, 101):
            u = i / 100.0
            z = amplitude_mm * math.sin(2.0 * math.pi * u)
            lines.append(f"G1 X{x0 + u * (x1 - x0):.4f} Y{y0 + u * (y1 - y0):.4f} Z{z:.4f}")
    return parse_program("\n".join(lines) + "\n", f"square with waves of {amplitude_mm:g} mm")


def origin_of(x_mm: float, y_mm: float, z_mm: float, turn_deg: float) -> Pose:
    """A placement in SI."""
    return (m_from_mm(x_mm), m_from_mm(y_mm), m_from_mm(z_mm), 0.0, 0.0, rad_from_deg(turn_deg))


def run_case_study(model: StiffnessModel, step: float = defaults.STEP) -> CaseStudy:
    """Analyze the path in every region, over the heights, and its non-planar variants.

    Raises
    ------
    UnreachableError
        The machine cannot reach a region (the regions are those of the reference machine).

    Examples
    --------
    >>> from toolpath_stiff.machine import load_machine
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> study = run_case_study(build_model(load_machine("nist")), step=0.02)
    >>> [found["holds"] for found in study.summary["conclusions"]]
    [True, True, True]
    """
    program = case_study_program()
    regions = {name: analyze(model, program, origin=origin_of(*at), step=step) for name, at in REGIONS.items()}
    figures = {name: _figures(analysis) for name, analysis in regions.items()}
    heights = [
        {"z_mm": z, **_figures(analyze(model, program, origin=origin_of(150.0, 100.0, z, 0.0), step=step))}
        for z in HEIGHTS_MM
    ]
    waves = [_wave(model, amplitude, step) for amplitude in WAVES_MM]
    summary = {
        "program": PROGRAM,
        "machine": model.machine.name,
        "step_mm": round(mm_from_m(step), 6),
        **effects_stated(model),
        "warnings": condition_warnings(model),
        "note": "the paper does not print its path; path and regions are ours",
        "regions": [
            {"region": name, "x_mm": at[0], "y_mm": at[1], "z_mm": at[2], "rotation_deg": at[3], **figures[name]}
            for name, at in REGIONS.items()
        ],
        "conclusions": _conclusions(figures),
        "heights": heights,
        "limits_of_the_conclusions": _limits(heights),
        "non_planar": waves,
    }
    return CaseStudy(summary, regions)


def _figures(analysis: Analysis) -> dict[str, float]:
    found = stiffness_figures(analysis, analysis.headline)
    return {
        key: round(float(found[key]), DECIMALS)
        for key in ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm", "max_N_per_mm")
    }


def _conclusions(figures: dict[str, dict[str, float]]) -> list[dict[str, Any]]:
    """The paper's three statements, each with the numbers that decide it."""

    def rises(key: str) -> tuple[bool, str]:
        steps = [(figures[low][key], figures[high][key]) for low, high in PAIRS_IN_HEIGHT]
        words = "; ".join(
            f"region {low} to {high}: {a:.0f} to {b:.0f} N/mm"
            for (low, high), (a, b) in zip(PAIRS_IN_HEIGHT, steps, strict=True)
        )
        return all(b > a for a, b in steps), words

    mean_rises, mean_words = rises("mean_N_per_mm")
    range_rises, range_words = rises("range_N_per_mm")
    apart = [
        (abs(figures[b]["mean_N_per_mm"] / figures[a]["mean_N_per_mm"] - 1.0), figures[a], figures[b], f"{a} and {b}")
        for a, b in PAIRS_IN_PLANE
    ]
    same_words = "; ".join(
        f"regions {pair}: means apart by {100 * gap:.2f} %, ranges {one['range_N_per_mm']:.0f} and "
        f"{two['range_N_per_mm']:.0f} N/mm"
        for gap, one, two, pair in apart
    )
    return [
        {"statement": "the mean rises with z", "holds": mean_rises, "numbers": mean_words},
        {"statement": "the range rises with z", "holds": range_rises, "numbers": range_words},
        {
            "statement": "at one height means agree closely and ranges differ a little",
            "holds": all(
                gap < MEANS_AGREE and one["range_N_per_mm"] != two["range_N_per_mm"] for gap, one, two, _ in apart
            ),
            "numbers": same_words,
        },
    ]


def _limits(heights: list[dict[str, float]]) -> dict[str, float]:
    """At which heights mean and range of the square at (150, 100) mm stop rising."""
    mean = max(heights, key=lambda row: row["mean_N_per_mm"])
    widest = max(heights, key=lambda row: row["range_N_per_mm"])
    return {"largest_mean_at_z_mm": mean["z_mm"], "largest_range_at_z_mm": widest["z_mm"]}


def _wave(model: StiffnessModel, amplitude: float, step: float) -> dict[str, Any]:
    """The wavy square in the four regions, and whether its mean still does not depend on where it lies."""
    program = wavy_program(amplitude)
    figures = {
        name: _figures(analyze(model, program, origin=origin_of(*at), step=step)) for name, at in REGIONS.items()
    }
    return {
        "amplitude_mm": amplitude,
        "regions": [{"region": name, **row} for name, row in figures.items()],
        "means_apart_at_one_height_percent": [
            round(100 * abs(figures[b]["mean_N_per_mm"] / figures[a]["mean_N_per_mm"] - 1.0), DECIMALS)
            for a, b in PAIRS_IN_PLANE
        ],
    }


def region_rows(study: CaseStudy) -> str:
    """`case_study.csv`: a row a region, mean and range first as in the paper's Figure 10."""
    keys = (
        "region",
        "x_mm",
        "y_mm",
        "z_mm",
        "rotation_deg",
        "mean_N_per_mm",
        "range_N_per_mm",
        "min_N_per_mm",
        "max_N_per_mm",
    )
    return csv_text(keys, ([str(row[key]) for key in keys] for row in study.summary["regions"]))


def study_text(study: CaseStudy) -> str:
    """The case study in words and numbers, Markdown."""
    summary = study.summary
    lines = [
        f"# Case study on {machine_words(summary)}",
        "",
        *(line for text in summary["warnings"] for line in (f"Warning: {text}.", "")),
        f"One path ({summary['program']}, {summary['note']}) in four regions, as the paper's Figure 10: mean stiffness",
        "under a load along the motion, and in parentheses its range, N/mm.",
        "",
        "| region | program zero, mm | turned | mean (range), N/mm |",
        "| --- | --- | --- | --- |",
    ]
    for row in summary["regions"]:
        place = f"{row['x_mm']:g}, {row['y_mm']:g}, {row['z_mm']:g}"
        lines.append(
            f"| {row['region']} | {place} | {row['rotation_deg']:g} deg | "
            f"{row['mean_N_per_mm']:.0f} ({row['range_N_per_mm']:.0f}) |"
        )
    lines += ["", "## The paper's conclusions", ""]
    for number, found in enumerate(summary["conclusions"], 1):
        lines.append(f"{number}. {found['statement']}: {'yes' if found['holds'] else 'NO'}. {found['numbers']}.")
    limits = summary["limits_of_the_conclusions"]
    lines += [
        "",
        "## Where they stop holding",
        "",
        f"Moved up and down at (150, 100) mm, the same path has its largest mean at z = "
        f"{limits['largest_mean_at_z_mm']:g} mm and its largest range at z = {limits['largest_range_at_z_mm']:g} mm: "
        "beyond, both fall again.",
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
        ranges = ", ".join(f"{row['range_N_per_mm']:.0f}" for row in wave["regions"])
        lines.append(f"| {wave['amplitude_mm']:g} | {low:.2f} % | {high:.2f} % | {ranges} |")
    return "\n".join([*lines, ""])
