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
    alone = [one for one in figures if one.loop.jog is None]
    lengths: dict[str, set[str]] = {}
    for one in alone:
        lengths.setdefault(one.loop.strut, set()).add(one.loop.place.get("length_mm", ""))

    def name(one: LoopFigures) -> str:
        length = one.loop.place.get("length_mm")
        return f"{one.loop.strut}, {length} mm" if len(lengths[one.loop.strut]) > 1 and length else one.loop.strut

    def readings(rows: list[tuple[LoopFigures, float, float]]) -> StrutReadings:
        return StrutReadings(
            np.array([name(one) for one, _, _ in rows], dtype=str),
            np.array([day_of(one.loop.date) for one, _, _ in rows]),
            np.log([stiffness for _, stiffness, _ in rows]),
            np.array([side for _, _, side in rows]),
            short_dates(one.loop.date for one, _, _ in rows),
        )

    alone = [one for one in alone if not one.standstill]
    judged = {strut: _judged([one for one in alone if one.loop.strut == strut]) for strut in lengths}
    compared = [(one, *_compared(one, judged[one.loop.strut])) for one in alone]
    slopes = [(one, k, side) for one in alone for k, side in ((one.tension, 1.0), (one.compression, -1.0))]
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
    recorded = [one for one in figures if len(one.loop.force)]
    if not recorded:
        return ""
    both = [one for one in recorded if not one.side]
    play = any(one.plays for one in both)
    if len(recorded) == len(figures):
        # The side that every record has, where some have no other.
        sides = {one.side for one in recorded}
        if len(sides) == 2 and 0.0 in sides and all(math.isfinite(one.tension) for one in both):
            return (IN_TENSION if 1.0 in sides else IN_COMPRESSION) + (OF_ONE_SIDE if play else "")
        if play and all(math.isfinite(one.beyond) for one in figures):
            return BEYOND
    return BLURRED if play else SECANT


def _compared(one: LoopFigures, judged: str) -> tuple[float, float]:
    """Stiffness in N/m by which a record is compared with others, and the side on which that is."""
    if judged == BEYOND:
        return one.beyond, one.side
    if judged.startswith(IN_TENSION) and not one.side:
        return one.tension, 1.0
    if judged.startswith(IN_COMPRESSION) and not one.side:
        return one.compression, -1.0
    return one.stiffness, one.side
