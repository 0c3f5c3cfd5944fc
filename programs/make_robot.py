"""Makes robot.urdf, robot_cell.toml and robot_pulls.csv: a milling robot, and what pulls at its tool say.

    python programs/make_robot.py

An invented arm of the rig, for tutorial 4. The URDF file holds what a maker would give: joints, limits, speeds, masses;
the machine file is what `tps machine from-urdf` makes of it, with the compliances filled in; the arm that is pulled has
a fault.
"""

import re
from pathlib import Path

import numpy as np

import toolpath_stiff as tps
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.rig.exercise import csv_text
from toolpath_stiff.rig.robot import robot_case
from toolpath_stiff.rotations import roll_pitch_yaw

HERE = Path(__file__).resolve().parent
SEED, HIDDEN, NOISE = 9, "joint_torsion", 0.02
SPEEDS = (105.0, 101.0, 107.0, 136.0, 129.0, 206.0)  # deg/s, of arms of this size


def words(values: np.ndarray) -> str:
    """Three numbers."""
    return " ".join(f"{value + 0.0:.10g}" for value in values)


def main() -> None:
    """Write the files."""
    text, pulls, _ = robot_case(SEED, HIDDEN, NOISE)
    text = re.sub(r"\d+\.\d{5,}", lambda number: f"{float(number[0]):.4g}", text)  # as one writes such figures
    arm = parse_machine(text)
    carried = {frame: (mass, place) for mass, frame, place in arm.tool_masses}
    rows = ['<?xml version="1.0"?>', '<robot name="robot">', '  <link name="base"/>']
    for i, joint in enumerate(arm.tool_joints, 1):
        place = f'<origin xyz="{words(joint.place.origin)}" rpy="{words(roll_pitch_yaw(joint.place.axes))}"/>'
        ends = (
            f'lower="{joint.low:.10g}" upper="{joint.high:.10g}" velocity="{np.radians(SPEEDS[i - 1]):.4g}" effort="0"'
        )
        before = f"link_{i - 1}" if i > 1 else "base"
        rows.append(f'  <joint name="J{i}" type="revolute">\n    <parent link="{before}"/><child link="link_{i}"/>')
        rows.append(f'    {place}\n    <axis xyz="0 0 1"/><limit {ends}/>\n  </joint>')
        mass, centre = carried.get(i, (0.0, np.zeros(3)))
        inertia = f'<inertial><origin xyz="{words(centre)}"/><mass value="{mass:g}"/></inertial>' if mass else ""
        rows.append(f'  <link name="link_{i}">{inertia}</link>')
    place = f'<origin xyz="{words(arm.tip.origin)}" rpy="{words(roll_pitch_yaw(arm.tip.axes))}"/>'
    rows.append(
        f'  <joint name="tool" type="fixed">\n    <parent link="link_6"/><child link="tip"/>{place}\n  </joint>'
    )
    urdf = HERE / "robot.urdf"
    urdf.write_text("\n".join([*rows, '  <link name="tip"/>', "</robot>", ""]), encoding="utf-8")
    made = tps.machine_from_urdf(urdf, "tip").text
    elements = text[text.index("[[element]]") : text.index("[[mass]]")]
    filled = re.sub(r"\[\[element\]\].*?(?=\[\[mass\]\])", lambda _: elements, made, flags=re.DOTALL)
    head = "# Compliances were filled in by hand; those of the joints are what the maker of such arms may say.\n"
    (HERE / "robot_cell.toml").write_text(head + filled.split("\n", 2)[2], encoding="utf-8")
    (HERE / "robot_pulls.csv").write_text(csv_text(pulls), encoding="utf-8")


if __name__ == "__main__":
    main()
