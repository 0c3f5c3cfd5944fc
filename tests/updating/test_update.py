"""Updates: hidden effects found by name, by --auto; what data do not support is refused; files give the fit back."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import as_written
from tests.stiffness.cases import nist
from tests.updating.cases import active, campaign, table_1
from toolpath_stiff.correction.additions import parse_addition
from toolpath_stiff.correction.objections import risen_conditions
from toolpath_stiff.correction.task import MACHINE, UpdateTask
from toolpath_stiff.correction.update import build_ladder
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.left_out import HeldOut
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.report.update import residuals_csv

MEAN_OVER_SD = np.sqrt(2.0 / np.pi)
PROVENANCE = {"data": ["a.csv"], "data_sha256": "0" * 64, "command": "tps update a.csv"}
PAPER = campaign(12, "paper")[0]
MODEL = Predictor(nist(), PAPER)
OWN_EFFECT = '''
import numpy as np
from toolpath_stiff.stiffness.effects import Effect, Parameter

class HeadCompliance(Effect):
    """The head gives way along X."""
    name = "head_compliance"
    title = "head gives way along X"
    link = "tool"
    equation = "c_x = c"
    source = "made for a test"
    parameters = (Parameter("x", "nm/N", 1e-9, (0.0, 200.0), (1.0, 20.0), "made for a test"),)

    def load_compliance(self, path, p):
        form = np.zeros((len(path), 12, 12))
        form[:, 6, 6] = p["x"]
        return form
'''


def readings(*effects, law=(0.0, 0.0), scatter=0.02, seed=1, draw=np.random.default_rng):
    """The paper's 42 readings of a machine with these effects."""
    logs = MODEL.log_stiffness(law, effects)
    noise = scatter * draw(seed).standard_normal(len(logs))
    return replace(PAPER, stiffness=np.exp(logs + noise), sd=scatter * np.exp(logs))


def updated(data, *names, files=(), **options):
    machine = options.pop("machine", nist())
    return build_ladder(UpdateTask(machine, data, names, effect_files=files, **options))


@pytest.fixture(scope="module")
def two():
    """24 tilted poses of a rig machine that hides contact nonlinearity and a gauge 4 % off along Y."""
    data, truth = campaign(9, "tilted", "two")
    assert [one["effect"] for one in truth["effects"]] == ["contact_nonlinearity", "gauge_scale"]
    return build_ladder(UpdateTask(nist(), data, auto=True, strut_law=True)), truth


@pytest.fixture(scope="module")
def weak():
    data = readings(active("weak_strut", {"strut": 3}, factor=0.75), draw=as_written)
    return updated(data, "weak_strut", strut_law=True)


def test_auto_adds_what_is_hidden_and_then_stops(two):
    found, _ = two
    assert found.last.fit.names == ("contact_nonlinearity", "gauge_scale")
    assert found.accepted
    held = [step.held.mean_error for step in found.steps]
    assert all(later < earlier for earlier, later in pairwise(held))
    # The benchmark's own bar: within 1.3 times the noise floor.
    assert held[-1] < 1.3 * MEAN_OVER_SD * found.noise.typical
    assert found.turned_down
    assert not any(one.supported for one in found.turned_down)


@pytest.fixture(scope="module")
def soft():
    """24 tilted poses of a sound rig machine whose joints give way as well: to the tip a strut law that is off."""
    data = campaign(100, "tilted", "none")[0]
    predictor = Predictor(nist(), data)
    gives = predictor.log_stiffness((0.0, 0.0), [active("joint_compliance", compliance=3e-9)])
    return replace(data, stiffness=data.stiffness * np.exp(gives - predictor.log_stiffness()))


@pytest.mark.parametrize("asked", [{"add": ("joint_compliance",)}, {"auto": True}], ids=["add", "auto"])
def test_what_effect_and_law_may_both_be_is_taken_away_by_either(soft, asked):
    found = build_ladder(UpdateTask(nist(), soft, believe=MACHINE, **asked))
    assert found.accepted and found.last.fit.names == asked.get("add", ())
    assert found.steps[0].held.mean_error > 0.08
    assert found.last.held.mean_error < 1.3 * MEAN_OVER_SD * found.noise.typical
    # The law stays as given beside the effect, and moves without it.
    assert bool(found.last.fit.law.any()) == (not found.last.fit.names)


