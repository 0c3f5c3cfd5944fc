"""`tps pose`: stiffness at single poses."""

from __future__ import annotations

import argparse
import json
import math
import sys
from typing import TYPE_CHECKING

from toolpath_stiff.cli.arguments import add_json_option, add_machine_options, finite_number, model_for
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.hints import command_line

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolpath_stiff.analysis.poses import PoseReport
    from toolpath_stiff.stiffness.model import StiffnessModel

    FloatArray = NDArray[np.float64]

EPILOG = """\
examples:
  tps pose -300 300 300 -30 0 0
  tps pose --csv poses.csv > stiffness.csv

Angles are roll A, pitch B, yaw C in degrees, R = Rz(C) Ry(B) Rx(A); the position is the tool tip in mm, machine
coordinates. --csv reads columns x_mm,y_mm,z_mm and, if there, a_deg,b_deg,c_deg; it writes one row a pose in the
same order, with empty cells where a pose is out of reach (exit code 1).
"""
FARTHEST = 1e5  # mm and degrees; more is a slip of unit or key


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
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


def run(args: argparse.Namespace) -> int:
    """Evaluate and print."""
    if (args.csv is None) == (not args.pose):
        raise InputError(
            "give either a pose or --csv FILE" if args.csv is None else "give a pose or --csv FILE, not both",
            expected="tps pose X Y Z [A B C], or tps pose --csv FILE",
        )
    if args.csv is None and len(args.pose) not in (3, 6):
        raise InputError(f"a pose of {len(args.pose)} numbers", expected="X Y Z or X Y Z A B C")
    model = model_for(args)
    if args.csv is not None:
        return _csv(model, args)
    return _single(model, args)


def _evaluate(model: StiffnessModel, poses: FloatArray, force: float) -> PoseReport:
    """Evaluate poses (n, 6) in mm and degrees."""
    from toolpath_stiff.analysis.poses import evaluate_poses
    from toolpath_stiff.units import m_from_mm, rad_from_deg

    return evaluate_poses(model, m_from_mm(poses[:, :3]), rad_from_deg(poses[:, 3:]), force=force)


def _csv(model: StiffnessModel, args: argparse.Namespace) -> int:
    from toolpath_stiff.report.machine import pose_csv
    from toolpath_stiff.stiffness.model import condition_warnings

    poses = _read_poses(args.csv)
    found = _evaluate(model, poses, args.force)
    sys.stdout.write(pose_csv(poses, found))
    for warning in condition_warnings(model):
        print(f"tps: warning: {warning}", file=sys.stderr)
    unreachable = (~found.reach.reachable).nonzero()[0]
    for i in unreachable[:10]:
        print(f"tps: warning: row {i + 1}: out of reach: {found.reach.describe(i)}", file=sys.stderr)
    if len(unreachable) > 10:
        print(f"tps: warning: {len(unreachable) - 10} more rows are out of reach", file=sys.stderr)
    return 1 if len(unreachable) else 0


def _read_poses(file: str) -> FloatArray:
    """(n, 6) mm and degrees from a table. Raises `InputErrors` with every bad cell named."""
    import numpy as np

    from toolpath_stiff.report.machine import POSE_COLUMNS
    from toolpath_stiff.tables import Columns, read_table

    table = read_table(file, "poses", Columns(POSE_COLUMNS))
    missing = [name for name in POSE_COLUMNS[:3] if name not in table.heading]
    if missing:
        raise InputError(
            f"column {missing[0]} is missing (found {', '.join(table.heading)})",
            expected=", ".join(POSE_COLUMNS[:3]),
            file=file,
            line=table.heading_line,
        )
    if not table.rows:
        raise InputError("no poses", expected=f"rows below the heading ({','.join(POSE_COLUMNS)})", file=file)
    columns = [(i, name) for i, name in enumerate(POSE_COLUMNS) if name in table.heading]
    poses, errors = np.zeros((len(table.rows), 6)), []
    for row, (line, cells) in enumerate(table.rows):
        for i, name in columns:
            at = table.heading.index(name)
            text = cells[at] if at < len(cells) else ""
            try:
                poses[row, i] = _coordinate(text)
            except ValueError:
                expected = f"a number within +-{FARTHEST:g}"
                errors.append(InputError(f"row {row + 1}, {name}: {text!r}", expected=expected, file=file, line=line))
    if errors:
        raise InputErrors(errors)
    for note in table.notes:
        print(f"tps: note: {note}", file=sys.stderr)
    return poses


def _coordinate(text: str) -> float:
    """A finite number within reason. Raises `ValueError`."""
    value = float(text)
    if not math.isfinite(value) or abs(value) > FARTHEST:
        raise ValueError(text)
    return value


def _single(model: StiffnessModel, args: argparse.Namespace) -> int:
    import numpy as np

    from toolpath_stiff.errors import UnreachableError
    from toolpath_stiff.report.machine import pose_columns, pose_text
    from toolpath_stiff.stiffness.model import condition_warnings, effects_stated

    poses = np.array([[*args.pose, 0.0, 0.0, 0.0][:6]])
    if np.abs(poses).max() > FARTHEST:
        raise InputError(f"a pose of {np.abs(poses).max():g} mm or degrees", expected=f"numbers within +-{FARTHEST:g}")
    found = _evaluate(model, poses, args.force)
    if not found.reach.reachable[0]:
        raise UnreachableError(
            f"the pose is out of reach on machine {model.machine.name}: {found.reach.describe(0)}",
            hint=f"`{command_line('machine', 'show', args.machine)}` lists the limits",
        )
    values = {name: column[0] for name, column in pose_columns(poses, found).items()}
    if args.json:
        plain = {n: v.item() if hasattr(v, "item") else v for n, v in values.items()}
        plain["extrapolated"] = bool(plain["extrapolated"])
        about = {"machine": model.machine.name, **effects_stated(model), "warnings": condition_warnings(model)}
        json.dump({**about, **plain}, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return 0
    print(pose_text(model, values, found))
    return 0
