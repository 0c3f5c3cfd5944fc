"""Raw records of a stiffness test (ASME B5.54): force and displacement while the machine is jogged against a gauge.

The machine is jogged from zero to one extreme, to the other, and back to zero (the paper: 0, +200, -200, 0 um in steps
of 100 um), restrained by a force gauge; indicators read how far it really moved. With the jog y, the force F and the
displacement D read by the indicator, the deflection is y - D, and the paper's equation 12 is its secant between the
extremes:

    k = (F(+0.2 mm) - F(-0.2 mm)) / (0.4 mm - (D(+0.2 mm) - D(-0.2 mm)))

A strut measured alone on a bench is not jogged: the force is set and its own stretch D read, so that k is the slope of
the force over D between the extremes of the force.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TypedDict, cast

import numpy as np

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.errors import InputError, InputErrors, MeasurementError
from toolpath_stiff.readings.dates import Order, day_of, short_dates
from toolpath_stiff.readings.history import SURE, HistoryDocument, Readings, StrutEntry, history
from toolpath_stiff.readings.raw_cycles import closed_cycle, closed_cycles, ends_without_drift, stands_still, turns_of
from toolpath_stiff.readings.raw_files import raw_tables
from toolpath_stiff.readings.raw_labels import labelled, replaced, serial_number, settled
from toolpath_stiff.readings.raw_layouts import UNIT_WORDS
from toolpath_stiff.readings.raw_records import (
    COLUMNS,
    CONDITIONS,
    PLACE,
    SAME_JOG,
    Loop,
    is_table,
    read_raw,
    read_stiffnesses,
)
from toolpath_stiff.readings.raw_shape import Play, Shape, play_of, shape_of, sides_of
from toolpath_stiff.readings.rows import DATE, SOFTEST, STIFFEST
from toolpath_stiff.tables import Table, heading_key
from toolpath_stiff.units import certain, n_per_mm_from_n_per_m, um_from_m

USUAL = 5e3, 1e6  # N/mm, of machine tools' struts and spindles; assumed, to tell what a wrong unit may be


ONE_SIDE = 0.05  # of the range: a force set on a bench that goes less far to the other side is of one side


CLOSED = 3  # turns of the drive, from which the records hold a closed cycle


FIGURES = ("lost_motion_um", "loop_width_um", "linearity_percent", "closure_um")


@dataclass(frozen=True)
class LoopFigures:
    """What a loop says. SI; nan where it has too few records.

    Attributes
    ----------
    stiffness
        N/m, the paper's equation 12.
    force
        N, half the difference of the forces at the extremes; on a bench, of one side alone, the whole, compression
        negative.
    deflection
        m, between the extremes. Errors of jog and indicator count in proportion to it.
    lost_motion
        m, distance at zero force between the straight lines through the records of the two sides.
    loop_width
        m, largest difference in deflection at one force between going and coming.
    linearity
        Largest departure of the deflection from the secant on the way from extreme to extreme, as a share of the
        deflection between them.
    closure
        m, deflection at the end less that at the beginning.
    shape
        Kinks, two slopes, work lost.
    tension, compression
        N/m, slopes of the two sides of a strut on a bench; beyond the lost motion where there is any.
    beyond
        N/m, what the secant of a strut on a bench would be without lost motion (`raw_records.play_of`). nan
        without a closed cycle that reaches both sides.
    plays
        Whether the record shows lost motion.
    """

    stiffness: float
    force: float
    deflection: float
    lost_motion: float
    loop_width: float
    linearity: float
    closure: float
    shape: Shape
    tension: float = math.nan
    compression: float = math.nan
    beyond: float = math.nan
    plays: bool = False

    @property
    def elastic(self) -> float:
        """N/m, the strut's own stiffness: the secant, but the slope beyond lost motion where there is any."""
        return self.beyond if self.plays else self.stiffness

    @property
    def side(self) -> float:
        """1 of a tension that is stated, -1 of a compression, 0 where neither is."""
        return 0.0 if math.isnan(self.force) else math.copysign(1.0, self.force)


NO_UNITS: Mapping[str, str] = {}


