"""`tps update`: fit effects to measurements, watch the error fall, write the machine that carries them."""

from __future__ import annotations

import argparse
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
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, hint, options

if TYPE_CHECKING:
    from toolpath_stiff.machine.model import Machine
    from toolpath_stiff.updating.correction.ladder import Update
    from toolpath_stiff.updating.correction.strut_law import BarCurve, StrutLawSearch
    from toolpath_stiff.updating.measurements import Measurements

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
    _check(args)
    args.replace |= args.force
    limit_threads(args.jobs)
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.machine import load_machine, machine_toml
    from toolpath_stiff.report.update import files, machine_heading, names, text
    from toolpath_stiff.updating.correction.document import document
    from toolpath_stiff.updating.measurements import read_measurements

    replaced = check_written(args, [args.output])
    target = destination(args, "update", args.data, "-update")
    target.check(names(not args.no_plots, machine=not args.output, figure3=args.objective == "mean-error"))
    machine = load_machine(args.machine)
    data = read_measurements(args.data, machine)
    update, search = _update(args, machine, data)
    provenance = _provenance(args, update)
    updated = update.fitted(provenance) if update.accepted else None
    machine_file = args.output or str(target.folder / MACHINE)
    found = document(
        update, updated, files=args.data, machine_file=machine_file if updated is not None else None,
        provenance=provenance, seed=args.seed,
    )  # fmt: skip
    found["next"] = _next(args, updated, machine_file)
    if search is not None:
        found["search"] = _search(search)
    bars = None if search is None else _bars(args, machine, data)
    if not args.no_plots:
        say("drawing")
    own = updated if args.output is None else None
    contents = files(update, found, machine=own, bars=bars, plots=not args.no_plots)
    say("")
    keep(replaced, quiet=args.json)
    written = []
    if updated is not None and args.output is not None:  # first: update.json names it
        written.append(write_atomically(Path(args.output), machine_toml(updated, machine_heading(found))))
    written += target.write(contents)
    if args.json:
        print(contents["update.json"], end="")
    else:
        print(text(found))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
        print("\n".join(["", *found["next"]]) if found["next"] else "", end="\n" if found["next"] else "")
    return 0


def _next(args: argparse.Namespace, updated: Machine | None, machine_file: str) -> list[str]:
    """Commands that use the new machine; an effect that belongs to a set-up acts only where that is named."""
    if updated is None:
        return []
    from toolpath_stiff.stiffness.model import build_model, setup_of

    model = build_model(updated, args.effects)
    setups = [name for active in model.effects if (name := setup_of(active))]
    found = [hint("what is left", asked(args).command("compare", machine=machine_file))]
    shown = options(machine=machine_file, effects=args.effects, setup=setups[0] if setups else None)
    also = " (analyze, place and pose take the same options)"
    return [*found, hint(f"the stiffness over the workspace{also}", command_line("map", *shown))]


def _check(args: argparse.Namespace) -> None:
    check_seed(args.seed)
    if args.objective == "mean-error" and (args.add or args.auto or not args.strut_law):
        raise InputError(
            "--objective mean-error is the paper's own estimation, of the strut law alone",
            expected="--strut-law, without --add and --auto",
            hint="effects are fitted by likelihood",
        )


def _update(args: argparse.Namespace, machine: Machine, data: Measurements) -> tuple[Update, StrutLawSearch | None]:
    if args.objective == "mean-error":
        from toolpath_stiff.updating.correction.strut_law import update_by_mean_error

        return update_by_mean_error(
            machine, data, noise=args.noise, strut_spread=args.strut_spread, seed=args.seed, progress=say,
            effect_files=args.effects,
        )  # fmt: skip
    from toolpath_stiff.updating.correction.ladder import parse_addition, update

    additions = [parse_addition(text, data, args.effects) for text in args.add]
    found = update(
        machine, data, additions, strut_law=args.strut_law, keep_law=args.keep_strut_law, auto=args.auto,
        force=args.force, noise=args.noise, strut_spread=args.strut_spread, effect_files=args.effects,
        seed=args.seed, progress=say,
    )  # fmt: skip
    return found, None


def _provenance(args: argparse.Namespace, update: Update) -> dict[str, Any]:
    """Where the fitted values come from. No date: the same data and command give the same bytes."""
    from toolpath_stiff.updating.correction.machines import data_hash

    return {
        "data": list(args.data),
        "data_sha256": data_hash(args.data),
        "readings": len(update.data),
        "command": _command(args),
        "noise": update.noise.origin,
        "mean_error_before_percent": round(100.0 * float(update.steps[0].fit.errors.mean()), 3),
        "mean_error_after_percent": round(100.0 * float(update.last.fit.errors.mean()), 3),
        "left_out_error_after_percent": round(100.0 * update.last.held.mean_error, 3),
    }


def _command(args: argparse.Namespace) -> str:
    """The command that repeats the fit; where its results go does not matter."""
    flags = {name: getattr(args, name) for name in ("strut_law", "keep_strut_law", "auto", "force")}
    objective = args.objective if args.objective != "likelihood" else None
    own = options(add=args.add, **flags, objective=objective, seed=args.seed or None)
    return asked(args).command("update", *own)


def _search(search: StrutLawSearch) -> dict[str, Any]:
    """Starts and ends of the paper's search, in N/um."""
    import numpy as np

    machine_law = np.array([search.strut_law.stiffness_1, search.strut_law.stiffness_2]) / np.exp(search.law) / 1e6
    return {
        "starts_N_per_um": np.round(machine_law * np.exp(search.starts), 3).tolist(),
        "ends_N_per_um": np.round(machine_law * np.exp(search.ends), 3).tolist(),
        "end_errors_percent": np.round(100.0 * search.end_errors, 4).tolist(),
        "agreeing": search.agreeing,
    }


def _bars(args: argparse.Namespace, machine: Machine, data: Measurements) -> BarCurve | None:
    """The paper's Figure 3; none where the machine's platform is not of rigid bars."""
    from toolpath_stiff.updating.correction.strut_law import bar_curve

    if any(entry.name == "platform_flexibility" for entry in machine.effects):
        return None
    say("the platform's bars, soft to rigid")
    return bar_curve(machine, data, seed=args.seed, starts=1)
