"""Kinds of machines against published check values, LinuxCNC's kinematics modules, and laws."""

from __future__ import annotations

import json
import re
import tomllib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toolpath_stiff as tps
from tests.machine.linuxcnc_kinematics import Module
from tests.machine.test_machine_readers import filled
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.chain import STILL
from toolpath_stiff.machine.chain_search import all_solutions
from toolpath_stiff.machine.file import load_machine, parse_machine
from toolpath_stiff.machine.kinematics import forward_kinematics, solve_struts
from toolpath_stiff.machine.limits import machine_limits
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices

DATA = Path(__file__).parent / "data"
NAMES = ("robot200", "mill5", "mill3", "pentapod", "delta")
MACHINES = {name: load_machine(DATA / f"{name}.toml") for name in NAMES}
CHECKS = [(name, i) for name in NAMES for i in range(3)]
VALUES = json.loads((DATA / "check_values.json").read_text())


def stance_of(name: str, i: int):
    """The stance at pose i of a machine's file."""
    machine = MACHINES[name]
    ((kind, values),) = tomllib.loads((DATA / f"{name}.toml").read_text())["pose"][i].items()
    if kind == "joints_deg":
        return machine.solve(*machine.forward(np.deg2rad(values)[None]))
    words = np.zeros((1, 3))
    for column, angle in zip({"mill5": (0, 2), "pentapod": (0, 1)}.get(name, ()), values[3:], strict=True):
        words[0, column] = np.deg2rad(angle)
    return machine.solve(np.array(values[None:3])[None] / 1e3, machine.rotation_of(words))


@pytest.mark.parametrize(("name", "i"), CHECKS)
def test_compliance_and_joints_are_the_published_ones(name, i):
    machine, stance, value = MACHINES[name], stance_of(name, i), VALUES[name][i]
    compliance = np.array(value["tip_compliance_6x6_SI"])
    np.testing.assert_allclose(stance.tip_compliance()[0], compliance, rtol=0.0, atol=1e-10 * np.abs(compliance).max())
    shown = stance.joints[0] * [1e3 if kind == "linear" else 180.0 / np.pi for kind in machine.joint_kinds]
    if name != "robot200":  # the file gives the joints, of one of eight configurations
        np.testing.assert_allclose(shown[: len(value["joints"])], value["joints"], rtol=1e-10, atol=1e-9)
        return
    stances = [machine.solve(stance.position, stance.rotation, configuration=c) for c in range(8)]
    near = min(np.abs(np.sin(0.5 * (s.joints[0] - np.deg2rad(value["joints"])))).max() for s in stances)
    assert near < 1e-12
    np.testing.assert_allclose(1e3 * stance.position[0], value["tip_mm"], rtol=1e-12)
    np.testing.assert_allclose(stance.rotation[0], value["tip_frame"], atol=1e-13)


def hal_pins(name: str) -> dict[str, float]:
    return {pin: float(value) for pin, value in re.findall(r"(?m)^setp\s+(\S+)\s+(\S+)", (DATA / name).read_text())}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("linuxcnc")


def near(first, second) -> None:
    """Equal to 1e-9 of mm and degrees, angles but for whole turns."""
    apart = np.abs(np.asarray(first) - second)
    apart[..., 3:] = np.abs((apart[..., 3:] + 180.0) % 360.0 - 180.0)
    assert apart.max() < 1e-9


@pytest.mark.parametrize(("hal", "letter"), [("xyzac-trt-kins", "A"), ("xyzbc-trt-kins", "B")])
def test_trunnions_are_linuxcncs(hal, letter, folder):
    machine, pins = MACHINES["mill5"], hal_pins("mill5_xyzac.hal")
    if letter == "B":
        text = (DATA / "mill5.toml").read_text().replace("xyzac", "xyzbc").replace("y_offset_mm", "x_offset_mm")
        machine = parse_machine(text.replace('"A_', '"B_').replace('"A"', '"B"').replace("\nA_deg", "\nB_deg"))
        pins = {p.replace("xyzac", "xyzbc").replace("y-offset", "x-offset"): value for p, value in pins.items()}
    module = Module(hal, pins, folder)
    rng = np.random.default_rng(4)
    pose = np.zeros((200, 6))
    pose[:, :3], pose[:, 5] = rng.uniform(-150, 150, (200, 3)), rng.uniform(-180, 180, 200)
    pose[:, "AB".index(letter) + 3] = np.where(np.arange(200) < 20, 0.0, rng.uniform(-100, 30, 200))
    rotation = machine.rotation_of(np.deg2rad(pose[:, 3:]))
    joints = machine.solve(pose[:, :3] / 1e3, rotation).joints
    shown = np.column_stack([1e3 * joints[:, :3], np.rad2deg(joints[:, 3:])])
    near(shown, [module.inverse(p, 5) for p in pose])
    position, turned = machine.forward(joints)
    there = np.array([module.forward(j) for j in shown])
    near(1e3 * position, there[:, :3])
    np.testing.assert_allclose(turned, machine.rotation_of(np.deg2rad(there[:, 3:])), atol=1e-12)


