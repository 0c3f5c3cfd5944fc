"""Remarks on reduced records: what is doubtful, replaced or changed, and which rows of a file are outdated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.history import StrutHistory
from toolpath_stiff.readings.loop_figures import LoopFigures
from toolpath_stiff.readings.raw_history import BEYOND
from toolpath_stiff.readings.strut_series import SURE
from toolpath_stiff.units import um_from_m

OTHER_SIDE = 1.05  # ratio of two slopes of a loop from which one side counts as softer; assumed, twice the scatter


def remarks(figures: Sequence[LoopFigures], history: StrutHistory) -> Iterator[str]:
    """What is doubtful, what stands in a measurement file in place of a secant, which of its rows are outdated."""
    yield from _standstills(figures)
    yield from _replaced(figures)
    beyond = {strut.strut for strut in history.struts if strut.judged_on == BEYOND}
    playing = [record for record in figures if record.plays and record.loop.strut in beyond]
    if playing:
        most = max(playing, key=lambda record: record.elastic / record.stiffness)
        yield (
            f"{len(playing)} loops show lost motion; the rows of their struts hold the slope beyond it, their own "
            f"stiffness. The secant is at most {100.0 * (1.0 - most.stiffness / most.elastic):.2g} % less: "
            f"{most.loop.title}"
        )
    both = sorted(sided(figures, history))
    if both:
        yield f"tension and compression differ: a row of each side for {', '.join(both)}"
    softer: dict[str, dict[bool, str]] = {}  # strut -> in tension or not -> where first
    for record in figures:
        if max(record.tension, record.compression) > OTHER_SIDE * min(record.tension, record.compression):
            where = softer.setdefault(record.loop.strut, {})
            where.setdefault(record.tension < record.compression, record.loop.date or f"line {record.loop.line}")
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
    stood = [(record.loop.title, still) for record in figures if (still := record.standstill)]
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
    loops = [record.loop for record in figures if record.loop.serial]
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
    lacking = {record.loop.strut for record in figures if math.isnan(record.tension)}
    return {strut.strut for strut in history.struts if strut.sides is not None and strut.sides.p < SURE} - lacking
