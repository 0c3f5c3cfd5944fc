"""Spindle, frame, table, set-up, geometry, instruments against assembled springs and other ways to a figure."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pytest
from scipy.linalg import eigh

from tests.effects.cases import model_with, readings
from tests.stiffness.cases import compliance_of_wrenches, nist, orthogonal_hexapod, random_poses
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.stiffness.core import tip_compliance
from toolpath_stiff.stiffness.effects.frame_compliance import frame_vertices
from toolpath_stiff.stiffness.model import build_model, load_path

NIST_TEXT = (resources.files("toolpath_stiff") / "data" / "machines" / "nist.toml").read_text("utf-8")


def added(name, position, rotation, **values):
    """(n, 3, 3) what the effect adds to the tip compliance."""
    with_it, without = model_with(name, **values), model_with()
    return tip_compliance(with_it, position, rotation) - tip_compliance(without, position, rotation)


def test_spindle_gives_way_along_and_across_the_tool():
    position, rotation = random_poses(6, 31)
    tensor = added("spindle_compliance", position, rotation, radial=5e-9, axial=2e-9)
    across, axis = rotation[:, :, 0], rotation[:, :, 2]
    assert np.einsum("nij,nj->ni", tensor, axis) == pytest.approx(2e-9 * axis, abs=1e-18)
    assert np.einsum("nij,nj->ni", tensor, across) == pytest.approx(5e-9 * across, abs=1e-18)


# The vertices of the NIST machine by its documentation: struts 1, 2 at 60 degrees, 3, 4 at 180, 5, 6 at 300.
VERTEX_OF = np.array([0, 0, 1, 1, 2, 2])
OUTWARD = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.radians([60.0, 180.0, 300.0])])


def test_vertices_are_those_of_the_octahedron():
    found = frame_vertices(nist().frame_joints)
    assert [pair for pair, _ in found] == [[0, 1], [2, 3], [4, 5]]
    assert np.array([radial for _, radial in found]) == pytest.approx(OUTWARD, abs=1e-9)


@pytest.mark.parametrize("vertex", [0, 1, 2, 3])
def test_frame_as_assembled_nodes_on_springs(vertex):
    """Displacement method: a rigid platform and six more unknowns, each vertex moving outwards and up."""
    radial, vertical = 6e-9, 4e-9
    position, rotation = random_poses(5, 32)
    struts = solve_struts(nist(), position, rotation)
    stiffness = nist().strut_law.stiffness(struts.lengths)
    expected = []
    for i in range(5):
        assembled = np.zeros((12, 12))
        for s in range(6):
            u = struts.directions[i, s]
            node = 6 + 2 * VERTEX_OF[s]
            stretch = np.zeros(12)
            stretch[:6] = np.r_[u, np.cross(struts.arms[i, s], u)]
            stretch[node : node + 2] = -u @ OUTWARD[VERTEX_OF[s]], -u[2]
            assembled += stiffness[i, s] * np.outer(stretch, stretch)
        for v in range(3):
            held = vertex not in (0, v + 1)
            ground = np.array([1e18, 1e18]) if held else np.array([1.0 / radial, 1.0 / vertical])
            assembled[6 + 2 * v : 8 + 2 * v, 6 + 2 * v : 8 + 2 * v] += np.diag(ground)
        expected.append(np.linalg.inv(assembled)[:3, :3])
    model = model_with("frame_compliance", vertex=vertex, radial=radial, vertical=vertical)
    found = tip_compliance(model, position, rotation)
    # 1e18 N/m holds a vertex to 1e-11 of the struts; the assembly's condition number costs the rest.
    assert np.abs(found - expected).max() < 1e-8 * np.abs(found).max()


def test_the_rigid_tangential_direction_costs_what_the_catalogue_says():
    """Energy of the vertices' tangential forces against that of the struts; the largest ratio is an eigenvalue."""
    table = read_measurements("nist-table1", nist())
    square = np.array([[x, y, z] for x in (-0.3, 0.0, 0.3) for y in (-0.3, 0.0, 0.3) for z in (0.8, 1.27)])
    around = np.cross([0.0, 0.0, 1.0], OUTWARD)

    def forms(at):
        """(n, 3, 3) compliance of the struts alone, and what 3 nm/N at three vertices adds."""
        struts = solve_struts(nist(), at)
        forces = np.linalg.inv(np.swapaxes(struts.jacobian, 1, 2))[:, :, :3]
        tangential = np.zeros((len(at), 3, 3))
        for strut, vertex in enumerate(VERTEX_OF):
            tangential[:, vertex] += (struts.directions[:, strut] @ around[vertex])[:, None] * forces[:, strut]
        energy = forces / nist().strut_law.stiffness(struts.lengths)[..., None]
        return np.swapaxes(forces, 1, 2) @ energy, 3e-9 * np.swapaxes(tangential, 1, 2) @ tangential

    own, more = (np.einsum("ni,nij,nj->n", table.direction, form, table.direction) for form in forms(table.position))
    assert 100.0 * np.sqrt(np.mean((more / own) ** 2)) == pytest.approx(0.08, abs=0.005)
    worst = np.array([eigh(b, a, eigvals_only=True)[-1] for a, b in zip(*forms(square), strict=True)])
    assert 100.0 * worst[square[:, 2] == 0.8].max() == pytest.approx(0.38, abs=0.005)
    assert 100.0 * worst.max() == pytest.approx(0.61, abs=0.005)


