"""Raw records of struts over their dates: and by which figure they are compared."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.readings.dates import day_of, short_dates
from toolpath_stiff.readings.history import StrutHistory, history
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.strut_series import StrutReadings

# What the records of a strut are compared by.
BEYOND = "slope beyond the lost motion"
BLURRED = "secant, which its lost motion blurs: not every date has a closed cycle of both sides"
SECANT, IN_TENSION, IN_COMPRESSION = "secant", "slope in tension", "slope in compression"
OF_ONE_SIDE = ", which its lost motion blurs in records of one side alone"


def struts_over_dates(figures: Sequence[LoopFigures]) -> StrutHistory:
    """Struts measured alone over their dates; those of several lengths by length, as a strut's stiffness varies."""
    alone = [record for record in figures if record.loop.jog is None]
    lengths: dict[str, set[str]] = {}
    for record in alone:
        lengths.setdefault(record.loop.strut, set()).add(record.loop.place.get("length_mm", ""))

    def name(record: LoopFigures) -> str:
        length = record.loop.place.get("length_mm")
        return (
            f"{record.loop.strut}, {length} mm" if len(lengths[record.loop.strut]) > 1 and length else record.loop.strut
        )

    def readings(rows: list[tuple[LoopFigures, float, float]]) -> StrutReadings:
        return StrutReadings(
            np.array([name(record) for record, _, _ in rows], dtype=str),
            np.array([day_of(record.loop.date) for record, _, _ in rows]),
            np.log([stiffness for _, stiffness, _ in rows]),
            np.array([side for _, _, side in rows]),
            short_dates(record.loop.date for record, _, _ in rows),
        )

    alone = [record for record in alone if not record.standstill]
    judged = {strut: _judged([record for record in alone if record.loop.strut == strut]) for strut in lengths}
    compared = [(record, *_compared(record, judged[record.loop.strut])) for record in alone]
    slopes = [(record, k, side) for record in alone for k, side in ((record.tension, 1.0), (record.compression, -1.0))]
    slopes = [row for row in slopes if math.isfinite(row[1])]
    over_time, struts = history(readings(compared), readings(slopes or compared)), []
    for strut in over_time.struts:
        figure = judged[strut.strut.split(" alone")[0] + " alone"]
        judged_text = "" if figure in ("", SECANT) else f"judged on the {figure}"
        text = "; ".join(filter(None, [strut.text, judged_text]))
        struts.append(replace(strut, judged_on=figure, text=text))
    return replace(over_time, struts=struts)


def _judged(figures: Sequence[LoopFigures]) -> str:
    """What all records of a strut can be compared by."""
    recorded = [record for record in figures if len(record.loop.force)]
    if not recorded:
        return ""
    both = [record for record in recorded if not record.side]
    play = any(record.plays for record in both)
    if len(recorded) == len(figures):
        # The side that every record has, where some have no other.
        sides = {record.side for record in recorded}
        if len(sides) == 2 and 0.0 in sides and all(math.isfinite(record.tension) for record in both):
            return (IN_TENSION if 1.0 in sides else IN_COMPRESSION) + (OF_ONE_SIDE if play else "")
        if play and all(math.isfinite(record.beyond) for record in figures):
            return BEYOND
    return BLURRED if play else SECANT


def _compared(record: LoopFigures, judged: str) -> tuple[float, float]:
    """Stiffness in N/m by which a record is compared with others, and the side on which that is."""
    if judged == BEYOND:
        return record.beyond, record.side
    if judged.startswith(IN_TENSION) and not record.side:
        return record.tension, 1.0
    if judged.startswith(IN_COMPRESSION) and not record.side:
        return record.compression, -1.0
    return record.stiffness, record.side