SPINDLE = """[[element]]
name = "spindle"
type = "spring"
at = "tip"
translation_nm_per_N = [9.0, 9.0, 3.5]
rotation_nrad_per_Nm = [0.0, 0.0, 0.0]
"""
HEAD = (
    'name = "head"\nkind = "serial"\n[tool]\ntip_mm = [0.0, 0.0, -250.0]\n'
    + SPINDLE
    + "".join(
        f'[[axis]]\nname = "{name}"\ntype = "{kind}"\naxis = {axis}\nxyz_mm = {place}\n'
        f"min_{unit} = -inf\nmax_{unit} = inf\n"
        for name, kind, axis, place, unit in (
            ("X", "linear", [1, 0, 0], [0, 0, 0], "mm"),
            ("Y", "linear", [0, 1, 0], [0, 0, 0], "mm"),
            ("Z", "linear", [0, 0, 1], [0, 0, 0], "mm"),
            ("C", "rotary", [0, 0, 1], [0, 0, 250], "deg"),
            ("B", "rotary", [0, -1, 0], [0, 0, 0], "deg"),
        )
    )
)


def test_a_head_on_a_head_is_linuxcncs(folder):
    machine = parse_machine(HEAD)
    module = Module("5axiskins", {"5axiskins.pivot-length": 250.0}, folder)
    pose = np.random.default_rng(5).uniform(-1.0, 1.0, (200, 6)) * [300, 300, 200, 0, 100, 180]
    joints = machine.solve(pose[:, :3] / 1e3, machine.rotation_of(np.deg2rad(pose[:, 3:]))).joints
    by_name = dict(zip(machine.joint_names, joints.T, strict=True))
    shown = np.column_stack([1e3 * joints[:, :3], np.rad2deg(by_name["B"]), np.rad2deg(by_name["C"])])
    near(shown, [module.inverse(p, 5) for p in pose])
    position, _ = machine.forward(joints)
    near(1e3 * position, [module.forward(j)[:3] for j in shown])


def test_the_robot_is_genserkins(folder):
    machine = MACHINES["robot200"].with_changes(tip=STILL)
    module = Module("genserkins", hal_pins("robot200_genserkins.hal"), folder)
    low, high = np.rad2deg(machine.joint_limits.T)
    joints = np.random.default_rng(6).uniform(np.maximum(low, -180), np.minimum(high, 180), (200, 6))
    position, rotation = machine.forward(np.deg2rad(joints))
    offset = [0.0, -90.0, 0.0, 0.0, 0.0, 0.0]  # LinuxCNC's rows have none
    there = np.array([module.forward(j + offset) for j in joints])
    near(1e3 * position, there[:, :3])
    np.testing.assert_allclose(rotation, rotation_matrices(np.deg2rad(there[:, 3:])), atol=1e-11)
    best = np.full(200, np.inf)
    for configuration in range(8):
        values = machine.solve(position, rotation, configuration=configuration).joints
        best = np.fmin(best, np.abs(np.sin(0.5 * (values - np.deg2rad(joints)))).max(axis=1))
    assert best.max() < 1e-9


PUMA = """
name = "puma"
kind = "serial"
[[element]]
name = "joints"
type = "joint"
torsion_nrad_per_Nm = 500.0
""" + "".join(
    f'[[axis]]\nname = "J{i}"\ntype = "R"\nalpha_deg = {alpha}\na_mm = {a}\nd_mm = {d}\nmin_deg = -180\nmax_deg = 180\n'
    for i, (alpha, a, d) in enumerate(
        [(0, 0, 0), (-90, 0, 0), (0, 300, 125), (-90, 35, 400), (90, 0, 0), (-90, 0, 70)], 1
    )
)  # D3 125 is the shoulder's lateral offset


