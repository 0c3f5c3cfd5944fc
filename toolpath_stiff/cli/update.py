"""`tps update`: fit effects to measurements, watch the error fall, write the machine that carries them."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import limit_threads
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    asked,
    check_seed,
)
from toolpath_stiff.cli.outputs import check_written, destination, keep
from toolpath_stiff.cli.progress import say
from toolpath_stiff.files import Content

if TYPE_CHECKING:
    from toolpath_stiff.updating.correction.ladder import Update
    from toolpath_stiff.updating.correction.strut_law import BarCurve

EPILOG = """\
examples:
  tps update measurements.csv --add joint_compliance -o fitted.toml
  tps update measurements.csv --add weak_strut:strut=3 --keep-strut-law
  tps update measurements.csv --auto
  tps update nist-table1 --strut-law --objective mean-error     the paper's own estimation

An effect that the data do not support is refused, with the reason, unless --force is given; the exit code is 0 all the
same. Files written to --out: update.json, residuals.csv, machine.toml (unless refused or -o names another place),
ladder.png, before_after.png, report.html; with --objective mean-error also figure3.csv and figure3.png.
"""

DATA, PICTURES = ("update.json", "residuals.csv"), ("ladder.png", "before_after.png", "report.html")
MACHINE = "machine.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add_data_arguments(parser)
    parser.add_argument(
        "--add", action="append", default=[], metavar="EFFECT[:KEY=VALUE,..]",
        help="effect to fit; what it acts on is searched unless it is said (weak_strut:strut=3)",
    )  # fmt: skip
    law = parser.add_mutually_exclusive_group()
    law.add_argument("--strut-law", action="store_true", help="write the refitted strut law even without an effect")
    law.add_argument(
        "--keep-strut-law", action="store_true",
        help="keep the strut law as given (default: its two stiffnesses are refitted along with every effect)",
    )  # fmt: skip
    parser.add_argument(
        "--auto",
        action="store_true",
        help="add effects as long as the error at left-out points falls and the data support it",
    )
    parser.add_argument(
        "--force", action="store_true", help="write what the data do not support as well; and as --replace"
    )
    parser.add_argument(
        "--objective", choices=("likelihood", "mean-error"), default="likelihood",
        help="mean-error: the strut law alone, as the paper fitted it (default: likelihood)",
    )  # fmt: skip
    parser.add_argument("-o", "--output", metavar="MACHINE.toml", help="the new machine file (default: in --out)")
    add_noise_arguments(parser, guess="a high guess")
    add_output_arguments(parser, "update", kept="update.json, residuals.csv and the machine file", force=False)


def run(args: argparse.Namespace) -> int:
    """Fit, judge, write. Refusal is success as well."""
    check_seed(args.seed)
    args.replace |= args.force
    replaced = check_written(args, [args.output])
    target = destination(args, "update", args.data, "-update")
    target.check((*DATA, *(() if args.output else (MACHINE,)), *(() if args.no_plots else PICTURES)))
    limit_threads(args.jobs)
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.machine import load_machine, machine_toml
    from toolpath_stiff.updating.correction import update
    from toolpath_stiff.updating.correction.document import document, residuals_csv
    from toolpath_stiff.updating.measurements import read_measurements

    machine = load_machine(args.machine)
    correction = update(
        machine, read_measurements(args.data, machine), args.add, strut_law=args.strut_law,
        keep_strut_law=args.keep_strut_law, auto=args.auto, force=args.force, objective=args.objective,
        noise=args.noise, strut_spread=args.strut_spread, effect_files=args.effects, seed=args.seed, files=args.data,
        machine_file=args.output or str(target.folder / MACHINE), asked=asked(args), progress=say,
    )  # fmt: skip
    updated = correction.machine
    found = document(correction)
    contents: dict[str, Content] = {
        "update.json": json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        "residuals.csv": residuals_csv(correction.update),
    }
    if updated is not None and args.output is None:
        contents[MACHINE] = machine_toml(updated, _preamble(found))
    if correction.bars is not None:
        contents |= _figure3(correction.bars, args.no_plots)
    if not args.no_plots:
        say("drawing")
        contents |= _pictures(found, correction.update, contents.get("figure3.png"))
    say("")
    keep(replaced, quiet=args.json)
    written = []
    if updated is not None and args.output is not None:  # first: update.json names it
        written.append(write_atomically(Path(args.output), machine_toml(updated, _preamble(found))))
    written += target.write(contents)
    if args.json:
        print(contents["update.json"], end="")
    else:
        from toolpath_stiff.report.update_text import terminal_text

        print(terminal_text(found))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
        print("\n".join(["", *found["next"]]) if found["next"] else "", end="\n" if found["next"] else "")
    return 0


def _preamble(found: dict[str, Any]) -> str:
    from textwrap import fill

    provenance = found["provenance"]
    return "\n".join(
        [
            fill(f"Machine {found['machine']}, updated. {found['text']}", 110),
            f"Command: {provenance['command']}",
            f"SHA-256 of the data: {provenance['data_sha256']}",
            "",
        ]
    )


def _figure3(curve: BarCurve, no_plots: bool) -> dict[str, Content]:
    """The paper's Figure 3 as data and, unless pictures are off, drawn."""
    from toolpath_stiff.updating.correction.strut_law import bar_curve_csv

    found: dict[str, Content] = {"figure3.csv": bar_curve_csv(curve)}
    if not no_plots:
        from toolpath_stiff.report.figure3_picture import figure3_png

        found["figure3.png"] = figure3_png(
            curve.bars[:-1], 100.0 * curve.error[:-1], refitted_percent=100.0 * curve.error_refitted[:-1]
        )
    return found


def _pictures(found: dict[str, Any], update: Update, figure3: Content | None) -> dict[str, Content]:
    from toolpath_stiff.report.update_page import update_html
    from toolpath_stiff.report.update_pictures import before_after_png, error_ladder_png

    last = found["steps"][-1]
    called = f"with {' + '.join(last['effects'])}" if last["effects"] else last["name"]
    entry = {"effect": called, "held_out_error_percent": last["held_out_error_percent"]}
    drawn = before_after_png(
        {"verdict": found["verdict"], "baseline": found["strut_law_refitted"], "candidates": [entry], "best": called},
        update.data, update.steps[0].fit.residual, update.steps[-1].fit.residual, names=("as given", called),
    )  # fmt: skip
    pictures = {
        "ladder.png": error_ladder_png(
            [_rung(step) for step in found["steps"]],
            found["noise_floor_percent"],
            "What does each step do to the error?",
            [{**one, "name": one["effect"]} for one in found["turned_down"]],
        ),
        "before_after.png": drawn,
    }
    shown = {**pictures, "figure3.png": figure3} if isinstance(figure3, bytes) else pictures
    return {**pictures, "report.html": update_html(found, shown)}


def _rung(step: dict[str, Any]) -> dict[str, Any]:
    """A step with what its effect acts on below the effect's name."""
    import re

    choices = re.findall(r"\(([^)]*)\)", step["name"])
    return {**step, "name": re.sub(r" \([^)]*\)", "", step["name"]), "remark": ", ".join(choices)}
