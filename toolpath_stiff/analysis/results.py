"""A program on a machine: sample its path, evaluate every sample, say what was assumed and what is out of reach."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.document import (
    compare_summaries,
    required_stiffness_missed,
    summarise,
    words_turn_the_platform,
)
from toolpath_stiff.analysis.evaluation import Evaluation, Progress, evaluate
from toolpath_stiff.analysis.loads import Load, parse_load
from toolpath_stiff.analysis.statistics import EvaluatedPath, sample_columns
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import number, without_nan
from toolpath_stiff.errors import ProgramError, UnreachableError
from toolpath_stiff.files import Content
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.nc.moves import Moves, ReadProgram
from toolpath_stiff.path.placing import place
from toolpath_stiff.path.sampling import Samples, sample_moves
from toolpath_stiff.poses import Pose
from toolpath_stiff.results import FolderResult, frame_of
from toolpath_stiff.stiffness.model import StiffnessModel, build_model, condition_warnings
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


MOST_NAMED = 5  # lines in a warning


@dataclass(frozen=True, repr=False, eq=False)
class Analysis(EvaluatedPath, FolderResult):
    r"""Stiffness along the path of a program, under a load at every sample of a cut.

    Attributes
    ----------
    required
        Stiffness that every cut must have, N/m; None: none.
    on_other
        The same on the machine compared with; None without one.

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

    required: float | None = None
    on_other: Analysis | None = None
    inputs: tuple[str, ...] = ()

    @property
    def moves(self) -> Moves:
        """The moves in machine coordinates; made anew each time, for a long program is a fifth of all memory."""
        return place(self.program.moves, self.origin)

    @property
    def mean_N_per_mm(self) -> float:  # noqa: N802  (newton)
        """Mean stiffness over the length of the cuts, plunges along the tool axis left out; nan without any."""
        return float(self.figures["mean_N_per_mm"] or np.nan)

    @property
    def min_N_per_mm(self) -> float:  # noqa: N802
        """The smallest stiffness of these cuts."""
        return float(self.figures["min_N_per_mm"] or np.nan)

    @property
    def range_N_per_mm(self) -> float:  # noqa: N802
        """The largest less the smallest."""
        span = self.figures["range_N_per_mm"]
        return np.nan if span is None else float(span)

    @property
    def complete(self) -> bool:
        """Whether every sample of a cut is within reach."""
        return not self.out_of_reach.any()

    @property
    def below_required(self) -> list[tuple[int, float]]:
        """(line, smallest stiffness in N/mm) of cuts below what was required, weakest first."""
        return [] if self.required is None else required_stiffness_missed(self, self.required)

    @property
    def deviation_N_per_mm(self) -> FloatArray | None:  # noqa: N802
        """(n,) standard deviation of each sample's stiffness from the fitted parameters; None where none is stated."""
        return None if self.parameter_band is None else n_per_mm_from_n_per_m(self.parameter_band.deviation)

    def to_frame(self) -> pd.DataFrame:
        """The samples as a pandas DataFrame, columns as in `samples.csv` (mm, degrees, N/mm)."""
        return frame_of(sample_columns(self))

    def to_dict(self) -> dict[str, Any]:
        """The document of `summary.json`."""
        return self._document

    @cached_property
    def _document(self) -> dict[str, Any]:
        summary: dict[str, Any] = {**summarise(self)}
        if self.required is not None:
            summary["required"] = {
                "required_N_per_mm": n_per_mm_from_n_per_m(self.required),
                "below": [{"line": line, "min_N_per_mm": lowest} for line, lowest in self.below_required],
            }
        if self.on_other is not None:
            other = self.on_other.to_dict()
            summary["compare"] = compare_summaries(summary, other)
            option = f"--compare {other['machine']}"  # without these the two machines may look the same
            idle = [f"{option}: {row['effect']} does not act: {row['reason']}" for row in other["effects_idle"]]
            summary["warnings"] = [*self.warnings, *idle]
        finite: dict[str, Any] = without_nan(summary)
        return finite

    def _short(self) -> str:
        mean, low = (number(self.to_dict()[name]) for name in ("mean_N_per_mm", "min_N_per_mm"))
        return f"{self.program.name} on {self.machine.name}, mean {mean} N/mm, min {low} N/mm"

    def plot(self, *, show_plunges: bool = False) -> Figure:
        """The path in three views, coloured by stiffness; with `show_plunges` these set axes and colours too."""
        return self._figure(show_plunges=show_plunges)

    def plot_profile(self, *, show_plunges: bool = False) -> Figure:
        """Stiffness along the path."""
        return self._figure("profile.png", show_plunges=show_plunges)

    def files(
        self, *, plots: bool = True, table: str = "csv", show_plunges: bool = False
    ) -> Mapping[str, Content | Callable[[], Content]]:
        """The files of `tps analyze`; samples as "csv" or "parquet"."""
        return self._files(plots, self.view.other_samples(table), show_plunges=show_plunges)