COMPRESSION = re.compile(
    r"(?:compression|compressive|pressure|pushing|druck)(?:\s+(?:force|load|is|counts|as))*\s*[:=(]?\s*(?:positiv|pos\b|\+)"
    r"|(?:tension|tensile|pulling|zug)(?:\s+(?:force|load|is|counts|as))*\s*[:=(]?\s*(?:negativ|neg\b|-(?!\d))"
    r"|(?:positive?|\+)\s*(?:in|=|:|is|means)\s*(?:compression|compressive|druck)",
    re.IGNORECASE,
)


TENSION = re.compile(
    r"(?:tension|tensile|pulling|zug)(?:\s+(?:force|load|is|counts|as))*\s*[:=(]?\s*(?:positiv|pos\b|\+)"
    r"|(?:positive?|\+)\s*(?:in|=|:|is|means)\s*(?:tension|tensile|zug)",
    re.IGNORECASE,
)


NO_FIGURES = LoopFigures(*(math.nan,) * 7, Shape())


BEYOND = "slope beyond the lost motion"


OTHER_SIDE = (
    1.05  # ratio of two slopes of a loop from which it counts as softer on one side; assumed, twice the scatter
)


BLURRED = "secant, which its lost motion blurs: not every date has a closed cycle of both sides"


SECANT, IN_TENSION, IN_COMPRESSION = "secant", "slope in tension", "slope in compression"


OF_ONE_SIDE = ", which its lost motion blurs in records of one side alone"


STEPS = 3.0  # of the indicator, that it misses while it stands still, from which that is told of


def reduce_loop(loop: Loop) -> LoopFigures:
    """Stiffness by the paper's equation 12, and what the loop says about play, friction and linearity.

    Raises
    ------
    InputError
        The loop does not reach both sides, or gives no stiffness that could be.
    """
    where = {"file": loop.file or None, "line": loop.line}
    drive = loop.drive
    high, low = float(drive.max()), float(drive.min())
    if loop.jog is not None and not (low < -SAME_JOG and high > SAME_JOG):
        raise MeasurementError(
            f"{loop.title}: jogged from {um_from_m(low):g} to {um_from_m(high):g} um",
            expected="extremes on both sides of zero, as 0, +200, -200, 0 um",
            **where,  # type: ignore[arg-type]
        )
    turns = turns_of(drive)
    if len(turns) >= CLOSED:
        ends = ends_without_drift(drive, loop.force, loop.deflection, turns, loop.same)
        force, deflection = ends.force, ends.deflection
    else:
        at_high, at_low = drive >= high - loop.same, drive <= low + loop.same
        force = float(loop.force[at_high].mean() - loop.force[at_low].mean())
        deflection = float(loop.deflection[at_high].mean() - loop.deflection[at_low].mean())
    stiffness = force / deflection if deflection else math.inf
    if not SOFTEST <= n_per_mm_from_n_per_m(stiffness) <= STIFFEST:
        raise MeasurementError(
            f"{loop.title}: {force:g} N over a deflection of {um_from_m(deflection):g} um",
            expected=f"{SOFTEST:g} to {STIFFEST:g} N/mm",
            hint=_hint(loop, stiffness),
            **where,  # type: ignore[arg-type]
        )
    cycle = loop.part(closed_cycle(turns)) if len(turns) >= CLOSED else loop
    width = _loop_width(cycle)
    play = _play(loop, turns)
    sides = (math.nan, math.nan) if loop.jog is not None else _sides(loop, turns, width, gap=play.shown)
    beyond = force / (deflection - play.size)
    if play.shown:
        sides = _sides_beyond(sides, (high, -low), deflection - play.size)
    return LoopFigures(
        stiffness=stiffness,
        force=one_side * force if (one_side := side_of(loop)) else force / 2.0,
        deflection=deflection,
        lost_motion=_lost_motion(cycle, float(cycle.drive.max()), float(cycle.drive.min())),
        loop_width=width,
        linearity=_linearity(cycle, deflection),
        closure=float(loop.deflection[-1] - loop.deflection[0]),
        shape=shape_of(cycle.force, cycle.deflection, _ways(cycle), width),
        tension=sides[0],
        compression=sides[1],
        beyond=beyond,
        plays=play.shown,
    )


