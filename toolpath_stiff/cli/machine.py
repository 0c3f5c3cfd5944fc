"""The commands on a machine: pose, map, machine, effects; studio, a case of it in the browser."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from toolpath_stiff.cli.arguments import (
    add_json_option,
    add_machine_options,
    add_reading_options,
    add_replace_option,
    add_unchecked_option,
    case_reading,
    check_made,
    check_new,
    check_single,
    check_written,
    destination,
    finite_number,
    keep,
    load_argument,
    machine_for,
    pose_argument,
    progress_line,
    range_argument,
    show,
    written_text,
)
from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, hint, options

# -- tps pose ---------------------------------------------------------------------------------------------------------

POSE_OUT_OF_REACH, MOST_NAMED = 1, 10
POSE_EPILOG = """\
examples:
  tps pose -300 300 300 -30 0 0
  tps pose --csv poses.csv > stiffness.csv

Angles are roll A, pitch B, yaw C in degrees, R = Rz(C) Ry(B) Rx(A); the position is the tool tip in mm, machine
coordinates. --csv reads columns x_mm,y_mm,z_mm and, if there, a_deg,b_deg,c_deg; it writes one row a pose in the
same order, with empty cells where a pose is out of reach (exit code 1).
"""
EPILOG = """\
examples:
  tps studio                                          a new case, in tps-case/
  tps studio measured.csv --machine mine.toml --program part.nc --case mill-3
  tps studio --case mill-3                            goes on where it was left
  tps studio --program part.nc --tools my.tbl         a program with tool lengths (G43)

It serves 127.0.0.1 alone; the address holds a token. Ctrl-C ends it, nothing is lost.
"""


def pose_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = POSE_EPILOG
    parser.add_argument(
        "pose", nargs="*", type=finite_number, metavar="X Y Z [A B C]", help="tool tip in mm, angles in degrees"
    )
    parser.add_argument(
        "--csv",
        metavar="FILE",
        help="read poses from a table (CSV, or FILE.xlsx[#SHEET]), write CSV to standard output",
    )
    add_machine_options(parser)
    add_json_option(parser, "print JSON instead of a table")


def pose(args: argparse.Namespace) -> int:
    """Evaluate and print."""
    from toolpath_stiff.api.poses import pose, read_poses

    if (args.csv is None) == (not args.pose):
        raise InputError(
            "give either a pose or --csv FILE" if args.csv is None else "give a pose or --csv FILE, not both",
            expected="tps pose X Y Z [A B C], or tps pose --csv FILE",
        )
    machine = machine_for(args)
    if args.csv is None:
        found = pose(machine, args.pose, force_N=args.force)
        sys.stdout.write(found.to_json() if args.json else f"{found}\n")
        return 0
    poses, notes = read_poses(args.csv)
    for note in notes:
        print(f"tps: note: {note}", file=sys.stderr)
    found = pose(machine, poses, force_N=args.force)
    sys.stdout.write(found.to_json() if args.json else found.csv())
    for warning in (*found.warnings, *found.out_of_reach(MOST_NAMED)):
        print(f"tps: warning: {warning}", file=sys.stderr)
    return 0 if found.reachable.all() else POSE_OUT_OF_REACH


# -- tps map ----------------------------------------------------------------------------------------------------------

MAP_EPILOG = """\
examples:
  tps map --z 1200 --x -150:150 --y -150:150 --load radial     the paper's Figure 8
  tps map --z 1200 --load z                                    its Figure 9
  tps map --slices 400,800,1200 --x -400:400 --y -400:400 --tilt 15,0,0

