"""Blind cases of the diagnosis benchmark: drawn by the rig, diagnosed, and written down as one record each."""

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from benchmarks.case_loop import record_of
from toolpath_stiff.diagnosis.diagnose import diagnose
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig import case as case_module
from toolpath_stiff.rig import exercise
from toolpath_stiff.rig.fem_faults import FAULTS, faults
from toolpath_stiff.rig.unknowns import UNKNOWNS

LAYOUTS = ("tilted", "paper")
# Distance of the seeds of layouts and of groups of cases, so that more cases of a group leave the others as they were.
LAYOUT_SEEDS, GROUP_SEEDS = 100_000, 1_000
NOT_IN_PAPER = frozenset(("force_N", "time_min", "temperature_C"))  # columns that the paper's layout lacks
CHOICES = ("strut", "vertex", "direction", "setup")


@dataclass(frozen=True)
class Job:
    """One case: `one`, `none` or `outside`; layout, seed and what is hidden are the rig's."""

    group: str
    layout: str
    seed: int
    hidden: str
    built: str = "springs"


def kinds_of(built: str, layout: str = "tilted") -> tuple[list[str], list[str]]:
    """What can be hidden in and outside the catalogue that a layout has the columns for."""
    lacking = NOT_IN_PAPER if layout == "paper" else frozenset()
    if built == "fem":
        known, beyond = ({name: FAULTS[name] for name in faults(in_catalogue=inside)} for inside in (True, False))
        inside = [name for name, fault in known.items() if lacking.isdisjoint(fault.columns)]
    else:
        inside, beyond = list(case_module.effects_of_layout(layout)), UNKNOWNS
    return inside, [name for name, kind in beyond.items() if lacking.isdisjoint(kind.columns)]


def make_jobs(
    first_seed: int, each: int, none: int, outside: int, layouts: Sequence[str] = LAYOUTS, built: str = "springs"
) -> list[Job]:
    """All cases, each with a seed of its own."""
    jobs = []
    for layout in layouts:
        start = first_seed + LAYOUT_SEEDS * LAYOUTS.index(layout)
        groups = [(k, "one", name, each) for k, name in enumerate(kinds_of(built, layout)[0])]
        groups += [(50, "none", "none", none), (51, "outside", "outside", outside)]
        for number, group, hidden, count in groups:
            jobs += [Job(group, layout, start + GROUP_SEEDS * number + k, hidden, built) for k in range(count)]
    return jobs


def run(job: Job) -> dict[str, Any]:
    """The record of a case; with `error`, the traceback, where it failed."""
    case = partial(case_module.make_case, job.seed, job.layout, job.hidden, built=job.built)
    return record_of(asdict(job), lambda folder: judged(*case(), folder)[0])


@cache
def machine() -> Hexapod:
    """The machine as the model has it."""
    return load_machine("nist")


def judged(rows: dict[str, Any], truth: dict[str, Any], folder: Path, **stated: Any) -> tuple[dict[str, Any], Document]:
    """Truth, verdict and probabilities of a case as a record, and the whole document; `stated` goes to `diagnose`."""
    file = folder / "measurements.csv"
    file.write_text(exercise.csv_text(rows), encoding="utf-8")
    start = time.process_time()
    diagnosis = diagnose(machine(), read_measurements(file, machine()), **stated)
    found = diagnosis.to_dict()
    cpu = time.process_time() - start
    record = {
        "truth": right_names(truth, found["plausible"]),
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
        record |= _right_effect(found, truth["effects"][0] | {"effect": record["truth"][0]})
    return record, found


def right_names(truth: dict[str, Any], plausible: Sequence[str]) -> list[str]:
    """Of each hidden effect its name; of a fault of finite elements a right one, if there is one in `plausible`."""
    names = [effect.get("names") or [effect["effect"]] for effect in truth["effects"]]
    return [next((name for name in right if name in plausible), right[0]) for right in names]


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
