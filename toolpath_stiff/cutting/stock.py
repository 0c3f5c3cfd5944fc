"""The stock: material on the table before the program runs, as heights of its top and underside over x and y."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.cutting.cells import cells_of_boxes
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_bytes
from toolpath_stiff.nc.courses import extents
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.units import m_from_mm, mm_from_m

MOST_CELLS = 20_000_000  # of an STL's grid, 320 MB


@dataclass(frozen=True)
class Stock:
    """Heights over cells of equal size in the set-up frame, SI; a box is a single cell.

    Attributes
    ----------
    corner, cell
        (2,) m, lowest x and y; (2,) m, size of a cell.
    top, bottom
        (nx, ny) m; top -inf: no material. Hollows below the top are taken as filled.
    origin
        Where this comes from, a sentence.

    Examples
    --------
    >>> [end.tolist() for end in box_stock((0.0, 0.0, -0.02), (0.1, 0.08, 0.0), "given").ends]
    [[0.0, 0.0, -0.02], [0.1, 0.08, 0.0]]
    """

    corner: FloatArray
    cell: FloatArray
    top: FloatArray
    bottom: FloatArray
    origin: str

    @property
    def ends(self) -> tuple[FloatArray, FloatArray]:
        """(3,) m, lowest and highest corner of the bounding box."""
        high = np.append(self.corner + self.cell * self.top.shape, self.top.max())
        return np.append(self.corner, self.bottom.min()), high

    def tops(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(n,) m, height of the top at points x, y; -inf outside the stock."""
        i, j, inside = self._cells(x, y)
        return np.where(inside, self.top[i, j], -np.inf)

    def bottoms(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(n,) m, height of the underside at points x, y."""
        i, j, _ = self._cells(x, y)
        return np.asarray(self.bottom[i, j])

    def through(self, x: FloatArray, y: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) m, where lines along z of frames enter the bounding box, and (n,) leave it; less: they miss it.

        `turn` (n, 3, 3): axes of its own frame as columns in those.
        """
        along = np.where(np.abs(turn[:, 2]) > 1e-12, turn[:, 2], 1e-12)
        beside = turn[:, 0] * x[:, None] + turn[:, 1] * y[:, None]
        first, second = ((end - beside) / along for end in self.ends)
        return np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)

    def _cells(self, x: FloatArray, y: FloatArray) -> tuple[IntArray, IntArray, BoolArray]:
        i, j = np.floor((x - self.corner[0]) / self.cell[0]), np.floor((y - self.corner[1]) / self.cell[1])
        inside = (i >= 0) & (j >= 0) & (i < self.top.shape[0]) & (j < self.top.shape[1])
        return np.where(inside, i, 0).astype(np.int64), np.where(inside, j, 0).astype(np.int64), inside


def box_stock(low: tuple[float, float, float], high: tuple[float, float, float], origin: str, file: str = "") -> Stock:
    """A box between two corners, m."""
    first, size = np.array(low[:2]), np.subtract(high, low)
    if not (size > 0.0).all():
        raise InputError(
            f"a stock of {' x '.join(f'{e:g}' for e in mm_from_m(size))} mm", expected="sizes > 0", file=file or None
        )
    return Stock(first, size[:2], np.array([[high[2]]]), np.array([[low[2]]]), origin)


def stock_of_extents(moves: Moves, cutters: Mapping[int, Cutter]) -> Stock:
    """A box around all cuts, grown by the largest cutter's radius; top at z = 0, or the highest level cut above it.

    An assumption: how much the first passes cut from the side is a guess then.
    """
    cuts = moves.take((moves.motion != RAPID) & (np.hypot(*(moves.end - moves.start)[:, :2].T) > 0.0))
    ends = extents(cuts)
    if not ends or max(0.0, ends["z"][1]) <= ends["z"][0]:
        raise InputError("no move cuts sideways below z = 0: they do not give a stock", hint="give the stock's box")
    radius = max(cutters[tool].radius for tool in np.unique(cuts.tool).tolist())
    low = tuple(m_from_mm(ends[axis][0]) - (radius if axis != "z" else 0.0) for axis in "xyz")
    high = tuple(m_from_mm(ends[axis][1]) + radius for axis in "xy")
    return box_stock(
        (low[0], low[1], low[2]),
        (high[0], high[1], max(0.0, m_from_mm(ends["z"][1]))),
        "assumed: the extents of the cuts grown by the cutter's radius, top at z = 0 or the highest cut",
    )


def stock_from_stl(path: str | Path, cell: float) -> Stock:
    """The body of an STL file (mm, program coordinates), sampled by a ray down the middle of each cell, m.

    Raises `InputError` where the file is none, or has more cells than fit into memory.
    """
    corners = m_from_mm(_triangles(Path(path)))
    low, high = corners.min(axis=(0, 1))[:2], corners.max(axis=(0, 1))[:2]
    count = np.maximum(np.ceil((high - low) / cell - 1e-9), 1.0)
    if count.prod() > MOST_CELLS:
        raise InputError(
            f"{count.prod():.0f} cells of {mm_from_m(cell):g} mm", expected=f"at most {MOST_CELLS}",
            hint="the STL is in mm; a smaller body or a larger cutter has fewer", file=str(path),
        )  # fmt: skip
    size = (high - low) / count
    shape = tuple(count.astype(np.int64).tolist())
    top, bottom = np.full(shape, -np.inf), np.full(shape, np.inf)
    first, last = (
        np.clip(np.floor((ends[:, :2] - low) / size), 0, count - 1).astype(np.int64)
        for ends in (corners.min(axis=1), corners.max(axis=1))
    )
    for triangle, ray in cells_of_boxes(first, last):
        a, b, c = (corners[triangle, k] for k in range(3))
        x, y = (low + (ray + 0.5) * size - a[:, :2]).T
        ab, ac = b - a, c - a
        area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
        area = np.where(area == 0.0, np.nan, area)  # vertical triangles are edges of others
        u, v = (x * ac[:, 1] - y * ac[:, 0]) / area, (ab[:, 0] * y - ab[:, 1] * x) / area
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9)
        height, cells = (a[:, 2] + u * ab[:, 2] + v * ac[:, 2])[hit], tuple(ray[hit].T)
        np.maximum.at(top, cells, height)
        np.minimum.at(bottom, cells, height)
    bottom[np.isinf(bottom)] = corners[:, :, 2].min()
    return Stock(low, size, top, bottom, f"the STL file {Path(path).name}, a ray every {mm_from_m(size.max()):.3g} mm")


def _triangles(path: Path) -> FloatArray:
    """(t, 3, 3) corners of the triangles of an STL file, binary or text."""
    content = read_bytes(path, "the stock's STL file")
    count = struct.unpack_from("<I", content, 80)[0] if len(content) >= 84 else -1
    if len(content) == 84 + 50 * count:
        rows = np.frombuffer(content, np.dtype([("numbers", "<f4", 12), ("spare", "<u2")]), count, 84)
        corners = rows["numbers"][:, 3:].reshape(-1, 3, 3).astype(np.float64)
    else:
        words = [line.split()[1:] for line in content.decode("latin-1").splitlines() if line.split()[:1] == ["vertex"]]
        try:
            corners = np.array(words, dtype=np.float64).reshape(-1, 3, 3)
        except ValueError:
            corners = np.zeros((0, 3, 3))
    if not len(corners) or not np.isfinite(corners).all():
        raise InputError("no STL file, or one that is cut off", expected="triangles, binary or text", file=str(path))
    return corners
