"""Effects of the geometry of chains, against the rig's own robot: frames of 4x4 matrices, no sum over elements."""

from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import as_written
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.element_fits import NO_LAW, PullProblem
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.file import load_machine, parse_machine
from toolpath_stiff.machine.serial import Serial
from toolpath_stiff.readings.pulls import read_pulls
from toolpath_stiff.rig.exercise import csv_text
from toolpath_stiff.rig.robot import GRAVITY, HANGING, frames, invented, machine_text, pulled, robot_case
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.model import build_model, load_path, path_of_stance

ROBOT = invented(as_written(4))
MACHINE = parse_machine(machine_text(ROBOT, "arm"))
Q = np.deg2rad([[5.0, 12.0, 35.0, -30.0, -60.0, -165.0], [-20.0, 5.0, 40.0, 45.0, -55.0, 130.0]])


def active(name: str, **values: object) -> ActiveEffect:
    return ActiveEffect(find_effect(name), values)


def standing(effect: ActiveEffect, machine: Serial = MACHINE, joints: np.ndarray = Q) -> Stance:
    """How it truly stands where its control believes these joints."""
    return path_of_stance(build_model(machine, extra=[effect]), machine.standing(joints)).stance


def longer(joint: int, by: float) -> object:
    """The rig's arm with the link before a joint longer along the line between the origins, a and d together."""
    rows = ROBOT.rows.copy()
    length = np.hypot(rows[joint, 1], rows[joint, 3])
    rows[joint, [1, 3]] *= 1.0 + by / length
    return replace(ROBOT, rows=rows)


def weight_turns(q: np.ndarray) -> np.ndarray:
    """(n, 6) rad: each joint's torsion times the slope of the masses' height over its value, in the rig's frames."""
    masses = (160.0, 120.0, 45.0)  # as the machine file has them

    def energy(joints: np.ndarray) -> np.ndarray:
        origins = frames(ROBOT, joints)[1]
        middles = [0.5 * (origins[:, a, 2] + origins[:, b, 2]) for a, b in HANGING]
        return sum(m * GRAVITY * z for m, z in zip(masses, middles, strict=True))

    step = 1e-5
    slopes = [(energy(q + step * e) - energy(q - step * e)) / (2 * step) for e in np.eye(6)]
    return -ROBOT.torsion * np.stack(slopes, axis=1)


def test_sag_turns_joints_by_torsion_times_the_slope_of_the_weights_work():
    stance = MACHINE.standing(Q)
    sagged = standing(active("gravity_sag", share=1.0))
    # The file's spindle hangs at the middle of the tool, turned with the flange as in the rig; g to 4 digits.
    np.testing.assert_allclose(sagged.joints - Q, weight_turns(Q), rtol=1e-3, atol=2e-6)
    drop = sagged.position[:, 2] - stance.position[:, 2]
    assert (drop < -0.5e-3).all() and (drop > -10e-3).all()
    half = standing(active("gravity_sag", share=0.5))
    np.testing.assert_allclose(half.joints - Q, 0.5 * (sagged.joints - Q), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_a_longer_link_is_the_rigs_arm_with_a_longer_link(joint):
    effect = active("link_length_error", element=f"joint {joint + 1}", error=3e-3)
    stance = standing(effect)
    rig = longer(joint, 3e-3)
    np.testing.assert_allclose(stance.position, frames(rig, Q)[1][:, 6], atol=1e-12)
    force = np.array([[300.0, -200.0, 500.0]] * 2)
    stiff = 1e4 * ROBOT.arms  # a beam stays as long as the file has it
    moved = pulled(replace(rig, arms=stiff), Q, force)
    machine = parse_machine(machine_text(replace(ROBOT, arms=stiff), "stiff"))
    ours = standing(effect, machine).tip_compliance()[:, :3, :3]
    np.testing.assert_allclose(np.einsum("nij,nj->ni", ours, force), moved, atol=2e-5 * np.abs(moved).max())


def test_a_joint_off_its_zero_stands_where_the_rig_does():
    effect = active("joint_zero_error", element="joint 3", error=np.deg2rad(0.4))
    stance = standing(effect)
    turned = Q + np.deg2rad(0.4) * np.eye(6)[2]
    np.testing.assert_allclose(stance.position, frames(ROBOT, turned)[1][:, 6], atol=1e-12)


def test_a_program_runs_on_the_geometry_that_the_control_does_not_know():
    model = build_model(MACHINE, extra=[active("joint_zero_error", element="joint 2", error=np.deg2rad(0.5))])
    position, rotation = MACHINE.forward(Q)
    path = load_path(model, position, rotation)
    believed = MACHINE.solve(position, rotation).joints
    np.testing.assert_allclose(path.stance.joints - believed, [[0.0, np.deg2rad(0.5), 0, 0, 0, 0]] * 2, atol=1e-12)
    assert (np.linalg.norm(path.position - position, axis=1) > 2e-3).all()


def test_pulls_see_an_error_of_the_geometry_once(tmp_path):
    """In the machine file or as a candidate it changes the readings alike; half a degree by a few per cent."""
    text, table, _ = robot_case(4, "none", 0.0)
    (tmp_path / "pulls.csv").write_text(csv_text(table))
    entry = '\n[[effect]]\nname = "joint_zero_error"\nelement = "joint 2"\nerror_deg = 0.5\n'
    plain, inside = parse_machine(text), parse_machine(text + entry)
    problems = [PullProblem(build_model(m), read_pulls([str(tmp_path / "pulls.csv")], m)) for m in (plain, inside)]
    change = problems[0].residual(NO_LAW, [active("joint_zero_error", element="joint 2", error=np.deg2rad(0.5))])
    np.testing.assert_allclose(change, problems[1].observed, atol=1e-12)
    apart = np.abs(change - problems[0].observed).max()
    assert 1e-4 < apart < 0.05


def test_what_is_no_joint_is_refused():
    with pytest.raises(InputError, match="'foot' is no joint"):
        standing(active("joint_zero_error", element="foot", error=0.01))
    mill = load_machine("tests/machine/data/mill3.toml")
    joints = np.array([[0.0, 0.0, 0.12]])
    assert standing(active("gravity_sag", share=1.0), mill, joints).joints == pytest.approx(joints)
