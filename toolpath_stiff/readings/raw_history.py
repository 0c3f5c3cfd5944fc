"""Raw records of struts over their dates: by which figure they are compared, and what is to be borne in mind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.readings.dates import day_of, short_dates
from toolpath_stiff.readings.history import StrutHistory, StrutOverTime, history
from toolpath_stiff.readings.loop_figures import LoopFigures, side_of, stuck_at
from toolpath_stiff.readings.mapping import DATE
from toolpath_stiff.readings.raw_records import Loop
from toolpath_stiff.readings.strut_series import SURE, StrutReadings
from toolpath_stiff.units import um_from_m

OTHER_SIDE = 1.05  # ratio of two slopes of a loop from which one side counts as softer; assumed, twice the scatter
# What the records of a strut are compared by.
BEYOND = "slope beyond the lost motion"
BLURRED = "secant, which its lost motion blurs: not every date has a closed cycle of both sides"
SECANT, IN_TENSION, IN_COMPRESSION = "secant", "slope in tension", "slope in compression"
OF_ONE_SIDE = ", which its lost motion blurs in records of one side alone"


def struts_over_dates(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> StrutHistory:
    """Struts measured alone over their dates; those of several lengths by length, as a strut's stiffness varies."""
    rows = [(loop, one) for loop, one in zip(loops, figures, strict=True) if loop.jog is None]
    lengths: dict[str, set[str]] = {}
    for loop, _ in rows:
        lengths.setdefault(loop.place["loop"], set()).add(loop.place.get("length_mm", ""))

    def readings(chosen: list[tuple[Loop, float, float]]) -> StrutReadings:
        names = [loop.place["loop"] for loop, _, _ in chosen]
        some = [loop.place.get("length_mm", "") for loop, _, _ in chosen]
        shown = [f"{n}, {mm} mm" if len(lengths[n]) > 1 and mm else n for n, mm in zip(names, some, strict=True)]
        return StrutReadings(
            np.array(shown, dtype=str),
            np.array([day_of(loop.place.get(DATE, "")) for loop, _, _ in chosen]),
            np.log([stiffness for _, stiffness, _ in chosen]),
            np.array([side for _, _, side in chosen]),
            short_dates(loop.place.get(DATE, "") for loop, _, _ in chosen),
        )

    rows = [(loop, one) for loop, one in rows if not stuck_at(loop, one)]
    judged = {name: _judged(name, rows) for name in lengths}
    seen = [(loop, *_seen(loop, one, judged[loop.place["loop"]])) for loop, one in rows]
    slopes = [(loop, k, s) for loop, one in rows for k, s in ((one.tension, 1.0), (one.compression, -1.0))]
    slopes = [one for one in slopes if math.isfinite(one[1])]
    over_time = history(readings(seen), readings(slopes or seen))
    return replace(over_time, struts=[_with_figure(one, judged) for one in over_time.struts])


def _with_figure(strut: StrutOverTime, judged: Mapping[str, str]) -> StrutOverTime:
    """The same with the figure that its dates were compared by."""
    figure = judged[strut.strut.split(" alone")[0] + " alone"]
    said = figure not in ("", SECANT)
    text = "; ".join(filter(None, [strut.text, f"judged on the {figure}" if said else ""]))
    return replace(strut, judged_on=figure, text=text)


def _judged(name: str, rows: Sequence[tuple[Loop, LoopFigures]]) -> str:
    """What all records of a strut can be compared by."""
    own = [(loop, one) for loop, one in rows if loop.place["loop"] == name]
    recorded = [(loop, one) for loop, one in own if len(loop.force)]
    if not recorded:
        return ""
    both = [one for loop, one in recorded if not side_of(loop)]
    play = any(one.plays for one in both)
    if len(recorded) == len(own):
        if side := _shared_side({side_of(loop) for loop, _ in recorded}, both):
            return side + (OF_ONE_SIDE if play else "")
        if play and all(math.isfinite(one.beyond) for _, one in own):
            return BEYOND
    return BLURRED if play else SECANT