files written to --out: map.csv (x_mm,y_mm,z_mm,stiffness_N_per_mm,reachable), map.json, map.png, map.html (3-D)
"""


def map_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = MAP_EPILOG
    heights = parser.add_mutually_exclusive_group()
    heights.add_argument("--z", type=finite_number, default=1200.0, metavar="MM", help="height (default: 1200)")
    heights.add_argument("--slices", type=_heights, metavar="Z,Z,...", help="several heights, mm")
    parser.add_argument(
        "--x", type=range_argument, default=(-150.0, 150.0), metavar="LO:HI", help="mm (default: -150:150)"
    )
    parser.add_argument(
        "--y", type=range_argument, default=(-150.0, 150.0), metavar="LO:HI", help="mm (default: -150:150)"
    )
    parser.add_argument("--points", type=int, default=61, metavar="N", help="grid points along a side (default: 61)")
    parser.add_argument(
        "--load", type=load_argument, default="radial", metavar="DIRECTION",
        help="radial, axial, softest, x, y, z or DX,DY,DZ (default: radial)",
    )  # fmt: skip
    parser.add_argument(
        "--tilt", type=_angles, default=(0.0, 0.0, 0.0), metavar="A,B,C", help="roll, pitch, yaw, degrees"
    )
    parser.add_argument("--out", metavar="DIR", help="folder (default: reports/<machine>-map)")
    add_replace_option(parser, force=False)
    parser.add_argument("--no-plots", action="store_true", help="only map.csv and map.json")
    add_machine_options(parser)
    add_json_option(parser, "print map.json to standard output and nothing else")


def _heights(text: str) -> list[float]:
    values = [finite_number(part) for part in text.split(",")]
    if len(set(values)) < len(values):
        raise argparse.ArgumentTypeError(f"{text!r}: a height appears twice")
    return sorted(values)


def _angles(text: str) -> tuple[float, float, float]:
    values = [finite_number(part) for part in text.split(",")]
    if len(values) != 3 or max(abs(v) for v in values) > 180.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected A,B,C in degrees, within +-180")
    return (values[0], values[1], values[2])


def map(args: argparse.Namespace) -> int:
    """Evaluate the grid and write the files."""
    from toolpath_stiff.api.poses import map_stiffness
    from toolpath_stiff.report.map import names

    target = destination(args, "map", [args.machine], "-map").check(names(not args.no_plots))
    with progress_line(quiet=args.json) as progress:
        found = map_stiffness(
            machine_for(args),
            x_mm=args.x,
            y_mm=args.y,
            z_mm=args.slices or args.z,
            load=args.load,
            tilt_deg=args.tilt,
            points=args.points,
            force_N=args.force,
            progress=progress,
        )
    return show(args, found, target)


# -- tps machine ------------------------------------------------------------------------------------------------------

MACHINE_EPILOG = """\
examples:
  tps machine show nist --out hexapod.png           figures with their origin; the machine at the paper's pose
  tps machine new mine.toml                         a commented template to edit
  tps machine check mine.toml
  tps machine from-linuxcnc programs/hexapod.hal --units mm -o hexapod.toml
  tps machine recover                               the NIST geometry from the paper's Table 1, fitted anew