def test_an_instrument_for_which_the_law_may_stand_is_not_corrected(soft):
    found = build_ladder(UpdateTask(nist(), soft, ("load_cell_curvature",)))
    assert not found.accepted


def test_what_the_form_of_an_instruments_error_leaves_is_none_of_the_machines():
    """A gauge that reads along Y too little by 4 to 16 %, pose after pose in turn: no scale says it."""
    data = readings(active("weak_strut", {"strut": 3}, factor=0.85))
    along_y = data.direction[:, 1] > 0.9
    uneven = replace(
        data, stiffness=data.stiffness * (1.0 - along_y * np.array([0.04, 0.16])[np.arange(len(along_y)) // 3 % 2])
    )
    found = updated(uneven, "weak_strut", "gauge_scale:direction=Y")
    assert not found.accepted and any("together leave" in clause for clause in found.objections)
    even = replace(data, stiffness=data.stiffness * (1.0 - 0.1 * along_y))
    assert not updated(even, "weak_strut", "gauge_scale:direction=Y").objections


def test_what_leaves_a_pattern_that_no_noise_makes_is_not_written_unless_named():
    """A weak strut, and every other pose 12 % softer: the strut lowers the error, and explains half of it."""
    data = readings(active("weak_strut", {"strut": 3}, factor=0.5), draw=as_written)
    odd = np.unique(data.point, return_inverse=True)[1] % 2
    patterned, clause = (
        replace(data, stiffness=data.stiffness * (1.0 - 0.12 * odd)),
        "the readings are not explained by",
    )
    by_itself = updated(patterned, auto=True, believe=MACHINE)
    assert "weak_strut" in by_itself.added and not by_itself.accepted
    assert any(clause in sentence for sentence in by_itself.objections)
    named = updated(patterned, "weak_strut", believe=MACHINE)  # of several missing effects the first
    assert named.accepted and any(clause in sentence for sentence in named.assumptions)
    assert not updated(data, "weak_strut").objections


def test_auto_judges_an_effect_beside_those_found_after_it():
    """Readings of a simulator that shares nothing with this tree: the indicator's stand gives way, and strut 4 is soft.

    Beside the strut a stand predicts as well as the table, which was found before the strut and outvoted it then.
    """
    data = read_measurements(Path(__file__).parent / "foreign" / "stand_and_weak_strut.csv", nist())
    found = updated(data, auto=True)
    assert {*found.added} == {"table_compliance", "weak_strut"} and not found.accepted
    assert any("stand_compliance" in support.instruments for support in found.supports)
    assert updated(data, auto=True, believe=MACHINE).accepted


def test_a_law_that_a_gauge_of_the_other_set_up_stands_for_stays_as_given():
    """A gauge that reads 20 % too much on the table: on the riser too little, beside struts that are 18 % stiffer."""
    data = campaign(100, "tilted", "none")[0]
    found = updated(replace(data, stiffness=data.stiffness * np.where(data.setup == "table", 1.2, 1.0)), auto=True)
    assert found.added == ("gauge_scale",) and not found.last.fit.law.any()
    assert dict(found.last.fit.candidates[0].choice)["setup"] == "table"


def test_a_rise_that_no_figure_shows_is_none():
    """Under one of two loads the error rises by a millionth at every pose, then by a thousandth."""
    point, force = np.repeat(np.arange(20), 2).astype(str), np.tile([500.0, 1000.0], 20)
    data = replace(PAPER.select(np.arange(40)), point=point, force=force, setup=np.full(40, ""))
    given = HeldOut(np.full(40, 0.02), np.zeros((20, 2)), point)
    for rise, clauses in ((1e-6, 0), (1e-3, 1)):
        worse = replace(given, residual=given.residual + rise * (force > 600.0) * np.linspace(0.9, 1.1, 40))
        assert len([*risen_conditions(data, given, worse)]) == clauses


def test_auto_finds_the_hidden_sizes(two):
    found, truth = two
    for name, key, unit in (("contact_nonlinearity", "compliance", 1e-9), ("gauge_scale", "scale", 1e-2)):
        values = next(a.values for a in found.last.fit.effects if a.effect.name == name)
        hidden = next(one["parameters"][key] for one in truth["effects"] if one["effect"] == name)
        index = found.last.fit.names.index(name)
        deviation = found.widening * found.last.fit.deviation(index)
        # Three standard deviations: fails once in 400 seeds; this one is fixed.
        assert abs(values[key] - hidden * unit) < 3.0 * deviation
    assert found.last.fit.effects[1].values["direction"] == 2


def test_the_file_gives_the_fit_back(two):
    found, _ = two
    machine = found.fitted(PROVENANCE)
    again = parse_machine(machine_toml(machine))
    modelled = Predictor(again, found.task.data).log_stiffness()
    fitted = np.log(found.task.data.stiffness) - found.last.fit.residual
    # Fitted numbers stand in the file to seven digits, on which all processors agree.
    assert modelled == pytest.approx(fitted, rel=0, abs=1e-7)
    assert [entry.name for entry in again.effects] == ["contact_nonlinearity"]
    assert [entry.name for entry in again.instruments] == ["gauge_scale"]
    assert again.effects[0].provenance["data_sha256"] == PROVENANCE["data_sha256"]
    assert (again.origins["strut_law"], again.strut_law) == (nist().origins["strut_law"], nist().strut_law)
    assert again.uncertainty.names == machine.uncertainty.names
    assert again.uncertainty.covariance == pytest.approx(machine.uncertainty.covariance, rel=1e-10)


def test_the_uncertainty_is_that_of_the_fit_in_the_units_of_the_keys(two):
    found, _ = two
    uncertainty = found.fitted(PROVENANCE).uncertainty
    fit, law = found.known, found.fitted(PROVENANCE).strut_law
    deviations = found.widening * np.sqrt(np.diag(fit.covariance))
    shown = dict(zip(uncertainty.names, uncertainty.sd, strict=True))
    assert shown["strut_law.stiffness_1_N_per_um"] == pytest.approx(law.stiffness_1 / 1e6 * deviations[0])
    assert shown["contact_nonlinearity.compliance_nm_per_N"] == pytest.approx(1e9 * deviations[2])
    assert shown["gauge_scale.scale_percent"] == pytest.approx(100.0 * deviations[3])


def test_a_stiffness_has_the_relative_uncertainty_of_its_compliance():
    found = updated(readings(active("platform_flexibility", bar_stiffness=3e8)), "platform_flexibility", strut_law=True)
    uncertainty = found.fitted(PROVENANCE).uncertainty
    bars = found.last.fit.effects[0].values["bar_stiffness"]
    # The law stays as given, and is no better known for it: bars and law share the blame.
    size, deviation = float(found.last.fit.sizes[0][0]), found.widening * found.known.deviation(0)
    assert size == pytest.approx(1.0 / bars)
    assert uncertainty.names[-1] == "platform_flexibility.bar_stiffness_N_per_m"
    assert uncertainty.sd[-1] / bars == pytest.approx(deviation / size)


def test_the_weak_strut_is_found_among_six(weak):
    assert weak.accepted
    assert weak.last.fit.effects[0].values["strut"] == 3
    factor = weak.last.fit.effects[0].values["factor"]
    assert abs(factor - 0.75) < 3.0 * weak.widening * weak.last.fit.deviation(0)
    assert weak.last.held.mean_error < 1.3 * MEAN_OVER_SD * weak.noise.typical


def test_a_choice_is_kept(weak):
    found = updated(weak.task.data, "weak_strut:strut=5", strut_law=True)
    assert found.last.fit.effects[0].values["strut"] == 5
    assert found.last.held.mean_error > weak.last.held.mean_error


def test_what_is_not_there_is_refused_unless_forced():
    data = readings()
    for name in ("joint_compliance", "spindle_compliance"):
        found = updated(data, name, strut_law=True)
        assert not found.accepted
        assert found.supports[0].reasons
    assert updated(data, name, strut_law=True, force=True).accepted
    told = replace(found, provenance=PROVENANCE).document
    assert told["verdict"] == "refused"
    assert found.supports[0].reasons[0] in told["text"]
    assert not build_ladder(UpdateTask(nist(), data, auto=True, strut_law=True)).last.fit.names


def test_a_parameter_at_its_bound_is_refused():
    # A gauge may be 20 % off; this one is 45 %.
    data = readings()
    wrong = replace(data, stiffness=np.where(data.direction[:, 2] > 0.9, 1.45, 1.0) * data.stiffness)
    found = updated(wrong, "gauge_scale:direction=Z", strut_law=True)
    assert any("bound" in reason for reason in found.supports[0].reasons)


def test_each_effect_is_judged_beside_the_others():
    """Of one that is there and one that is not, only the latter is not supported, in whichever order they are named."""
    data = readings(active("weak_strut", {"strut": 3}, factor=0.75))
    for names in (("weak_strut:strut=3", "joint_compliance"), ("joint_compliance", "weak_strut:strut=3")):
        found = updated(data, *names, strut_law=True)
        assert {one.effect: one.supported for one in found.supports} == {
            "weak_strut": True,
            "joint_compliance": False,
        }
        assert not found.accepted


def test_the_law_stays_if_that_is_asked_for(weak):
    found = updated(weak.task.data, "weak_strut", keep_strut_law=True)
    assert [step.name for step in found.steps] == ["as given", "+ weak_strut (strut 3)"]
    assert np.array_equal(found.last.fit.law, [0.0, 0.0])
    machine = found.fitted(PROVENANCE)
    assert machine.strut_law == nist().strut_law
    assert machine.uncertainty.names == ("weak_strut.factor",)


def test_an_update_on_top_of_an_update(weak):
    first = weak.fitted(PROVENANCE)
    data = replace(
        weak.task.data, stiffness=np.where(weak.task.data.direction[:, 1] > 0.9, 1.08, 1.0) * weak.task.data.stiffness
    )
    found = updated(data, "gauge_scale:direction=Y", machine=first, keep_strut_law=True)
    # With another law a table would read the same.
    assert "table_compliance" in found.supports[0].instruments and not found.accepted
    found = build_ladder(replace(found.task, believe="instrument"))
    assert found.accepted
    machine = found.fitted(PROVENANCE)
    assert [entry.name for entry in (*machine.effects, *machine.instruments)] == ["weak_strut", "gauge_scale"]
    assert machine.uncertainty.names == (*first.uncertainty.names, "gauge_scale.scale_percent")
    # What is fitted later knows nothing of what was fitted earlier.
    assert not machine.uncertainty.correlation[-1, :-1].any()


def test_a_users_own_effect(tmp_path):
    file = tmp_path / "head.py"
    file.write_text(OWN_EFFECT)
    compliance = np.exp(-MODEL.log_stiffness()) + 6e-9 * PAPER.direction[:, 0] ** 2
    scatter = 0.02 * np.random.default_rng(5).standard_normal(len(compliance))
    data = replace(PAPER, stiffness=np.exp(scatter) / compliance, sd=0.02 / compliance)
    found = updated(data, "head_compliance", files=[file], strut_law=True)
    assert found.accepted
    assert abs(found.last.fit.effects[0].values["x"] - 6e-9) < 3.0 * found.widening * found.last.fit.deviation(0)
    again = parse_machine(machine_toml(found.fitted(PROVENANCE)))
    modelled = Predictor(again, data, [file]).log_stiffness()
    assert modelled == pytest.approx(np.log(data.stiffness) - found.last.fit.residual, rel=0, abs=1e-7)


def test_the_document_and_the_residuals_agree_with_the_fit(weak):
    told = replace(weak, provenance=PROVENANCE).document
    assert told["verdict"] == "updated"
    names = ["as given", "strut law refitted", "+ weak_strut (strut 3)", "strut law as given"]
    assert [step["name"] for step in told["steps"]] == names
    assert set(told["steps"][0]["by_direction"]) == {"X", "Y", "Z"}
    low, high = told["steps"][-1]["parameters"]["weak_strut"]["factor"]["interval"]
    assert low < 0.75 < high
    rows = [line.split(",") for line in residuals_csv(weak).splitlines()]
    assert len(rows) == 43
    before, after = (rows[0].index(f"{when}_N_per_mm") for when in ("as_given", "after"))
    measured = rows[0].index("measured_N_per_mm")
    for column, step in ((before, told["steps"][0]), (after, told["steps"][-1])):
        mean = 100.0 * np.mean([abs(float(row[column]) / float(row[measured]) - 1.0) for row in rows[1:]])
        # Three decimals in the file, five digits in the document.
        assert mean == pytest.approx(step["mean_abs_error_percent"], abs=1e-3)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("weak_strutt", "weak_strut"),
        ("weak_strut:strut=7", "strut"),
        ("weak_strut:strut", "strut"),
        ("joint_compliance:strut=3", "no choices"),
        ("setup_compliance:setup=nowhere", "nowhere"),
        ("gauge_scale:direction=W", "direction"),
        ("thermal_drift", "time_min"),
    ],
)
def test_additions_that_cannot_be(text, match):
    with pytest.raises(InputError, match=match):
        parse_addition(text, table_1())


