"""Figures and tables of a path: length-weighted mean, extremes, the weakest places, tool by tool; sample by sample."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolpath_stiff.analysis.evaluation import Evaluation, joint_columns
from toolpath_stiff.analysis.loads import Load, along_tool_axis, headline_rows
from toolpath_stiff.analysis.poses import POSE_COLUMNS
from toolpath_stiff.analysis.uncertainty import ParameterBand, parameter_band
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.moves import RAPID, ReadProgram
from toolpath_stiff.nc.operations import Operations, operations
from toolpath_stiff.path.sampling import Samples, move_durations
from toolpath_stiff.path.table import path_columns
from toolpath_stiff.poses import Pose
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, um_from_m

FIGURES = ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "mean_deflection_um")
ACROSS, PLUNGES_ONLY, ALL_CUTS = "across the tool axis", "plunges only", "all cuts"  # samples of headline figures
WEAKEST_PLACES = 3
ROUNDED = 1e-9  # m: a move of half a step must not count as shorter through rounding


@dataclass(frozen=True, repr=False, eq=False)
class EvaluatedPath:
    """Samples of a program with the machine's figures at each: the basis of statistics and tables.

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

    @property
    def machine(self) -> MachineTool:
        """The machine, with effects of geometry."""
        return self.model.machine

    @cached_property
    def parameter_band(self) -> ParameterBand | None:
        """Uncertainty of the stiffness from the machine's fitted parameters; None if unknown."""
        return parameter_band(self.model, self.samples, self.load, self.force, self.at.stiffness)

    @cached_property
    def move_lengths(self) -> FloatArray:
        """(m,) m, of every move."""
        return move_lengths(self.program.moves)

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
        """(n,) counted samples of plunges along the tool axis; none if the load does not follow the motion."""
        return np.asarray(self.counted & self.along_axis & (self.load.kind == "tangential"))

    @cached_property
    def headline(self) -> BoolArray:
        """(n,) counted samples that mean, range and weakest place are about: those of `headline_rows`."""
        return headline_rows(self.counted, self.plunging)

    @cached_property
    def set_aside(self) -> BoolArray:
        """(n,) plunges left out of the headline figures; none if the program only plunges."""
        return np.asarray(self.counted & ~self.headline)

    @cached_property
    def figures(self) -> Document:
        """`class_figures` of the whole path."""
        return class_figures(self, np.arange(len(self.samples)))

    @cached_property
    def weakest_rows(self) -> list[int]:
        """Weakest headline samples, one a place: at least a twentieth of the path apart, in different lines."""
        rows = np.flatnonzero(self.headline)
        chosen: list[int] = []
        s, line = self.samples.s, self.samples.line
        apart = (s[rows[-1]] - s[rows[0]]) / 20.0 if len(rows) else 0.0
        while len(rows) and len(chosen) < WEAKEST_PLACES:
            weakest = int(rows[np.argmin(self.at.stiffness[rows])])
            chosen.append(weakest)
            rows = rows[(np.abs(s[rows] - s[weakest]) >= apart) & (line[rows] != line[weakest])]
        return chosen

    @cached_property
    def out_of_reach(self) -> BoolArray:
        """(n,) cutting samples that the machine cannot reach."""
        return np.asarray(self.samples.cutting & ~self.at.reachable)

    @cached_property
    def operations(self) -> Operations:
        """The program's operations, and the row of its operation for every move."""
        return operations(self.program)


def stiffness_figures(path: EvaluatedPath, rows: BoolArray | IntArray) -> Document:
    """Mean (by length), min, max, range in N/mm and mean deflection in um of some counted samples.

    None for each where there are no such samples.
    """
    stiffness, weight = path.at.stiffness[rows], path.samples.weight[rows]
    if not len(stiffness):
        return dict.fromkeys(FIGURES)
    low, high = float(stiffness.min()), float(stiffness.max())
    mean = float(np.average(stiffness, weights=weight))
    values = [float(n_per_mm_from_n_per_m(value)) for value in (mean, low, high, high - low)]
    deflection = um_from_m(float(np.average(path.force / stiffness, weights=weight)))
    return dict(zip(FIGURES, [*values, deflection], strict=True))


def share(condition: BoolArray, among: BoolArray) -> float:
    """Share of the rows of `among` for which `condition` holds; 0 if there are none."""
    return float(condition[among].mean()) if among.any() else 0.0


def class_figures(path: EvaluatedPath, rows: IntArray) -> Document:
    """Headline figures of the samples `rows`, what they are about, their weakest place, and the plunges.

    `rows` (m,) are rows of samples, in order; only those in the statistics count. `plunges` is None without any.
    """
    counted, plunging, samples = path.counted[rows], path.plunging[rows], path.samples
    plunges = rows[plunging]
    headline = ALL_CUTS
    if path.load.kind == "tangential" and counted.any():
        headline = PLUNGES_ONLY if plunging[counted].all() else ACROSS

    def about(some: IntArray) -> Document:
        weakest = describe_sample(path, int(some[np.argmin(path.at.stiffness[some])])) if len(some) else None
        return {**stiffness_figures(path, some), "weakest": weakest}

    beside = {
        "samples": len(plunges),
        "moves": len(np.unique(samples.move[plunges])),
        "length_mm": mm_from_m(float(samples.weight[plunges].sum())),
        **about(plunges),
    }
    return {
        "headline": headline,
        **about(rows[headline_rows(counted, plunging)]),
        "plunges": beside if len(plunges) else None,
    }


