"""The command on blind exercises."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from toolpath_stiff.cli.outputs import inputs_of, show, tell_kept, write_made
from toolpath_stiff.cli.parser import JSON, REPLACE, Command, own
from toolpath_stiff.hints import Asked, hint
from toolpath_stiff.results_folder import Rules

FILES = ("measurements.csv", "machine.toml", "sealed.bin")  # of an exercise
EXAMPLES = """\
examples:
  tps rig new --seed 7 --out blind                    measurements.csv, machine.toml, sealed.bin in blind/
  tps rig new --seed 8 --out two --layout paper --hidden two
  tps rig measure blind --at plan.csv --out more.csv  the same hidden machine again
  tps rig reveal blind --claim table_compliance       opens the seal and scores the claim

The rig shares no stiffness code with the model that it tests. The seal is a blindfold, not cryptography.
"""


def new(args: Namespace) -> int:
    """Make a blind exercise."""
    from toolpath_stiff.rig.exercise import blind_case, new_exercise

    rules = Rules(inputs=tuple(inputs_of(args)), fresh=True, replace=args.replace, kept=tell_kept)
    case = blind_case(args.seed, args.layout, args.hidden, args.noise / 100.0, args.machine, args.at)
    count = new_exercise(args.out, case, rules)
    print(f"{args.out}: {count} measurements, the nominal machine and the sealed truth")
    print(hint("next", _diagnose(args.out)))
    return 0


def measure(args: Namespace) -> int:
    """Measure the same hidden machine again."""
    from toolpath_stiff.rig.exercise import measured_again

    text, count = measured_again(args.folder, args.at, args.visit)
    write_made(args, {Path(args.out): text}, (Path(args.folder) / name for name in FILES))
    print(f"{args.out}: {count} measurements")
    print(hint("next", _diagnose(args.folder, args.out)))
    return 0


def reveal_truth(args: Namespace) -> int:
    """Open the seal and score a claim."""
    from toolpath_stiff.rig.exercise import reveal

    truth = reveal(args.folder, args.claim)
    return show(args, _wording(truth), document=lambda: truth)


def _diagnose(folder: str, *more: str) -> str:
    """The diagnosis of an exercise, all measurements together."""
    place = Path(folder)
    files = dict.fromkeys((str(place / "measurements.csv"), *more))
    return Asked(tuple(files), str(place / "machine.toml")).command("diagnose")


def _wording(truth: dict[str, Any]) -> str:
    """What was hidden, in lines."""
    lines = [f"claim {', '.join(truth['claim'])}: {truth['verdict']}"]
    if not truth["effects"]:
        lines.append("nothing was hidden")
    for effect in truth["effects"]:
        values = ", ".join(
            f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in effect["parameters"].items()
        )
        lines.append(
            f"hidden: {effect['effect']} ({values}); changes the readings by {100 * effect['size']:.1f} % (rms)"
        )
        if "links" in effect:
            lines.append(f"it is in: {' or '.join(effect['links'])}; varies with: {' or '.join(effect['variables'])}")
    return "\n".join(lines)


FOLDER = own("DIR", "folder that `tps rig new` wrote", name="folder")
COMMANDS = {
    "rig new": Command(
        new,
        own("--seed N", "of every random draw, 0 or more", kind=int, required=True),
        own("--out DIR", "folder to write to", required=True),
        own(
            "--layout",
            "paper: its 14 points along X, Y, Z; tilted: 24 tilted poses, two loads, two repeats; campaign: the rows "
            "of --at",
            kind=str,
            choices=("paper", "tilted", "campaign"),
            default="tilted",
        ),
        own("--at PLAN.csv", "poses of layout campaign: measurement file without stiffness"),
        own(
            "--hidden WHAT",
            "none, one, two, three, outside, unknown, or NAME[,NAME]; default: drawn blindly from the seed, unknowns "
            "left out",
        ),
        own("--noise %", "repeat noise of a reading", kind=float, default=2.0),
        own("--machine NAME|FILE", "nominal machine", default="nist"),
        REPLACE,
    ),
    "rig measure": Command(
        measure,
        FOLDER,
        own("--at PLAN.csv", "measurement file with the stiffness empty", required=True),
        own("--out FILE.csv", "file to write", required=True),
        own("--visit N", "another number draws clamping and noise anew", kind=int, default=1),
        REPLACE,
    ),
    "rig reveal": Command(
        reveal_truth,
        FOLDER,
        own("--claim EFFECT[,EFFECT]", "what is hidden; `none`, or `outside` the catalogue", required=True),
        JSON,
    ),
}
