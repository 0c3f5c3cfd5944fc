"""Load-dependent effects beside joints that resist turning, and extreme directions, against solves of their own.

The opponent assembles six nonlinear springs and twelve rotational ones node by node and minimises the potential energy
of the platform's six displacements with scipy; it knows neither secant compliances nor strut forces.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from tests.effects.cases import neutral_values
from tests.stiffness.cases import nist, random_poses
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.poses import evaluate_poses
from toolpath_stiff.errors import InputError
from toolpath_stiff.rotations import roll_pitch_yaw
from toolpath_stiff.stiffness import core, exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.contract import Effect, Parameter
from toolpath_stiff.stiffness.model import StiffnessModel, build_model, load_path

POSITION, ROTATION = random_poses(40, seed=11)


def model_of(kappa: float = 0.0, gap: float = 0.0, contact: float = 0.0, more: tuple = ()) -> StiffnessModel:
    given = (("joint_moment_stiffness", "stiffness", kappa), ("joint_clearance", "lost_motion", gap))
    given += (("contact_nonlinearity", "compliance", contact),)
    found = [(find_effect(name), key, value) for name, key, value in given if value]
    extra = [ActiveEffect(effect, neutral_values(effect) | {key: value}) for effect, key, value in found]
    for name, values in more:
        effect = find_effect(name)
        extra.append(ActiveEffect(effect, neutral_values(effect) | values))
    return build_model(nist(), extra=extra)


def strut_force(stretch: float, compliance: float, gap: float, contact: float) -> float:
    """N in one strut that is `stretch` m longer: nothing within its gap, beyond it Hertz' contacts and the strut."""
    beyond = abs(stretch) - gap
    if beyond <= 0.0:
        return 0.0
    if contact < 1e-20:
        return float(np.sign(stretch) * beyond / compliance)
    hertz = contact * 500.0 ** (1.0 / 3.0)
    most = 1.001 * beyond / compliance  # without the contact it would be all but this
    force = brentq(lambda f: compliance * f + hertz * f ** (2.0 / 3.0) - beyond, 0.0, most, xtol=1e-9, rtol=1e-14)
    return float(np.sign(stretch) * force)


def spring_matrix(axis, arms, length):
    """(6, 6) twice the energy of unit springs at both ends of all struts, from the motions of twelve hinges."""
    matrix = np.zeros((6, 6))
    for u, arm, reach in zip(axis, arms, length, strict=True):
        swing = np.array([np.cross(u, twist[:3] + np.cross(twist[3:], arm)) / reach for twist in np.eye(6)])
        across = np.array([twist[3:] - (u @ twist[3:]) * u for twist in np.eye(6)])
        matrix += swing @ swing.T + (swing - across) @ (swing - across).T
    return matrix


def opponent(machine, position, rotation, direction, force, kappa, gap, contact) -> float:
    """N/m, secant stiffness of the tip at one pose: least potential energy over the platform's displacements."""
    arms = machine.platform_joints @ rotation.T
    spans = position + arms - machine.frame_joints
    length = np.linalg.norm(spans, axis=1)
    axis = spans / length[:, None]
    law = machine.strut_law
    rate = (law.stiffness_2 - law.stiffness_1) / (law.length_2 - law.length_1)
    compliance = 1.0 / (law.stiffness_1 + rate * (length - law.length_1))
    hertz = contact * 500.0 ** (1.0 / 3.0)
    rows = np.array([[*u, *np.cross(arm, u)] for u, arm in zip(axis, arms, strict=True)])
    springs, load = kappa * spring_matrix(axis, arms, length), np.array([*(force * direction), 0.0, 0.0, 0.0])

    def parts(x):
        stretch = rows @ x
        pull = np.array([strut_force(e, c, gap, contact) for e, c in zip(stretch, compliance, strict=True)])
        size = np.abs(pull)
        stored = size * np.maximum(np.abs(stretch) - gap, 0.0) - 0.5 * compliance * size**2
        stored -= 0.6 * hertz * size ** (5.0 / 3.0)
        loaded = np.maximum(size, 1e-9)
        rate = np.where(size > 0.0, 1.0 / (compliance + hertz * 2.0 / 3.0 * loaded ** (-1.0 / 3.0)), 0.0)
        return stored.sum() + 0.5 * x @ springs @ x - load @ x, rows.T @ pull + springs @ x - load, rate

    x = np.linalg.solve(rows.T @ (rows / compliance[:, None]) + springs, load)
    for _ in range(500):
        energy, gradient, rate = parts(x)
        if np.abs(gradient).max() < 1e-9 * force:
            break
        step = -np.linalg.solve(rows.T @ (rows * rate[:, None]) + springs, gradient)
        share = 1.0
        while share > 1e-12 and parts(x + share * step)[0] > energy + 1e-4 * share * (gradient @ step):
            share *= 0.5
        x = x + share * step
        if np.abs(step).max() < 1e-13 or share <= 1e-12:  # rounding leaves no way further down
            break
    assert np.abs(parts(x)[1]).max() < 1e-4 * force
    return float(force / (x[:3] @ direction))


