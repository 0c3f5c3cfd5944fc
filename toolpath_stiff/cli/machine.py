"""`tps machine`: list, show, check, make and import machine files; repeat the recovery of the NIST geometry."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.cli.arguments import pose_argument
from toolpath_stiff.cli.outputs import add_replace_option, check_new, check_written, keep
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, hint

if TYPE_CHECKING:
    pass

EPILOG = """\
examples:
  tps machine show nist --out hexapod.png           figures with their origin; the machine at the paper's pose
  tps machine new mine.toml                         a commented template to edit
  tps machine check mine.toml
  tps machine from-linuxcnc kinematics.hal -o mine.toml
  tps machine recover                               the NIST geometry from the paper's Table 1, fitted anew
"""
# The pose of the paper's Figure 2 is the one to show the paper's machine in.
FIGURE_2 = (-0.3, 0.3, 0.3, -0.5235987755982988, 0.0, 0.0)
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
    from toolpath_stiff.machine import load_machine, packaged_machines

    rows = [(name, load_machine(name)) for name in packaged_machines()]
    if args.json:
        found = [{"name": name, "title": machine.title, "source": machine.source} for name, machine in rows]
        json.dump(found, sys.stdout, indent=2)
        print()
        return 0
    for name, machine in rows:
        print(f"{name:<16} {machine.title}\n{'':<16} {machine.source}")
    return 0


def _show(args: argparse.Namespace) -> int:
    import numpy as np

    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.machine import load_machine, reach, solve_struts
    from toolpath_stiff.report.machine import figure_entries, machine_picture, text
    from toolpath_stiff.rotations import rotation_matrices

    machine = load_machine(args.machine)
    paper = FIGURE_2 if machine.name == "nist" else machine.default_origin
    pose = np.array(args.pose if args.pose is not None else paper)
    turn = rotation_matrices(pose[3:])
    struts = solve_struts(machine, pose[:3], turn)
    stand = reach(machine, pose[:3], struts, turn[None])
    if args.json:
        json.dump(figure_entries(machine), sys.stdout, indent=2)
        print()
    else:
        print(text(machine, stand))
    if args.out or not args.json:
        target = args.out or f"reports/{machine.name}.png"
        keep(check_written(args, [target]), quiet=args.json)
        write_atomically(target, machine_picture(machine, pose, struts))
        if not args.json:
            print(f"written:\n  {target}")
    return 0 if stand.reachable[0] else OUT_OF_REACH


def _check(args: argparse.Namespace) -> int:
    """Load the file, say what is wrong or doubtful, draw the machine at its neutral pose."""
    import numpy as np

    from toolpath_stiff.analysis.checks import check_machine
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.machine.kinematics import solve_struts_at
    from toolpath_stiff.report.machine import check_text, machine_views
    from toolpath_stiff.stiffness.model import build_model

    if not Path(args.file).is_file():
        new = command_line("machine", "new", args.file)
        raise InputError(f"cannot read machine file {args.file!r}", hint=f"`{new}` writes a template")
    machine = load_machine(Path(args.file))
    target = args.out or f"reports/{Path(args.file).stem}_machine.png"
    replaced = check_written(args, [target])
    model = build_model(machine, args.effects)
    found = check_machine(model)
    pose = np.array(machine.limits.neutral_pose)
    marked = tuple((stray.body, stray.joint) for stray in found.symmetry.strays)
    keep(replaced)
    write_atomically(target, machine_views(machine, pose, solve_struts_at(machine, pose), marked))
    print(check_text(args.file, model, found))
    print(f"written:\n  {target}")
    return 0 if found.good else NOT_GOOD


def _new(args: argparse.Namespace) -> int:
    from importlib import resources

    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.machine.writer import TEMPLATE_REMARK, toml_text

    target, replaced = Path(args.file), check_new(args, args.file)
    text = (resources.files("toolpath_stiff") / "data" / "templates" / "machine.toml.txt").read_text("utf-8")
    text = text.replace('"MACHINE_NAME"', toml_text(target.stem)).replace("MACHINE_FILE", target.name)
    keep(replaced)
    write_atomically(target, text.replace("REMARK", TEMPLATE_REMARK))
    print(f"written:\n  {target}\n{hint('edit it, then', command_line('machine', 'check', target))}")
    return 0


def _from_linuxcnc(args: argparse.Namespace) -> int:
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.machine import machine_toml
    from toolpath_stiff.machine.linuxcnc import machine_from_hal, units_of

    path = Path(args.file)
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"cannot read {args.file!r}: {error.strerror}") from None
    replaced = check_written(args, [args.out])
    units = args.units or units_of(path)
    if units is None:
        raise InputError(
            "the unit of the pins is not known (no ini file beside it that says LINEAR_UNITS)",
            hint="give it with --units mm or --units inch",
            file=args.file,
        )
    machine, notes = machine_from_hal(text, units, path.name)
    content = machine_toml(machine, f"Made from {path.name}, pins in {units}.\n" + "\n".join(notes))
    if args.out:
        keep(replaced)
        write_atomically(args.out, content)
        print(f"written:\n  {args.out}\n{hint('next', command_line('machine', 'check', args.out))}")
    else:
        sys.stdout.write(content)
    for note in notes:
        print(f"tps: note: {note}", file=sys.stderr)
    return 0


def _recover(args: argparse.Namespace) -> int:
    from toolpath_stiff.updating.correction.machines import recover_geometry, recovery_text

    if not 1 <= args.starts <= 1000:
        raise InputError(f"--starts {args.starts}", expected="1 to 1000")
    found = recover_geometry(starts=args.starts, seed=args.seed)
    if args.json:
        json.dump(found, sys.stdout, indent=2)
        print()
    else:
        print(recovery_text(found))
    return 0
