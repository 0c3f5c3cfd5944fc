"""`tps machine`: list, show, check, make and import machine files; repeat the recovery of the NIST geometry."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from toolpath_stiff.cli.arguments import pose_argument
from toolpath_stiff.cli.outputs import add_replace_option, check_new, check_written, keep, written_text
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, hint

EPILOG = """\
examples:
  tps machine show nist --out hexapod.png           figures with their origin; the machine at the paper's pose
  tps machine new mine.toml                         a commented template to edit
  tps machine check mine.toml
  tps machine from-linuxcnc kinematics.hal -o mine.toml
  tps machine recover                               the NIST geometry from the paper's Table 1, fitted anew
"""
OUT_OF_REACH = NOT_GOOD = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of every action."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = actions.add_parser("list", help="packaged machines")
    listing.add_argument("--json", action="store_true", help="print JSON")
    show = actions.add_parser("show", help="figures of a machine with their origin, and a picture of it")
    show.add_argument("machine", metavar="NAME|FILE", nargs="?", default="nist")
    show.add_argument("--pose", type=pose_argument, metavar="X,Y,Z[,A,B,C]", help="pose of the picture, mm and degrees")
    show.add_argument("--out", metavar="FILE.png", help="the picture (default: reports/<name>.png)")
    add_replace_option(show)
    show.add_argument("--json", action="store_true", help="print JSON, draw nothing unless --out is given")
    check = actions.add_parser(
        "check", help="check a machine file for slips, draw it; exit code 1 if it cannot be right"
    )
    check.add_argument("file", metavar="FILE")
    check.add_argument(
        "--effects", action="append", default=[], metavar="FILE.py", help="your own physical effects that it names"
    )
    check.add_argument("--out", metavar="FILE.png", help="the picture (default: reports/<file>_machine.png)")
    add_replace_option(check)
    new = actions.add_parser("new", help="write a commented template")
    new.add_argument("file", metavar="FILE")
    add_replace_option(new)
    hal = actions.add_parser("from-linuxcnc", help="read the genhexkins pins of a LinuxCNC HAL file")
    hal.add_argument("file", metavar="FILE.hal")
    hal.add_argument("-o", "--out", metavar="FILE", help="machine file to write (default: standard output)")
    add_replace_option(hal)
    hal.add_argument(
        "--units", choices=("mm", "inch"), help="unit of the pins (default: LINEAR_UNITS of the ini beside)"
    )
    recover = actions.add_parser("recover", help="fit the NIST geometry to the paper's Table 1 anew")
    recover.add_argument("--starts", type=int, default=20, metavar="N", help="scattered starting points (default: 20)")
    recover.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the starting points (default: 1)")
    recover.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Do the chosen action."""
    action = {
        "list": _list,
        "show": _show,
        "check": _check,
        "new": _new,
        "from-linuxcnc": _from_linuxcnc,
        "recover": _recover,
    }[args.action]
    return action(args)


def _list(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.inputs import Machine
    from toolpath_stiff.api.results import json_text

    machines = [Machine.load(name) for name in Machine.names()]
    if args.json:
        sys.stdout.write(json_text([{"name": m.asked, "title": m.title, "source": m.source} for m in machines]))
    else:
        print("\n".join(f"{m.asked:<16} {m.title}\n{'':<16} {m.source}" for m in machines))
    return 0


def _show(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.inputs import Machine
    from toolpath_stiff.api.results import json_text
    from toolpath_stiff.files import write_atomically

    machine = Machine.load(args.machine)
    if args.json:
        sys.stdout.write(json_text(machine.to_frame().to_dict("records")))
    else:
        print(machine.text(args.pose))
    if args.out or not args.json:
        target = args.out or f"reports/{machine.name}.png"
        keep(check_written(args, [target]), quiet=args.json)
        written = write_atomically(target, machine.picture(args.pose))
        if not args.json:
            print(written_text([written]))
    return 0 if machine.standing(args.pose)[2].reachable[0] else OUT_OF_REACH


def _check(args: argparse.Namespace) -> int:
    """Load the file, say what is wrong or doubtful, draw the machine at its neutral pose."""
    from toolpath_stiff.api.inputs import Machine
    from toolpath_stiff.files import write_atomically

    if not Path(args.file).is_file():
        new = command_line("machine", "new", args.file)
        raise InputError(f"cannot read machine file {args.file!r}", hint=f"`{new}` writes a template")
    target = args.out or f"reports/{Path(args.file).stem}_machine.png"
    replaced = check_written(args, [target])
    found = Machine.load(Path(args.file), effects=args.effects).check()
    keep(replaced)
    print(f"{found}\n{written_text([write_atomically(target, found.picture())])}")
    return 0 if found.good else NOT_GOOD


def _new(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.machines import machine_template

    target, replaced = Path(args.file), check_new(args, args.file)
    keep(replaced)
    written = machine_template(target).save(target)
    print(f"{written_text([written])}\n{hint('edit it, then', command_line('machine', 'check', target))}")
    return 0


def _from_linuxcnc(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.machines import machine_from_linuxcnc

    replaced = check_written(args, [args.out])
    found = machine_from_linuxcnc(args.file, args.units)
    if args.out:
        keep(replaced)
        print(written_text([found.save(args.out)]))
        print(hint("next", command_line("machine", "check", args.out)))
    else:
        sys.stdout.write(str(found))
    for note in found.notes:
        print(f"tps: note: {note}", file=sys.stderr)
    return 0


def _recover(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.machines import recover_geometry

    found = recover_geometry(starts=args.starts, seed=args.seed)
    sys.stdout.write(found.to_json() if args.json else f"{found}\n")
    return 0