def test_a_lateral_offset_is_pumakins(folder):
    machine = parse_machine(PUMA)
    pins = {"A2": 300.0, "A3": 35.0, "D3": 125.0, "D4": 400.0, "D6": 70.0}
    module = Module("pumakins", {f"pumakins.{pin}": value for pin, value in pins.items()}, folder)
    joints = np.random.default_rng(7).uniform(-120, 120, (100, 6))
    position, rotation = machine.forward(np.deg2rad(joints))
    there = np.array([module.forward(j) for j in joints])
    near(1e3 * position, there[:, :3])
    np.testing.assert_allclose(rotation, rotation_matrices(np.deg2rad(there[:, 3:])), atol=1e-9)
    solutions = [machine.solve(position, rotation, configuration=c).joints for c in range(8)]
    for values in solutions:
        again = machine.forward(values)
        np.testing.assert_allclose(again[0], position, atol=1e-9)
        np.testing.assert_allclose(again[1], rotation, atol=1e-9)


def test_the_pentapod_is_pentakins(folder):
    machine = MACHINES["pentapod"]
    module = Module("pentakins", hal_pins("pentapod_pentakins.hal"), folder)
    pose = np.random.default_rng(8).uniform(-1.0, 1.0, (200, 6)) * [250, 250, 150, 30, 30, 0]
    stance = machine.solve(pose[:, :3] / 1e3, machine.rotation_of(np.deg2rad(pose[:, 3:])))
    far = machine.singularities(stance)[:, 0] > 0.25  # else two modes lie side by side
    assert far.sum() > 100
    pose, joints = pose[far], stance.joints[far]
    near(1e3 * joints[:, :3], [module.inverse(p, 5)[:3] for p in pose])
    near(1e3 * joints[:, 3:], [module.inverse(p, 5)[3:] for p in pose])
    start = pose + np.random.default_rng(9).uniform(-1.0, 1.0, pose.shape) * [2, 2, 2, 1, 1, 0]
    there = np.array([module.forward(1e3 * j, p) for j, p in zip(joints, start, strict=True)])
    near(there, pose)
    position, rotation = machine.forward(joints, start=start[:, :5] / [1e3, 1e3, 1e3, *[180 / np.pi] * 2])
    near(1e3 * position, pose[:, :3])
    np.testing.assert_allclose(roll_pitch_yaw(rotation), np.deg2rad(pose[:, 3:]), atol=1e-10)


def test_the_delta_is_lineardeltakins(folder):
    machine = MACHINES["delta"]
    module = Module("lineardeltakins", hal_pins("delta_lineardeltakins.hal"), folder)
    pose = np.random.default_rng(9).uniform(-1.0, 1.0, (200, 6)) * [300, 300, 200, 0, 0, 0]
    joints = machine.solve(pose[:, :3] / 1e3).joints
    height = np.array([0.0, 0.0, 95.0, 0.0, 0.0, 0.0])  # LinuxCNC's z is the joints' height
    near(1e3 * joints, [module.inverse(p + height, 3) for p in pose])
    position, _ = machine.forward(joints)
    near(1e3 * position, [(module.forward(j) - height)[:3] for j in 1e3 * joints])


def test_hexapods_are_genhexkins(folder):
    hal = (Path(__file__).parents[2] / "programs/hexapod.hal").read_text()
    machine = filled(tps.machine_from_linuxcnc(Path(__file__).parents[2] / "programs/hexapod.hal", "mm").text)
    pins = {f"genhexkins.{pin}": float(value) for pin, value in re.findall(r"setp genhexkins\.(\S+)\s+(\S+)", hal)}
    module = Module("genhexkins", pins, folder)
    pose = np.random.default_rng(5).uniform(-1.0, 1.0, (200, 6)) * [60, 60, 60, 10, 10, 10]
    pose[:, 2] += 1e3 * machine.default_origin[2]
    lengths = solve_struts(machine, pose[:, :3] / 1e3, rotation_matrices(np.deg2rad(pose[:, 3:]))).lengths
    near(1e3 * lengths, [module.inverse(p, 6) for p in pose])
    found = forward_kinematics(machine, lengths) * np.repeat([1e3, 180.0 / np.pi], 3)
    with suppress(AssertionError):
        module.forward(1e3 * lengths[0], pose[0])  # its first call says no, whatever it is given
    near(found, [module.forward(length, p) for length, p in zip(1e3 * lengths, pose + 0.5, strict=True)])


