"""Cases that can be done by hand: the orthogonal hexapod, moved reference points, springs beside the struts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from tests.stiffness import reference
from tests.stiffness.cases import compliance_of_wrenches, nist, orthogonal_hexapod, random_poses
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter
from toolpath_stiff.stiffness.model import build_model, load_path

ORIGIN = np.zeros((1, 3))
H, KX, KY, KZ = 0.2, 20e6, 40e6, 60e6  # orthogonal hexapod: arm in m, stiffness of each pair of struts in N/m


def skew(vector: np.ndarray) -> np.ndarray:
    """The matrix of the cross product, skew(a) b = a x b."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def test_orthogonal_hexapod():
    """Pairs of struts are parallel springs; each pair is also a torsion spring k h^2 about one axis."""
    model = build_model(orthogonal_hexapod())
    compliance = compliance_of_wrenches(model, load_path(model, ORIGIN))[0]
    by_hand = 1.0 / np.array([KX, KY, KZ, KY * H**2, KZ * H**2, KX * H**2])
    assert np.diag(compliance) == pytest.approx(by_hand, rel=1e-12)
    assert compliance - np.diag(np.diag(compliance)) == pytest.approx(0.0, abs=1e-12 * by_hand.min())


def test_a_tip_below_the_struts_adds_the_tilting():
    """A force along x at a tip `a` below turns the platform about y too: 1/Kx + a^2/(Kz h^2); z is not touched."""
    a = 0.3
    model = build_model(orthogonal_hexapod(offset=a))
    compliance = exact.tip_compliance(model, load_path(model, ORIGIN))[0]
    assert compliance[0, 0] == pytest.approx(1 / KX + a**2 / (KZ * H**2), rel=1e-12)
    assert compliance[1, 1] == pytest.approx(1 / KY + a**2 / (KY * H**2), rel=1e-12)
    assert compliance[2, 2] == pytest.approx(1 / KZ, rel=1e-12)


def test_moving_the_reference_point_along_the_tool():
    """The same platform, spoken of at a tip further out: C' = A C A^T with A = [[1, -[d]x], [0, 1]]."""
    model = build_model(nist())
    position, rotation = random_poses(5, 11)
    extension = 0.12
    shift = -extension * rotation[:, :, 2]
    short = compliance_of_wrenches(model, load_path(model, position, rotation, 0.15))
    long = compliance_of_wrenches(model, load_path(model, position + shift, rotation, 0.15 + extension))
    for i in range(5):
        move = np.eye(6)
        move[:3, 3:] = -skew(shift[i])
        assert long[i] == pytest.approx(move @ short[i] @ move.T, rel=1e-9, abs=1e-12 * np.abs(long[i]).min())


def test_the_jacobian_is_how_struts_lengthen():
    """Finite differences of the inverse kinematics, which knows no Jacobian; small turns about the base axes."""
    machine, step = nist(), 1e-6
    pose = np.array([0.1, -0.2, 0.8, 0.2, -0.25, 0.3])
    jacobian = solve_struts_at(machine, pose).jacobian[0]
    for axis in range(6):
        lengths = []
        for sign in (1.0, -1.0):
            moved = pose.copy()
            if axis < 3:
                moved[axis] += sign * step
            else:
                turn = rotation_matrices(sign * step * np.eye(3)[axis - 3])
                moved[3:] = roll_pitch_yaw(turn @ rotation_matrices(pose[3:]))
            lengths.append(solve_struts_at(machine, moved).lengths[0])
        # Central differences of lengths near 3 m: rounding 1e-16 * 3 / 1e-6 leaves 1e-9 or so.
        assert (lengths[0] - lengths[1]) / (2 * step) == pytest.approx(jacobian[:, axis], abs=5e-9)


@pytest.mark.parametrize("bars", [np.inf, 1e9])
def test_energy_balance(bars):
    """Work of the load equals what the members store; with bars, the struts' share is the smaller."""
    model = build_model(nist(bars))
    path = load_path(model, *random_poses(20, 12))
    wrench = np.random.default_rng(1).normal(size=(20, 6, 1)) * [[500.0], [500.0], [500.0], [50.0], [50.0], [50.0]]
    twists, forces = exact.respond(path, *exact.assemble_links(model, path), wrench)
    work = np.einsum("nij,nij->n", wrench, twists)
    in_struts = (forces[..., 0] ** 2 / model.machine.strut_law.stiffness(path.struts.lengths)).sum(axis=1)
    if np.isinf(bars):
        assert work == pytest.approx(in_struts, rel=1e-10)
    else:
        assert (work > in_struts).all()


