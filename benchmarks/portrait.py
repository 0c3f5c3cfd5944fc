"""`python -m benchmarks.portrait`: what `tps diagnose` says of machines whose fault is in no catalogue.

Blind cases of the rig: each kind of unknown, 4 to 15 % rms, and sound machines; 2 % repeat noise and 1 % clamping.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from benchmarks.bars import Record
from benchmarks.case_loop import document, run_benchmark, sound
from benchmarks.portrait_bars import failures_table, figures, kinds_table
from benchmarks.portrait_cases import LAYOUTS, Job, make_jobs, run
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.unknowns import UNKNOWNS

FIRST_SEED = 63_000_000  # chosen once, before the first run
RECORDS = Path(__file__).parent.parent / "reports" / "benchmark_portrait.jsonl"
OUT = Path(__file__).parent / "portrait.md"
CASES, SOUND = 6, 100
WHAT = (
    "Each case is a machine of [the rig](../docs/rig.md) with one of its unknowns, or sound: 2 % repeat noise, 1 % "
    "clamping, 1 % strut spread, joints off by 0.5 mm, 2 % wild readings. Which links and variables are right is "
    "settled by the physics of each kind. A set is right if it holds one of them and is short: four links, three "
    "variables at most. Intervals of shares are Wilson's; a bar is cleared by the figure."
)


def report(records: Sequence[Record], command: str) -> tuple[str, bool]:
    """The document, and whether all bars are cleared."""
    order = ["none", *UNKNOWNS, *FAULTS]
    good = sound(records, lambda r: (r["layout"] != "tilted", order.index(r["hidden"]), r["seed"]))
    counts = Counter((r["layout"], "sound" if r["hidden"] == "none" else "unknown", r["verdict"]) for r in good)
    parts = [
        ("Verdicts", [f"- {layout}, {of}, `{verdict}`: {n}" for (layout, of, verdict), n in sorted(counts.items())]),
        *((f"Each unknown, {layout} layout", kinds_table(good, layout)) for layout in LAYOUTS),
        ("Cases that count against a bar", failures_table(good)),
    ]
    return document("Descriptions of what is in no catalogue", WHAT, figures(good), parts, records, command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; exit code 1 if a bar is not cleared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.portrait", description=__doc__)
    parser.add_argument("--cases", type=int, default=CASES, help=f"cases of each kind and layout (default: {CASES})")
    parser.add_argument("--sound", type=int, default=SOUND, help=f"sound machines of each layout (default: {SOUND})")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default: {FIRST_SEED}")
    parser.add_argument("--layouts", nargs="+", choices=LAYOUTS, default=LAYOUTS, metavar="LAYOUT")
    parser.add_argument(
        "--only", nargs="+", choices=[*UNKNOWNS, *FAULTS], default=(), metavar="KIND", help="kinds of unknown"
    )

    def make(args: argparse.Namespace) -> list[Job]:
        return make_jobs(args.first_seed, args.cases, args.sound, args.layouts, args.only, args.built)

    return run_benchmark(parser, arguments, make, run, report, records=RECORDS, out=OUT)


if __name__ == "__main__":
    sys.exit(main())
