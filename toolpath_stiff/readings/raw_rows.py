"""Reduced loops as they are written: entries of a document, rows of a measurement file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.readings.history import StrutHistory
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.raw_history import BEYOND
from toolpath_stiff.readings.raw_records import CONDITIONS, PLACE, Loop
from toolpath_stiff.readings.raw_remarks import sided
from toolpath_stiff.units import certain, n_per_mm_from_n_per_m, um_from_m


def loop_entry(figures: LoopFigures) -> dict[str, Any]:
    """A loop in the shop's units; what it cannot say is None. `slope_N_per_mm`: beyond the lost motion."""
    shape = figures.shape
    numbers = {
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(figures.stiffness),
        "force_N": figures.force,
        "deflection_um": um_from_m(figures.deflection),
        "slope_N_per_mm": n_per_mm_from_n_per_m(figures.beyond if figures.plays else math.nan),
        "tension_N_per_mm": n_per_mm_from_n_per_m(figures.tension),
        "compression_N_per_mm": n_per_mm_from_n_per_m(figures.compression),
        **_shop_figures(figures),
    }
    of_shape = {
        "force_N": shape.force,
        "first_N_per_mm": n_per_mm_from_n_per_m(shape.first),
        "second_N_per_mm": n_per_mm_from_n_per_m(shape.second),
        "work_lost_mJ": 1e3 * shape.lost,
    }
    return {
        "loop": figures.loop.title,
        "line": figures.loop.line,
        **{name: round(value, 6) if math.isfinite(value) else None for name, value in numbers.items()},
        "shape": {
            "kind": shape.kind,
            **{name: certain(value) if math.isfinite(value) else None for name, value in of_shape.items()},
            "text": str(shape),
        },
    }


def _shop_figures(figures: LoopFigures) -> dict[str, float]:
    """Columns of a measurement file that say more than the stiffness."""
    return {
        "lost_motion_um": um_from_m(figures.lost_motion),
        "loop_width_um": um_from_m(figures.loop_width),
        "linearity_percent": 100.0 * figures.linearity,
        "closure_um": um_from_m(figures.closure),
    }


def measurement_csv(reduced: Sequence[LoopFigures], history: StrutHistory) -> str:
    """A measurement file, one row a loop; of a strut that differs in tension and compression a row of each.

    A figure that some loop lacks is left out as a column.
    """
    both_sides = sided(reduced, history)
    mixed = {strut.strut for strut in history.struts if strut.judged_on != BEYOND}
    figures: list[LoopFigures] = []
    for record in reduced:
        if record.loop.strut in both_sides:
            figures.append(replace(record, stiffness=record.tension, force=float(record.loop.force.max())))
            figures.append(replace(record, stiffness=record.compression, force=float(record.loop.force.min())))
        else:
            stiffness = record.stiffness if record.loop.strut in mixed else record.elastic
            figures.append(replace(record, stiffness=stiffness))
    loops = [record.loop for record in figures]
    # Of struts alone only columns with something in them.
    alone = all(loop.jog is None for loop in loops)
    place = [n for n in PLACE if any(loop.place.get(n) if alone else n in loop.place for loop in loops)]
    forces = sorted({_force_column(loop) for loop in loops})
    conditions = [name for name in CONDITIONS if all(name in loop.conditions for loop in loops)]
    shown = [_shop_figures(record) for record in figures]
    further = [name for name in shown[0] if all(math.isfinite(numbers[name]) for numbers in shown)]
    rows = []
    for record, numbers in zip(figures, shown, strict=True):
        force = f"{record.force:.2f}" if math.isfinite(record.force) else ""
        cells = [record.loop.place.get(name, "") for name in place]
        cells += [f"{n_per_mm_from_n_per_m(record.stiffness):.1f}"]
        cells += [force if name == _force_column(record.loop) else "" for name in forces]
        cells += [f"{record.loop.conditions[name]:.6g}" for name in conditions]
        rows.append([*cells, *(f"{numbers[name] + 0.0:.3f}" for name in further)])
    return csv_text([*place, "stiffness_N_per_mm", *forces, *conditions, *further], rows)


def _force_column(loop: Loop) -> str:
    """The column of its force: at the tool tip, or along a strut measured alone."""
    return "strut_force_N" if loop.jog is None else "force_N"
