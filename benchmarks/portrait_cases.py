"""Blind cases of `benchmarks.portrait`: machines with an unknown that is in no catalogue, or sound."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.bars import Record
from benchmarks.case_loop import record_of
from benchmarks.diagnosis_cases import judged, kinds_of
from toolpath_stiff.rig import case as rig

LAYOUTS = ("tilted", "paper")
LAYOUT_SEEDS, KIND_SEEDS = 10_000_000, 1_000
NAMES = ("links", "variables")  # sets in the truth and in a portrait
# What one of their entries is called in a portrait.
ENTRY = {"links": "link", "variables": "variable"}
FIGURES = ("held_out_rms_percent", "noise_floor_percent", "error_percent", "explained_percent", "look_elsewhere")


@dataclass(frozen=True)
class Job:
    """One case: an unknown of a kind, or "none"."""

    layout: str
    seed: int
    hidden: str
    built: str = "springs"


def make_jobs(
    first_seed: int,
    cases: int,
    sound: int,
    layouts: Sequence[str] = LAYOUTS,
    only: Sequence[str] = (),
    built: str = "springs",
) -> list[Job]:
    """`cases` of each kind and layout, `sound` machines of each layout.

    A kind's seeds follow from its name, so that another kind in the list leaves them as they were; the first cases of
    all kinds come first, so that a run that is stopped has seen them all.
    """
    jobs = []
    for layout in layouts:
        start = first_seed + LAYOUT_SEEDS * LAYOUTS.index(layout)
        kinds = [kind for kind in kinds_of(built, layout)[1] if not only or kind in only]
        jobs += [
            Job(layout, start + KIND_SEEDS * (1 + zlib.crc32(kind.encode()) % 9000) + k, kind, built)
            for k in range(cases)
            for kind in kinds
        ]
        jobs += [Job(layout, start + k, "none", built) for k in range(sound)]
    return jobs


def run(job: Job) -> dict[str, Any]:
    """The record of a case; with `error`, the traceback, where it failed."""
    return record_of(asdict(job), lambda folder: _diagnosed(job, folder))


def _diagnosed(job: Job, folder: Path) -> Record:
    record, document = judged(*rig.make_case(job.seed, job.layout, job.hidden, built=job.built), folder)
    same = document.get("looks_the_same")
    return record | {
        "portrait": in_short(document.get("portrait")),
        "same": same and {name: [entry[ENTRY[name]] for entry in same[name]] for name in NAMES},
    }


def in_short(portrait: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """The part of a portrait that is judged: names with their probabilities, figures, the terms in words."""
    if portrait is None:
        return None
    return {
        **{name: {entry[ENTRY[name]]: entry["probability"] for entry in portrait[name]} for name in NAMES},
        **{name: portrait[name] for name in FIGURES},
        "terms": [term["words"] for term in portrait["terms"]],
        "alike": [term["words"] for term in portrait["indistinguishable"]],
    }
