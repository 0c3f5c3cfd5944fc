"""The pages that benchmarks write: what they found, the command, the day and the commit."""

import argparse
import subprocess
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from toolpath_stiff.files import write_atomically


def commit() -> str:
    """The commit of this checkout, with -dirty where files differ from it; "unknown" without git."""
    command = ["git", "describe", "--always", "--dirty", "--exclude=*"]
    try:
        done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.strip()


STARTED = datetime.now(UTC).date(), commit()  # a run takes hours, in which the checkout may move on


def table(headings: str, rows: Iterable[Sequence[object]]) -> list[str]:
    """Lines of a table in markdown; the column of a heading that ends in ":" is set to the right."""
    names = headings.split(" | ")
    ruler = " | ".join("---:" if name.endswith(":") else "---" for name in names)
    lines = [f"| {' | '.join(name.removesuffix(':') for name in names)} |", f"| {ruler} |"]
    return lines + [f"| {' | '.join(map(str, row))} |" for row in rows]


def bar(clears: bool, text: str) -> str:
    """A bar in words, marked where it is not cleared."""
    return text if clears else f"{text}: NOT CLEARED"


def mark(passed: bool) -> str:
    """Whether a bar is cleared, in a cell of its own."""
    return "pass" if passed else "**FAIL**"


def write_page(file: str | Path, text: str, *, of_records: bool = False) -> None:
    """Write a page, with a last line on the run that made it; `of_records`: it tabulates those of an earlier run."""
    what = "Tabulated anew from an earlier run's records" if of_records else "Run"
    day, name = STARTED
    write_atomically(file, f"{text.rstrip()}\n\n{what} on {day}, commit {name}.\n")


def page_parser(name: str, about: str | None) -> argparse.ArgumentParser:
    """The parser of `python -m name`, whose page goes to --out as well."""
    parser = argparse.ArgumentParser(prog=f"python -m {name}", description=about)
    parser.add_argument("--out", type=Path, metavar="FILE.md", help="write the page to this file as well")
    return parser


def tell(text: str, args: argparse.Namespace, command: str, passed: bool) -> int:
    """Print a page, write it to --out with the command that made it; the exit code: 1 where a bar is not cleared."""
    print(text)
    if args.out:
        write_page(args.out, f"{text.rstrip()}\n\nMade by `{command} --out {args.out}`.")
    return 0 if passed else 1
