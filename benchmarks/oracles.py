"""`python -m benchmarks.oracles`: compliance of twelve serial machines by pinocchio, MuJoCo and OpenSees.

At a thousand poses drawn within the limits, in units of the compliances of the two directions (geometric mean). The
machines are the three serial ones of the reference, mills with heads and nutating axes, arms with an offset wrist, on a
rail and in front of a turning table, and invented arms.
"""

import argparse
import re
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks.pages import table, write_page
from tests.machine.oracles import ORACLES, apart, drawn, soft
from tests.machine.test_machine_kinds import DATA, KINDS
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.machine.serial import Serial
from toolpath_stiff.rig.robot import invented, machine_text

BAR = 1e-10
NAMES = ("robot200", "mill5", "mill3", "head", "table", "rail", "offset wrist")
TURNING = """
[[axis]]
name = "E1"
type = "rotary"
side = "work"
xyz_mm = [2000.0, 0.0, 300.0]
min_deg = -180
max_deg = 180
"""


def machines() -> dict[str, Serial]:
    """By name."""
    robot, mill = ((DATA / f"{name}.toml").read_text(encoding="utf-8") for name in ("robot200", "mill5"))
    nutating = mill.replace("xyzac", "xyzbc").replace("A_deg", "B_deg").replace("y_offset_mm", "x_offset_mm")
    with_table = re.sub(r"((?:torsion|bending)_nrad_per_Nm = \[[^\]]*)\]", r"\1, 300.0]", robot) + TURNING
    texts = {"table before an arm": with_table, "nutating": nutating.replace('"A"', '"B"')}
    texts |= {f"arm {seed}": machine_text(invented(np.random.default_rng(seed)), f"arm{seed}") for seed in (1, 2, 3)}
    made = {name: KINDS[name] for name in NAMES} | {name: parse_machine(text) for name, text in texts.items()}
    return {name: soft(machine) for name, machine in made.items() if isinstance(machine, Serial)}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; exit code 1 if a bar is not cleared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.oracles", description=__doc__)
    parser.add_argument("--poses", type=int, default=1000, help="of each machine (default: 1000)")
    parser.add_argument("--out", type=Path, help="markdown file to write")
    args = parser.parse_args(arguments)
    if missing := [name for name in ORACLES if find_spec(name.split(".")[0]) is None]:
        parser.error(f"{', '.join(missing)} not installed; pip install 'toolpath-stiff[test]' brings them")
    rows, worst = [], 0.0
    for name, machine in machines().items():
        joints = drawn(machine, np.random.default_rng(7), args.poses)
        differences = [apart(oracle, machine, joints) for oracle in ORACLES]
        worst = max(worst, *differences)
        rows.append((name, len(machine.joints), len(machine.elements), *(f"{value:.1e}" for value in differences)))
        print(*rows[-1], file=sys.stderr, flush=True)
    what = " ".join((__doc__ or "").split("\n\n", 1)[1].split())
    verdict = f"Largest difference {worst:.1e}, bar {BAR:g}: {'cleared' if worst < BAR else 'NOT CLEARED'}."
    heading = "machine | joints: | elements: | pinocchio: | MuJoCo: | OpenSees:"
    text = "\n".join(["# Compliance by other programs", "", what, "", verdict, "", *table(heading, rows), ""])
    print(text)
    if args.out:
        write_page(args.out, f"{text}\nMade by `python -m benchmarks.oracles --poses {args.poses}`.")
    return 0 if worst < BAR else 1


if __name__ == "__main__":
    sys.exit(main())
