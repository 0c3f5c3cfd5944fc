"""Figures and tables of a path: length-weighted mean, extremes, the weakest places, tool by tool; sample by sample.

How far the uncertainty of a machine's fitted parameters reaches into them is a linear propagation (JCGM 100:2008,
Guide to the expression of uncertainty in measurement, equation 13): the covariance of the parameters between two
slopes of the stiffness, which are differences of whole evaluations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.evaluation import Evaluation, evaluate
from toolpath_stiff.analysis.loads import Load, along_tool_axis, follows_motion, headline_of, headline_words
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.column_files import csv_pieces, parquet_pieces
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.nc.moves import RAPID, ReadProgram
from toolpath_stiff.nc.operations import Operations, operations
from toolpath_stiff.path import PATH_COLUMNS, Samples, path_columns
from toolpath_stiff.stiffness.model import StiffnessModel, idle_effects, with_parameter_moved
from toolpath_stiff.units import Pose, deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, um_from_m

FIGURES = ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "mean_deflection_um")
# Of `samples.csv`, Parquet and the DataFrame, with their decimals.
COLUMNS: dict[str, int | None] = {
    **PATH_COLUMNS,
    "stiffness_N_per_mm": 4,
    "deflection_um": 6,
    **{f"strut{i}_mm": 6 for i in range(1, 7)},
    "margin": 6,
    "margin_limit": None,
    "operation": None,
    "cut": None,
}

FENCE = 3.0  # interquartile ranges beyond the quartiles; Tukey, Exploratory Data Analysis, 1977: "far out"
STEP = 0.01  # of a standard deviation, for differences: stiffness bends little over it, and rounding stays far below


@dataclass(frozen=True, repr=False, eq=False)
class EvaluatedPath:
    """A program's samples and what the machine does at each: what statistics and tables are made from.

    Attributes
    ----------
    program
        What was sampled.
    load, force
        Direction of the load; its size in N.
    samples
        The path in machine coordinates.
    at
        Stiffness, struts, reach at every sample.
    model
        The machine with its effects.
    origin, origin_source
        Where program zero sits (m, rad) and who said so: "option", "program" or "default".
    step
        Largest distance of two samples in m.
    warnings
        What deserves a look, plain sentences, the program's own included.
    """

    program: ReadProgram
    load: Load
    force: float
    samples: Samples
    at: Evaluation
    model: StiffnessModel
    origin: Pose
    origin_source: str
    step: float
    warnings: list[str]

    @property
    def machine(self) -> Machine:
        """The machine, geometry effects included."""
        return self.model.machine

    @cached_property
    def parameter_band(self) -> ParameterBand | None:
        """What the uncertainty of the machine's fitted parameters does to the stiffness; None if none is known."""
        return parameter_band(self, self.model)

    @cached_property
    def counted(self) -> BoolArray:
        """(n,) samples in the statistics: cutting, reachable, with a load in the asked direction."""
        return np.asarray(self.samples.cutting & self.at.reachable & (self.samples.weight > 0.0))

    @cached_property
    def along_axis(self) -> BoolArray:
        """(n,) samples whose tip moves along the tool axis."""
        return along_tool_axis(self.samples.tangent, self.samples.abc)

    @cached_property
    def plunging(self) -> BoolArray:
        """(n,) counted samples of plunges along the tool axis; none where the load does not follow the motion."""
        return np.asarray(self.counted & self.along_axis if follows_motion(self.load) else np.zeros_like(self.counted))

    @property
    def headline(self) -> BoolArray:
        """(n,) counted samples that mean, range and weakest place are about: those of `headline_rows`."""
        return headline_of(self.counted, self.plunging)

    @property
    def set_aside(self) -> BoolArray:
        """(n,) plunges beside the headline; none of a program that only plunges."""
        return np.asarray(self.counted & ~self.headline)

    @cached_property
    def figures(self) -> dict[str, Any]:
        """`class_figures` of the whole path."""
        return class_figures(self, np.arange(len(self.samples)))

    @cached_property
    def weakest_rows(self) -> list[int]:
        """The rows of `weakest_places`."""
        return weakest_places(self)

    @cached_property
    def central_range(self) -> tuple[float, float]:
        """Lowest and highest of `charted` in N/m, values far out set aside."""
        return central_range(*self.charted)

    @property
    def charted(self) -> tuple[FloatArray, FloatArray]:
        """Stiffness in N/m and length in m of the headline samples.

        A program that only turns rotary axes has none: then every reachable cutting sample counts alike.
        """
        about, weight = self.headline, self.samples.weight
        if not about.any():
            about, weight = self.samples.cutting & self.at.reachable, np.ones(len(weight))
        return self.at.stiffness[about], weight[about]

    @property
    def out_of_reach(self) -> BoolArray:
        """(n,) cutting samples that the machine cannot reach."""
        return np.asarray(self.samples.cutting & ~self.at.reachable)

    @cached_property
    def operations(self) -> Operations:
        """The program's operations, and the row of its operation for every move."""
        return operations(self.program)

    @property
    def operation(self) -> IntArray:
        """(n,) number of each sample's operation, from 1."""
        return np.asarray(self.operations.of_move[self.samples.move] + 1)


