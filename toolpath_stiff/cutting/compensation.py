"""A program shifted to compensate deflection: the mirror method, iterated with the engagement of the shifted path.

p' = p + e n, n into the work, e the mean over the wall's height of the error that the cut along p' makes (Law, Geddam,
J. Mater. Process. Technol. 138 (2003) 379, "mirror" compensation). The error of the surface against the drawing is then
that of the cut less the shift; what varies over the height no shift removes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import ArrayColumns, BoolArray, FloatArray, IntArray
from toolpath_stiff.documents import Document, certain, records, to_dict, without_nan
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.courses import move_lengths, points_along
from toolpath_stiff.nc.moves import Moves, ReadProgram
from toolpath_stiff.poses import Pose
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.rewriting.program import RewrittenProgram, shift_program
from toolpath_stiff.rewriting.side_shift import Shifts, SideShift, movable_rows
from toolpath_stiff.units import m_from_mm, mm_from_m, um_from_m

if TYPE_CHECKING:
    from toolpath_stiff.cutting.cut import Cut

LARGEST = 1e-4  # m, and half of the width of cut: a line that would be shifted by more is left alone
SETTLED = 5e-8  # m, half of the last decimal written: a change of the shift that is worth another turn
MOST_TURNS, SWINGING = 6, 0.9
SHORT = 3e-3  # m of a move, below which it is a part of a wall
SAME = 1e-7  # m by which the error of a wall may grow: rounding of the numbers written, and of the stock's grid
WORSE = "it would be worse"
ELSEWHERE = "other lines cut its wall afterwards"
BETWEEN = "it lies between two walls: what a shift removes from one it adds to the other"


@dataclass(frozen=True)
class Walls(ArrayColumns):
    """Stations at which the final walls of a program are made, and the walls' errors there. SI.

    Attributes
    ----------
    row, share
        (n,) of the untouched program's moves: the row, how far along it.
    shift
        (n,) m, how far left of that the station is.
    error
        (n, 2) m of the walls on the left and on the right against the drawing, mean over the height, + material left;
        nan where none is made there.
    spread
        (n, 2) m, the range of the error over the height.
    width, weight
        (n,) m: width of cut; length of path that the station stands for.
    """

    row: IntArray
    share: FloatArray
    shift: FloatArray
    error: FloatArray
    spread: FloatArray
    width: FloatArray
    weight: FloatArray

    @property
    def wanted(self) -> FloatArray:
        """(n,) m, shift to the left that removes the error; between two walls, the shift that makes neither worse."""
        both = np.stack([self.error[:, 0] + self.shift, self.shift - self.error[:, 1]], axis=1)
        size, alike = np.abs(both), both.prod(axis=1) > 0.0
        between = np.where(alike, np.minimum(size.mean(axis=1), 2.0 * size.min(axis=1)) * np.sign(both[:, 0]), 0.0)
        return np.asarray(np.where(np.isfinite(both).all(axis=1), between, np.nansum(both, axis=1)))


def walls_of(cut: Cut, written: Moves, row_of: IntArray, untouched: Moves) -> Walls:
    """Walls made by a program whose moves replace the rows `row_of` of the original program's moves."""
    rows = np.flatnonzero(np.isfinite(cut.wall_mean).any(axis=1))
    move, s = cut.samples.move[rows], cut.samples.s[rows]
    length = move_lengths(written)
    before = np.cumsum(length) - length
    along = np.clip((s - before[move]) / np.where(length > 0.0, length, 1.0)[move], 0.0, 1.0)
    first = np.unique(row_of, return_index=True)[1]  # rows ascend, and so do their first indices
    whole = np.bincount(row_of, length)[row_of[move]]
    start = before[first][np.searchsorted(row_of[first], row_of[move])]
    share, shift = places_beside(untouched, row_of[move], points_along(written, move, along)[0], (s - start) / whole)
    sides = np.array([-1.0, 1.0])
    return Walls(
        row=row_of[move],
        share=share,
        shift=shift,
        error=cut.wall_mean[rows] + sides * shift[:, None],
        spread=(cut.highest - cut.lowest)[rows, :2],
        width=cut.ae[rows],
        weight=cut.samples.weight[rows],
    )