def _hint(loop: Loop, stiffness: float) -> str:
    """What may be wrong with a loop that gives no stiffness that could be."""
    if loop.jog is not None:
        return "force, jog and displacement count positive the same way; displacement is what the indicator read"
    if stiffness < 0.0:
        return (
            "tension and stretch are positive: one of the two columns counts the other way; turn its sign, "
            "or say --compression-positive (compression_positive=True)"
        )
    rules = "Tension and stretch are positive; a slope needs two forces"
    for factor, words in ((1e3, "the force in kN"), (1e-3, "the displacement in mm"), (1e6, "both in kN and mm")):
        if USUAL[0] <= factor * n_per_mm_from_n_per_m(stiffness) <= USUAL[1]:
            return f"is {words}? Name the unit in the heading (force_kN, displacement_mm): it is converted. {rules}"
    return rules


def side_of(loop: Loop) -> float:
    """1 of a bench record under tension alone, -1 under compression alone, 0 of any other loop."""
    if loop.jog is not None or not len(loop.force):
        return 0.0
    least = ONE_SIDE * float(np.ptp(loop.force))
    return 1.0 if loop.force.min() >= -least else -1.0 if loop.force.max() <= least else 0.0


def _lost_motion(loop: Loop, high: float, low: float) -> float:
    """Straight lines through the outer half of each side, both passes; their distance at zero force."""
    drive, same, at_zero = loop.drive, loop.same, []
    if not low < 0.0 < high or side_of(loop):
        return math.nan
    for outer in (drive >= 0.5 * high - SAME_JOG, drive <= 0.5 * low + SAME_JOG):
        force, deflection = loop.force[outer], loop.deflection[outer]
        if np.ptp(drive[outer]) < same or np.ptp(force) == 0.0:
            return math.nan
        centred = force - force.mean()
        slope = (centred @ deflection) / (centred @ centred)
        at_zero.append(float(deflection.mean() - slope * force.mean()))
    return at_zero[0] - at_zero[1]


def _ways(loop: Loop) -> list[slice]:
    """The records from one extreme to the other, whichever comes first, and of a closed cycle those back."""
    turns = turns_of(loop.drive)[:CLOSED]
    return [slice(one, other + 1) for one, other in pairwise(turns)]


def _sides(loop: Loop, turns: list[int], width: float, gap: bool) -> tuple[float, float]:
    """Slopes of the two sides in N/m; nan where they cannot be told from the width of a loop that does not close."""
    if len(turns) >= CLOSED:
        cycles = loop.part(closed_cycles(turns))
        return sides_of(cycles.force, cycles.deflection, drift=True, gap=gap)
    sides = sides_of(loop.force, loop.deflection)
    farthest = min(float(loop.force.max()), -float(loop.force.min()))
    return (math.nan, math.nan) if abs(1.0 / sides[0] - 1.0 / sides[1]) * farthest < width else sides


def _play(loop: Loop, turns: list[int]) -> Play:
    """The lost motion of a strut on a bench, of all its closed cycles."""
    if loop.jog is not None or len(turns) < CLOSED or side_of(loop):
        return Play(math.nan, False)
    records = closed_cycles(turns)
    cycles = loop.part(records)
    way = np.searchsorted(np.array(turns), np.arange(records.start, records.stop), side="right") % 2
    return play_of(cycles.force, cycles.deflection, np.where(way == 1, 1.0, -1.0))


def _sides_beyond(sides: tuple[float, float], reach: tuple[float, float], deflection: float) -> tuple[float, float]:
    """Slopes of the two sides in N/m without lost motion, which adds the same to the compliance of both.

    Their difference in compliance is kept; together they give the deflection (m) without it at the forces `reach`.
    """
    apart = 1.0 / sides[0] - 1.0 / sides[1]
    pushed = (deflection - apart * reach[0]) / sum(reach)
    pulled = pushed + apart
    return (1.0 / pulled, 1.0 / pushed) if min(pulled, pushed) > 0.0 else (math.nan, math.nan)


def _loop_width(loop: Loop) -> float:
    """The way from extreme to extreme against the way there and the way back, at the forces of the latter."""
    main = _ways(loop)[0]
    order = np.argsort(loop.force[main], kind="stable")
    force, deflection = loop.force[main][order], loop.deflection[main][order]
    other = np.r_[0 : main.start, main.stop : len(loop.force)].astype(int)
    other = other[(loop.force[other] >= force[0]) & (loop.force[other] <= force[-1])]
    if not len(other):
        return math.nan
    return float(np.abs(loop.deflection[other] - np.interp(loop.force[other], force, deflection)).max())


