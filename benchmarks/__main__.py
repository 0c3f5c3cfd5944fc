"""`python -m benchmarks`: the stiffness routes, whole commands, many programs, cost over size, with the bars to clear.

One core: the thread pools are limited before numpy loads. Rounds interleave the methods, each ratio is taken within
its round, the medians are printed. Absolute times depend on the machine; the ratios hardly do.
"""

from __future__ import annotations

import argparse
import sys
from importlib.util import find_spec
from pathlib import Path

from benchmarks.growth import measure_growth, picture, table
from benchmarks.many import measure_many, measure_pictures
from benchmarks.pages import write_page
from benchmarks.processes import describe_machine
from benchmarks.routes import measure_routes
from benchmarks.whole_commands import measure_commands

BARS = "A bar that is not cleared is marked; the exit code is then 1."


def main() -> int:
    """Measure and print; `--out FILE` also writes the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=7, help="interleaved rounds (default: 7)")
    parser.add_argument("--quick", action="store_true", help="as --rounds 3")
    parser.add_argument("--full", action="store_true", help="cost over size up to a million lines and 5,000 readings")
    parser.add_argument("--out", help="write the page to this file as well, and its picture beside it (.png)")
    args = parser.parse_args()
    rounds = 3 if args.quick else args.rounds
    if rounds < 1:
        parser.error(f"--rounds {rounds}: at least 1 is needed")
    missing = [name for name in ("numba", "openseespy") if find_spec(name) is None]
    if missing:
        parser.error(
            f"{' and '.join(missing)} not installed; pip install 'toolpath-stiff[test]' brings all that is timed"
        )
    route_lines, routes_pass = measure_routes(rounds)
    command_lines, commands_pass = measure_commands(rounds)
    many_lines, many_pass = measure_many(1)
    picture_lines, pictures_pass = measure_pictures()
    costs = measure_growth(args.full)
    drawn = [f"![CPU and memory over the size]({Path(args.out).with_suffix('.png').name})", ""] if args.out else []
    tables = [*route_lines, "", *command_lines, "", *many_lines, "", *picture_lines, ""]
    growth = ["## Cost over size", "", *drawn, *table(costs), "", BARS, ""]
    text = "\n".join(["# Benchmark", "", describe_machine(), "", *tables, *growth])
    print(text)
    if args.out:
        picture(costs, Path(args.out).with_suffix(".png"))
        write_page(args.out, f"{text}\nMade by `python -m benchmarks --out {args.out}`.")
    return 0 if routes_pass and commands_pass and many_pass and pictures_pass else 1


if __name__ == "__main__":
    sys.exit(main())