def places_beside(moves: Moves, row: IntArray, points: FloatArray, near: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) share along moves of points' feet, and how far left of the move points lie, m; of turns the one `near`.

    An arc that stands on edge is straight in plan; `near` is also the share of a move that is a point there.
    """
    start, end, center, point = (
        place[:, 0] + 1j * place[:, 1] for place in (moves.start[row], moves.end[row], moves.arc_center[row], points)
    )
    chord = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        on_chord = (point - start) * np.conj(chord) / np.abs(chord)
        share, left = np.where(chord == 0.0, (near, 0.0 * near), (on_chord.real / np.abs(chord), on_chord.imag))
        sweep = moves.arc_sweep[row] * np.round(moves.arc_normal[row, 2])
        turned = np.angle((point - center) / (start - center))
        turned += 2.0 * np.pi * np.round((near * sweep - turned) / (2.0 * np.pi))
        share = np.where(sweep == 0.0, share, turned / sweep)
    radius = np.abs(start - center) + np.clip(share, 0.0, 1.0) * (np.abs(end - center) - np.abs(start - center))
    left = np.where(sweep == 0.0, left, np.sign(sweep) * (radius - np.abs(point - center)))
    return np.clip(share, 0.0, 1.0), left


def _by_row(walls: Walls) -> Iterator[tuple[int, IntArray]]:
    """Each row, and its stations."""
    order = np.argsort(walls.row, kind="stable")
    rows, first = np.unique(walls.row[order], return_index=True)
    yield from zip(rows.tolist(), np.split(order, first[1:]), strict=True)


def _shifts(walls: Walls, shift: FloatArray) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Shifts of moves, mm to the left, from the shifts (n,) m at the stations of their walls."""
    shifts, wanted = {}, mm_from_m(shift)
    for row, some in _by_row(walls):
        shares, which = np.unique(walls.share[some], return_inverse=True)
        means = np.bincount(which, wanted[some]) / np.bincount(which)
        knots = np.union1d(shares, [0.0, 1.0])
        shifts[row] = (knots, np.interp(knots, shares, means))
    return shifts


def _too_far(walls: Walls) -> dict[int, str]:
    """Rows whose shift is beyond the limit, with the reason."""
    reasons, wanted = {}, np.abs(walls.wanted)
    for row, some in _by_row(walls):
        shift, ae = um_from_m(float(wanted[some].max())), um_from_m(float(walls.width[some].max()))
        limit = min(um_from_m(LARGEST), ae / 2.0)
        if shift > limit:
            what = "the limit" if limit < ae / 2.0 else "half of the width of cut"
            reasons[row] = f"its shift of {shift:.1f} um is beyond {what}, {limit:.1f} um"
    return reasons


def figures_of_walls(walls: Walls, rows: int) -> dict[str, FloatArray]:
    """Figures by move and side, (rows, 2): length m, mean error, mean size, rms, peak, mean range, shift; SI."""
    station, side = np.nonzero(np.isfinite(walls.error))
    key, size, error = walls.row[station] * 2 + side, 2 * rows, walls.error[station, side]
    weight = np.maximum(walls.weight[station], 1e-12)
    length = np.bincount(key, weight, size)
    into = np.where(side == 0, 1.0, -1.0) * walls.shift[station]
    values = {"error": error, "size": np.abs(error), "spread": walls.spread[station, side], "shift": into}
    with np.errstate(invalid="ignore"):
        means = {name: np.bincount(key, weight * column, size) / length for name, column in values.items()}
    means["rms"] = np.sqrt(np.bincount(key, weight * error**2, size) / np.where(length > 0.0, length, np.nan))
    peak = np.full(size, np.nan)
    np.fmax.at(peak, key, np.abs(error))
    return {name: column.reshape(rows, 2) for name, column in {**means, "peak": peak, "length": length}.items()}


