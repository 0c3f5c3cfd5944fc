"""Blind cases run in whole processes, each record written as it comes."""

import argparse
import json
import shlex
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from multiprocessing import Pool
from pathlib import Path
from typing import Any

from benchmarks.bars import Figure, Record, bars_table, summary
from benchmarks.pages import write_page
from toolpath_stiff.rig.case import BUILT


def run_benchmark(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    make_jobs: Callable[[argparse.Namespace], Sequence[Any]],
    diagnosed: Callable[[Any, Path], Record],
    report: Callable[[Sequence[Record], str], tuple[str, bool]],
) -> int:
    """The exit code of a benchmark on blind cases, 1 if a bar is not cleared; prints its page, writes it to --out.

    `make_jobs` makes the cases that the options say, `diagnosed` is that of `record_of`, `report` the page of all
    records and of the command, and whether all bars are cleared.
    """
    name = parser.prog.rpartition(".")[2]
    records = Path(__file__).parent.parent / "reports" / f"benchmark_{name}.jsonl"
    if "--built" not in parser.format_usage():
        parser.add_argument("--built", choices=BUILT, default=BUILT[0], help=f"machines (default: {BUILT[0]})")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--records", type=Path, default=records, help="JSON lines, one a case")
    parser.add_argument("--resume", action="store_true", help="keep the cases that --records holds")
    parser.add_argument("--table-only", action="store_true", help="print the tables from --records again")
    parser.add_argument("--out", type=Path, metavar="FILE.md", help="write the page to this file as well")
    args = parser.parse_args(arguments)
    if not args.table_only:
        run_cases(make_jobs(args), diagnosed, args.jobs, args.records, resume=args.resume)
    made = [json.loads(line) for line in args.records.read_text(encoding="utf-8").splitlines()]
    text, cleared = report(made, f"{parser.prog} {shlex.join(sys.argv[1:] if arguments is None else arguments)}")
    print(text)
    if args.out:
        write_page(args.out, text, of_records=args.table_only)
    return 0 if cleared else 1


def record_of(diagnosed: Callable[[Any, Path], Record], job: Any) -> Record:
    """A case and what became of it in a folder of its own; with `error`, the traceback, where it failed."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            return asdict(job) | diagnosed(job, Path(folder))
    except Exception:  # a case that breaks must be counted, not end the run
        return asdict(job) | {"error": traceback.format_exc()}


def run_cases(
    jobs: Sequence[Any], diagnosed: Callable[[Any, Path], Record], workers: int, into: Path, *, resume: bool = False
) -> None:
    """Each record is written as it comes, a line of JSON; `resume` keeps those there of cases that did not break."""
    into.parent.mkdir(parents=True, exist_ok=True)
    kept = into.read_text(encoding="utf-8").splitlines() if resume and into.exists() else []
    records = [record for record in map(json.loads, kept) if "error" not in record]
    jobs = [job for job in jobs if not any(asdict(job).items() <= record.items() for record in records)]
    with into.open("w", encoding="utf-8") as stream, Pool(workers) as pool:
        stream.writelines(json.dumps(record) + "\n" for record in records)
        for count, record in enumerate(pool.imap_unordered(partial(record_of, diagnosed), jobs, chunksize=1), 1):
            stream.write(json.dumps(record) + "\n")
            stream.flush()
            if count % 10 == 0 or count == len(jobs):
                print(f"{count} of {len(jobs)}", file=sys.stderr, flush=True)


def sound(records: Sequence[Record], order: Callable[[Record], Any]) -> list[Record]:
    """The records of cases that did not break, in order."""
    return sorted((r for r in records if "error" not in r), key=order)


def document(
    title: str,
    about: str | None,
    figures: Sequence[Figure],
    parts: Sequence[tuple[str, Sequence[str]]],
    records: Sequence[Record],
    command: str,
) -> tuple[str, bool]:
    """A page in markdown, and whether all bars are cleared and no case broke.

    What the benchmark's docstring (`about`) says after its first sentence, what fails, the cases that broke, the bars,
    parts under their headings, and the command.
    """
    what = " ".join((about or "").partition("\n\n")[2].split())
    broken = [
        f"- {' '.join(str(r[key]) for key in ('layout', 'group', 'hidden', 'seed') if key in r)}: "
        f"`{r['error'].strip().splitlines()[-1]}`"
        for r in records
        if "error" in r
    ]
    lines = [f"# {title}", "", what, "", summary(figures), ""]
    for heading, body in (("Cases that broke", broken), ("Bars", bars_table(figures)), *parts):
        lines += [f"## {heading}", "", *body, ""] if body else []
    text = "\n".join([*lines, f"Made by `{command}`."]) + "\n"
    return text, not broken and all(figure.cleared is not False for figure in figures)
