"""`python -m benchmarks.size`: programs of up to a million lines: reading, analyzing, writing; CPU time and memory.

One core. Rounds interleave what is compared, each ratio is taken within its round, the medians are printed. Bars: at
least 12 times pygcode's own parse-and-process throughput on 200,000 lines; `tps analyze` of a million lines within 12 s
of CPU and 1 GB with all its files (two samples a move: one at each end); a line of a million as cheap as one of
10,000 (within 1.5); CSV and Parquet at the speed of the columnar library's own writers (0.8 of it, or more).
"""

from __future__ import annotations

import argparse
import io
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.pages import write_page
from benchmarks.processes import describe_machine, whole_command
from benchmarks.size_programs import KINDS, program
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.request import Request

FASTER, FLAT, CPU_SECONDS, GIGABYTES, COLUMNAR = 12.0, 1.5, 12.0, 1.0, 0.8
LENGTHS = (10_000, 30_000, 100_000, 300_000, 1_000_000)


@dataclass
class Report:
    """Lines of the table, and whether all bars are cleared."""

    lines: list[str] = field(default_factory=list)
    passed: bool = True

    def add(self, *lines: str) -> None:
        """Add lines, and print them."""
        self.lines += lines
        print("\n".join(lines), flush=True)

    def bar(self, cleared: bool, text: str) -> str:
        """The text of a bar, marked if it is not cleared."""
        self.passed &= cleared
        return text if cleared else f"{text}: NOT CLEARED"


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


