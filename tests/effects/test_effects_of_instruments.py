"""Instruments that mislead, against solves that share nothing with the effects."""

from __future__ import annotations

import numpy as np
import pytest

from tests.effects.cases import model_with, readings
from tests.effects.test_effect_laws import directions
from tests.stiffness.cases import nist, random_poses
from toolpath_stiff.stiffness.model import load_path


def rigid_body(position, rotation):
    """(6, 6) stiffness of six springs about the tip, from joints and the strut law alone."""
    machine = nist()
    platform = position + machine.platform_joints @ rotation.T
    stiffness = np.zeros((6, 6))
    for foot, head in zip(machine.frame_joints, platform, strict=True):
        strut = foot - head
        length = float(np.linalg.norm(strut))
        line = np.concatenate([strut, np.cross(head - position, strut)]) / length
        stiffness += float(machine.strut_law.stiffness(np.array([length]))[0]) * np.outer(line, line)
    return stiffness


@pytest.mark.parametrize("loaded_above", [False, True])
def test_an_indicator_above_the_tip_reads_the_point_that_it_touches(loaded_above):
    """And a load above the tip, read at the tip, shows the same (Maxwell and Betti)."""
    height, (position, rotation), along = 0.05, random_poses(6, 31), directions(6, 32)
    shown = readings(model_with("indicator_off_tip", height=height), position, along, rotation)
    for k in range(6):
        above = height * rotation[k, :, 2]
        arms = (above, np.zeros(3)) if loaded_above else (np.zeros(3), above)
        load = np.concatenate([along[k], np.cross(arms[0], along[k])])
        twist = np.linalg.solve(rigid_body(position[k], rotation[k]), load)
        read = (twist[:3] + np.cross(twist[3:], arms[1])) @ along[k]
        assert shown[k] == pytest.approx(1.0 / read, rel=1e-9)


def test_a_curved_load_cell_scales_every_reading_by_its_load():
    position, rotation = random_poses(4, 33)
    along = directions(4, 34)
    model = model_with("load_cell_curvature", curvature=2e-5)
    for force in (500.0, 4000.0):
        plain = readings(model_with(), position, along, rotation, force=force)
        assert readings(model, position, along, rotation, force=force) == pytest.approx(plain * (1.0 + 2e-5 * force))


def test_a_stand_that_tilts_is_read_as_a_table_that_does():
    """Sideways by the square of the height, as a table that rocks; a horizontal load on the axis tells nothing."""
    position = np.array([[0.0, 0.0, 0.6], [0.0, 0.0, 1.0]])
    along = np.tile([0.6, 0.8, 0.0], (2, 1))
    stand = model_with("stand_compliance", sideways=2e-9, tilting=3e-9)
    table = model_with("table_compliance", x=2e-9, y=2e-9, rocking=3e-9)
    assert readings(stand, position, along) == pytest.approx(readings(table, position, along), rel=1e-12)
    plain = readings(model_with(), position, along)
    added = 1.0 / readings(stand, position, along) - 1.0 / plain
    assert added == pytest.approx([2e-9 + 3e-9 * 0.36, 2e-9 + 3e-9], rel=1e-9)


def test_the_work_of_the_vertices_is_the_frames():
    """What six pulls do at the shifted vertices is what the tip's load does: virtual work."""
    values = {"sideways": 2e-9, "vertical": 1e-9}
    model = model_with("frame_sway", **values)
    active = model.effects[-1]
    position, rotation = random_poses(5, 35)
    path = load_path(model, position, rotation)
    load, jacobian = directions(5, 36), path.struts.jacobian
    wrench = np.concatenate([load, np.zeros((5, 3))], axis=1)
    forces = np.linalg.solve(np.swapaxes(jacobian, 1, 2), wrench[..., None])[..., 0]
    form = active.effect.load_compliance(path, active.values)
    at_tip = np.einsum("ni,nij,nj->n", load, form[:, 6:9, 6:9], load)
    pulls = forces[..., None] * path.struts.directions
    work = np.zeros(5)
    for vertex, (first, second) in enumerate(((0, 1), (2, 3), (4, 5)), start=1):
        moved = active.effect.vertex_displacement(path, active.values, forces, vertex)
        work += np.einsum("ni,ni->n", pulls[:, first] + pulls[:, second], moved)
    assert work == pytest.approx(at_tip, rel=1e-9)


def test_where_nobody_says_how_long_the_tool_is_it_does_not_bend():
    machine = nist().with_changes(reference_tool_length=0.0)
    position, rotation = random_poses(3, 37)
    plain = readings(model_with(machine=machine), position, directions(3, 38), rotation)
    bent = readings(model_with("tool_bending", machine, compliance=5e-9), position, directions(3, 38), rotation)
    assert (bent == plain).all()
