"""The next visit of a plan in figures and sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict, cast

from toolpath_stiff.planning.document import RivalEntry, plan_rows
from toolpath_stiff.planning.gaps import SETTLED, further_minutes
from toolpath_stiff.units import certain

if TYPE_CHECKING:
    from toolpath_stiff.planning.next_visit import NextVisit


class NextDocument(TypedDict):
    """What `tps plan --next` says; `rows` as of plan.csv."""

    rivals: list[RivalEntry]
    readings: int
    settled: bool
    minutes: float | None
    why: str
    rows: list[dict[str, Any]]
    text: list[str]
    notes: list[str]


def next_document(found: NextVisit) -> NextDocument:
    """Probabilities, the visit, its rows."""
    visits, rows, minutes = found.tables.visits, list[dict[str, Any]](), None
    if found.visit is not None:
        been = len(set(found.taken.clamp.tolist()))
        rows = plan_rows(visits, [found.visit])
        for row in rows:
            row["clamp"] = been + 1
            row["point"] = str(visits.label[found.visit]) or f"next {been + 1}"
        minutes = float(further_minutes(visits, (), found.tables.costs, found.tables.menu)[found.visit])
    written = {
        "rivals": [{"name": name, "probability": weight} for name, weight in found.probability.items()],
        "readings": len(found.taken.rows),
        "settled": found.settled,
        "minutes": minutes,
        "why": found.why,
        "text": _text(found, rows),
        "notes": list(found.notes),
    }
    return cast(NextDocument, {**certain(written), "rows": rows})


def _text(found: NextVisit, rows: list[dict[str, Any]]) -> list[str]:
    chances = ", ".join(f"{name} {_percent(weight)}" for name, weight in found.probability.items())
    lines = [f"after {len(found.taken.rows)} readings of this plan: {chances}"]
    if found.unlike:
        return [*lines, "too many readings are far off under each of these: ask tps diagnose what else it could be"]
    if found.settled:
        return [*lines, f"settled: one explanation has {100 * SETTLED:.0f} % or more; confirm it with tps diagnose"]
    if not rows:
        return [*lines, "nothing is left to go to that would tell them apart; ask tps diagnose"]
    first = rows[0]
    tool = first["tool_extension_mm"]
    lines.append(
        f"next: X{first['x_mm']:g} Y{first['y_mm']:g} Z{first['z_mm']:g} mm, A{first['a_deg']:g} B{first['b_deg']:g} "
        f"C{first['c_deg']:g} deg" + (f", tool {tool:g} mm longer" if tool else "")
    )
    return [*lines, f"  {found.why}"]


def _percent(share: float) -> str:
    """Never "100 %" or "0 %"."""
    if share > 0.99:
        return "more than 99 %"
    return "less than 1 %" if share < 0.01 else f"{100 * share:.0f} %"
