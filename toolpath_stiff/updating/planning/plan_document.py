"""A plan in figures and sentences."""

from __future__ import annotations

from typing import Any

from toolpath_stiff.updating.planning.plan import MOST_REPEATS, Plan
from toolpath_stiff.updating.planning.plan_rivals import SETTLED


def plan_document(plan: Plan) -> dict[str, Any]:
    """The plan as the content of plan.json."""
    return {
        "rivals": [{"name": rival.name, "probability": rival.weight} for rival in plan.rivals],
        "poses": len(plan.chosen),
        "readings": int(plan.visits.counts[list(plan.chosen)].sum()),
        "minutes": plan.minutes,
        "expected": {
            "probability_of_truth_before": plan.before.truth,
            "probability_of_truth_after": plan.after.truth,
            "settled_before": plan.before.settled,
            "settled_after": plan.after.settled,
            "settled_at": SETTLED,
            "poses_to_settle": plan.enough,
            "repeats_to_settle": plan.repeats,
        },
        "pairs": [
            {
                "effects": [pair.first, pair.second],
                "gap_sigma": pair.gap,
                "best_single_pose_sigma": pair.best_visit_gap,
                "separable": pair.separable,
                "indicator_across": pair.indicators,
            }
            for pair in plan.pairs
        ],
        "text": plan_text(plan),
        "notes": list(plan.notes),
    }


def _percent(share: float) -> str:
    """Never "100 %" for what is only expected."""
    return "more than 99 %" if share > 0.99 else f"{100 * share:.0f} %"


def plan_text(plan: Plan) -> list[str]:
    """What the plan promises, in sentences."""
    count = len(plan.chosen)
    lines = [
        f"{count} pose{'s' if count > 1 else ''}, about {plan.minutes:.0f} minutes: the probability of the right "
        f"explanation is expected to rise from {_percent(plan.before.truth)} to {_percent(plan.after.truth)}, "
        f"and the verdict to be settled in {_percent(plan.after.settled)} of cases"
    ]
    if plan.enough is not None and plan.enough < count:
        lines.append(f"{plan.enough} of the poses should do for {100 * SETTLED:.0f} %; the others are in reserve")
    elif plan.repeats is None:
        lines.append(f"{100 * SETTLED:.0f} % is not expected from repeats of these poses, up to {MOST_REPEATS} of them")
    elif plan.repeats > 1:
        lines.append(f"{100 * SETTLED:.0f} % is expected after {plan.repeats} repeats of each, clamped anew")
    for pair in plan.pairs:
        if not pair.separable:
            lines.append(
                f"tip stiffness cannot tell {pair.first} from {pair.second} ({pair.gap:.1f} sigma after all poses); "
                f"put an indicator across the link: "
                + "; or ".join(f"{link}: {place}" for link, place in pair.indicators.items())
            )
    return lines