def unit(vector) -> np.ndarray:
    return np.asarray(vector, dtype=float) / np.linalg.norm(vector)


def stiffness(model, i, direction, force) -> float:
    path = load_path(model, POSITION[i : i + 1], ROTATION[i : i + 1], force=force, direction=direction[None])
    return float(1.0 / exact.compliance_along(model, path, direction[None])[0])


@pytest.mark.parametrize("force", [100.0, 500.0, 4000.0])
@pytest.mark.parametrize(("gap", "contact"), [(4e-6, 0.0), (0.0, 10e-9), (4e-6, 10e-9), (40e-6, 0.0)])
@pytest.mark.parametrize("kappa", [5.0, 1e5, 5.5e5])
def test_gaps_and_contacts_beside_stiff_joints_are_those_of_an_independent_solve(kappa, gap, contact, force):
    """1e-5: below a thousandth of a newton a strut counts as idle here, the opponent's gaps are free."""
    model = model_of(kappa, gap, contact)
    rng = np.random.default_rng(5)
    for i in range(3):
        direction = unit(rng.normal(size=3))
        expected = opponent(nist(), POSITION[i], ROTATION[i], direction, force, kappa, gap, contact)
        assert stiffness(model, i, direction, force) == pytest.approx(expected, rel=1e-5)


def test_one_pass_was_too_stiff_by_several_per_cent():
    """What the forces of the linear machine, taken for those of the loaded one, would give here: the check can fail."""
    model, linear = model_of(1e5, 4e-6), model_of(1e5)
    direction, worst = np.eye(3), 0.0
    for i in range(10):
        for along in direction:
            path = load_path(linear, POSITION[i : i + 1], ROTATION[i : i + 1], force=500.0)
            wrench = np.array([[*along, 0.0, 0.0, 0.0]])[..., None]
            form, parallel = exact.assemble_links(linear, path)
            forces = exact.respond(path, form, parallel, wrench)[1][0, :, 0] * 500.0
            form[0, range(6), range(6)] += 4e-6 / np.abs(forces)
            once = 1.0 / (exact.respond(path, form, parallel, wrench)[0][0, :3, 0] @ along)
            worst = max(worst, once / stiffness(model, i, along, 500.0) - 1.0)
    assert 0.03 < worst < 0.2


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 39),
    st.floats(0.0, 6.3),
    st.floats(0.0, 6.3).map(lambda power: 10.0**power),
    st.floats(-7.0, -3.7).map(lambda power: 10.0**power),
    st.floats(0.0, 200e-9),
    st.floats(2.0, 4.5).map(lambda power: 10.0**power),
)
def test_any_sizes_settle_on_the_independent_solve(i, turn, kappa, gap, contact, force):
    direction = unit([np.cos(turn), np.sin(turn), 0.3])
    found = stiffness(model_of(kappa, gap, contact), i, direction, force)
    # A gap makes any equilibrium softer: twice the complementary energy of the linear parts alone is least without it.
    assert found <= stiffness(model_of(kappa), i, direction, force) * (1.0 + 1e-9)
    expected = opponent(nist(), POSITION[i], ROTATION[i], direction, force, kappa, gap, contact)
    assert found == pytest.approx(expected, rel=1e-4)  # idle below 1e-3 N here, within the gap there


@pytest.mark.parametrize("force", [1.0, 30.0, 2000.0])
def test_every_pose_settles_beside_a_soft_frame_too(force):
    more = (("frame_compliance", {}), ("spindle_compliance", {}))
    direction = np.tile(unit([0.6, -0.2, 0.5]), (40, 1))
    for kappa in (1e2, 1e5, 2e6):
        model = model_of(kappa, 20e-6, 50e-9, more)
        assert np.isfinite(core.compliance_along(model, direction, POSITION, ROTATION, force=force)).all()


class Slack(Effect):
    """A strut whose stretch jumps up and down with its force: no equilibrium to be found."""

    name, title, link, equation, source = "slack", "snaps to and fro", "struts", "c = a (F mod 2 < 1)", "this test"
    parameters = (Parameter("size", "m/N", 1.0, (0.0, 1.0), (0.0, 1.0), "this test"),)
    load_dependent = True

    def strut_compliance(self, path, p):
        if path.strut_forces is None:
            return None
        return p["size"] * (np.abs(path.strut_forces) % 2.0 < 1.0)


