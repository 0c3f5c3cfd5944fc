"""Reduced loops as they are written: entries of a document, rows of a measurement file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.readings.history import StrutHistory
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.raw_history import BEYOND, sided
from toolpath_stiff.readings.raw_records import CONDITIONS, PLACE, Loop
from toolpath_stiff.readings.raw_shape import Shape
from toolpath_stiff.units import certain, n_per_mm_from_n_per_m, um_from_m

FIGURES = ("lost_motion_um", "loop_width_um", "linearity_percent", "closure_um")


def loop_entry(loop: Loop, figures: LoopFigures) -> dict[str, Any]:
    """A loop in the shop's units; what it cannot say is None. `slope_N_per_mm`: beyond the lost motion."""
    numbers = {
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(figures.stiffness),
        "force_N": figures.force,
        "deflection_um": um_from_m(figures.deflection),
        "slope_N_per_mm": n_per_mm_from_n_per_m(figures.beyond if figures.plays else math.nan),
        "tension_N_per_mm": n_per_mm_from_n_per_m(figures.tension),
        "compression_N_per_mm": n_per_mm_from_n_per_m(figures.compression),
        **shop_figures(figures),
    }
    shown = {name: round(value, 6) if math.isfinite(value) else None for name, value in numbers.items()}
    return {"loop": loop.title, "line": loop.line, **shown, "shape": _shape(figures.shape)}


def _shape(shape: Shape) -> dict[str, Any]:
    """What stands out of a straight line."""
    numbers = {
        "force_N": shape.force,
        "first_N_per_mm": n_per_mm_from_n_per_m(shape.first),
        "second_N_per_mm": n_per_mm_from_n_per_m(shape.second),
        "work_lost_mJ": 1e3 * shape.lost,
    }
    shown = {name: certain(value) if math.isfinite(value) else None for name, value in numbers.items()}
    return {"kind": shape.kind, **shown, "text": str(shape)}


def shop_figures(figures: LoopFigures) -> dict[str, float]:
    """`FIGURES` in the shop's units."""
    return {
        "lost_motion_um": um_from_m(figures.lost_motion),
        "loop_width_um": um_from_m(figures.loop_width),
        "linearity_percent": 100.0 * figures.linearity,
        "closure_um": um_from_m(figures.closure),
    }


def _rows_of(
    loops: Sequence[Loop], figures: Sequence[LoopFigures], history: StrutHistory
) -> list[tuple[Loop, LoopFigures]]:
    """Loops as they stand in a measurement file: struts with their own stiffness, two rows where the sides differ."""
    both_sides = sided(loops, figures, history)
    mixed = {one.strut for one in history.struts if one.judged_on != BEYOND}
    found = []
    for loop, one in zip(loops, figures, strict=True):
        if loop.place.get("loop") in both_sides:
            high, low = float(loop.force.max()), float(loop.force.min())
            found.append((loop, replace(one, stiffness=one.tension, force=high)))
            found.append((loop, replace(one, stiffness=one.compression, force=low)))
        else:
            own = one.stiffness if loop.place.get("loop") in mixed else one.elastic
            found.append((loop, replace(one, stiffness=own)))
    return found


def measurement_csv(loops: Sequence[Loop], figures: Sequence[LoopFigures], history: StrutHistory) -> str:
    """A measurement file, one row a loop; of a strut that differs in tension and compression a row of each.

    A figure that some loop lacks is left out as a column.
    """
    loops, figures = zip(*_rows_of(loops, figures, history), strict=True)
    shown = [shop_figures(one) for one in figures]
    there = [name for name in FIGURES if all(math.isfinite(one[name]) for one in shown)]
    place = _place_columns(loops)
    forces = _force_columns(loops)
    conditions = [name for name in CONDITIONS if all(name in loop.conditions for loop in loops)]
    rows = []
    for loop, one, own in zip(loops, figures, shown, strict=True):
        force = f"{one.force:.2f}" if math.isfinite(one.force) else ""
        cells = [loop.place.get(name, "") for name in place]
        cells += [f"{n_per_mm_from_n_per_m(one.stiffness):.1f}"]
        cells += [force if name == _force_column(loop) else "" for name in forces]
        cells += [f"{loop.conditions[name]:.6g}" for name in conditions]
        cells += [f"{own[name] + 0.0:.3f}" for name in there]
        rows.append(cells)
    return csv_text([*place, "stiffness_N_per_mm", *forces, *conditions, *there], rows)


def _place_columns(loops: Sequence[Loop]) -> list[str]:
    """Columns that say where the loops were; of struts alone those with something in them."""
    place = [name for name in PLACE if any(name in loop.place for loop in loops)]
    alone = all(loop.jog is None for loop in loops)
    return [name for name in place if not alone or any(loop.place.get(name) for loop in loops)]


def _force_column(loop: Loop) -> str:
    """The column of its force: at the tool tip, or along a strut measured alone."""
    return "strut_force_N" if loop.jog is None else "force_N"


def _force_columns(loops: Sequence[Loop]) -> list[str]:
    return sorted({_force_column(loop) for loop in loops})