def _shared_side(sides: set[float], both: Sequence[LoopFigures]) -> str:
    """The side that every record has, where some have no other (`both`: those with either); else nothing."""
    if len(sides) != 2 or 0.0 not in sides or not all(math.isfinite(one.tension) for one in both):
        return ""
    return IN_TENSION if 1.0 in sides else IN_COMPRESSION


def _seen(loop: Loop, one: LoopFigures, judged: str) -> tuple[float, float]:
    """Stiffness in N/m by which a record is compared with others, and the side on which that is."""
    side = side_of(loop) if len(loop.force) else one.side
    if judged == BEYOND:
        return one.beyond, side
    if judged.startswith(IN_TENSION) and not side:
        return one.tension, 1.0
    if judged.startswith(IN_COMPRESSION) and not side:
        return one.compression, -1.0
    return one.stiffness, side


def remarks(loops: Sequence[Loop], figures: Sequence[LoopFigures], history: StrutHistory) -> Iterator[str]:
    """What stands in the measurement file in place of a secant, and which of its rows are of a strut as it was."""
    own = {one.strut for one in history.struts if one.judged_on == BEYOND}
    pairs = zip(loops, figures, strict=True)
    playing = [(loop.title, one) for loop, one in pairs if one.plays and loop.place["loop"] in own]
    if playing:
        title, one = max(playing, key=lambda pair: pair[1].elastic / pair[1].stiffness)
        yield (
            f"{len(playing)} loops show lost motion; the rows of their struts hold the slope beyond it, their own "
            f"stiffness. The secant is at most {100.0 * (1.0 - one.stiffness / one.elastic):.2g} % less: {title}"
        )
    both = sorted(sided(loops, figures, history))
    if both:
        yield f"tension and compression differ: a row of each side for {', '.join(both)}"
    for strut, (pulled, pushed) in _changing_places(loops, figures).items():
        yield (
            f"{strut}: softer in tension on {pulled}, in compression on {pushed}: does a file count compression "
            "positive? Its head may say so (compression positive)"
        )
    changed = {one.strut: one.changes[-1].before for one in history.struts if one.changes}
    for strut, since in changed.items():
        yield f"{strut} changed: leave out its rows before {since} for diagnose and update, which take all dates as one"


def _changing_places(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> dict[str, tuple[str, str]]:
    """Struts that are softer in tension on one date and in compression on another: which dates."""
    softer: dict[str, dict[bool, str]] = {}
    for loop, one in zip(loops, figures, strict=True):
        if max(one.tension, one.compression) > OTHER_SIDE * min(one.tension, one.compression):
            found = softer.setdefault(loop.place["loop"], {})
            found.setdefault(one.tension < one.compression, loop.place.get(DATE, "") or f"line {loop.line}")
    return {name: (found[True], found[False]) for name, found in softer.items() if len(found) > 1}


def standstills(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> list[str]:
    """A note where indicators stood still while the force went on."""
    tried = [(loop.title, stuck_at(loop, one)) for loop, one in zip(loops, figures, strict=True)]
    found = [(title, still) for title, still in tried if still]
    if not found:
        return []
    title, (displacement, start, end) = found[0]
    others = f"; so in {len(found) - 1} further loops" if len(found) > 1 else ""
    return [
        f"{title}: the indicator stands still at {um_from_m(displacement):g} um while the force goes on from "
        f"{start:.4g} to {end:.4g} N: at the end of its range? The stiffness is too high then, and does not count in "
        f"the history; leave out its row{others}"
    ]


def sided(loops: Sequence[Loop], figures: Sequence[LoopFigures], history: StrutHistory) -> set[str]:
    """Struts that differ in tension and compression and whose loops all say so: rows of both would not be alike."""
    lacking = {loop.place.get("loop") for loop, one in zip(loops, figures, strict=True) if math.isnan(one.tension)}
    struts = (one for one in history.struts if one.sides is not None and one.sides.p < SURE)
    return {one.strut for one in struts} - lacking
