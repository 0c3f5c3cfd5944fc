"""A program on a machine: sample its path, evaluate every sample, say what was assumed and what is out of reach."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.loads import RULES, Load, parse_load
from toolpath_stiff.analysis.poses import PoseStiffness, Progress, evaluate
from toolpath_stiff.analysis.statistics import (
    EvaluatedPath,
    ParameterBand,
    band_figures,
    describe_sample,
    parameter_band,
    path_length,
    per_operation,
    per_tool,
    samples_frame,
    share,
)
from toolpath_stiff.arrays import IntArray
from toolpath_stiff.errors import ProgramError, UnreachableError
from toolpath_stiff.hints import both_names
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.nc.moves import CUTTER_LOCATION, Moves, Program
from toolpath_stiff.path import Samples, place, sample_moves
from toolpath_stiff.stiffness.model import (
    StiffnessModel,
    acting_effects,
    build_model,
    condition_warnings,
    conditions_stated,
    effects_stated,
)
from toolpath_stiff.units import Pose, deg_from_rad, mm_from_m, mm_per_min_from_m_per_s, n_per_mm_from_n_per_m

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Analysis(EvaluatedPath):
    """A program evaluated on a machine: the evaluated path, and what it was asked.

    Attributes
    ----------
    model
        The machine with its effects.
    origin, origin_source
        Where program zero sits (m, rad) and who said so: "option", "program" or "default".
    step
        Distance of the samples in m.
    warnings
        What deserves a look, plain sentences, the program's own included.
    """

    model: StiffnessModel
    origin: Pose
    origin_source: str
    step: float
    warnings: tuple[str, ...]

    @property
    def moves(self) -> Moves:
        """The moves in machine coordinates; made anew each time, for a long program is a fifth of all memory."""
        return place(self.program.moves, self.origin)

    @property
    def machine(self) -> Machine:
        """The machine, geometry effects included."""
        return self.model.machine

    @cached_property
    def parameter_band(self) -> ParameterBand | None:
        """What the uncertainty of the machine's fitted parameters does to the stiffness; None if none is known."""
        return parameter_band(self, self.model)

    def to_frame(self) -> pd.DataFrame:
        """The samples as a pandas DataFrame, columns as in `samples.csv` (mm, degrees, N/mm)."""
        return samples_frame(self)

    def summary(self) -> dict[str, object]:
        """The figures of `summary.json`."""
        return summarise(self)


