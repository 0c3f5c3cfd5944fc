"""`python -m benchmarks.mutations`: the built-in reader on programs with bytes dropped, doubled and swapped.

Each mutated program must either be read or be refused with its line: no traceback, no hang, no growth of memory. Exit
code 1 if one is not. Mutated are openings of the programs in `programs/`, cutter-location files among them, read in
every dialect, seeded.
"""

from __future__ import annotations

import argparse
import random
import resource
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from types import FrameType

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import read_tool_table

PROGRAMS = Path(__file__).parent.parent / "programs"
TOOLS = read_tool_table(PROGRAMS / "tools.tbl")
LINES = (30, 90)  # of the openings that are mutated: the later part is met as well
MOST_MUTATIONS = 6
PATIENCE = 20  # s for one program
SETTLED = 0.1  # share of the programs after which memory is compared: caches are full then
GROWTH_BAR = 32.0  # MB between then and the end
WRONG = ("traceback", "hang", "no line")
# What concerns the whole program has no line of its own.
OF_THE_WHOLE = ("no cutting move", "empty")


class Hang(BaseException):
    """A program took too long; not an `Exception`, so that no reader swallows it."""


def _alarm(number: int, frame: FrameType | None) -> None:
    raise Hang


def openings() -> list[tuple[str, bytes]]:
    """A short and a longer opening of every program, each with a name of its kind."""
    found = []
    for path in sorted([*PROGRAMS.glob("*.nc"), *PROGRAMS.glob("*.apt")]):
        lines = path.read_bytes().splitlines(keepends=True)
        # Circles and cycles come late in a cutter-location file.
        pieces = [lines[:count] for count in LINES] if path.suffix == ".nc" else [lines[:30], lines[-45:], lines]
        found += [(f"part{path.suffix}", b"".join(piece)) for piece in pieces]
    return found


def mutated(opening: bytes, chance: random.Random) -> bytes:
    """The opening with one to six bytes dropped, doubled or swapped."""
    content = bytearray(opening)
    for _ in range(chance.randint(1, MOST_MUTATIONS)):
        at = chance.randrange(len(content))
        kind = chance.randrange(3)
        if kind == 0 and len(content) > 1:
            del content[at]
        elif kind == 1:
            content.insert(at, content[at])
        else:
            other = chance.randrange(len(content))
            content[at], content[other] = content[other], content[at]
    return bytes(content)


def outcome(name: str, content: bytes, dialect: str) -> str:
    """`read`, `refused`, or what went wrong."""
    signal.alarm(PATIENCE)
    try:
        parse_program(content.decode("latin-1"), name, controller=Controller(DIALECTS[dialect], tools=TOOLS))
    except InputError as error:
        whole = error.line is not None or any(words in str(error) for words in OF_THE_WHOLE)
        return "refused" if whole else f"no line: {error}"
    except Hang:
        return "hang"
    except Exception as error:
        return f"traceback: {type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
    return "read"


def megabytes() -> float:
    """Largest memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> int:
    """Mutate, read, count, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations", description=__doc__)
    parser.add_argument("--n", type=int, default=20_000, metavar="N", help="programs (default: 20000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N")
    parser.add_argument("--out", metavar="FILE", help="write the table to this file as well")
    args = parser.parse_args()
    signal.signal(signal.SIGALRM, _alarm)
    chance, originals, dialects = random.Random(args.seed), openings(), sorted(DIALECTS)
    counts: Counter[str] = Counter()
    wrong, slowest, settled = [], 0.0, 0.0
    for number in range(args.n):
        name, opening = chance.choice(originals)
        content, dialect = mutated(opening, chance), dialects[number % len(dialects)]
        begin = time.process_time()
        found = outcome(name, content, dialect)
        slowest = max(slowest, time.process_time() - begin)
        counts[found.split(":")[0]] += 1
        if found not in ("read", "refused"):
            wrong.append(f"program {number} ({dialect}): {found}")
        if number == int(SETTLED * args.n):
            settled = megabytes()
        if sys.stderr.isatty() and number % 100 == 0:
            sys.stderr.write(f"\r{number} of {args.n}")
    growth = megabytes() - settled
    rows = [
        f"| programs | {args.n} (seed {args.seed}) | | |",
        f"| read, mutation without harm | {counts['read']} | | |",
        f"| refused with a line | {counts['refused']} | | |",
        *(
            f"| {kind} | {counts[kind]} | 0 | {_verdict(not counts[kind])} |"
            for kind in ("traceback", "hang", "no line")
        ),
        f"| memory grown by | {growth:.1f} MB | {GROWTH_BAR:g} MB | {_verdict(growth <= GROWTH_BAR)} |",
        f"| slowest program | {slowest:.1f} s of CPU | {PATIENCE} s | {_verdict(slowest <= PATIENCE)} |",
    ]
    text = "\n".join(["# Mutated programs", "", "| | found | bar | |", "| --- | ---: | ---: | --- |", *rows, ""])
    print("\n".join([text, *wrong[:20]]))
    if args.out:
        made = f"\nMade by `python -m benchmarks.mutations --out {args.out}`.\n"
        write_atomically(Path(args.out), text + made)
    return int(bool(wrong) or growth > GROWTH_BAR)


def _verdict(passed: bool) -> str:
    return "pass" if passed else "**FAIL**"


if __name__ == "__main__":
    raise SystemExit(main())
