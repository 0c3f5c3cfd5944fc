"""`python -m benchmarks.spoiled`: wild readings, a wrongly stated noise, mistyped rows.

Blind cases of the rig with 2 % repeat noise, 1 % clamping, 1 % strut spread, joints off by 0.5 mm and 2 % wild readings
unless more is said; two effects change the stiffness by 10 and 5 % rms. Intervals of shares are Wilson's; a bar is
cleared by the figure.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence

from benchmarks.bars import Record
from benchmarks.case_loop import document, run_benchmark, sound
from benchmarks.pages import table
from benchmarks.spoiled_bars import false_name, figures, named_rows, slip_found, slip_visible
from benchmarks.spoiled_cases import GROUPS, diagnosed, make_jobs

FIRST_SEED = 52_000_000  # chosen once, before the first run


def slips_table(records: Sequence[Record]) -> list[str]:
    """Each kind of slip."""
    rows = []
    wrong = [r for r in records if r["group"] == "slip" and r["slip"]]
    for kind in dict.fromkeys(r["slip"] for r in wrong):
        mine = [r for r in wrong if r["slip"] == kind]
        plain, faint = ([r for r in mine if slip_visible(r) == visible] for visible in (True, False))
        rows.append((kind, len(mine), len(plain), sum(map(slip_found, plain)), sum(map(slip_found, faint))))
    return table("slip | cases: | show: | row named, of these: | row named, of the others:", rows)


def failures_table(records: Sequence[Record]) -> list[str]:
    """Every case that counts against a bar."""
    rows = []
    for r in records:
        what = []
        if false_name(r):
            what.append("false name")
        if r["group"] == "slip" and r["slip"] and slip_visible(r) and not slip_found(r):
            what.append(f"{r['slip']} not found")
        if r["group"] == "slip" and not r["slip"] and named_rows(r):
            what.append("a sound row suspected")
        if what:
            hidden, plausible = ", ".join(r["truth"]) or "none", ", ".join(r["plausible"])
            rows.append((r["group"], r["seed"], hidden, r["verdict"], plausible, "; ".join(what)))
    return table("group | seed: | hidden | verdict | plausible | what", rows)


def report(records: Sequence[Record], command: str) -> tuple[str, bool]:
    """The document, and whether all bars are cleared."""
    good = sound(records, lambda r: (GROUPS.index(r["group"]), r["seed"]))
    verdicts = Counter((r["group"], r["verdict"]) for r in good)
    parts = [
        ("Verdicts", [f"- {group}, `{verdict}`: {count}" for (group, verdict), count in sorted(verdicts.items())]),
        ("Slips", slips_table(good)),
        ("Cases that count against a bar", failures_table(good)),
    ]
    title = "Wild readings, a wrong noise, mistyped rows"
    return document(title, __doc__, figures(good), parts, records, command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; exit code 1 if a bar is not cleared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.spoiled", description=__doc__)
    parser.add_argument(
        "--cases", type=int, default=100,
        help="of each kind with outliers and of sound tables; a fifth of each stated noise and slip (default: 100)",
    )  # fmt: skip
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default: {FIRST_SEED}")
    parser.add_argument("--only", nargs="+", choices=GROUPS, default=GROUPS, metavar="GROUP", help=", ".join(GROUPS))
    return run_benchmark(
        parser, arguments, lambda args: make_jobs(args.first_seed, args.cases, args.only, args.built), diagnosed, report
    )


if __name__ == "__main__":
    sys.exit(main())