def analyze(
    machine: Hexapod | StiffnessModel,
    program: ReadProgram,
    *,
    origin: Pose | None = None,
    load: Load | str = defaults.LOAD,
    step: float = defaults.STEP,
    force: float = defaults.FORCE,
    partial: bool = False,
    progress: Progress | None = None,
) -> Analysis:
    r"""Stiffness along the path of a program.

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
    samples = sample_moves(place(program.moves, place_at), step, model.machine.rapid_feed, place_at)
    evaluation = evaluate(
        model, samples.position, samples.abc, samples.tangent, samples.tool_length, direction, force, progress
    )
    warnings = [*map(str, program.warnings), *condition_warnings(model), *_warnings(samples, evaluation)]
    analysis = Analysis(
        program=program, model=model, origin=place_at, origin_source=source, load=direction, force=force, step=step,
        samples=samples, at=evaluation, warnings=warnings,
    )  # fmt: skip
    _check_reach(analysis, partial)
    return analysis


def _effective_origin(machine: Hexapod, program: ReadProgram, origin: Pose | None) -> tuple[Pose, str]:
    """The option, else the program's own word, else the machine's default."""
    chosen, source = program.origin, program.origin_source
    if origin is not None:
        chosen, source = origin, "option"
    elif source == "default":
        chosen = machine.default_origin
    if program.moves.from_machine.any() and not np.allclose(chosen, program.origin, rtol=0.0, atol=1e-12):
        raise ProgramError(
            "moves in machine coordinates (G53, G28, G30) depend on where program zero sits",
            hint=f"read the program with origin={tuple(round(v, 9) for v in chosen)}",
            file=program.name,
        )
    return chosen, source


def _warnings(samples: Samples, evaluation: Evaluation) -> list[str]:
    """What the evaluation itself has to say."""
    warnings = []
    rapids, swapped = ~samples.cutting & ~evaluation.reachable, samples.cutting & evaluation.substituted
    if rapids.any():
        first = int(np.argmax(rapids))
        warnings.append(
            f"line {samples.line[first]}: {int(rapids.sum())} samples of rapid moves are out of reach, first "
            f"{describe_pose(samples, first)}: {evaluation.reach.describe(first)}"
        )
    if swapped.any():
        lines = np.unique(samples.line[swapped])
        more = f" and {len(lines) - MOST_NAMED} more" if len(lines) > MOST_NAMED else ""
        warnings.append(
            f"lines {', '.join(map(str, lines[:MOST_NAMED]))}{more}: the load direction does not exist there "
            "(rotary axes alone, or a move along the tool axis); the softest direction stands in"
        )
    return warnings


def describe_pose(samples: Samples, i: int) -> str:
    """The pose of sample i as a control would show it, machine coordinates."""
    values = [*mm_from_m(samples.position[i]), *deg_from_rad(samples.abc[i])]
    words = [f"{axis}{value:.3f}" for axis, value in zip("XYZABC", values, strict=True)]
    return f"at {' '.join(words if samples.abc[i].any() else words[:3])} (machine coordinates, mm)"


def _check_reach(analysis: Analysis, partial: bool) -> None:
    """Refuse a program that cuts nothing, or, unless `partial`, whose cuts leave the machine's reach."""
    samples, evaluation = analysis.samples, analysis.at
    if not samples.cutting.any():
        raise ProgramError(
            "no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=analysis.program.name
        )
    bad = analysis.out_of_reach
    if not bad.any() or (partial and not bad[samples.cutting].all()):
        return
    first = int(np.argmax(bad))
    hint = "place the work elsewhere with --origin"
    hint += "" if partial else ", or keep the reachable part with --partial"
    if words_turn_the_platform(analysis.program):
        hint += "; if the program was posted for another machine, name it with [kinematics] in a controller file"
    raise UnreachableError(
        f"{int(bad.sum())} of {int(samples.cutting.sum())} cutting samples are out of reach, first "
        f"{describe_pose(samples, first)}: {evaluation.reach.describe(first)}",
        hint=hint,
        file=analysis.program.name,
        line=int(samples.line[first]),
    )