def test_rotarydeltakins(folder):
    machine = KINDS["arms"]
    sizes = {"platformradius": 180, "thighlength": 320, "shinlength": 830, "footradius": 120}
    module = Module("rotarydeltakins", {f"rotarydeltakins.{pin}": value for pin, value in sizes.items()}, folder)
    pose = np.random.default_rng(9).uniform(-1.0, 1.0, (200, 6)) * [250, 250, 100, 0, 0, 0]
    pose[:, 2] += 1e3 * machine.default_origin[2]
    joints = machine.solve(pose[:, :3] / 1e3).joints
    height = np.array([0.0, 0.0, 95.0, 0.0, 0.0, 0.0])  # LinuxCNC's z is the joints' height
    near(np.rad2deg(joints), [module.inverse(p + height, 3) for p in pose])
    position, _ = machine.forward(joints)
    near(1e3 * position, [(module.forward(j) - height)[:3] for j in np.rad2deg(joints)])


def test_a_cantilever_with_an_arm_is_the_closed_form():
    beam = """
name = "cantilever"
kind = "serial"
[limits]
X_mm = [-1.0, 1.0]
Y_mm = [-1.0, 1.0]
Z_mm = [-1.0, 1.0]
[[element]]
name = "beam"
type = "beam"
from_mm = [-1600.0, 0.0, 0.0]
to_mm = [-400.0, 0.0, 0.0]
z_axis = [0.0, 0.0, 1.0]
EA_MN = 800.0
EIy_MNm2 = 5.0
EIz_MNm2 = 2.0
GJ_MNm2 = 3.0
"""
    compliance = parse_machine(beam).solve([[0.0, 0.0, 0.0]]).tip_compliance()[0]
    length, arm = 1.2, 0.4
    along = {1: 2e6, 2: 5e6}
    for axis, ei in along.items():
        expected = (length**3 / 3.0 + length**2 * arm + length * arm**2) / ei
        assert compliance[axis, axis] == pytest.approx(expected, rel=1e-12)
        slope = (length**2 / 2.0 + length * arm) / ei
        assert abs(compliance[axis, {1: 5, 2: 4}[axis]]) == pytest.approx(slope, rel=1e-12)
    assert 1e9 * compliance[2, 2] == pytest.approx(268.8, rel=1e-12)
    np.testing.assert_allclose(np.diag(compliance)[[0, 3, 4, 5]], np.array([1 / 800, 1 / 3, 1 / 5, 1 / 2]) * 1.2e-6)


def axis(name: str, kind: str, side: str = "tool", **more: object) -> str:
    unit = "mm" if kind == "linear" else "deg"
    keys = {"name": name, "type": kind, "side": side, **more}
    rows = "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())
    return f"[[axis]]\n{rows}min_{unit} = {more.get('low', -3000)}\nmax_{unit} = {more.get('high', 3000)}\n".replace(
        f"low = {more.get('low')}\n", ""
    ).replace(f"high = {more.get('high')}\n", "")


