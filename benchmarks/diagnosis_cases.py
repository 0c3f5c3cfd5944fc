"""Blind cases of the diagnosis benchmark: drawn by the rig, diagnosed, and written down as one record each."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.bars import Record
from benchmarks.case_loop import record_of
from benchmarks.random_visits import random_visits
from toolpath_stiff.diagnosis.diagnose import Diagnosis, diagnose
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.plan import RivalPlan, plan_measurements
from toolpath_stiff.planning.result import plan_csv, plan_rows
from toolpath_stiff.planning.rivals import rivals_of
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig import case as case_module
from toolpath_stiff.rig import exercise
from toolpath_stiff.rig.exercise import read_plan

LAYOUTS = ("tilted", "paper")
POSES = (2, 4, 6)  # planned poses after which the verdict is asked again
PLANNED_CASES = 25
MISSTATED = (0.5, 2.0)  # stated noise over the true one
CLAMPS_LATER = 1000  # added to a plan's clamp numbers, which begin at 1 as the campaign's do
RANDOM_DRAWS = 20  # draws of random poses until the rig can measure them all
# Distance of the seeds of layouts and of groups of cases, so that more cases of a group leave the others as they were.
LAYOUT_SEEDS, GROUP_SEEDS = 100_000, 1_000
CHOICES = ("strut", "vertex", "direction", "setup")


@dataclass(frozen=True)
class Job:
    """One case to diagnose.

    Attributes
    ----------
    group
        `one`, `none`, `outside`, `two`; `misstated`: the column of the readings' sd is off by `factor`.
    layout, seed, hidden
        Of the rig.
    factor
        Stated sd over the true one.
    plan
        Whether to plan further poses, measure and diagnose again.
    """

    group: str
    layout: str
    seed: int
    hidden: str
    factor: float = 1.0
    plan: bool = False


def make_jobs(
    first_seed: int, each: int, none: int, outside: int, two: int, misstated: int, layouts: Sequence[str] = LAYOUTS
) -> list[Job]:
    """All cases but the planned ones, each with a seed of its own; `misstated` cases share theirs over the factors."""
    jobs = []
    for layout in layouts:
        start = first_seed + LAYOUT_SEEDS * LAYOUTS.index(layout)
        groups = [("one", name, each) for name in case_module.effects_of_layout(layout)]
        for number, (group, hidden, count) in enumerate(groups):
            jobs += [Job(group, layout, start + GROUP_SEEDS * number + k, hidden) for k in range(count)]
        for number, (hidden, count) in enumerate((("none", none), ("outside", outside), ("two", two)), 20):
            jobs += [Job(hidden, layout, start + GROUP_SEEDS * number + k, hidden) for k in range(count)]
        if layout == "paper":  # the layout whose noise is stated; the other one's is estimated from its repeats
            for number, hidden in enumerate(("none", "one"), 30):
                seeds = [start + GROUP_SEEDS * number + k for k in range(misstated)]
                jobs += [Job("misstated", layout, seed, hidden, f) for f in MISSTATED for seed in seeds]
    return jobs


def run(job: Job) -> dict[str, Any]:
    """The record of a case; with `error`, the traceback, where it failed."""
    work = _planned if job.plan else _diagnosed
    return record_of(_heading(job), lambda folder: work(job, folder))


@cache
def machine() -> Hexapod:
    """The machine as the model has it."""
    return load_machine("nist")


def _heading(job: Job) -> dict[str, Any]:
    group = "planned" if job.plan else job.group
    return {"group": group, "layout": job.layout, "seed": job.seed, "hidden": job.hidden, "factor": job.factor}


def _diagnosed(job: Job, folder: Path) -> dict[str, Any]:
    """Draw, diagnose, compare with the truth."""
    rows, truth = case_module.make_case(job.seed, job.layout, hidden=job.hidden)
    if job.factor != 1.0:
        rows["sd_N_per_mm"] = rows["sd_N_per_mm"] * job.factor
    return judged(rows, truth, folder)[0]


def judged(rows: dict[str, Any], truth: dict[str, Any], folder: Path, **stated: Any) -> tuple[dict[str, Any], Document]:
    """Truth, verdict and probabilities of a case as a record, and the whole document; `stated` goes to `diagnose`."""
    file = folder / "measurements.csv"
    file.write_text(exercise.csv_text(rows), encoding="utf-8")
    start = time.process_time()
    diagnosis = diagnose(machine(), read_measurements(file, machine()), **stated)
    found = diagnosis.to_dict()
    cpu = time.process_time() - start
    record = {
        "truth": truth["hidden"],
        "kind": truth["kind"],
        "effects": truth["effects"],
        "verdict": found["verdict"],
        "plausible": found["plausible"],
        "not_excluded": {one["effect"]: one["probability"] for one in found["not_excluded"]},
        "first": found["candidates"][0]["effect"],
        "probability": {name: round(weight, 4) for name, weight in diagnosis.main.probability.items() if weight > 5e-5},
        "gate": found["gates"]["baseline_probability"],
        "cpu": round(cpu, 2),
    }
    if truth["kind"] == "one":
        record |= _right_effect(found, truth["effects"][0])
    return record, found


def _right_effect(found: Document, hidden: dict[str, Any]) -> dict[str, Any]:
    """How the effect that was hidden fares: place, errors, adequacy, and whether its intervals hold the truth."""
    names = [candidate["effect"] for candidate in found["candidates"]]
    if hidden["effect"] not in names:
        return {"place": None, "held_out_percent": None, "parameters": []}
    place = names.index(hidden["effect"])
    candidate = found["candidates"][place]
    return {
        "place": place + 1,
        "held_out_percent": candidate["held_out_error_percent"],
        "passes": candidate["adequate"],
        "choice": candidate["choice"],
        "choice_right": choice_is_right(candidate["choice"], hidden["parameters"]),
        "parameters": interval_checks(candidate["parameters"], hidden["parameters"]),
    }


def choice_is_right(choice: dict[str, Any], true: dict[str, Any]) -> bool:
    """Whether strut, vertex, direction and set-up, as far as the effect has them, are the hidden ones."""
    return all(choice.get(key) == true[key] for key in CHOICES if key in true)


def interval_checks(fitted: dict[str, Any], true: dict[str, Any]) -> list[dict[str, Any]]:
    """Each fitted parameter that has a true value, with its interval and whether that holds it.

    The rig names parameters without the unit that the document's keys end with. An end of None is infinite.
    """
    checks = []
    for key, value in fitted.items():
        truth = next((true[name] for name in true if key == name or key.startswith(f"{name}_")), None)
        if truth is None:
            continue
        low, high = value["interval"]
        holds = (low is None or low <= truth) and (high is None or truth <= high)
        checks.append({"key": key, "true": truth, "value": value["value"], "interval": [low, high], "holds": holds})
    return checks


def _planned(job: Job, folder: Path) -> dict[str, Any]:
    """An ambiguous case: plan, measure the same hidden machine, diagnose all data; the same with random poses."""
    case = case_module.draw_case(job.seed, job.layout, hidden=job.hidden)
    file = folder / "measurements.csv"
    file.write_text(exercise.csv_text(case.rows), encoding="utf-8")
    before = diagnose(machine(), read_measurements(file, machine()))
    truth = case.truth["hidden"][0]
    record: Record = {"truth": [truth], "effects": case.truth["effects"], "plausible": list(before.plausible)}
    plans = {n: _plan(before, n) for n in POSES}
    plan = plans[POSES[-1]]
    if plan is None:
        return record | {"settleable": False, "rivals": []}
    record |= {
        "rivals": [rival.name for rival in plan.rivals],
        "settleable": settleable(plan, truth),
        "pairs": [[*pair.effects, round(pair.separation_sigma, 2), pair.separable] for pair in plan.pairs],
        "forecast": round(plan.after.settled, 3),
    }
    blind = random_visits(plan, POSES[-1], job.seed)
    for draw in range(RANDOM_DRAWS):
        try:
            random = _measured(case, before, plan, blind, folder / "random.csv", [job.seed, 2, draw])
            break
        except InputError:  # beyond the hidden machine's reach, or the indicator would run backwards
            blind = random_visits(plan, POSES[-1], job.seed + 1 + draw)
    else:
        raise InputError("no random poses that the rig can measure")
    chosen = _measured(case, before, plan, plan.chosen, folder / "planned.csv", [job.seed, 1])
    for n in POSES:
        first = plans[n]
        assert first is not None
        # A shorter plan is the longer one's first choices: the same readings serve both.
        kept = [plan.chosen.index(visit) for visit in first.chosen if visit in plan.chosen]
        for label, further, clamps in (("planned", chosen, kept), ("random", random, list(range(n)))):
            more = folder / f"{label}_{n}.csv"
            more.write_text(_rows_of_clamps(further, clamps), encoding="utf-8")
            after = diagnose(machine(), read_measurements([file, more], machine()))
            settled = after.verdict == "identified" and after.plausible == [truth]
            record[f"{label}_{n}"] = [after.verdict, list(after.plausible), settled]
    return record


def _plan(diagnosis: Diagnosis, poses: int) -> RivalPlan | None:
    """The plan behind `next_measurements`, which hands on its rows only; None where nothing rivals."""
    judgement = diagnosis.main
    rivals = rivals_of(judgement)
    if len(rivals) < 2:
        return None
    noise = (float(np.sqrt(np.mean(judgement.noise.repeat**2))), judgement.noise.clamping)
    return plan_measurements(
        diagnosis.machine, rivals, noise, poses, menu=Menu.of(diagnosis.data), seed=0,
        strut_spread=judgement.noise.strut_spread,
    )  # fmt: skip


def settleable(plan: RivalPlan, truth: str) -> bool:
    """Whether tip stiffness can tell the truth from each rival; without the truth among them, the rivals apart."""
    known = truth in {rival.name for rival in plan.rivals}
    return all(pair.separable for pair in plan.pairs if not known or truth in pair.effects)


def _measured(
    case: case_module.Case, before: Diagnosis, plan: RivalPlan, visits: Sequence[int], file: Path, seed: Sequence[int]
) -> dict[str, Any]:
    """What the hidden machine shows at these visits; clamps are numbered on."""
    file.write_text(plan_csv(plan_rows(plan.visits, visits, set(before.data.point.tolist()))), encoding="utf-8")
    table = read_plan(str(file), case.nominal)
    table["clamp"] = table["clamp"] + CLAMPS_LATER
    return case.again(table, np.random.default_rng(seed))


def _rows_of_clamps(table: dict[str, Any], clamps: Sequence[int]) -> str:
    """CSV of the readings of some clampings, numbered from 0 in measuring order."""
    kept = [i for i, clamp in enumerate(table["clamp"]) if clamp - CLAMPS_LATER - 1 in clamps]
    return exercise.csv_text({name: [values[i] for i in kept] for name, values in table.items()})
