"""Figures of an analysis's cut: errors of walls and floors by part and by line, the worst places, a tolerance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.analysis.statistics import EvaluatedPath, parts_of_path
from toolpath_stiff.arrays import AnyArray, FloatArray, IntArray
from toolpath_stiff.documents import Document
from toolpath_stiff.units import deg_from_rad, mm3_from_m3, mm_from_m, nm_from_m, um_from_m

if TYPE_CHECKING:
    from toolpath_stiff.cutting.cut import Cut

SURFACES = ("left", "right", "floor")  # of the path, seen along the feed
PLACES = 5  # worst places that are named


def cut_document(path: EvaluatedPath, cut: Cut, tolerance: float | None) -> Document:
    """Entry `cut` of `summary.json`, in the shop's units; `tolerance` in m."""
    everything = np.arange(len(cut.samples))
    operations, tools = parts_of_path(path)
    document: dict[str, object] = {
        "stock": cut.work.stock.origin,
        "coefficients": cut.coefficients.document(),
        "tools": [_tool(cut, number) for number in cut.cutters],
        "machine_only": cut.machine_only,
        **_figures(cut, everything),
        "worst_material_left": _worst(path, cut, 1.0),
        "worst_cut_too_deep": _worst(path, cut, -1.0),
        "per_operation": [_figures(cut, rows) for rows in operations],
        "per_tool": [{"tool": number, **_figures(cut, rows)} for number, rows in tools.items()],
        "assumptions": list(cut.assumptions),
        "warnings": list(cut.warnings),
    }
    if tolerance is not None:
        beyond = lines_beyond(cut, tolerance)
        document["tolerance"] = {
            "tolerance_um": um_from_m(tolerance),
            "beyond": [{"line": line, "worst_um": worst} for line, worst in beyond],
        }
    return document


def _tool(cut: Cut, number: int) -> Document:
    cutter = cut.cutters[number]
    return {
        "tool": number,
        "diameter_mm": mm_from_m(cutter.diameter),
        "corner_radius_mm": mm_from_m(cutter.corner_radius),
        "flutes": cutter.flutes,
        "helix_deg": cutter.hand * deg_from_rad(cutter.helix),
        "run_out_um": um_from_m(cutter.run_out),
        "stick_out_mm": mm_from_m(cutter.stickout),
        "lateral_nm_per_N": nm_from_m(cutter.lateral_compliance),
        "axial_nm_per_N": nm_from_m(cutter.axial_compliance),
    }


def _figures(cut: Cut, rows: IntArray) -> Document:
    """Errors of walls and floors at some samples, the largest force, the volume removed."""
    weight, mean = cut.samples.weight[rows], cut.errors[rows]
    low, high = cut.lowest[rows], cut.highest[rows]
    force = np.abs(cut.peak_force[rows]).max(axis=1, initial=0.0)
    return {
        "removed_mm3": mm3_from_m3(float(cut.removed[rows].sum())),
        "largest_force_N": float(force.max(initial=0.0)),
        "walls": _errors(mean[:, :2], low[:, :2], high[:, :2], weight),
        "floors": _errors(mean[:, 2:], low[:, 2:], high[:, 2:], weight),
    }


def _errors(mean: FloatArray, low: FloatArray, high: FloatArray, weight: FloatArray) -> Document | None:
    """Mean by length, limits that 95 % of the surface keep, and extremes, um; None without a surface."""
    made = np.isfinite(mean) & (weight[:, None] > 0.0)
    if not made.any():
        return None
    length = np.broadcast_to(weight[:, None], mean.shape)[made]
    size = np.abs(mean[made])
    order = np.argsort(size, kind="stable")
    share = np.cumsum(length[order]) / length.sum()
    return {
        "length_mm": mm_from_m(float(length.sum())),
        "mean_um": um_from_m(float(np.average(mean[made], weights=length))),
        "p95_um": um_from_m(float(size[order][np.searchsorted(share, 0.95)])),
        "least_um": um_from_m(float(low[made].min())),
        "most_um": um_from_m(float(high[made].max())),
    }


def _worst(path: EvaluatedPath, cut: Cut, sign: float) -> list[Document]:
    """Surfaces that stand out farthest (sign 1) or are cut deepest (-1), each of another line."""
    size = np.where(np.isfinite(cut.errors), cut.highest if sign > 0.0 else -cut.lowest, -np.inf)
    size[cut.samples.weight <= 0.0] = -np.inf
    rows, worst = largest_of(cut.samples.line, size)
    chosen = np.argsort(-worst, kind="stable")[:PLACES]
    return [
        surface_at(path, cut, *divmod(int(row), 3))
        for row, by in zip(rows[chosen], worst[chosen], strict=True)
        if by > 0.0
    ]


