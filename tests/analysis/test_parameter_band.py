"""The band of parameter uncertainty: against differences of whole analyses, closed forms, and its laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import multivariate_normal, norm

from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.analysis.uncertainty import ParameterBand
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.error_model import ErrorModel, coordinates
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.model import STRUT_LAW, EffectEntry, Uncertainty
from toolpath_stiff.nc.reader import read_program
from toolpath_stiff.stiffness.model import build_model, with_parameter_moved
from toolpath_stiff.units import n_per_mm_from_n_per_m

PROGRAM = "G21 G90 G94\nG0 X0 Y0 Z20\nG1 Z0 F600\nG1 X150 F1200\nG1 Y-120\nM30\n"
NIST = load_machine("nist")
JOINTS = "joint_compliance.compliance_nm_per_N"


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    file = tmp_path_factory.mktemp("band") / "part.nc"
    file.write_text(PROGRAM)
    return read_program(file)


def with_uncertainty(names, sd, correlation=None, machine=NIST):
    matrix = np.eye(len(names)) if correlation is None else np.array(correlation)
    return machine.with_changes(uncertainty=Uncertainty(tuple(names), np.array(sd, dtype=float), matrix))


def soft_joints(machine=NIST, size=5.0):
    return machine.with_changes(effects=(EffectEntry("joint_compliance", {"compliance_nm_per_N": size}),))


def test_a_machine_without_uncertainty_has_no_band(program):
    found = analyze(NIST, program, step=0.05)
    assert found.parameter_band is None
    assert "parameter_uncertainty" not in found.to_dict()


def test_a_law_wrong_by_one_factor_makes_the_stiffness_wrong_by_it(program):
    """Rigid but for its struts, a machine is as stiff as they are: 2 % in both constants together is 2 % everywhere."""
    law = NIST.strut_law
    sd = [0.02 * law.stiffness_1 / 1e6, 0.02 * law.stiffness_2 / 1e6]
    found = analyze(with_uncertainty(STRUT_LAW, sd, [[1.0, 1.0], [1.0, 1.0]]), program, step=0.05)
    counted = found.counted
    relative = found.parameter_band.deviation[counted] / found.at.stiffness[counted]
    # 2e-4 of it: each constant is moved alone by 0.02 % of itself, over which the stiffness bends by as much.
    assert relative == pytest.approx(0.02, rel=2e-4)
    figures = found.to_dict()["parameter_uncertainty"]
    assert figures["mean_sd_N_per_mm"] == pytest.approx(0.02 * found.to_dict()["mean_N_per_mm"], rel=2e-4)


def test_the_deviation_is_the_move_that_the_parameter_makes(program):
    machine = with_uncertainty([JOINTS], [0.1], machine=soft_joints())
    found = analyze(machine, program, step=0.05)
    up, down = (analyze(soft_joints(size=5.0 + change), program, step=0.05).at.stiffness for change in (0.1, -0.1))
    counted = found.counted
    # Half the move between plus and minus one deviation; 0.1 of 20 nm/N bends by (0.5 %)^2.
    assert found.parameter_band.deviation[counted] == pytest.approx((down - up)[counted] / 2.0, rel=1e-2)


def test_it_agrees_with_drawn_parameters(program):
    """1000 machines drawn from the covariance scatter as the band says."""
    law, correlation = NIST.strut_law, np.array([[1.0, -0.6], [-0.6, 1.0]])
    sd = np.array([0.5, 0.4])
    found = analyze(with_uncertainty(STRUT_LAW, sd, correlation), program, step=0.5)
    rng = np.random.default_rng(3)
    drawn = rng.multivariate_normal([0.0, 0.0], np.outer(sd, sd) * correlation, 1000, method="cholesky")
    runs = [
        analyze(
            NIST.with_changes(
                strut_law=replace(law, stiffness_1=law.stiffness_1 + a * 1e6, stiffness_2=law.stiffness_2 + b * 1e6)
            ),
            program,
            step=0.5,
        ).at.stiffness
        for a, b in drawn
    ]
    # 10 %: a standard deviation of 1000 draws is known to 2.2 %.
    spread = np.std(runs, axis=0)[found.counted]
    assert found.parameter_band.deviation[found.counted] == pytest.approx(spread, rel=0.10)


def test_errors_of_parameters_do_not_average_out(program):
    law = NIST.strut_law
    sd = [0.03 * law.stiffness_1 / 1e6, 0.03 * law.stiffness_2 / 1e6]
    found = analyze(with_uncertainty(STRUT_LAW, sd, [[1.0, 0.5], [0.5, 1.0]]), program, step=0.01)
    weight = np.where(found.counted, found.samples.weight, 0.0)
    deviation = found.parameter_band.deviation[found.counted]
    assert deviation.min() <= found.parameter_band.deviation_of_mean(weight) <= deviation.max()


def test_instruments_act_on_readings_only(program):
    machine = NIST.with_changes(
        instruments=(EffectEntry("gauge_scale", {"direction": 1, "setup": "", "scale_percent": 3.0}),)
    )
    found = analyze(with_uncertainty(["gauge_scale.scale_percent"], [1.0], machine=machine), program, step=0.05)
    assert found.parameter_band is None


def test_a_parameter_at_its_bound_is_moved_inwards(program):
    machine = with_uncertainty([JOINTS], [0.5], machine=soft_joints(size=0.0))
    with pytest.raises(InputError, match=JOINTS):
        with_parameter_moved(build_model(machine), JOINTS, -0.1)
    found = analyze(machine, program, step=0.05)
    assert (found.parameter_band.deviation[found.counted] > 0.0).all()


def test_geometry_effects_are_applied_once(program):
    """The model's machine has the longer tool already; the moved one must not get it twice."""
    machine = NIST.with_changes(effects=(EffectEntry("tool_length_error", {"error_mm": 20.0}),))
    model = build_model(machine)
    same = with_parameter_moved(model, "tool_length_error.error_mm", 0.0)
    assert np.array_equal(same.machine.platform_joints, model.machine.platform_joints)
    found = analyze(with_uncertainty(["tool_length_error.error_mm"], [2.0], machine=machine), program, step=0.05)
    near = analyze(
        NIST.with_changes(effects=(EffectEntry("tool_length_error", {"error_mm": 22.0}),)), program, step=0.05
    )
    moved = np.abs(near.at.stiffness - found.at.stiffness)[found.counted]
    # 2 mm of tool on arms of 300 mm: the slope changes by a per cent or two over it; small slopes by more.
    assert found.parameter_band.deviation[found.counted] == pytest.approx(moved, rel=0.05, abs=0.02 * moved.max())


