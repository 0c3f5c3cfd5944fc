"""The commands on measurements: reduce, compare, diagnose, update, plan; rig, the blind exercises."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.api.correction import COSTS
from toolpath_stiff.cli.arguments import (
    add_condition_options,
    add_json_option,
    add_program_options,
    add_replace_option,
    add_unchecked_option,
    check_made,
    check_single,
    check_written,
    destination,
    finite_number,
    inputs_of,
    keep,
    loaded_machine,
    positive_number,
    program_for,
    progress_line,
    show,
    tell_kept,
    written_text,
)
from toolpath_stiff.defaults import MACHINE, STRUT_SPREAD
from toolpath_stiff.files import write_atomically
from toolpath_stiff.hints import Asked, hint
from toolpath_stiff.results_folder import Rules

if TYPE_CHECKING:
    from toolpath_stiff.api.diagnosis import Measurements
    from toolpath_stiff.api.machines import Machine

EPILOG = """\
examples:
  tps rig new --seed 7 --out blind                    measurements.csv, machine.toml, sealed.bin in blind/
  tps rig new --seed 8 --out two --layout paper --hidden two
  tps rig measure blind --at plan.csv --out more.csv  the same hidden machine again
  tps rig reveal blind --claim table_compliance       opens the seal and scores the claim

The rig shares no stiffness code with the model that it tests. The seal is a blindfold, not cryptography.
"""
FILES = ("measurements.csv", "machine.toml", "sealed.bin")  # of an exercise


def add_columns_option(parser: argparse.ArgumentParser) -> None:
    """--columns, of every command that reads measurements or raw records."""
    parser.add_argument(
        "--columns",
        metavar="MAPPING",
        help='columns that DATA call otherwise: "stiffness=stiff_mean:N/um, date=day:DD.MM.YYYY, setup==bare" '
        "(default: as FILE.columns.toml beside a file says)",
    )


def add_data_arguments(parser: argparse.ArgumentParser, nargs: str = "+", otherwise: str = "") -> None:
    """DATA, --machine and --effects."""
    parser.add_argument(
        "data",
        nargs=nargs,
        metavar="DATA",
        help="measurement files (CSV, or FILE.xlsx[#SHEET]), or nist-table1" + otherwise,
    )
    parser.add_argument(
        "--machine", default=MACHINE, metavar="NAME|FILE", help=f"machine name or file (default: {MACHINE})"
    )
    parser.add_argument(
        "--effects",
        action="append",
        default=[],
        metavar="FILE.py",
        help="file with your own physical effects, used as well",
    )
    add_unchecked_option(parser)
    add_columns_option(parser)


def add_noise_arguments(parser: argparse.ArgumentParser, guess: str = "a low and a high guess") -> None:
    """--noise and --strut-spread; `guess` is made where nothing is known."""
    group = parser.add_argument_group("noise")
    group.add_argument(
        "--noise", type=noise_argument, metavar="PERCENT[,PERCENT]",
        help="sd of one reading, re-clamping included; or of the reading alone and of a clamping "
        f"(default: from repeats, else from sd_N_per_mm, else {guess})",
    )  # fmt: skip
    group.add_argument(
        "--strut-spread", type=spread_argument, default=100.0 * STRUT_SPREAD, metavar="PERCENT",
        help="of the struts' stiffness (default: 1)",
    )  # fmt: skip


def add_output_arguments(
    parser: argparse.ArgumentParser, command: str, kept: str, *, force: bool = True, of: str = "DATA"
) -> None:
    """--seed, --out, --replace (--force), --no-plots, --json; `kept` is what --no-plots writes still.

    `of` is what the folder is named after.
    """
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of every random draw (default: 0)")
    parser.add_argument("--out", metavar="DIR", help=f"folder (default: reports/<{of}>-{command})")
    add_replace_option(parser, force=force)
    parser.add_argument("--no-plots", action="store_true", help=f"only {kept}")
    add_json_option(parser, f"print {command}.json to standard output and nothing else")


def measured(args: argparse.Namespace) -> tuple[Machine, Measurements]:
    """The machine with its effect files, and the measurements."""
    from toolpath_stiff.api.diagnosis import Measurements

    return loaded_machine(args), Measurements(args.data, args.columns)


def noise_options(args: argparse.Namespace) -> dict[str, Any]:
    """--noise, --strut-spread and --seed, as every function on measurements takes them."""
    return {"noise_percent": args.noise, "strut_spread_percent": args.strut_spread, "seed": args.seed}


def noise_argument(text: str) -> float | tuple[float, float]:
    """One or two percentages."""
    parts = [finite_number(part) for part in text.split(",")]
    if len(parts) > 2 or not all(0.0 <= part <= 50.0 for part in parts) or parts[0] <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected one or two percentages, more than 0 and at most 50")
    return parts[0] if len(parts) == 1 else (parts[0], parts[1])


def spread_argument(text: str) -> float:
    """A percentage from 0 to 50."""
    value = finite_number(text)
    if not 0.0 <= value <= 50.0:
        raise argparse.ArgumentTypeError(f"{text} %: expected 0 to 50 %")
    return value


# -- tps reduce -------------------------------------------------------------------------------------------------------

REDUCE_EPILOG = """\
columns of RAW:
  x_mm,y_mm,z_mm,direction     where and along what (X, Y, Z; or dx,dy,dz), optionally a_deg,b_deg,c_deg
  jog_um                       how far the machine was told to move from zero
  force_N,displacement_um      gauge and indicator, positive the way the jog counts
  date                         2024-03-31, 2024-03-31T14:05, 2024-03, 2024; each date is a loop of its own
  point,setup,clamp,repeat,loop,tool_extension_mm,time_min,temperature_C   optional, carried along