def _linearity(loop: Loop, deflection: float) -> float:
    main = _ways(loop)[0]
    force, read = loop.force[main], loop.deflection[main]
    secant = read[0] + (read[-1] - read[0]) * (force - force[0]) / (force[-1] - force[0])
    return float(np.abs(read - secant).max() / deflection)


@dataclass(frozen=True)
class Reduction:
    """Loops of a file of raw records with what they say, and what reading it left to be said.

    `history`: of struts measured alone, over their dates.
    """

    loops: tuple[Loop, ...]
    figures: tuple[LoopFigures, ...]
    notes: tuple[str, ...]
    history: HistoryDocument


def reduce(
    *raw: str | Path, date_order: Order | None = None, units: Mapping[str, str] = NO_UNITS, compression: bool = False
) -> Reduction:
    """Raw records of force and displacement to measured stiffnesses.

    Parameters
    ----------
    raw
        Files and folders of them: text, JSON, or FILE.xlsx[#SHEET]; or tables of struts' stiffnesses, whose history is
        looked at.
    date_order
        "dmy" or "mdy" of dates with slashes or dashes; None: what the dates of the set show.
    units
        "force", "displacement", "stiffness" -> the unit of headings that state none, as `units_of` gives them.
    compression
        Whether the forces of struts on a bench count compression positive.

    Raises
    ------
    InputError
        A file cannot be read, has not the right columns, or no records.
    InputErrors
        Bad records, or loops that give no stiffness, all of them.

    Examples
    --------
    >>> import tempfile
    >>> rows = ["x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um"]
    >>> rows += [f"0,0,800,X,{jog},{40 * jog},{0.2 * jog}" for jog in (0, 200, -200, 0)]
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(chr(10).join(rows)), file.flush()
    ...     found = reduce(file.name)
    >>> document(found)[0]["stiffness_N_per_mm"]
    50000.0
    """
    loops: list[Loop] = []
    figures: list[LoopFigures] = []
    notes: list[str] = []
    serials: list[tuple[str, str, str]] = []
    tables = [labelled(table) for table in raw_tables([str(file) for file in raw], COLUMNS, units)]
    for table in settled(tables, date_order):
        if is_table(table):
            records, known = read_stiffnesses(table)
            own = [replace(NO_FIGURES, stiffness=stiffness, force=force) for stiffness, force in known]
        else:
            records = read_raw(table)
            turned = compression or says_compression(table)
            if turned:
                records = records._replace(loops=[in_tension(loop) for loop in records.loops])
                notes.append(f"{table.file}: compression counts positive there; it is turned: tension is positive here")
            own = reduce_loops(records.loops)
        loops += records.loops
        figures += own
        serials += [
            (o.place["loop"], o.place.get(DATE, ""), serial_number(table, o.line))
            for o in records.loops
            if o.jog is None
        ]
        notes += [*table.notes, *records.notes]
    notes += [*_stuck(loops, figures), *replaced(serials)]
    found = _history(loops, figures)
    return Reduction(tuple(loops), tuple(figures), (*notes, *_to_bear_in_mind(loops, figures, found)), found)


def _to_bear_in_mind(loops: Sequence[Loop], figures: Sequence[LoopFigures], history: HistoryDocument) -> Iterator[str]:
    """What stands in the measurement file in place of a secant, and which of its rows are of a strut as it was."""
    own = {one["strut"] for one in history["struts"] if one["judged_on"] == BEYOND}
    pairs = zip(loops, figures, strict=True)
    playing = [(loop.title, one) for loop, one in pairs if one.plays and loop.place["loop"] in own]
    if playing:
        title, one = max(playing, key=lambda pair: pair[1].elastic / pair[1].stiffness)
        yield (
            f"{len(playing)} loops show lost motion; the rows of their struts hold the slope beyond it, their own "
            f"stiffness. The secant is at most {100.0 * (1.0 - one.stiffness / one.elastic):.2g} % less: {title}"
        )
    both = sorted(_sided(loops, figures, history))
    if both:
        yield f"tension and compression differ: a row of each side for {', '.join(both)}"
    for strut, (pulled, pushed) in _changing_places(loops, figures).items():
        yield (
            f"{strut}: softer in tension on {pulled}, in compression on {pushed}: does a file count compression "
            "positive? Its head may say so (compression positive)"
        )
    changed = {one["strut"]: one["changes"][-1]["before"] for one in history["struts"] if one["changes"]}
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


