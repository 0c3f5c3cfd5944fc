"""What the viewer draws of a machine: bodies in work axes, its tip where the pose says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.browser import needs_browser, painted
from toolpath_stiff.report.scene import machine_scene, reach_boundary

MACHINES = Path(__file__).parents[1] / "machine" / "data"


@pytest.mark.parametrize(("name", "turn", "there"), [("robot200", (0.1, -0.2, 0.3), 2), ("mill5", (0.3, 0.0, 0.5), 3)])
def test_the_tool_ends_at_the_pose_in_work_axes(name, turn, there):
    machine = tps.Machine.load(MACHINES / f"{name}.toml").model.machine
    poses = np.array([machine.default_origin] * 3)
    poses[1, :3] += 0.02
    poses[1, 3:] = turn
    poses[2, :3] += 50.0  # no arm is that long; slides only have limits
    scene = machine_scene(machine, poses)
    names = [body["name"] for body in scene["bodies"]]
    assert len(scene["poses"]) == len(scene["frames"]) == there
    for pose, frame in zip(poses, scene["frames"], strict=False):
        assert frame[names.index("tool")][1] == pytest.approx(1000 * pose[:3], abs=0.06)
        assert frame[names.index("tool")][0] != frame[names.index("tool")][1]
    ends = np.array([frame[names.index("tool")] for frame in scene["frames"]])
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert lengths == pytest.approx(np.full(there, lengths[0]), abs=0.2)


def test_the_reach_is_that_of_the_rays():
    machine = tps.Machine.load("nist")
    boundary = np.array(reach_boundary(machine.model.machine))
    assert boundary[0, 0, 2] == pytest.approx(800 - machine.reach_mm((0, 0, 800), [(0, 0, -1)])[0], abs=0.06)
    assert boundary[4, 0, 0] == pytest.approx(machine.reach_mm((0, 0, 800), [(1, 0, 0)])[0], abs=0.06)


@needs_browser
@pytest.mark.parametrize("name", ["nist", MACHINES / "robot200.toml", MACHINES / "mill5.toml", MACHINES / "delta.toml"])
def test_the_page_draws_machines_of_every_kind(name, tmp_path):
    page = tps.Machine.load(name).page()
    assert not re.search(r"https?://|//[a-z]+\.|@import|url\(|fetch\(|XMLHttpRequest|import\(", page)
    assert len(painted(page, tmp_path)["view"]) > 200  # shades