class Spring(Effect):
    """A 6 x 6 stiffness beside the struts, as a user would write it."""

    name = "spring"
    title = "spring beside the struts"
    link = "joints"
    equation = "K"
    source = "test"
    parameters = (Parameter("scale", "", 1.0, (0.0, 1e3), (0.0, 1.0), "test"),)

    def parallel_stiffness(self, path: LoadPath, p: Mapping[str, float]) -> np.ndarray:
        return np.broadcast_to(p["scale"] * spring_stiffness(), (len(path), 6, 6))


def spring_stiffness() -> np.ndarray:
    """A full, positive definite 6 x 6 stiffness of the struts' order."""
    root = np.random.default_rng(2).normal(size=(6, 6)) * np.array([3e3, 3e3, 3e3, 1e3, 1e3, 1e3])
    return root @ root.T


def test_parallel_stiffness_on_a_rigid_platform():
    """Stiffnesses in parallel add: (J^T k J + K)^-1."""
    model = build_model(nist(), extra=[ActiveEffect(Spring(), {"scale": 1.0})])
    path = load_path(model, *random_poses(10, 13))
    strut = model.machine.strut_law.stiffness(path.struts.lengths)
    jacobian = path.struts.jacobian
    total = np.swapaxes(jacobian, 1, 2) @ (strut[..., None] * jacobian) + spring_stiffness()
    expected = np.linalg.inv(total)
    for got, right in zip(compliance_of_wrenches(model, path), expected, strict=True):
        assert got == pytest.approx(right, rel=1e-8, abs=1e-11 * np.abs(right).max())


def test_parallel_stiffness_on_a_flexible_platform():
    """An assembled truss whose joints' least-squares rigid motion is held by the same springs."""
    machine = nist(1e9)
    model = build_model(machine, extra=[ActiveEffect(Spring(), {"scale": 1.0})])
    position, rotation = random_poses(6, 14)
    got = exact.tip_compliance(model, load_path(model, position, rotation))
    plain = exact.tip_compliance(build_model(machine), load_path(model, position, rotation))
    for i, (tip, turn) in enumerate(zip(position, rotation, strict=True)):
        structure = reference.structure_stiffness(machine, tip, turn)
        arms = machine.platform_joints @ turn.T
        motions = np.vstack([np.hstack([np.eye(3), -skew(arm)]) for arm in arms])  # (18, 6)
        fit = np.linalg.pinv(motions)
        structure[:18, :18] += fit.T @ spring_stiffness() @ fit
        expected = np.linalg.inv(structure)[21:, 21:]
        assert np.abs(got[i] - expected).max() < 1e-9 * np.abs(expected).max()
        assert np.abs(plain[i] - expected).max() > 1e-2 * np.abs(expected).max()  # the springs do matter


def test_a_spring_in_one_direction_only():
    """A singular K: on the orthogonal hexapod a spring along x stands beside the pair of struts along x."""

    class OneSpring(Spring):
        def parallel_stiffness(self, path: LoadPath, p: Mapping[str, float]) -> np.ndarray:
            return np.broadcast_to(np.diag([5e6, 0.0, 0.0, 0.0, 0.0, 0.0]), (len(path), 6, 6))

    model = build_model(orthogonal_hexapod(), extra=[ActiveEffect(OneSpring(), {"scale": 1.0})])
    compliance = exact.tip_compliance(model, load_path(model, ORIGIN))[0]
    assert np.diag(compliance) == pytest.approx([1 / (KX + 5e6), 1 / KY, 1 / KZ], rel=1e-12)


def test_no_spring_is_no_change():
    """The solving route with K = 0 must meet the equilibrium route."""
    machine = nist(1e9)
    zero = build_model(machine, extra=[ActiveEffect(Spring(), {"scale": 0.0})])
    plain = build_model(machine)
    pose = random_poses(20, 15)
    one = compliance_of_wrenches(zero, load_path(zero, *pose))
    other = compliance_of_wrenches(plain, load_path(plain, *pose))
    assert np.abs(one - other).max() < 1e-9 * np.abs(other).max()