def differs(strut: StrutEntry) -> bool:
    """Whether a strut is told to differ in tension and compression."""
    return strut["sides"] is not None and strut["sides"]["p"] < SURE


def units_of(text: str) -> dict[str, str]:
    """Units of `N,um`: of a force, a displacement, a stiffness, in any order.

    Raises
    ------
    InputError
        A unit of none of these, or two of one.

    Examples
    --------
    >>> units_of("kN,mm")
    {'force': 'kn', 'displacement': 'mm'}
    """
    found: dict[str, str] = {}
    for part in text.split(","):
        unit = heading_key(part)
        if unit not in UNIT_WORDS or UNIT_WORDS[unit] in found:
            raise MeasurementError(f"units {text!r}", expected="those of force and displacement, as N,um, or N/um")
        found[UNIT_WORDS[unit]] = unit
    return found


def says_compression(table: Table) -> bool:
    """Whether a head says that compression counts positive. Raises `InputError` where it says both."""
    text = " ".join(cell for _, cells in table.above for cell in [*cells, "|"])
    pressed, pulled = COMPRESSION.search(text), TENSION.search(text)
    if pressed and pulled:
        raise MeasurementError(f"{pressed[0]!r} and {pulled[0]!r}", expected="one of them", file=table.file)
    return bool(pressed)


def in_tension(loop: Loop) -> Loop:
    """A loop of a bench with tension positive; its displacement counts the way that makes a stiffness positive."""
    if loop.jog is not None or not len(loop.force):
        return loop
    force = -loop.force
    way = 1.0 if float((force - force.mean()) @ (loop.displacement - loop.displacement.mean())) > 0.0 else -1.0
    return replace(loop, force=force, displacement=way * loop.displacement)


def stuck_at(loop: Loop, figures: LoopFigures) -> tuple[float, float, float] | None:
    """Where the indicator of a bench stood still while the force went on, as `stands_still`; None where it did not."""
    if loop.jog is not None or not len(loop.force):
        return None
    still = stands_still(loop.force, loop.displacement, turns_of(loop.drive))
    return still if still and abs(still[2] - still[1]) / figures.stiffness > STEPS * loop.resolution else None


