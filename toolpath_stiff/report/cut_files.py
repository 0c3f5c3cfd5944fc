"""Files of a cut: stations and lines as CSV, the finished surface for viewers of bodies."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from toolpath_stiff.analysis.cut_figures import cut_columns, line_columns
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import AnyArray
from toolpath_stiff.column_files import csv_pieces
from toolpath_stiff.report.words import shortened
from toolpath_stiff.units import mm_from_m, um_from_m

DECIMALS = {"mm": 6, "um": 4, "N": 4, "deg": 4, "mm3": 6}
MOST_QUADS = 60_000  # of walls and of floors in the file
VTK_BLOCK = 20_000  # lines of the file written at a time


def _decimals(name: str) -> int | None:
    return DECIMALS.get(name.rpartition("_")[2])


def stations_csv(analysis: Analysis) -> Iterator[bytes]:
    """`cut.csv` in pieces: one row per sample; an empty cell where there is no such surface."""
    assert analysis.cut is not None
    columns = partial(cut_columns, analysis, analysis.cut)
    return csv_pieces(columns, len(analysis.samples), {name: _decimals(name) for name in columns(slice(0, 1))})


def lines_csv(analysis: Analysis) -> Iterator[bytes]:
    """`cut_lines.csv`: one row for each line that cuts."""
    assert analysis.cut is not None
    columns = line_columns(analysis.cut)
    decimals = {name: _decimals(name) for name in columns}
    return csv_pieces(lambda rows: {n: c[rows] for n, c in columns.items()}, len(columns["line"]), decimals)


def surface_vtk(analysis: Analysis) -> Iterator[str]:
    """`surface.vtk`: the finished part as quadrangles with their error in um, mm in program coordinates.

    VTK's legacy format (The VTK User's Guide, 11th ed., "Simple Legacy Formats").
    """
    from toolpath_stiff.report.surface import surface_of

    assert analysis.cut is not None
    quads, error, sample = surface_of(analysis.cut, MOST_QUADS)
    n = len(quads)
    yield "# vtk DataFile Version 3.0\n"
    yield f"{shortened(analysis.program.name, 60)}: error of the surface, um\nASCII\nDATASET POLYDATA\n"
    yield f"POINTS {4 * n} float\n"
    yield from _rows(mm_from_m(quads).reshape(-1, 3), "%.4f %.4f %.4f\n")
    yield f"POLYGONS {n} {5 * n}\n"
    yield from _rows(np.arange(4 * n).reshape(-1, 4), "4 %d %d %d %d\n")
    yield f"CELL_DATA {n}\nSCALARS error_um float 1\nLOOKUP_TABLE default\n"
    yield from _rows(um_from_m(error)[:, None], "%.4f\n")
    yield "SCALARS line int 1\nLOOKUP_TABLE default\n"
    yield from _rows(np.where(sample < 0, 0, analysis.samples.line[sample])[:, None], "%d\n")


def _rows(values: AnyArray, form: str) -> Iterator[str]:
    for start in range(0, len(values), VTK_BLOCK):
        part = values[start : start + VTK_BLOCK]
        yield form * len(part) % tuple(part.ravel().tolist())
