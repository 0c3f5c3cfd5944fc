"""A program on a machine: its path sampled, every sample evaluated; figures and assumptions, `summary.json`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.assumptions import assumptions_of, pose_words, words_turn_the_platform
from toolpath_stiff.analysis.cut_figures import cut_columns, cut_document, lines_beyond
from toolpath_stiff.analysis.evaluation import Progress, evaluate
from toolpath_stiff.analysis.joint_motion import joint_warnings
from toolpath_stiff.analysis.loads import Load, parse_load
from toolpath_stiff.analysis.statistics import (
    FIGURES,
    EvaluatedPath,
    describe_sample,
    per_operation,
    per_tool,
    sample_columns,
    share,
)
from toolpath_stiff.analysis.turning import FIXED, TurnChoice, choose_turn
from toolpath_stiff.analysis.uncertainty import band_figures
from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.documents import Document, number, to_dict, without_nan
from toolpath_stiff.errors import ProgramError, UnreachableError
from toolpath_stiff.files import Content
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.nc.moves import RAPID, Moves, ReadProgram
from toolpath_stiff.path.placing import place
from toolpath_stiff.path.sampling import lines_named, sample_moves
from toolpath_stiff.poses import Pose, pose_in_mm
from toolpath_stiff.results import DataFrame, Figure, FolderResult, frame_of
from toolpath_stiff.stiffness.model import (
    StiffnessModel,
    build_model,
    condition_warnings,
    effects_stated,
)
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.cutting.cut import Cut

STANDING = ("weakest", "out_of_reach_samples", "extrapolated_share")  # copied from the machine compared with


@dataclass(frozen=True, repr=False, eq=False)
class Analysis(EvaluatedPath, FolderResult):
    r"""Stiffness along the path of a program, under a load at every sample of a cut.

    Attributes
    ----------
    turn
        The turn about the tool's axis, where it is not as programmed.
    required
        Stiffness that every cut must have, N/m; None: none.
    on_other
        The same on the machine compared with; None without one.
    cut, tolerance
        What is cut and the error of the surface, None without a setup of the cut; m that it may have, or None.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> found = tps.analyze(slot, "nist", origin_mm_deg=(0, 0, 800), require_N_per_mm=54000)
    >>> [round(one) for one in (found.mean_N_per_mm, found.min_N_per_mm, found.range_N_per_mm)]
    [54353, 53875, 948]
    >>> [found.to_dict()["weakest"][name] for name in ("line", "text")]
    [4, 'G1 X40']
    >>> [(line, round(stiffness)) for line, stiffness in found.below_required]
    [(4, 53875)]
    >>> found.complete, found.warnings
    (True, [])
    >>> found.deviation_N_per_mm is None  # the figures of this machine are stated without standard deviations
    True
    >>> len(found.to_frame()), len(found.to_dict()["weakest_places"])
    (53, 1)
    >>> [type(picture()).__name__ for picture in (found.plot, found.plot_profile)]
    ['Figure', 'Figure']
    """

    command: ClassVar[str] = "analyze"
    shown_by: ClassVar[str] = "analysis"

    turn: TurnChoice | None = None
    required: float | None = None
    on_other: Analysis | None = None
    cut: Cut | None = None
    tolerance: float | None = None
    inputs: tuple[str, ...] = ()

    @cached_property
    def warnings(self) -> list[str]:
        """Points to check, including the program's own warnings."""
        of_cut = () if self.cut is None else self.cut.warnings
        return [*map(str, self.program.warnings), *condition_warnings(self.model), *_warnings(self), *of_cut]

    @property
    def moves(self) -> Moves:
        """Moves in machine coordinates; made anew each time, as a long program's take a fifth of all memory."""
        return place(self.program.moves, self.origin)

    @property
    def mean_N_per_mm(self) -> float:  # noqa: N802  (newton)
        """Mean stiffness over the length of the cuts, plunges along the tool axis left out; nan without any."""
        return float(np.asarray(self.figures["mean_N_per_mm"], dtype=float))

    @property
    def min_N_per_mm(self) -> float:  # noqa: N802
        """Smallest stiffness of these cuts."""
        return float(np.asarray(self.figures["min_N_per_mm"], dtype=float))

    @property
    def range_N_per_mm(self) -> float:  # noqa: N802
        """Largest less smallest stiffness of these cuts."""
        return float(np.asarray(self.figures["range_N_per_mm"], dtype=float))

    @property
    def complete(self) -> bool:
        """True if every sample of a cut is within reach."""
        return not self.out_of_reach.any()

    @property
    def below_required(self) -> list[tuple[int, float]]:
        """(line, smallest stiffness in N/mm) of cuts below what was required, weakest first."""
        return [] if self.required is None else required_stiffness_missed(self, self.required)

    @property
    def beyond_tolerance(self) -> list[tuple[int, float]]:
        """(line, error of the surface in um) of lines whose surface leaves the tolerance anywhere, worst first."""
        return [] if self.cut is None or self.tolerance is None else lines_beyond(self.cut, self.tolerance)

    @property
    def deviation_N_per_mm(self) -> FloatArray | None:  # noqa: N802
        """(n,) standard deviation of each sample's stiffness, of all that a band holds; None where none is stated."""
        return None if self.parameter_band is None else n_per_mm_from_n_per_m(self.parameter_band.deviation)

    def to_frame(self) -> DataFrame:
        """All samples as a pandas DataFrame, columns as in `samples.csv` and `cut.csv` (mm, degrees, N/mm, um)."""
        return frame_of(sample_columns(self) | ({} if self.cut is None else cut_columns(self, self.cut)))

    def to_dict(self) -> Document:
        """Document of `summary.json`."""
        return self._document

    @cached_property
    def _document(self) -> Document:
        document: dict[str, object] = without_nan(_summary(self))
        if self.required is not None:
            document["required"] = {
                "required_N_per_mm": n_per_mm_from_n_per_m(self.required),
                "below": without_nan([{"line": line, "min_N_per_mm": low} for line, low in self.below_required]),
            }
        if self.cut is not None:
            document["cut"] = without_nan(cut_document(self, self.cut, self.tolerance))
        if self.on_other is not None:
            other = self.on_other.to_dict()
            document["compare"] = compare_summaries(document, other)
            option = f"--compare {other['machine']}"  # otherwise the machines may look the same without a reason
            idle = [f"{option}: {row['effect']} does not act: {row['reason']}" for row in other["effects_idle"]]
            document["warnings"] = [*self.warnings, *idle]
        return document

    def _short(self) -> str:
        mean, low = number(self.mean_N_per_mm), number(self.min_N_per_mm)
        return f"{self.program.name} on {self.machine.name}, mean {mean} N/mm, min {low} N/mm"

    def plot_profile(self) -> Figure:
        """Stiffness along the path."""
        return self._figure("profile.png")

    def files(self, *, plots: bool = True, table: str = "csv") -> Mapping[str, Content | Callable[[], Content]]:
        """Files of `tps analyze`; samples as "csv" or "parquet"."""
        return self._files(plots, self.view.unwritten(table, self.cut is not None))


