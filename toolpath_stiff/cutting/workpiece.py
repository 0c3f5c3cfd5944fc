"""The stock and what the program takes from it: heights of the part at any point and time, by an index of cells.

A cell of the index lists the pieces that pass over it, in the order of time. A piece that lies nowhere in the cell
below what an earlier one left all over it is not listed; a query begins at the first piece that still counts at its
time. So neither levels nor passes lengthen a query, and there is no grid on which heights would be rounded.

Long programs are indexed in stages: what the pieces of one have outdone is not in the next.
"""

import importlib.util
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, numbered, portions, product
from toolpath_stiff.cutting.cells import PORTION, cells_of_boxes
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.envelopes import (
    CLEAR,
    Index,
    bounds,
    compiled,
    distance,
    foot,
    height_above,
    within,
)
from toolpath_stiff.cutting.stock import Stock
from toolpath_stiff.cutting.sweeps import PIECE, sweeps_of
from toolpath_stiff.nc.moves import Moves

# Of a line through the work, where what other tools have left is looked for, and the steps in which it is bounded.
SHARES = np.union1d(np.geomspace(1e-3, 0.0625, 7), np.linspace(1e-6, 1.0 - 1e-6, 9))
HALVINGS = 17
SLACK = 5e-7  # m by which other tools take more than they do: what two of them only touch is rounding
CELL = 0.33  # radii of the smallest cutter, size of a cell of the index
MANY = 500  # pieces from where on it pays to import numba: half a second
STAGE = 8192  # pieces
BEFORE = 1024  # pieces: between a station of the stage before and the first of a stage are fewer
# A piece in a cell, and m, bounds of the height that it leaves there.
ENTRY = np.dtype([("cell", np.int32), ("piece", np.int32), ("below", np.float64), ("above", np.float64)])
OFFSET = np.array([0.3819e-3, 0.2764e-3])  # m: walls at round coordinates shall not run along borders of cells


