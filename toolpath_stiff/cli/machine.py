"""The commands on a machine: pose, map, machine."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

import toolpath_stiff as tps
from toolpath_stiff.api.inputs import pose_si
from toolpath_stiff.cli.calls import call, given
from toolpath_stiff.cli.outputs import check_new, check_single, destination, keep, show, tell, write_made, written_text
from toolpath_stiff.cli.parser import FOLDER, JSON, REPLACE, Command, own
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, hint
from toolpath_stiff.options import finite_number, numbers

OUT_OF_REACH = NOT_GOOD = 1  # exit codes
MOST_NAMED = 10
EXAMPLES = """\
examples:
  tps machine show nist --out hexapod.png           figures with their origin; the machine at the paper's pose
  tps machine new mine.toml                         a commented template to edit
  tps machine check mine.toml
  tps machine from-linuxcnc programs/hexapod.hal --units mm -o hexapod.toml
  tps machine recover                               the NIST geometry from the paper's Table 1, fitted anew
"""


def pose(args: Namespace) -> int:
    """Stiffness, softest and stiffest direction, strut lengths at single poses.

    for example:
      tps pose -300 300 300 -30 0 0
      tps pose --csv poses.csv > stiffness.csv

    Angles are roll A, pitch B, yaw C in degrees, R = Rz(C) Ry(B) Rx(A); the position is the tool tip in mm, machine
    coordinates. --csv reads columns x_mm,y_mm,z_mm and, if there, a_deg,b_deg,c_deg; it writes one row a pose in the
    same order, with empty cells where a pose is out of reach (exit code 1).
    """
    if (args.csv is None) == (not args.pose):
        raise InputError(
            "give either a pose or --csv FILE" if args.csv is None else "give a pose or --csv FILE, not both",
            expected="tps pose X Y Z [A B C], or tps pose --csv FILE",
        )
    if args.csv is None:
        return show(args, call(args, tps.pose, pose_mm_deg=args.pose))
    table, notes = tps.read_poses(args.csv)
    tell("note", notes)
    stiffness = call(args, tps.pose, pose_mm_deg=table)
    sys.stdout.write(stiffness.to_json() if args.json else stiffness.csv())
    tell("warning", (*stiffness.warnings, *stiffness.out_of_reach(MOST_NAMED)))
    return 0 if stiffness.reachable.all() else OUT_OF_REACH


def map(args: Namespace) -> int:
    """Stiffness over planes of the workspace: picture, table, 3-D page.

    for example:
      tps map --z 1200 --x -150:150 --y -150:150 --load radial     the paper's Figure 8
      tps map --z 1200 --load z                                    its Figure 9
      tps map --slices 400,800,1200 --x -400:400 --y -400:400 --tilt 15,0,0

    files written to --out: map.csv (x_mm,y_mm,z_mm,stiffness_N_per_mm,reachable), map.json, map.png, map.html (3-D)
    """
    target = destination(args, tps.StiffnessMap, [args.machine])
    stiffness = call(args, tps.map_stiffness, **({"z_mm": args.slices} if args.slices else {}))
    return show(args, stiffness, written_text(target.write(stiffness, plots=not args.no_plots)))


def _heights(text: str) -> list[float]:
    heights = sorted(numbers(text))
    if len(set(heights)) < len(heights):
        raise ValueError("each height once")
    return heights


def list_machines(args: Namespace) -> int:
    """Packaged machines."""
    machines = [tps.Machine.load(name) for name in tps.Machine.names()]
    text = "\n".join(f"{m.asked:<16} {m.title}\n{'':<16} {m.source}" for m in machines)
    return show(
        args, text, document=lambda: [{"name": m.asked, "title": m.title, "source": m.source} for m in machines]
    )


def show_machine(args: Namespace) -> int:
    """Figures of a machine with their origin, and a picture of it."""
    machine = tps.Machine.load(args.machine)
    drawn = {_picture_file(args.out, machine.name): machine.picture(args.pose)} if args.out or not args.json else {}
    written = write_made(args, drawn)
    show(args, machine.text(args.pose), written_text(written), document=lambda: machine.to_dict()["figures"])
    return 0 if machine.standing(args.pose)[2].reachable[0] else OUT_OF_REACH


def _pose(text: str) -> Sequence[float]:
    pose = numbers(text)
    pose_si("--pose", pose)
    return pose


def _picture_file(out: str | None, name: str) -> Path:
    """Where a picture goes: the file of --out, or the folder, as of every other command. Raises `InputError`."""
    place = Path(out or "reports")
    if place.suffix.lower() == ".png" and not place.is_dir():
        return place
    if place.suffix and not place.is_dir():
        raise InputError(f"--out {out}: {place.suffix} is no picture's ending here", expected="FILE.png or a folder")
    return place / f"{name}.png"


def check_machine(args: Namespace) -> int:
    """Check a machine file for mistakes, draw it; exit code 1 if it cannot be right."""
    if not Path(args.file).is_file():
        new = command_line("machine", "new", args.file)
        raise InputError(f"cannot read machine file {args.file!r}", hint=f"`{new}` writes a template")
    target = _picture_file(args.out, f"{Path(args.file).stem}_machine")
    check = tps.Machine.load(Path(args.file), **given(args, tps.Machine.load)).check()
    written = write_made(args, {target: check.picture()} if args.out or not args.json else {})
    show(args, check, written_text(written))
    return 0 if check.good else NOT_GOOD


def new_machine(args: Namespace) -> int:
    """Write a commented template."""
    target = Path(args.file)
    keep(check_new(args, args.file))
    written = tps.machine_template(target).save(target)
    print(f"{written_text([written])}\n{hint('edit it, then', command_line('machine', 'check', target))}")
    return 0


def from_linuxcnc(args: Namespace) -> int:
    """Read the genhexkins pins of a LinuxCNC HAL file."""
    replaced = check_single(args, args.out)
    machine_file = tps.machine_from_linuxcnc(args.file, args.units)
    if args.out:
        keep(replaced)
        print(written_text([machine_file.save(args.out)]))
        print(hint("next", command_line("machine", "check", args.out)))
    else:
        sys.stdout.write(str(machine_file))
    tell("note", machine_file.notes)
    return 0


def recover(args: Namespace) -> int:
    """Fit the NIST geometry to the paper's Table 1 anew."""
    return show(args, call(args, tps.recover_geometry))


