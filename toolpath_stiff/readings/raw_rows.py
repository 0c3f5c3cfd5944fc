"""Reduced loops in writing: entries of a document, rows of a measurement file, struts over their dates."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.documents import Document
from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.history import SURE, StrutHistory, StrutReadings, history
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.raw_records import PLACE
from toolpath_stiff.units import n_per_mm_from_n_per_m, um_from_m


def struts_over_dates(figures: Sequence[LoopFigures]) -> StrutHistory:
    """Struts measured alone over their dates; several lengths apart, as a strut's stiffness depends on length."""
    alone = [record for record in figures if record.loop.jog is None]
    kinds: dict[str, set[tuple[str, float]]] = {}
    for record in alone:
        kinds.setdefault(record.loop.strut, set()).add((record.loop.place.get("length_mm", ""), record.loop.side))

    def name(record: LoopFigures) -> str:
        strut, length = record.loop.strut, record.loop.place.get("length_mm")
        parts = [strut, f"{length} mm" if length and len({kind[0] for kind in kinds[strut]}) > 1 else ""]
        # A one-sided record is not compared with two-sided ones.
        if record.loop.side and 0.0 in {kind[1] for kind in kinds[strut]}:
            parts.append("in tension alone" if record.loop.side > 0.0 else "in compression alone")
        return ", ".join(filter(None, parts))

    def readings(rows: list[tuple[LoopFigures, float, float]]) -> StrutReadings:
        return StrutReadings(
            np.array([name(record) for record, _, _ in rows], dtype=str),
            np.array([day_of(record.loop.date) for record, _, _ in rows]),
            np.log([stiffness for _, stiffness, _ in rows]),
            np.array([side for _, _, side in rows]),
        )

    secants = [(record, record.stiffness, record.side) for record in alone]
    slopes = [(record, k, side) for record in alone for k, side in ((record.tension, 1.0), (record.compression, -1.0))]
    slopes = [row for row in slopes if math.isfinite(row[1])]
    return history(readings(secants), readings(slopes or secants))


def _sided(figures: Sequence[LoopFigures], over_time: StrutHistory) -> set[str]:
    """Struts that differ in tension and compression, with both sides in all loops: they get a row for each side."""
    lacking = {record.loop.strut for record in figures if math.isnan(record.tension)}
    return {strut.strut for strut in over_time.struts if strut.sides is not None and strut.sides.p < SURE} - lacking


def remarks(figures: Sequence[LoopFigures], over_time: StrutHistory) -> Iterator[str]:
    """Remarks on rows that replace a secant in the measurement file, and on rows that are outdated."""
    both = sorted(_sided(figures, over_time))
    if both:
        yield f"tension and compression differ: a row of each side for {', '.join(both)}"
    for strut in over_time.struts:
        if strut.changes:
            yield (
                f"{strut.strut} changed: leave out its rows before {strut.changes[-1].before} for diagnose and "
                "update, which take all dates as one"
            )


# Columns of a measurement file beyond the stiffness.
FURTHER = ("lost_motion_um", "loop_width_um", "linearity_percent")


def _in_shop_units(figures: LoopFigures) -> dict[str, float]:
    """Figures of a loop by their names in documents; nan for unknown ones."""
    return {
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(figures.stiffness),
        "force_N": figures.force,
        "deflection_um": um_from_m(figures.deflection),
        "tension_N_per_mm": n_per_mm_from_n_per_m(figures.tension),
        "compression_N_per_mm": n_per_mm_from_n_per_m(figures.compression),
        "lost_motion_um": um_from_m(figures.lost_motion),
        "loop_width_um": um_from_m(figures.loop_width),
        "linearity_percent": 100.0 * figures.linearity,
    }


def loop_entry(figures: LoopFigures) -> Document:
    """A loop in the shop's units; None for unknown figures."""
    numbers = _in_shop_units(figures).items()
    rounded = {name: round(value, 6) if math.isfinite(value) else None for name, value in numbers}
    return {"loop": figures.loop.title, "line": figures.loop.line, **rounded}


def measurement_csv(reduced: Sequence[LoopFigures], over_time: StrutHistory) -> str:
    """A measurement file with one row per loop, or per side of a strut that differs in tension and compression.

    A figure that some loop lacks is left out as a column.
    """
    both_sides = _sided(reduced, over_time)
    figures: list[LoopFigures] = []
    for record in reduced:
        rows = [(record.stiffness, record.force)]
        if record.loop.strut in both_sides:
            force = record.loop.force
            rows = [(record.tension, float(force.max())), (record.compression, float(force.min()))]
        figures += [replace(record, stiffness=stiffness, force=force) for stiffness, force in rows]
    numbers = [_in_shop_units(record) for record in figures]
    place = [name for name in PLACE if any(record.loop.place.get(name) for record in figures)]
    # The force of a strut measured alone is along it, otherwise it is at the tool tip.
    of_force = ["strut_force_N" if record.loop.jog is None else "force_N" for record in figures]
    forces = sorted(set(of_force))
    further = [name for name in FURTHER if all(math.isfinite(values[name]) for values in numbers)]
    cells = [
        [
            *(record.loop.place.get(name, "") for name in place),
            f"{values['stiffness_N_per_mm']:.1f}",
            *(f"{record.force:.2f}".replace("nan", "") if name == column else "" for name in forces),
            *(f"{values[name] + 0.0:.3f}" for name in further),
        ]
        for record, values, column in zip(figures, numbers, of_force, strict=True)
    ]
    return csv_text([*place, "stiffness_N_per_mm", *forces, *further], cells)