of a strut alone on a bench:   strut (1 to 6), date, force_N, displacement_um; length_mm, serial if known; no pose, no
                               jog; or strut, date, stiffness_N_per_mm of struts that were reduced elsewhere
Other names, units and forms of dates are said by a mapping, also kept as RAW.columns.toml (force = "Kraft:kN"):
  tps reduce RAW --columns "strut=hp, date=day_ms:ms, stiffness=stiff_mean:N/um"
  tps reduce RAW --columns "strut==3, date=Datum:DD.MM.YYYY, force=Kraft:kN, displacement=Weg:mm"

Records in the order taken, jogging 0, +200, -200, 0 um as ASME B5.54 and the paper do; those of one point, direction,
set-up, clamping and repeat are one loop. Its stiffness is the secant between the extremes (the paper's equation 12);
on a bench, force over displacement between the extremes of the force, tension and stretch positive. Struts measured
on several dates: which of them changed, and when.
"""


def reduce_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = REDUCE_EPILOG
    parser.add_argument("raw", nargs="+", metavar="RAW", help="raw records: files, FILE.xlsx[#SHEET], folders of files")
    add_columns_option(parser)
    parser.add_argument(
        "--compression-positive", action="store_true", help="forces of struts on a bench count compression positive"
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        help="measurement file to write (default: <first RAW>_measurements.csv); loops go beside it",
    )
    add_replace_option(parser)
    parser.add_argument("--no-plots", action="store_true", help="do not draw the loops")
    add_json_option(parser, "print the figures as JSON")


def reduce(args: argparse.Namespace) -> int:
    """Reduce, write, print."""
    from toolpath_stiff.readings.raw import reduce
    from toolpath_stiff.results import json_text
    from toolpath_stiff.workbooks import split_name

    found = reduce(*args.raw, columns=args.columns, compression_positive=args.compression_positive)
    first = Path(split_name(args.raw[0])[0])
    name = first.stem if first.is_file() else first.resolve().name
    out = Path(args.out or f"{name or 'raw'}_measurements.csv")
    files = found.files(out, plots=not args.no_plots)
    keep(check_made(args, files), quiet=args.json)
    written = [str(write_atomically(name, content)) for name, content in files.items()]
    for line in found.read_as:
        print(f"tps: {line}", file=sys.stderr)
    for note in found.notes:
        print(f"tps: note: {note}", file=sys.stderr)
    if args.json:
        sys.stdout.write(json_text({**found.to_dict(), "files": written}))
    else:
        print(f"{found}\n\nwrote {' and '.join(written)}")
    return 0


# -- tps compare ------------------------------------------------------------------------------------------------------

COMPARE_EPILOG = """\
examples:
  tps compare nist-table1
  tps compare measurements.csv --machine my_machine.toml
  tps compare first.csv second.csv --noise 2,1 --out reports/again

The machine file is compared as it stands; `tps diagnose` asks which effect it lacks. A finding is a pattern in the
residuals that fewer than 5 % of campaigns of mere scatter would show anywhere among all patterns looked for.
Files written to --out: compare.json, residuals.csv, report.html, measured_modelled.png, strips.png, planes.png,
machine.png, variables.png, load_path.png.
"""


def compare_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = COMPARE_EPILOG
    add_data_arguments(parser)
    add_noise_arguments(parser)
    add_output_arguments(parser, "compare", kept="compare.json and residuals.csv")


def compare(args: argparse.Namespace) -> int:
    """Compare, write, say where the model fails."""
    from toolpath_stiff.report.compare.page import names

    target = destination(args, "compare", args.data, "-compare").check(names(not args.no_plots))
    from toolpath_stiff.api.diagnosis import compare

    with progress_line(quiet=args.json) as progress:
        found = compare(*measured(args), **noise_options(args), progress=progress)
        return show(args, found, target)


# -- tps diagnose -----------------------------------------------------------------------------------------------------

DIAGNOSE_EPILOG = """\
examples:
  tps diagnose measurements.csv
  tps diagnose nist-table1 --noise 5
  tps diagnose first.csv second.csv --effects my_effect.py --out reports/again

The verdict: adequate (nothing is missing that these data could show), identified, described (by an effect whose form
was read off these very readings), ambiguous (several explain the data equally well), unexplained (something is missing
that no effect of the catalogue describes). Files written to --out:
diagnose.json, residuals.csv, ladder.png, portrait.png, confounding.png, detectable.png, before_after.png, envelope.png,
report.html.
"""


def diagnose_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = DIAGNOSE_EPILOG
    add_data_arguments(parser)
    add_noise_arguments(parser)
    group = parser.add_argument_group("how much the choice matters")
    group.add_argument(
        "--program", metavar="PROGRAM", help="NC program to try it on (default: the packaged case study)"
    )
    add_condition_options(group)
    add_program_options(parser, sampled=False)
    add_output_arguments(parser, "diagnose", kept="diagnose.json and residuals.csv")


def diagnose(args: argparse.Namespace) -> int:
    """Diagnose, write, say what was found. Any verdict is success."""
    from toolpath_stiff.report.diagnose.page import names

    target = destination(args, "diagnose", args.data, "-diagnose").check(names(not args.no_plots))
    from toolpath_stiff.api.diagnosis import diagnose

    machine, data = measured(args)
    with progress_line(quiet=args.json) as progress:
        found = diagnose(
            machine.under(args.setup, args.temperature),
            data,
            **noise_options(args),
            program=program_for(args, args.program) if args.program else None,
            origin_mm_deg=args.origin,
            progress=progress,
        )
        return show(args, found, target)


# -- tps update -------------------------------------------------------------------------------------------------------

UPDATE_EPILOG = """\
examples:
  tps update measurements.csv --add joint_compliance -o fitted.toml
  tps update measurements.csv --add weak_strut:strut=3 --keep-strut-law
  tps update measurements.csv --auto
  tps update nist-table1 --strut-law --objective mean-error     the paper's own estimation

An effect that the data do not support is refused, with the reason, unless --force is given; the exit code is 0 all the
same. Files written to --out: update.json, residuals.csv, machine.toml (unless refused or -o names another place),
ladder.png, before_after.png, report.html; with --objective mean-error also figure3.csv and figure3.png.
"""


def update_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = UPDATE_EPILOG
    add_data_arguments(parser)
    parser.add_argument(
        "--add", action="append", default=[], metavar="EFFECT[:KEY=VALUE,..]",
        help="effect to fit; what it acts on is searched for unless given (weak_strut:strut=3)",
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
        "--force",
        action="store_true",
        help="write what the data do not support as well, but never a machine that fits worse; and as --replace",
    )
    parser.add_argument(
        "--objective", choices=("likelihood", "mean-error"), default="likelihood",
        help="mean-error: the strut law alone, as the paper fitted it (default: likelihood)",
    )  # fmt: skip
    parser.add_argument("-o", "--output", metavar="MACHINE.toml", help="the new machine file (default: in --out)")
    add_noise_arguments(parser, guess="a high guess")
    add_output_arguments(parser, "update", kept="update.json, residuals.csv and the machine file", force=False)


def update(args: argparse.Namespace) -> int:
    """Fit, judge, write. Refusal is success as well."""
    from toolpath_stiff.report.update.page import MACHINE_FILE, names

    args.replace |= args.force
    replaced = check_single(args, args.output, mark=b"# Command: tps update")
    target = destination(args, "update", args.data, "-update")
    target.check(names(not args.no_plots, machine=args.output is None))
    from toolpath_stiff.api.correction import update

    with progress_line(quiet=args.json) as progress:
        found = update(
            *measured(args),
            add=args.add,
            strut_law=args.strut_law,
            keep_strut_law=args.keep_strut_law,
            auto=args.auto,
            force=args.force,
            objective=args.objective,
            machine_file=args.output or target.folder / MACHINE_FILE,
            **noise_options(args),
            progress=progress,
        )
        files = found.files(plots=not args.no_plots, machine=args.output is None)
    keep(replaced, quiet=args.json)
    machine_file = {args.output: found.machine_text()} if args.output and found.accepted else {}
    written = [*map(Path, machine_file), *target.write(files, machine_file)]
    if args.json:
        sys.stdout.write(found.to_json())
    else:
        print("\n".join([str(found), written_text(written), *(["", *found.next] if found.next else [])]))
    return 0


# -- tps plan ---------------------------------------------------------------------------------------------------------

PLAN_EPILOG = """\
examples:
  tps plan measurements.csv                       what would tell the plausible explanations apart
  tps plan measurements.csv --between frame_compliance,joint_moment_stiffness --n 4
  tps plan --next FOLDER [READINGS.csv]           at the machine: where to go after the readings of that plan so far
  tps plan --machine nist                         a good first campaign
  tps plan --machine nist --between spindle_compliance,table_compliance

Files written to --out: plan.csv (a measurement file with the stiffness left empty), plan.json, plan.png, and
plan_tables.npz, from which --next chooses within a second or two; --next writes next_1.csv (2, 3 ...) beside them.
"""


def plan_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = PLAN_EPILOG
    add_data_arguments(parser, nargs="*", otherwise="; none: a first campaign")
    parser.add_argument("--between", type=_names, metavar="A,B", help="tell these effects apart (or `none`)")
    parser.add_argument("--n", type=int, metavar="N", help="poses (default: 6, or 24 of a first campaign)")
    parser.add_argument(
        "--next", metavar="FOLDER",
        help="of a plan: the next pose after the readings so far (DATA; else its own files as filled in)",
    )  # fmt: skip
    group = parser.add_argument_group("what may vary")
    group.add_argument("--radius", type=positive_number("mm", 1e5), metavar="MM", help="about the axis (default: 300)")
    group.add_argument("--heights", type=_numbers, metavar="Z,Z,...", help="of the tool tip, mm (default: five levels)")
    group.add_argument("--max-tilt", type=_tilt, metavar="DEG", help="of the spindle (default: 25)")
    group.add_argument("--loads", type=_numbers, metavar="N,N,...", help="default: 500,1000,4000 and those of the data")
    group.add_argument(
        "--tools", type=_numbers, metavar="MM,MM,...",
        help="tools, longer than the reference tool by; the first is in the spindle (default: as last, and 150)",
    )  # fmt: skip
    group.add_argument(
        "--setups", type=_names, metavar="NAME,...", help="the first is on the table (default: those of the data)"
    )
    group.add_argument(
        "--indicators", action="store_true",
        help="a second indicator across a link of the load path where that tells more (column loop of plan.csv)",
    )  # fmt: skip
    group.add_argument(
        "--cost", action="append", default=[], type=_cost, metavar="WHAT=MINUTES",
        help="of a reading (default 1), a pose (15), another tool (10), another setup (45), a second indicator (10)",
    )  # fmt: skip
    add_noise_arguments(parser, guess="a high guess, or 2 %% without data")
    add_output_arguments(parser, "plan", kept="plan.csv and plan.json", of="DATA, else machine")


def _names(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(dict.fromkeys(finite_number(part) for part in text.split(",")))


def _tilt(text: str) -> float:
    value = finite_number(text)
    if not 0.0 <= value < 90.0:
        raise argparse.ArgumentTypeError(f"{text} degrees: expected 0 or more and less than 90")
    return value


def _cost(text: str) -> tuple[str, float]:
    name, _, minutes = text.partition("=")
    if name not in COSTS:
        raise argparse.ArgumentTypeError(f"{text!r}: expected {', '.join(COSTS)} and =MINUTES")
    value = finite_number(minutes)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected minutes, 0 or more")
    return name, value


def plan(args: argparse.Namespace) -> int:
    """Plan, write the files, say what the plan promises; or the next pose of a plan."""
    if args.next is not None:
        return _next(args)
    from toolpath_stiff.report.plan import names

    target = destination(args, "plan", args.data or [args.machine], "-plan").check(names(not args.no_plots))
    from toolpath_stiff.api.correction import plan

    machine, data = measured(args)
    found = plan(
        machine,
        data if args.data else None,
        between=args.between or (),
        n=args.n,
        radius_mm=args.radius,
        heights_mm=args.heights,
        max_tilt_deg=args.max_tilt,
        loads_N=args.loads,
        tool_extensions_mm=args.tools,
        setups=args.setups,
        indicators=args.indicators,
        minutes=dict(args.cost),
        **noise_options(args),
    )
    return show(args, found, target)


def _next(args: argparse.Namespace) -> int:
    """The next visit of a plan: say where, write its rows."""
    from toolpath_stiff.api.next_visits import next_visit

    found = next_visit(args.next, args.data, columns=args.columns)
    written = found.save()
    if args.json:
        sys.stdout.write(found.to_json())
    else:
        print("\n".join([str(found), *([written_text(written)] if written else [])]))
    return 0


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
    from toolpath_stiff.rig import exercise as exercises

    if args.action == "new":
        rules = Rules(inputs=tuple(inputs_of(args)), fresh=True, replace=args.replace, kept=tell_kept)
        count = exercises.new_exercise(
            args.out, args.seed, args.layout, args.hidden, args.noise / 100.0, args.machine, args.at, rules
        )
        print(f"{args.out}: {count} measurements, the nominal machine and the sealed truth")
        print(hint("next", _diagnose(args.out)))
        return 0
    if args.action == "measure":
        check_written(args, [args.out], (Path(args.folder) / name for name in FILES))
        text, count = exercises.measured_again(args.folder, args.at, args.visit)
        keep(check_made(args, {Path(args.out): text}))
        write_atomically(args.out, text)
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


# Command -> what declares its arguments, what runs it.
COMMANDS = {
    "reduce": (reduce_arguments, reduce),
    "compare": (compare_arguments, compare),
    "diagnose": (diagnose_arguments, diagnose),
    "update": (update_arguments, update),
    "plan": (plan_arguments, plan),
    "rig": (rig_arguments, rig),
}