def test_forces_that_do_not_settle_are_an_error_that_names_effect_and_pose():
    model = build_model(
        nist(),
        extra=[
            ActiveEffect(find_effect("joint_moment_stiffness"), {"strut": 0, "stiffness": 5e5}),
            ActiveEffect(Slack(), {"size": 1e-6}),
        ],
    )
    position, _ = random_poses(4, 2)
    with pytest.raises(InputError, match=r"do not converge at X.* under 400 N with slack"):
        core.compliance_along(model, np.tile(unit([1, 2, 3]), (4, 1)), position, force=400.0)


def pinned(machine, position, rotation, directions, force, gap, contact):
    """(m,) N/m of six pinned bars: forces by statics, each bar's own stretch, and the work that they do."""
    arms = machine.platform_joints @ rotation.T
    spans = position + arms - machine.frame_joints
    length = np.linalg.norm(spans, axis=1)
    axis, law = spans / length[:, None], machine.strut_law
    rate = (law.stiffness_2 - law.stiffness_1) / (law.length_2 - law.length_1)
    screws = np.hstack([axis, np.cross(arms, axis)])
    pull = np.linalg.solve(screws.T, force * np.hstack([directions, np.zeros_like(directions)]).T).T
    size = np.abs(pull)
    stretch = size / (law.stiffness_1 + rate * (length - law.length_1)) + gap * (size > 0.0)
    stretch += contact * 500.0 ** (1.0 / 3.0) * size ** (2.0 / 3.0)
    return force**2 / (size * stretch).sum(axis=1)


@pytest.mark.parametrize(("gap", "contact", "force"), [(4e-6, 10e-9, 500.0), (40e-6, 0.0, 500.0), (0.0, 50e-9, 100.0)])
def test_softest_and_stiffest_are_those_of_the_linear_machine_with_its_gaps_along_them(gap, contact, force):
    """The directions are the linear tensor's, as every result says; the stiffness is that of bars assembled here."""
    place = POSITION[:8], roll_pitch_yaw(ROTATION[:8])
    found, linear = evaluate_poses(model_of(0.0, gap, contact), *place, force=force), evaluate_poses(model_of(), *place)
    np.testing.assert_array_equal([found.softest, found.stiffest], [linear.softest, linear.stiffest])
    for i in range(8):
        both = np.array([found.softest[i], found.stiffest[i]])
        here = pinned(nist(), POSITION[i], ROTATION[i], both, force, gap, contact)
        # A strut below a thousandth of a newton counts as idle there.
        assert here == pytest.approx([found.softest_stiffness[i], found.stiffest_stiffness[i]], rel=1e-5)
    names = [name for name, size in (("joint_clearance", gap), ("contact_nonlinearity", contact)) if size]
    assert any(f"directions are those without {', '.join(names)}" in text for text in found.warnings)


def test_loads_that_mean_the_softest_direction_mean_it_under_the_load():
    model = model_of(0.0, 4e-6, 10e-9)
    place = POSITION[:4], roll_pitch_yaw(ROTATION[:4])
    axis = ROTATION[:4, :, 2]
    soft = evaluate(model, *place, axis, load=Load("softest"), force=500.0)
    poses = evaluate_poses(model, *place, force=500.0)
    assert soft.stiffness == pytest.approx(poses.softest_stiffness, rel=1e-9)


def test_the_tip_compliance_holds_what_acts_under_the_load():
    """Its column along each axis is the stiffness that the pose states there, gaps and contacts included."""
    model = model_of(kappa=2e4, gap=2e-6, contact=3e-9)
    poses = evaluate_poses(model, POSITION, roll_pitch_yaw(ROTATION), force=400.0)
    np.testing.assert_allclose(1.0 / np.diagonal(poses.tip_compliance, axis1=1, axis2=2), poses.along_axes, rtol=1e-7)
    load = np.random.default_rng(3).normal(size=POSITION.shape) * 200.0
    size = np.linalg.norm(load, axis=1)
    tensor = core.tip_compliance(model, POSITION, ROTATION, load=load)
    along = np.einsum("ni,nij,nj->n", load, tensor, load) / size**2
    expected = [
        core.compliance_along(model, load[[i]] / size[i], POSITION[[i]], ROTATION[[i]], force=size[i])[0]
        for i in range(len(load))
    ]
    np.testing.assert_allclose(along, expected, rtol=1e-7)
    plain = evaluate_poses(model_of(), POSITION, roll_pitch_yaw(ROTATION))
    np.testing.assert_allclose(np.diagonal(plain.tip_compliance, axis1=1, axis2=2) * plain.along_axes, 1.0, rtol=1e-12)