def analyze(
    machine: MachineTool | StiffnessModel,
    program: ReadProgram,
    *,
    origin: Pose | None = None,
    load: Load | str = defaults.LOAD,
    step: float = defaults.STEP,
    force: float = defaults.FORCE,
    partial: bool = False,
    turn: str | float = FIXED,
    progress: Progress | None = None,
) -> Analysis:
    r"""Analyze the stiffness along the path of a program.

    Parameters
    ----------
    machine
        A machine, or a model that carries further effects.
    program
        As read by `read_program`.
    origin
        Where program zero sits, m and rad; unless given, where the program says, else the machine's default.
    load
        Direction of the load, see `loads.LOADS`.
    step
        Largest distance of two samples, m.
    force
        Size of the load, N: for deflections, and for effects that depend on it.
    partial
        Keep the reachable samples of a program that leaves the workspace.
    turn
        How the tool is turned about its axis: "fixed", "feed", "best" or so many degrees, see `turning`.
    progress
        Called with (samples done, samples in all).

    Raises
    ------
    UnreachableError
        A cutting sample is out of reach and `partial` is not set.
    InputError
        The program cuts nothing, or uses machine coordinates and was read for another origin.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> slot = parse_program("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2\n", "slot.nc")
    >>> round(analyze(load_machine("nist"), slot, origin=(0.0, 0.0, 0.8, 0.0, 0.0, 0.0)).mean_N_per_mm)
    54353
    """
    model = machine if isinstance(machine, StiffnessModel) else build_model(machine)
    direction = parse_load(load) if isinstance(load, str) else load
    place_at, source = _effective_origin(model.machine, program, origin)
    words = model.machine.angles_of if program.native else None
    samples = sample_moves(program.moves, step, model.machine.rapid_feed, place_at, words)
    choice, poses = None, (samples.position, samples.abc, samples.tangent, samples.tool_length)
    if turn == FIXED:
        there = evaluate(model, *poses, direction, force, progress)
    else:
        choice = choose_turn(model, *poses, direction, turn)
        samples = replace(samples, abc=choice.abc)
        there = choice.evaluate(model, samples, direction, force, progress)
    analysis = Analysis(
        program=program,
        model=model,
        origin=place_at,
        origin_source=source,
        load=direction,
        force=force,
        step=step,
        samples=samples,
        at=there,
        turn=choice,
    )
    _check_reach(analysis, partial)
    return analysis