JOINTS = '[[element]]\nname = "joints"\ntype = "joint"\ntorsion_nrad_per_Nm = 400.0\nbending_nrad_per_Nm = 90.0\n'
RIGHT = [-90, 0, 90]
HEAD_TABLE = 'name = "bridge"\nkind = "serial"\n' + JOINTS + "".join(
    [
        axis("Y", "linear", axis=[0, 1, 0]),
        axis("X", "linear", axis=[1, 0, 0]),
        axis("Z", "linear", axis=[0, 0, 1]),
        axis("B", "rotary", axis=[0, 0.6, 0.8], xyz_mm=[0, 30, 220], low=-170, high=170),  # nutated by 53 degrees
        axis("C", "rotary", "work", axis=[0, 0, -1], xyz_mm=[400, 100, -300]),
    ]
) + "[tool]\ntip_mm = [10.0, 0.0, -260.0]\n[work]\nxyz_mm = [0.0, 0.0, 80.0]\n"  # fmt: skip
UR = 'name = "offset wrist"\nkind = "serial"\nconvention = "standard DH"\n' + JOINTS + "".join(
    f'[[axis]]\nname = "J{i}"\ntype = "R"\nalpha_deg = {alpha}\na_mm = {a}\nd_mm = {d}\nmin_deg = -180\nmax_deg = 180\n'
    for i, (alpha, a, d) in enumerate(  # Universal Robots' published rows of the UR10
        [(90, 0, 127.3), (0, -612, 0), (0, -572.3, 0), (90, 0, 163.941), (-90, 0, 115.7), (0, 0, 92.2)], 1
    )
)  # fmt: skip
RAIL = (DATA / "robot200.toml").read_text().split("[[pose]]")[0].replace(
    "[[axis]]                       # modified",
    axis("E1", "linear", axis=[0, 1, 0], low=0, high=4000) + "[[axis]] # modified",
).replace('at = "base"', 'frame = "E1"\ncentre_mm = [0, 0, 0]')  # fmt: skip
UR_ON_RAIL = UR.replace("[[axis]]", axis("E1", "linear", axis=[0, 1, 0], low=0, high=4000) + "[[axis]]", 1)
GLIDE = """
name = "glide"
kind = "hexaglide"
[feet]
mm = [[0, 300, 0], [0, 330, 0], [0, -300, 0], [0, -330, 0], [0, 360, 0], [0, -360, 0]]
rails = [[1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]]
sides = [1, -1, 1, -1, 1, -1]
min_mm = -1500
max_mm = 1500
translation_nm_per_N = [20.0, 3.0, 2.0]
rotation_nrad_per_Nm = [0.0, 0.0, 0.0]
[platform_joints]
mm = [[90, 80, 250], [-90, 80, 250], [80, -90, 260], [-80, -90, 260], [30, 140, 240], [-30, -150, 245]]
[strut]
length_mm = 900
compliance_nm_per_N = 12.0
[setup]
default_origin_mm = [0.0, 0.0, -850.0]
rapid_mm_per_min = 20000
"""
ARMS = (DATA / "delta.toml").read_text().split("[[pose]]")[0].replace('kind = "linear_delta"', 'kind = "rotary_delta"')
for _old, _new in (
    (r"carriage_joint_radius_mm = \S+", "hip_radius_mm = 180.0"),
    (r"carriage_mm = .*", "arm_deg = [-50.0, 85.0]"),
    (r"\[carriage\]", "[arm]"),
    (r"rail_radius_mm = .*", "length_mm = 320.0"),
    (r"centre_height_mm = .*", ""),
):
    ARMS = re.sub(_old, _new, ARMS)
KINDS = {
    **MACHINES,
    **{
        name: parse_machine(text)
        for name, text in (("head", HEAD), ("table", HEAD_TABLE), ("rail", RAIL), ("glide", GLIDE), ("arms", ARMS))
    },
    "offset wrist": parse_machine(UR),
}