def largest_of(group: IntArray, values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Flat index of the largest of values (n, k) in each group (n,) of rows, and that value; in order of the groups."""
    column = values.argmax(axis=1)
    best = np.take_along_axis(values, column[:, None], axis=1)[:, 0]
    order = np.lexsort((-best, group))
    first = order[np.flatnonzero(np.diff(group[order], prepend=group.min(initial=0) - 1))]
    return first * values.shape[1] + column[first], best[first]


def surface_at(path: EvaluatedPath, cut: Cut, row: int, surface: int) -> Document:
    """One surface of one sample: its place and its error."""
    line, position = int(cut.samples.line[row]), mm_from_m(path.samples.position[row]).tolist()
    source = path.program.source
    return {
        "line": line,
        "text": source[line - 1].strip() if 0 < line <= len(source) else "",
        "sample": row,
        "surface": SURFACES[surface],
        **{f"{axis}_mm": value for axis, value in zip("xyz", position, strict=True)},
        "mean_um": um_from_m(float(cut.errors[row, surface])),
        "least_um": um_from_m(float(cut.lowest[row, surface])),
        "most_um": um_from_m(float(cut.highest[row, surface])),
        "sd_um": um_from_m(float(cut.deviation[row, surface])),
    }


def lines_beyond(cut: Cut, tolerance: float) -> list[tuple[int, float]]:
    """(line, largest error in um) of lines whose surface leaves +-tolerance (m) anywhere, worst first."""
    error = np.where(-cut.lowest > cut.highest, cut.lowest, cut.highest)
    made = np.isfinite(error) & (cut.samples.weight > 0.0)[:, None]
    places, worst = largest_of(cut.samples.line, np.where(made, np.abs(error), -np.inf))
    beyond = np.flatnonzero(worst > tolerance)
    beyond = beyond[np.argsort(-worst[beyond], kind="stable")]
    lines = cut.samples.line[places[beyond] // 3].tolist()
    return list(zip(lines, um_from_m(error.reshape(-1)[places[beyond]]).tolist(), strict=True))


def cut_columns(path: EvaluatedPath, cut: Cut, rows: slice = slice(None)) -> dict[str, AnyArray]:
    """Column of `cut.csv` -> values in the shop's units, for some rows."""
    samples = path.samples
    columns: dict[str, AnyArray] = {
        "line": samples.line[rows],
        "tool": samples.tool[rows],
        "s_mm": mm_from_m(samples.s[rows]),
    }
    columns |= {f"{axis}_mm": mm_from_m(samples.position[rows, i]) for i, axis in enumerate("xyz")}
    columns |= {"feed_per_tooth_um": um_from_m(cut.feed_per_tooth[rows])}
    columns |= {f"{name}_mm": mm_from_m(getattr(cut, name)[rows]) for name in ("ap", "ae")}
    columns |= {f"{name}_deg": deg_from_rad(getattr(cut, name)[rows]) for name in ("entry", "exit")}
    columns |= {"removed_mm3": mm3_from_m3(cut.removed[rows])}
    for name in ("mean", "peak"):
        columns |= {f"{name}_f{axis}_N": getattr(cut, f"{name}_force")[rows, i] for i, axis in enumerate("xyz")}
    columns |= {f"deflection_{axis}_um": um_from_m(cut.deflection[rows, i]) for i, axis in enumerate("xyz")}
    for i, name in enumerate(SURFACES):
        parts = (("mean", cut.errors), ("least", cut.lowest), ("most", cut.highest), ("sd", cut.deviation))
        columns |= {f"{name}_{part}_um": um_from_m(values[rows, i]) for part, values in parts}
    return columns


def line_columns(cut: Cut) -> dict[str, AnyArray]:
    """Column of `cut_lines.csv` -> values of each line that cuts; nan if it leaves no such surface."""
    cuts = np.flatnonzero(cut.samples.cutting)
    cuts = cuts[np.argsort(cut.samples.line[cuts], kind="stable")]
    first = np.flatnonzero(np.diff(cut.samples.line[cuts], prepend=-1))
    force = np.abs(cut.peak_force[cuts]).max(axis=1)
    columns: dict[str, AnyArray] = {
        "line": cut.samples.line[cuts[first]],
        "tool": cut.samples.tool[cuts[first]],
        "largest_ap_mm": mm_from_m(np.maximum.reduceat(cut.ap[cuts], first)),
        "largest_ae_mm": mm_from_m(np.maximum.reduceat(cut.ae[cuts], first)),
        "removed_mm3": mm3_from_m3(np.add.reduceat(cut.removed[cuts], first)),
        "largest_force_N": np.maximum.reduceat(force, first),
    }
    for i, name in enumerate(SURFACES):
        error = cut.errors[cuts, i]
        weight = np.where(np.isfinite(error), cut.samples.weight[cuts], 0.0)
        length = np.add.reduceat(weight, first)
        total = np.add.reduceat(np.where(weight > 0.0, error, 0.0) * weight, first)
        columns |= {
            f"{name}_length_mm": mm_from_m(length),
            f"{name}_mean_um": um_from_m(np.where(length > 0.0, total / np.where(length > 0.0, length, 1.0), np.nan)),
            f"{name}_least_um": um_from_m(np.fmin.reduceat(cut.lowest[cuts, i], first)),
            f"{name}_most_um": um_from_m(np.fmax.reduceat(cut.highest[cuts, i], first)),
        }
    return columns