def with_errors(places_m, struts=0.0, near=0.0, away=0.0):
    """The law known exactly; struts that differ, and what the model lacks."""
    place = coordinates(np.atleast_2d(places_m), np.zeros((1, 3)))
    errors = ErrorModel(np.zeros((2, 44)), struts, 0.0, near, away, place)
    return NIST.with_changes(uncertainty=Uncertainty(STRUT_LAW, np.ones(2), np.eye(2), errors))


def test_struts_that_differ_widen_the_band(program):
    found = analyze(with_errors([0.0, 0.0, 0.0], struts=0.01), program, step=0.05)
    squares = 0.0
    for strut in range(1, 7):
        weak = NIST.with_changes(effects=(EffectEntry("weak_strut", {"strut": strut, "factor": 0.9999}),))
        squares += (100.0 * (analyze(weak, program, step=0.05).at.stiffness - found.at.stiffness)) ** 2
    counted = found.counted
    assert found.parameter_band.deviation[counted] == pytest.approx(np.sqrt(squares)[counted], rel=1e-3)


def test_the_band_widens_away_from_the_measured_poses_and_says_so(program):
    origin = analyze(NIST, program, step=0.05).samples.position
    here, away = (with_errors(origin[-1] + [0.0, 0.0, z], near=0.01, away=0.03) for z in (0.0, 2.0))
    for machine, few, least, most in ((here, 0.0, 0.01, 0.02), (away, 1.0, 0.03, 0.03)):
        found = analyze(machine, program, step=0.05)
        relative = (found.parameter_band.deviation / found.at.stiffness)[found.counted]
        assert relative.min() >= least * (1.0 - 1e-6)
        assert relative.max() <= most * (1.0 + 1e-6)
        figures = found.to_dict()["parameter_uncertainty"]
        assert figures["few_readings_share"] == few
        assert figures["few_readings_at_min"] == bool(few)
        assert figures["form_known"]
        assert ("few readings near here" in str(found)) == bool(few)
        # What the model lacks is alike along one axis, half of it elsewhere: it averages out in part.
        weight = np.where(found.counted, found.samples.weight, 0.0)
        assert found.parameter_band.deviation_of_mean(weight) < 0.9 * found.parameter_band.deviation.max()


def band_of(factors, form, x_m=0.0):
    """A band of samples at x (n,), loaded along Z."""
    n, place = len(form), np.zeros((len(form), 6))
    place[:, 0] = x_m
    none = np.zeros(n, dtype=bool)
    return ParameterBand(("a",), np.asarray(factors), np.asarray(form), none, place, np.tile([0.0, 0.0, 1.0], (n, 1)))


def independent(means, deviations):
    """Interval of the smallest of independent normals: none of them is below it."""
    return [
        brentq(lambda x, p=p: norm.logsf(x, means, deviations).sum() - np.log1p(-p), -100.0, 200.0)
        for p in (0.025, 0.975)
    ]


