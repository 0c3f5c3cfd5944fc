"""`summary.json`: the figures of an analysis in the shop's units, what was assumed, what two machines differ in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.loads import RULES
from toolpath_stiff.analysis.statistics import (
    FIGURES,
    EvaluatedPath,
    band_figures,
    describe_sample,
    path_length,
    per_operation,
    per_tool,
    share,
)
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.moves import CUTTER_LOCATION, ReadProgram
from toolpath_stiff.stiffness.model import acting_effects, conditions_stated, effects_stated
from toolpath_stiff.units import deg_from_rad, mm_from_m, mm_per_min_from_m_per_s, n_per_mm_from_n_per_m


def assumptions(analysis: EvaluatedPath) -> list[str]:
    """Everything that was assumed or recovered rather than published or given; plain sentences."""
    machine = analysis.machine
    found = list(analysis.program.assumptions)
    if words_turn_the_platform(analysis.program):
        found.append(
            "A, B, C of the program are roll, pitch, yaw of the platform (see [kinematics] of controller files)"
        )
    x, y, z, *angles = analysis.origin
    where = f"X{mm_from_m(x):g} Y{mm_from_m(y):g} Z{mm_from_m(z):g}" + (
        " A{:g} B{:g} C{:g}".format(*(deg_from_rad(v) for v in angles)) if any(angles) else ""
    )
    if analysis.origin_source == "default":
        found.append(
            f"program zero (G54) sits at {where} in machine coordinates, the machine's default; "
            f"{both_names('--origin')} puts it elsewhere"
        )
    for quantity, origin in machine.origins.items():
        if origin != "published":
            remark = machine.remarks.get(quantity)
            found.append(f"machine {machine.name}: {quantity} {origin}" + (f": {remark}" if remark else ""))
    feed = mm_per_min_from_m_per_s(machine.rapid_feed)
    found.append(f"rapid moves take {feed:g} mm/min (time only)")
    found.append(f"load {analysis.load}: {RULES[analysis.load.kind]}")
    found += conditions_stated(analysis.model)
    acting = acting_effects(analysis.model)
    load_dependent = any(active.effect.load_dependent for active in acting)
    secant = "; the stiffness is the secant one at this load" if load_dependent else ""
    found.append(f"a force of {analysis.force:g} N for deflections{secant}")
    law = machine.strut_law
    found.append(
        "the stiffness of a strut is the same at every length"
        if law.constant
        else f"the strut law is extrapolated outside {mm_from_m(min(law.length_1, law.length_2)):.1f} to "
        f"{mm_from_m(max(law.length_1, law.length_2)):.1f} mm of strut length"
    )
    if analysis.parameter_band is not None:
        found.append(
            "the band of the stiffness holds the uncertainty of the fitted parameters alone, propagated linearly: "
            f"{', '.join(analysis.parameter_band.names)}"
        )
    if not acting:
        found.append("platform, frame, joints, spindle, tool and table are rigid: the struts alone give way")
    return found


def summarise(analysis: EvaluatedPath) -> dict[str, Any]:
    """The figures of `summary.json`, in the shop's units."""
    samples = analysis.samples
    places = analysis.weakest_rows
    cutting = samples.cutting & analysis.at.reachable
    x, y, z, a, b, c = analysis.origin
    nearest = int(np.argmin(np.where(cutting, analysis.at.margin, np.inf)))
    band = None if analysis.parameter_band is None else band_figures(analysis, analysis.parameter_band)
    return {
        "program": analysis.program.name,
        "interpreter": analysis.program.interpreter,
        "kinematics": analysis.program.kinematics,
        "machine": analysis.machine.name,
        "load": str(analysis.load),
        "force_N": analysis.force,
        "step_mm": mm_from_m(analysis.step),
        "origin_mm_deg": [mm_from_m(x), mm_from_m(y), mm_from_m(z), *(deg_from_rad(v) for v in (a, b, c))],
        "origin_source": analysis.origin_source,
        "samples": len(samples),
        "cutting_length_mm": mm_from_m(path_length(samples, rapid=False)),
        "rapid_length_mm": mm_from_m(path_length(samples, rapid=True)),
        "time_s": float(samples.t[-1]) if len(samples) else 0.0,
        **analysis.figures,
        **({} if band is None else {"parameter_uncertainty": band}),
        "weakest_places": [describe_sample(analysis, row) for row in places],
        "per_tool": per_tool(analysis),
        "per_operation": per_operation(analysis),
        "min_margin": float(analysis.at.margin[nearest]),
        "min_margin_limit": analysis.at.reach.describe(nearest),
        "min_margin_line": int(samples.line[nearest]),
        "out_of_reach_samples": int(analysis.out_of_reach.sum()),
        "extrapolated_share": share(analysis.at.extrapolated, cutting),
        **effects_stated(analysis.model),
        "unsupported": [
            {"line": u.line, "column": u.column, "word": u.word, "reason": u.reason}
            for u in analysis.program.unsupported
        ],
        "assumptions": assumptions(analysis),
        "warnings": analysis.warnings,
        "version": defaults.VERSION,
    }


