"""`python -m benchmarks.heidenhain [--language siemens] [--programs N] [--seed S]`: random programs in a language.

Each is read by the package and by an independent small reader (`tests.nc.plain_language`, `siemens_reader`): kinds of
moves, points along them, the tool's axis must agree within 0.0001 mm. Prints what differs; exit code 1 if
anything does, or a program is refused.
"""

import argparse
import math
import sys

import numpy as np

from tests.nc import plain_language, siemens_reader
from toolpath_stiff.errors import TpsError
from toolpath_stiff.nc.moves import RAPID, Moves
from toolpath_stiff.nc.reader import parse_program

TOLERANCE_MM, TOLERANCE_AXIS = 1e-4, 1e-6
READERS = {"heidenhain": (plain_language, "hunt.h"), "siemens": (siemens_reader, "hunt.mpf")}


def seen(moves: Moves) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Moves as the small reader has them: kind, points along the way in mm, tool axis."""
    rows = []
    for i in range(len(moves)):
        start, end, normal = moves.start[i, :3] * 1e3, moves.end[i, :3] * 1e3, moves.arc_normal[i]
        out, points = start - moves.arc_center[i] * 1e3, []
        for share in plain_language.SHARES:
            turn, climb = moves.arc_sweep[i] * share, share * (end - start)
            if turn:
                along = normal * (normal @ out)
                turned = along + math.cos(turn) * (out - along) + math.sin(turn) * np.cross(normal, out)
                points.append(moves.arc_center[i] * 1e3 + turned + normal * (normal @ climb))
            else:
                points.append(start + climb)
        roll, pitch = moves.end[i, 3:5]
        axis = (math.sin(pitch) * math.cos(roll), -math.sin(roll), math.cos(pitch) * math.cos(roll))
        rows.append(("R" if moves.motion[i] == RAPID else "F", np.array(points), np.array(axis)))
    return rows


def milled(moves: list, lines: np.ndarray, witness: list) -> list:
    """Moves with those of each milling cycle (the witness's "M") as one: ("M", what is wrong)."""
    merged, row = [], 0
    for kind, line, claim in witness:
        last = row + 1
        if kind == "M":
            last = next((i for i in range(row, len(moves)) if lines[i] != line), len(moves))
            check, frame, end = claim
            to_program = np.linalg.inv(frame)
            local = [(k, (np.c_[p, np.ones(len(p))] @ to_program.T)[:, :3]) for k, p, _ in moves[row:last]]
            off = end is not None and np.abs(local[-1][1][-1] - end).max() > TOLERANCE_MM
            merged.append(("M", "another end" if off else check(local)))
        else:
            merged += moves[row:last]
        row = last
    return merged + moves[row:]


def difference(text: str, language: str = "heidenhain") -> str:
    """What differs between both readings, or why one refuses; "" where they agree."""
    readers, name = READERS[language]
    witness = readers.Reader(text).moves
    try:
        read = parse_program(text, name).moves
        moves, lines = seen(read), read.line
    except TpsError as error:
        return f"refused: {error}"
    moves = milled(moves, lines, witness)
    for number, (ours, theirs) in enumerate(zip(moves, witness, strict=False)):
        if theirs[0] == "M":  # what a milling cycle says of its path
            if problem := ours[1]:
                return f"move {number}: {problem}"
            continue
        kind, known = ("R", -1) if theirs[0] == "E" else (theirs[0], 0)  # only its end, where it begins is not said
        apart, leaning = np.abs(ours[1][known:] - theirs[1][known:]).max(), np.abs(ours[2] - theirs[2]).max()
        if ours[0] != kind or apart > TOLERANCE_MM or leaning > TOLERANCE_AXIS:
            return f"move {number}: {ours} and {theirs}"
    return "" if len(moves) == len(witness) else f"{len(moves)} moves and {len(witness)}"


def main() -> int:
    """Hunt; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--language", choices=READERS, default="heidenhain")
    arguments = parser.parse_args()
    differing = 0
    for seed in range(arguments.seed, arguments.seed + arguments.programs):
        text = READERS[arguments.language][0].random_program(seed)
        if detail := difference(text, arguments.language):
            differing += 1
            sys.stdout.write(f"seed {seed}: {detail}\n{text}\n")
    sys.stdout.write(f"{arguments.programs} programs, {differing} read otherwise\n")
    return min(differing, 1)


if __name__ == "__main__":
    sys.exit(main())
