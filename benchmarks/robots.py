"""`python -m benchmarks.robots`: blind cases on serial machines, invented arms that hide a fault or none.

144 pulls at 24 poses, 2 % noise that is stated; a fault moves the readings by 8 to 25 % (rms). A known effect counts
where the readings carry it: whitened length of what it does to them (`just detectable` of the rig). A backlash that the
weight of the arm holds closed moves nothing.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import toolpath_stiff as tps
from benchmarks.bars import Record, share
from benchmarks.case_loop import document, run_benchmark, sound
from benchmarks.pages import table
from toolpath_stiff.rig.exercise import csv_text
from toolpath_stiff.rig.robot import FAULTS, robot_case
from toolpath_stiff.rig.sizes import DETECTABLE

FIRST_SEED = 92_000_000
NOISE = 0.02
LINKS = {"link 1": "upper arm", "link 2": "forearm"}  # of the rig, as the machine file has them
WHOLE = {"loose_foot": "foot", "soft_spindle": "spindle"}


@dataclass(frozen=True)
class Job:
    """One case; what it hides is drawn unless named."""

    seed: int
    hidden: str | None
    stated: bool = True  # whether the readings say how they scatter


def labels(effect: Record) -> set[str]:
    """Names with their element that are right of a hidden fault."""
    part = effect["parameters"].get("element", "")
    place = WHOLE.get(effect["effect"], LINKS.get(part, part))
    return {name if name == "spindle_compliance" else f"{name}, {place}" for name in effect["names"]}


def diagnosed(job: Job, folder: Path) -> Record:
    """What a diagnosis says, beside the truth."""
    text, pulls, truth = robot_case(job.seed, job.hidden, NOISE)
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    said = {name: column for name, column in pulls.items() if job.stated or name != "sd_um"}
    (folder / "pulls.csv").write_text(csv_text(said), encoding="utf-8")
    verdict = tps.diagnose(folder / "pulls.csv", folder / "robot.toml").to_dict()
    effect = truth["effects"][0] if truth["effects"] else {"effect": "none", "names": [], "parameters": {}}
    return {
        "kind": truth["kind"], "effect": effect["effect"], "part": effect["parameters"].get("element", ""),
        "right": sorted(labels(effect)), "seen": effect.get("detectability", 0.0), "verdict": verdict["verdict"],
        "plausible": verdict["plausible"],
    }  # fmt: skip


def named(record: Record) -> bool:
    """Right names and no other."""
    names = set(record["plausible"])
    return bool(names) and names <= set(record["right"])


def misnamed(record: Record) -> bool:
    """One name, and it is wrong."""
    return record["verdict"] == "identified" and not named(record)


def report(records: Sequence[Record], command: str) -> tuple[str, bool]:
    """The page, and whether all bars are cleared."""
    cases = sound(records, lambda r: r["seed"])
    inside, outside, none = ([r for r in cases if r["kind"] == kind] for kind in ("one", "outside", "none"))
    carried = [r for r in inside if r["seen"] >= DETECTABLE]
    counted = [
        ("known effect: right", carried, named, 0.90, None),
        ("known effect: right, or listed", carried, lambda r: set(r["right"]) & set(r["plausible"]), None, None),
        ("known effect that no reading carries: right, or called sound",
         [r for r in inside if r["seen"] < DETECTABLE], lambda r: named(r) or r["verdict"] == "adequate", None, None),
        ("wrong name", cases, misnamed, None, 0.03),
        ("outside the catalogue: `unexplained`", outside, lambda r: r["verdict"] == "unexplained", 0.90, None),
        ("sound: `adequate`", none, lambda r: r["verdict"] == "adequate", 0.95, None),
    ]  # fmt: skip
    figures = [share("serial", what, [bool(rule(r)) for r in rows], *ends) for what, rows, rule, *ends in counted]
    kinds = Counter((r["effect"], r["part"], "right" if named(r) else r["verdict"]) for r in cases)
    rows = [(effect, part, verdict, n) for (effect, part, verdict), n in sorted(kinds.items())]
    parts = [("Verdicts", table("hidden | where | verdict | cases:", rows))]
    what = __doc__ if cases[0]["stated"] else __doc__.replace("noise that is stated", "noise that nobody states")
    return document("Robots", what, figures, parts, records, command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; exit code 1 if a bar is not cleared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robots", description=__doc__)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default: {FIRST_SEED}")
    parser.add_argument("--cases", type=int, default=200, help="default: 200")
    parser.add_argument("--hidden", choices=("none", "one", "outside", *FAULTS), help="drawn unless given")
    parser.add_argument("--unstated", action="store_true", help="without the column that says how readings scatter")
    return run_benchmark(
        parser, arguments,
        lambda args: [Job(args.first_seed + k, args.hidden, not args.unstated) for k in range(args.cases)],
        diagnosed, report,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