PICTURE = own("--out FILE.png|DIR", "the picture, or its folder (default: reports)")
FILE = own("FILE")
COMMANDS = {
    "pose": Command(
        pose,
        own(
            "X Y Z [A B C]", "tool tip in mm, angles in degrees", name="pose", read=finite_number, count="*", default=()
        ),
        own("--csv FILE", "read poses from a table (CSV, or FILE.xlsx[#SHEET]), write CSV to standard output"),
        tps.pose,
        tps.Machine.load,
        tps.Machine.under,
        JSON,
    ),
    "map": Command(
        map,
        own("--slices Z,Z,...", "several heights, mm", read=_heights, instead_of="z_mm"),
        tps.map_stiffness,
        tps.Machine.load,
        tps.Machine.under,
        *FOLDER,
    ),
    "machine list": Command(list_machines, JSON),
    "machine show": Command(
        show_machine,
        own("NAME|FILE", name="machine", count="?", default="nist"),
        own("--pose X,Y,Z[,A,B,C]", "pose of the picture, mm and degrees", read=_pose),
        PICTURE,
        REPLACE,
        JSON,
    ),
    "machine check": Command(check_machine, FILE, tps.Machine.load, PICTURE, REPLACE, JSON, without=["machine"]),
    "machine new": Command(new_machine, FILE, REPLACE),
    "machine from-linuxcnc": Command(
        from_linuxcnc,
        own("FILE.hal", name="file"),
        own("-o --out FILE", "machine file to write (default: standard output)"),
        tps.machine_from_linuxcnc,
        REPLACE,
    ),
    "machine recover": Command(recover, tps.recover_geometry, JSON),
}
