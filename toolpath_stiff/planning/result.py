"""A plan: what to measure next, or first, and what that is expected to show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.documents import Document, certain, to_dict
from toolpath_stiff.files import Content
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.judgement import Judgement, judge
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.campaign import RISER, TABLE, Campaign, first_campaign
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.plan import RivalPlan, plan_measurements
from toolpath_stiff.planning.rivals import errors_so_far, fitted_rivals, rivals_of, unfitted_rivals
from toolpath_stiff.planning.rows import PlanRow, plan_rows, visit_entries
from toolpath_stiff.planning.tables import TABLES
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.results import FolderResult
from toolpath_stiff.stiffness.catalogue import known_effects

if TYPE_CHECKING:
    import pandas as pd

PLAN_POSES, CAMPAIGN_POSES = 6, 24
CAMPAIGN_NOISE = 0.02  # relative sd of a reading where nothing is known, of a plan without data; assumed


@dataclass(frozen=True, eq=False, repr=False)
class Plan(FolderResult):
    """A plan of what to measure next, or first, and what that is expected to show.

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

    machine: Hexapod
    data: Readings | None
    choice: RivalPlan | Campaign
    effect_files: tuple[str | Path, ...]
    seed: int
    names: tuple[str, ...] = ()
    line: str = ""
    inputs: tuple[str, ...] = ()

    @cached_property
    def rows(self) -> list[PlanRow]:
        """The rows of plan.csv: a measurement file whose stiffness is left empty."""
        return plan_rows(self.choice.visits, self.choice.chosen, () if self.data is None else self.data.point.tolist())

    @property
    def visits(self) -> list[Document]:
        """One entry a clamping: where, how, what is read, why."""
        choice = self.choice
        return visit_entries(choice.visits, choice.chosen, self.rows, choice.kinds, choice.why)

    def to_dict(self) -> dict[str, Any]:
        """The content of plan.json."""
        document: dict[str, Any] = certain(
            to_dict(
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
        )
        return document

    def to_frame(self) -> pd.DataFrame:
        """One row a reading, as in `plan.csv`: a measurement file with the stiffness left empty."""
        import pandas as pd

        return pd.DataFrame(self.rows)

    def files(self, *, plots: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """The files of `tps plan`."""
        return self._files(plots, () if isinstance(self.choice, RivalPlan) else (TABLES,))

    def _short(self) -> str:
        kind = "rivals" if isinstance(self.choice, RivalPlan) else "campaign"
        return f"{kind}, {len(self.choice.chosen)} clampings"


def plan(
    machine: Hexapod,
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
) -> Plan:
    """Plan what to measure next, after some measurements; or first.

    Parameters
    ----------
    machine, data
        The model; n readings, or None for a plan before any.
    menu
        What may vary, and what it costs; None: the usual, and what the data have (`usual_menu`).
    between
        Effects to be told apart, or `none`; empty: what a diagnosis leaves standing, or a first campaign.
    n
        Poses; None: 6, or 24 of a first campaign.
    noise, strut_spread, effect_files, seed
        As in `diagnose`; without data, a noise of `CAMPAIGN_NOISE` is assumed.
    judgement
        What a diagnosis of these data came to already (`Diagnosis.main`): it is not made again.

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
    menu, effects = menu or usual_menu(data), known_effects(effect_files)
    planned_for: float | tuple[float, float] = CAMPAIGN_NOISE if noise is None else noise
    if data is None and not between:
        poses = CAMPAIGN_POSES if n is None else n
        campaign = first_campaign(machine, poses, menu, seed, effects, planned_for, effect_files)
        return Plan(machine, data, campaign, tuple(effect_files), seed)
    verdict, errors = "", dict[str, float]()
    if data is None:
        rivals = unfitted_rivals(between, effects, setup=menu.setups[-1])
        notes = ["no data: the rivals are taken at their usual sizes"]
        notes += [] if noise is not None else [f"noise of a reading: {100 * CAMPAIGN_NOISE:g} % assumed"]
    else:
        # Where nothing is known of the noise the larger guess is planned for: too many repeats do no harm.
        scatter = judgement.noise if judgement else noise_models(data, noise, strut_spread)[-1]
        problem = judgement.problem if judgement else Problem.of(Predictor(machine, data, effect_files), scatter)
        notes = [*filter(None, [question(problem.predictor)]), f"noise: {scatter.origin}"]
        if between:
            rivals = fitted_rivals(problem, between, effects)
        else:
            judgement = judgement or judge(problem, scatter, testable_effects(problem.predictor)[0], seed)
            rivals, verdict = rivals_of(judgement), judgement.verdict
            if verdict == "described":
                notes.append("the answer is only described: the plan goes where it would show, or fail")
            elif verdict != "ambiguous":
                notes.append(
                    f"the diagnosis is settled ({verdict}): the plan puts it to the test against what comes next"
                )
        planned_for, errors = (scatter.typical_repeat, scatter.clamping), errors_so_far(problem, rivals)
    choice = plan_measurements(
        machine, rivals, planned_for, PLAN_POSES if n is None else n, menu=menu, seed=seed,
        effect_files=effect_files, strut_spread=strut_spread,
    )  # fmt: skip
    choice = replace(choice, notes=(*notes, *choice.notes), verdict=verdict, errors=errors)
    return Plan(machine, data, choice, tuple(effect_files), seed)


def usual_menu(data: Readings | None) -> Menu:
    """The menu unless anyone says otherwise: what the data have, before any a bare table and a riser."""
    return Menu(setups=(TABLE, RISER)) if data is None else Menu.of(data)
