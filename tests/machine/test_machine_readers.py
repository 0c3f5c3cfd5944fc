"""Descriptions of other programs: the same machine by each, compliances left to fill in, bad ones in one line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine, parse_machine
from toolpath_stiff.rotations import rotation_matrices

DATA = Path(__file__).parent / "data"
ROBOT = load_machine(DATA / "robot200.toml")
JOINTS = np.deg2rad(np.random.default_rng(1).uniform(-60.0, 60.0, (20, 6)))
FILLED = dict(
    row.split(" = ")
    for row in """torsion_nrad_per_Nm = 500.0
translation_nm_per_N = [4.0, 4.0, 9.0]
rotation_nrad_per_Nm = [30.0, 30.0, 30.0]
centre_mm = [0.0, 0.0, 100.0]
min_deg = -170.0
max_deg = 170.0
X_mm = [-400, 400]
Y_mm = [-400, 400]
Z_mm = [-400, 400]
A_deg = [-110, 30]
C_deg = [-400, 400]
length_mm = 1200.0
strut = 5
compliance_nm_per_N = 16.0
slope_nm_per_N_per_m = 7.5
min_mm = 750.0
max_mm = 2200.0
EI_MNm2 = 1.35
hinge_nrad_per_Nm = 180.0
carriage_joint_radius_mm = 520.0
effector_joint_radius_mm = 120.0
rod_spacing_mm = 220.0
effector_joint_height_mm = 95.0
carriage_mm = [500, 1300]
rail_radius_mm = 610.0
centre_height_mm = 40.0
stiffness_N_per_um = 50.0
frame_max_deg = 60.0
platform_max_deg = 60.0
neutral_pose_mm_deg = [0, 0, 550, 0, 0, 0]
default_origin_mm = [0, 0, 550]
rapid_mm_per_min = 10000.0""".splitlines()
)


def filled(text: str):
    """The machine with what is commented out filled in; nothing else is missing."""
    return parse_machine(re.sub(r"(?m)^# (\w+) =(?: \[\])?(?=\s|$)", lambda m: f"{m[1]} = {FILLED[m[1]]}", text))


def test_urdf_is_the_robot_with_its_tool_and_limits():
    made = tps.machine_from_urdf(DATA / "robot200.urdf", "tip")
    with pytest.raises(InputError, match=r"torsion_nrad_per_Nm is missing.*0 to|torsion_nrad_per_Nm is missing"):
        parse_machine(made.text)
    machine = filled(made.text)
    assert machine.weight_loads(machine.solve([[1.5, 0.0, 0.8]])).any()  # masses of the links
    for ours, theirs in zip(machine.forward(JOINTS), ROBOT.forward(JOINTS), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    np.testing.assert_allclose(machine.joint_limits, ROBOT.joint_limits, rtol=1e-12)
    assert machine.wrist is not None  # right angles survive the way through rpy
    assert not any("turn it" in note for note in made.notes)
    assert "z of link6 does not run back" in " ".join(tps.machine_from_urdf(DATA / "robot200.urdf", "link6").notes)
    assert [element.name for element in machine.elements][:2] == ["joint 1", "joint 2"]


def test_what_files_of_robots_have_besides_is_read_past(tmp_path):
    """As files on the web have it: comments on xacro, a link "world" below, joints named again by transmissions."""
    besides = "<!-- made from robot.xacro: see there --><gazebo><plugin/></gazebo>" + "".join(
        f'<transmission name="t{i}"><joint name="J{i}"/><actuator name="m{i}"/></transmission>' for i in range(1, 7)
    )
    world = '<link name="world"/><joint name="w" type="fixed"><parent link="world"/><child link="base"/></joint>'
    file = tmp_path / "arm.urdf"
    file.write_text(URDF.replace("</robot>", f"{besides}{world}</robot>").replace('velocity="0"', 'velocity="2.5"'))
    machine = filled(tps.machine_from_urdf(file, "tip").text)
    np.testing.assert_allclose(machine.forward(JOINTS)[0], ROBOT.forward(JOINTS)[0], atol=1e-12)
    np.testing.assert_allclose(machine.joint_speeds, 2.5)


def test_a_table_of_dh_rows_is_the_robot(tmp_path):
    rows = ["name;alpha_deg;a_mm;offset_deg;d_mm;min_deg;max_deg"]
    for block in (DATA / "robot200.toml").read_text().split("[[axis]]")[1:7]:
        value = dict(re.findall(r"(\w+) = (\S+)", block))
        rows.append(";".join(value[key].strip('"') for key in rows[0].split(";")))
    (tmp_path / "arm.csv").write_text("\n".join(rows))
    bare = ROBOT.with_changes(tip=load_machine(DATA / "robot200.toml").tip.then(ROBOT.tip.inverse()))
    machine = filled(tps.machine_from_dh(tmp_path / "arm.csv", "modified").text)
    for ours, theirs in zip(machine.forward(JOINTS), bare.forward(JOINTS), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    (tmp_path / "arm.csv").write_text("\n".join([*rows[:2], rows[2].replace("340.0", "")]))
    with pytest.raises(InputError, match=r"arm.csv:3: joint J2"):
        tps.machine_from_dh(tmp_path / "arm.csv", "modified")


def test_linuxcncs_files_are_the_machines(tmp_path):
    made = {
        name: filled(tps.machine_from_linuxcnc(DATA / f"{name}.hal", "mm").text)
        for name in ("mill5_xyzac", "pentapod_pentakins", "delta_lineardeltakins", "robot200_genserkins")
    }
    pose = np.array([[0.075, 0.02, -0.12]])
    words = np.deg2rad([[-40.0, 0.0, 65.0]])
    for name, rotation in (
        ("mill5_xyzac", words),
        ("pentapod_pentakins", words * [0.2, 0, 0]),
        ("delta_lineardeltakins", 0 * words),
    ):
        machine, ours = load_machine(DATA / f"{name.split('_')[0]}.toml"), made[name]
        stances = [m.solve(pose, m.rotation_of(rotation)) for m in (machine, ours)]
        np.testing.assert_allclose(stances[0].joints, stances[1].joints, atol=1e-12)
    position, rotation = made["robot200_genserkins"].forward(JOINTS - np.deg2rad([0, 90, 0, 0, 0, 0]))
    flange = ROBOT.with_changes(tip=ROBOT.tip.then(ROBOT.tip.inverse()))
    np.testing.assert_allclose(position, flange.forward(JOINTS)[0], atol=1e-12)
    inch = "setp pumakins.A2 10\nsetp pumakins.A3 1\nsetp pumakins.D3 5\nsetp pumakins.D4 16\nsetp pumakins.D6 3\n"
    (tmp_path / "puma.hal").write_text(inch)
    joints = "".join(f"[JOINT_{i}]\nTYPE = ANGULAR\nMIN_LIMIT = -150\nMAX_LIMIT = 150\n" for i in range(6))
    (tmp_path / "puma.ini").write_text("[KINS]\nKINEMATICS = pumakins\n[TRAJ]\nLINEAR_UNITS = inch\n" + joints)
    puma = filled(tps.machine_from_linuxcnc(tmp_path / "puma.hal").text)
    np.testing.assert_allclose(puma.joint_limits, np.deg2rad([[-150.0, 150.0]] * 6))
    assert puma.tool_joints[2].place.origin[0] == pytest.approx(0.254)
    (tmp_path / "head.hal").write_text("setp 5axiskins.pivot-length 250\n")
    (tmp_path / "puma.ini").unlink()
    head = filled(tps.machine_from_linuxcnc(tmp_path / "head.hal", "mm").text.replace("# min_mm", "min_mm =-900 #")
                  .replace("# max_mm", "max_mm = 900 #"))  # fmt: skip
    assert head.joint_names == ("X", "Y", "Z", "C", "B")
    (tmp_path / "mill.hal").write_text("loadrt [KINS]KINEMATICS\n")
    (tmp_path / "mill.ini").write_text(
        "[KINS]\nKINEMATICS = trivkins coordinates=XYZ\n[TRAJ]\nLINEAR_UNITS = mm\n"
        "[JOINT_0]\nMIN_LIMIT = -5\nMAX_LIMIT = 300\n[JOINT_2]\nMIN_LIMIT = -90\nMAX_LIMIT = 0.5\n"
    )
    mill = filled(tps.machine_from_linuxcnc(tmp_path / "mill.hal").text)
    np.testing.assert_allclose(mill.joint_limits, [[-0.005, 0.3], [-0.4, 0.4], [-0.09, 0.0005]])


SAMPLES = Path("/usr/share/doc/linuxcnc/examples/sample-configs/sim/axis")


@pytest.mark.skipif(not SAMPLES.exists(), reason="needs linuxcnc-uspace")
def test_linuxcncs_own_samples_are_read(tmp_path):
    """HALCMD, nets and signals, small letters: as its files have them. Machines in one folder are not mixed."""
    library = Path("/usr/share/linuxcnc/hallib")
    for delta in ("rdelta", "ldelta"):
        for file in (SAMPLES / f"{delta}.ini", library / f"sim_{delta}.hal"):
            (tmp_path / file.name).write_text(file.read_text())
        made = tps.machine_from_linuxcnc(tmp_path / f"{delta}.ini").text
        assert {"rdelta": "length_mm = 254.0", "ldelta": "rod_length_mm = 269.0"}[delta] in made
    trunnions = SAMPLES / "vismach/5axis/table-rotary-tilting"
    made = tps.machine_from_linuxcnc(trunnions / "xyzac-trt.ini").text
    assert "y_offset_mm = 20.0\nz_offset_mm = 10.0" in made and "A_deg = [-100.0, 50.0]" in made
    with pytest.raises(InputError, match=r"KINEMATICS = xyzac.* and xyzbc.*Give the ini file"):
        tps.machine_from_linuxcnc(trunnions / "switchkins_postgui.hal")
    robot = filled(tps.machine_from_linuxcnc(SAMPLES / "vismach/puma/puma560.ini").text)
    assert robot.joint_names == ("J1", "J2", "J3", "J4", "J5", "J6")
    bare = tps.machine_from_linuxcnc(trunnions / "xyzbc-trt.ini", "inch")
    assert "x_offset_mm = -508.0" in bare.text
    (tmp_path / "a.hal").write_text("setp xyzac-trt-kins.y-offset [OFF](Y)\n")
    (tmp_path / "a.ini").write_text("[HAL]\nHALFILE = a.hal\n[TRAJ]\nLINEAR_UNITS = mm\n[OFF]\nY = 12.5\n")
    made = tps.machine_from_linuxcnc(tmp_path / "a.hal")
    assert "y_offset_mm = 12.5" in made.text and "z-offset is not set: 0" in " ".join(made.notes)


def axis(role: str, kind: str, direction: list[float], origin=(0, 0, 0), parent=None, low=-400, high=400) -> dict:
    return {"type": kind, "role": role, "parent": parent, "sequence": 0, "joint": [list(origin), direction],
            "limits": {"min": low, "max": high}}  # fmt: skip


def freecad(**changes: dict) -> str:
    axes = {
        "X": axis("table_linear", "linear", [1, 0, 0]),
        "Y": axis("head_linear", "linear", [0, 1, 0]),
        "Z": axis("head_linear", "linear", [0, 0, 1], parent="Y"),
        "A": axis("table_rotary", "rotary", [1, 0, 0], (0, 0, -50), "X", -120, 30),
        "C": axis("table_rotary", "rotary", [0, 0, 1], (0, 0, -80), "A", -360, 360),
        **changes,
    }
    return json.dumps({"machine": {"name": "MCV", "units": "metric", "axes": axes}})


def test_freecads_machine_is_read_in_the_order_of_its_parents(tmp_path):
    file = tmp_path / "mcv.fcm"
    file.write_text(freecad())
    machine = filled(tps.machine_from_freecad(file).text)
    assert [joint.name for joint in machine.work_joints] == ["X", "A", "C"]
    joints = np.array([[0.03, -0.02, 0.05, 0.4, -0.7]])  # X Y Z A C as the file lists head and table
    values = dict(zip("XYZAC", joints[0], strict=True))
    position, _ = machine.forward(np.array([[values[name] for name in machine.joint_names]]))
    # The table moves against its axes: p = Rz(C) (Rx(A) (tip + X - a) + a - c) + c, a and c on the axes.
    a, c = np.array([0.0, 0.0, -0.05]), np.array([0.0, 0.0, -0.08])
    tip = np.array([values["X"], values["Y"], values["Z"]])
    about = [rotation_matrices([values["A"], 0.0, 0.0]), rotation_matrices([0.0, 0.0, values["C"]])]
    expected = about[1] @ (about[0] @ (tip - a) + a - c) + c
    in_work = position[0] + [0.0, 0.0, -0.08]  # work axes begin at the last joint
    np.testing.assert_allclose(in_work, expected, atol=1e-12)
    old = json.loads(freecad())
    old["machine"]["axes"]["X"]["joint"] = [[1, 0, 0], [0, 0, 0]]  # as files of linear axes had it
    file.write_text(json.dumps(old))
    again = filled(tps.machine_from_freecad(file).text)
    in_order = np.array([[values[name] for name in again.joint_names]])
    np.testing.assert_array_equal(again.forward(in_order)[0], position)
    orphans = {name: axis("table_rotary", "rotary", [1, 0, 0]) for name in "AC"}
    file.write_text(freecad(**orphans))
    with pytest.raises(InputError, match=r"which of X, A, C carries which. Give them from the base outwards: --order"):
        tps.machine_from_freecad(file)
    assert tps.machine_from_freecad(file, ["X", "A", "C", "Y", "Z"]).name == "mcv"


URDF = (DATA / "robot200.urdf").read_text()
LOOP = '<joint name="L" type="fixed"><parent link="tip"/><child link="link2"/></joint></robot>'
BAD_URDF = [
    (URDF.replace("</robot>", LOOP), "tip", "link link2 hangs on the joints J2 and L: a loop"),
    (URDF, "flange", "no link flange that hangs on a joint; expected --tip tip"),
    (re.sub(r'<limit lower="-1.1344[^/]*/>', "", URDF), "tip", "joint J2 has no limits"),
    (URDF.replace('upper="1.4835298641951802"', 'upper="85"'), "tip", "radians or metres, not degrees or mm"),
    (URDF.replace('xyz="1.1200000000000001 0 0"', 'xyz="1120 0 0"'), "tip", "These look like mm or degrees"),
    (URDF.replace('type="revolute"', 'type="planar"', 1), "tip", "joint J1 is planar"),
    (URDF.replace("<robot", "<robot xmlns:xacro='x'").replace("<link", "<xacro:link", 1), "tip", "Run xacro"),
    (URDF.replace('link name="link4"', 'link name="${p}link4"'), "tip", "Run xacro"),
    (URDF[:300], "tip", "not XML"),
    (URDF.replace("<robot", "<sdf").replace("</robot", "</sdf"), "tip", "<sdf>; expected <robot>"),
    (URDF.replace('axis xyz="0 0 1"', 'axis xyz="0 0 0"', 1), "tip", "axis 0 0 0"),
    (URDF.replace('axis xyz="0 0 1"', 'axis xyz="0 0"', 1), "tip", "three numbers"),
    (URDF.replace('name="J3"', 'name="J2"'), "tip", "joint 'J2' is there twice"),
    (URDF.replace('<link name="link3"', '<link name="link33"'), "tip", "joint J3: no link 'link3', its child"),
    (re.sub(r'lower="-1.1344[^"]*"', 'lower="2"', URDF), "tip", "joint J2: limits [2.0, 1.48"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "tip", "words"), BAD_URDF)
def test_a_bad_urdf_is_one_line(tmp_path, text, tip, words):
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    with pytest.raises(InputError) as error:
        tps.machine_from_urdf(file, tip)
    assert words in str(error.value) and "\n" not in str(error.value)
    assert error.value.line is not None or "no link flange" in words


@pytest.mark.parametrize(
    ("reader", "name", "text", "words"),
    [
        ("freecad", "m.fcm", freecad(Y=axis("head_linear", "linear", [0, -1, 0])), "mirrored"),
        ("freecad", "m.fcm", freecad(A=axis("spindle", "rotary", [1, 0, 0])), "table_... or head_..."),
        ("freecad", "m.fcm", freecad(A=axis("table_rotary", "rotary", [1, 0, 0], low=5, high=5)), "min below max"),
        ("freecad", "m.fcm", freecad(A=axis("table_rotary", "prismatic", [1, 0, 0])), "has the type 'prismatic'"),
        ("freecad", "m.fcm", freecad(A=axis("table_rotary", "rotary", [0, 0, 0])), "axis A: joint"),
        ("freecad", "m.fcm", freecad(A=axis("table_rotary", "rotary", [1, 0])), "three numbers each"),
        ("freecad", "m.fcm", "{}", "not a FreeCAD machine"),
        ("linuxcnc", "m.hal", "setp genserkins.ALPHA-0 0\nsetp genserkins.A-0 0\n", "genserkins.D-0 is not set"),
        ("linuxcnc", "m.hal", "".join(f"setp genserkins.{n}-{i} -90\n" for i in range(6) for n in ("ALPHA", "A", "D")),
         "ALPHA-0 = -90; expected rad, not degrees"),
        ("linuxcnc", "m.hal", "setp lineardeltakins.L many\n", "expected a number"),
        ("linuxcnc", "m.hal", "loadrt [KINS]KINEMATICS\n", "no machine of a kinematics module"),
        ("linuxcnc", "m.hal", "setp xyzac-trt-kins.tool-offset 3\n", "tool-offset is not 0"),
        ("linuxcnc", "m.ini", "[KINS]\nKINEMATICS = maxkins\n", "no machine of maxkins; expected trivkins"),
        ("linuxcnc", "m.ini", "[KINS]\nKINEMATICS = rotarydeltakins\n", "rotarydeltakins.platformradius is not set"),
    ],
)  # fmt: skip
def test_other_bad_descriptions_are_one_line(tmp_path, reader, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as error:
        if reader == "freecad":
            tps.machine_from_freecad(tmp_path / name)
        else:
            tps.machine_from_linuxcnc(tmp_path / name, "mm")
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("machine", "old", "new", "words"),
    [
        ("robot200", 'name = "forearm"', 'name = "upper_arm"', "[[element]] 4 name = 'upper_arm' is there twice"),
        ("mill3", "z_axis = [1.0, 0.0, 0.0]", "z_axis = [0.0, 0.0, 1.0]", "[[element]] 1 z_axis lies along the beam"),
        ("mill3", "z_axis = [1.0, 0.0, 0.0]", "z_axis = [0.0, 0.0, 0.0]", "[[element]] 1 z_axis lies along the beam"),
    ],
)
def test_bad_elements_are_one_line(machine, old, new, words):
    text = (DATA / f"{machine}.toml").read_text()
    with pytest.raises(InputError) as error:
        parse_machine(text.replace(old, new, 1), "m.toml")
    assert words in str(error.value) and error.value.line is not None and "\n" not in str(error.value)
