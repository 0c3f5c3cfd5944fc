"""`python -m benchmarks.drafts`: how often a draft is confirmed by readings that it has not seen, rightly or wrongly.

Each case is a tilted campaign of the rig. A draft is made of every other clamping; then all readings are judged with it
and with the whole catalogue. `same`: the others are of the same machine. `gone`: the others are of the same machine
without what the draft was read off, so that it says nothing true of them. `noise`: nothing is hidden at all, but the
noise is stated half as large as it is, so that the draft is read off scatter.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.bars import Figure, Record, share
from benchmarks.case_loop import document, record_of, run_benchmark, sound
from benchmarks.diagnosis_cases import kinds_of, machine
from benchmarks.pages import table
from toolpath_stiff.correction.draft import draft
from toolpath_stiff.diagnosis.diagnose import diagnose
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.judgement import judge
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig import case as case_module
from toolpath_stiff.rig import exercise
from toolpath_stiff.rig.hidden import Nuisances

FIRST_SEED = 83_000_000
NOISE_SEEDS = 1_000_000  # distance of the seeds of the cases without anything hidden
RECORDS = Path(__file__).parent.parent / "reports" / "benchmark_drafts.jsonl"
OUT = Path(__file__).parent / "drafts.md"
STATED = (0.01, 0.005)  # half of the rig's repeat noise and clamping
NOISE = "noise"
STRIDE = 7  # kinds stand in the order of their links; prime to their number


@dataclass(frozen=True)
class Job:
    """One draft: of an unknown of this kind, or of `NOISE`."""

    seed: int
    hidden: str
    built: str


def make_jobs(first_seed: int, unknowns: int, noises: int, built: str) -> list[Job]:
    """Drafts of unknowns, of each kind in turn, those of different links mixed, and of noise."""
    kinds = kinds_of(built)[1]
    found = [Job(first_seed + k, kinds[k * STRIDE % len(kinds)], built) for k in range(unknowns)]
    return found + [Job(first_seed + NOISE_SEEDS + k, NOISE, built) for k in range(noises)]


def run(job: Job) -> dict[str, Any]:
    """The record of a draft; with `error`, the traceback, where it failed."""
    return record_of(asdict(job), lambda folder: _drafted(job, folder))


def _drafted(job: Job, folder: Path) -> dict[str, Any]:
    """Draft from every other clamping, judge with all readings; the links that hold the truth and what was drafted."""
    noise = STATED if job.hidden == NOISE else None
    case = case_module.draw_case(job.seed, "tilted", "none" if job.hidden == NOISE else job.hidden, built=job.built)
    tables = {"same": case.rows}
    if job.hidden != NOISE:
        # The same seed: the same poses, struts, joints and scatter.
        tables["gone"] = case_module.draw_case(job.seed, "tilted", "none", noise=Nuisances(), built=job.built).rows
    old = np.asarray(case.rows["clamp"]) % 2 == 0
    file = folder / "old.csv"
    file.write_text(exercise.csv_text({name: np.asarray(values)[old] for name, values in case.rows.items()}))
    before = diagnose(machine(), read_measurements(file, machine()), noise=noise)
    made = draft(before, "missing.toml")
    links = [] if not made.text or before.portrait is None else [one.term.link for one in before.portrait.terms]
    truth = [link for effect in case.truth["effects"] for link in effect["links"]]
    record = {"verdict": before.verdict, "drafted": list(made.effects), "links": links, "truth": truth, "judged": {}}
    if not made.text:
        return record
    (folder / "missing.toml").write_text(made.text)
    for what, readings in tables.items():
        mixed = {n: np.where(old, np.asarray(case.rows[n]), np.asarray(readings[n])) for n in case.rows}
        file = folder / f"{what}.csv"
        file.write_text(exercise.csv_text(mixed))
        record["judged"][what] = _judged(file, str(folder / "missing.toml"), noise)
    return record


def _judged(file: Path, effects: str, noise: tuple[float, float] | None) -> dict[str, Any]:
    """Verdict over all readings with the draft among the catalogue, and what the new ones say of it."""
    data = read_measurements(file, machine())
    predictor = Predictor(machine(), data, [effects])
    scatter = noise_models(data, noise)[-1]
    found = judge(Problem.of(predictor, scatter), scatter, testable_effects(predictor)[0], seed=0)
    drawn = found.drawn.document if found.drawn else None
    return {"verdict": found.verdict, "explanations": list(found.explanations), "drawn": drawn}


def confirmed(record: Record, what: str) -> bool:
    """`identified` under a name that is drafted."""
    one = record["judged"][what]
    return one["verdict"] == "identified" and any(
        name in words for name in record["drafted"] for words in one["explanations"]
    )


def figures(records: Sequence[Record]) -> list[Figure]:
    """What becomes of drafts, by what they were read off."""
    made = [r for r in records if r["judged"]]
    unknown = [r for r in made if r["hidden"] != NOISE]
    right = [r for r in unknown if set(r["links"][:1]) & set(r["truth"])]
    wrong = [r for r in unknown if r not in right]
    noise = [r for r in records if r["hidden"] == NOISE]
    of_noise = [r for r in noise if r["judged"]]
    at = "tilted"
    return [
        share(at, "an unknown hidden: a draft is made", [bool(r["judged"]) for r in records if r["hidden"] != NOISE]),
        share(at, "leading link right, same machine: `identified`", [confirmed(r, "same") for r in right]),
        share(at, "leading link wrong, same machine: `identified`", [confirmed(r, "same") for r in wrong]),
        share(at, "gone from the new readings: `identified`", [confirmed(r, "gone") for r in unknown], at_most=0.05),
        share(at, "noise stated half as large: a draft is made", [bool(r["judged"]) for r in noise]),
        share(at, "read off noise: `identified`", [confirmed(r, "same") for r in of_noise], at_most=0.05),
    ]


def cases_table(records: Sequence[Record]) -> list[str]:
    """Each draft."""
    rows = []
    for r in records:
        for what, judged in r["judged"].items() or [("", {"verdict": f"no draft: {r['verdict']}", "drawn": None})]:
            gain = f"{judged['drawn']['gain']:.1f}" if judged["drawn"] else ""
            truth, links = ", ".join(r["truth"]), ", ".join(r["links"])
            rows.append((r["seed"], r["hidden"], truth, links, what, judged["verdict"], gain))
    return table("seed: | hidden | links | drafted | new readings | verdict | log probability gained:", rows)


def report(records: Sequence[Record], command: str) -> tuple[str, bool]:
    """The document, and whether all bars are cleared."""
    good = sound(records, lambda r: r["seed"])
    what = " ".join((__doc__ or "").split("\n\n", 1)[1].split())
    return document("Are drafts confirmed?", what, figures(good), [("Cases", cases_table(good))], records, command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; exit code 1 if a bar is not cleared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.drafts", description=__doc__)
    parser.add_argument("--cases", type=int, default=16, help="drafts of unknowns (default: 16)")
    parser.add_argument("--noise-cases", type=int, default=8, help="drafts of noise (default: 8)")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default: {FIRST_SEED}")

    def make(args: argparse.Namespace) -> list[Job]:
        return make_jobs(args.first_seed, args.cases, args.noise_cases, args.built)

    return run_benchmark(parser, arguments, make, run, report, records=RECORDS, out=OUT)


if __name__ == "__main__":
    sys.exit(main())
