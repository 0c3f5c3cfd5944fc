"""`summary.json`: the figures of an analysis in the shop's units, what was assumed, what two machines differ in."""

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.statistics import (
    FIGURES,
    EvaluatedPath,
    describe_sample,
    path_length,
    per_operation,
    per_tool,
    share,
)
from toolpath_stiff.analysis.uncertainty import band_figures
from toolpath_stiff.documents import Document, to_dict
from toolpath_stiff.nc.moves import CUTTER_LOCATION, ReadProgram
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.stiffness.model import acting_effects, conditions_stated, effects_stated
from toolpath_stiff.units import mm_from_m, mm_per_min_from_m_per_s, n_per_mm_from_n_per_m


def assumptions(analysis: EvaluatedPath) -> list[str]:
    """Everything that was assumed or recovered rather than published or given; plain sentences."""
    machine, model, law = analysis.machine, analysis.model, analysis.machine.strut_law
    sentences = list(analysis.program.assumptions)
    if words_turn_the_platform(analysis.program):
        sentences.append(
            "A, B, C of the program are roll, pitch, yaw of the platform (see [kinematics] of controller files)"
        )
    if analysis.origin_source == "default":
        words = [f"{axis}{value:g}" for axis, value in zip("XYZABC", pose_in_mm(analysis.origin), strict=True)]
        where = " ".join(words if any(analysis.origin[3:]) else words[:3])
        sentences.append(
            f"program zero (G54) sits at {where} in machine coordinates, the machine's default; "
            "--origin puts it elsewhere"
        )
    for quantity, origin in machine.origins.items():
        if origin != "published":
            remark = machine.remarks.get(quantity)
            sentences.append(f"machine {machine.name}: {quantity} {origin}" + (f": {remark}" if remark else ""))
    secant = "; the stiffness is the secant one at this load" if model.load_dependent else ""
    sentences += [
        f"rapid moves take {mm_per_min_from_m_per_s(machine.rapid_feed):g} mm/min (time only)",
        *conditions_stated(model),
        f"a force of {analysis.force:g} N for deflections{secant}",
    ]
    low, high = sorted((mm_from_m(law.length_1), mm_from_m(law.length_2)))
    range_of_law = f"the strut law is extrapolated outside {low:.1f} to {high:.1f} mm of strut length"
    sentences.append("the stiffness of a strut is the same at every length" if law.constant else range_of_law)
    if analysis.parameter_band is not None:
        sentences.append(
            "the band of the stiffness holds the uncertainty of the fitted parameters alone, propagated linearly: "
            f"{', '.join(analysis.parameter_band.names)}"
        )
    if not acting_effects(model):
        sentences.append("platform, frame, joints, spindle, tool and table are rigid: the struts alone give way")
    return sentences


def summarise(analysis: EvaluatedPath) -> Document:
    """The figures of `summary.json`, in the shop's units."""
    samples, program, there, band = analysis.samples, analysis.program, analysis.at, analysis.parameter_band
    cutting, headline = samples.cutting & there.reachable, analysis.headline
    nearest = int(np.argmin(np.where(cutting, there.reach.margin, np.inf)))
    return {
        "program": program.name,
        "interpreter": program.interpreter,
        "kinematics": program.kinematics,
        "machine": analysis.machine.name,
        "load": str(analysis.load),
        "force_N": analysis.force,
        "step_mm": mm_from_m(analysis.step),
        "origin_mm_deg": list(pose_in_mm(analysis.origin)),
        "origin_source": analysis.origin_source,
        "samples": len(samples),
        "cutting_length_mm": mm_from_m(path_length(samples, rapid=False)),
        "rapid_length_mm": mm_from_m(path_length(samples, rapid=True)),
        "time_s": float(samples.t[-1]),
        **analysis.figures,
        **({} if band is None else {"parameter_uncertainty": band_figures(band, samples, there.stiffness, headline)}),
        "weakest_places": [describe_sample(analysis, row) for row in analysis.weakest_rows],
        "per_tool": per_tool(analysis),
        "per_operation": per_operation(analysis),
        "min_margin": float(there.reach.margin[nearest]),
        "min_margin_limit": there.reach.describe(nearest),
        "min_margin_line": int(samples.line[nearest]),
        "out_of_reach_samples": int(analysis.out_of_reach.sum()),
        "extrapolated_share": share(there.extrapolated, cutting),
        **effects_stated(analysis.model),
        "unsupported": to_dict(program.unsupported),
        "assumptions": assumptions(analysis),
        "warnings": analysis.warnings,
        "version": defaults.VERSION,
    }


def compare_summaries(summary: Document, other: Document) -> Document:
    """The entry `compare` of `summary.json`.

    The other machine's figures, and `difference_percent`: how much higher each is than the first machine's
    (None where a figure is missing, or the first machine's is zero); the same for the mean of the plunges.
    """
    names = {name: name.partition("_N_per")[0].removesuffix("_um") for name in FIGURES}
    plunges = [(figures["plunges"] or {}).get("mean_N_per_mm") for figures in (summary, other)]
    return {
        "machine": other["machine"],
        "effects": list(other["effects"]),
        **{name: other[name] for name in (*FIGURES, "weakest", "out_of_reach_samples", "extrapolated_share")},
        "difference_percent": {short: _higher(summary[name], other[name]) for name, short in names.items()},
        "headline": other["headline"],
        "plunges": other["plunges"],
        "plunges_difference_percent": _higher(*plunges),
    }


def _higher(first: float | None, second: float | None) -> float | None:
    """By how much the second is higher, in percent of the first; None where that cannot be said."""
    return None if first is None or second is None or not first else (second - first) / first * 100.0


def words_turn_the_platform(program: ReadProgram) -> bool:
    """Whether rotary words were taken for the platform's own angles."""
    native = not program.kinematics and program.dialect != CUTTER_LOCATION
    return native and bool(program.moves.start[:, 3:].any() or program.moves.end[:, 3:].any())


def required_stiffness_missed(analysis: EvaluatedPath, required: float) -> list[tuple[int, float]]:
    """(line, smallest stiffness in N/mm) of cutting moves that are not known to have `required` N/m, weakest first.

    What has no stiffness does not have the required one: nan, before all others, for lines that are out of reach in
    part (`partial`), and for all cutting lines where no sample counts at all.
    """
    samples, counted = analysis.samples, analysis.counted
    cuts = samples.cutting & ((samples.weight > 0.0) | (not counted.any()))
    stiffness = np.where(counted, analysis.at.stiffness, np.nan)[cuts]
    lines, index = np.unique(samples.line[cuts], return_inverse=True)
    lowest = np.full(len(lines), np.inf)
    with np.errstate(invalid="ignore"):
        np.minimum.at(lowest, index, stiffness)
    missed = np.flatnonzero(~(lowest >= required))
    order = missed[np.argsort(np.nan_to_num(lowest[missed], nan=-np.inf), kind="stable")]
    return [(int(lines[i]), n_per_mm_from_n_per_m(float(lowest[i]))) for i in order]