def analyze(
    machine: Machine | StiffnessModel,
    program: Program,
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
    >>> round(analyze(load_machine("nist"), slot, origin=(0.0, 0.0, 0.8, 0.0, 0.0, 0.0)).summary()["mean_N_per_mm"])
    54353
    """
    model = machine if isinstance(machine, StiffnessModel) else build_model(machine)
    direction = parse_load(load) if isinstance(load, str) else load
    place_at, source = _effective_origin(model.machine, program, origin)
    samples = sample_moves(place(program.moves, place_at), step, model.machine.rapid_feed, place_at)
    at = evaluate(
        model, samples.position, samples.abc, samples.tangent, samples.tool_length, direction, force, progress
    )
    tool_given = not np.isnan(samples.tool_length[samples.cutting]).any()
    warnings = (*program.warnings, *condition_warnings(model, tool_given), *_warnings(samples, at))
    analysis = Analysis(
        program=program, model=model, origin=place_at, origin_source=source, load=direction, force=force, step=step,
        samples=samples, at=at, warnings=warnings,
    )  # fmt: skip
    _check_reach(analysis, partial)
    return analysis


def _effective_origin(machine: Machine, program: Program, origin: Pose | None) -> tuple[Pose, str]:
    """The option, else the program's own word, else the machine's default."""
    if origin is not None:
        chosen, source = origin, "option"
    elif program.origin_source == "default":
        chosen, source = machine.default_origin, "default"
    else:
        chosen, source = program.origin, program.origin_source
    if program.moves.from_machine.any() and not np.allclose(chosen, program.origin, rtol=0.0, atol=1e-12):
        raise ProgramError(
            "moves in machine coordinates (G53, G28, G30) depend on where program zero sits",
            hint=f"read the program with origin={tuple(round(v, 9) for v in chosen)}",
            file=program.name,
        )
    return chosen, source


def _warnings(samples: Samples, at: PoseStiffness) -> list[str]:
    """What the evaluation itself has to say."""
    found = []
    rapids = ~samples.cutting & ~at.reachable
    if rapids.any():
        first = int(np.argmax(rapids))
        found.append(
            f"line {samples.line[first]}: {int(rapids.sum())} samples of rapid moves are out of reach, first "
            f"{describe_pose(samples, first)}: {at.reach.describe(first)}"
        )
    swapped = samples.cutting & at.substituted
    if swapped.any():
        lines = np.unique(samples.line[swapped])
        found.append(
            f"{_lines(lines)}: the load direction does not exist there (rotary axes alone, or a move along "
            "the tool axis); the softest direction stands in"
        )
    return found


def _lines(lines: IntArray, most: int = 5) -> str:
    """Line numbers in words: "lines 3, 4, 9 and 12 more"."""
    shown = ", ".join(str(line) for line in lines[:most])
    more = f" and {len(lines) - most} more" if len(lines) > most else ""
    return f"line{'s' if len(lines) > 1 else ''} {shown}{more}"


def describe_pose(samples: Samples, i: int) -> str:
    """The pose of sample i as a control would show it, machine coordinates."""
    x, y, z = (mm_from_m(float(v)) for v in samples.position[i])
    a, b, c = (deg_from_rad(float(v)) for v in samples.abc[i])
    text = f"at X{x:.3f} Y{y:.3f} Z{z:.3f}"
    return text + (f" A{a:.3f} B{b:.3f} C{c:.3f}" if a or b or c else "") + " (machine coordinates, mm)"


def _check_reach(analysis: Analysis, partial: bool) -> None:
    """Refuse a program that cuts nothing, or, unless `partial`, whose cuts leave the machine's reach."""
    samples, at = analysis.samples, analysis.at
    if not samples.cutting.any():
        raise ProgramError(
            "no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=analysis.program.name
        )
    bad = analysis.out_of_reach
    if not bad.any() or (partial and not bad[samples.cutting].all()):
        return
    first = int(np.argmax(bad))
    hint = f"place the work elsewhere with {both_names('--origin')}, or keep the reachable part with --partial"
    if partial:
        hint = f"place the work elsewhere with {both_names('--origin')}"
    if _words_turn_the_platform(analysis.program):
        hint += "; if the program was posted for another machine, name it with [kinematics] in a controller file"
    raise UnreachableError(
        f"{int(bad.sum())} of {int(samples.cutting.sum())} cutting samples are out of reach, first "
        f"{describe_pose(samples, first)}: {at.reach.describe(first)}",
        hint=hint,
        file=analysis.program.name,
        line=int(samples.line[first]),
    )


def _words_turn_the_platform(program: Program) -> bool:
    """Whether rotary words were taken for the platform's own angles."""
    own = not program.kinematics and program.dialect != CUTTER_LOCATION
    return own and bool(program.moves.start[:, 3:].any() or program.moves.end[:, 3:].any())


def assumptions(analysis: Analysis) -> list[str]:
    """Everything that was assumed or recovered rather than published or given; plain sentences."""
    machine = analysis.machine
    found = list(analysis.program.assumptions)
    if _words_turn_the_platform(analysis.program):
        found.append(
            "A, B, C of the program are roll, pitch, yaw of the platform (see [kinematics] of controller files)"
        )
    x, y, z, *angles = analysis.origin
    where = f"X{mm_from_m(x):g} Y{mm_from_m(y):g} Z{mm_from_m(z):g}" + (
        " A{:g} B{:g} C{:g}".format(*(deg_from_rad(v) for v in angles)) if any(angles) else ""
    )
    if analysis.origin_source == "default":
        found.append(
            f"program zero (G54) sits at {where} in machine coordinates, the machine's default; "
            f"{both_names('--origin')} puts it elsewhere"
        )
    for quantity, origin in machine.origins.items():
        if origin != "published":
            remark = machine.remarks.get(quantity)
            found.append(f"machine {machine.name}: {quantity} {origin}" + (f": {remark}" if remark else ""))
    feed = mm_per_min_from_m_per_s(machine.rapid_feed)
    found.append(f"rapid moves take {feed:g} mm/min (time only)")
    found.append(f"load {analysis.load}: {RULES[analysis.load.kind]}")
    found += conditions_stated(analysis.model)
    acting = acting_effects(analysis.model)
    load_dependent = any(active.effect.load_dependent for active in acting)
    secant = "; the stiffness is the secant one at this load" if load_dependent else ""
    found.append(f"a force of {analysis.force:g} N for deflections{secant}")
    law = machine.strut_law
    found.append(
        "the stiffness of a strut is the same at every length"
        if law.constant
        else f"the strut law is extrapolated outside {mm_from_m(min(law.length_1, law.length_2)):.1f} to "
        f"{mm_from_m(max(law.length_1, law.length_2)):.1f} mm of strut length"
    )
    if analysis.parameter_band is not None:
        found.append(
            "the band of the stiffness holds the uncertainty of the fitted parameters alone, propagated linearly: "
            f"{', '.join(analysis.parameter_band.names)}"
        )
    if not acting:
        found.append("platform, frame, joints, spindle, tool and table are rigid: the struts alone give way")
    return found


def summarise(analysis: Analysis) -> dict[str, Any]:
    """The figures of `summary.json`, in the shop's units."""
    samples = analysis.samples
    places = analysis.weakest
    cutting = samples.cutting & analysis.at.reachable
    x, y, z, a, b, c = analysis.origin
    nearest = int(np.argmin(np.where(cutting, analysis.at.margin, np.inf)))
    band = None if analysis.parameter_band is None else band_figures(analysis, analysis.parameter_band)
    return {
        "program": analysis.program.name,
        "interpreter": analysis.program.interpreter,
        "kinematics": analysis.program.kinematics,
        "machine": analysis.machine.name,
        "load": str(analysis.load),
        "force_N": analysis.force,
        "step_mm": mm_from_m(analysis.step),
        "origin_mm_deg": [mm_from_m(x), mm_from_m(y), mm_from_m(z), *(deg_from_rad(v) for v in (a, b, c))],
        "origin_source": analysis.origin_source,
        "samples": len(samples),
        "cutting_length_mm": mm_from_m(path_length(samples, rapid=False)),
        "rapid_length_mm": mm_from_m(path_length(samples, rapid=True)),
        "time_s": float(samples.t[-1]) if len(samples) else 0.0,
        **analysis.figures,
        **({} if band is None else {"parameter_uncertainty": band}),
        "weakest_places": [describe_sample(analysis, row) for row in places],
        "per_tool": per_tool(analysis),
        "per_operation": per_operation(analysis),
        "min_margin": float(analysis.at.margin[nearest]),
        "min_margin_limit": analysis.at.reach.describe(nearest),
        "min_margin_line": int(samples.line[nearest]),
        "out_of_reach_samples": int(analysis.out_of_reach.sum()),
        "extrapolated_share": share(analysis.at.extrapolated, cutting),
        **effects_stated(analysis.model),
        "unsupported": [
            {"line": u.line, "column": u.column, "word": u.word, "reason": u.reason}
            for u in analysis.program.unsupported
        ],
        "assumptions": assumptions(analysis),
        "warnings": list(analysis.warnings),
        "version": defaults.VERSION,
    }


def required_stiffness_missed(analysis: Analysis, required: float) -> list[tuple[int, float]]:
    """(line, smallest stiffness in N/mm) of cutting moves that are not known to have `required` N/m, weakest first.

    What has no stiffness does not have the required one: nan, before all others, for lines that are out of reach in
    part (`partial`), and for all cutting lines where no sample counts at all.
    """
    samples, counted = analysis.samples, analysis.counted
    asked = samples.cutting & ((samples.weight > 0.0) | (not counted.any()))
    stiffness = np.where(counted, analysis.at.stiffness, np.nan)[asked]
    lines, index = np.unique(samples.line[asked], return_inverse=True)
    lowest = np.full(len(lines), np.inf)
    with np.errstate(invalid="ignore"):
        np.minimum.at(lowest, index, stiffness)
    missed = np.flatnonzero(~(lowest >= required))
    order = missed[np.argsort(np.nan_to_num(lowest[missed], nan=-np.inf), kind="stable")]
    return [(int(lines[i]), n_per_mm_from_n_per_m(float(lowest[i]))) for i in order]