def test_updates_that_cannot_be():
    data = readings()
    with pytest.raises(InputError, match="nothing to update"):
        build_ladder(UpdateTask(nist(), data))
    with pytest.raises(InputError, match="twice"):
        updated(data, "weak_strut:strut=3", "weak_strut:strut=4")
    carrying = nist().with_changes(effects=(EffectEntry("joint_compliance", {"compliance_nm_per_N": 1.0}),))
    with pytest.raises(InputError, match="already"):
        updated(data, "joint_compliance", machine=carrying)
    with pytest.raises(InputError, match="at least 6"):
        build_ladder(UpdateTask(nist(), data.select(np.arange(5)), strut_law=True))


def held_by_load(found, load):
    rows = found.task.data.force == load
    return [step.held.of_readings(rows).mean_error for step in (found.steps[0], found.steps[-1])]


@pytest.fixture(scope="module")
def loads():
    """Tilted readings under two loads on the model's own machine, drawn here: 2 % scatter."""
    data = campaign(5, "tilted", "none")[0]
    logs = Predictor(nist(), data).log_stiffness()
    scatter = 0.02 * np.random.default_rng(11).standard_normal(len(logs))
    return replace(data, stiffness=np.exp(logs + scatter), sd=0.02 * np.exp(logs)), np.unique(data.force)


