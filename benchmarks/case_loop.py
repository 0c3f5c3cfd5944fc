"""Blind cases run in whole processes, each record written as it comes."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import Pool
from pathlib import Path
from typing import Any

from benchmarks.bars import Figure, Record, bars_table, summary
from benchmarks.pages import write_page

Collect = Callable[[str, Callable[[Any], Record], Sequence[Any]], list[Record]]


def run_benchmark(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    make_records: Callable[[argparse.Namespace], list[Record]],
    report: Callable[[Sequence[Record], str], tuple[str, bool]],
    *,
    records: Path,
    out: Path | None,
) -> int:
    """The exit code of a benchmark on blind cases, 1 if a bar is not cleared; its page is printed and written.

    Parameters
    ----------
    parser
        With the options that say which cases are run.
    arguments
        Of the command line.
    make_records
        Runs the cases that the options say.
    report
        Makes the page of the records and of the command, and says whether all bars are cleared.
    records, out
        Where the records of the cases and the page go unless said otherwise; None: the page is printed alone.
    """
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--records", type=Path, default=records, help="JSON lines, one a case")
    parser.add_argument("--table-only", action="store_true", help="print the tables from --records again")
    parser.add_argument("--out", type=Path, default=out, help="markdown file to write")
    args = parser.parse_args(arguments)
    text, cleared = report(
        read_records(args.records) if args.table_only else make_records(args), _command(parser, args)
    )
    print(text)
    if args.out:
        write_page(args.out, text, of_records=args.table_only)
    return 0 if cleared else 1


def _command(parser: argparse.ArgumentParser, args: argparse.Namespace) -> str:
    """The command line that says what was run: the options that are not as usual."""
    words = [parser.prog]
    for name, value in vars(args).items():
        values = value if isinstance(value, list) else [value]
        usual = parser.get_default(name)
        if name not in ("jobs", "records", "table_only") and value != usual and tuple(values) != usual:
            words += [f"--{name.replace('_', '-')}", *map(str, values)]
    return " ".join(words)


def record_of(heading: Record, work: Callable[[Path], Record]) -> Record:
    """The heading of a case and what work in a folder of its own says; with `error`, the traceback, where it failed."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            return heading | work(Path(folder))
    except Exception:  # a case that breaks must be counted, not end the run
        return heading | {"error": traceback.format_exc()}


def run_cases(args: argparse.Namespace, name: str, run: Callable[[Any], Record], jobs: Sequence[Any]) -> list[Record]:
    """The records of all cases, in as many processes as the options say."""
    with case_loop(args.jobs, args.records) as collect:
        return collect(name, run, jobs)


@contextmanager
def case_loop(workers: int, into: Path) -> Iterator[Collect]:
    """A function (what is said, what makes a record of a job, jobs) -> records, which all go into one file of lines.

    Processes are started only where there are several.
    """
    into.parent.mkdir(parents=True, exist_ok=True)
    with into.open("w", encoding="utf-8") as stream:

        def collect(name: str, made: Iterator[Record], count: int) -> list[Record]:
            records = []
            for record in made:
                records.append(record)
                stream.write(json.dumps(record) + "\n")
                stream.flush()
                if len(records) % 10 == 0 or len(records) == count:
                    print(f"{name}: {len(records)} of {count}", file=sys.stderr, flush=True)
            return records

        if workers <= 1:
            yield lambda name, run, jobs: collect(name, map(run, jobs), len(jobs))
            return
        with Pool(workers) as pool:
            yield lambda name, run, jobs: collect(name, pool.imap_unordered(run, jobs, chunksize=1), len(jobs))


def sound(records: Sequence[Record], order: Callable[[Record], Any]) -> list[Record]:
    """The records of cases that did not break, in order."""
    return sorted((r for r in records if "error" not in r), key=order)


def document(
    title: str,
    what: str,
    figures: Sequence[Figure],
    parts: Sequence[tuple[str, Sequence[str]]],
    records: Sequence[Record],
    command: str,
) -> tuple[str, bool]:
    """A page in markdown, and whether all bars are cleared and no case broke.

    What fails in a sentence, the cases that broke, the bars, parts under their headings, and the command.
    """
    broken = [r for r in records if "error" in r]
    shown = [("", [summary(figures)]), ("Bars", bars_table(figures)), *parts]
    if broken:
        rows = [
            f"- {' '.join(str(r[key]) for key in ('layout', 'group', 'hidden', 'seed') if key in r)}: "
            f"`{r['error'].strip().splitlines()[-1]}`"
            for r in broken
        ]
        shown.insert(1, ("Cases that broke", rows))
    lines = [f"# {title}", "", what, ""]
    for heading, body in shown:
        lines += [*([f"## {heading}", ""] if heading else []), *body, ""]
    text = "\n".join([*lines, f"Made by `{command}`."]) + "\n"
    return text, not broken and all(figure.cleared is not False for figure in figures)


def read_records(file: Path) -> list[Record]:
    """The records of an earlier run."""
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