def test_table_as_a_rigid_body_on_springs_at_the_origin():
    position, rotation = random_poses(5, 33)
    x, y, z, rocking = 2e-9, 3e-9, 4e-9, 5e-9
    tensor = added("table_compliance", position, rotation, x=x, y=y, z=z, rocking=rocking)
    for p, found in zip(position, tensor, strict=True):
        for j, force in enumerate(np.eye(3)):
            turn = np.array([rocking, rocking, 0.0]) * np.cross(p, force)
            moved = np.array([x, y, z]) * force + np.cross(turn, p)
            assert found[:, j] == pytest.approx(moved, abs=1e-9 * np.abs(tensor).max())


def test_a_setup_gives_way_in_its_own_rows_only():
    position, _ = random_poses(4, 34)
    along = np.tile([0.0, 0.0, 1.0], (4, 1))
    setups = np.array(["riser", "bare", "riser", "Riser"])
    plain = readings(model_with(), position, along)
    found = readings(model_with("setup_compliance", x=9e-9, z=3e-9), position, along, setup=setups)
    more = 1.0 / found - 1.0 / plain
    assert more == pytest.approx([3e-9, 0.0, 3e-9, 0.0], abs=1e-18)
    unknown = model_with("setup_compliance", z=3e-9)
    assert np.array_equal(tip_compliance(unknown, position), tip_compliance(model_with(), position))


def test_a_longer_tool_leaves_the_struts_and_moves_the_tip():
    """The nominal machine's 6 x 6 compliance carried from the programmed tip to the true one by the lever."""
    position, rotation = random_poses(6, 35)
    model = model_with("tool_length_error", error=0.040)
    assert load_path(model, position, rotation).struts.lengths == pytest.approx(
        solve_struts(nist(), position, rotation).lengths, abs=1e-14
    )
    plain = model_with()
    six = compliance_of_wrenches(plain, load_path(plain, position, rotation))
    lever = -0.040 * rotation[:, :, 2]
    carry = np.zeros((6, 3, 6))
    for i, (x, y, z) in enumerate(lever):  # motion of the true tip = v + theta x lever
        carry[i] = np.c_[np.eye(3), -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])]
    expected = carry @ six @ np.swapaxes(carry, 1, 2)
    assert tip_compliance(model, position, rotation) == pytest.approx(expected, rel=1e-9)