@pytest.mark.parametrize(
    ("means", "deviations"),
    [(np.full(10, 100.0), np.full(10, 1.0)), ([100.0, 103.0, 120.0], [1.0, 5.0, 0.1]), ([100.0], [2.0])],
)
def test_the_lowest_of_independent_samples(means, deviations):
    """Also where the modelled lowest is not: one of 103 +- 5 reaches further down than one of 100 +- 1."""
    sd, ends = band_of(np.diag(deviations), np.zeros(len(means))).of_lowest(np.array(means), np.ones(len(means)))
    # A quantile of 1000 draws is known to 0.085 standard deviations: four of these, of the widest.
    assert ends == pytest.approx(independent(means, deviations), abs=0.35 * max(deviations))
    assert len(means) > 1 or (sd, *ends) == pytest.approx((2.0, 100.0 - 3.919928, 100.0 + 3.919928))


def test_the_lowest_of_samples_that_are_off_together():
    """Errors that all share move the lowest as they move each: no draws are seen in it."""
    band, stiffness = band_of(np.ones((4, 1)), np.zeros(4)), np.array([104.0, 90.0, 101.0, 108.0])
    sd, ends = band.of_lowest(stiffness, np.ones(4))
    assert (sd, *ends) == pytest.approx((1.0, 90.0 - 1.959964, 90.0 + 1.959964))
    assert band.of_lowest(stiffness, np.array([1.0, 0.0, 1.0, 1.0]))[1].mean() == pytest.approx(101.0)


def test_the_lowest_of_two_places_whose_form_is_half_common():
    """Smaller of two normals correlated by a half (Nadarajah and Kotz 2008, IEEE Trans. VLSI 16, 210)."""
    both, weight = np.array([100.0, 100.0]), np.ones(2)
    sd, ends = band_of(np.zeros((2, 1)), np.ones(2), np.array([0.0, 90.0])).of_lowest(both, weight)
    assert sd == pytest.approx(np.sqrt(1.0 - 0.5 / np.pi), abs=0.09)  # 4 / sqrt(2 x 1000)
    pair = multivariate_normal([0.0, 0.0], [[1.0, 0.5], [0.5, 1.0]])
    expected = [brentq(lambda x, p=p: pair.cdf([-x, -x]) - 1.0 + p, -5.0, 5.0) for p in (0.025, 0.975)]
    assert ends - 100.0 == pytest.approx(expected, abs=0.35)
    # At one place they are the same, but for what keeps their correlation from being singular.
    assert band_of(np.zeros((2, 1)), np.ones(2)).of_lowest(both, weight)[1] == pytest.approx(
        [100.0 - 1.959964, 100.0 + 1.959964], abs=1e-3
    )


def test_no_such_parameter():
    with pytest.raises(InputError, match="no parameter"):
        with_parameter_moved(build_model(NIST), "joint_compliance.compliance_nm_per_N", 1.0)


def test_the_profile_holds_the_band(program):
    from toolpath_stiff.report.curves import profile_band, profile_curve

    found = analyze(with_uncertainty(STRUT_LAW, [1.0, 1.0]), program, step=0.05)
    low, high = profile_band(found)
    _, k = profile_curve(found)
    drawn = ~np.isnan(k)
    assert np.array_equal(np.isnan(low), ~drawn)
    assert (high - low)[drawn] / 2 / 1.959964 == pytest.approx(
        n_per_mm_from_n_per_m(found.parameter_band.deviation[drawn]), rel=1e-9
    )
    found.plot_profile()


def test_under_another_load_what_may_hang_on_it_is_in_the_band_and_the_table(program):
    """A tenth of the compliance at 4 kN: as much, 4^(1/3) or 4 times as much at 1 kN, each as likely."""
    machine = with_errors([0.0, 0.0, 0.0], near=0.01, away=0.01)
    errors = replace(machine.uncertainty.errors, load=4000.0, by_load=0.1)
    machine = machine.with_changes(uncertainty=replace(machine.uncertainty, errors=errors))
    by_load = 0.1 * (((4.0 ** (1.0 / 3.0) - 1.0) ** 2 + 9.0) / 3.0) ** 0.5
    for force, expected in ((4000.0, 0.01), (1000.0, np.hypot(0.01, by_load))):
        found = analyze(machine, program, step=0.05, force=force)
        table = found.to_frame()[found.counted]
        relative = table["stiffness_sd_N_per_mm"] / table["stiffness_N_per_mm"]
        assert relative.to_numpy() == pytest.approx(np.full(len(table), expected), rel=1e-6)
        assert any("may hang on the load" in sentence for sentence in found.to_dict()["assumptions"]) == (
            force < 4000.0
        )
    assert "stiffness_sd_N_per_mm" not in analyze(NIST, program, step=0.05).to_frame()