def stiffness_figures(path: EvaluatedPath, rows: BoolArray) -> dict[str, Any]:
    """Mean (by length), min, max, range in N/mm and mean deflection in um of some counted samples.

    None for each where there are no such samples.
    """
    return weighted_figures(path.at.stiffness[rows], path.samples.weight[rows], path.force)


def path_length(samples: Samples, rapid: bool) -> float:
    """Length in m of the rapid, or of the cutting moves."""
    if not len(samples):
        return 0.0
    step = np.diff(samples.s, prepend=samples.s[0])
    step[np.diff(samples.move, prepend=samples.move[0]) != 0] = 0.0  # a move's first sample repeats the last end
    return float(step[(samples.motion == RAPID) == rapid].sum())


def weakest_places(path: EvaluatedPath, count: int = 3) -> list[int]:
    """Rows of the weakest headline samples, one a place: apart by at least a twentieth of the path, other lines."""
    rows = np.flatnonzero(path.headline)
    if not len(rows):
        return []
    s, line = path.samples.s, path.samples.line
    apart = (s[rows[-1]] - s[rows[0]]) / 20.0
    chosen: list[int] = []
    while len(rows) and len(chosen) < count:
        best = int(rows[np.argmin(path.at.stiffness[rows])])
        chosen.append(best)
        rows = rows[(np.abs(s[rows] - s[best]) >= apart) & (line[rows] != line[best])]
    return chosen


