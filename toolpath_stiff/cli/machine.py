"""Machines by themselves: listed, shown, checked, made; stiffness at poses and over planes.

for example:
  tps machine show nist --out hexapod.png           figures with their origin; the machine at the paper's pose
  tps machine new mine.toml                         a commented template to edit
  tps machine check mine.toml
  tps machine from-linuxcnc programs/hexapod.hal --units mm -o hexapod.toml
"""

import sys
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated

import toolpath_stiff as tps
from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import FOLDER, JSON, REPLACE, command
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import Option, finite_number, numbers
from toolpath_stiff.results import TextFile

OUT_OF_REACH = NOT_GOOD = 1  # exit codes
MOST_NAMED = 10


@command("pose", "pose", "Machine.load", "Machine.under", JSON)
def pose(
    args: Namespace,
    pose: Annotated[Sequence[float], Option("X Y Z [A B C]", read=finite_number, count="*")] = (),
    csv: Annotated[str | None, Option("--csv", "FILE")] = None,
) -> int:
    """Stiffness, softest and stiffest direction, joint values at single poses.

    for example:
      tps pose -300 300 300 -30 0 0
      tps pose --csv poses.csv > stiffness.csv

    Angles are roll A, pitch B, yaw C in degrees, R = Rz(C) Ry(B) Rx(A); the position is the tool tip in mm, machine
    coordinates. --csv reads columns x_mm,y_mm,z_mm and, if there, a_deg,b_deg,c_deg; it writes one row per pose in the
    same order, with empty cells where a pose is out of reach (exit code 1).

    Parameters
    ----------
    pose
        Tool tip in mm, angles in degrees.
    csv
        Read poses from a table (CSV, or FILE.xlsx[#SHEET]), write CSV to standard output.
    """
    if (csv is None) == (not pose):
        raise InputError("give either a pose or --csv FILE", expected="tps pose X Y Z [A B C], or tps pose --csv FILE")
    if csv is None:
        return run.show(args, run.call(args, tps.pose, pose_mm_deg=pose))
    table, notes = tps.read_poses(csv)
    run.tell("note", notes)
    stiffness = run.call(args, tps.pose, pose_mm_deg=table)
    sys.stdout.write(stiffness.to_json() if args.json else stiffness.csv())
    run.tell("warning", (*stiffness.warnings, *stiffness.out_of_reach(MOST_NAMED)))
    return 0 if stiffness.reachable.all() else OUT_OF_REACH


@command("map", "map_stiffness", "Machine.load", "Machine.under", *FOLDER)
def map(
    args: Namespace,
    slices: Annotated[Sequence[float], Option("--slices", "Z,Z,...", read=numbers, instead_of="z_mm")] = (),
) -> int:
    """Stiffness over planes of the workspace: picture, table, 3-D page.

    for example:
      tps map --z 1200 --x -150:150 --y -150:150 --load radial     the paper's Figure 8
      tps map --z 1200 --load z                                    its Figure 9
      tps map --slices 400,800,1200 --x -400:400 --y -400:400 --tilt 15,0,0

    files written to --out: map.csv (x_mm,y_mm,z_mm,stiffness_N_per_mm,reachable), map.json, map.png, map.html (3-D)

    Parameters
    ----------
    slices
        Several heights, mm.
    """
    heights = {"z_mm": slices} if slices else {}
    return run.to_folder(args, tps.map_stiffness, tps.StiffnessMap, [args.machine], **heights)


@command("machine list", JSON)
def list_machines(args: Namespace) -> int:
    """Packaged machines."""
    machines = [tps.Machine.load(name).to_dict() for name in tps.Machine.names()]
    listed = [{key: machine[key] for key in ("name", "title", "source")} for machine in machines]
    text = "\n".join("{name:<16} {title}\n{0:<16} {source}".format("", **entry) for entry in listed)
    return run.show(args, text, document=lambda: listed)


Picture = Annotated[str | None, Option("--out", "FILE.png", help="the picture (default: in reports)")]
Drawing = Annotated[str | None, Option("--out", "FILE.png|.html", help="picture, or page (default: both, in reports)")]


@command("machine show", REPLACE, JSON)
def show_machine(
    args: Namespace,
    machine: Annotated[str, Option("NAME|FILE", count="?")] = "nist",
    pose: Annotated[Sequence[float] | None, Option("--pose", "X,Y,Z[,A,B,C]", read=numbers)] = None,
    out: Drawing = None,
) -> int:
    """Figures of a machine with their origin, a picture of it, and a page on which it can be turned.

    Parameters
    ----------
    pose
        Pose of picture and page, mm and degrees.
    """
    shown = tps.Machine.load(machine)
    makers = {".png": lambda: shown.picture(pose), ".html": lambda: shown.page(pose).encode()}
    written = _draw(args, out, shown.name, makers)
    code = 0 if shown.standing(pose)[2].reachable[0] else OUT_OF_REACH
    return run.show(args, shown.text(pose), written, document=lambda: shown.to_dict()["figures"], code=code)


def _draw(args: Namespace, out: str | None, name: str, makers: Mapping[str, Callable[[], bytes]]) -> str:
    """Write drawings to --out, or to reports unless JSON is printed; text of the files written. Raises `InputError`."""
    files = [Path(out)] if out else [] if args.json else [Path(f"reports/{name}{suffix}") for suffix in makers]
    if out and files[0].suffix.lower() not in makers:
        raise InputError(f"--out {out}", expected=f"a name that ends in {' or '.join(makers)}")
    return run.written_text(run.write_single(args, {file: makers[file.suffix.lower()]() for file in files}))


@command("machine check", "Machine.load", REPLACE, JSON, without=["machine"])
def check_machine(args: Namespace, file: Annotated[str, Option("FILE")], out: Picture = None) -> int:
    """Check a machine file for mistakes, draw it; exit code 1 if it cannot be right."""
    check = tps.Machine.load(Path(file), **run.given(args, tps.Machine.load)).check()
    written = _draw(args, out, f"{Path(file).stem}_machine", {".png": check.picture})
    return run.show(args, check, written, code=0 if check.good else NOT_GOOD)


@command("machine new", "machine_template", REPLACE)
def new_machine(args: Namespace, file: Annotated[str, Option("FILE")]) -> int:
    """Write a commented template."""
    text = tps.machine_template(file, kind=args.kind).text
    return run.write_text(args, file, text, "edit it, then", "machine", "check", file, fresh=True)


Made = Annotated[str | None, Option("-o --out", "FILE", help="machine file to write (default: standard output)")]


def _made_by(function: Callable[..., TextFile]) -> Callable[..., int]:
    """A command that writes or prints the file that a public function makes from another."""

    def make(args: Namespace, out: Made = None) -> int:
        made = run.call(args, function)
        run.tell("note", made.notes)
        if out:
            return run.write_text(args, out, made.text, "fill in what it leaves open, then", "machine", "check", out)
        sys.stdout.write(made.text)
        return 0

    make.__doc__ = function.__doc__
    return make


for kind in ("linuxcnc", "urdf", "dh", "freecad"):
    name = f"machine_from_{kind}"
    command(f"machine from-{kind}", name, REPLACE)(_made_by(getattr(tps, name)))