def _effective_origin(machine: MachineTool, program: ReadProgram, origin: Pose | None) -> tuple[Pose, str]:
    """Origin and its source: the option, otherwise the program's own, otherwise the machine's default."""
    chosen, source = program.origin, program.origin_source
    if origin is not None:
        chosen, source = origin, "option"
    elif source == "default":
        chosen = machine.default_origin
    if program.moves.from_machine.any() and not np.allclose(chosen, program.origin, rtol=0.0, atol=1e-12):
        raise ProgramError(
            "moves in machine coordinates (G53, G28, G30) depend on the position of program zero",
            hint=f"read the program with origin={tuple(round(v, 9) for v in chosen)}",
            file=program.name,
        )
    return chosen, source


def _warnings(analysis: Analysis) -> list[str]:
    """Warnings of the evaluation itself."""
    warnings, samples, there = [], analysis.samples, analysis.at
    warnings += joint_warnings(analysis, () if analysis.turn is None else analysis.turn.changes)
    rapids, swapped = ~samples.cutting & ~there.reachable, samples.cutting & there.substituted
    if rapids.any():
        first = int(np.argmax(rapids))
        warnings.append(
            f"line {samples.line[first]}: {int(rapids.sum())} samples of rapid moves are out of reach, first "
            f"{_sample_words(analysis, first)}"
        )
    if swapped.any():
        warnings.append(
            f"{lines_named(samples.line[swapped])}: the load direction does not exist there "
            "(rotary axes alone, or a move along the tool axis); the softest direction is used instead"
        )
    return warnings


def _sample_words(analysis: Analysis, i: int) -> str:
    """Pose of sample i, as a control would show it, and the limit that it breaks."""
    pose = [*analysis.samples.position[i], *analysis.samples.abc[i]]
    return f"at {pose_words(pose, '.3f')} (machine coordinates, mm): {analysis.at.reach.describe(i)}"


def _check_reach(analysis: Analysis, partial: bool) -> None:
    """Refuse a program that cuts nothing, or, unless `partial`, whose cuts leave the machine's reach."""
    cutting, bad = analysis.samples.cutting, analysis.out_of_reach
    if not cutting.any():
        raise ProgramError(
            "no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=analysis.program.name
        )
    if not bad.any() or (partial and not bad[cutting].all()):
        return
    first = int(np.argmax(bad))
    hint = "place the work elsewhere with --origin"
    hint += "" if partial else ", or keep the reachable part with --partial"
    if words_turn_the_platform(analysis.program):
        hint += "; if the program was posted for another machine, name it with [kinematics] in a controller file"
    raise UnreachableError(
        f"{int(bad.sum())} of {int(cutting.sum())} cutting samples are out of reach, first "
        f"{_sample_words(analysis, first)}",
        hint=hint,
        file=analysis.program.name,
        line=int(analysis.samples.line[first]),
    )