"""
MACHINE_OUT_OF_REACH = NOT_GOOD = 1


def machine_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of every action."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = MACHINE_EPILOG
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = actions.add_parser("list", help="packaged machines")
    listing.add_argument("--json", action="store_true", help="print JSON")
    show = actions.add_parser("show", help="figures of a machine with their origin, and a picture of it")
    show.add_argument("machine", metavar="NAME|FILE", nargs="?", default="nist")
    show.add_argument("--pose", type=pose_argument, metavar="X,Y,Z[,A,B,C]", help="pose of the picture, mm and degrees")
    show.add_argument("--out", metavar="FILE.png|DIR", help="the picture, or its folder (default: reports)")
    add_replace_option(show)
    show.add_argument("--json", action="store_true", help="print JSON, draw nothing unless --out is given")
    check = actions.add_parser(
        "check", help="check a machine file for mistakes, draw it; exit code 1 if it cannot be right"
    )
    check.add_argument("file", metavar="FILE")
    check.add_argument(
        "--effects", action="append", default=[], metavar="FILE.py", help="your own physical effects that it names"
    )
    add_unchecked_option(check)
    check.add_argument("--out", metavar="FILE.png|DIR", help="the picture, or its folder (default: reports)")
    add_replace_option(check)
    check.add_argument("--json", action="store_true", help="print JSON, draw nothing unless --out is given")
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


def machine(args: argparse.Namespace) -> int:
    """Do the chosen action."""
    action = {
        "list": _machine_list,
        "show": _machine_show,
        "check": _machine_check,
        "new": _machine_new,
        "from-linuxcnc": _from_linuxcnc,
        "recover": _recover,
    }[args.action]
    return action(args)


def _machine_list(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.machines import Machine
    from toolpath_stiff.results import json_text

    machines = [Machine.load(name) for name in Machine.names()]
    if args.json:
        sys.stdout.write(json_text([{"name": m.asked, "title": m.title, "source": m.source} for m in machines]))
    else:
        print("\n".join(f"{m.asked:<16} {m.title}\n{'':<16} {m.source}" for m in machines))
    return 0


def _machine_show(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.machines import Machine
    from toolpath_stiff.files import write_atomically
    from toolpath_stiff.results import json_text

    machine = Machine.load(args.machine)
    if args.json:
        sys.stdout.write(json_text(machine.to_frame().to_dict("records")))
    else:
        print(machine.text(args.pose))
    if args.out or not args.json:
        target = _picture_file(args.out, machine.name)
        check_written(args, [target])
        picture = machine.picture(args.pose)
        keep(check_made(args, {target: picture}), quiet=args.json)
        written = write_atomically(target, picture)
        if not args.json:
            print(written_text([written]))
    return 0 if machine.standing(args.pose)[2].reachable[0] else MACHINE_OUT_OF_REACH


def _picture_file(out: str | None, name: str) -> Path:
    """Where a picture goes: the file of --out, or the folder, as of every other command. Raises `InputError`."""
    place = Path(out or "reports")
    if place.suffix.lower() == ".png" and not place.is_dir():
        return place
    if place.suffix and not place.is_dir():
        raise InputError(f"--out {out}: {place.suffix} is no picture's ending here", expected="FILE.png or a folder")
    return place / f"{name}.png"


def _machine_check(args: argparse.Namespace) -> int:
    """Load the file, say what is wrong or doubtful, draw the machine at its neutral pose."""
    from toolpath_stiff.api.machines import Machine
    from toolpath_stiff.files import write_atomically

    if not Path(args.file).is_file():
        new = command_line("machine", "new", args.file)
        raise InputError(f"cannot read machine file {args.file!r}", hint=f"`{new}` writes a template")
    target = _picture_file(args.out, f"{Path(args.file).stem}_machine")
    drawn = bool(args.out) or not args.json
    check_written(args, [target] if drawn else [])
    found = Machine.load(
        Path(args.file), effects=args.effects, allow_unchecked_effects=args.allow_unchecked_effects
    ).check()
    files = {target: found.picture()} if drawn else {}
    keep(check_made(args, files), quiet=args.json)
    written = [write_atomically(file, content) for file, content in files.items()]
    if args.json:
        sys.stdout.write(found.to_json())
    else:
        print(f"{found}\n{written_text(written)}")
    return 0 if found.good else NOT_GOOD


def _machine_new(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.machines import machine_template

    target, replaced = Path(args.file), check_new(args, args.file)
    keep(replaced)
    written = machine_template(target).save(target)
    print(f"{written_text([written])}\n{hint('edit it, then', command_line('machine', 'check', target))}")
    return 0


def _from_linuxcnc(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.machines import machine_from_linuxcnc

    replaced = check_single(args, args.out)
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


# -- tps effects ------------------------------------------------------------------------------------------------------

CHECK_FAILED = 1
EFFECTS_EPILOG = """\
examples:
  tps effects list
  tps effects show platform_flexibility
  tps effects new my_screw.py            a working effect to change into yours
  tps effects draft measurements.csv -o missing.toml  what a diagnosis leaves unexplained, as an effect to edit
  tps effects check my_screw.py          shapes, symmetry, units, neutral value, speed; exit code 1 if it fails
  tps effects list --effects my_screw.py

