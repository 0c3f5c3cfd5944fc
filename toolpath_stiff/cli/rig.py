"""Blind exercises: a simulated machine that hides an effect.

for example:
  tps rig new --seed 7 --out blind                    measurements.csv, machine.toml, sealed.bin in blind/
  tps rig new --seed 8 --out two --layout paper --hidden two
  tps rig measure blind --at plan.csv --out more.csv  the same hidden machine again
  tps rig reveal blind --claim table_compliance       opens the seal and scores the claim

The rig shares no stiffness code with the model that it tests. The seal is a blindfold, not cryptography.
"""

from argparse import Namespace
from pathlib import Path
from typing import Annotated

from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import JSON, REPLACE, command
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, hint
from toolpath_stiff.options import Option
from toolpath_stiff.rig.campaigns import LAYOUTS
from toolpath_stiff.rig.case import draw_case
from toolpath_stiff.rig.exercise import FILES, measured_again, new_exercise, new_robot, read_plan, reveal
from toolpath_stiff.rig.nominal import load_nominal

Exercise = Annotated[str, Option("DIR", help="folder that `tps rig new` wrote")]


@command("rig new", REPLACE)
def new(
    args: Namespace,
    seed: Annotated[int, Option("--seed")],
    out: Annotated[str, Option("--out", "DIR")],
    layout: Annotated[str, Option("--layout", choices=LAYOUTS)] = "tilted",
    at: Annotated[str | None, Option("--at", "PLAN.csv")] = None,
    hidden: Annotated[str | None, Option("--hidden", "WHAT")] = None,
    noise: Annotated[float, Option("--noise", "%")] = 2.0,
    machine: Annotated[str, Option("--machine", "NAME|FILE")] = "nist",
    built: Annotated[str, Option("--built", choices=("springs", "fem", "serial"))] = "springs",
) -> int:
    """Make a blind exercise.

    Parameters
    ----------
    seed
        Seed of all random draws, 0 or more.
    out
        Folder to write to.
    layout
        paper: the 14 points of the paper along X, Y, Z; tilted: 24 tilted poses, two loads, two repeats; campaign: the
        rows of --at.
    at
        Poses of layout campaign: measurement file without stiffness.
    hidden
        What to hide: none, one, two, three, outside, unknown, or NAME[,NAME]; default: drawn blindly from the seed,
        without unknowns.
    noise
        Repeat noise of a reading.
    machine
        Nominal machine.
    built
        How the hidden machine is built: springs and bars, or finite elements (whose faults have other names); serial:
        an invented robot of six joints, pulled along X, Y and Z.
    """
    if built == "serial":
        if at or layout != "tilted" or machine != "nist":
            raise InputError("--built serial with a layout, a plan or a machine", expected="--seed, --hidden, --noise")
        written = f"{new_robot(out, seed, hidden, noise / 100.0, run.rules_of(args, fresh=True))} pulls"
    else:
        nominal = load_nominal(machine)
        plan = None if at is None else read_plan(at, nominal)
        case = draw_case(seed, layout, hidden, noise / 100.0, nominal, plan, built=built)
        written = f"{new_exercise(out, case, run.rules_of(args, fresh=True))} measurements"
    print(f"{out}: {written}, the nominal machine and the sealed truth", _diagnose(out), sep="\n")
    return 0


@command("rig measure", REPLACE)
def measure(
    args: Namespace,
    folder: Exercise,
    at: Annotated[str, Option("--at", "PLAN.csv")],
    out: Annotated[str, Option("--out", "FILE.csv")],
    visit: Annotated[int, Option("--visit")] = 1,
) -> int:
    """Measure the same hidden machine again.

    Parameters
    ----------
    at
        Measurement file with the stiffness empty.
    out
        File to write.
    visit
        Number of the visit; another one draws clamping and noise again.
    """
    text, count = measured_again(folder, at, visit)
    run.write_single(args, {Path(out): text}, *(Path(folder) / name for name in FILES))
    print(f"{out}: {count} measurements", _diagnose(folder, out), sep="\n")
    return 0


@command("rig reveal", JSON)
def reveal_truth(args: Namespace, folder: Exercise, claim: Annotated[str, Option("--claim", "EFFECT[,EFFECT]")]) -> int:
    """Open the seal and score a claim.

    Parameters
    ----------
    claim
        What is hidden; `none`, or `outside` the catalogue.
    """
    truth = reveal(folder, claim)
    return run.show(args, _wording(truth), document=lambda: truth)


def _diagnose(folder: str, *more: str) -> str:
    """Hint with the command that diagnoses an exercise from all its measurements."""
    files = dict.fromkeys((str(Path(folder, "measurements.csv")), *more))
    return hint("next", Asked(tuple(files), str(Path(folder, "machine.toml"))).command("diagnose"))


def _wording(truth: Document) -> str:
    """Lines of text on the hidden effects."""
    lines = [f"claim {', '.join(truth['claim'])}: {truth['verdict']}"]
    for effect in truth["effects"]:
        values = (f"{value:.4g}" if isinstance(value, float) else value for value in effect["parameters"].values())
        sizes = ", ".join(f"{key} {value}" for key, value in zip(effect["parameters"], values, strict=True))
        change = f"changes the readings by {100 * effect['size']:.1f} % (rms)"
        lines.append(f"hidden: {effect['effect']} ({sizes}); {change}")
        if "links" in effect:
            varies = f"; varies with: {' or '.join(effect['variables'])}" if "variables" in effect else ""
            lines.append(f"it is in: {' or '.join(effect['links'])}{varies}")
    return "\n".join(lines if truth["effects"] else [*lines, "nothing was hidden"])
