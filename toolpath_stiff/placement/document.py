"""What a placement hands to terminal, placement.json, page, set-up sheet: figures in the shop's units, and advice.

The advice is made here once and told alike everywhere; what got worse comes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from toolpath_stiff.analysis.loads import Load, plunging_rows
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.analysis.statistics import share, stiffness_figures
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.placement.climb import Bounds
from toolpath_stiff.placement.evaluator import Evaluator, PlacementFigures
from toolpath_stiff.placement.paths import WorkPath
from toolpath_stiff.placement.search import PlacementResult, SearchRules
from toolpath_stiff.rewriting.program import offset_blocks
from toolpath_stiff.stiffness.model import StiffnessModel, effects_stated
from toolpath_stiff.units import (
    Pose,
    deg_from_rad,
    m_from_mm,
    mm_from_m,
    n_per_mm_from_n_per_m,
    rad_from_deg,
    um_from_m,
)

PLACEMENT = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "rotation_deg")


# The three objectives and where their values stand.
FIGURES = {"mean": "mean_N_per_mm", "range": "range_N_per_mm", "weakest": "min_N_per_mm"}


COLUMNS = (
    "number",
    *PLACEMENT,
    *FIGURES.values(),
    "mean_deflection_um",
    "plunge_mean_N_per_mm",
    "plunge_min_N_per_mm",
    "extrapolated_share",
    "margin",
    "rapid_margin",
)


SIGNS = {"mean": 1.0, "range": -1.0, "weakest": 1.0}  # more is better; less is better


ROUNDING = 1e-9  # of the mean: two evaluations of one placement differ by less


USUAL_CHORD_MM = 0.01  # tried where a program cannot be written without chords


AT_BOUND = 1e-3  # of a bound's span: this near the search has ended on it


NAMES = ("x", "y", "z", "tilt-a", "tilt-b", "rotate")


def pose_of(placement: FloatArray) -> Pose:
    """A placement as a tuple."""
    x, y, z, a, b, c = (float(v) for v in placement)
    return (x, y, z, a, b, c)


def placement_row(placement: FloatArray) -> dict[str, float]:
    """The numbers of a placement in mm and degrees; the rotation within 0 to 360."""
    x, y, z, a, b, c = pose_of(placement)
    return {
        "x_mm": mm_from_m(x),
        "y_mm": mm_from_m(y),
        "z_mm": mm_from_m(z),
        "a_deg": deg_from_rad(a),
        "b_deg": deg_from_rad(b),
        "rotation_deg": deg_from_rad(c) % 360.0,
    }


def placement_of(row: dict[str, Any]) -> FloatArray:
    """(6,) m and rad of a row in mm and degrees."""
    values = np.array([row[key] for key in PLACEMENT], dtype=float)
    return np.concatenate([m_from_mm(values[:3]), rad_from_deg(values[3:])])


def front_rows(
    model: StiffnessModel, path: WorkPath, load: Load, found: PlacementResult, force: float
) -> list[dict[str, Any]]:
    """Rows of `placements.csv`, numbered from 1 by rising mean; deflections under `force` in N."""
    plunges = _plunge_figures(model, path, load, found.front, force)
    rows = []
    for i, placement in enumerate(found.front):
        figures = found.figures.take(slice(i, i + 1))
        values = (figures.mean[0], figures.spread[0], figures.lowest[0])
        beside = (None, None) if plunges is None else (plunges.mean[i], plunges.lowest[i])
        mean, lowest = (None if v is None or np.isnan(v) else n_per_mm_from_n_per_m(float(v)) for v in beside)
        rows.append(
            {
                "number": i + 1,
                **placement_row(placement),
                **{k: n_per_mm_from_n_per_m(float(v)) for k, v in zip(FIGURES.values(), values, strict=True)},
                "mean_deflection_um": um_from_m(force * float(figures.compliance[0])),
                "plunge_mean_N_per_mm": mean,
                "plunge_min_N_per_mm": lowest,
                "extrapolated_share": float(figures.extrapolated[0]),
                "margin": _finite(figures.margin[0]),
                "rapid_margin": _finite(figures.rapid_margin[0]),
            }
        )
    return rows


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _plunge_figures(
    model: StiffnessModel, path: WorkPath, load: Load, front: FloatArray, force: float
) -> PlacementFigures | None:
    """Figures of the plunges alone at each placement of the front; None where they are no class of their own."""
    beside = plunging_rows(load, path.tangent, path.abc, path.cutting & (path.weight > 0.0)) & ~path.headline
    return Evaluator(model, path.alone(beside), load, force).figures(front) if beside.any() else None


def figures_of(analysis: Analysis) -> dict[str, Any]:
    """Placement and figures of one analysis: the headline's, and the plunges' beside."""
    found, beside = (stiffness_figures(analysis, rows) for rows in (analysis.headline, analysis.set_aside))
    return {
        **placement_row(np.array(analysis.origin)),
        **{key: found[key] for key in (*FIGURES.values(), "mean_deflection_um")},
        "plunge_mean_N_per_mm": beside["mean_N_per_mm"],
        "plunge_min_N_per_mm": beside["min_N_per_mm"],
        "extrapolated_share": share(analysis.at.extrapolated, analysis.samples.cutting),
    }


def placement_summary(
    program: Program,
    best: Analysis,
    front: list[dict[str, Any]],
    search: dict[str, Any],
    chosen: dict[str, Any],
    before: dict[str, Any] | None,
    reason: str,
    worse: list[dict[str, Any]],
    written: dict[str, Any] | None,
    warnings: list[str],
) -> dict[str, Any]:
    """The figures of `placement.json`."""
    return {
        "warnings": warnings,
        "worse": worse,
        "program": program.name,
        "machine": best.machine.name,
        **effects_stated(best.model),
        "load": str(best.load),
        "force_N": best.force,
        "objective": search["options"]["--objective"],
        "chosen": chosen,
        "picked": chosen["number"] != search["recommended"],
        "recommended": front[search["recommended"] - 1],
        "before": before,
        "before_reason": reason or None,
        "trade_offs": _costs(front, chosen),
        "front": front,
        "binding_limits": _binding_limits(best),
        "offset_blocks": _offsets(program, best.origin),
        "written": written,
        "search": search,
        "assumptions": best.assumptions,
    }


def _costs(front: list[dict[str, Any]], chosen: dict[str, Any]) -> dict[str, dict[str, float]]:
    """What the choice costs in each objective: the best on the front beside it."""
    return {
        name: {
            "chosen_N_per_mm": chosen[key],
            "best_on_front_N_per_mm": (min if name == "range" else max)(row[key] for row in front),
        }
        for name, key in FIGURES.items()
    }


def _binding_limits(best: Analysis) -> list[dict[str, Any]]:
    """The limits that the cuts come nearest to, at most three."""
    near = np.argsort(best.at.margin + np.where(best.samples.cutting, 0.0, np.inf), kind="stable")[:200]
    names = list(dict.fromkeys(best.at.limits[int(best.at.limit[i])].name for i in near))[:3]
    smallest = float(best.at.margin[best.samples.cutting].min())
    return [{"limit": name, **({"smallest_margin": smallest} if i == 0 else {})} for i, name in enumerate(names)]


def _offsets(program: Program, placement: Pose) -> dict[str, str | None]:
    blocks = offset_blocks(program, placement)
    return {
        "linuxcnc": blocks.linuxcnc or None,
        "linuxcnc_reason": blocks.linuxcnc_reason or None,
        "fanuc": blocks.fanuc or None,
        "fanuc_reason": blocks.fanuc_reason or None,
    }


def worsened(chosen: dict[str, Any], before: dict[str, Any] | None) -> list[dict[str, Any]]:
    """What is worse at the chosen placement than at the present one: name, both values, by how much, N/mm."""
    if before is None:
        return []
    found = []
    for name, key in FIGURES.items():
        worse_by = SIGNS[name] * (before[key] - chosen[key])
        if worse_by > ROUNDING * before["mean_N_per_mm"]:
            values = {"chosen_N_per_mm": chosen[key], "before_N_per_mm": before[key], "worse_by_N_per_mm": worse_by}
            found.append({"figure": name, **values})
    return found


def placement_warnings(
    bounds: Bounds,
    rules: SearchRules,
    search: dict[str, Any],
    chosen: dict[str, Any],
    before: dict[str, Any] | None,
    reason: str,
    worse: list[dict[str, Any]],
    present: PlacementFigures,
    best: Analysis,
) -> list[str]:
    """Plain sentences, the gravest first.

    Parameters
    ----------
    bounds, rules, search
        What was asked; the search as `placement.json` has it.
    chosen, before, reason
        Figures at the chosen and at the present placement (None where out of reach, then `reason`).
    worse
        From `worsened`.
    present
        The present placement's margins.
    best
        The analysis at the chosen placement.
    """
    picked = chosen["number"] != search["recommended"]
    found = [nothing_better_words(search)] if search.get("nothing_better") else []
    found += [_worse_words(one, picked) for one in worse]
    if worse and not picked:
        found.append("no placement was found within the bounds that is as good as the present one in all three")
    if before is None:
        found.append(
            f"the present placement is out of reach, so nothing says what must not get worse: {reason or 'no figures'}"
        )
    found += [
        f"line {rapid['line']}: no placement within the bounds keeps this rapid within reach ({rapid['reason']}); it "
        "does not follow the work, and was left out of the search"
        for rapid in search["rapids_left_out"]
    ]
    found += _present_words(rules, present) if before is not None else []
    found += _extrapolation_words(chosen, before)
    found += bound_warnings(bounds, placement_of(chosen), best.machine.limits.workspace)
    if best.plunging[best.counted].all():
        found.append("the program only plunges along the tool axis: mean, range and weakest are those of plunges")
    return list(dict.fromkeys([*found, *best.warnings]))


def nothing_better_words(search: dict[str, Any]) -> str:
    """That the front is the present placement alone, and how hard another was looked for."""
    return (
        f"nothing better than the present placement was found within the bounds, in {search['searches']} searches from "
        f"the beginning, {search['pose_evaluations']} poses evaluated"
    )


def _worse_words(one: dict[str, Any], picked: bool) -> str:
    which = "picked" if picked else "recommended"
    what = {"mean": "the mean is lower", "range": "the range is wider", "weakest": "the weakest place is softer"}
    share = 100.0 * one["worse_by_N_per_mm"] / max(abs(one["before_N_per_mm"]), 1e-12)
    chosen, before = (f"{one[key]:,.0f}".replace(",", " ") for key in ("chosen_N_per_mm", "before_N_per_mm"))
    return (
        f"WORSE: at the {which} placement {what[one['figure']]} than at the present one, "
        f"{chosen} instead of {before} N/mm ({share:.1f} % worse)"
    )


def _present_words(rules: SearchRules, present: PlacementFigures) -> list[str]:
    """What the present placement itself does not keep."""
    asked, found = rules.margin, []
    if present.rapid_margin[0] < 0.0:
        found.append("at the present placement a rapid is out of reach")
    least = float(min(present.margin[0], present.rapid_margin[0]))
    if 0.0 <= least < asked:
        found.append(
            f"the present placement has a margin of {100.0 * least:.2f} % of a limit's span, less than the "
            f"{100.0 * asked:g} % asked for with {both_names('--margin')}"
        )
    if present.clearance[0] < 0.0:
        found.append(
            f"the present placement runs {mm_from_m(-float(present.clearance[0])):.1f} mm deep into a keep-out"
        )
    return found


def _extrapolation_words(chosen: dict[str, Any], before: dict[str, Any] | None) -> list[str]:
    if not chosen["extrapolated_share"]:
        return []
    now = "" if before is None else f" (at present at {100.0 * before['extrapolated_share']:.0f} %)"
    return [
        f"the strut law is extrapolated at {100.0 * chosen['extrapolated_share']:.0f} % of the samples{now}: outside "
        "the lengths that it was measured at"
    ]


def bound_warnings(bounds: Bounds, placement: np.ndarray, workspace: np.ndarray) -> list[str]:
    """Which bounds of the search a placement (6,) lies on, with the options that widen them by half."""
    found = []
    for i in bounds.free:
        if bounds.round[i] or (i == 2 and bounds.heights):
            continue
        low, high = float(bounds.low[i]), float(bounds.high[i])
        # The file's rotation is within 0 to 360 degrees, the bounds may lie elsewhere.
        value = low + float(np.mod(placement[i] - low + 1e-9, 2.0 * np.pi)) - 1e-9 if i == 5 else float(placement[i])
        span = high - low
        ends = [(value - low, low, -1), (high - value, high, 1)]
        for room, end, side in ends:
            if room > AT_BOUND * span or (i < 3 and _at_workspace(end, side, workspace[:, i])):
                continue
            wider = [low - 0.5 * span, high] if side < 0 else [low, high + 0.5 * span]
            if i < 3:
                wider = [max(wider[0], float(workspace[0, i])), min(wider[1], float(workspace[1, i]))]
            unit, shown = ("mm", mm_from_m) if i < 3 else ("degrees", deg_from_rad)
            found.append(
                f"the search ended on its own bound of {NAMES[i]}, {round(shown(end), 3):g} {unit}: widen it with "
                f"--{NAMES[i]}={round(shown(wider[0]), 3):g}:{round(shown(wider[1]), 3):g}"
            )
    if len(bounds.heights) > 1:
        for end, which in ((min(bounds.heights), "lowest"), (max(bounds.heights), "highest")):
            if abs(placement[2] - end) < 1e-9:
                found.append(
                    f"the search took the {which} height, {mm_from_m(end):g} mm, of {both_names('--z-values')}: "
                    "try one beyond it"
                )
    return found


def _at_workspace(end: float, side: int, workspace: np.ndarray) -> bool:
    """Whether an end of the search (m) is the machine's own, and so cannot be widened."""
    limit = float(workspace[0] if side < 0 else workspace[1])
    return bool(np.isfinite(limit) and (limit - end) * side <= 1e-9)