def reading(report: Report, lines: int, rounds: int) -> None:
    """Throughput against pygcode's own."""
    report.add(
        f"## Reading, {lines:,} lines",
        "",
        "| program | pygcode's Line and Machine, lines/s | one by one, lines/s | tps, lines/s | tps / pygcode | bar |",
        "| --- | ---: | ---: | ---: | ---: | --- |",
    )
    for kind in KINDS:
        text = program(kind, lines)
        slow = program(kind, lines // 10)  # as fast a line, and enough of it
        ours, theirs, single, ratios = [], [], [], []
        parse_program(text)
        for _ in range(rounds):
            theirs.append(lines // 10 / cpu(lambda slow=slow: pygcode_alone(slow)))
            ours.append(lines / cpu(lambda text=text: parse_program(text)))
            single.append(lines // 10 / cpu(lambda slow=slow: one_by_one(slow)))
            ratios.append(ours[-1] / theirs[-1])
        ratio = statistics.median(ratios)
        bar = report.bar(ratio >= FASTER, f"{FASTER:g} or more")
        figures = " | ".join(f"{statistics.median(rates):,.0f}" for rates in (theirs, single, ours))
        report.add(f"| {kind} | {figures} | {ratio:.1f} | {bar} |")


def one_by_one(text: str) -> None:
    """Our reader without its fast way."""
    run = ProgramRun(Request(split_lines(text, "p"), "p"), fast=False)
    run.run()
    run.state.recorder.moves()


def lengths(report: Report, longest: int, rounds: int) -> None:
    """Cost of a line in programs of growing length."""
    sizes = [n for n in LENGTHS if n <= longest]
    names = " | ".join(f"{n:,} lines" for n in sizes)
    report.add(
        "",
        "## Cost of a line, microseconds of CPU",
        "",
        f"| program | {names} | dearest / cheapest | bar |",
        f"| --- |{' ---: |' * len(sizes)} ---: | --- |",
    )
    for kind in KINDS:
        texts = [program(kind, n) for n in sizes]
        rows = [
            [1e6 * cpu(lambda t=t: parse_program(t)) / n for t, n in zip(texts, sizes, strict=True)]
            for _ in range(rounds)
        ]
        costs = [statistics.median(column) for column in zip(*rows, strict=True)]
        ratio = max(costs) / min(costs)
        bar = report.bar(ratio <= FLAT, f"{FLAT:g} or less")
        report.add(f"| {kind} | {' | '.join(f'{c:.2f}' for c in costs)} | {ratio:.2f} | {bar} |")


def analyzing(report: Report, lines: int, folder: Path) -> None:
    """Whole commands in processes of their own."""
    report.add(
        "",
        f"## `tps analyze` of {lines:,} lines, all files, pictures and page included",
        "",
        "| program | samples as | CPU s | peak memory, GB | bar |",
        "| --- | --- | ---: | ---: | --- |",
    )
    for kind in KINDS:
        file = folder / f"{kind}.nc"
        file.write_text(program(kind, lines), encoding="ascii")
        for table in ("csv", "parquet"):
            seconds, megabytes = whole_command(
                ["analyze", str(file), "--origin", "0,0,800", "--format", table, "--out", str(folder / "report")]
            )
            bar = report.bar(
                seconds <= CPU_SECONDS and megabytes <= 1000.0 * GIGABYTES,
                f"{CPU_SECONDS:g} s, {GIGABYTES:g} GB or less",
            )
            report.add(f"| {kind} | {table} | {seconds:.1f} | {megabytes / 1000.0:.2f} | {bar} |")


def writing(report: Report, lines: int, rounds: int) -> None:
    """Our tables against pyarrow's and pandas' own writers, from the same analysis to bytes in memory."""
    import pyarrow as pa
    import pyarrow.csv as pc
    import pyarrow.parquet as pq

    from toolpath_stiff.analysis.results import analyze
    from toolpath_stiff.analysis.statistics import sample_columns, samples_csv, samples_parquet
    from toolpath_stiff.machine.file import load_machine

    analysis = analyze(load_machine("nist"), parse_program(program("5-axis", lines)), origin=(0, 0, 0.8, 0, 0, 0))
    rows = len(analysis.samples)

    def table() -> pa.Table:
        return pa.table({name: pa.array(values) for name, values in sample_columns(analysis).items()})

    ways: dict[str, Callable[[], object]] = {
        "tps csv": lambda: sum(map(len, samples_csv(analysis))),
        "pyarrow csv": lambda: pc.write_csv(table(), io.BytesIO()),
        "pandas csv": lambda: analysis.to_frame().iloc[: rows // 10].to_csv(float_format="%.6f"),
        "tps parquet": lambda: sum(map(len, samples_parquet(analysis))),
        "pyarrow parquet": lambda: pq.write_table(table(), io.BytesIO()),
    }
    share = {"pandas csv": 10}  # a tenth of the rows is enough of it
    for work in ways.values():  # what they load is not their speed
        work()
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, work in ways.items():
            taken[name].append(share.get(name, 1) * cpu(work))
    report.add(
        "",
        f"## Writing {rows:,} samples",
        "",
        "| format | tps, rows/s | pyarrow, rows/s | pandas, rows/s | tps / pyarrow | bar |",
        "| --- | ---: | ---: | ---: | ---: | --- |",
    )
    for form in ("csv", "parquet"):
        pairs = zip(taken[f"tps {form}"], taken[f"pyarrow {form}"], strict=True)
        ratio = statistics.median(theirs / ours for ours, theirs in pairs)
        rates = [
            f"{rows / statistics.median(taken[name]):,.0f}" if name in taken else ""
            for name in (f"tps {form}", f"pyarrow {form}", f"pandas {form}")
        ]
        bar = report.bar(ratio >= COLUMNAR, f"{COLUMNAR:g} or more")
        report.add(f"| {form} | {' | '.join(rates)} | {ratio:.2f} | {bar} |")


def main() -> int:
    """Measure and print; `--out FILE` also writes the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.size", description=__doc__)
    parser.add_argument("--lines", type=int, default=200_000, help="lines of the programs read (default: 200000)")
    parser.add_argument("--longest", type=int, default=1_000_000, help="lines of the longest (default: 1000000)")
    parser.add_argument("--rounds", type=int, default=3, help="interleaved rounds (default: 3)")
    parser.add_argument("--out", help="write the table to this file as well")
    args = parser.parse_args()
    report = Report()
    report.add("# Size", "", describe_machine(), "")
    reading(report, args.lines, args.rounds)
    lengths(report, args.longest, args.rounds)
    with tempfile.TemporaryDirectory() as folder:
        analyzing(report, args.longest, Path(folder))
    writing(report, args.lines, args.rounds)
    report.add("", "A bar that is not cleared is marked; the exit code is then 1.")
    if args.out:
        text = "\n".join(report.lines)
        write_page(args.out, f"{text}\n\nMade by `python -m benchmarks.size --out {args.out}`.")
    return 0 if report.passed else 1


if __name__ == "__main__":
    sys.exit(main())