def test_platform_radius_as_written_in_the_machine_file():
    """The wider machine, standing where struts of the lengths of the nominal one put it."""
    wider = parse_machine(NIST_TEXT.replace("[304.77,", "[306.77,"), "wider.toml")
    position, rotation = random_poses(6, 36)
    model = model_with("platform_radius_error", error=0.002)
    path = load_path(model, position, rotation)
    nominal = solve_struts(nist(), position, rotation)
    assert path.struts.lengths == pytest.approx(nominal.lengths, abs=1e-10)  # a hundred times Newton's tolerance
    missed = np.linalg.norm(path.position - position, axis=1)
    assert (missed > 1e-4).all() and (missed < 0.02).all()
    expected = tip_compliance(build_model(wider), path.position, path.rotation)
    assert tip_compliance(model, position, rotation) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", ["tool_length_error", "platform_radius_error"])
@pytest.mark.parametrize("error", [-0.060, 0.060])
def test_geometry_at_its_bounds_still_has_a_pose(name, error):
    position, rotation = random_poses(60, 38, tilt_deg=15.0)
    assert np.isfinite(tip_compliance(model_with(name, error=error), position, rotation)).all()


def test_geometry_unknown_to_the_control_with_tools_of_two_lengths():
    position, rotation = random_poses(4, 39)
    lengths = np.array([np.nan, 0.3, 0.15, 0.3])
    model = model_with("tool_length_error", error=0.02)
    found = tip_compliance(model, position, rotation, lengths)
    for i in range(4):
        one = tip_compliance(model, position[i : i + 1], rotation[i : i + 1], float(lengths[i]))
        assert found[i] == pytest.approx(one[0], rel=1e-9)


def test_a_joint_on_the_tool_axis_stays_there():
    machine = orthogonal_hexapod()  # its joints 3 and 4 lie on the tool axis
    moved = model_with("platform_radius_error", machine, error=0.01).machine.platform_joints
    assert np.array_equal(moved[2:4], machine.platform_joints[2:4])
    assert moved[0] == pytest.approx([0.0, 0.21, 0.0])


@pytest.mark.parametrize(
    ("direction", "setup", "scaled"),
    [
        (0, "", [1, 1, 1, 1]),
        (3, "", [0, 0, 1, 0]),
        (1, "", [1, 0, 0, 0]),
        (0, "riser", [1, 0, 1, 0]),
        (3, "bare", [0, 0, 0, 0]),
    ],
)
def test_a_gauge_scales_its_own_readings_only(direction, setup, scaled):
    position, _ = random_poses(4, 37)
    along = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    setups = np.array(["riser", "bare", "riser", "bare"])
    model = model_with("gauge_scale", direction=direction, setup=setup, scale=-0.1)
    ratio = readings(model, position, along, setup=setups) / readings(model_with(), position, along)
    assert ratio == pytest.approx(1.0 - 0.1 * np.array(scaled), rel=1e-12)


def test_a_gauge_of_one_direction_wants_to_know_the_direction():
    model = model_with("gauge_scale", direction=1, setup="", scale=0.1)
    path = load_path(model, np.array([[0.0, 0.0, 0.8]]))
    with pytest.raises(InputError, match="direction"):
        model.instruments[0].effect.reading(np.array([1e7]), path, model.instruments[0].values)


def test_drift_adds_to_the_deflection_with_time():
    """1 um/min for 3 min on a deflection of 60 um is 5 % (effects on displacement, not a factor in time)."""
    model = model_with("thermal_drift", rate=1e-6 / 60.0)
    path = load_path(model, np.tile([0.0, 0.0, 0.8], (3, 1)), force=600.0, time=np.array([0.0, 180.0, 360.0]))
    true = np.full(3, 600.0 / 60e-6)
    read = model.instruments[0].effect.reading(true, path, model.instruments[0].values)
    assert 600.0 / read == pytest.approx(np.array([60e-6, 63e-6, 66e-6]), rel=1e-12)


def test_drift_that_swallows_the_deflection_is_no_number():
    model = model_with("thermal_drift", rate=-20e-6 / 60.0)
    path = load_path(model, np.array([[0.0, 0.0, 0.8]]), force=1000.0, time=np.array([600.0]))
    assert np.isnan(model.instruments[0].effect.reading(np.array([5e7]), path, model.instruments[0].values)).all()