Machine files carry effects as [[effect]], those that act on readings as [[instrument]].
"""


def effects_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from toolpath_stiff.cli.measurements import add_data_arguments, add_noise_arguments

    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EFFECTS_EPILOG
    actions = parser.add_subparsers(dest="action", metavar="list|show|new|draft|check", required=True)
    listing = actions.add_parser("list", help="all effects, in the order of the load path")
    showing = actions.add_parser("show", help="equation, parameters, units, bounds, typical values and their source")
    showing.add_argument("name", metavar="NAME", help="name of the effect")
    for sub in (listing, showing):
        sub.add_argument(
            "--effects", action="append", default=[], metavar="FILE.py", help="file with your own physical effects"
        )
        add_json_option(sub, "print JSON")
    checking = actions.add_parser("check", help="try the effects of a file against the contract")
    checking.add_argument("file", metavar="FILE.py", help="file with your own physical effects")
    checking.add_argument("--machine", default="nist", metavar="NAME|FILE", help="to try them on (default: nist)")
    add_json_option(checking, "print JSON")
    writing = actions.add_parser("new", help="write a commented, working example of an effect")
    writing.add_argument("file", metavar="FILE.py", help="file to write")
    add_replace_option(writing)
    drafting = actions.add_parser("draft", help="write what a diagnosis leaves unexplained as an effect to edit")
    add_data_arguments(drafting)
    add_noise_arguments(drafting)
    drafting.add_argument("--seed", type=int, default=0, metavar="N", help="seed of every random draw (default: 0)")
    drafting.add_argument("-o", "--output", default="missing.toml", metavar="FILE.toml", help="default: missing.toml")
    add_replace_option(drafting)
    add_json_option(drafting, "print the draft as JSON")


def effects(args: argparse.Namespace) -> int:
    """List, show, check or write."""
    action = {
        "list": _effects_list,
        "show": _effects_show,
        "check": _effects_check,
        "new": _effects_new,
        "draft": _effects_draft,
    }[args.action]
    return action(args)


def _effects_list(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.effects import effects

    found = effects(args.effects)
    sys.stdout.write(found.to_json() if args.json else f"{found}\n")
    return 0


def _effects_show(args: argparse.Namespace) -> int:
    from toolpath_stiff.report.effects import describe_effect, effect_details
    from toolpath_stiff.results import json_text
    from toolpath_stiff.stiffness.catalogue import find_effect

    effect = find_effect(args.name, args.effects)
    sys.stdout.write(json_text(describe_effect(effect)) if args.json else f"{effect_details(effect)}\n")
    return 0


def _effects_check(args: argparse.Namespace) -> int:
    """Try every effect of a file; exit code 1 if one fails."""
    from toolpath_stiff.api.effects import check_effects

    found = check_effects(args.file, args.machine)
    sys.stdout.write(found.to_json() if args.json else f"{found}\n")
    return 0 if found.passed else CHECK_FAILED


def _effects_new(args: argparse.Namespace) -> int:
    """Write the example effect, named after its file."""
    from toolpath_stiff.api.effects import effect_name, effect_template

    name = effect_name(args.file)
    keep(check_new(args, args.file))
    effect_template(name).save(args.file)
    line = command_line("effects", "show", name, *options(effects=args.file))
    print(f"wrote {args.file}\n{hint('read it back', line)}")
    return 0


def _effects_draft(args: argparse.Namespace) -> int:
    """Diagnose, write what is left as an effect. That there is nothing to write is an answer as well."""
    from toolpath_stiff.api.effects import draft_effect
    from toolpath_stiff.cli.measurements import measured, noise_options

    check_written(args, [args.output])
    replaced = check_new(args, args.output)
    with progress_line(quiet=args.json) as progress:
        found = draft_effect(*measured(args), args.output, **noise_options(args), progress=progress)
    if found.text:
        keep(replaced, quiet=args.json)
        found.save(args.output)
    if args.json:
        sys.stdout.write(found.to_json())
    elif not found.text:
        print(found.reason)
    else:
        print("\n".join([found.diagnosis.to_dict()["portrait"]["text"], f"wrote {args.output}", *found.next]))
    return 0


def studio_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("data", nargs="*", metavar="DATA", help="measurement files to add to the case")
    parser.add_argument("--machine", metavar="NAME|FILE", help=f"machine of a new case (default: {MACHINE})")
    parser.add_argument("--program", metavar="FILE", help="NC program to add")
    parser.add_argument("--effects", action="append", default=[], metavar="FILE.py", help="your own physical effects")
    parser.add_argument(
        "--trust",
        action="append",
        default=[],
        metavar="effects/FILE.py",
        help="code that came with the case, which you have read and agree to run",
    )
    add_reading_options(parser.add_argument_group("how programs are read"))
    parser.add_argument("--case", default="tps-case", metavar="DIR", help="folder of the case (default: tps-case)")
    parser.add_argument("--exercise", type=int, metavar="SEED", help="start a blind exercise in a new case")
    parser.add_argument("--port", type=int, default=0, metavar="N", help="port (default: one that is free)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, open nothing")


def studio(args: argparse.Namespace) -> int:
    """Open the case and serve it until Ctrl-C."""
    from toolpath_stiff.studio.run import ask_for_effects, opened_case, serve

    case = opened_case(
        args.case,
        args.data,
        machine=args.machine,
        program=args.program,
        effects=args.effects,
        exercise=args.exercise,
        trust=args.trust,
        reading=case_reading(args),
    )
    ask_for_effects(case, args.case)
    return serve(case, args.port, browser=not args.no_browser)


# Command -> what declares its arguments, what runs it.
COMMANDS = {
    "pose": (pose_arguments, pose),
    "map": (map_arguments, map),
    "machine": (machine_arguments, machine),
    "effects": (effects_arguments, effects),
    "studio": (studio_arguments, studio),
}
