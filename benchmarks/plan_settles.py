"""Does a plan settle what a diagnosis leaves open? Ambiguous blind cases, at most six further visits of any kind.

    python -m benchmarks.plan_settles --cases 60 --out plan_settles.md

Each case is the paper's layout on a blind machine of the rig whose diagnosis is ambiguous, or on one whose joints
give way. A plan with indicators is made and measured on the same machine; so are as many visits drawn at random from
the same menu. Counted are the verdicts over all readings after the plan, the minutes until one explanation has 95 %,
and how often that was to be expected: over all rivals as they stand, `none` among them, and if what is hidden in the
case is the truth. Bars: 90 % settled, half of random's minutes, forecast within 5 points, `joint_compliance` named in
80 %.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.pages import write_page
from toolpath_stiff.diagnosis.diagnose import diagnose
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.planning.gaps import SETTLED, plan_minutes
from toolpath_stiff.planning.next_visit import TABLES, next_visit, tables_of
from toolpath_stiff.planning.plan import RivalPlan, random_visits
from toolpath_stiff.planning.result import plan
from toolpath_stiff.planning.rows import plan_csv, plan_rows
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig.case import Case, again, draw_case
from toolpath_stiff.rig.exercise import csv_text, read_plan

POSES = 6
FIRST_SEED = 70_000
JOINTS_EVERY = 4  # each fourth case hides joint_compliance, which the tip alone never names
MOST_DRAWS = 6  # seeds tried for one ambiguous case
SETTLES = "identified"  # something is hidden in every case


@dataclass(frozen=True)
class Outcome:
    """A case: what was hidden, the verdict after the plan, minutes by plan and at random, what was expected.

    `expected` is the forecast that the plan prints, over all rivals; `expected_if` the same were what is hidden the
    truth, over all rivals where that is none of them.
    """

    seed: int
    hidden: str
    verdict: str
    right: bool
    settled: bool
    minutes: float
    random_minutes: float
    expected: float
    expected_if: float


def run(seed: int, hidden: str, folder: Path) -> Outcome | None:
    """One case; None where its diagnosis is settled at once."""
    machine = load_machine("nist")
    case = draw_case(seed, "paper", hidden, 0.02)
    tip = folder / "tip.csv"
    tip.write_text(csv_text(case.rows))
    data = read_measurements(str(tip), machine)
    before = diagnose(machine, data, plan_next=False)
    if before.verdict != "ambiguous" and hidden != "joint_compliance":
        return None
    proposal = plan(machine, data, n=POSES, indicators=True, judgement=before.main)
    assert isinstance(proposal.choice, RivalPlan)
    (folder / TABLES).write_bytes(tables_of(proposal))
    visits, chosen = proposal.choice.visits, proposal.choice.chosen
    minutes, files = [], list[str]()
    for name, some in (("plan", chosen), ("random", random_visits(proposal.choice, POSES, seed))):
        taken = [_measured(case, proposal.choice, visit, folder / f"{name}{k}.csv", k) for k, visit in enumerate(some)]
        files = files or taken
        needed = _needed(folder, taken)
        minutes.append(plan_minutes(visits, some[:needed], proposal.costs, proposal.menu))
    after = diagnose(machine, read_measurements([str(tip), *files], machine), plan_next=False)
    right = set(after.plausible if after.verdict == "identified" else ()) == set(case.truth["hidden"])
    outlook = proposal.choice.after
    rivals = [one.name for one in proposal.choice.rivals]
    true = " + ".join(sorted(case.truth["hidden"]))
    expected_if = outlook.settled_if[rivals.index(true)] if true in rivals else outlook.settled
    return Outcome(
        seed,
        hidden,
        after.verdict,
        right,
        after.verdict == SETTLES,
        minutes[0],
        minutes[1],
        outlook.settled,
        expected_if,
    )


def _needed(folder: Path, files: list[str]) -> int:
    """How many of the visits, in their order, until one explanation has 95 %; all where none has."""
    for k in range(1, len(files)):
        if max(next_visit(folder, tuple(files[:k])).probability.values()) >= SETTLED:
            return k
    return len(files)


def _measured(case: Case, planned: RivalPlan, visit: int, file: Path, number: int) -> str:
    """A visit measured on the case's machine, as a file."""
    rows = plan_rows(planned.visits, [visit])
    for row in rows:
        row["clamp"], row["point"] = number + 1, f"{file.stem}"
    file.write_text(plan_csv(rows))
    table = read_plan(str(file), case.nominal)
    file.write_text(csv_text(again(case.nominal, case.machine, case.nuisances, table, np.random.default_rng(number))))
    return str(file)


def cases(count: int, first: int) -> list[Outcome]:
    """So many ambiguous cases, one after the other; progress on the terminal."""
    found: list[Outcome] = []
    for k in range(count):
        hidden = "joint_compliance" if k % JOINTS_EVERY == JOINTS_EVERY - 1 else "one"
        for draw in range(MOST_DRAWS):
            with tempfile.TemporaryDirectory() as folder:
                one = run(first + 100 * k + draw, hidden, Path(folder))
            if one is not None:
                found.append(one)
                print(f"{len(found)}/{count} {one}", file=sys.stderr, flush=True)
                break
    return found


def report(found: list[Outcome]) -> str:
    """The figures beside their bars, as markdown."""
    joints = [one for one in found if one.hidden == "joint_compliance"]
    settled = 100.0 * float(np.mean([one.settled for one in found]))
    expected, known = (
        100.0 * float(np.mean([getattr(one, name) for one in found])) for name in ("expected", "expected_if")
    )
    shorter = float(np.mean([one.minutes for one in found]) / np.mean([one.random_minutes for one in found]))
    named = 100.0 * float(np.mean([one.right for one in joints])) if joints else float("nan")
    wrong = 100.0 * float(np.mean([one.verdict == "identified" and not one.right for one in found]))
    rows = [
        ("settled after the plan", f"{settled:.0f} %", "90 %"),
        ("a wrong name", f"{wrong:.0f} %", "-"),
        ("forecast of that, what is hidden being the truth", f"{known:.0f} %", "within 5 points"),
        ("forecast of that, over all rivals, `none` among them", f"{expected:.0f} %", "-"),
        ("minutes until 95 %, over those at random", f"{shorter:.2f}", "0.5"),
        ("joint_compliance named", f"{named:.0f} %", "80 %"),
    ]
    lines = [f"# What plans settle: {len(found)} cases", "", "| figure | found | bar |", "| --- | --- | --- |"]
    return "\n".join([*lines, *(f"| {name} | {value} | {bar} |" for name, value, bar in rows), ""])


def main() -> None:
    """Run the cases and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=60, metavar="N", help="ambiguous cases (default: 60)")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, metavar="N", help="of the first case")
    parser.add_argument("--out", metavar="FILE.md", help="write the table there as well")
    args = parser.parse_args()
    text = report(cases(args.cases, args.seed))
    print(text)
    if args.out:
        write_page(args.out, text)


if __name__ == "__main__":
    main()
