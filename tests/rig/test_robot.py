"""Exercises on invented robots: the frame of the rig against the sum over elements, seals, claims."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.conftest import as_written
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.rig.robot import FAULTS, frames, invented, machine_text, pulled, robot_case

SOUND = robot_case(3, "none", 0.0)[1]
JOINTS = np.deg2rad([[5.0, 12.0, 35.0, -30.0, -60.0, -165.0], [-20.0, 5.0, 40.0, 45.0, -55.0, 130.0]])


@pytest.mark.parametrize("seed", [1, 2])
def test_the_frame_gives_what_the_elements_of_its_file_give(seed):
    robot = invented(as_written(seed))
    machine = parse_machine(machine_text(robot, "arm"))
    position, rotation = machine.forward(JOINTS)
    np.testing.assert_allclose(frames(robot, JOINTS)[1][:, 6], position, atol=1e-12)
    forces = np.array([[300.0, -200.0, 500.0]] * 2)
    for i in range(2):
        near = [machine.solve(position, rotation, configuration=c) for c in range(8)]
        stance = min(near, key=lambda s: np.abs(np.sin(0.5 * (s.joints[i] - JOINTS[i]))).max())
        expected = stance.tip_compliance()[i, :3, :3] @ forces[i]
        # What is rigid in the frame gives a thousandth of a nm/N.
        np.testing.assert_allclose(pulled(robot, JOINTS, forces)[i], expected, atol=5e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_moves_the_readings_by_its_share(name):
    text, table, truth = robot_case(3, name, 0.0)
    moved, before = (np.column_stack([t[f"u{axis}_um"] for axis in "xyz"]) for t in (table, SOUND))
    size = truth["effects"][0]["size"]
    assert 0.08 <= size < 0.26 or name == "backlash"  # a gap that the weight holds closed moves little
    assert np.linalg.norm(moved - before) / np.linalg.norm(before) == pytest.approx(size, abs=2e-3)  # 1 um of noise
    assert truth["kind"] == ("one" if FAULTS[name][0] else "outside") and parse_machine(text).name == "robot3"


def test_an_exercise_is_sealed_and_scored(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["rig", "new", "--seed", "5", "--built", "serial", "--hidden", "joint_torsion", "--out", "blind"]) == 0
    assert re.search(r"144 pulls", capsys.readouterr().out)
    assert main(["rig", "reveal", "blind", "--claim", "weak_element"]) == 0
    assert "right" in capsys.readouterr().out
    assert main(["rig", "reveal", "blind", "--claim", "outside"]) == 0
    assert "wrong" in capsys.readouterr().out
    (tmp_path / "plan.csv").write_text("x_mm,y_mm,z_mm,direction\n0,0,0,X\n")
    assert main(["rig", "measure", "blind", "--at", "plan.csv", "--out", "more.csv"]) == 2
    assert "a robot is pulled once" in capsys.readouterr().err
    assert main(["rig", "new", "--seed", "5", "--built", "serial", "--layout", "paper", "--out", "other"]) == 2
    with pytest.raises(InputError, match="nothing called"):
        robot_case(3, "gremlins", 0.02)