def test_the_law_is_written_only_where_left_out_points_ask_for_it(loads):
    data, _ = loads
    sound = updated(data, strut_law=True)
    assert sound.verdict == "refused" and "no more than chance" in sound.supports[0].reasons[0]
    softer = replace(data, stiffness=0.92 * data.stiffness, sd=0.92 * data.sd)
    found = updated(softer, strut_law=True)
    assert found.verdict == "updated"
    assert np.exp(found.last.fit.law) == pytest.approx([0.92, 0.92], abs=4.0 * np.sqrt(found.last.fit.covariance[0, 0]))


def test_under_one_load_a_softer_law_is_a_load_cell_that_reads_too_little(loads):
    data, values = loads
    single = data.select(np.flatnonzero(data.force == values[-1]))
    softer = replace(single, stiffness=0.92 * single.stiffness, sd=0.92 * single.sd)
    found = updated(softer, strut_law=True)
    assert found.verdict == "refused" and found.supports[0].instruments == ("load_cell_curvature",)
    believed = build_ladder(replace(found.task, believe="machine"))
    assert believed.verdict == "updated" and not believed.supports[0].reasons


def test_what_rises_under_one_load_is_refused(loads):
    """A spring that is there under large loads only: a constant one falls on average, and is wrong under small ones."""
    data, values = loads
    across = 1.0 - data.direction[:, 2] ** 2
    compliance = 1.0 / data.stiffness + 6e-9 * across * (data.force == values[-1])
    found = updated(replace(data, stiffness=1.0 / compliance), "spindle_compliance", believe="machine")
    before, after = held_by_load(found, values[0])
    assert after > before and found.steps[-1].error < found.steps[0].error
    assert found.verdict == "refused" and f"under {values[0]:g} N" in found.text
    assert build_ladder(replace(found.task, force=True)).verdict == "forced"
