"""The portrait of what is missing: terms are physics, the dictionary finds them, a sound machine gets none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.updating.cases import effect_of
from toolpath_stiff.inference import candidates
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.fits import fit_effects
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.portrait.alike import looks_the_same
from toolpath_stiff.portrait.columns import Ground
from toolpath_stiff.portrait.dictionary import crossed, dictionary_of
from toolpath_stiff.portrait.portrait import Portrait, draw_portrait
from toolpath_stiff.portrait.words import alike_entry, portrait_entry, term_words
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig import case, exercise
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.terms import LINKS, SHAPES, VARIABLES, Term


@cache
def sound(seed: int, folder: str) -> Predictor:
    """A campaign of the rig on a machine that hides nothing."""
    rows, _ = case.make_case(seed, layout="tilted", hidden="none")
    file = Path(folder) / f"sound_{seed}.csv"
    file.write_text(exercise.csv_text(rows), encoding="utf-8")
    nist = load_machine("nist")
    found = Predictor(nist, read_measurements(file, nist))
    assert found.joint_columns.size
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return str(tmp_path_factory.mktemp("portrait"))


def forces(predictor: Predictor) -> np.ndarray:
    """(n, 6) strut forces per unit load, of J^T f = w solved here."""
    struts = predictor.full_path.struts
    jacobian = np.concatenate([struts.directions, np.cross(struts.arms, struts.directions)], axis=-1)
    wrench = np.concatenate([predictor.data.direction, np.zeros_like(predictor.data.direction)], axis=1)
    return np.linalg.solve(np.swapaxes(jacobian, 1, 2), wrench[..., None])[..., 0]


def portrait_with(predictor: Predictor, added: np.ndarray) -> Portrait:
    """The portrait of the same campaign on a machine with more compliance (n,), m/N."""
    compliance = np.exp(-predictor.log_stiffness())
    data = replace(predictor.data, stiffness=predictor.data.stiffness * compliance / (compliance + added))
    with_more = Predictor(predictor.machine, data)
    noise = noise_models(data)[-1]
    problem = Problem.of(with_more, noise)
    return draw_portrait(problem, problem.score_base(), noise, seed=0)


def test_every_term_is_the_effect_that_it_says(folder):
    # The dictionary's columns are sums of squared forces; the effect goes through the exact route.
    predictor = sound(1, folder)
    base = predictor.log_stiffness()
    compliance = np.exp(-base)
    ground = Ground(predictor, compliance, np.zeros(2))
    dictionary = dictionary_of(ground)
    acting = [i for i, term in enumerate(dictionary.terms) if term.acts and term.action != "joint offset"]
    rng = np.random.default_rng(0)
    of_action: dict[str, list[int]] = {}
    for i in acting:
        of_action.setdefault(dictionary.terms[i].action, []).append(i)
    assert len(of_action) > 10
    for i in [k for same in of_action.values() for k in rng.choice(same, 5, replace=False).tolist()]:
        term = dictionary.terms[i]
        size = 0.01 / np.sqrt(np.mean((ground.column(term) / compliance) ** 2))
        whole = predictor.log_stiffness(effects=[ActiveEffect(effect_of(term), {"size": size})])
        np.testing.assert_allclose(np.exp(-whole), compliance + size * ground.column(term.sized(size)), rtol=1e-11)


def test_a_resistance_to_turning_grows_by_its_slope(folder):
    # It stands parallel to the struts: what it takes away is not in proportion to its size.
    predictor = sound(1, folder)
    ground = Ground(predictor, np.exp(-predictor.log_stiffness()), np.zeros(2))
    swing = (("centre", 0.0), ("reach", 0.6))
    term = Term("joints", "all", "tilt", "square", "turning", at=swing, column="platform joint").sized(2e5)
    more, less = (size * ground.column(term.sized(size)) for size in (2.001e5, 1.999e5))
    np.testing.assert_allclose(ground.slope(term), (more - less) / 200.0, rtol=1e-5)
    assert np.abs(ground.slope(term) / ground.column(term) - 1.0).max() > 0.05


def test_joints_that_turn_less_easily_under_small_loads_are_recognised(folder):
    # By the catalogue's effect at each load by itself; no shape of the dictionary is this one.
    predictor = sound(1, folder)
    load, whole = predictor.data.force, np.zeros(288)
    for force in np.unique(load).tolist():
        stiffness = 3e5 * 300.0 / (300.0 + force)
        (effect,) = (e for e in candidates.testable_effects(predictor)[0] if e.name == "joint_moment_stiffness")
        found = np.exp(-predictor.log_stiffness(effects=[ActiveEffect(effect, {"strut": 0, "stiffness": stiffness})]))
        whole = np.where(load == force, found, whole)
    found = portrait_with(predictor, whole - np.exp(-predictor.log_stiffness()))
    assert found.links[0][0] == "joints"
    assert found.terms[0].term.action == "turning"
    assert [name for name, _ in found.variables] == ["load"]
    assert found.held_out_rms < 1.3 * found.noise_floor


def test_joints_that_give_along_a_pin_are_recognised(folder):
    predictor = sound(2, folder)
    path = predictor.full_path
    joints = path.machine.platform_joints[:, :2]
    pins = np.zeros((6, 3))
    pins[:, :2] = joints / np.linalg.norm(joints, axis=1, keepdims=True)
    along = np.einsum("nki,nij,kj->nk", path.struts.directions, path.rotation, pins)
    found = portrait_with(predictor, 3e-8 * (forces(predictor) ** 2 * along**2).sum(axis=1))
    assert found.terms[0].term.action == "platform pin"
    assert found.terms[0].term.direction == "radial"
    low, high = found.terms[0].interval
    assert low < 3e-8 < high


def test_a_long_tool_that_bends_with_its_cube_is_recognised(folder):
    # A cantilever, 3 E I / l^3; the campaign has two lengths, the long tool at a sixth of its poses.
    predictor = sound(3, folder)
    data, length = predictor.data, predictor.machine.reference_tool_length
    axis = predictor.full_path.rotation[:, :, 2]
    across = 1.0 - (data.direction * axis).sum(axis=1) ** 2
    found = portrait_with(predictor, 2.5e-9 * across * ((length + data.tool_extension) / length) ** 3)
    assert found.terms[0].term.link == "tool"
    assert found.terms[0].term.variable == "tool length"
    assert "tool's length" in term_words(found.terms[0].term)
    low, high = found.terms[0].interval
    assert low < 2.5e-9 < high


def test_a_hose_that_holds_the_platform_is_recognised(folder):
    # A spring of 4 N/um along Y at the middle of the platform joints, by Sherman and Morrison (1950) on the compliance
    # of six springs, J^-1 K^-1 J^-T, put together here.
    predictor = sound(4, folder)
    path, direction = predictor.full_path, predictor.data.direction
    struts = path.struts
    jacobian = np.concatenate([struts.directions, np.cross(struts.arms, struts.directions)], axis=-1)
    inverse = np.linalg.inv(jacobian)
    softness = 1.0 / path.machine.strut_law.stiffness(struts.lengths)
    compliance = np.einsum("nij,nj,nkj->nik", inverse, softness, inverse)
    middle, y = struts.arms.mean(axis=1), np.array([0.0, 1.0, 0.0])
    held = np.concatenate([np.broadcast_to(y, middle.shape), np.cross(middle, y)], axis=1)
    moved = np.einsum("nij,nj->ni", compliance, held)
    along = (moved[:, :3] * direction).sum(axis=1)
    taken = along**2 / (1.0 / 4e6 + (moved * held).sum(axis=1))
    found = portrait_with(predictor, -taken)
    (one,) = found.terms
    assert (one.term.link, one.term.action, one.term.direction) == ("platform", "spring", "Y")
    low, high = one.interval
    assert low < 4e6 < high
    assert not found.lacking
    assert "dictionary lacks" not in portrait_entry(found)["text"]
    left = portrait_entry(replace(found, held_out_rms=1.31 * found.noise_floor))
    assert left["lacking"]
    assert left["text"].startswith("The dictionary lacks what is missing: the terms stand for it, the error at points")
    assert "1.3 times the noise, and link and variable may be wrong" in left["text"]


def test_the_dictionary_speaks_the_agreed_words(folder):
    dictionary = dictionary_of(Ground(sound(1, folder), np.exp(-sound(1, folder).log_stiffness()), np.zeros(2)))
    terms = dictionary.terms
    assert {t.link for t in terms} == set(LINKS)
    assert {t.variable for t in terms} <= set(VARIABLES)
    assert {t.shape for t in terms} <= set(SHAPES)
    assert len({t.key for t in terms}) == len(terms)
    assert np.exp(dictionary.log_prior).sum() <= 1.0 + 1e-9


def test_columns_of_many_readings_are_made_again_and_are_the_same(folder, monkeypatch):
    ground = Ground(sound(1, folder), np.exp(-sound(1, folder).log_stiffness()), np.zeros(2))
    kept = dictionary_of(ground)
    columns, some = np.concatenate([*kept.columns()]), slice(None, None, 97)
    one_by_one = [ground.column(term) / ground.compliance for term in kept.terms[some]]
    np.testing.assert_allclose(columns[some], one_by_one, rtol=1e-12, atol=1e-12)
    for module in ("columns", "dictionary"):
        monkeypatch.setattr(f"toolpath_stiff.portrait.{module}.MOST_HELD", 0)
    made_again = dictionary_of(Ground(ground.predictor, ground.compliance, np.zeros(2)))
    assert made_again.terms == kept.terms
    np.testing.assert_allclose(np.concatenate([*made_again.columns()]), columns, rtol=1e-5, atol=1e-6)


def test_what_can_only_give_has_no_negative_size_and_factors_leave_a_stiffness():
    give = Term("table", "Y", "y", "slope", "give", at=(("start", -0.4), ("end", 0.4)))
    assert effect_of(give).parameters[0].bounds[0] == 0.0
    factor = Term("one strut", "along the struts", "constant", "offset", "strut factor", where=2)
    assert -100.0 < effect_of(factor).parameters[0].bounds[0] < 0.0


def test_no_effect_sees_the_order_of_the_readings():
    term = Term("one strut", "along the struts", "order", "slope", "strut factor", 2, (("start", 0.0), ("end", 1.0)))
    assert not term.acts


def test_a_table_that_gives_way_towards_one_side_is_recognised(folder):
    # A smooth step that no shape of the dictionary is.
    predictor = sound(1, folder)
    y = predictor.data.position[:, 1]
    found = portrait_with(predictor, 6e-9 * predictor.data.direction[:, 1] ** 2 * (1.0 + np.tanh(y / 0.08)))
    entry = portrait_entry(found)
    assert "table" in [one["link"] for one in entry["links"]]
    assert [one["variable"] for one in entry["variables"]] == ["y"]
    assert entry["terms"][0]["direction"] == "Y"
    assert entry["held_out_rms_percent"] < 1.3 * entry["noise_floor_percent"]
    assert entry["explained_percent"] > 90.0
    assert entry["look_elsewhere"] < 0.01


def test_a_plate_that_gives_in_shear_is_recognised(folder):
    # Along X and Y alike, growing with the order of the readings as no shape of the dictionary does.
    predictor = sound(1, folder)
    order = np.linspace(0.0, 1.0, 288)
    sideways = (predictor.data.direction[:, :2] ** 2).sum(axis=1)
    found = portrait_with(predictor, 5e-9 * sideways * (1.0 - np.exp(-order / 0.25)))
    assert {"table", "frame"} & {name for name, _ in found.links}
    assert "horizontal" in {one.term.direction for one in (*found.terms, *found.alike)}
    assert [name for name, _ in found.variables] == ["order"]


def test_two_causes_are_found_wherever_the_search_begins(folder):
    # Joints that hold small loads and a frame that gives: added one by one, from the frame on, they are not found.
    predictor = sound(2, folder)
    ground = Ground(predictor, np.exp(-predictor.log_stiffness()), np.zeros(2))
    causes = [
        (8e-9, Term("joints", "along the struts", "load", "threshold", "strut", at=(("beyond", 400.0),))),
        (9e-9, Term("frame", "along the struts", "load", "slope", "vertex", at=(("power", -1.0), ("reference", 2e3)))),
    ]
    found = portrait_with(predictor, sum(size * ground.column(term) for size, term in causes))
    assert {"load", "strut force"} >= {one.term.variable for one in found.terms}
    assert {one.term.link for one in found.terms} >= {"frame"}
    assert found.held_out_rms < 1.3 * found.noise_floor
    assert sum(weight for _, weight in found.links) == pytest.approx(1.0, abs=0.1)


def test_a_strut_that_is_softer_in_tension_is_recognised(folder):
    predictor = sound(2, folder)
    own = forces(predictor)[:, 4]
    stiffness = predictor.machine.strut_law.stiffness(predictor.full_path.struts.lengths[:, 4])
    found = portrait_with(predictor, 0.5 * own**2 * (own > 0.0) / stiffness)
    assert found.links[0][0] == "one strut"
    assert found.terms[0].term.where == 5
    assert found.variables[0][0] == "force sign"
    low, high = found.terms[0].interval
    assert low < 0.5 < high


def test_a_sound_machine_has_no_description(folder):
    found = portrait_with(sound(2, folder), np.zeros(288))
    assert not found.terms
    assert found.look_elsewhere > 0.01
    assert portrait_entry(found)["terms"] == []
    assert "No description" in portrait_entry(found)["text"]


def test_a_frame_looks_the_same_as_a_table(folder):
    # Both stand between tool and work in base axes: no reading tells them apart, however many there are.
    predictor = sound(1, folder)
    compliance = np.exp(-predictor.log_stiffness())
    added = 5e-9 * predictor.data.direction[:, 0] ** 2
    data = replace(predictor.data, stiffness=predictor.data.stiffness * compliance / (compliance + added))
    problem = Problem.of(Predictor(predictor.machine, data), noise_models(data)[-1])
    effects = candidates.testable_effects(problem.predictor)[0]
    (table,) = candidates.candidates_of(next(one for one in effects if one.name == "table_compliance"), data)
    base = problem.score_base()
    named = fit_effects(problem, [table], [np.array([5e-9, 0.0, 0.0, 0.0])], (0,), base.law)
    alike = looks_the_same(problem, base, named, noise_models(data)[-1], seed=0)
    found = alike["table_compliance"]
    told = {(term.link, term.direction, term.variable) for term, _ in found.terms}
    assert ("frame", "X", "constant") in told
    assert ("table", "X", "constant") not in told  # the effect itself
    entry = alike_entry(alike)
    assert "frame" in [one["link"] for one in entry["links"]]
    assert "the frame gives way along X" in entry["text"]
    same = [
        one for one in entry["terms"] if (one["link"], one["direction"], one["variable"]) == ("frame", "X", "constant")
    ]
    assert same[0]["size"] == pytest.approx(1e9 * named.sizes[0][0], rel=0.01)


def test_nothing_looks_the_same_where_no_single_effect_is_named(folder):
    predictor = sound(1, folder)
    problem = Problem.of(predictor, noise_models(predictor.data)[-1])
    base = problem.score_base()
    assert looks_the_same(problem, base, base, noise_models(predictor.data)[-1], seed=0) == {}


def test_the_same_readings_give_the_same_portrait(folder):
    predictor = sound(1, folder)
    added = 4e-9 * predictor.data.direction[:, 0] ** 2
    assert portrait_entry(portrait_with(predictor, added)) == portrait_entry(portrait_with(predictor, added))


def test_a_shape_is_tried_at_every_place_that_may_feel_it(folder):
    predictor = sound(1, folder)
    ground = Ground(predictor, np.exp(-predictor.log_stiffness()), np.zeros(2))
    term = Term("table", "Y", "y", "bump", "give", at=(("centre", 0.1), ("width", 0.05)))
    terms = crossed(term, ground)
    assert {"table", "frame", "struts", "one strut", "instrument", "platform"} == {other.link for other in terms}
    assert term in terms
    assert all("y is about 100 mm" in term_words(other) for other in terms)
