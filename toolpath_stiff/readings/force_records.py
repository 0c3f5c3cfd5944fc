"""Dynamometer records of slots: mean force over whole turns, without drift, and harmonics of the turn.

A file with neither a time nor a rate of sampling holds mean forces, a row per slot.

A turn cuts where its mean force is half of the strongest turns' or more, and is air where the force swings hardly more
than in the quietest. (Not where it swings: many teeth in a full slot make it swing less than its entry does.) Over a
radius of feed after entry and before exit the slot is not full, unless the second turn already pushes as the others.
The zero is a straight line through the air before and after. The speed of the spindle is taken from the record itself,
where its teeth are heard.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.readings.mapping import check_needed, mapped_table, number_columns
from toolpath_stiff.tables import Columns
from toolpath_stiff.units import m_from_mm, s_from_min

FORCES = ("fx_N", "fy_N", "fz_N")
FEEDS = ("feed_per_tooth_mm", "feed_mm_per_min")
ComplexArray = NDArray[np.complex128]
RATE = "sample_rate_Hz"  # instead of time_s
COLUMNS = Columns(numbers=("time_s", RATE, *FORCES, *FEEDS, "spindle_rpm", "depth_mm"), texts=("record",))
LAYOUT = (
    "time_s or sample_rate_Hz (neither: mean forces, a row a slot), fx_N, fy_N, fz_N, feed_per_tooth_mm or "
    "feed_mm_per_min, spindle_rpm, depth_mm; record, if several"
)
MEAN = "a mean force, taken as that of whole turns of the full slot, less what the dynamometer reads in air"
MOST_MEANS = 100  # rows of a file without a time: more are moments of a record
CUTS, AIR = 0.5, 1.5  # mean force of turns that cut, of the strongest's; swing of turns in air, of the quietest's
SLIGHT = 0.2  # of the swing: means no further apart are of one kind; that of one tooth in a slot is over a quarter
STEADY = 0.05  # of the mean force, within which a turn is as the usual one
STRONG = 90.0  # per cent of the turns that are weaker than the strongest, and stronger than the quietest
MOST_FORCE = 1e6  # N
LEAST_TURNS = 5  # of the full slot
SPEED_RANGE = 0.03  # relative range of spindle speed about the stated one
FINER = 8  # refinement of the search for the speed over the record's spectrum


def read_records(
    file: str, columns: Mapped, flutes: int
) -> Iterator[tuple[str, tuple[float, float, float], FloatArray, tuple[str, ...]]]:
    """Name, settings (feed m per tooth, depth m, turns a second) and rows (m, 4) s and N of each record; remarks.

    Raises
    ------
    InputError
        A column is missing, a cell is no number, a setting changes within a record, time does not rise.
    """
    table = mapped_table(file, "records of forces", COLUMNS, columns)
    feed = next((name for name in FEEDS if name in table.heading), FEEDS[0])
    clock = RATE if RATE in table.heading else "time_s"
    means = clock not in table.heading and len(table.rows) <= MOST_MEANS
    needed = ["fy_N", "depth_mm", feed, *(["spindle_rpm"] if not means or feed == FEEDS[1] else [])]
    check_needed(table, needed if means else [clock, *needed], LAYOUT)
    each = " line {}" if means else ""
    names = np.array([table.record(row).get("record", "") + each.format(line) for line, row in table.rows])
    lines = np.array([line for line, _ in table.rows])
    numbers = number_columns(table, (clock, *FORCES, "spindle_rpm", "depth_mm", feed))
    signal, (rate, depth, fed) = numbers[:, :4], numbers[:, 4:].T
    if clock == RATE:
        signal[:, 0] = np.arange(len(signal)) / signal[:, 0]
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)
        wrong = {"time_s": (np.diff(signal[rows, 0], prepend=-np.inf) <= 0.0, "later than the row before")}
        for setting, column in (("spindle_rpm", rate), ("depth_mm", depth), (feed, fed)):
            odd = (column[rows] != column[rows[0]]) | (column[rows] <= 0.0)
            wrong[setting] = odd, f"above 0 and the same in all rows of a record, {column[rows[0]]:g}"
        limit = f"at most {MOST_FORCE:g} N; is the unit right?"
        wrong |= {axis: (np.abs(signal[rows, k]) > MOST_FORCE, limit) for k, axis in enumerate(FORCES, 1)}
        for setting, (odd, expected) in wrong.items():
            if setting in (*needed, "time_s", *FORCES) and odd.any():
                row = int(rows[np.argmax(odd)])
                mistake = f"{setting} = {table.record(table.rows[row][1]).get(setting, '')}"
                raise MeasurementError(mistake, expected=expected, file=file, line=int(lines[row]))
        turns_a_second = float(rate[rows[0]]) / s_from_min(1.0)
        per_tooth = float(fed[rows[0]]) / (s_from_min(1.0) * turns_a_second * flutes if feed == FEEDS[1] else 1.0)
        settings = (m_from_mm(per_tooth), m_from_mm(float(depth[rows[0]])), turns_a_second)
        yield f"{file} {name.strip()}".strip(), settings, signal[rows], table.remarks


def mean_force(
    name: str, signal: FloatArray, rate: float, cutter: Cutter, feed: float, side: int
) -> tuple[FloatArray, ComplexArray, list[str]]:
    """(3,) N, mean force over the whole turns of the full slot; (2,) N, its `harmonics` sideways; remarks.

    Of a record that is a mean itself there are no harmonics: nan.

    Parameters
    ----------
    name
        Of the record, for messages.
    signal
        (m, 4) s and N, as recorded.
    rate
        Turns a second.
    cutter, feed
        Of the record; m per tooth.
    side
        Which force is across the feed.

    Raises
    ------
    MeasurementError
        The record does not hold enough whole turns of a full slot.
    """
    if np.isnan(signal[0, 0]):
        return signal[0, 1:], np.full(2, np.nan, complex), [MEAN]
    time, force = signal[:, 0] - signal[0, 0], signal[:, 1:]
    known = np.nan_to_num(force)
    remarks = []
    heard = _heard_rate(time, known, rate, cutter.flutes)
    if abs(heard / rate - 1.0) > 0.01:
        heard_speed, stated = (f"{s_from_min(1.0) * value:.0f}" for value in (heard, rate))
        remarks.append(f"the teeth pass at {heard_speed} turns a minute, not at {stated}")
    turn = np.floor(time * heard).astype(int)
    cutting, air = _cut_and_air(turn, known, int(np.ceil(cutter.radius / (feed * cutter.flutes))))
    if len(cutting) < LEAST_TURNS:
        raise MeasurementError(
            f"{name}: {len(cutting)} whole turns of the full slot",
            expected=f"{LEAST_TURNS} or more",
            hint="are spindle_rpm, feed and the cutter's diameter right?",
        )
    silent, zero = np.isin(turn, air), np.zeros(3)
    if len(air):
        order = 1 if air[0] < cutting[0] and air[-1] > cutting[-1] else 0
        line = np.polynomial.polynomial.polyfit(time[silent], known[silent], order)
        zero = np.polynomial.polynomial.polyval(time, line).T
    else:
        remarks.append("no air before or after the cut, the zero is as recorded")
    full = (turn >= cutting[0]) & (turn <= cutting[-1])
    cleared = (known - zero)[full]
    waves = harmonics(time[full] * heard, cleared[:, side], cutter.flutes)
    return np.where(np.isnan(force[0]), np.nan, cleared.mean(axis=0)), waves, remarks


def _cut_and_air(turn: IntArray, force: FloatArray, filling: int) -> tuple[IntArray, IntArray]:
    """Whole turns of the full slot, and turns in air; the slot is full `filling` turns after entry.

    `turn` (m,) of the forces (m, 3).
    """
    first = np.searchsorted(turn, np.arange(turn[-1] + 1))  # the last turn is not whole
    if len(first) <= LEAST_TURNS:
        return first[:0], first[:0]
    first, ending = first[:-1], first[-1]
    high, low = (extreme.reduceat(force[:ending], first) for extreme in (np.maximum, np.minimum))
    mean = np.add.reduceat(force[:ending], first) / np.diff(np.append(first, ending))[:, None]
    swing = (high - low).max(axis=1)
    quiet = np.percentile(swing, 100.0 - STRONG)
    push = np.linalg.norm(mean - np.median(mean[swing <= quiet], axis=0), axis=1)
    strong, slight = np.percentile(push, STRONG), SLIGHT * np.median(swing)
    aired = strong > slight
    runs = np.flatnonzero(push >= CUTS * strong if aired else push <= slight)
    cutting = max(np.split(runs, np.flatnonzero(np.diff(runs) > 1) + 1), key=len)
    if not aired:
        return cutting, first[:0]
    # Even where the swing hardly differs from that in air, first contact may already push.
    reach = min(filling // 10 + 1, (len(swing) - 1) // 2)
    touched = np.convolve(swing > AIR * quiet, np.ones(2 * reach + 1), "same") > 0.5
    usual = np.median(push[cutting])
    begin, end = (1 if abs(of / usual - 1.0) < STEADY else filling for of in push[cutting][[1, -2]])
    return cutting[begin : len(cutting) - end], np.flatnonzero(~touched & (push < CUTS * strong))


def _heard_rate(time: FloatArray, force: FloatArray, rate: float, flutes: int) -> float:
    """Turns a second at which the teeth pass, near the stated rate; the stated rate if no teeth are heard."""
    if time[-1] * rate < LEAST_TURNS:  # too short for the caller as well
        return rate
    count = FINER * len(time)
    even = np.linspace(time[0], time[-1], len(time))
    power = np.zeros(count // 2 + 1)
    for column in force.T:
        power += np.abs(np.fft.rfft(np.interp(even, time, column - column.mean()), count)) ** 2
    frequency = np.fft.rfftfreq(count, even[1] - even[0]) / flutes
    near = np.flatnonzero(np.abs(frequency / rate - 1.0) <= SPEED_RANGE)
    near = near[(near > 0) & (near < len(power) - 1)]
    if not len(near) or power[near].max() < 10.0 * np.median(power):
        return rate
    peak = int(near[np.argmax(power[near])])
    left, middle, right = np.sqrt(power[peak - 1 : peak + 2])
    bend = left - 2.0 * middle + right
    return float(frequency[peak] + (0.5 * (left - right) / bend if bend < 0.0 else 0.0) * frequency[1])


def harmonics(turns: FloatArray, force: FloatArray, flutes: int) -> ComplexArray:
    """(2,) N: components of forces (m,) N, after (m,) turns, that recur once a turn and once a tooth."""
    waves = np.exp(-2j * np.pi * np.array([[1], [flutes]]) * turns)
    return np.asarray((waves * force).mean(axis=1))