class Hertz(Effect):
    """Secant compliance of a contact in every strut, c0 (|f| / F0)^(-1/3) with F0 = 500 N."""

    name = "hertz"
    title = "contact in the joints"
    link = "joints"
    equation = "c = c0 (|f| / 500 N)^(-1/3)"
    source = "test"
    parameters = (Parameter("contact", "m/N", 1.0, (0.0, 1e-6), (3e-9, 8e-9), "test"),)
    load_dependent = True

    def strut_compliance(self, path: LoadPath, p: Mapping[str, float]) -> np.ndarray:
        assert path.strut_forces is not None
        return p["contact"] * (np.abs(path.strut_forces) / 500.0) ** (-1.0 / 3.0)


@pytest.mark.parametrize("force", [100.0, 4000.0])
def test_load_dependent_effect_against_a_nonlinear_solve(force):
    """Struts with e(f) = f/k + c0 F0^(1/3) sign(f) |f|^(2/3), equilibrium found by Newton's method in displacements."""
    from scipy.optimize import brentq, root

    contact = 5e-9
    model = build_model(nist(), extra=[ActiveEffect(Hertz(), {"contact": contact})])
    path = load_path(model, *random_poses(1, 16), force=force)
    direction = np.array([[0.6, 0.0, 0.8]])
    got = exact.compliance_along(model, path, direction)[0]

    stiffness = model.machine.strut_law.stiffness(path.struts.lengths)[0]
    jacobian = path.struts.jacobian[0]

    def strut_force(stretch: float, k: float) -> float:
        def gap(size: float) -> float:
            return size / k + contact * 500.0 ** (1 / 3) * size ** (2 / 3) - abs(stretch)

        return float(np.copysign(brentq(gap, 0.0, 1e6, xtol=1e-12, rtol=1e-14), stretch))

    def imbalance(scaled: np.ndarray) -> np.ndarray:
        stretches = jacobian @ (scaled * 1e-6)
        forces = np.array([strut_force(e, k) for e, k in zip(stretches, stiffness, strict=True)])
        return (jacobian.T @ forces - load) / force

    load = np.r_[force * direction[0], 0.0, 0.0, 0.0]
    start = np.linalg.solve((jacobian.T * stiffness) @ jacobian, load) * 1e6
    solved = root(imbalance, start, method="hybr", tol=1e-13)
    assert np.abs(solved.fun).max() < 1e-9
    assert got == pytest.approx(direction[0] @ solved.x[:3] * 1e-6 / force, rel=1e-7)


def test_a_contact_is_stiffer_under_a_larger_load_and_absent_from_the_linear_tensor():
    model = build_model(nist(), extra=[ActiveEffect(Hertz(), {"contact": 5e-9})])
    direction = np.array([[0.0, 0.0, 1.0]])
    at = [exact.compliance_along(model, load_path(model, [0, 0, 0.8], force=f), direction)[0] for f in (1e2, 1e3, 1e4)]
    linear = exact.tip_compliance(model, load_path(model, [0, 0, 0.8]))[0, 2, 2]
    assert at[0] > at[1] > at[2] > linear
    # Hertz: the share of the contact falls with the cube root of the load.
    assert (at[0] - linear) / (at[1] - linear) == pytest.approx(10 ** (1 / 3), rel=1e-9)


def test_a_singular_pose_is_nan_and_leaves_its_neighbours_alone():
    """All struts through one point: no moment can be held. The sound pose in the same batch stays as it was."""
    model = build_model(orthogonal_hexapod())
    sound = load_path(model, np.zeros((2, 3)))
    arms = sound.struts.arms.copy()
    arms[1] = 0.0
    broken = replace(sound, stance=replace(sound.struts, arms=arms))
    compliance = exact.tip_compliance(model, broken)
    assert np.isnan(compliance[1]).all()
    assert np.array_equal(compliance[0], exact.tip_compliance(model, sound)[0])


def test_a_strut_law_carried_beyond_zero_is_refused():
    """The NIST law reaches 0 at 3.2132 m + 32.5 / 14 * 0.6516 m = 4.726 m; a negative spring is no physics."""
    model = build_model(nist())
    with pytest.raises(InputError, match=r"strut \d would be .* mm long.*above 0"):
        exact.tip_compliance(model, load_path(model, [[0.0, 0.0, 0.8], [0.0, 0.0, -2.0]]))
