"""Reduced loops as they are written: entries of a document, rows of a measurement file."""

import math
from collections.abc import Sequence
from dataclasses import replace

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.readings.history import StrutHistory
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.raw_history import BEYOND, sided
from toolpath_stiff.readings.raw_records import CONDITIONS, PLACE
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m


def loop_entry(figures: LoopFigures) -> dict[str, str | int | float | None]:
    """A loop in the shop's units; what it cannot say is None. `slope_N_per_mm`: beyond the lost motion."""
    numbers = {
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(figures.stiffness),
        "force_N": figures.force,
        "deflection_um": um_from_m(figures.deflection),
        "slope_N_per_mm": n_per_mm_from_n_per_m(figures.beyond if figures.plays else math.nan),
        "tension_N_per_mm": n_per_mm_from_n_per_m(figures.tension),
        "compression_N_per_mm": n_per_mm_from_n_per_m(figures.compression),
        **_further(figures),
    }
    rounded = {name: round(value, 6) if math.isfinite(value) else None for name, value in numbers.items()}
    return {"loop": figures.loop.title, "line": figures.loop.line, **rounded}


def _further(figures: LoopFigures) -> dict[str, float]:
    """Columns of a measurement file that say more than the stiffness."""
    return {
        "lost_motion_um": um_from_m(figures.lost_motion),
        "loop_width_um": um_from_m(figures.loop_width),
        "linearity_percent": 100.0 * figures.linearity,
        "closure_um": um_from_m(figures.closure),
    }


def measurement_csv(reduced: Sequence[LoopFigures], over_time: StrutHistory) -> str:
    """A measurement file, one row a loop; of a strut that differs in tension and compression a row of each.

    A figure that some loop lacks is left out as a column.
    """
    both_sides = sided(reduced, over_time)
    beyond = {strut.strut for strut in over_time.struts if strut.judged_on == BEYOND}
    figures: list[LoopFigures] = []
    for record in reduced:
        if record.loop.strut in both_sides:
            figures.append(replace(record, stiffness=record.tension, force=float(record.loop.force.max())))
            figures.append(replace(record, stiffness=record.compression, force=float(record.loop.force.min())))
        else:
            plays = record.plays and record.loop.strut in beyond
            figures.append(replace(record, stiffness=record.beyond if plays else record.stiffness))
    loops = [record.loop for record in figures]
    place = [name for name in PLACE if any(loop.place.get(name) for loop in loops)]
    # The force of a strut measured alone is along it, else at the tool tip.
    forces = sorted({"strut_force_N" if loop.jog is None else "force_N" for loop in loops})
    conditions = [name for name in CONDITIONS if all(name in loop.conditions for loop in loops)]
    further = [name for name in _further(figures[0]) if all(math.isfinite(_further(r)[name]) for r in figures)]
    rows = []
    for record in figures:
        own = "strut_force_N" if record.loop.jog is None else "force_N"
        force = f"{record.force:.2f}" if math.isfinite(record.force) else ""
        cells = [record.loop.place.get(name, "") for name in place]
        cells += [f"{n_per_mm_from_n_per_m(record.stiffness):.1f}"]
        cells += [force if name == own else "" for name in forces]
        cells += [f"{record.loop.conditions[name]:.6g}" for name in conditions]
        rows.append([*cells, *(f"{_further(record)[name] + 0.0:.3f}" for name in further)])
    return csv_text([*place, "stiffness_N_per_mm", *forces, *conditions, *further], rows)
