"""A placement in words, for the terminal."""

from __future__ import annotations

from typing import Any

from toolpath_stiff.report.wording import machine_text


def placement_text(summary: dict[str, Any]) -> str:
    """What got worse, the placement, what it brings, what it costs; `summary` as in `placement.json`."""
    best, before = summary["chosen"], summary["before"]
    first = len(summary["worse"])
    which = f"placement {best['number']} of {len(summary['front'])}, picked" if summary["picked"] else "recommended"
    lines = [
        *(f"warning         {text}" for text in summary["warnings"][:first]),
        f"program         {summary['program']} on {machine_text(summary)}, load {summary['load']}",
        f"{'picked' if summary['picked'] else 'recommended':<16}X{best['x_mm']:.3f} Y{best['y_mm']:.3f} "
        f"Z{best['z_mm']:.3f}, turned by {best['rotation_deg']:.3f} degrees "
        f"({which if summary['picked'] else 'objective ' + summary['objective']})",
    ]
    if best["a_deg"] or best["b_deg"]:
        lines.append(f"                set-up tilted by A{best['a_deg']:.3f} B{best['b_deg']:.3f} degrees")
    for name, row in (("  stiffness", best), ("  before", before)):
        lines.append(f"{name:<16}{_figures_words(row) if row else 'out of reach: ' + summary['before_reason']}")
    lines += _plunges_words(best, before)
    for goal, cost in summary["costs"].items():
        lines.append(
            f"  best {goal:<9} {cost['best_on_front_N_per_mm']:.0f} on the front, "
            f"{cost['chosen_N_per_mm']:.0f} here, N/mm"
        )
    lines.append(f"  margin        {100.0 * _smallest_margin(best):.1f} % of a limit's span at least, rapids included")
    blocks = summary["offset_blocks"]
    lines.append(f"LinuxCNC        {blocks['linuxcnc'] or blocks['linuxcnc_reason']}")
    fanuc = (blocks["fanuc"] or blocks["fanuc_reason"]).replace("\n", "\n                ")
    lines.append(f"Fanuc-style     {fanuc}")
    evaluated = summary["search"]["pose_evaluations"]
    lines.append(f"front           {len(summary['front'])} placements, {evaluated} poses evaluated")
    lines += _written(summary["written"]) if summary["written"] else []
    lines += [f"warning         {text}" for text in summary["warnings"][first:]]
    return "\n".join(lines)


def _figures_words(row: dict[str, Any]) -> str:
    return (
        f"mean {row['mean_N_per_mm']:.0f}, range {row['range_N_per_mm']:.0f}, weakest {row['min_N_per_mm']:.0f} N/mm, "
        f"deflection {row['mean_deflection_um']:.1f} um"
    )


def _plunges_words(best: dict[str, Any], before: dict[str, Any] | None) -> list[str]:
    """The plunges, where they stand beside the other figures."""
    if best["plunge_mean_N_per_mm"] is None:
        return []
    now = f", before {before['plunge_mean_N_per_mm']:.0f}" if before else ""
    return [
        f"  plunges       mean {best['plunge_mean_N_per_mm']:.0f}{now} N/mm, along the tool axis, not counted above"
    ]


def _smallest_margin(row: dict[str, Any]) -> float:
    return float(min(value for value in (row["margin"], row["rapid_margin"], 1.0) if value is not None))


def _written(written: dict[str, Any]) -> list[str]:
    """What became of the transformed program."""
    at, apart = written["analysed_at"], written["relative_difference"]
    figures = ", ".join(f"{name} {value:.1e}" for name, value in apart.items())
    lines = [
        f"rewritten       {written['file']}; at X{at['x_mm']:g} Y{at['y_mm']:g} Z{at['z_mm']:g}, "
        f"{at['rotation_deg']:g} degrees it differs from the placed program by (relative) {figures}"
    ]
    return lines + [f"                {note}" for note in written["notes"]]
