"""The results of a search for a placement: page, files and text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.placement.result import Placement, Written
from toolpath_stiff.placement.rows import COLUMNS, PlacementRow
from toolpath_stiff.report.pages import Drawing
from toolpath_stiff.report.place_page import page_pieces
from toolpath_stiff.report.words import machine_text
from toolpath_stiff.units import number


def text(placed: Placement) -> str:
    """A placement in words: what got worse, the placement, what it brings, what it costs."""
    best, present, count = placed.chosen, placed.present, len(placed.front)
    first = len(placed.worse) + placed.search.nothing_better
    label = "picked" if placed.picked else "recommended"
    which = (
        f"placement {best.number} of {count}, picked" if placed.picked else f"objective {placed.task.rules.objective}"
    )
    lines = [
        *(f"warning         {warning}" for warning in placed.warnings[:first]),
        f"program         {placed.best.program.name} on {machine_text(placed.machine_stated)}, load {placed.best.load}",
        f"{label:<16}X{best.x_mm:.3f} Y{best.y_mm:.3f} Z{best.z_mm:.3f}, turned by {best.rotation_deg:.3f} degrees "
        f"({which})",
    ]
    if best.a_deg or best.b_deg:
        lines.append(f"                set-up tilted by A{best.a_deg:.3f} B{best.b_deg:.3f} degrees")
    lines.append(f"  stiffness     {_figures_words(best)}")
    lines.append(f"  before        {_figures_words(present) if present else f'out of reach: {placed.present_reason}'}")
    if best.plunge_mean_N_per_mm is not None:
        now = f", before {number(present.plunge_mean_N_per_mm)}" if present else ""
        mean = number(best.plunge_mean_N_per_mm)
        lines.append(f"  plunges       mean {mean}{now} N/mm, along the tool axis, not counted above")
    for goal, cost in placed.trade_offs.items():
        lines.append(
            f"  best {goal:<9} {number(cost['best_on_front_N_per_mm'])} on the front, "
            f"{number(cost['chosen_N_per_mm'])} here, N/mm"
        )
    margin = min(value for value in (best.margin, best.rapid_margin, 1.0) if value is not None)
    lines.append(f"  margin        {100.0 * margin:.1f} % of a limit's span at least, rapids included")
    blocks = placed.offsets
    lines.append(f"LinuxCNC        {blocks.linuxcnc or blocks.linuxcnc_reason}")
    fanuc = (blocks.fanuc or blocks.fanuc_reason).replace("\n", "\n                ")
    lines.append(f"Fanuc-style     {fanuc}")
    evaluated = placed.search.pose_evaluations
    lines.append(f"front           {count} placements, {number(evaluated)} poses evaluated")
    lines += _written(placed.written) if placed.written else []
    lines += [f"warning         {warning}" for warning in placed.warnings[first:]]
    return "\n".join(lines)


def _figures_words(row: PlacementRow) -> str:
    return (
        f"mean {number(row.mean_N_per_mm)}, range {number(row.range_N_per_mm)}, "
        f"weakest {number(row.min_N_per_mm)} N/mm, deflection {row.mean_deflection_um:.1f} um"
    )


def _written(written: Written) -> list[str]:
    """Lines on the transformed program."""
    if written.refused:
        return [f"not rewritten   {written.file}: {written.refused}"]
    zero, apart = written.analysed_at, written.relative_difference
    figures = ", ".join(f"{name} {value:.1e}" for name, value in apart.items())
    lines = [
        f"rewritten       {written.file}; at X{zero['x_mm']:g} Y{zero['y_mm']:g} Z{zero['z_mm']:g}, "
        f"{zero['rotation_deg']:g} degrees it differs from the placed program by (relative) {figures}"
    ]
    return lines + [f"                {note}" for note in written.notes]


def _table(placed: Placement) -> str:
    """The front."""
    return csv_text(COLUMNS, ([_cell(value) for value in vars(row).values()] for row in placed.front))


def _cell(value: float | None) -> str:
    """A number of placements.csv; nothing where there is none."""
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.6f}"


def page(placed: Placement, drawn: Mapping[str, Drawing]) -> Iterator[str]:
    """The page, in pieces."""
    return page_pieces(placed)


DATA = {"placements.csv": _table, "placement.json": Placement.to_json}
PAGE = "report.html"