def idle_on(other: Mapping[str, Any]) -> list[str]:
    """Effects of the other machine that wait for something: without them the two machines may look the same."""
    return [
        f"{both_names('--compare', other['machine'])}: {idle['effect']} does not act: {idle['reason']}"
        for idle in other["effects_idle"]
    ]


def compare_summaries(summary: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """The entry `compare` of `summary.json`.

    The other machine's figures, and `difference_percent`: how much higher each is than the first machine's
    (None where a figure is missing, or the first machine's is zero); the same for the mean of the plunges.
    """
    difference = {
        name.partition("_N_per")[0].removesuffix("_um"): _higher(summary.get(name), other.get(name)) for name in FIGURES
    }
    plunges = [(one.get("plunges") or {}).get("mean_N_per_mm") for one in (summary, other)]
    return {
        "machine": other["machine"],
        "effects": list(other.get("effects") or ()),
        **{name: other.get(name) for name in FIGURES},
        "weakest": other.get("weakest"),
        "out_of_reach_samples": other.get("out_of_reach_samples"),
        "extrapolated_share": other.get("extrapolated_share"),
        "difference_percent": difference,
        "headline": other.get("headline"),
        "plunges": other.get("plunges"),
        "plunges_difference_percent": _higher(*plunges),
    }


def _higher(first: float | None, second: float | None) -> float | None:
    """By how much the second is higher, in percent of the first; None where that cannot be said."""
    return None if first is None or second is None or not first else (second - first) / first * 100.0


def words_turn_the_platform(program: ReadProgram) -> bool:
    """Whether rotary words were taken for the platform's own angles."""
    own = not program.kinematics and program.dialect != CUTTER_LOCATION
    return own and bool(program.moves.start[:, 3:].any() or program.moves.end[:, 3:].any())


def required_stiffness_missed(analysis: EvaluatedPath, required: float) -> list[tuple[int, float]]:
    """(line, smallest stiffness in N/mm) of cutting moves that are not known to have `required` N/m, weakest first.

    What has no stiffness does not have the required one: nan, before all others, for lines that are out of reach in
    part (`partial`), and for all cutting lines where no sample counts at all.
    """
    samples, counted = analysis.samples, analysis.counted
    asked = samples.cutting & ((samples.weight > 0.0) | (not counted.any()))
    stiffness = np.where(counted, analysis.at.stiffness, np.nan)[asked]
    lines, index = np.unique(samples.line[asked], return_inverse=True)
    lowest = np.full(len(lines), np.inf)
    with np.errstate(invalid="ignore"):
        np.minimum.at(lowest, index, stiffness)
    missed = np.flatnonzero(~(lowest >= required))
    order = missed[np.argsort(np.nan_to_num(lowest[missed], nan=-np.inf), kind="stable")]
    return [(int(lines[i]), n_per_mm_from_n_per_m(float(lowest[i]))) for i in order]