def _summary(analysis: Analysis) -> Document:
    """Figures of `summary.json`, in the shop's units."""
    samples, program, there, band = analysis.samples, analysis.program, analysis.at, analysis.parameter_band
    cutting, length = samples.cutting & there.reachable, mm_from_m(analysis.move_lengths)
    rapid, weight = program.moves.motion == RAPID, np.where(analysis.headline, samples.weight, 0.0)
    nearest = int(np.argmin(np.where(cutting, there.reach.margin, np.inf)))
    return {
        "program": program.name,
        "interpreter": program.interpreter,
        "kinematics": program.kinematics,
        "machine": analysis.machine.name,
        "load": str(analysis.load),
        "force_N": analysis.force,
        "step_mm": mm_from_m(analysis.step),
        "origin_mm_deg": list(pose_in_mm(analysis.origin)),
        "origin_source": analysis.origin_source,
        "samples": len(samples),
        "cutting_length_mm": float(length[~rapid].sum()),
        "rapid_length_mm": float(length[rapid].sum()),
        "time_s": float(samples.t[-1]),
        **analysis.figures,
        **({} if band is None else {"parameter_uncertainty": band_figures(band, there.stiffness, weight)}),
        "weakest_places": [describe_sample(analysis, row) for row in analysis.weakest_rows],
        "per_tool": per_tool(analysis),
        "per_operation": per_operation(analysis),
        "min_margin": float(there.reach.margin[nearest]),
        "min_margin_limit": there.reach.describe(nearest),
        "min_margin_line": int(samples.line[nearest]),
        "out_of_reach_samples": int(analysis.out_of_reach.sum()),
        **_of_kind(analysis, cutting),
        **effects_stated(analysis.model),
        "unsupported": to_dict(program.unsupported),
        "assumptions": assumptions_of(analysis, analysis.turn.sentence if analysis.turn else ""),
        "warnings": analysis.warnings,
        "version": defaults.VERSION,
    }


def _of_kind(analysis: Analysis, cutting: BoolArray) -> Document:
    """Entries for one kind of machine: share of extrapolated struts, or configuration of the joints."""
    if isinstance(analysis.machine, Hexapod):
        return {"extrapolated_share": share(analysis.at.extrapolated, cutting)}
    return {"configuration": analysis.at.configuration or None}


def compare_summaries(summary: Document, other: Document) -> Document:
    """Entry `compare` of `summary.json`.

    The other machine's figures, and `difference_percent`: how much higher each is than the first machine's
    (None where a figure is missing, or the first machine's is zero); the same for the mean of the plunges.
    """
    names = {name: name.partition("_N_per")[0].removesuffix("_um") for name in FIGURES}
    plunges = [(figures["plunges"] or {}).get("mean_N_per_mm") for figures in (summary, other)]
    return {
        "machine": other["machine"],
        "effects": list(other["effects"]),
        **{name: other[name] for name in (*FIGURES, *STANDING) if name in other},
        "difference_percent": {short: _higher(summary[name], other[name]) for name, short in names.items()},
        "headline": other["headline"],
        "plunges": other["plunges"],
        "plunges_difference_percent": _higher(*plunges),
    }


def _higher(first: float | None, second: float | None) -> float | None:
    """Percentage by which the second exceeds the first; None if it cannot be computed."""
    return None if first is None or second is None or not first else (second - first) / first * 100.0


def required_stiffness_missed(analysis: EvaluatedPath, required: float) -> list[tuple[int, float]]:
    """(line, smallest stiffness in N/mm) of cutting moves not known to have `required` N/m, weakest first.

    What has no stiffness does not have the required one: nan, before all others, for lines that are out of reach in
    part (`partial`), and for all cutting lines where no sample counts at all.
    """
    samples, counted, stiffness = analysis.samples, analysis.counted, analysis.at.stiffness
    cuts = samples.cutting & ((samples.weight > 0.0) | (not counted.any()))
    lines, index = np.unique(samples.line[cuts], return_inverse=True)
    lowest = np.full(len(lines), np.inf)
    np.minimum.at(lowest, index, np.where(counted & ~np.isnan(stiffness), stiffness, -np.inf)[cuts])
    missed = np.flatnonzero(lowest < required)
    missed = missed[np.argsort(lowest[missed], kind="stable")]
    shown = n_per_mm_from_n_per_m(np.where(np.isfinite(lowest), lowest, np.nan))[missed]
    return list(zip(lines[missed].tolist(), shown.tolist(), strict=True))
