"""`python -m benchmarks.diagnosis_size`: what a diagnosis costs over the readings, in CPU time and memory.

Campaigns of the rig in its tilted layout: each pose loaded along X, Y and Z at two loads, clamped twice. Every command
runs as its user runs it, in a process of its own and on one core. Bars: 288 readings within 3 s of CPU (`update`: 2 s),
1,000 within 20 s, 5,000 within 120 s and 2 GB; from 288 on the cost grows at most as n^1.5; 10,000 readings end with a
verdict.
"""

import argparse
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.pages import bar, table, write_page
from benchmarks.processes import describe_machine, whole_command
from toolpath_stiff.rig import case, exercise

SIZES = (288, 1000, 5000, 10_000)
COMMANDS = {"diagnose": (), "compare": (), "update": ("--add", "weak_strut")}
SECONDS = {288: 3.0, 1000: 20.0, 5000: 120.0}
UPDATE_SECONDS = {288: 2.0}
MEGABYTES = {5000: 2000.0}
EXPONENT = 1.5
SEED, HIDDEN, HIDDEN_SIZE = 3, "weak_strut", 0.06
TABLE = Path(__file__).parent / "diagnosis_size.md"


def campaign(readings: int) -> str:
    """A measurement file of so many readings of one machine."""
    tables, poses = [], 0
    for seed in range(1000, 1000 + readings // 288 + 1):
        rows, _ = case.make_case(seed, hidden="none")
        rows["clamp"] = np.asarray(rows["clamp"]) + 2 * poses
        rows["point"] = np.asarray(rows["point"]) + poses
        poses += len(set(np.asarray(rows["point"]).tolist()))
        tables.append({name: column for name, column in rows.items() if name != "stiffness_N_per_mm"})
    plan = {name: np.concatenate([np.asarray(part[name]) for part in tables])[:readings] for name in tables[0]}
    plan |= {name: plan[name].tolist() for name in ("direction", "setup")}
    return exercise.csv_text(case.make_case(SEED, "campaign", HIDDEN, plan=plan, size=HIDDEN_SIZE)[0])


def main() -> int:
    """Measure, print the table, write it beside this file; 1 where a bar is not cleared."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="readings of the largest campaign")
    parser.add_argument("--write", action="store_true", help=f"write {TABLE.name}")
    given = parser.parse_args()
    rows, passed, first = [], True, dict[str, float]()
    for readings in (n for n in SIZES if n <= given.largest):
        for command, more in COMMANDS.items():
            with tempfile.TemporaryDirectory() as folder:
                (Path(folder) / "data.csv").write_text(campaign(readings), encoding="utf-8")
                words = [command, "data.csv", *more, "--no-plots", "--json", "--out", "out"]
                # An update that the data do not support ends with 1.
                seconds, megabytes = whole_command(words, folder, allowed=(0, 1))
            ratio = seconds / first.setdefault(command, seconds)
            exponent = math.log(ratio) / math.log(readings / SIZES[0]) if readings > SIZES[0] else 0.0
            most = (SECONDS | (UPDATE_SECONDS if command == "update" else {})).get(readings, math.inf)
            memory = MEGABYTES.get(readings, math.inf)
            checks = {f"{most:g} s": seconds <= most, f"{memory:g} MB": megabytes <= memory}
            checks |= {f"n^{EXPONENT:g}": exponent <= EXPONENT}
            passed &= all(checks.values())
            bars = ", ".join(bar(clears, text) for text, clears in checks.items() if not text.startswith("inf"))
            rows.append((command, f"{readings:,}", f"{seconds:.1f}", f"{exponent:.2f}", f"{megabytes:.0f}", bars))
            print(*rows[-1], sep=" | ", flush=True)
    heading = "command | readings: | CPU, s: | exponent from the first: | memory, MB: | bars"
    text = "\n".join(["# Cost of diagnosis over the readings", "", describe_machine(), "", *table(heading, rows)])
    print(text)
    if given.write:
        write_page(TABLE, text)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
