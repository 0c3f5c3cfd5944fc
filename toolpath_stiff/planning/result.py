"""A plan of what to measure, next or first, with its expected outcome; a measurement file to fill in."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.documents import Document, certain, records, to_dict
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.judgement import Judgement, judge
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.elements import turns
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.planning.campaign import Campaign, first_campaign
from toolpath_stiff.planning.forecasts import Rival
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.plan import MOST_RIVALS, RivalPlan, plan_measurements
from toolpath_stiff.planning.rivals import errors_so_far, fitted_rivals, rivals_of, unfitted_rivals
from toolpath_stiff.planning.visits import AXES, Visits
from toolpath_stiff.readings.measurements import Readings, point_names
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.units import deg_from_rad, min_from_s, mm_from_m

PLAN_POSES, CAMPAIGN_POSES = 6, 24
CAMPAIGN_NOISE = 0.02  # relative sd of a reading where nothing is known, of a plan without data; assumed
POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
PlanRow = dict[str, float | str]  # a reading, by the columns of a measurement file


@dataclass(frozen=True, eq=False, repr=False)
class Plan(FolderResult):
    """A plan of what to measure, next or first, with its expected outcome.

    Attributes
    ----------
    machine, data
        What is to be measured; what has been, None before the first campaign.
    choice
        Visits that tell rivals apart, or a first campaign, with arrays in SI.
    effect_files, seed, names, line, inputs
        For the record: names of the measurement files, the command; files that must not be written over.
    """

    command: ClassVar[str] = "plan"
    shown_by: ClassVar[str] = "plan"

    machine: MachineTool
    data: Readings | None
    choice: RivalPlan | Campaign
    effect_files: tuple[str | Path, ...]
    seed: int
    names: tuple[str, ...] = ()
    line: str = ""
    inputs: tuple[str, ...] = ()

    @cached_property
    def rows(self) -> list[PlanRow]:
        """Rows of plan.csv: a measurement file with the stiffness left empty."""
        return plan_rows(self.choice.visits, self.choice.chosen, () if self.data is None else self.data.point.tolist())

    @property
    def visits(self) -> list[Document]:
        """One entry per clamping: pose, set-up, readings, purpose."""
        choice, first = self.choice, {row["clamp"]: row for row in reversed(self.rows)}
        visits, entries = choice.visits, list[Document]()
        for clamp, (visit, kind, why) in enumerate(zip(choice.chosen, choice.kinds, choice.why, strict=True), 1):
            taken = visits.rows(visit)
            entries.append(
                {key: first[clamp][key] for key in ("clamp", "point", *POSE, "tool_extension_mm")}
                | {
                    "setup": str(visits.setup[visit]),
                    "forces_N": sorted(set(_round(visits.readings.force[taken]).tolist())),
                    "directions": list(dict.fromkeys(visits.names[taken].tolist())),
                    "loops": list(dict.fromkeys(filter(None, visits.readings.loop[taken].tolist()))),
                    "kind": kind,
                    "why": why,
                }
            )
        return entries

    def to_dict(self) -> dict[str, Any]:
        """Content of plan.json."""
        document = to_dict(
            {
                **self.choice.head(),
                "text": self.choice.sentences,
                "notes": self.choice.notes,
                "visits": self.visits,
                "machine": self.machine.name,
                "data": self.names,
                "seed": self.seed,
                "costs_minutes": self.choice.visits.menu.costs,
                "command": self.line,
            }
        )
        return dict(certain(document))

    def to_frame(self) -> DataFrame:
        """One row per reading, as in `plan.csv`: a measurement file with the stiffness left empty."""
        return frame_of(self.rows)

    def _short(self) -> str:
        kind = "rivals" if isinstance(self.choice, RivalPlan) else "campaign"
        return f"{kind}, {len(self.choice.chosen)} clampings"


def plan_rows(visits: Visits, chosen: Sequence[int], taken: Collection[str] = ()) -> list[PlanRow]:
    """Rows of a measurement file in shop units, in measuring order.

    Parameters
    ----------
    visits, chosen
        The visits in measuring order; each is one clamping.
    taken
        Names of points that new points must not have.
    """
    planned = [visits.rows(visit) for visit in chosen]
    rows, counts = np.concatenate(planned), [len(each) for each in planned]
    visit, clamp = (np.repeat(of, counts) for of in (list(chosen), range(1, len(planned) + 1)))
    readings, names, setup = visits.readings.select(rows), visits.names[rows], visits.setup[visit]
    pose = np.concatenate([mm_from_m(visits.pose[visit, :3]), deg_from_rad(visits.pose[visit, 3:])], axis=1)
    empty, beside = np.full(len(rows), ""), bool((readings.loop != "").any())
    axes = {"direction": names}
    if not np.isin(names, AXES).all():  # files allow vectors of any length: directions in whole numbers
        axes = {f"d{axis.lower()}": (np.char.find(names, axis) >= 0).astype(int) for axis in AXES}
    columns = {
        **dict(zip(POSE, _round(pose).T, strict=True)),
        **axes,
        "stiffness_N_per_mm": empty,
        **({"loop": readings.loop, "displacement_um": empty} if beside else {}),
        "force_N": _round(readings.force),
        **({"setup": setup} if (setup != "").any() else {}),
        "clamp": clamp,
        "repeat": visits.rounds[rows],
        "point": point_names(visits.pose[visit], visits.label[visit], "plan ", taken),
        **({} if np.isnan(visits.readings.time).any() else {"time_min": _round(min_from_s(readings.time))}),
        "tool_extension_mm": _round(mm_from_m(visits.extension[visit])),
    }
    return records(columns)


def _round(values: FloatArray) -> FloatArray:
    """Values rounded to six decimals, so that nobody has to key in 0.30000000000000004."""
    return np.round(values, 6) + 0.0


def plan_csv(rows: Sequence[PlanRow]) -> str:
    """The rows as CSV."""
    cells = [[value if isinstance(value, str) else f"{value:.10g}" for value in row.values()] for row in rows]
    return csv_text(rows[0], cells)


def elements_apart(machine: MachineTool) -> list[str]:
    """Rivals of a first campaign on a machine of elements: each joint soft in torsion, then each other element soft."""
    turn = [f"joint_torsion:{element.name}" for element in machine.elements if turns(element)]
    soft = [f"weak_element:{element.name}" for element in machine.elements if not turns(element)]
    return [*turn, *soft][:MOST_RIVALS]


def plan(
    machine: MachineTool,
    data: Readings | None = None,
    menu: Menu | None = None,
    *,
    between: Sequence[str] = (),
    n: int | None = None,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    judgement: Judgement | None = None,
    rivals: Sequence[Rival] = (),
) -> Plan:
    """Plan what to measure next after some measurements, or first.

    Parameters
    ----------
    machine, data
        The model; n readings, or None for a plan before any.
    menu
        What may vary, and what it costs; None: the usual, and what the data have (`Menu.of`).
    between
        Effects to be told apart, or `none`; empty: what a diagnosis leaves standing, or a first campaign.
    n
        Poses; None: 6, or 24 of a first campaign.
    noise, strut_spread, effect_files, seed
        As in `diagnose`; without data, a noise of `CAMPAIGN_NOISE` is assumed.
    judgement
        What a diagnosis of these data came to already (`Diagnosis.main`): it is not made again.
    rivals
        Of a machine of elements: what its pulls leave, fitted to them.

    Raises
    ------
    InputError
        An unknown effect, a number of poses or a menu that cannot be, no reachable pose.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> found = plan(load_machine("nist"), between=("spindle_compliance", "none"), n=2)
    >>> len(found.choice.chosen), found.choice.separable
    (2, True)
    """
    menu, effects = menu or Menu.of(data), known_effects(effect_files, machine.kind)
    if not isinstance(machine, Hexapod):
        menu = replace(menu, setups=("",))  # no rival belongs to one
        if np.isnan(machine.reference_tool_length):
            menu = replace(menu, tool_extensions=(0.0,))
        if not between and not rivals:
            between, n = elements_apart(machine), CAMPAIGN_POSES if n is None else n
    planned_for: float | tuple[float, float] = CAMPAIGN_NOISE if noise is None else noise
    if isinstance(machine, Hexapod) and data is None and not between:
        poses = CAMPAIGN_POSES if n is None else n
        campaign = first_campaign(machine, poses, menu, seed, effects, planned_for, effect_files)
        return Plan(machine, data, campaign, tuple(effect_files), seed)
    verdict, errors = "", dict[str, float]()
    notes = list[str]()
    if rivals:
        notes.append(f"noise of a reading: {100 * np.hypot.reduce(np.atleast_1d(planned_for)):.2g} %")
    elif data is None or not isinstance(machine, Hexapod):
        rivals = unfitted_rivals(between, effects, setup=menu.setups[-1])
        notes += ["no data: the rivals are taken at their usual sizes"]
        notes += [] if noise is not None else [f"noise of a reading: {100 * CAMPAIGN_NOISE:g} % assumed"]
    else:
        # With unknown noise, plan for the larger guess: too many repeats do no harm.
        scatter = judgement.noise if judgement else noise_models(data, noise, strut_spread)[-1]
        problem = judgement.problem if judgement else Problem.of(Predictor(machine, data, effect_files), scatter)
        notes = [*filter(None, [question(problem.predictor)]), f"noise: {scatter.origin}"]
        if between:
            rivals = fitted_rivals(problem, between, effects)
        else:
            judgement = judgement or judge(problem, scatter, testable_effects(problem.predictor)[0], seed)
            rivals, verdict = rivals_of(judgement), judgement.verdict
            if verdict == "described":
                notes.append("the effect is only described: the plan measures where it would be confirmed or refuted")
            elif verdict != "ambiguous":
                notes.append(
                    f"the diagnosis is settled ({verdict}): the plan tests it against the next best explanation"
                )
        planned_for, errors = (scatter.typical_repeat, scatter.clamping), errors_so_far(problem, rivals)
    choice = plan_measurements(
        machine, rivals, planned_for, PLAN_POSES if n is None else n, menu=menu, seed=seed,
        effect_files=effect_files, strut_spread=strut_spread,
    )  # fmt: skip
    choice = replace(choice, notes=(*notes, *choice.notes), verdict=verdict, errors=errors)
    return Plan(machine, data, choice, tuple(effect_files), seed)