def per_operation(path: EvaluatedPath) -> list[Document]:
    """Figures of each operation, in order of the run; lengths, times and samples add up to the whole."""
    rows, names = path.operations.rows, ("name", "tool", "first_line", "last_line")
    headings = [{"operation": row.number, **{name: getattr(row, name) for name in names}} for row in rows]
    parts = _parts(path, path.operations.of_move, len(rows))
    return [{**heading, **part} for heading, part in zip(headings, parts, strict=True)]


def per_tool(path: EvaluatedPath) -> list[Document]:
    """Figures of each tool that cuts, in order of use; its length is that of its first cut."""
    moves, remarks = path.program.moves, {tool.number: tool.remark for tool in path.program.tools}
    numbers, of_move = np.unique(moves.tool, return_inverse=True)
    parts, cuts = _parts(path, of_move, len(numbers)), np.flatnonzero(moves.motion != RAPID)
    used, first = np.unique(of_move[cuts], return_index=True)
    rows: list[Document] = []
    for i, cut in sorted(zip(used.tolist(), cuts[first].tolist(), strict=True), key=lambda pair: pair[1]):
        tool, length = int(numbers[i]), mm_from_m(float(moves.tool_length[cut]))
        heading = {"tool": tool, "remark": remarks.get(tool, ""), "length_mm": None if np.isnan(length) else length}
        rows.append({**heading, **parts[i]})
    return rows


def parts_of_path(path: EvaluatedPath) -> tuple[list[IntArray], dict[int, IntArray]]:
    """Rows of the samples of each operation, in order, and of each tool that cuts, by its number."""
    samples = path.samples
    operations = _rows_of(path.operations.of_move[samples.move], len(path.operations.rows))
    tools, of_sample = np.unique(samples.tool, return_inverse=True)
    cutting = np.unique(samples.tool[samples.cutting])
    rows = dict(zip(tools.tolist(), _rows_of(of_sample, len(tools)), strict=True))
    return operations, {number: rows[number] for number in cutting.tolist()}


def _parts(path: EvaluatedPath, of_move: IntArray, count: int) -> list[Document]:
    """Figures of `count` parts of a program; `of_move` (n,) is the part of each move."""
    samples, moves = path.samples, path.program.moves
    length, rapid = path.move_lengths, moves.motion == RAPID
    duration = move_durations(moves, length, path.machine.rapid_feed) + moves.dwell
    margin = np.where(samples.cutting & path.at.reachable, path.at.reach.margin, np.inf)
    parts: list[Document] = []
    for made, rows in zip(_rows_of(of_move, count), _rows_of(of_move[samples.move], count), strict=True):
        nearest = int(rows[np.argmin(margin[rows])])
        known = bool(np.isfinite(margin[nearest]))
        parts.append(
            {
                "cutting_length_mm": mm_from_m(float(length[made][~rapid[made]].sum())),
                "rapid_length_mm": mm_from_m(float(length[made][rapid[made]].sum())),
                "time_s": float(duration[made].sum()),
                **(path.figures if len(rows) == len(samples) else class_figures(path, rows)),
                "min_margin": float(margin[nearest]) if known else None,
                "min_margin_limit": path.at.reach.describe(nearest) if known else None,
                "min_margin_line": int(samples.line[nearest]) if known else None,
                "out_of_reach_samples": int(path.out_of_reach[rows].sum()),
            }
        )
    return parts


def _rows_of(part: IntArray, count: int) -> list[IntArray]:
    """Rows of each of `count` parts, in order; `part` (n,) is the part of each row."""
    if count == 1:
        return [np.arange(len(part))]
    order = np.argsort(part, kind="stable")
    return np.split(order, np.searchsorted(part[order], np.arange(1, count)))[:count]


def describe_sample(path: EvaluatedPath, row: int) -> Document:
    """Line, source text, position and stiffness of one sample."""
    source, columns = path.program.source, path_columns(path.samples, slice(row, row + 1))
    line = int(columns["line"][0])
    return {
        "line": line,
        "text": source[line - 1].strip() if 0 < line <= len(source) else "",
        **{name: float(columns[name][0]) for name in ("s_mm", *POSE_COLUMNS)},
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(float(path.at.stiffness[row])),
    }


def sample_columns(path: EvaluatedPath, rows: slice | IntArray = slice(None)) -> dict[str, AnyArray]:
    """Column name -> values in the shop's units, for some samples."""
    evaluation = path.at
    reach, names = evaluation.reach, np.array([limit.name for limit in evaluation.reach.limits] or ["none"])
    moving = (path.samples.motion[rows] != RAPID) & path.samples.tangent[rows].any(axis=1)
    band = path.parameter_band
    sd = {} if band is None else {"stiffness_sd_N_per_mm": n_per_mm_from_n_per_m(band.deviation[rows])}
    return {
        **path_columns(path.samples, rows),
        "stiffness_N_per_mm": n_per_mm_from_n_per_m(evaluation.stiffness[rows]),
        **sd,
        "deflection_um": um_from_m(path.force / evaluation.stiffness[rows]),
        **joint_columns(path.machine, evaluation.joints[rows]),
        "margin": reach.margin[rows],
        "margin_limit": names[reach.limit[rows]],
        "operation": path.operations.of_move[path.samples.move[rows]] + 1,
        "cut": np.where(moving, np.where(path.along_axis[rows], "plunge", "across"), ""),  # whatever the load
    }


def table_rows(path: EvaluatedPath) -> IntArray:
    """Samples in `samples.csv`: all, except that a move shorter than half a step gives only its last."""
    samples = path.samples
    last = np.flatnonzero(np.diff(samples.move, append=-1))
    first = np.append(0, last[:-1] + 1)[: len(last)]
    short = (last - first == 1) & (samples.s[last] - samples.s[first] < 0.5 * path.step - ROUNDED)
    return np.delete(np.arange(len(samples)), first[short])
