"""`python -m benchmarks`: the stiffness routes, whole commands, many programs, with the bars to clear.

One core: the thread pools are limited before numpy loads. Rounds interleave the methods, each ratio is taken within
its round, the medians are printed. Absolute times depend on the machine; the ratios hardly do.
"""

import sys
from importlib.util import find_spec

from benchmarks.pages import page_parser, tell
from benchmarks.processes import describe_machine
from benchmarks.routes import measure_routes
from benchmarks.whole_commands import measure_commands, measure_many, measure_pictures


def main() -> int:
    """Measure and print; `--out FILE` also writes the table."""
    parser = page_parser("benchmarks", __doc__)
    parser.add_argument("--rounds", type=int, default=7, help="interleaved rounds (default: 7)")
    parser.add_argument("--programs", type=int, default=2000, help="small programs of one command (default: 2000)")
    args = parser.parse_args()
    missing = [name for name in ("numba", "openseespy") if find_spec(name) is None]
    if missing:
        parser.error(
            f"{' and '.join(missing)} not installed; pip install 'toolpath-stiff[test]' brings all that is timed"
        )
    many = measure_many(1, args.programs), measure_pictures(args.programs // 10)
    measured = [measure_routes(args.rounds), measure_commands(args.rounds), *many]
    lines = [line for part, _ in measured for line in (*part, "")]
    text = "\n".join(["# Benchmark", "", describe_machine(), "", *lines, "A bar that is not cleared is marked."])
    command = f"python -m benchmarks --rounds {args.rounds} --programs {args.programs}"
    return tell(text, args, command, all(passed for _, passed in measured))


if __name__ == "__main__":
    sys.exit(main())