@dataclass(frozen=True)
class Workpiece:
    """The stock, the pieces that cut it, and the index of cells.

    Attributes
    ----------
    stock
        Before the first cut.
    pieces, first
        (m,) of `sweeps.PIECE`; (moves + 1,) the first piece of each move.
    until
        The pieces before this are in the index: it serves from those of the stage before on.
    corner, size, columns
        (2,) m of the lowest cell; m; number of cells along y.
    index
        (cells + 1,) first entry of each cell; (e,) piece of each entry, ascending in a cell; (e,) the first of its
        entries that counts after it; (e,) m, the piece leaves no less anywhere in the cell.
    quick
        Whether numba looks up.
    others
        The same work as tools with other axes cut it: (3, 3) from this frame into theirs, and it; without theirs.
    """

    stock: Stock
    pieces: AnyArray
    first: IntArray
    until: int
    corner: FloatArray
    size: float
    columns: int
    index: Index
    quick: bool
    others: tuple[tuple[FloatArray, "Workpiece"], ...] = ()

    @cached_property
    def key(self) -> IntArray:
        """(e,) cell * m + piece, ascending."""
        starts, piece = self.index[:2]
        return np.repeat(np.arange(len(starts) - 1), np.diff(starts)) * len(self.pieces) + piece

    @cached_property
    def has_levels(self) -> bool:
        """Whether all that is left stands level, between upright walls."""
        return not (self.others or self.pieces["slope"].any() or (self.pieces["flat"] < self.pieces["reach"]).any())

    def tops(
        self,
        x: FloatArray,
        y: FloatArray,
        window: tuple[IntArray, IntArray],
        slack_from: IntArray | None = None,
        slack: float = 0.0,
        ceiling: FloatArray | float = np.inf,
        enough: FloatArray | float = -np.inf,
    ) -> tuple[FloatArray, IntArray]:
        """(n,) m, height of what some pieces leave at points, and (n,) the last piece that left it; -1: the stock.

        The pieces are first <= piece < last of `window`, (n,) each. Of those from `slack_from` (n,) on the cutter is
        taken for smaller and higher by `slack`, m. A `ceiling` (n,) stands for what is higher; a height below `enough`
        (n,) may be any that is. Owners are right without them.
        """
        top, owner = np.minimum(self.stock.tops(x, y), ceiling), np.full(len(x), -1)
        late = np.full(len(x), len(self.pieces)) if slack_from is None else slack_from
        if self.quick:
            grid = self.corner, self.size, self.columns
            compiled()[1](
                self.pieces, grid, self.index, (x, y), window, (late, slack), (top, owner), np.full(len(x), enough)
            )
            return top, owner
        low, high = self._entries(x, y, window)
        counts = high - low
        for rows in portions(counts, PORTION):
            some = counts[rows]
            point, place = numbered(some)
            point += rows.start
            piece = self.index[1][low[point] + place]
            smaller = np.where(piece >= late[point], slack, 0.0)
            height = _heights(np.take(self.pieces, piece), x[point], y[point], smaller)
            hit = np.flatnonzero(some)
            if not len(hit):
                continue
            starts = (np.cumsum(some) - some)[hit]
            lowest, points = np.minimum.reduceat(height, starts), hit + rows.start
            level = np.repeat(lowest + CLEAR, some[hit])
            last = np.maximum.reduceat(np.where(height <= level, piece, -1), starts)
            cut = lowest <= top[points] + CLEAR
            top[points] = np.minimum(top[points], lowest)
            owner[points[cut]] = last[cut]
        return top, owner

    def standing(self, points: FloatArray, since: FloatArray, until: FloatArray) -> BoolArray:
        """(n,) whether what tools with other axes take on stretches of the path (n,) m leaves points (3, n)."""
        stands = np.full(points.shape[1], True)
        for turn, other in self.others:
            rows = np.flatnonzero(stands)
            x, y, z = product(turn, points[:, rows])
            first, last = (np.searchsorted(other.pieces["before"], path[rows]) for path in (since, until))
            top = other.tops(x, y, (first, last), np.zeros_like(first), -SLACK, enough=z)[0]
            stands[rows] = (top > z) & (other.stock.bottoms(x, y) < z)
        return stands

    def span(
        self, x: FloatArray, y: FloatArray, ends: tuple[FloatArray, FloatArray], since: FloatArray, until: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest place (n,) m at points between `ends` that tools with other axes leave, as `standing`."""
        low, high = (place.copy() for place in ends)
        rows = np.flatnonzero(high > low)
        if not self.others or not len(rows):
            return low, high
        base, size = ends[0], ends[1] - ends[0]

        def stands(some: IntArray, share: FloatArray) -> BoolArray:
            place = base[some] + share * size[some]
            return self.standing(np.stack([x[some], y[some], place]), since[some], until[some])

        found = np.array([stands(rows, np.full(len(rows), share)) for share in SHARES])
        high[rows[~found.any(axis=0)]] = -np.inf
        for limit, order in ((low, 1), (high, -1)):
            first, shares = found[::order].argmax(axis=0), SHARES[::order]
            cut = np.flatnonzero(first > 0)
            inner, outer, some = shares[first[cut]], shares[first[cut] - 1], rows[cut]
            for _ in range(HALVINGS):
                middle = 0.5 * (inner + outer)
                inside = stands(some, middle)
                inner, outer = np.where(inside, middle, inner), np.where(inside, outer, middle)
            limit[some] = base[some] + inner * size[some]
        return low, high

    def _entries(self, x: FloatArray, y: FloatArray, window: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
        """(n,) first entry, and (n,) the one after the last, to look at."""
        i = np.floor((x - self.corner[0]) / self.size).astype(np.int64)
        j = np.floor((y - self.corner[1]) / self.size).astype(np.int64)
        cell = np.where((i >= 0) & (j >= 0) & (j < self.columns), i * self.columns + j, -1) * len(self.pieces)
        low, high = (np.searchsorted(self.key, cell + piece) for piece in window)
        last = np.maximum(high - 1, 0)
        since = (window[0] == 0) & (high > low)
        low[since] = np.maximum(low[since], self.index[2][last[since]])
        none = cell < 0
        low[none] = high[none] = 0
        return low, np.maximum(high, low)


def stages_of(
    stock: Stock, moves: Moves, cutters: Mapping[int, Cutter], chosen: BoolArray, staged: bool = True
) -> Iterator[Workpiece]:
    """The stock with the pieces of the moves chosen (n,) up to one after the other; the last, or the only one, has all.

    Raises `ProgramError`.
    """
    pieces, first = sweeps_of(moves, cutters, chosen)
    quick = len(pieces) >= MANY and importlib.util.find_spec("numba") is not None
    if not len(pieces):
        pieces = np.zeros(1, PIECE)  # far from everything: its reach is 0
    low, high = _boxes(pieces)
    size = CELL * max(float(pieces["reach"].min()), 1e-6)
    corner = low.min(axis=0) - OFFSET - size
    low, high = (np.floor((ends - corner) / size).astype(np.int64) for ends in (low, high))
    rows, columns = (high.max(axis=0) + 1).tolist()
    entries = np.zeros(0, dtype=ENTRY)
    stage = STAGE if staged else len(pieces)
    for begin in range(0, len(pieces), stage):
        until = min(begin + stage, len(pieces))
        boxes = cells_of_boxes(low[begin:until], high[begin:until])
        new = (_bounded(pieces, begin + number, place, corner, size, columns, quick) for number, place in boxes)
        entries = np.concatenate([entries, *new])
        entries = entries[np.argsort(entries["cell"], kind="stable")]
        cell, piece, below, above = (np.ascontiguousarray(entries[name]) for name in ENTRY.names or ())
        starts = np.searchsorted(cell, np.arange(rows * columns + 1))
        outdone = np.minimum(_outdone(cell, below, above), starts[cell + 1])
        kept = outdone > np.arange(len(cell))
        before = np.append(0, np.cumsum(kept))
        counts_from = np.searchsorted(np.maximum.accumulate(before[outdone[kept]]), np.arange(before[-1]), side="right")
        index = before[starts], piece[kept].astype(np.int64), counts_from, below[kept]
        kept &= ~_redone(cell, below, np.where(piece < until - BEFORE, above, np.inf))
        entries = entries[kept]
        del cell, piece, below, above, outdone, before, counts_from, kept  # while the stage is looked into
        yield Workpiece(stock, pieces, first, until, corner, size, columns, index, quick)


def _bounded(
    pieces: AnyArray, piece: IntArray, cell: IntArray, corner: FloatArray, size: float, columns: int, quick: bool
) -> AnyArray:
    """Entries (k,) of pieces in cells that they pass, some of those (e, 2) given."""
    x, y = (corner + (cell + 0.5) * size).T
    half = float(size / np.sqrt(2.0)) + 1e-6  # of a cell's diagonal, and a little for rounding
    rows = np.empty((3, len(piece)))
    if quick:
        compiled()[0](pieces, piece, np.ascontiguousarray(x), np.ascontiguousarray(y), half, rows)
    else:
        part = pieces[piece]
        for arc in (False, True):
            some = np.flatnonzero((part["turn"] != 0.0) == arc)
            rows[:, some] = bounds(part[some], x[some], y[some], half, arc)
    far, below, above = rows
    reach = pieces["reach"][piece]
    near = np.flatnonzero(far <= reach + half)
    entries = np.empty(len(near), dtype=ENTRY)
    entries["cell"], entries["piece"] = (cell[:, 0] * columns + cell[:, 1])[near], piece[near]
    entries["below"], entries["above"] = below[near], np.where(far + half <= reach, above, np.inf)[near]
    return entries


def _heights(part: AnyArray, x: FloatArray, y: FloatArray, smaller: FloatArray) -> FloatArray:
    """(e,) m that pieces leave above the point of each row; inf: not passed."""
    heights, kind = np.full(len(x), np.inf), 2 * (part["turn"] != 0.0) + (part["slope"] != 0.0)
    for arc, sloped in ((False, False), (False, True), (True, False), (True, True)):
        rows = np.flatnonzero(kind == 2 * arc + sloped)
        if len(rows):
            some = part[rows]
            along, beside, spoke = foot(some, x[rows], y[rows], arc)
            near = distance(beside, within(along, some["extent"]) - along, spoke, arc) <= some["reach"] - smaller[rows]
            rows, some = rows[near], some[near]
            heights[rows] = height_above(some, along[near], beside[near], spoke[near], arc, sloped) + smaller[rows]
    return heights


def _boxes(pieces: AnyArray) -> tuple[FloatArray, FloatArray]:
    """(m, 2) m, lowest and highest x, y that each piece passes."""
    points = np.stack([np.stack(_along(pieces, share), axis=1) for share in (0.0, 0.5, 1.0)])
    bulge = np.where(pieces["turn"] != 0.0, pieces["radius"] * pieces["extent"] ** 2 / 32.0, 0.0)
    margin = (1.1 * bulge + pieces["reach"])[:, None]
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def _along(pieces: AnyArray, share: float) -> tuple[FloatArray, FloatArray]:
    """x, y, m, of the axis at a share of each piece."""
    place, arc = share * pieces["extent"], pieces["turn"] != 0.0
    angle = pieces["heading"] + pieces["turn"] * place
    radius = np.where(arc, pieces["radius"] + pieces["growth"] * place, place)
    return pieces["x"] + radius * np.cos(angle), pieces["y"] + radius * np.sin(angle)


def _outdone(cell: IntArray, below: FloatArray, above: FloatArray) -> IntArray:
    """(e,) the first entry of the cell that leaves less than each all over it; beyond the cell: none.

    By the least bound so far in each cell: a running minimum over all entries, the cells set apart by a large step.
    """
    highest = float(below.max(initial=0.0)) + 1e-4
    apart = (highest - float(below.min(initial=0.0)) + 1e-3) * cell
    bound = np.minimum.accumulate(np.minimum(above, highest) - apart)
    return np.searchsorted(-bound, CLEAR + apart - below, side="right")


def _redone(cell: IntArray, below: FloatArray, above: FloatArray) -> BoolArray:
    """(e,) whether a later entry of the cell leaves no more than each all over it."""
    highest = float(below.max(initial=0.0)) + 1e-4
    apart = (highest - float(below.min(initial=0.0)) + 1e-3) * (cell.max(initial=0) - cell)
    bound = np.minimum.accumulate((np.minimum(above, highest) - apart)[::-1])[::-1]
    return np.asarray(np.append(bound[1:], np.inf)[: len(cell)] + apart <= below + CLEAR)
