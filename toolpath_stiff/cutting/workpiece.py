"""The stock and what the program takes from it: heights of the part at any point and any time, by an index of cells.

A cell of the index lists the pieces that pass over it, in the order of time. A piece that lies nowhere in the cell
below what an earlier one left all over it is not listed; a query begins at the first piece that still counts at its
time. So neither levels nor passes lengthen a query, and there is no grid on which heights would be rounded.
"""

import importlib.util
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray
from toolpath_stiff.cutting.cells import cells_of_boxes, portions
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.stock import Stock
from toolpath_stiff.cutting.sweeps import FIELDS, PIECE, heights_above, nearest, rise, sweeps_of
from toolpath_stiff.nc.moves import Moves

CELL, COMPILED_CELL = 0.3, 0.12  # radii of the smallest cutter, size of a cell of the index
MANY = 3_000  # pieces from where on it pays to import numba: half a second
CLEAR = 1e-9  # m, height by which a piece must lie below another to outdo it
MOST_ENTRIES = 60_000_000  # of the index; larger cells beyond
OFFSET = np.array([0.3819e-3, 0.2764e-3])  # m: walls at round coordinates shall not run along borders of cells

Index = tuple[IntArray, IntArray, IntArray, FloatArray]


@dataclass(frozen=True)
class Workpiece:
    """The stock, the pieces that cut it, and the index of cells.

    Attributes
    ----------
    stock
        Before the first cut.
    pieces, first
        (m,) of `sweeps.PIECE`; (moves + 1,) the first piece of each move.
    corner, size, columns
        (2,) m of the lowest cell; m; number of cells along y.
    index
        (cells + 1,) first entry of each cell; (e,) piece of each entry, ascending in a cell; (e,) the first of its
        entries that counts after it; (e,) m, the piece leaves no less anywhere in the cell.
    compiled
        Whether numba looks up.
    """

    stock: Stock
    pieces: AnyArray
    first: IntArray
    corner: FloatArray
    size: float
    columns: int
    index: Index
    compiled: bool

    @cached_property
    def key(self) -> IntArray:
        """(e,) cell * m + piece, ascending."""
        starts, piece = self.index[:2]
        return np.repeat(np.arange(len(starts) - 1), np.diff(starts)) * len(self.pieces) + piece

    def tops(
        self,
        x: FloatArray,
        y: FloatArray,
        window: tuple[IntArray, IntArray],
        slack_from: IntArray | None = None,
        slack: float = 0.0,
    ) -> tuple[FloatArray, IntArray]:
        """(n,) m, height of what some pieces leave at points, and (n,) the last piece that left it; -1: the stock.

        The pieces are first <= piece < last of `window`, (n,) each. Of those from `slack_from` (n,) on the cutter is
        taken for smaller and higher by `slack`, m.
        """
        top, owner = self.stock.tops(x, y), np.full(len(x), -1)
        if self.compiled:
            late = np.full(len(x), len(self.pieces)) if slack_from is None else slack_from
            cells, index = (self.corner, self.size, self.columns, CLEAR), self.index
            _compiled().lowest(_table(self.pieces), cells, index, (x, y), window, (late, slack), (top, owner))
            return top, owner
        low, high = self._entries(x, y, window)
        counts = high - low
        for rows in portions(counts):
            some = counts[rows]
            point = np.repeat(np.arange(rows.start, rows.stop), some)
            entry = np.arange(len(point)) + np.repeat(low[rows] - np.cumsum(some) + some, some)
            piece = self.index[1][entry]
            smaller = np.zeros(len(point)) if slack_from is None else np.where(piece >= slack_from[point], slack, 0.0)
            part = np.take(_table(self.pieces), piece, axis=0).view(PIECE)[:, 0]
            height = heights_above(part, x[point], y[point], smaller)
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


