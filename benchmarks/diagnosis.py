"""`python -m benchmarks.diagnosis`: the diagnosis on blind cases of the rig, against every bar of its issue.

2 % noise, two layouts: the paper's 14 points x 3 directions with `sd_N_per_mm`, and 24 tilted poses x 3 directions x
2 loads x 2 repeats. Seeds were never used while the method was developed.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.bars import Record, middle_of
from benchmarks.case_loop import document, run_benchmark, sound
from benchmarks.diagnosis_bars import FLOOR_PERCENT, figures
from benchmarks.diagnosis_cases import LAYOUTS, Job, make_jobs, run
from benchmarks.diagnosis_tables import calibration_table, effects_table, failures_table, verdicts_table

FIRST_SEED = 41_000_000  # chosen once, before the first run
RECORDS = Path(__file__).parent.parent / "reports" / "benchmark_diagnosis.jsonl"
WHAT = (
    "Each case is a machine of the rig with 2 % repeat noise, 1 % clamping, 1 % strut spread, joints off by 0.5 mm and "
    "2 % outliers; the rig draws sizes log-uniformly from just detectable to 30 %. Seeds {low} to {high}, none of them "
    "used for development. Intervals of shares are Wilson's; a bar is cleared by the figure, not by its interval. "
    "The noise floor is 0.80 x the sd of one reading, {floor:.2f} %. `identified` and wrong counts every name that was "
    "not hidden, also beside the right one."
)
CALIBRATION = (
    "All hypotheses of cases with one or no hidden effect that were not `unexplained`. The cases are not mixed as the "
    "prior has them."
)


def report(records: Sequence[Record], command: str) -> tuple[str, bool]:
    """The document, and whether all bars are cleared."""
    good = sound(records, lambda r: (r["layout"], r["group"], r["seed"]))
    seeds = sorted(r["seed"] for r in good)
    cpu = "CPU of `diagnose`, without start-up and pictures, median"
    times = [middle_of(of, cpu, [r["cpu"] for r in good if r["layout"] == of], None, " s") for of in LAYOUTS]
    parts = [
        ("Verdicts", verdicts_table(good)),
        *((f"Each effect, {layout} layout", effects_table(good, layout)) for layout in LAYOUTS),
        ("Calibration of the probabilities", [CALIBRATION, "", *calibration_table(good)]),
        ("Cases that count against a bar", failures_table(good)),
    ]
    what = WHAT.format(low=seeds[0], high=seeds[-1], floor=FLOOR_PERCENT)
    return document("Diagnosis on blind cases", what, [*figures(good), *times], parts, records, command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; exit code 1 if a bar is not cleared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis", description=__doc__)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default: {FIRST_SEED}")
    parser.add_argument("--each", type=int, default=8, help="cases of each effect and layout (default: 8)")
    parser.add_argument("--none", type=int, default=150, help="cases with nothing hidden (default: 150)")
    parser.add_argument("--outside", type=int, default=60, help="cases outside the catalogue (default: 60)")

    def make(args: argparse.Namespace) -> list[Job]:
        jobs = make_jobs(args.first_seed, args.each, args.none, args.outside, built=args.built)
        # The longest cases first, so that no process is left with one at the end.
        return sorted(jobs, key=lambda job: (job.layout != "tilted", job.group != "outside"))

    return run_benchmark(parser, arguments, make, run, report, records=RECORDS)


if __name__ == "__main__":
    sys.exit(main())
