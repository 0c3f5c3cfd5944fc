"""A plan: what to measure next, or first, and what that is expected to show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.documents import to_dict
from toolpath_stiff.files import Content
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.judgement import NAMED, Judgement, judge
from toolpath_stiff.inference.noise import Noise, noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.question import question
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.planning.campaign import RISER, TABLE, Campaign, first_campaign
from toolpath_stiff.planning.plan import RivalPlan, plan_measurements, plan_text
from toolpath_stiff.planning.rivals import Rival, errors_so_far, fitted_rivals, rivals_of, unfitted_rivals
from toolpath_stiff.planning.rows import plan_rows, visit_entries
from toolpath_stiff.planning.visits import Costs, Menu, with_options
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.results import FolderResult
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.units import certain

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

PLAN_POSES, CAMPAIGN_POSES = 6, 24


CAMPAIGN_NOISE = 0.02  # relative sd of a reading where nothing is known, of a plan without data; assumed


SHOWS = 3.0  # standard deviations from which on an effect is said to show


@dataclass(frozen=True, eq=False, repr=False)
class Plan(FolderResult):
    """What to measure next, or first, and what that is expected to show.

    Attributes
    ----------
    machine, data
        What is to be measured; what has been, None before the first campaign.
    choice
        Visits that tell rivals apart, or a first campaign, with arrays in SI.
    menu, costs
        What might vary, and what it costs.
    noise
        Relative sd of a reading, or (repeat, clamping), that was planned for.
    verdict, errors
        Of the diagnosis of the data, "" if none was made; mean errors so far, %.
    effect_files, names, seed, line, inputs
        For the record: names of the measurement files, the command; files that must not be written over.
    """

    command: ClassVar[str] = "plan"
    shown_by: ClassVar[str] = "plan"

    machine: Machine
    data: Measurements | None
    choice: RivalPlan | Campaign
    menu: Menu
    costs: Costs
    noise: float | tuple[float, float]
    verdict: str
    errors: Mapping[str, float]
    effect_files: tuple[str | Path, ...]
    names: tuple[str, ...]
    seed: int
    line: str = ""
    inputs: tuple[str, ...] = ()

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of plan.csv: a measurement file whose stiffness is left empty."""
        if isinstance(self.choice, RivalPlan):
            taken = () if self.data is None else set(self.data.point.tolist())
            return plan_rows(self.choice.visits, self.choice.chosen, taken)
        return plan_rows(self.choice.visits, range(len(self.choice.visits)), repeats=self.choice.repeats)

    @property
    def sentences(self) -> list[str]:
        """What the plan promises."""
        if isinstance(self.choice, Campaign):
            return self._campaign_sentences(self.choice)
        lines = plan_text(self.choice)
        if self.errors:
            steps = ", ".join(f"{name} {value:.2f} %" for name, value in self.errors.items())
            lines.insert(int(not self.choice.gains), f"mean error so far: {steps}")
        return lines

    def _campaign_sentences(self, campaign: Campaign) -> list[str]:
        poses, heights = ({row[key] for row in self.rows} for key in ("point", "z_mm"))
        hidden = ", ".join(name for name, gap in campaign.sees.items() if gap < SHOWS)
        lines = [
            f"{len(poses)} poses at {len(heights)} heights, {len(campaign.visits)} clampings, {len(self.rows)} "
            f"readings: about {campaign.minutes / 60.0:.0f} hours"
        ]
        return lines + (
            [f"of usual size and alone, these would not show at {self._noise_text} noise: {hidden}"] if hidden else []
        )

    @property
    def notes(self) -> list[str]:
        """What was assumed or left out."""
        if isinstance(self.choice, RivalPlan):
            return list(self.choice.notes)
        return [f"seen or not: at a noise of {self._noise_text}, each effect alone at its usual size"]

    @property
    def _noise_text(self) -> str:
        """As "2 %"; of a reading and of a clamping, "2 % and 1 %"."""
        parts = self.noise if isinstance(self.noise, tuple) else (self.noise,)
        return " and ".join(f"{100 * part:g} %" for part in parts)

    @property
    def visits(self) -> list[dict[str, Any]]:
        """One entry a clamping: where, how, what is read, why."""
        if isinstance(self.choice, RivalPlan):
            return visit_entries(self.rows, self.choice.kinds, self.choice.why)
        return visit_entries(self.rows, self.choice.purposes, self.choice.purposes)

    def to_dict(self) -> dict[str, Any]:
        """The content of plan.json."""
        choice = self.choice
        if isinstance(choice, RivalPlan):
            head = {
                "kind": "rivals",
                "verdict": self.verdict,
                "mean_abs_error_percent": dict(self.errors),
                "rivals": [{"name": rival.name, "probability": rival.weight} for rival in choice.rivals],
                "poses": len(choice.chosen),
                "readings": len(self.rows),
                "minutes": choice.minutes,
                "expected": {
                    "probability_of_truth_before": choice.before.truth,
                    "probability_of_truth_after": choice.after.truth,
                    "settled_before": choice.before.settled,
                    "settled_after": choice.after.settled,
                    "settled_at": NAMED,
                    "poses_to_settle": choice.enough,
                    "repeats_to_settle": choice.repeats,
                },
                "worth_measuring": choice.gains,
                "pairs": choice.pairs,
            }
        else:
            head = {
                "kind": "campaign",
                "poses": len({row["point"] for row in self.rows}),
                "readings": len(self.rows),
                "minutes": choice.minutes,
                "detectability": [{"effect": name, "separation_sigma": gap} for name, gap in choice.sees.items()],
            }
        tail = {
            "text": self.sentences,
            "notes": self.notes,
            "visits": self.visits,
            "machine": self.machine.name,
            "data": self.names,
            "seed": self.seed,
            "costs_minutes": self.costs,
            "command": self.line,
        }
        document: dict[str, Any] = certain(to_dict(head | tail))
        return document

    def to_frame(self) -> pd.DataFrame:
        """One row a reading, as in `plan.csv`: a measurement file with the stiffness left empty."""
        import pandas as pd

        return pd.DataFrame(self.rows)

    def plot(self) -> Figure:
        """The visits in the workspace."""
        figure: Figure = self.view.figure(self)
        return figure

    def _short(self) -> str:
        kind, count = "rivals" if isinstance(self.choice, RivalPlan) else "campaign", len(self.visits)
        return f"{kind}, {count} clamping{'' if count == 1 else 's'}"

    def files(self, *, plots: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """The files of `tps plan`."""
        files: Mapping[str, Content] = self.view.files(self, plots=plots)
        return files


def plan(
    machine: Machine,
    data: Measurements | None = None,
    *,
    between: Sequence[str] = (),
    n: int | None = None,
    radius: float | None = None,
    heights: Sequence[float] | None = None,
    max_tilt: float | None = None,
    loads: Sequence[float] | None = None,
    tool_extensions: Sequence[float] | None = None,
    setups: Sequence[str] | None = None,
    indicators: bool = False,
    costs: Costs | None = None,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    judgement: Judgement | None = None,
    names: Sequence[str] = (),
    line: str = "",
    inputs: tuple[str, ...] = (),
) -> Plan:
    """What to measure next, after some measurements; or first.

    Parameters
    ----------
    machine, data
        The model; n readings, or None for a plan before any.
    between
        Effects to be told apart, or `none`; empty: what a diagnosis leaves standing, or a first campaign.
    n
        Poses; None: 6, or 24 of a first campaign.
    radius, heights, max_tilt, loads, tool_extensions, setups
        What may vary, as in `Menu`: m, m, rad, N, m, names; None: the usual, and what the data have.
    indicators
        Whether a second indicator may be set across a link of the load path.
    costs
        Minutes of work.
    noise, strut_spread, effect_files, seed
        As in `diagnose`; without data, a noise of `CAMPAIGN_NOISE` is assumed.
    judgement
        What a diagnosis of these data came to already (`Diagnosis.main`): it is not made again.
    names, line, inputs
        Names of the measurement files and the command, for the record; files that must not be written over.

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
    costs = costs or Costs()
    menu = with_options(
        Menu(setups=(TABLE, RISER)) if data is None else Menu.of(data), radius=radius, heights=heights,
        max_tilt=max_tilt, loads=loads, tool_extensions=tool_extensions, setups=setups, indicators=indicators,
    )  # fmt: skip
    record = (tuple(effect_files), tuple(names), seed, line, inputs)
    effects = known_effects(effect_files)
    planned_for: float | tuple[float, float] = CAMPAIGN_NOISE if noise is None else noise
    if data is None and not between:
        campaign = first_campaign(
            machine, CAMPAIGN_POSES if n is None else n, menu=menu, costs=costs, seed=seed, effects=effects,
            noise=planned_for, effect_files=effect_files,
        )  # fmt: skip
        return Plan(machine, data, campaign, menu, costs, planned_for, "", {}, *record)
    verdict, errors = "", dict[str, float]()
    if data is None:
        rivals = unfitted_rivals(between, effects, setup=menu.setups[-1])
        notes = ["no data: the rivals are taken at their usual sizes"]
        notes += [] if noise is not None else [f"noise of a reading: {100 * CAMPAIGN_NOISE:g} % assumed"]
    else:
        rivals, verdict, scatter, problem, notes = _rivals_after(
            machine, data, between, effects, noise, strut_spread, effect_files, seed, judgement
        )
        planned_for, errors = (scatter.typical_repeat, scatter.clamping), errors_so_far(problem, rivals)
    found = plan_measurements(
        machine, rivals, planned_for, PLAN_POSES if n is None else n, menu=menu, costs=costs, seed=seed,
        effect_files=effect_files, strut_spread=strut_spread,
    )  # fmt: skip
    found = replace(found, notes=(*notes, *found.notes))
    return Plan(machine, data, found, menu, costs, planned_for, verdict, errors, *record)


def _rivals_after(
    machine: Machine,
    data: Measurements,
    between: Sequence[str],
    effects: Mapping[str, Effect],
    noise: float | tuple[float, float] | None,
    strut_spread: float,
    effect_files: Sequence[str | Path],
    seed: int,
    judgement: Judgement | None,
) -> tuple[list[Rival], str, Noise, Problem, list[str]]:
    """Rivals after some measurements, the diagnosis's verdict ("" if none was made), noise, problem, notes."""
    if judgement is not None:
        scatter, problem = judgement.noise, judgement.problem
    else:
        # Where nothing is known of the noise the larger guess is planned for: too many repeats do no harm.
        scatter = noise_models(data, noise, strut_spread)[-1]
        problem = Problem.of(Predictor(machine, data, effect_files), scatter)
    notes = [*filter(None, [question(problem.predictor)]), f"noise: {scatter.origin}"]
    if between:
        return fitted_rivals(problem, between, effects), "", scatter, problem, notes
    if judgement is None:
        judgement = judge(problem, scatter, testable_effects(problem.predictor)[0], seed)
    verdict = judgement.verdict
    if verdict == "described":
        notes.append("the answer is only described: the plan goes where it would show, or fail")
    elif verdict != "ambiguous":
        notes.append(f"the diagnosis is settled ({verdict}): the plan puts it to the test against what comes next")
    return rivals_of(judgement), verdict, scatter, problem, notes
