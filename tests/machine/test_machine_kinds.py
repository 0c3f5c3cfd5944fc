"""Kinds of machines against published check values, LinuxCNC's kinematics modules, and laws."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.machine.linuxcnc_kinematics import Module
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.chain import STILL
from toolpath_stiff.machine.file import load_machine, parse_machine
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


HEAD = """
name = "head"
kind = "serial"
[tool]
tip_mm = [0.0, 0.0, -250.0]
[[element]]
name = "spindle"
type = "spring"
at = "tip"
translation_nm_per_N = [9.0, 9.0, 3.5]
rotation_nrad_per_Nm = [0.0, 0.0, 0.0]
""" + "".join(
    f'[[axis]]\nname = "{name}"\ntype = "{kind}"\naxis = {axis}\nxyz_mm = {place}\nmin_{unit} = -inf\nmax_{unit} = inf\n'
    for name, kind, axis, place, unit in (
        ("X", "linear", [1, 0, 0], [0, 0, 0], "mm"),
        ("Y", "linear", [0, 1, 0], [0, 0, 0], "mm"),
        ("Z", "linear", [0, 0, 1], [0, 0, 0], "mm"),
        ("C", "rotary", [0, 0, 1], [0, 0, 250], "deg"),
        ("B", "rotary", [0, -1, 0], [0, 0, 0], "deg"),
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
