"""`python -m benchmarks`: the stiffness routes, start-up and many programs, with the bars that they must clear.

One core: the thread pools are limited before numpy loads. Rounds interleave the methods, each ratio is taken within
its round, the medians are printed. Absolute times depend on the machine; the ratios hardly do.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[variable] = "1"

# ruff: noqa: E402 - the thread limits above must come first
import argparse
import platform
import sys
from importlib.util import find_spec
from pathlib import Path

from benchmarks.many import measure_many
from benchmarks.routes import measure_routes
from benchmarks.startup import measure_startup

BARS = "A bar that is not cleared is marked; the exit code is then 1."


def describe_machine() -> str:
    """Processor and versions."""
    from importlib.metadata import version

    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [
            line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if line.startswith("model name")
        ]
        model = names[0] if names else model
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "openseespy"))
    return f"{model}; Python {platform.python_version()}; {packages}; one core"


def main() -> int:
    """Measure and print; `--out FILE` also writes the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=7, help="interleaved rounds (default: 7)")
    parser.add_argument("--quick", action="store_true", help="as --rounds 3")
    parser.add_argument("--out", help="write the table to this file as well")
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
    startup_lines, startup_pass = measure_startup(rounds)
    many_lines, many_pass = measure_many(1)
    text = "\n".join(
        ["# Benchmark", "", describe_machine(), "", *route_lines, "", *startup_lines, "", *many_lines, "", BARS, ""]
    )
    print(text)
    if args.out:
        Path(args.out).write_text(f"{text}\nMade by `python -m benchmarks --out {args.out}`.\n", encoding="utf-8")
    return 0 if routes_pass and startup_pass and many_pass else 1


if __name__ == "__main__":
    sys.exit(main())