def central_range(stiffness: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """Lowest and highest of values (n,) with weights (n,), those far out (`FENCE`) set aside."""
    order = np.argsort(stiffness, kind="stable")
    length = np.cumsum(weight[order])
    lower, upper = stiffness[order[np.searchsorted(length, [0.25 * length[-1], 0.75 * length[-1]])]]
    reach = FENCE * (upper - lower)
    inside = stiffness[(stiffness >= lower - reach) & (stiffness <= upper + reach)]
    values = inside if np.ptp(inside) > 0.0 else stiffness
    return float(values.min()), float(values.max())


def share(condition: BoolArray, among: BoolArray) -> float:
    """Share of the rows of `among` for which `condition` holds; 0 of none."""
    total = int(among.sum())
    return float((condition & among).sum()) / total if total else 0.0


def weighted_figures(stiffness: FloatArray, weight: FloatArray, force: float) -> dict[str, float | None]:
    """Mean by weight, min, max, range in N/mm and mean deflection in um; None for each where there is nothing.

    stiffness (n,) N/m; weight (n,); force N.
    """
    if not len(stiffness):
        return dict.fromkeys(FIGURES)
    low, high = float(stiffness.min()), float(stiffness.max())
    return {
        "mean_N_per_mm": n_per_mm_from_n_per_m(float(np.average(stiffness, weights=weight))),
        "min_N_per_mm": n_per_mm_from_n_per_m(low),
        "max_N_per_mm": n_per_mm_from_n_per_m(high),
        "range_N_per_mm": n_per_mm_from_n_per_m(high - low),
        "mean_deflection_um": um_from_m(float(np.average(force / stiffness, weights=weight))),
    }


def class_figures(path: EvaluatedPath, rows: IntArray) -> dict[str, Any]:
    """The headline figures of the samples `rows`, what they are about, their weakest place, and the plunges beside.

    `rows` (m,) are rows of samples, in order; only those in the statistics count. `plunges` is None without any.
    """
    counted, plunging = path.counted[rows], path.plunging[rows]
    about = rows[headline_of(counted, plunging)]
    return {
        "headline": headline_words(path.load, counted, plunging),
        **_figures_and_weakest(path, about),
        "plunges": _plunges(path, rows[plunging]) if plunging.any() else None,
    }


def _plunges(path: EvaluatedPath, rows: IntArray) -> dict[str, Any]:
    samples = path.samples
    return {
        "samples": len(rows),
        "moves": 1 + int(np.count_nonzero(np.diff(samples.move[rows]))),  # they rise along the path
        "length_mm": mm_from_m(float(samples.weight[rows].sum())),
        **_figures_and_weakest(path, rows),
    }


def _figures_and_weakest(path: EvaluatedPath, rows: IntArray) -> dict[str, Any]:
    stiffness = path.at.stiffness[rows]
    return {
        **weighted_figures(stiffness, path.samples.weight[rows], path.force),
        "weakest": describe_sample(path, int(rows[np.argmin(stiffness)])) if len(rows) else None,
    }


def per_operation(path: EvaluatedPath) -> list[dict[str, Any]]:
    """The figures of each operation, in the order of the run; their lengths, times and samples add up to the whole."""
    operations = path.operations
    parts = _Parts(path, operations.of_move, len(operations.rows))
    return [
        {
            "operation": operation.number,
            "name": operation.name,
            "tool": operation.tool,
            "first_line": operation.first_line,
            "last_line": operation.last_line,
            **parts.row(part),
        }
        for part, operation in enumerate(operations.rows)
    ]


def per_tool(path: EvaluatedPath) -> list[dict[str, Any]]:
    """The figures of each tool that cuts, in order of use; a tool that cuts with two lengths has two rows.

    Rapids with a length that the tool never cuts with (before G43) count with the first that it does.
    """
    moves = path.program.moves
    remarks = {tool.number: tool.remark for tool in path.program.tools}
    tools, tool = np.unique(moves.tool, return_inverse=True)
    lengths, length = np.unique(moves.tool_length, return_inverse=True)  # nan, the reference tool's, is one of them
    many = len(lengths)
    of_move = tool * many + length
    used, first = np.unique(of_move[moves.motion != RAPID], return_index=True)
    order = used[np.argsort(first)].tolist()
    first_of_tool: dict[int, int] = {}
    for part in order:
        first_of_tool.setdefault(part // many, part)
    counts_with = [
        part if part in order else first_of_tool.get(part // many, part) for part in range(len(tools) * many)
    ]
    parts = _Parts(path, np.array(counts_with)[of_move], len(counts_with))
    rows = []
    for part in order:
        number, tool_length = int(tools[part // many]), float(lengths[part % many])
        about = {
            "tool": number,
            "remark": remarks.get(number, ""),
            "length_mm": None if math.isnan(tool_length) else mm_from_m(tool_length),
        }
        rows.append({**about, **parts.row(part)})
    return rows


class _Parts:
    """A path in parts, each move in one of them: `of_move` (n_moves,) says in which of `count`."""

    def __init__(self, path: EvaluatedPath, of_move: IntArray, count: int) -> None:
        self.path = path
        samples, moves = path.samples, path.program.moves
        first = np.searchsorted(samples.move, np.arange(len(moves)))
        last = np.append(first[1:], len(samples)) - 1
        length, cutting = samples.s[last] - samples.s[first], moves.motion != RAPID
        time = np.diff(np.append(samples.t[first], samples.t[-1]))  # with the dwell after each move but the last
        self.cutting_length = np.bincount(of_move, np.where(cutting, length, 0.0), count)
        self.rapid_length = np.bincount(of_move, np.where(cutting, 0.0, length), count)
        self.time = np.bincount(of_move, time, count)
        self.out_of_reach = path.out_of_reach
        self.margin = np.where(samples.cutting & path.at.reachable, path.at.margin, np.inf)
        self.rows = _rows_of_parts(of_move[samples.move], count)

    def row(self, part: int) -> dict[str, Any]:
        """Length, time, figures, weakest place and nearest limit of one part."""
        path, rows = self.path, self.rows[part]
        nearest = int(rows[np.argmin(self.margin[rows])])
        known = bool(np.isfinite(self.margin[nearest]))
        return {
            "cutting_length_mm": mm_from_m(float(self.cutting_length[part])),
            "rapid_length_mm": mm_from_m(float(self.rapid_length[part])),
            "time_s": float(self.time[part]),
            **(path.figures if len(rows) == len(path.samples) else class_figures(path, rows)),
            "min_margin": float(self.margin[nearest]) if known else None,
            "min_margin_limit": path.at.reach.describe(nearest) if known else None,
            "min_margin_line": int(path.samples.line[nearest]) if known else None,
            "out_of_reach_samples": int(self.out_of_reach[rows].sum()),
        }


def _rows_of_parts(part: IntArray, count: int) -> list[IntArray]:
    """The rows of each of `count` parts, in order; `part` (n,) says in which each row is."""
    if count == 1:
        return [np.arange(len(part))]
    order = np.argsort(part, kind="stable")
    ends = np.searchsorted(part[order], np.arange(count + 1))
    return [order[ends[one] : ends[one + 1]] for one in range(count)]


def describe_sample(path: EvaluatedPath, row: int) -> dict[str, Any]:
    """Line, source text, position and stiffness of one sample."""
    samples = path.samples
    line = int(samples.line[row])
    x, y, z = (mm_from_m(float(v)) for v in samples.position[row])
    a, b, c = (deg_from_rad(float(v)) for v in samples.abc[row])
    source = path.program.source
    return {
        "line": line,
        "text": source[line - 1].strip() if 0 < line <= len(source) else "",
        "s_mm": mm_from_m(float(samples.s[row])),
        "x_mm": x,
        "y_mm": y,
        "z_mm": z,
        "a_deg": a,
        "b_deg": b,
        "c_deg": c,
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(float(path.at.stiffness[row])),
    }


@dataclass(frozen=True)
class ParameterBand:
    """Uncertainty of the stiffness of n samples that comes from p fitted parameters.

    Attributes
    ----------
    names
        Of the parameters, as in machine files.
    slopes
        (n, p) N/m by which the stiffness changes with one standard deviation of each; nan out of reach.
    correlation
        (p, p) of the parameters.
    """

    names: tuple[str, ...]
    slopes: FloatArray
    correlation: FloatArray

    @property
    def deviation(self) -> FloatArray:
        """(n,) N/m, standard deviation of the stiffness of each sample."""
        squared = np.einsum("ni,ij,nj->n", self.slopes, self.correlation, self.slopes)
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))

    def deviation_of_mean(self, weight: FloatArray) -> float:
        """N/m, standard deviation of the mean stiffness of samples with weights (n,); the errors do not average out."""
        slope: FloatArray = weight[weight > 0.0] @ self.slopes[weight > 0.0] / weight.sum()
        return float(np.sqrt(max(float(slope @ self.correlation @ slope), 0.0)))


def parameter_band(path: EvaluatedPath, model: StiffnessModel) -> ParameterBand | None:
    """The band of a path; None where the machine file has no `[uncertainty]`, or none of what acts on the machine."""
    given = model.given
    uncertainty = given.uncertainty if given is not None else None
    if uncertainty is None:
        return None
    idle = {active.effect.name for active in model.instruments}
    idle |= {one.effect for one in idle_effects(model)}
    kept = [
        i
        for i, (name, sd) in enumerate(zip(uncertainty.names, uncertainty.sd, strict=True))
        if sd > 0.0 and name.partition(".")[0] not in idle
    ]
    if not kept:
        return None
    slopes = [_slope(path, model, uncertainty.names[i], float(uncertainty.sd[i])) for i in kept]
    return ParameterBand(
        tuple(uncertainty.names[i] for i in kept),
        np.stack(slopes, axis=1),
        np.asarray(uncertainty.correlation[np.ix_(kept, kept)]),
    )


def _slope(path: EvaluatedPath, model: StiffnessModel, name: str, sd: float) -> FloatArray:
    """(n,) N/m per standard deviation of one parameter, away from a bound that is near."""
    for step in (STEP, -STEP):
        try:
            moved = with_parameter_moved(model, name, step * sd)
        except InputError:
            continue
        return np.asarray((_stiffness(path, moved) - path.at.stiffness) / step)
    raise InputError(f"[uncertainty]: {name} has no room between its bounds for a standard deviation of {sd:g}")


def _stiffness(path: EvaluatedPath, model: StiffnessModel) -> FloatArray:
    samples = path.samples
    at = evaluate(model, samples.position, samples.abc, samples.tangent, samples.tool_length, path.load, path.force)
    return at.stiffness


def band_figures(path: EvaluatedPath, band: ParameterBand) -> dict[str, Any] | None:
    """Headline figures of the band: standard deviations and 95 % intervals in N/mm; None where nothing counts."""
    about = path.headline
    if not about.any():
        return None
    stiffness, weight = path.at.stiffness, np.where(about, path.samples.weight, 0.0)
    relative = np.where(about, band.deviation / stiffness, 0.0)
    mean, mean_sd = float(np.average(stiffness[about], weights=weight[about])), band.deviation_of_mean(weight)
    row = int(np.argmin(np.where(about, stiffness, np.inf)))
    widest = int(np.argmax(relative))
    return {
        "parameters": list(band.names),
        "mean_sd_N_per_mm": n_per_mm_from_n_per_m(mean_sd),
        "mean_95_N_per_mm": _interval(mean, mean_sd),
        "min_sd_N_per_mm": n_per_mm_from_n_per_m(float(band.deviation[row])),
        "min_95_N_per_mm": _interval(float(stiffness[row]), float(band.deviation[row])),
        "largest_sd_percent": 100.0 * float(relative[widest]),
        "largest_sd_line": int(path.samples.line[widest]),
    }


def _interval(value: float, sd: float) -> list[float]:
    return [n_per_mm_from_n_per_m(value + sign * defaults.NORMAL_95 * sd) for sign in (-1.0, 1.0)]


def sample_columns(path: EvaluatedPath, rows: slice = slice(None)) -> dict[str, AnyArray]:
    """Column name -> values in the shop's units, for some rows."""
    at = path.at
    names = np.array([limit.name for limit in at.limits] or ["none"])
    return {
        **path_columns(path.samples, rows),
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(at.stiffness[rows]),
        "deflection_um": um_from_m(path.force / at.stiffness[rows]),
        **{f"strut{i + 1}_mm": mm_from_m(at.strut_lengths[rows, i]) for i in range(6)},
        "margin": at.margin[rows],
        "margin_limit": names[at.limit[rows]],
        "operation": path.operations.of_move[path.samples.move[rows]] + 1,
        "cut": _cut(path, rows),
    }


def _cut(path: EvaluatedPath, rows: slice) -> TextArray:
    """(n,) "across" or "plunge", whatever the load; "" on rapids and where the tip does not move."""
    moving = (path.samples.motion[rows] != RAPID) & path.samples.tangent[rows].any(axis=1)
    return np.where(moving, np.where(path.along_axis[rows], "plunge", "across"), "")


def samples_csv(path: EvaluatedPath) -> Iterator[bytes]:
    """`samples.csv` in pieces: the heading, then blocks of rows. A value that does not exist is an empty cell."""
    return csv_pieces(partial(sample_columns, path), len(path.samples), COLUMNS)


def samples_parquet(path: EvaluatedPath) -> Iterator[bytes]:
    """`samples.parquet` in pieces, full precision. A value that does not exist is null."""
    return parquet_pieces(partial(sample_columns, path), len(path.samples))
