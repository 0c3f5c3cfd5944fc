"""`python -m benchmarks.diagnosis_size`: CPU and memory of `diagnose`, `compare` and `update` over the readings.

Campaigns of the rig on one machine, from the 288 readings of its tilted layout on: more poses drawn as those are, each
along X, Y and Z at two loads, clamped twice. Every command runs as its user runs it, in a process of its own and on one
core. Bars: 288 readings within 3 s of CPU (`update`: 2 s), 1,000 within 20 s, 5,000 within 120 s and 2 GB; from 288 on
the cost grows at most as n^1.5; 10,000 readings end with a verdict.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.pages import bar, write_page
from benchmarks.processes import describe_machine, whole_command
from toolpath_stiff.rig import case, exercise

SIZES = (288, 1000, 5000, 10_000)
COMMANDS = {"diagnose": (), "compare": (), "update": ("--add", "weak_strut")}
CPU_SECONDS = {288: 3.0, 1000: 20.0, 5000: 120.0}
UPDATE_SECONDS = {288: 2.0}
MEGABYTES = {5000: 2000.0}
EXPONENT = 1.5
SEED, HIDDEN, HIDDEN_SIZE = 3, "weak_strut", 0.06
TABLE = Path(__file__).parent / "diagnosis_size.md"


@dataclass(frozen=True)
class Run:
    """One command on one campaign: user and system CPU, s; largest memory, MB."""

    command: str
    readings: int
    seconds: float
    megabytes: float


def campaign(readings: int) -> str:
    """A measurement file of so many readings of one machine."""
    tables, poses = [], 0
    for seed in range(1000, 1000 + readings // 288 + 1):
        rows, _ = case.make_case(seed, hidden="none")
        rows["clamp"] = np.asarray(rows["clamp"]) + 2 * poses
        rows["point"] = np.asarray(rows["point"]) + poses
        poses += len(set(np.asarray(rows["point"]).tolist()))
        tables.append({name: column for name, column in rows.items() if name != "stiffness_N_per_mm"})
    plan = {name: np.concatenate([np.asarray(one[name]) for one in tables])[:readings] for name in tables[0]}
    plan |= {name: plan[name].tolist() for name in ("direction", "setup")}
    return exercise.csv_text(case.make_case(SEED, "campaign", HIDDEN, plan=plan, size=HIDDEN_SIZE)[0])


def run(command: str, readings: int, file: Path, out: Path) -> Run:
    """One command in a process of its own; an update that the data do not support ends with 1."""
    words = [command, str(file), *COMMANDS[command], "--no-plots", "--json", "--out", str(out)]
    return Run(command, readings, *whole_command(words, allowed=(0, 1)))


def row(one: Run, first: Run) -> tuple[str, bool]:
    """A line of the table, and whether its bars are cleared."""
    bars = CPU_SECONDS | (UPDATE_SECONDS if one.command == "update" else {})
    ratio = one.seconds / first.seconds
    exponent = math.log(ratio) / math.log(one.readings / first.readings) if one is not first else float("nan")
    checks = [
        (one.seconds <= bars.get(one.readings, math.inf), f"{bars.get(one.readings, math.inf):g} s"),
        (one.megabytes <= MEGABYTES.get(one.readings, math.inf), f"{MEGABYTES.get(one.readings, math.inf):g} MB"),
        (one is first or exponent <= EXPONENT, f"n^{EXPONENT:g}"),
    ]
    said = [bar(cleared, text) for cleared, text in checks if not text.startswith("inf")]
    growth = "" if one is first else f"{exponent:.2f}"
    figures = f"{one.seconds:.1f} | {ratio:.1f} | {growth} | {one.megabytes:.0f}"
    line = f"| {one.command} | {one.readings:,} | {figures} | {', '.join(said)} |"
    return line, all(cleared for cleared, _ in checks)


def main() -> int:
    """Measure, print the table, write it beside this file; 1 where a bar is not cleared."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="readings of the largest campaign")
    parser.add_argument("--write", action="store_true", help=f"write {TABLE.name}")
    given = parser.parse_args()
    lines = [
        "# Cost of diagnosis over the readings",
        "",
        describe_machine(),
        "",
        "| command | readings | CPU, s | times the first | exponent from the first | memory, MB | bars |",
        "| --- | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    print("\n".join(lines), flush=True)
    passed, first = True, {}
    with tempfile.TemporaryDirectory() as folder:
        for readings in (n for n in SIZES if n <= given.largest):
            file = Path(folder) / f"{readings}.csv"
            file.write_text(campaign(readings), encoding="utf-8")
            for command in COMMANDS:
                one = run(command, readings, file, Path(folder) / f"{command}{readings}")
                line, cleared = row(one, first.setdefault(command, one))
                passed &= cleared
                lines.append(line)
                print(line, flush=True)
    if given.write:
        write_page(TABLE, "\n".join(lines))
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