def _stuck(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> list[str]:
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


def _history(loops: Sequence[Loop], figures: Sequence[LoopFigures]) -> HistoryDocument:
    """Struts measured alone over their dates; those of several lengths by length, as a strut's stiffness varies."""
    rows = [(loop, one) for loop, one in zip(loops, figures, strict=True) if loop.jog is None]
    lengths: dict[str, set[str]] = {}
    for loop, _ in rows:
        lengths.setdefault(loop.place["loop"], set()).add(loop.place.get("length_mm", ""))

    def readings(chosen: list[tuple[Loop, float, float]]) -> Readings:
        names = [loop.place["loop"] for loop, _, _ in chosen]
        some = [loop.place.get("length_mm", "") for loop, _, _ in chosen]
        shown = [f"{n}, {mm} mm" if len(lengths[n]) > 1 and mm else n for n, mm in zip(names, some, strict=True)]
        return Readings(
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
    found = history(readings(seen), readings(slopes or seen))
    for strut in found["struts"]:
        strut["judged_on"] = judged[strut["strut"].split(" alone")[0] + " alone"]
        if strut["judged_on"] not in ("", SECANT):
            strut["text"] = "; ".join(filter(None, [strut["text"], f"judged on the {strut['judged_on']}"]))
    return found


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


def document(reduction: Reduction) -> list[LoopEntry]:
    """One entry a loop in the shop's units; what a loop cannot say is None."""
    found = []
    for loop, one in zip(reduction.loops, reduction.figures, strict=True):
        numbers = {
            "stiffness_N_per_mm": n_per_mm_from_n_per_m(one.stiffness),
            "force_N": one.force,
            "deflection_um": um_from_m(one.deflection),
            "slope_N_per_mm": n_per_mm_from_n_per_m(one.beyond if one.plays else math.nan),
            "tension_N_per_mm": n_per_mm_from_n_per_m(one.tension),
            "compression_N_per_mm": n_per_mm_from_n_per_m(one.compression),
            **shop_figures(one),
        }
        shown = {name: round(value, 6) if math.isfinite(value) else None for name, value in numbers.items()}
        found.append(cast(LoopEntry, {"loop": loop.title, "line": loop.line, **shown, "shape": _shape(one.shape)}))
    return found


def _shape(shape: Shape) -> ShapeEntry:
    numbers = {
        "force_N": shape.force,
        "first_N_per_mm": n_per_mm_from_n_per_m(shape.first),
        "second_N_per_mm": n_per_mm_from_n_per_m(shape.second),
        "work_lost_mJ": 1e3 * shape.lost,
    }
    shown = {name: certain(value) if math.isfinite(value) else None for name, value in numbers.items()}
    return cast(ShapeEntry, {"kind": shape.kind, **shown, "text": str(shape)})


class ShapeEntry(TypedDict):
    """What stands out of a straight line; see `raw_records.Shape`."""

    kind: str
    force_N: float | None
    first_N_per_mm: float | None
    second_N_per_mm: float | None
    work_lost_mJ: float | None
    text: str


class LoopEntry(TypedDict):
    """A loop as `tps reduce --json` has it; `slope_N_per_mm`: beyond its lost motion, None where it shows none."""

    loop: str
    line: int
    stiffness_N_per_mm: float
    force_N: float | None
    deflection_um: float | None
    slope_N_per_mm: float | None
    tension_N_per_mm: float | None
    compression_N_per_mm: float | None
    lost_motion_um: float | None
    loop_width_um: float | None
    linearity_percent: float | None
    closure_um: float | None
    shape: ShapeEntry


def reduce_loops(loops: Iterable[Loop]) -> list[LoopFigures]:
    """Figures of every loop. Raises `InputErrors` that name all loops that give none."""
    figures, errors = [], []
    for loop in loops:
        try:
            figures.append(reduce_loop(loop))
        except InputError as error:
            errors.append(error)
    if errors:
        raise InputErrors(errors)
    return figures


def shop_figures(figures: LoopFigures) -> dict[str, float]:
    """`FIGURES` in the shop's units."""
    return {
        "lost_motion_um": um_from_m(figures.lost_motion),
        "loop_width_um": um_from_m(figures.loop_width),
        "linearity_percent": 100.0 * figures.linearity,
        "closure_um": um_from_m(figures.closure),
    }


def _rows_of(reduction: Reduction) -> list[tuple[Loop, LoopFigures]]:
    """Loops as they stand in a measurement file: struts with their own stiffness, two rows where the sides differ."""
    sided = _sided(reduction.loops, reduction.figures, reduction.history)
    mixed = {one["strut"] for one in reduction.history["struts"] if one["judged_on"] != BEYOND}
    found = []
    for loop, one in zip(reduction.loops, reduction.figures, strict=True):
        if loop.place.get("loop") in sided:
            high, low = float(loop.force.max()), float(loop.force.min())
            found.append((loop, replace(one, stiffness=one.tension, force=high)))
            found.append((loop, replace(one, stiffness=one.compression, force=low)))
        else:
            own = one.stiffness if loop.place.get("loop") in mixed else one.elastic
            found.append((loop, replace(one, stiffness=own)))
    return found


def _sided(loops: Sequence[Loop], figures: Sequence[LoopFigures], history: HistoryDocument) -> set[str]:
    """Struts that differ in tension and compression and whose loops all say so: rows of both would not be alike."""
    lacking = {loop.place.get("loop") for loop, one in zip(loops, figures, strict=True) if math.isnan(one.tension)}
    return {one["strut"] for one in history["struts"] if differs(one)} - lacking


def measurement_csv(reduction: Reduction) -> str:
    """A measurement file, one row a loop; of a strut that differs in tension and compression a row of each.

    A figure that some loop lacks is left out as a column.
    """
    loops, figures = zip(*_rows_of(reduction), strict=True)
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
