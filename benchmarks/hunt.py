"""`python -m benchmarks.hunt [--programs N] [--seed S]`: random programs through the built-in reader and LinuxCNC's.

Where one of them refuses a line, the line is left out and the rest tried again: what is compared has been read by both.
The feed path must be the same (0.01 mm and degrees, move by move). Prints how many came out how, and every program that
both read differently; exit code 1 if there is one.
"""

import math
import re
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.conformance import LINUXCNC
from benchmarks.hunt_compensation import Beside, Tolerances
from benchmarks.hunt_programs import Harsh, Parametric, Zeros
from benchmarks.pages import page_parser, table, tell
from tests.nc import rs274
from toolpath_stiff.errors import TpsError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.linuxcnc.reader import fenced
from toolpath_stiff.nc.moves import MOTION_NAMES, ReadProgram
from toolpath_stiff.nc.reader import read_program

TOLERANCE = 0.01  # mm and degrees
PRINTED = 0.011  # a move shorter than rs274's digits, and twice their sum
CENTER_TOLERANCE = 0.05  # mm: a centre from R magnifies the digits where the chord is nearly a diameter
MOST_REPAIRS = 15
LENGTHS = {1: 50.0, 2: 75.5, 3: 101.6}  # mm
SAME, RAPIDS, REFUSED, WE_REFUSE, ONLY_WE, UNANSWERED, OTHER = (
    "same feed path", "same feed path, other rapids", "refused by both", "refused by the built-in reader",
    "refused by LinuxCNC alone", "LinuxCNC gave no answer within a minute", "OTHER PATH",
)  # fmt: skip
COMMENT, CODE = re.compile(r"\([^)]*\)|;.*"), re.compile(r"([GM]) *0*(\d+(?:\.\d)?)(?![\d.])")
WITHHELD = "not given to LinuxCNC"
VERDICTS = (SAME, RAPIDS, REFUSED, WE_REFUSE, ONLY_WE, WITHHELD, UNANSWERED, OTHER)
Move = tuple[str, np.ndarray, np.ndarray, "tuple[np.ndarray, np.ndarray, float] | None"]


@dataclass(frozen=True)
class Outcome:
    """What became of a program: verdict, what differs, and the text that both were given in the end."""

    verdict: str
    detail: str
    text: str


def our_moves(program: ReadProgram) -> list[Move]:
    """Moves in control coordinates, mm and degrees, as the witness has them."""
    moves, origin = program.moves, np.array(program.origin[:3]) * 1e3
    found: list[Move] = []
    for i in range(len(moves)):
        ends = [np.concatenate([p[:3] * 1e3 + origin, np.rad2deg(p[3:])]) for p in (moves.start[i], moves.end[i])]
        turned = bool(moves.arc_sweep[i])
        arc = (moves.arc_center[i] * 1e3 + origin, moves.arc_normal[i], float(moves.arc_sweep[i])) if turned else None
        name = MOTION_NAMES[moves.motion[i]]
        found.append(("rapid" if name == "rapid" else "arc" if turned else "feed", ends[0], ends[1], arc))
    return found


def kept(moves: list[Move], rapids: bool) -> list[Move]:
    """Those that are compared."""
    return [
        move
        for move in moves
        if (rapids or move[0] != "rapid") and (move[3] is not None or np.abs(move[2] - move[1]).max() > PRINTED)
    ]


def difference(ours: list[Move], theirs: list[Move]) -> str:
    """The first thing in which two lists of moves differ; "" if nothing."""
    if len(ours) != len(theirs):
        return f"{len(ours)} moves and {len(theirs)}"
    for number, (mine, other) in enumerate(zip(ours, theirs, strict=True), 1):
        if mine[0] != other[0]:
            return f"move {number}: {mine[0]} and {other[0]}"
        for what, a, b in (("start", mine[1], other[1]), ("end", mine[2], other[2])):
            if np.abs(a - b).max() > TOLERANCE:
                return f"move {number}: {what} {a.round(3).tolist()} and {b.round(3).tolist()}"
        if mine[3] is not None and other[3] is not None:
            apart = arcs_apart(mine[3], other[3])
            if apart:
                return f"move {number}: {apart}"
    return ""


def arcs_apart(mine: tuple[np.ndarray, np.ndarray, float], other: tuple[np.ndarray, np.ndarray, float]) -> str:
    """In what two arcs differ; the witness' third entry is its signed number of turns."""
    (center, normal, sweep), (their_center, their_normal, turns) = mine, other
    if np.abs(normal - their_normal).max() > 1e-3:
        return "planes"
    if np.sign(sweep) != np.sign(turns) or max(1, math.ceil(abs(sweep) / math.tau - 1e-6)) != abs(turns):
        return f"a sweep of {sweep:.4f} rad and {turns} turns"
    apart = center - their_center
    return "centres" if np.linalg.norm(apart - (apart @ normal) * normal) > CENTER_TOLERANCE else ""


