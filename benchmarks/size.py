"""`python -m benchmarks.size`: programs of up to a million lines: reading, analyzing, writing; CPU time and memory.

One core. Rounds interleave what is compared, each ratio is taken within its round, the medians are printed. Bars: at
least 12 times pygcode's own parse-and-process throughput on 200,000 lines; `tps analyze` of a million lines within 12 s
of CPU and 1 GB with all its files (two samples a move: one at each end); a line of a million as cheap as one of
10,000 (within 1.5).
"""

import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.pages import bar, page_parser, table, tell
from benchmarks.processes import describe_machine, whole_command
from toolpath_stiff.nc.reader import parse_program

FASTER, FLAT, CPU_SECONDS, GIGABYTES = 12.0, 1.5, 12.0, 1.0
LENGTHS = (10_000, 30_000, 100_000, 300_000, 1_000_000)
Measured = tuple[list[str], bool]  # lines of a table, and whether its bars are cleared

# Programs as CAM systems write them, the same bytes for the same number of lines.
HEAD = "%\n(PART 1)\nG21 G90 G17 G94\nT1 M6\nS12000 M3\nG0 X0. Y0. Z10.\nG1 Z0. F800.\n"
TAIL = "M5\nM30\n%\n"


def three_axis(lines: int) -> Iterator[str]:
    """Modal X Y Z moves of 0.1 to 0.3 mm with new feeds, and every tenth line a small arc."""
    yield HEAD
    x = y = 0.0
    for i in range(lines):
        t = i * 0.002
        if i % 10 == 9:  # a quarter of a circle of 0.2 mm, in the direction that leads on
            yield f"G3 X{x + 0.2:.3f} Y{y + 0.2:.3f} I0. J0.2\n"
            x, y = round(x + 0.2, 3), round(y + 0.2, 3)
            continue
        x, y, z = 100.0 * math.sin(0.7 * t), 100.0 * math.cos(0.31 * t), 5.0 * math.sin(3.0 * t)
        mode = "G1" if i % 10 == 0 else ""
        feed = f" F{600 + 50 * (i // 100 % 7)}." if i % 100 == 0 else ""
        x, y, z = round(x, 3), round(y, 3), round(z, 3)
        yield f"{mode} X{x:.3f} Y{y:.3f}{f' Z{z:.3f}' if i % 3 == 0 else ''}{feed}\n".lstrip()
    yield TAIL


def five_axis(lines: int) -> Iterator[str]:
    """Numbered X Y Z A B moves, four decimals."""
    yield HEAD
    for i in range(lines):
        t = i * 0.002
        x, y, z = 100.0 * math.sin(0.7 * t), 100.0 * math.cos(0.31 * t), 5.0 * math.sin(3.0 * t)
        yield f"N{i + 10} G1 X{x:.4f} Y{y:.4f} Z{z:.4f} A{8.0 * math.sin(t):.3f} B{8.0 * math.cos(t):.3f}\n"
    yield TAIL


KINDS = {"3-axis": three_axis, "5-axis": five_axis}


def program(kind: str, lines: int) -> str:
    """A program of `KINDS` with that many lines of moves."""
    return "".join(KINDS[kind](lines))


def cpu(work: Callable[[], object]) -> float:
    """CPU seconds of a call."""
    start = time.process_time()
    work()
    return time.process_time() - start


def pygcode_alone(text: str) -> None:
    """What a script around pygcode does: every line through `Line`, every block through `Machine`."""
    from pygcode import Line, Machine

    machine = Machine()
    for line in text.splitlines():
        if line != "%":
            machine.process_block(Line(line).block)


def reading(lines: int, rounds: int) -> Measured:
    """Throughput against pygcode's own."""
    rows, passed = [], True
    for kind in KINDS:
        text, slow = program(kind, lines), program(kind, lines // 10)  # as fast a line, and enough of it
        parse_program(text)
        pairs = [
            (lines // 10 / cpu(lambda t=slow: pygcode_alone(t)), lines / cpu(lambda t=text: parse_program(t)))
            for _ in range(rounds)
        ]
        ratio = statistics.median(ours / theirs for theirs, ours in pairs)
        passed &= ratio >= FASTER
        rates = (f"{statistics.median(column):,.0f}" for column in zip(*pairs, strict=True))
        rows.append((kind, *rates, f"{ratio:.1f}", bar(ratio >= FASTER, f"{FASTER:g} or more")))
    heading = "program | pygcode's Line and Machine, lines/s: | tps, lines/s: | tps / pygcode: | bar"
    return [f"## Reading, {lines:,} lines", "", *table(heading, rows), ""], passed


def lengths(longest: int, rounds: int) -> Measured:
    """Cost of a line in programs of growing length."""
    sizes, rows, passed = [n for n in LENGTHS if n <= longest], [], True
    for kind in KINDS:
        texts = {n: program(kind, n) for n in sizes}
        costs = [
            statistics.median(1e6 * cpu(lambda t=text: parse_program(t)) / n for _ in range(rounds))
            for n, text in texts.items()
        ]
        ratio = max(costs) / min(costs)
        passed &= ratio <= FLAT
        rows.append((kind, *(f"{c:.2f}" for c in costs), f"{ratio:.2f}", bar(ratio <= FLAT, f"{FLAT:g} or less")))
    names = " | ".join(f"{n:,} lines:" for n in sizes)
    heading = f"program | {names} | dearest / cheapest: | bar"
    return ["## Cost of a line, microseconds of CPU", "", *table(heading, rows), ""], passed


def analyzing(lines: int) -> Measured:
    """Whole commands in processes of their own."""
    rows, passed = [], True
    most = f"{CPU_SECONDS:g} s, {GIGABYTES:g} GB or less"
    for kind, form in ((kind, form) for kind in KINDS for form in ("csv", "parquet")):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "part.nc").write_text(program(kind, lines), encoding="ascii")
            words = ["analyze", "part.nc", "--origin", "0,0,800", "--format", form, "--out", "report"]
            seconds, megabytes = whole_command(words, folder)
        clears = seconds <= CPU_SECONDS and megabytes <= 1000.0 * GIGABYTES
        passed &= clears
        rows.append((kind, form, f"{seconds:.1f}", f"{megabytes / 1000.0:.2f}", bar(clears, most)))
    what = f"## `tps analyze` of {lines:,} lines, all files, pictures and page included"
    return [what, "", *table("program | samples as | CPU s: | peak memory, GB: | bar", rows), ""], passed


def main() -> int:
    """Measure and print; `--out FILE` also writes the table."""
    parser = page_parser("benchmarks.size", __doc__)
    parser.add_argument("--lines", type=int, default=200_000, help="lines of the programs read (default: 200000)")
    parser.add_argument("--longest", type=int, default=1_000_000, help="lines of the longest (default: 1000000)")
    parser.add_argument("--rounds", type=int, default=3, help="interleaved rounds (default: 3)")
    args = parser.parse_args()
    measured = [reading(args.lines, args.rounds), lengths(args.longest, args.rounds), analyzing(args.longest)]
    lines = [line for part, _ in measured for line in part]
    text = "\n".join(["# Size", "", describe_machine(), "", *lines, "A bar that is not cleared is marked."])
    return tell(text, args, "python -m benchmarks.size", all(passed for _, passed in measured))


if __name__ == "__main__":
    sys.exit(main())
