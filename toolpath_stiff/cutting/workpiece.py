"""The stock less the program's cuts: heights of the part at any point and time, by an index of cells.

A cell of the index lists the pieces that pass over it, in the order of time. A piece that lies nowhere in the cell
below what an earlier one left all over it is not listed; a query begins at the first piece that still counts at its
time. So neither levels nor passes lengthen a query, and there is no grid on which heights would be rounded.

Long programs are indexed in stages: what the pieces of one have outdone is not in the next.

Where tools stand aslant the cells are cubes of the stock, a place is in the material if it stands below what each piece
leaves in the frame of its tilt, and heights are looked for along the tool.
"""

import importlib.util
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, numbered, portions
from toolpath_stiff.cutting.cells import PORTION, cells_of_boxes
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.envelopes import (
    CLEAR,
    ROUNDED,
    Grid,
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
from toolpath_stiff.path.sampling import Orient

# Shares of a line through the work at which the material left by other tools is sought, and bisections to bound it.
SHARES = np.union1d(np.geomspace(1e-5, 0.0625, 13), np.linspace(1e-7, 1.0 - 1e-7, 9))
HALVINGS = 20
# The front of the cutter would touch what the pieces just before have left: these are taken for smaller by SLACK. It is
# above the rounding of coordinates (4 decimals of a mm); a turn of the tool moves it on by much more. Tools with other
# axes take more by it: what two of them only touch is rounding.
SLACK = 5e-7  # m
CELL = 0.33  # radii of the smallest cutter, size of a cell of the index
MOST_CUBES = 1e6  # of a stock, for inclined tools
MANY = 500  # pieces from which on it pays to import numba: half a second
STAGE = 8192  # pieces
BEFORE = 1024  # pieces: between a station of the stage before and the first of a stage are fewer
Window = tuple[IntArray, ...]  # (n,) the first piece, the one after the last; the first of those just before
# A piece in a cell, and m, bounds of the height that it leaves there.
ENTRY = np.dtype([("cell", np.int32), ("piece", np.int32), ("below", np.float64), ("above", np.float64)])
OFFSET = np.array(
    [0.3819e-3, 0.2764e-3, 0.1459e-3]
)  # m: so that walls at round coordinates do not lie along the borders of cells


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
    tilts, turns
        (moves,) number of each move's tilt and (t, 3, 3) frames of tilts, as of `sweeps_of`.
    corner, size, columns
        (3,) m of the lowest cell; m; numbers of cells along y and along z.
    index
        (cells + 1,) first entry of each cell; (e,) piece of each entry, ascending in a cell; (e,) the first of its
        entries that counts after it; (e,) m, the piece leaves no less anywhere in the cell.
    quick
        Whether numba looks up.
    """

    stock: Stock
    pieces: AnyArray
    first: IntArray
    until: int
    tilts: IntArray
    turns: FloatArray
    corner: FloatArray
    size: float
    columns: tuple[int, int]
    index: Index
    quick: bool

    @property
    def tilted(self) -> bool:
        """True if any tool is not parallel to Z."""
        return len(self.turns) > 1

    @cached_property
    def key(self) -> IntArray:
        """(e,) cell * m + piece, ascending."""
        starts, piece = self.index[:2]
        return np.repeat(np.arange(len(starts) - 1), np.diff(starts)) * len(self.pieces) + piece

    @cached_property
    def has_levels(self) -> bool:
        """True if the remaining material has only level surfaces and vertical walls."""
        return not (self.tilted or self.pieces["slope"].any() or (self.pieces["flat"] < self.pieces["reach"]).any())

    def tops(
        self,
        x: FloatArray,
        y: FloatArray,
        window: Window,
        ceiling: FloatArray | float = np.inf,
        enough: FloatArray | float = -np.inf,
    ) -> tuple[FloatArray, IntArray]:
        """(n,) m, height left by some pieces of upright tools, and (n,) the last piece that left it; -1: the stock.

        A `ceiling` (n,) stands for what is higher; a height below `enough` (n,) may be any that is. Owners are right
        without them.
        """
        top = np.minimum(self.stock.tops(x, y), ceiling)
        return self.lowest(np.stack([x, y, np.zeros(len(x))]), np.zeros(len(x), dtype=np.int64), window, top, enough)

    def lowest(
        self, places: FloatArray, tilt: IntArray, window: Window, top: FloatArray, enough: FloatArray | float = -np.inf
    ) -> tuple[FloatArray, IntArray]:
        """(n,) m, lowest height above places (3, n), along the tools, left by some pieces, or `top`; the piece, or -1.

        `tilt` (n,): of a tool at the place, which pieces of other tilts are taken for larger than by `SLACK`.
        """
        top, owner = top.copy(), np.full(len(top), -1)
        first, last, late = window if len(window) == 3 else (*window, np.full(len(top), len(self.pieces)))
        if self.quick:
            grid = self.corner, self.size, *self.columns
            compiled()[1](
                (self.pieces, self.turns), grid, self.index, (*places, tilt), (first, last), (late, SLACK),
                (top, owner), np.full(len(top), enough),
            )  # fmt: skip
            return top, owner
        low, high = self._entries(places, first, last)
        counts = high - low
        for rows in portions(counts, PORTION):
            some = counts[rows]
            point, place = numbered(some)
            point += rows.start
            piece = self.index[1][low[point] + place]
            part = np.take(self.pieces, piece)
            smaller = np.where(piece >= late[point], SLACK, np.where(part["tilt"] == tilt[point], 0.0, -SLACK))
            x, y, z = in_frames(places[:, point], self.turns, part["tilt"])
            height = _heights(part, x, y, smaller) - z
            hit = np.flatnonzero(some)
            if not len(hit):
                continue
            starts = (np.cumsum(some) - some)[hit]
            lowest, points = np.minimum.reduceat(height, starts), hit + rows.start
            level = np.repeat(lowest + CLEAR, some[hit])
            last_piece = np.maximum.reduceat(np.where(height <= level, piece, -1), starts)
            cut = lowest <= top[points] + CLEAR
            top[points] = np.minimum(top[points], lowest)
            owner[points[cut]] = last_piece[cut]
        return top, owner

    def standing(self, points: FloatArray, tilt: IntArray, window: Window) -> BoolArray:
        """(n,) True where some pieces leave material at points (3, n), each in the frame of a tilt (n,)."""
        x, y, z = points
        if not self.tilted:
            return np.asarray((self.stock.bottoms(x, y) < z) & (self.tops(x, y, window, z + CLEAR, z)[0] > z))
        places = np.stack(in_frames(points, np.swapaxes(self.turns, 1, 2), tilt))
        x, y, z = places
        stands = (self.stock.bottoms(x, y) < z) & (self.stock.tops(x, y) > z)
        rows = np.flatnonzero(stands)
        some = tuple(values[rows] for values in window)
        stands[rows] = self.lowest(places[:, rows], tilt[rows], some, np.full(len(rows), np.inf), 0.0)[0] > 0.0
        return np.asarray(stands)

    def span(
        self,
        x: FloatArray,
        y: FloatArray,
        tilt: IntArray,
        ends: tuple[FloatArray | float, FloatArray | float],
        window: Window,
    ) -> tuple[FloatArray, FloatArray]:
        """(n,) m, lowest and highest place of material between `ends` on lines along tools; highest below lowest: none.

        Below the lower of the ends the highest place may be any that is.
        """
        if not self.tilted:
            return np.maximum(self.stock.bottoms(x, y), ends[0]), self.tops(x, y, window, ends[1], ends[0])[0]
        low, high = self.stock.through(x, y, np.swapaxes(self.turns[tilt], 1, 2))
        low, high = np.maximum(low, ends[0]), np.minimum(high, ends[1])
        rows = np.flatnonzero(high > low)
        base, size = low.copy(), high - low

        def stands(some: IntArray, share: FloatArray) -> BoolArray:
            place = np.stack([x[some], y[some], base[some] + share * size[some]])
            return self.standing(place, tilt[some], tuple(values[some] for values in window))

        for limit, shares in ((high, SHARES[::-1]), (low, SHARES)):
            first = np.full(len(rows), len(shares))
            for number, share in enumerate(shares):
                rest = np.flatnonzero(first == len(shares))
                found = stands(rows[rest], np.full(len(rest), share))
                first[rest[found]] = number
            high[rows[first == len(shares)]] = -np.inf
            rows, first = rows[first < len(shares)], first[first < len(shares)]
            cut = np.flatnonzero(first > 0)
            inner, outer, some = shares[first[cut]], shares[first[cut] - 1], rows[cut]
            for _ in range(HALVINGS):
                middle = 0.5 * (inner + outer)
                inside = stands(some, middle)
                inner, outer = np.where(inside, middle, inner), np.where(inside, outer, middle)
            limit[some] = base[some] + inner * size[some]
        return low, high

    def _entries(self, places: FloatArray, first: IntArray, last: IntArray) -> tuple[IntArray, IntArray]:
        """(n,) first entry to look at, and (n,) the one after the last."""
        i, j, k = np.floor((places - self.corner[:, None]) / self.size).astype(np.int64)
        wide, deep = self.columns
        inside = (i >= 0) & (j >= 0) & (j < wide) & (k >= 0) & (k < deep)
        cell = np.where(inside, (i * wide + j) * deep + k, -1) * len(self.pieces)
        low, high = (np.searchsorted(self.key, cell + piece) for piece in (first, last))
        before = np.maximum(high - 1, 0)
        since = (first == 0) & (high > low)
        low[since] = np.maximum(low[since], self.index[2][before[since]])
        none = cell < 0
        low[none] = high[none] = 0
        return low, np.maximum(high, low)


def stages_of(
    stock: Stock, moves: Moves, cutters: Mapping[int, Cutter], orient: Orient = np.asarray
) -> Iterator[Workpiece]:
    """One workpiece per stage, with the pieces cut up to the stage's end; the last has all of them.

    `orient` as of `sweeps_of`. Raises `ProgramError`.
    """
    pieces, first, tilts, turns = sweeps_of(moves, cutters, orient)
    quick = (len(pieces) >= MANY or len(turns) > 1) and importlib.util.find_spec("numba") is not None
    if not len(pieces):
        pieces = np.zeros(1, PIECE)  # a piece without effect: its reach is 0
    low, high = _boxes(pieces, turns, stock)
    size = CELL * max(float(pieces["reach"].min()), 1e-6)
    if len(turns) > 1:
        size = max(size, float((high.max(axis=0) - low.min(axis=0)).prod() / MOST_CUBES) ** (1.0 / 3.0))
    corner = low.min(axis=0) - OFFSET - size
    low, high = (np.floor((ends - corner) / size).astype(np.int64) for ends in (low, high))
    rows, wide, deep = (high.max(axis=0) + 1).tolist()
    entries = np.zeros(0, dtype=ENTRY)
    for begin in range(0, len(pieces), STAGE):
        until = min(begin + STAGE, len(pieces))
        boxes = cells_of_boxes(low[begin:until], high[begin:until])
        grid = corner, size, (wide, deep)
        new = (_bounded(pieces, turns, begin + number, place, grid, quick) for number, place in boxes)
        entries = np.concatenate([entries, *new])
        entries = entries[np.argsort(entries["cell"], kind="stable")]
        cell, piece, below, above = (np.ascontiguousarray(entries[name]) for name in ENTRY.names or ())
        starts = np.searchsorted(cell, np.arange(rows * wide * deep + 1))
        outdone = np.minimum(_outdone(cell, below, above), starts[cell + 1])
        kept = outdone > np.arange(len(cell))
        before = np.append(0, np.cumsum(kept))
        counts_from = np.searchsorted(np.maximum.accumulate(before[outdone[kept]]), np.arange(before[-1]), side="right")
        index = before[starts], piece[kept].astype(np.int64), counts_from, below[kept]
        kept &= ~_redone(cell, below, np.where(piece < until - BEFORE, above, np.inf))
        entries = entries[kept]
        del cell, piece, below, above, outdone, before, counts_from, kept  # free memory while the stage is in use
        yield Workpiece(stock, pieces, first, until, tilts, turns, *grid, index, quick)


def _bounded(pieces: AnyArray, turns: FloatArray, piece: IntArray, cell: IntArray, grid: Grid, quick: bool) -> AnyArray:
    """Entries (e,) for pairs (k,) of a piece and a cell (k, 3), for those where the piece passes the cell."""
    corner, size, (wide, deep) = grid
    tilted = len(turns) > 1
    x, y, z = in_frames((corner + (cell + 0.5) * size).T, turns, pieces["tilt"][piece])
    half = size * float(np.sqrt(0.75 if tilted else 0.5)) + 1e-6  # half a cell's diagonal, and a little for rounding
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
    near, all_over = far <= reach + half, far + half <= reach
    if tilted:  # the first piece that removes all of a cell counts, not how deep it goes
        near &= below < z + half
        taken = np.where(all_over & (above < z - half), 2.0 * CLEAR * (piece - len(pieces)), np.inf)
        below, above = np.minimum(-CLEAR, taken), taken
    passed = np.flatnonzero(near)
    entries = np.empty(len(passed), dtype=ENTRY)
    entries["cell"] = ((cell[:, 0] * wide + cell[:, 1]) * deep + cell[:, 2])[passed]
    entries["piece"] = piece[passed]
    entries["below"], entries["above"] = below[passed], np.where(all_over, above, np.inf)[passed]
    return entries


def _heights(part: AnyArray, x: FloatArray, y: FloatArray, smaller: FloatArray) -> FloatArray:
    """(e,) m, height that each row's piece leaves above the row's point; inf: not passed."""
    heights, kind = np.full(len(x), np.inf), 2 * (part["turn"] != 0.0) + (part["slope"] != 0.0)
    for arc, sloped in ((False, False), (False, True), (True, False), (True, True)):
        rows = np.flatnonzero(kind == 2 * arc + sloped)
        if len(rows):
            some = part[rows]
            along, beside, spoke = foot(some, x[rows], y[rows], arc)
            away = distance(beside, within(along, some["extent"]) - along, spoke, arc)
            near = away <= some["reach"] - smaller[rows] - ROUNDED
            rows, some = rows[near], some[near]
            heights[rows] = height_above(some, along[near], beside[near], spoke[near], arc, sloped) + smaller[rows]
    return heights


def in_frames(points: FloatArray, turns: FloatArray, tilt: IntArray) -> tuple[FloatArray, ...]:
    """x, y, z (n,) of points (3, n) in the frames of tilts (n,); unchanged if there is only one frame."""
    if len(turns) == 1:
        return tuple(points)
    turn = turns[tilt]
    return tuple(sum(points[i] * turn[:, i, j] for i in range(3)) for j in range(3))


def _boxes(pieces: AnyArray, turns: FloatArray, stock: Stock) -> tuple[FloatArray, FloatArray]:
    """(m, 3) m, lowest and highest x, y, z that each piece passes: for upright tools z is 0, else within the stock."""
    bulge = np.where(pieces["turn"] != 0.0, pieces["radius"] * pieces["extent"] ** 2 / 32.0, 0.0)
    margin = (1.1 * bulge + pieces["reach"])[:, None] * (1.0, 1.0, float(len(turns) > 1))
    places = [np.stack(_along(pieces, share)) for share in (0.0, 0.5, 1.0)]
    if len(turns) == 1:
        points = np.stack([place.T * (1.0, 1.0, 0.0) for place in places])
        return points.min(axis=0) - margin, points.max(axis=0) + margin
    points = np.stack(
        [np.stack(in_frames(place, np.swapaxes(turns, 1, 2), pieces["tilt"]), axis=1) for place in places]
    )
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    # Extended along the tool to the end of the stock.
    axis = turns[pieces["tilt"], :, 2]
    lowest, highest = stock.ends
    room = np.where(axis > 0.0, highest - low, high - lowest) / np.maximum(np.abs(axis), 1e-12)
    along = np.maximum(room.min(axis=1), 0.0)[:, None] * axis
    low, high = low + np.minimum(along, 0.0), high + np.maximum(along, 0.0)
    return np.clip(low, lowest, highest), np.clip(high, lowest, highest)


def _along(pieces: AnyArray, share: float) -> tuple[FloatArray, ...]:
    """x, y, z, m, of the tip at a share of each piece, in the frame of its tilt."""
    place, arc = share * pieces["extent"], pieces["turn"] != 0.0
    angle = pieces["heading"] + pieces["turn"] * place
    radius = np.where(arc, pieces["radius"] + pieces["growth"] * place, place)
    height = pieces["z"] + pieces["slope"] * place
    return pieces["x"] + radius * np.cos(angle), pieces["y"] + radius * np.sin(angle), height


def _outdone(cell: IntArray, below: FloatArray, above: FloatArray) -> IntArray:
    """(e,) first later entry of the cell that leaves less than this one everywhere in it; beyond the cell: none.

    By the least bound so far in each cell: a running minimum over all entries, the cells set apart by a large step.
    """
    highest = float(below.max(initial=0.0)) + 1e-4
    apart = (highest - float(below.min(initial=0.0)) + 1e-3) * cell
    bound = np.minimum.accumulate(np.minimum(above, highest) - apart)
    return np.searchsorted(-bound, CLEAR + apart - below, side="right")


def _redone(cell: IntArray, below: FloatArray, above: FloatArray) -> BoolArray:
    """(e,) True if a later entry of the cell leaves no more than this one everywhere in it."""
    highest = float(below.max(initial=0.0)) + 1e-4
    apart = (highest - float(below.min(initial=0.0)) + 1e-3) * (cell.max(initial=0) - cell)
    bound = np.minimum.accumulate((np.minimum(above, highest) - apart)[::-1])[::-1]
    return np.asarray(np.append(bound[1:], np.inf)[: len(cell)] + apart <= below + CLEAR)