def hunt_one(text: str, folder: Path, controller: Controller = UNKNOWN_CONTROL) -> Outcome | None:
    """Hold a program against the witness; None if LinuxCNC must not be given it."""
    ours_table = "".join(f"T{n} P{n} Z{z} D6.35 ;\n" for n, z in LENGTHS.items())
    # rs274 takes the lengths of its table as inches.
    their_table = "".join(f"T{n} P{n} Z{z / 25.4:.8f} D0.25 ;\n" for n, z in LENGTHS.items())
    (folder / "ours.tbl").write_text(ours_table)
    file = folder / "part.ngc"
    for _ in range(MOST_REPAIRS):
        try:
            fenced(split_lines(text, file.name), file.name)
        except TpsError:
            return None
        file.write_text(text, newline="")
        for left in ("rs274.var", "canon.txt"):  # it keeps its parameters from run to run
            (folder / left).unlink(missing_ok=True)
        try:
            theirs = rs274.run(file, folder, their_table)
        except subprocess.TimeoutExpired:
            return Outcome(UNANSWERED, "", text)
        program, answer = None, ""
        try:
            program = read_program(file, tool_table=folder / "ours.tbl", controller=controller)
        except TpsError as error:
            answer = str(error)
        if program is not None and not theirs.error:
            return _both_read(program, theirs, text)
        line = _refused_line(text, answer, theirs.error)
        if line is None:
            verdict = REFUSED if answer and theirs.error else WE_REFUSE if answer else ONLY_WE
            if "no cutting move" in answer and not theirs.error:
                verdict = OTHER if kept(theirs.moves, rapids=False) else SAME
            return Outcome(verdict, answer or theirs.error.strip().splitlines()[-1], text)
        lines = text.splitlines()
        text = "\n".join([*lines[: line - 1], *lines[line:], ""])
    return Outcome(REFUSED, "too many lines", text)


def _both_read(program: ReadProgram, theirs: rs274.Canon, text: str) -> Outcome:
    ours = our_moves(program)
    apart = difference(kept(ours, False), kept(theirs.moves, False))
    if apart:
        return Outcome(OTHER, apart, text)
    apart = difference(kept(ours, True), kept(theirs.moves, True))
    return Outcome(RAPIDS if apart else SAME, apart, text)


def _refused_line(text: str, ours: str, theirs: str) -> int | None:
    """The line (from 1) to leave out: that which the built-in reader names, else that which rs274 repeats."""
    found = re.match(r"part\.ngc:(\d+)", ours)
    if found:
        return int(found[1])
    repeated = theirs.strip().splitlines()[-1].strip() if theirs and not ours else None
    lines = enumerate(text.splitlines(), 1)
    return next((number for number, line in lines if repeated and line.strip() == repeated), None)


def main() -> int:
    """Hunt; the exit code is 1 if a path differs."""
    parser = page_parser("benchmarks.hunt", __doc__)
    parser.add_argument("--programs", type=int, default=2000, metavar="N", help="how many (default: 2000)")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the first one (default: 0)")
    args = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        for seed in range(args.seed, args.seed + args.programs):
            outcome = hunt_one(program_of(seed), Path(name), control_of(seed))
            counts[outcome.verdict if outcome else WITHHELD] += 1
            if outcome and outcome.verdict == OTHER:
                print(f"seed {seed}: {outcome.detail}\n{outcome.text}\n")
    command = f"python -m benchmarks.hunt --programs {args.programs} --seed {args.seed}"
    return tell(page(counts, args.programs, args.seed), args, command, not counts[OTHER])


def codes_of(text: str) -> set[str]:
    """The codes in a program, and the words F, S, T that act like codes."""
    bare = COMMENT.sub("", text).upper()
    codes = {code_name(letter, float(number)) for letter, number in CODE.findall(bare)}
    return codes | {letter for letter in "FST" if letter in bare}


def page(counts: Counter[str], programs: int, seed: int) -> str:
    """The document."""
    what = (
        f"{programs} random programs, of the seeds {seed} to {seed + programs - 1}: of lines at odds with each other, "
        "with variables and flow, contours under cutter compensation, arcs at the tolerance. A "
        "line that one of the readers refuses is left out; the feed paths must agree within "
        f"{TOLERANCE} mm and degrees, move by move."
    )
    rows = [(verdict, counts[verdict]) for verdict in VERDICTS if counts[verdict] or verdict == OTHER]
    head = ["# Random programs through both readers", "", what, ""]
    return "\n".join([*head, *table("what became of it | programs", rows)])


KINDS = (Harsh, Zeros, Harsh, Parametric, Beside, Tolerances)


def program_of(seed: int) -> str:
    """The program of a seed, of the kinds in turn, the harsh one twice."""
    return KINDS[seed % len(KINDS)](seed).program()


def control_of(seed: int) -> Controller:
    """The control that the built-in reader takes it for: compensation is read in LinuxCNC's dialect alone."""
    return LINUXCNC if KINDS[seed % len(KINDS)] is Beside else UNKNOWN_CONTROL


if __name__ == "__main__":
    sys.exit(main())
