"""Raw records of struts over their dates, and the remarks that follow: which rows of a file are outdated."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.readings.dates import day_of, short_dates
from toolpath_stiff.readings.history import StrutHistory, history
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.strut_series import SURE, StrutReadings

# What the records of a strut are compared by.
SECANT, BEYOND = "secant", "slope beyond the lost motion"


def struts_over_dates(figures: Sequence[LoopFigures]) -> StrutHistory:
    """Struts measured alone over their dates; those of several lengths by length, as a strut's stiffness varies."""
    alone = [record for record in figures if record.loop.jog is None]
    kinds: dict[str, set[tuple[str, float]]] = {}
    for record in alone:
        kinds.setdefault(record.loop.strut, set()).add((record.loop.place.get("length_mm", ""), record.loop.side))

    def name(record: LoopFigures) -> str:
        strut, length = record.loop.strut, record.loop.place.get("length_mm")
        parts = [strut, f"{length} mm" if length and len({kind[0] for kind in kinds[strut]}) > 1 else ""]
        # A record of one side alone is not held against those of both.
        if record.loop.side and 0.0 in {kind[1] for kind in kinds[strut]}:
            parts.append("in tension alone" if record.loop.side > 0.0 else "in compression alone")
        return ", ".join(filter(None, parts))

    def readings(rows: list[tuple[LoopFigures, float, float]]) -> StrutReadings:
        return StrutReadings(
            np.array([name(record) for record, _, _ in rows], dtype=str),
            np.array([day_of(record.loop.date) for record, _, _ in rows]),
            np.log([stiffness for _, stiffness, _ in rows]),
            np.array([side for _, _, side in rows]),
            short_dates(record.loop.date for record, _, _ in rows),
        )

    judged = {strut: _judged([record for record in alone if record.loop.strut == strut]) for strut in kinds}
    compared = [(r, r.beyond if judged[r.loop.strut] == BEYOND else r.stiffness, r.side) for r in alone]
    slopes = [(record, k, side) for record in alone for k, side in ((record.tension, 1.0), (record.compression, -1.0))]
    slopes = [row for row in slopes if math.isfinite(row[1])]
    over_time, struts = history(readings(compared), readings(slopes or compared)), []
    for strut in over_time.struts:
        figure = judged[strut.strut.split(" alone")[0] + " alone"]
        told = f"judged on the {figure}" if figure == BEYOND else ""
        struts.append(replace(strut, judged_on=figure, text="; ".join(filter(None, [strut.text, told]))))
    return replace(over_time, struts=struts)


def _judged(figures: Sequence[LoopFigures]) -> str:
    """What all records of a strut can be compared by; "" of stiffnesses without records."""
    if not any(len(record.loop.force) for record in figures):
        return ""
    beyond = any(record.plays for record in figures) and all(math.isfinite(record.beyond) for record in figures)
    return BEYOND if beyond else SECANT


def sided(figures: Sequence[LoopFigures], over_time: StrutHistory) -> set[str]:
    """Struts that differ in tension and compression and whose loops all say so: rows of both would not be alike."""
    lacking = {record.loop.strut for record in figures if math.isnan(record.tension)}
    return {strut.strut for strut in over_time.struts if strut.sides is not None and strut.sides.p < SURE} - lacking


def remarks(figures: Sequence[LoopFigures], over_time: StrutHistory) -> Iterator[str]:
    """What stands in a measurement file in place of a secant, and which of its rows are outdated."""
    beyond = [strut.strut for strut in over_time.struts if strut.judged_on == BEYOND]
    if beyond:
        yield f"lost motion: the rows of {', '.join(beyond)} hold the slope beyond it, their own stiffness"
    both = sorted(sided(figures, over_time))
    if both:
        yield f"tension and compression differ: a row of each side for {', '.join(both)}"
    for strut in over_time.struts:
        if strut.changes:
            yield (
                f"{strut.strut} changed: leave out its rows before {strut.changes[-1].before} for diagnose and "
                "update, which take all dates as one"
            )
