"""Raw records of struts over their dates: by which figure they are compared, and what is to be borne in mind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from toolpath_stiff.readings.dates import day_of, short_dates
from toolpath_stiff.readings.history import StrutHistory, history
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.strut_series import SURE, StrutReadings
from toolpath_stiff.units import um_from_m

OTHER_SIDE = 1.05  # ratio of two slopes of a loop from which one side counts as softer; assumed, twice the scatter
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


def remarks(figures: Sequence[LoopFigures], history: StrutHistory) -> Iterator[str]:
    """What is doubtful, what stands in a measurement file in place of a secant, which of its rows are outdated."""
    yield from _standstills(figures)
    yield from _replaced(figures)
    beyond = {strut.strut for strut in history.struts if strut.judged_on == BEYOND}
    playing = [one for one in figures if one.plays and one.loop.strut in beyond]
    if playing:
        most = max(playing, key=lambda one: one.elastic / one.stiffness)
        yield (
            f"{len(playing)} loops show lost motion; the rows of their struts hold the slope beyond it, their own "
            f"stiffness. The secant is at most {100.0 * (1.0 - most.stiffness / most.elastic):.2g} % less: "
            f"{most.loop.title}"
        )
    both = sorted(sided(figures, history))
    if both:
        yield f"tension and compression differ: a row of each side for {', '.join(both)}"
    softer: dict[str, dict[bool, str]] = {}  # strut -> in tension or not -> where first
    for one in figures:
        if max(one.tension, one.compression) > OTHER_SIDE * min(one.tension, one.compression):
            where = softer.setdefault(one.loop.strut, {})
            where.setdefault(one.tension < one.compression, one.loop.date or f"line {one.loop.line}")
    for strut, where in softer.items():
        if len(where) > 1:
            yield (
                f"{strut}: softer in tension on {where[True]}, in compression on {where[False]}: does a file count "
                "compression positive? Its head may say so (compression positive)"
            )
    for changed in history.struts:
        if changed.changes:
            yield (
                f"{changed.strut} changed: leave out its rows before {changed.changes[-1].before} for diagnose and "
                "update, which take all dates as one"
            )


def _standstills(figures: Sequence[LoopFigures]) -> Iterator[str]:
    """A note where indicators stood still while the force went on."""
    stood = [(one.loop.title, still) for one in figures if (still := one.standstill)]
    if stood:
        title, (displacement, start, end) = stood[0]
        others = f"; so in {len(stood) - 1} further loops" if len(stood) > 1 else ""
        yield (
            f"{title}: the indicator stands still at {um_from_m(displacement):g} um while the force goes on from "
            f"{start:.4g} to {end:.4g} N: at the end of its range? The stiffness is too high then, and does not count "
            f"in the history; leave out its row{others}"
        )


def _replaced(figures: Sequence[LoopFigures]) -> Iterator[str]:
    """Notes where a strut's serial number changes."""
    loops = [one.loop for one in figures if one.loop.serial]
    for strut in sorted({loop.strut for loop in loops}):
        dated = sorted((day_of(loop.date), loop.date, loop.serial) for loop in loops if loop.strut == strut)
        for (_, last, before), (_, first, after) in pairwise(dated):
            if before != after:
                yield (
                    f"{strut}: serial number {before} until {last or '?'}, {after} from {first or '?'}: another part, "
                    "so that a change between these dates is its replacement"
                )


def sided(figures: Sequence[LoopFigures], history: StrutHistory) -> set[str]:
    """Struts that differ in tension and compression and whose loops all say so: rows of both would not be alike."""
    lacking = {one.loop.strut for one in figures if math.isnan(one.tension)}
    return {one.strut for one in history.struts if one.sides is not None and one.sides.p < SURE} - lacking
