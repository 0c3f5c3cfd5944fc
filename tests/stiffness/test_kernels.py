"""The fast routes against equilibrium solved with pivoting, 40-digit arithmetic, symmetry, and random machines."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.kinematics import singularity_index, solve_struts, solve_struts_at
from toolpath_stiff.machine.model import Hexapod, StrutLaw
from toolpath_stiff.rotations import rotation_about_z, rotation_matrices
from toolpath_stiff.stiffness import closed_form, core
from toolpath_stiff.stiffness.model import build_model

NIST = load_machine("nist")


def poses(n: int, seed: int = 0, tilt: float = 0.35):
    rng = np.random.default_rng(seed)
    position = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), rng.uniform(0.3, 1.3, n)])
    return position, rotation_matrices(rng.uniform(-tilt, tilt, (n, 3)))


def by_equilibrium(machine: Hexapod, position, rotation) -> np.ndarray:
    """Tip compliance from J^T f = w with a pivoted 6 x 6 solve, written out here again."""
    arms = machine.platform_joints @ np.swapaxes(rotation, 1, 2)
    strut = position[:, None] + arms - machine.frame_joints
    length = np.linalg.norm(strut, axis=2)
    u = strut / length[..., None]
    force = np.linalg.solve(np.swapaxes(np.concatenate([u, np.cross(arms, u)], axis=2), 1, 2), np.eye(6)[:, :3])
    law = machine.strut_law
    k = np.interp(length, [0, 10], [law.intercept, law.intercept + 10 * law.slope])
    return np.swapaxes(force, 1, 2) @ (force / k[..., None])


def along(kernel, position, direction, rotation):
    """`compliance_along_columns` with poses first: compliance, determinant, lengths (n, 6), good."""
    columns = None if rotation is None else np.ascontiguousarray(rotation.reshape(-1, 9).T)
    p, d = np.ascontiguousarray(position.T), np.ascontiguousarray(direction.T)
    compliance, determinant, lengths, good = closed_form.compliance_along_columns(kernel, p, d, columns)
    return compliance, determinant, lengths.T, good


def tensors(machine: Hexapod, position, rotation, tool_length: float = np.nan):
    """Tip compliance by the closed form along six directions a pose, and where it may be trusted."""
    kernel, (x, y, z), compliance, good = closed_form.prepare(machine, tool_length), np.eye(3), {}, True
    for name, direction in (("xx", x), ("yy", y), ("zz", z), ("xy", x + y), ("xz", x + z), ("yz", y + z)):
        there = np.broadcast_to(direction, (len(position), 3))
        compliance[name], _, _, sure = along(kernel, position, there, rotation)
        good = good & sure
    tensor = np.empty((len(position), 3, 3))
    for i, a in enumerate("xyz"):
        for j, b in enumerate("xyz"):
            both = compliance[min(a, b) + max(a, b)]
            tensor[:, i, j] = both if a == b else 0.5 * (both - compliance[a + a] - compliance[b + b])
    return tensor, good


def worst(found, expected) -> float:
    scale = np.abs(expected).max(axis=(1, 2))
    return float((np.abs(found - expected).max(axis=(1, 2)) / scale).max())


@pytest.mark.parametrize("tilted", [False, True])
def test_agrees_with_a_pivoted_solve(tilted):
    position, rotation = poses(5000)
    turn = rotation if tilted else None
    found, _ = tensors(NIST, position, turn)
    expected = by_equilibrium(NIST, position, rotation if tilted else np.broadcast_to(np.eye(3), rotation.shape))
    assert worst(found, expected) < 1e-13  # 16 digits less the condition of the equilibrium, some hundreds


def test_forty_digits():
    mp = pytest.importorskip("mpmath")
    mp.mp.dps = 40
    position, rotation = poses(4, seed=3)
    found, _ = tensors(NIST, position, rotation)
    for p, r, c in zip(position, rotation, found, strict=True):
        columns, compliances = [], []
        for joint, frame in zip(NIST.platform_joints, NIST.frame_joints, strict=True):
            arm = mp.matrix(r.tolist()) * mp.matrix(joint.tolist())
            s = mp.matrix(p.tolist()) + arm - mp.matrix(frame.tolist())
            length = mp.sqrt(sum(v * v for v in s))
            u = s / length
            moment = [arm[1] * u[2] - arm[2] * u[1], arm[2] * u[0] - arm[0] * u[2], arm[0] * u[1] - arm[1] * u[0]]
            columns.append([*u, *moment])
            compliances.append(1 / (mp.mpf(NIST.strut_law.intercept) + mp.mpf(NIST.strut_law.slope) * length))
        system = mp.matrix(columns).T
        forces = [mp.lu_solve(system, mp.matrix([1.0 if i == axis else 0.0 for i in range(6)])) for axis in range(3)]
        exact = [
            [float(sum(a * b * k for a, b, k in zip(x, y, compliances, strict=True))) for y in forces] for x in forces
        ]
        np.testing.assert_allclose(c, exact, rtol=0, atol=1e-14 * np.abs(exact).max())


@pytest.mark.parametrize("exact", [True, False])
def test_symmetry_of_120_degrees(exact):
    position, rotation = poses(500, seed=5)
    third = rotation_about_z(2 * np.pi / 3)
    places = (position, rotation), (position @ third.T, third @ rotation @ third.T)
    plain, turned = (
        core.tip_compliance(build_model(NIST), *place) if exact else tensors(NIST, *place)[0] for place in places
    )
    assert worst(third.T @ turned @ third, plain) < 1e-12


def random_machine(rng) -> Hexapod:
    """Joints anywhere: no symmetry, no plane; often close to singular."""
    frame = rng.uniform([-1, -1, 1.0], [1, 1, 2.0], (6, 3))
    platform = rng.uniform([-0.4, -0.4, 0.0], [0.4, 0.4, 0.3], (6, 3))
    law = StrutLaw(0.5, 4e7, 3.0, 2e7)
    return Hexapod(name="random", title="random", source="", frame_joints=frame, platform_joints=platform,
                   reference_tool_length=0.1, strut_law=law)  # fmt: skip


def rounding(machine: Hexapod, position, rotation) -> tuple[np.ndarray, np.ndarray]:
    """(n,) by how much the elimination, and a pivoted solve, make rounding larger.

    Determinant and cofactors of U_A are right to eps, so U_A^-1 to eps |U_A^-1| / det U_A; that is the error of
    S = M_B - M_A U_A^-1 U_B in units of the arms, of which S^-1 makes |S^-1| times as much.
    """
    kernel = closed_form.prepare(machine)
    first, second = list(kernel.order[:3]), list(kernel.order[3:])
    arms = machine.platform_joints @ np.swapaxes(rotation, 1, 2)
    strut = position[:, None] + arms - machine.frame_joints
    u = strut / np.linalg.norm(strut, axis=2)[..., None]
    force, moment = np.swapaxes(u, 1, 2), np.swapaxes(np.cross(arms, u), 1, 2) / kernel.arm
    inverse = np.linalg.inv(force[:, :, first])
    left = moment[:, :, second] - moment[:, :, first] @ inverse @ force[:, :, second]
    sizes = [np.linalg.norm(matrix, 2, axis=(1, 2)) for matrix in (inverse, np.linalg.inv(left))]
    determinant = np.abs(np.linalg.det(force[:, :, first]))
    return sizes[0] * sizes[1] / determinant, np.linalg.cond(np.concatenate([force, moment], axis=1))


def test_random_machines_fall_back_where_the_closed_form_is_ill_conditioned():
    """Each pose within 32 times its own rounding: of 144,000 the worst is 8 times, and 0.6 times where solved.

    The worst error of these is 3e-9, with a tail like its inverse; with determinants of 1e-5 let pass it is 9e-6.
    """
    rng = np.random.default_rng(11)
    fell_back = 0
    for _ in range(60):
        machine = random_machine(rng)
        position = rng.uniform(-0.3, 0.3, (200, 3))
        rotation = rotation_matrices(rng.uniform(-0.6, 0.6, (200, 3)))
        found, good = tensors(machine, position, rotation)
        found[~good] = core.tip_compliance(build_model(machine), position[~good], rotation[~good])
        expected = by_equilibrium(machine, position, rotation)
        error = np.abs(found - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))
        eliminated, solved = rounding(machine, position, rotation)
        assert (error < 32 * np.finfo(float).eps * np.where(good, eliminated + solved, solved)).all()
        assert error.max() < 1e-7
        fell_back += int((~good).sum())
    assert fell_back > 0  # the guard was needed, and used


def test_a_block_with_singular_poses_keeps_the_good_ones():
    # On its axis, an octahedral hexapod is singular at a yaw of 90 degrees (Fichter 1986).
    vertices = 0.5 * (NIST.frame_joints[::2] + NIST.frame_joints[1::2])
    machine = NIST.with_changes(frame_joints=np.repeat(vertices, 2, axis=0))
    position = np.array([[0.0, 0.0, 0.8]] * 200)
    rotation = np.broadcast_to(rotation_about_z(np.pi / 2), (200, 3, 3)).copy()
    rotation[::2] = rotation_about_z(0.4)
    found, good = tensors(machine, position, rotation)
    assert good[::2].all()
    assert worst(found[::2], by_equilibrium(machine, position[::2], rotation[::2])) < 1e-9
    assert not good[1::2].any()


def unit_vectors(n: int) -> np.ndarray:
    direction = np.random.default_rng(1).normal(size=(n, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


@pytest.mark.parametrize("tilted", [False, True])
def test_compliance_along_with_lengths_and_determinant(tilted):
    n = closed_form.BLOCK + 100  # a whole block and a part of one
    position, rotation = poses(n, seed=9)
    direction, turn = unit_vectors(n), rotation if tilted else None
    found, determinant, lengths, good = along(closed_form.prepare(NIST), position, direction, turn)
    tensor = core.tip_compliance(build_model(NIST), position, turn)
    np.testing.assert_allclose(found, np.einsum("ni,nij,nj->n", direction, tensor, direction), rtol=1e-12)
    struts = solve_struts(NIST, position, turn)
    np.testing.assert_allclose(lengths, struts.lengths, rtol=1e-14)
    neutral = np.abs(np.linalg.det(solve_struts_at(NIST, NIST.limits.neutral_pose).jacobian[0]))
    np.testing.assert_allclose(determinant / neutral, singularity_index(NIST, struts), rtol=1e-11)
    assert good.all()


def test_compliance_along_of_random_machines_is_right_wherever_it_is_called_good():
    rng = np.random.default_rng(12)
    doubtful = 0
    for _ in range(60):
        machine = random_machine(rng)
        position = rng.uniform(-0.3, 0.3, (200, 3))
        rotation, direction = rotation_matrices(rng.uniform(-0.6, 0.6, (200, 3))), unit_vectors(200)
        found, _, _, good = along(closed_form.prepare(machine), position, direction, rotation)
        tensor = by_equilibrium(machine, position, rotation)
        expected = np.einsum("ni,nij,nj->n", direction, tensor, direction)
        # An error in the forces is an error relative to the tensor's size, of which a direction may see little.
        size = np.abs(tensor).max(axis=(1, 2))
        assert np.all(np.abs(found - expected)[good] < 1e-9 * size[good])
        doubtful += int((~good).sum())
    assert doubtful > 0


# X, Y, Z stiffness in N/mm of the geometry that Table 1 of Clinton, Zhang and Wavering (1997) determines, platform
# rigid, computed for this project apart from its code and rounded to 1 N/mm.
CHECK_VALUES = [
    ((0, 0, 1268.225), (0, 0, 0), (57950, 57950, 110141)),
    ((-300, 300, 300), (-30, 0, 0), (15889, 22759, 18919)),
    ((100, -200, 800), (10, -15, 20), (37690, 27565, 41344)),
]


def test_check_values():
    tip, angles, expected = (np.array(column, dtype=float) for column in zip(*CHECK_VALUES, strict=True))
    found, _ = tensors(NIST, tip / 1e3, rotation_matrices(np.deg2rad(angles)))
    stiffness = 1e-3 / np.diagonal(found, axis1=1, axis2=2)
    np.testing.assert_allclose(stiffness, expected, rtol=0, atol=0.51)  # half of the last digit printed


@pytest.mark.parametrize("tilted", [False, True])
def test_only_the_doubtful_poses_are_given_up(tilted):
    position, rotation = poses(500, seed=4)
    turn = rotation if tilted else None
    position[7] = [0.0, 0.0, -3.0]  # struts of some 6 m; the law ends at 4.7 m
    position[11] = np.nan
    expected = ~np.isin(np.arange(500), [7, 11])
    kernel, direction = closed_form.prepare(NIST), unit_vectors(500)
    np.testing.assert_array_equal(along(kernel, position, direction, turn)[3], expected)
    some, turn = (position[expected], direction[expected]), None if turn is None else turn[expected]
    assert along(closed_form.prepare(NIST, 0.6), *some, turn)[3].all()


def test_tools_of_several_lengths():
    position, rotation = poses(600, seed=2)
    lengths = np.where(np.arange(600) % 3 == 0, np.nan, np.where(np.arange(600) % 3 == 1, 0.12, 0.25))
    plain = core.tip_compliance(build_model(NIST), position, rotation, lengths)
    for length, rows in core.rows_of_tools(lengths):
        assert worst(tensors(NIST, position[rows], rotation[rows], length)[0], plain[rows]) < 1e-13


@pytest.mark.parametrize("law", [(2.0, 5e-318, 3.0, 5e-318), (1e-303, 4e7, 2e-303, 3e7), (2.0, np.nan, 3.0, 4e7)])
def test_a_strut_law_that_gives_no_number_is_refused(law):
    machine = NIST.with_changes(strut_law=StrutLaw(*law))
    tip = np.linspace([0.0, 0.0, 0.8], [0.2, 0.1, 0.9], 3)
    with pytest.raises(InputError, match=r"strut \d would be .* at X0 Y0 Z800 mm; expected a finite stiffness above 0"):
        core.tip_compliance(build_model(machine), tip)
    if law[1] > 1e-300:
        assert not tensors(machine, tip, None)[1].any()


def test_a_strut_law_beyond_zero_is_refused():
    with pytest.raises(InputError):
        core.tip_compliance(build_model(NIST), np.array([[0.0, 0.0, -3.0]]))  # struts of 6 m; the law ends at 4.7 m


def test_the_closed_form_is_for_struts_on_a_rigid_platform():
    plain, soft = build_model(NIST), build_model(NIST.with_changes(platform_bar_stiffness=1e9))
    assert core.is_closed_form(plain)
    assert not core.is_closed_form(soft)


def test_memory_does_not_grow_with_the_poses():
    kernel = closed_form.prepare(NIST)

    def peak_above_output(n: int) -> float:
        (position, rotation), direction = poses(n), unit_vectors(n)
        columns = [np.ascontiguousarray(a.reshape(n, -1).T) for a in (position, direction, rotation)]
        tracemalloc.start()
        outputs = closed_form.compliance_along_columns(kernel, *columns)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak - sum(output.nbytes for output in outputs)

    small, large = peak_above_output(4 * closed_form.BLOCK), peak_above_output(40 * closed_form.BLOCK)
    assert large < 1.2 * small + 2 * 36 * closed_form.BLOCK  # and what says where it may be trusted


def test_no_poses():
    empty, turns = np.empty((0, 3)), np.empty((0, 3, 3))
    for turn in (None, turns):
        assert core.tip_compliance(build_model(NIST), empty, turn).shape == (0, 3, 3)
        assert [len(a) for a in along(closed_form.prepare(NIST), empty, empty, turn)] == [0, 0, 0, 0]
