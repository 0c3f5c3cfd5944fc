"""Text of a plan, and its files."""

from toolpath_stiff.planning.plan import RivalPlan
from toolpath_stiff.planning.result import Plan, plan_csv


def text(plan: Plan) -> str:
    """Visits in measuring order, then the expected outcome; the outcome first if there is nothing to gain."""
    promise, between = plan.choice.sentences, isinstance(plan.choice, RivalPlan)
    lines = [promise.pop(0), ""] if isinstance(plan.choice, RivalPlan) and not plan.choice.gains else []
    lines += [
        f"{'':>4} {'x':>7} {'y':>7} {'z':>7} mm {'a':>6} {'b':>6} deg {'tool':>5} mm  load N     set-up, directions"
    ]
    for visit in plan.visits:
        loads = "/".join(f"{force:g}" for force in visit["forces_N"])
        where = ", ".join([*([visit["setup"]] if visit["setup"] else []), " ".join(visit["directions"])])
        lines.append(
            f"{visit['clamp']:>4} {visit['x_mm']:>7.1f} {visit['y_mm']:>7.1f} {visit['z_mm']:>7.1f}    "
            f"{visit['a_deg']:>6.1f} {visit['b_deg']:>6.1f}     {visit['tool_extension_mm']:>5g}     {loads:<10} "
            f"{where}"
        )
        if between:
            lines.append(f"{'':>5}{visit['why']}")
    return "\n".join([*lines, "", *promise, *(f"note: {note}" for note in plan.choice.notes)])


DATA = {"plan.csv": lambda plan: plan_csv(plan.rows), "plan.json": Plan.to_json}
