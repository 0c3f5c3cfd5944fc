"""What has to be said about a placement: made here once, told alike in terminal, placement.json, page and set-up sheet.

What got worse comes first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.analysis import Analysis
from toolpath_stiff.placement.batch import PlacementFigures
from toolpath_stiff.placement.climb import Bounds
from toolpath_stiff.placement.report_data import FIGURES, placement_of
from toolpath_stiff.units import deg_from_rad, mm_from_m

if TYPE_CHECKING:
    from toolpath_stiff.placement.placing import Task

SIGNS = {"mean": 1.0, "range": -1.0, "weakest": 1.0}  # more is better; less is better
ROUNDING = 1e-9  # of the mean: two evaluations of one placement differ by less
AT_BOUND = 1e-3  # of a bound's span: this near the search has ended on it
NAMES = ("x", "y", "z", "tilt-a", "tilt-b", "rotate")


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
    task: Task,
    search: dict[str, Any],
    chosen: dict[str, Any],
    before: dict[str, Any] | None,
    reason: str,
    worse: list[dict[str, Any]],
    present: PlacementFigures,
    best: Analysis,
) -> list[str]:
    """Sentences for people, the gravest first.

    Parameters
    ----------
    task, search
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
    found = [_worse_words(one, picked) for one in worse]
    if worse and not picked:
        found.append("no placement was found within the bounds that is as good as the present one in all three")
    if before is None:
        found.append(
            f"the present placement is out of reach, so nothing says what must not get worse: {reason or 'no figures'}"
        )
    found += [
        f"line {rapid['line']}: no placement within the bounds keeps this rapid within reach ({rapid['reason']}); it "
        "does not follow the work, and was left out of the search"
        for rapid in search["unmended_rapids"]
    ]
    found += _present_words(task, present) if before is not None else []
    found += _extrapolation_words(chosen, before)
    found += bound_warnings(task.bounds, placement_of(chosen), task.model.machine.limits.workspace)
    if best.plunging[best.counted].all():
        found.append("the program only plunges along the tool axis: mean, range and weakest are those of plunges")
    return list(dict.fromkeys([*found, *best.warnings]))


def _worse_words(one: dict[str, Any], picked: bool) -> str:
    which = "picked" if picked else "recommended"
    what = {"mean": "the mean is lower", "range": "the range is wider", "weakest": "the weakest place is softer"}
    share = 100.0 * one["worse_by_N_per_mm"] / max(abs(one["before_N_per_mm"]), 1e-12)
    return (
        f"WORSE: at the {which} placement {what[one['figure']]} than at the present one, "
        f"{one['chosen_N_per_mm']:.0f} instead of {one['before_N_per_mm']:.0f} N/mm ({share:.1f} % worse)"
    )


def _present_words(task: Task, present: PlacementFigures) -> list[str]:
    """What the present placement itself does not keep."""
    asked, found = task.rules.margin, []
    if present.rapid_margin[0] < 0.0:
        found.append("at the present placement a rapid is out of reach")
    least = float(min(present.margin[0], present.rapid_margin[0]))
    if 0.0 <= least < asked:
        found.append(
            f"the present placement has a margin of {100.0 * least:.2f} % of a limit's span, less than the "
            f"{100.0 * asked:g} % asked for (--margin)"
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
                found.append(f"the search took the {which} of --z-values, {mm_from_m(end):g} mm: try one beyond it")
    return found


def _at_workspace(end: float, side: int, workspace: np.ndarray) -> bool:
    """Whether an end of the search (m) is the machine's own, and so cannot be widened."""
    limit = float(workspace[0] if side < 0 else workspace[1])
    return bool(np.isfinite(limit) and (limit - end) * side <= 1e-9)
