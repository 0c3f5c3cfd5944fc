"""Blind cases of `benchmarks.spoiled`: wild readings, a wrong noise, mistyped rows."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.diagnosis_cases import judged
from tests.rig.slips import SLIPS, slipped_case, with_stated_noise
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.rig import case as rig
from toolpath_stiff.rig.hidden import Nuisances

GROUPS = ("outliers", "stated", "slip")
PAIR_SIZES = (0.10, 0.05)  # rms change of ln k of the two
FEW_OUTLIERS, MANY_OUTLIERS = 0.02, 0.10
FACTORS = (0.5, 1.0, 2.0)
# Layout and way in which a noise is stated; the tilted one has repeats, the paper's has none.
WAYS = (("tilted", "option"), ("tilted", "column"), ("paper", "option"), ("paper", "column"))
GROUP_SEEDS = 10_000  # distance of the seeds of groups


@dataclass(frozen=True)
class Job:
    """One case: of `GROUPS`; `none`, `one` or `two` hidden effects; the share of wild readings; a slip's kind.

    `way` says how a noise is stated (`option`: `--noise`; `column`: `sd_N_per_mm`), `factor` times the true one.
    """

    group: str
    layout: str
    seed: int
    hidden: str
    outliers: float = FEW_OUTLIERS
    way: str = ""
    factor: float = 1.0
    slip: str = ""
    built: str = "springs"


def make_jobs(first_seed: int, cases: int, groups: Sequence[str] = GROUPS, built: str = "springs") -> list[Job]:
    """All cases: `cases` of each kind with outliers and without a slip, a fifth of each stated noise and slip.

    Cases that are compared with each other share their seed. More cases leave the first ones as they were.
    """
    fifth, jobs = max(cases // 5, 1), list[Job]()
    start = {group: first_seed + GROUP_SEEDS * number for number, group in enumerate(GROUPS)}
    for number, hidden in enumerate(("none", "one", "two")):
        for k in range(cases):
            seed = start["outliers"] + 1000 * number + k
            jobs += [Job("outliers", "tilted", seed, hidden, share) for share in (FEW_OUTLIERS, MANY_OUTLIERS)]
    for number, (layout, way) in enumerate(WAYS):
        for k in range(fifth):
            for other, hidden in enumerate(("none", "one")):
                seed = start["stated"] + 1000 * number + 500 * other + k
                jobs += [Job("stated", layout, seed, hidden, way=way, factor=factor) for factor in FACTORS]
    for number, slip in enumerate(("", *SLIPS)):
        for k in range(fifth if slip else cases):
            # Alternately on a sound machine and on one that hides an effect.
            jobs.append(Job("slip", "tilted", start["slip"] + 1000 * number + k, "one" if k % 2 else "none", slip=slip))
    return [replace(job, built=built) for job in jobs if job.group in groups]


def diagnosed(job: Job, folder: Path) -> dict[str, Any]:
    """Draw, disturb, diagnose, and what the document says of noise and rows."""
    nuisances = Nuisances(outliers=job.outliers)
    size = PAIR_SIZES if job.hidden == "two" else None
    case = rig.draw_case(job.seed, job.layout, job.hidden, size=size, noise=nuisances, built=job.built)
    rows, truth, stated = case.rows, case.truth, {}
    more: dict[str, Any] = {}
    if job.way == "column":
        rows, more["noise"] = with_stated_noise(rows, nuisances, job.factor)
    elif job.way == "option":
        rows = {name: values for name, values in rows.items() if name != "sd_N_per_mm"}
        stated["noise"] = (job.factor * nuisances.repeat, job.factor * nuisances.clamping)
    if job.slip:
        rows, more["slips"] = slipped_case(case, job.seed, job.slip)
    try:
        record, document = judged(rows, truth, folder, **stated)
    except (InputError, InputErrors) as refusal:
        message = str(refusal).replace(f"{folder}/", "")
        return more | {"truth": truth["hidden"], "effects": truth["effects"], "verdict": "refused", "plausible": [],
                       "refused": message, "suspects": suspects_of_refusal(message)}  # fmt: skip
    return more | record | {
        "noise_found": document["noise"],
        "noise_remarks": noise_remarks(document),
        # The folder is another one in every run.
        "suspects": json.loads(json.dumps(document.get("suspect_rows", [])).replace(f"{folder}/", "")),
    }  # fmt: skip


def suspects_of_refusal(message: str) -> list[dict[str, Any]]:
    """The lines that the reader names (`FILE.csv:152: ...`) as suspected rows; the heading is line 1."""
    return [{"rows": [int(line) - 1], "words": message} for line in re.findall(r"\.csv:(\d+)", message)]


# What a sentence must say to be about a wrong noise: that one was stated, and that it is not what the readings show.
_STATED = re.compile(r"\bstated|sd_N_per_mm|--noise", re.IGNORECASE)
_WRONG = re.compile(r"\btoo (small|large|low|high)|\b(smaller|larger|lower|higher) than|\bhalf\b|\btwice\b|\btimes\b")


def noise_remarks(document: Mapping[str, Any]) -> list[str]:
    """Sentences that say a stated noise is wrong, where a reader looks: text, reasons, warnings, notes, its origin."""
    noise = document["noise"]
    sentences = [document["text"], *document["why"], *document["warnings"], *document["notes"], noise["origin"]]
    sentences.append(str(noise.get("remark", "")))
    return [one for one in sentences if _STATED.search(one) and _WRONG.search(one)]
