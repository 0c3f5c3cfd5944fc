"""`tps rig`: blind exercises on a simulated machine that hides an effect."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from toolpath_stiff.cli.arguments import add_json_option, add_replace_option, check_written, inputs_of, keep, tell_kept
from toolpath_stiff.hints import Asked, hint
from toolpath_stiff.results_folder import Rules

EPILOG = """\
examples:
  tps rig new --seed 7 --out blind                    measurements.csv, machine.toml, sealed.bin in blind/
  tps rig new --seed 8 --out two --layout paper --hidden two
  tps rig measure blind --at plan.csv --out more.csv  the same hidden machine again
  tps rig reveal blind --claim table_compliance       opens the seal and scores the claim

The rig shares no stiffness code with the model that it tests. The seal is a blindfold, not cryptography.
"""

FILES = ("measurements.csv", "machine.toml", "sealed.bin")  # of an exercise


def rig_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    actions = parser.add_subparsers(dest="action", metavar="new|measure|reveal", required=True)
    new = actions.add_parser("new", help="make a blind exercise")
    new.add_argument("--seed", type=int, required=True, metavar="N", help="seed of every random draw, 0 or more")
    new.add_argument("--out", required=True, metavar="DIR", help="folder to write to")
    new.add_argument(
        "--layout",
        default="tilted",
        choices=("paper", "tilted", "campaign"),
        help="paper: its 14 points along X, Y, Z; tilted: 24 tilted poses, two loads, two repeats (default); "
        "campaign: the rows of --at",
    )
    new.add_argument("--at", metavar="PLAN.csv", help="poses of layout campaign: measurement file without stiffness")
    new.add_argument(
        "--hidden",
        metavar="WHAT",
        help="none, one, two, three, outside, unknown, or NAME[,NAME]; default: drawn "
        "blindly from the seed, unknowns left out",
    )
    new.add_argument("--noise", type=float, default=2.0, metavar="PERCENT", help="repeat noise of a reading; default 2")
    add_replace_option(new)
    new.add_argument("--machine", default="nist", metavar="NAME|FILE", help="nominal machine (default: nist)")
    measuring = actions.add_parser("measure", help="measure the same hidden machine again")
    measuring.add_argument("folder", metavar="DIR", help="folder that `tps rig new` wrote")
    measuring.add_argument("--at", required=True, metavar="PLAN.csv", help="measurement file with the stiffness empty")
    measuring.add_argument("--out", required=True, metavar="FILE.csv", help="file to write")
    add_replace_option(measuring)
    measuring.add_argument(
        "--visit", type=int, default=1, metavar="N", help="another number draws clamping and noise anew (default 1)"
    )
    revealing = actions.add_parser("reveal", help="open the seal and score a claim")
    revealing.add_argument("folder", metavar="DIR", help="folder that `tps rig new` wrote")
    revealing.add_argument(
        "--claim", required=True, metavar="EFFECT[,EFFECT]", help="what is hidden; `none`, or `outside` the catalogue"
    )
    add_json_option(revealing, "print JSON")


def rig(args: argparse.Namespace) -> int:
    """Make, measure or reveal."""
    from toolpath_stiff import rig as exercises

    if args.action == "new":
        rules = Rules(inputs=tuple(inputs_of(args)), fresh=True, replace=args.replace, kept=tell_kept)
        count = exercises.new_exercise(
            args.out, args.seed, args.layout, args.hidden, args.noise / 100.0, args.machine, args.at, rules
        )
        print(f"{args.out}: {count} measurements, the nominal machine and the sealed truth")
        print(hint("next", _diagnose(args.out)))
        return 0
    if args.action == "measure":
        replaced = check_written(args, [args.out], (Path(args.folder) / name for name in FILES))
        keep(replaced)
        count = exercises.measure_again(args.folder, args.at, args.out, args.visit)
        print(f"{args.out}: {count} measurements")
        print(hint("next", _diagnose(args.folder, args.out)))
        return 0
    found = exercises.reveal(args.folder, args.claim)
    print(json.dumps(found, indent=2, ensure_ascii=False) if args.json else _wording(found))
    return 0


def _diagnose(folder: str, *more: str) -> str:
    """The diagnosis of an exercise, all measurements together."""
    place = Path(folder)
    files = dict.fromkeys((str(place / "measurements.csv"), *more))
    return Asked(tuple(files), str(place / "machine.toml")).command("diagnose")


def _wording(found: dict[str, Any]) -> str:
    """What was hidden, in lines."""
    lines = [f"claim {', '.join(found['claim'])}: {found['verdict']}"]
    if not found["effects"]:
        lines.append("nothing was hidden")
    for effect in found["effects"]:
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


COMMANDS = {"rig": (rig_arguments, rig)}