def poses(name: str, share: np.ndarray, joints: np.ndarray):
    """Poses of a machine from numbers of -1 to 1: by joint values of a chain, by places of the others."""
    machine = KINDS[name]
    if machine.kind == "serial":
        low, high = np.clip(machine.joint_limits, -3.0, 3.0).T
        joints = low + (high - low) * 0.5 * (joints[:, : len(low)] + 1.0)
        return machine.forward(np.where(np.array(machine.joint_names) == "E1", 0.0, joints))  # a rail stands still
    flat = [0.2, 0.2, 0.1, 0, 0, 0]
    size = {"delta": flat, "arms": flat, "pentapod": [0.2, 0.2, 0.1, 0.3, 0.3, 0]}.get(name, [0.1] * 6)
    pose = share * size + machine.default_origin
    return pose[:, :3], machine.rotation_of(pose[:, 3:])


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_forward_undoes_inverse_with_any_tool(name, seed):
    rng, machine = np.random.default_rng(seed), KINDS[name].with_changes(reference_tool_length=0.1)
    n = 2 if name == "offset wrist" else 8  # each is searched from many starts
    position, rotation = poses(name, rng.uniform(-1, 1, (n, 6)), rng.uniform(-0.95, 0.95, (n, 7)))
    tool = 0.1 + rng.uniform(0.0, 0.05 if n == 8 else 0.0, n)
    stance = machine.solve(position, rotation, tool)
    reached = np.isfinite(stance.joints).all(axis=1)
    start = {"start": np.column_stack([position, roll_pitch_yaw(rotation)])[reached]} if name == "glide" else {}
    if name == "pentapod":
        start = {"start": np.column_stack([position, roll_pitch_yaw(rotation)[:, :2]])[reached]}
    again = machine.forward(stance.joints[reached], tool[reached], **start)
    # A longer tool leaves some out of reach of a chain; a search finds all that there are.
    assert reached.sum() >= (n // 2 if machine.kind == "serial" and n == 8 else n)
    np.testing.assert_allclose(again[0], position[reached], atol=1e-9)
    np.testing.assert_allclose(again[1], rotation[reached], atol=1e-9)


MOVED = {
    "joint ": 5,
    "carriage ": 2,
    "foot ": 0,
    "strut ": 0,
    "arm ": 4,
}  # the load of an element that its joint works against


@pytest.mark.parametrize("name", [name for name in KINDS if name not in ("mill5", "mill3", "head")])
def test_elements_carry_what_virtual_work_says(name):
    """Load per unit force at the tip = motion of the tip per motion of the joint, by differences of `forward`."""
    machine, rng = KINDS[name], np.random.default_rng(3)
    position, rotation = poses(name, rng.uniform(-0.5, 0.5, (1, 6)), rng.uniform(-0.5, 0.5, (1, 7)))
    stance = machine.solve(position, rotation)
    pose = np.column_stack([position, roll_pitch_yaw(rotation)])
    start = {"glide": {"start": pose}, "pentapod": {"start": pose[:, :5]}}.get(name, {})
    tried = 0
    for element, load in zip(machine.elements, stance.loads, strict=True):
        joint = element.name.replace("joint ", "J" if name in ("robot200", "rail", "offset wrist") else "")
        row = next((row for word, row in MOVED.items() if element.name.startswith(word)), None)
        if row is None or joint not in machine.joint_names:
            continue
        ends = []
        for change in (1e-6, -1e-6):
            moved = stance.joints.copy()
            moved[0, machine.joint_names.index(joint)] += change
            ends.append(machine.forward(moved, **start)[0][0])
        slope = (ends[0] - ends[1]) / 2e-6  # of the tip in work axes
        slope = slope if stance.work_axes is None else stance.work_axes[0] @ slope
        force = load.rows(stance.position)[0, row, :3]
        np.testing.assert_allclose(force * np.sign(force @ slope), slope, atol=1e-8)
        tried += 1
    assert tried == {"table": 2, "pentapod": 5, "delta": 3, "arms": 3}.get(name, 6)


@pytest.mark.parametrize(("arm", "text"), [("robot200", RAIL), ("offset wrist", UR_ON_RAIL)])
def test_a_rail_stays_where_it_is_put(arm, text):
    """At 0, where the file says or where it starts; its own limits bound nothing."""
    bare, q = KINDS[arm], np.deg2rad([[5.0, 12.0, 45.0, -30.0, -60.0, -165.0]])
    position, rotation = bare.forward(q)
    expected = bare.solve(position, rotation, configuration=0, start=q[0])
    for place, stands, start in ((0.0, "", None), (1.5, "stands_mm = 1500.0", None), (0.7, "", 0.7)):
        machine = parse_machine(text.replace("max_mm = 4000", f"max_mm = 4000\n{stands}"))
        assert machine.standing_joints == {"E1": place if start is None else 0.0}
        first = None if start is None else np.array([start, *q[0]])
        there = position + np.array([0.0, place, 0.0])
        stance = machine.solve(there, rotation, configuration=0, start=first)
        assert stance.joints[0, 0] == place
        assert not any("E1" in limit.name for limit in machine_limits(machine))
        np.testing.assert_allclose(machine.forward(stance.joints)[0], there, atol=1e-9)
        if start is not None:
            np.testing.assert_allclose(stance.joints[0, 1:], expected.joints[0], atol=1e-9)
            np.testing.assert_allclose(stance.tip_compliance(), expected.tip_compliance(), rtol=1e-8, atol=1e-16)
    with pytest.raises(InputError, match=r"stands_mm = 9000; expected 0 to 4000"):
        parse_machine(text.replace("max_mm = 4000", "max_mm = 4000\nstands_mm = 9000"))


def test_joints_wind_on_along_a_path():
    machine = MACHINES["robot200"]
    joints = np.deg2rad([[5.0, 12.0, 45.0, -30.0, -60.0, 0.0]]) + np.zeros((80, 1))
    joints[:, 5] = np.linspace(-6.0, 6.0, 80)
    position, rotation = machine.forward(joints)
    there = [machine.solve(position, rotation, configuration=c, start=joints[0]).joints for c in range(8)]
    assert min(np.abs(values - joints).max() for values in there) < 1e-9
    each = [machine.solve(position, rotation, configuration=c).joints for c in range(8)]
    assert min(np.nanmax(np.abs(np.diff(values[:, 5]))) for values in each) > 6.0


def test_a_chain_without_closed_form_has_all_its_solutions():
    machine = KINDS["offset wrist"]  # such arms have up to eight (Hawkins, 2013)
    joints = np.array([[0.3, -1.1, 1.4, -0.6, 0.9, 0.4]])
    position, rotation = machine.forward(joints)
    solutions = all_solutions(machine.tool_joints, machine.tool_frames, position[0], rotation[0])
    assert len(solutions) == 8 and np.abs(solutions - joints).max(axis=1).min() < 1e-9
    for values in solutions:
        again = machine.forward(values[None])
        np.testing.assert_allclose(again[0], position, atol=1e-10)


BAD = [
    ("robot200", "a_mm = 1120.0", "a_mm = 1120.0\nlength = 3", "length"),
    ("robot200", "min_deg = -65.0\n", "", "[[axis]] 2 min_deg is missing"),
    ("robot200", "alpha_deg = -90.0", "alpha_deg = -1.5707963", "right angle in radians; expected degrees: -90"),
    ("robot200", "x_axis = [0.0, 0.0, 1.0]", "x_axis = [0.0, 0.0, 1.0]\ny_axis = [0.0, -1.0, 0.0]", "mirrored"),
    ("robot200", "x_axis = [0.0, 0.0, 1.0]", "x_axis = [0.0, 0.6, 0.8]\ny_axis = [1.0, 0.0, 0.0]", "not square"),
    ("robot200", "x_axis = [0.0, 0.0, 1.0]", "x_axis = [0.0, 0.0, 0.5]", "no unit vectors"),
    ("robot200", 'frame = "J3"', 'frame = "J9"', "one of J1, J2"),
    ("robot200", 'name = "J2"', 'name = "J1"', "twice"),
    ("robot200", 'type = "beam"', 'type = "bean"', "spring, joint, beam"),
    ("robot200", "GJ_MNm2 = 6.5", "", "GJ_MNm2 is missing"),
    ("robot200", "340.0, 460.0, 1900.0, 2300.0, 4800.0]", "340.0]", "2 numbers; expected 6, one a rotary joint"),
    ("robot200", "max_deg = 85.0", "max_deg = -85.0", "more than min_deg = -65"),
    ("mill5", "X_mm = [-300.0, 300.0]\n", "", "[limits] X_mm is missing"),
    ("mill5", 'moves_with = ["Y", "X"]', 'moves_with = ["X"]', "moves_with"),
    ("mill5", 'convention = "linuxcnc xyzac-trt-kins"', 'convention = "heidenhain"', "xyzbc-trt-kins"),
    ("mill5", 'centre = "C"', 'centre = "B"', "one of A, C"),
    ("mill3", "EIz_MNm2 = 140.0", "EIz_MNm2 = 0.0", "above 0"),
    ("pentapod", "strut = 5", "strut = 6", "at most 5"),
    ("pentapod", "max_mm = 2200.0", "max_mm = 700.0", "min below max"),
    ("pentapod", "[1100.0, -670.0, 790.0], ", "", "5 rows of 3"),
    ("delta", "rod_length_mm = 830.0", "rod_length_mm = 0.83", "do not reach"),
    ("delta", "carriage_mm = [500.0, 1300.0]", "", "carriage_mm is missing"),
]  # fmt: skip


HEADS = [
    ('name = "B"', 'name = "B1"', "rotary axis 'B1'; expected A, B or C"),
    ("axis = [0, -1, 0]", "axis = [0, 0, -1]", "C and B turn about the same direction"),
    ("axis = [0, 1, 0]", "axis = [0, -1, 0]", "X, Y, Z are mirrored"),
    ("axis = [0, 1, 0]", "axis = [1, 0, 0]", "do not reach all places"),
    (
        'name = "Z"\ntype = "linear"',
        'name = "A"\ntype = "rotary"',
        "m(ax|in)_mm: the axis is rotary",
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), HEADS)
def test_axes_that_cannot_be_are_refused(old, new, words):
    assert old in HEAD
    with pytest.raises(InputError, match=words):
        parse_machine(HEAD.replace(old, new, 1))


@pytest.mark.parametrize(("name", "old", "new", "words"), BAD)
def test_a_bad_description_is_one_line_that_names_it(name, old, new, words):
    text = (DATA / f"{name}.toml").read_text()
    assert old in text
    with pytest.raises(InputError) as error:
        parse_machine(text.replace(old, new, 1), file="mine.toml")
    assert words in str(error.value) and "\n" not in str(error.value) and str(error.value).startswith("mine.toml:")


def test_limits_of_all_axes_in_radians_are_refused():
    text = re.sub(r"(m(?:in|ax)_deg) = (\S+)", lambda m: f"{m[1]} = {np.deg2rad(float(m[2])):.6f}",
                  (DATA / "robot200.toml").read_text())  # fmt: skip
    with pytest.raises(InputError, match="are these radians"):
        parse_machine(text)
    metres = re.sub(
        r"(a|d)_mm = (\S+)", lambda m: f"{m[1]}_mm = {float(m[2]) / 1e3}", (DATA / "robot200.toml").read_text()
    )
    with pytest.raises(InputError, match="lengths in mm, not m"):
        parse_machine(metres.replace("tip_mm = [250.0, 0.0, 140.0]", "tip_mm = [0.25, 0.0, 0.14]"))


@pytest.mark.parametrize(("name", "letter"), [("mill3", "A"), ("mill5", "B"), ("delta", "C"), ("pentapod", "C")])
def test_a_word_of_a_missing_axis_is_refused(name, letter):
    words = np.zeros((3, 3))
    words[1, "ABC".index(letter)] = 0.1
    with pytest.raises(InputError, match=f"machine {name} has no axis {letter}"):
        MACHINES[name].rotation_of(words)


def test_a_mill_without_an_axis_does_not_tilt_its_tool():
    stance = MACHINES["mill3"].solve([[0.0, 0.0, 0.2]] * 2, rotation_matrices([[0, 0, 0], [0.3, 0, 0]]))
    assert np.isfinite(stance.joints).all(axis=1).tolist() == [True, False]


MASSES = (("J2", 160.0, [560.0, 0.0, 0.0]), ("J3", 120.0, [95.0, 630.0, 0.0]), ("J6", 45.0, [0.0, 0.0, 90.0]))


def test_the_weight_on_joints_is_the_slope_of_its_work():
    """The moment about each axis by what the height of the masses gains for a small turn (virtual work)."""
    rows = "".join(
        f'[[mass]]\nname = "{frame}"\nkg = {kg}\nframe = "{frame}"\ncentre_mm = {place}\n'
        for frame, kg, place in MASSES
    )
    machine = parse_machine((DATA / "robot200.toml").read_text() + rows)
    q = np.deg2rad([[10.0, 30.0, 20.0, 40.0, -60.0, 15.0]])
    stances = [machine.solve(*machine.forward(q), configuration=i) for i in range(8)]
    loads = machine.weight_loads(next(s for s in stances if np.allclose(s.joints, q, atol=1e-9)))[0].reshape(-1, 6)
    about_z = [row[5] for row, element in zip(loads, machine.elements, strict=True) if element.link == "joints"]

    def energy(joints: np.ndarray) -> float:
        frames = machine.frames(joints.T)[0]
        return sum(kg * 9.80665 * frames[int(name[1])].point(np.array(place) / 1e3)[2] for name, kg, place in MASSES)

    steps = 1e-6 * np.eye(6)[:, None]
    slopes = [(energy(q + step) - energy(q - step)) / 2e-6 for step in steps]
    np.testing.assert_allclose(about_z, np.negative(slopes), rtol=1e-6, atol=1e-5)