@dataclass(frozen=True, eq=False, repr=False)
class Compensation(Result):
    """A program shifted to compensate the deflection at its final walls, and the effect on each wall.

    Attributes
    ----------
    rewritten
        The program as written; the untouched one where nothing could be shifted.
    lines
        A row per line of the program and side of its feed on which it makes a final wall, by columns: line, side,
        length_mm, shift_um (mean, + into the work); of the mean over the wall's height, mean and mean size along the
        line and the largest, before and after (error, size, peak; um, + material left); spread_um, the mean range over
        the height, which no shift removes; left_alone, the reason or "". Nan after, where other lines make it then.
    before, after
        Surface errors of the untouched and of the written program.
    shift
        (n,) m to the left of the feed at each sample of `before`.
    turns
        Of the iteration, the programs that were written and cut.
    course_error_um
        How far courses are from their shift where that varies along a move.
    notes
        What the user should know, one sentence each.
    """

    command: ClassVar[str] = "compensate"
    shown_by: ClassVar[str] = "compensation"

    rewritten: RewrittenProgram
    lines: Mapping[str, list[Any]]
    before: Cut
    after: Cut
    shift: FloatArray
    turns: int
    course_error_um: float
    notes: tuple[str, ...]

    @property
    def walls(self) -> Document:
        """Figures over all walls: length, mean size before and after, share left, worst, range over the height.

        Those left alone are included.
        """
        columns = {name: np.array(self.lines[name]) for name in self.lines if name.endswith(("_um", "_mm"))}
        length = columns["length_mm"]
        before, after, spread = (
            float(np.nansum(columns[name] * length) / length[np.isfinite(columns[name])].sum())
            for name in ("size_before_um", "size_after_um", "spread_um")
        )
        return {
            "length_mm": float(length.sum()),
            "mean_before_um": before,
            "mean_after_um": after,
            "left_percent": 100.0 * after / before if before else 0.0,
            "worst_before_um": float(columns["peak_before_um"].max()),
            "worst_after_um": float(np.nanmax(columns["peak_after_um"])),
            "mean_range_um": spread,
        }

    @property
    def changed(self) -> bool:
        """True if any part of the program was shifted."""
        return bool(np.abs(self.lines["shift_um"]).max() > 1e-3)  # less is rounding

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command."""
        names = ("turns", "course_error_um", "notes")
        document = {"program": self.rewritten.name, "changed": self.changed, "walls": self.walls}
        document["lines"] = records(self.lines)
        return dict(certain(without_nan(to_dict(document | {name: getattr(self, name) for name in names}))))

    def to_frame(self) -> DataFrame:
        """A row per line and side, as `lines`."""
        return frame_of(dict(self.lines))

    def _short(self) -> str:
        walls = self.walls
        return f"{self.rewritten.name}, {walls['mean_before_um']:.2f} to {walls['mean_after_um']:.2f} um"

    def save(self, file: str | Path) -> Path:
        """Write the program, completely or not at all."""
        return self.rewritten.save(file)


def compensate_program(
    program: ReadProgram,
    origin: Pose,
    evaluate: Callable[[ReadProgram], Cut],
    reread: Callable[[str], ReadProgram],
    *,
    decimals: int | None = None,
    control: Controller = UNKNOWN_CONTROL,
) -> Compensation:
    """A program shifted to compensate the deflection at its final walls, and the effect on each wall.

    Parameters
    ----------
    program, origin
        As read, where its zero sits.
    evaluate, reread
        The surface errors of a program; a program that was written, read as this one was.
    decimals, control
        As of `rewriting.program.shift_program`.

    Raises
    ------
    InputError
        The program makes no final wall, or a block cannot be rewritten, with its line.
    """
    moves = program.moves
    cut = before_cut = evaluate(program)
    before = walls_of(cut, moves, np.arange(len(moves)), moves)
    if not len(before.row):
        raise ProgramError("no pass makes a wall of the finished part", file=program.name)
    still = np.unique(before.row[~movable_rows(moves)[before.row]]).tolist()
    alone = dict.fromkeys(still, "a plunge, a vertical arc, or a tilted tool")
    alone |= _too_far(before)
    fixed = shift_program(program, origin, {}, decimals=decimals, control=control)[2]
    alone |= {
        row: f"{fixed[row]}: put the shift into the tool's wear" for row in fixed.keys() & set(before.row.tolist())
    }
    changes, turn = [_quantile(before.wanted)], 0
    shifts = _shifts(before, before.wanted)
    while True:
        turn += 1
        shifts |= {row: (shifts[row][0], 0.0 * shifts[row][1]) for row in alone.keys() & shifts.keys()}
        side = SideShift(moves, shifts, fixed)
        alone = side.refused | alone
        rewritten, row_of, _ = shift_program(program, origin, side.courses, decimals=decimals, control=control)
        read = reread(rewritten.text)
        cut = evaluate(read)
        after = walls_of(cut, read.moves, np.array(row_of, dtype=np.int64), moves)
        change = after.wanted - _intended(shifts, after)
        changes.append(_quantile(change[~np.isin(after.row, list(alone))]))
        if changes[-1] > SETTLED and turn < MOST_TURNS:
            # Half a step if it oscillates. A wall that another pass makes in this turn keeps its shift.
            back = 0.5 if changes[-1] > SWINGING * changes[-2] else 0.0
            shifts |= _shifts(after, after.wanted - back * change)
            alone = _too_far(after) | alone
            continue
        spoilt = _spoilt(before, after, moves)
        if not spoilt or not side.courses:
            break
        # An unshifted wall is spoilt by others: leave its nearest shifted neighbours alone too, more of them each time.
        away = {row: min(abs(row - other) for other in spoilt) for row in shifts.keys() - alone.keys()}
        alone |= {row: WORSE for row, far in away.items() if far <= 2 * min(away.values())}
    shift = np.zeros(len(before_cut.samples))
    shift[np.isfinite(before_cut.wall_mean).any(axis=1)] = _intended(shifts, before)
    was, now = figures_of_walls(before, len(moves)), figures_of_walls(after, len(moves))
    return Compensation(
        rewritten, _lines(moves, was, now, alone), before_cut, cut, shift, turn,
        um_from_m(m_from_mm(side.error)), _notes(changes[-1], before_cut, rewritten),
    )  # fmt: skip


def _quantile(values: FloatArray) -> float:
    """Size below which 95 % of the values lie; 0 if there are none."""
    return float(np.quantile(np.abs(values), 0.95)) if len(values) else 0.0


def _intended(shifts: Shifts, walls: Walls) -> FloatArray:
    """(n,) m, the requested shift at each station."""
    intended = np.zeros(len(walls.row))
    for row, some in _by_row(walls):
        intended[some] = m_from_mm(np.interp(walls.share[some], *shifts[row])) if row in shifts else 0.0
    return intended


def _spoilt(before: Walls, after: Walls, moves: Moves) -> set[int]:
    """Rows of walls whose error grew, in mean size or rms, along the wall and in total over its length.

    One that is new counts against the worst there was. A move is a wall; moves shorter than `SHORT` that follow each
    other, as chords do, are one together.
    """
    short = move_lengths(moves) < SHORT
    wall = np.cumsum(np.where(short & np.roll(short, 1), 0, 1))
    was, now = (figures_of_walls(replace(walls, row=wall[walls.row]), int(wall[-1]) + 1) for walls in (before, after))
    worse, made = np.zeros(now["length"].shape, dtype=bool), was["length"] > 0.0
    for name in ("size", "rms"):
        base = np.where(made, was[name], np.nanmax(was[name]))
        # A line that makes less of the wall than before may have lost the part with the smaller error.
        whole = now[name] * now["length"] > (base + SAME) * was["length"]
        worse |= (now[name] - base > SAME) & whole
    spoilt: BoolArray = np.asarray(worse.any(axis=1))[wall[before.row]]
    return set(np.unique(before.row[spoilt]).tolist())


def _lines(
    moves: Moves, was: Mapping[str, FloatArray], now: Mapping[str, FloatArray], alone: Mapping[int, str]
) -> dict[str, list[Any]]:
    """Columns of `Compensation.lines`."""
    row, side = np.nonzero(was["length"] > 0.0)
    columns: dict[str, list[Any]] = {
        "line": moves.line[row].tolist(),
        "side": np.array(["left", "right"])[side].tolist(),
        "length_mm": mm_from_m(was["length"][row, side]).tolist(),
        "shift_um": um_from_m(np.nan_to_num(now["shift"][row, side])).tolist(),
    }
    for name in ("error", "size", "peak"):
        before, after = was[name][row, side], now[name][row, side]
        columns[f"{name}_before_um"] = um_from_m(before).tolist()
        columns[f"{name}_after_um"] = um_from_m(after).tolist()
    columns["spread_um"] = um_from_m(now["spread"][row, side]).tolist()
    between = (was["length"] > 0.0).all(axis=1) & (np.abs(now["shift"]).max(axis=1) < 0.05 * was["size"].max(axis=1))
    reasons = np.where(between[row], BETWEEN, np.where(np.isnan(now["size"][row, side]), ELSEWHERE, ""))
    columns["left_alone"] = [alone.get(r, reason) for r, reason in zip(row.tolist(), reasons.tolist(), strict=True)]
    return columns


def _notes(change: float, cut: Cut, rewritten: RewrittenProgram) -> tuple[str, ...]:
    notes = [*rewritten.notes, *cut.lines_warning(cut.turning, "not shifted: the tool turns along the move")]
    if change > SETTLED:
        notes.append(f"the iteration did not converge: its last step changed shifts by {um_from_m(change):.2f} um")
    return (*notes, "floors are not compensated")