def workpiece_of(stock: Stock, moves: Moves, cutters: Mapping[int, Cutter]) -> Workpiece:
    """The stock with all pieces of the program's cuts. Raises `ProgramError`."""
    pieces, first = sweeps_of(moves, cutters)
    if not len(pieces):
        none = np.zeros(0, dtype=np.int64)
        index = np.zeros(1, dtype=np.int64), none, none, np.zeros(0)
        return Workpiece(stock, np.zeros(1, PIECE), first, np.zeros(2), 1.0, 0, index, False)
    compiled = len(pieces) >= MANY and importlib.util.find_spec("numba") is not None
    low, high = _boxes(pieces)
    size = (COMPILED_CELL if compiled else CELL) * float(pieces["reach"].min())
    while float((np.ceil((high - low) / size) + 1.0).prod(axis=1).sum()) > MOST_ENTRIES:
        size *= 1.5
    corner = low.min(axis=0) - OFFSET - size
    low, high = (np.floor((ends - corner) / size).astype(np.int64) for ends in (low, high))
    columns = int(high[:, 1].max()) + 1
    if compiled:
        cells = corner, size, columns, CLEAR
        index = _compiled().index_of(_table(pieces), low, high, _half(size), cells)
    else:
        index = _index(pieces, low, high, corner, size)
    return Workpiece(stock, pieces, first, corner, size, columns, index, compiled)


def _compiled() -> ModuleType:
    """The compiled loops. numba comes with them: half a second, and some seconds to compile the first time."""
    from toolpath_stiff.cutting import compiled_sweeps

    return compiled_sweeps


def _index(pieces: AnyArray, low: IntArray, high: IntArray, corner: FloatArray, size: float) -> Index:
    """The index of the pieces between cells `low` and `high` (m, 2)."""
    columns = int(high[:, 1].max()) + 1
    parts = list(_rasters(pieces, low, high, corner, size))
    cell, piece, below, above = (np.concatenate([part[k] for part in parts]) for k in range(4))
    cell = cell[:, 0] * columns + cell[:, 1]
    order = np.argsort(cell, kind="stable")
    cell, piece, below, outdone = _without_outdone(cell[order], piece[order], below[order], above[order])
    counts_from = np.searchsorted(np.maximum.accumulate(outdone), np.arange(len(cell)), side="right")
    starts = np.searchsorted(cell, np.arange((int(cell[-1]) // columns + 1) * columns + 1))
    return starts, piece, counts_from, below


def _table(pieces: AnyArray) -> FloatArray:
    """(m, fields) of the pieces as numbers."""
    return np.asarray(pieces.view(np.float64).reshape(len(pieces), len(FIELDS)))


def _half(size: float) -> float:
    """Half of a cell's diagonal, m, and a little for rounding."""
    return float(size / np.sqrt(2.0)) + 1e-6


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


def _rasters(
    pieces: AnyArray, low: IntArray, high: IntArray, corner: FloatArray, size: float
) -> Iterator[tuple[IntArray, IntArray, FloatArray, FloatArray]]:
    """(k, 2) cells that pieces pass, in portions, (k,) the piece, and m, bounds of the height that it leaves there."""
    half = _half(size)
    for piece, cell in cells_of_boxes(low, high):
        part, middle = pieces[piece], corner + (cell + 0.5) * size
        place, distance = nearest(part, middle[:, 0], middle[:, 1])
        near = np.flatnonzero(distance <= part["reach"] + half)
        part, place, distance = part[near], place[near], distance[near]
        height = part["z"] + part["slope"] * place
        bottom = part["z"] + np.minimum(part["slope"] * part["extent"], 0.0)
        below = bottom + rise(part, np.clip(distance - half, 0.0, part["reach"]))
        above = np.where(distance + half <= part["reach"], height + rise(part, distance + half), np.inf)
        yield cell[near], piece[near], below, above


def _without_outdone(
    cell: IntArray, piece: IntArray, below: FloatArray, above: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, IntArray]:
    """Cell, piece and lower bound of the entries that are lowest somewhere in their time, and where they cease to be.

    By the lowest bound so far in each cell: a running minimum over all entries, the cells set apart by a large step.
    """
    highest = float(below.max()) + 1e-4
    apart = (highest - float(below.min()) + 1e-3) * cell
    bound = np.minimum.accumulate(np.minimum(above, highest) - apart)
    outdone = np.searchsorted(-bound, CLEAR + apart - below, side="right")
    outdone = np.minimum(outdone, np.searchsorted(cell, cell, side="right"))
    kept = outdone > np.arange(len(cell))
    before = np.append(0, np.cumsum(kept))
    return cell[kept], piece[kept], below[kept], before[outdone[kept]]
