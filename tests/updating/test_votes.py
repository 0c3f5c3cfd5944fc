"""Votes of left-out poses, fair forms, and what the nuisances have taken up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.stiffness.cases import nist
from tests.updating.cases import campaign, diagnosed, examined, judged
from toolpath_stiff.correction.task import MACHINE, UpdateTask
from toolpath_stiff.correction.update import build_ladder
from toolpath_stiff.diagnosis.words import why
from toolpath_stiff.inference import judgement
from toolpath_stiff.inference.fair_forms import fair_rivals
from toolpath_stiff.inference.gates import absolute_gate
from toolpath_stiff.inference.nuisances import findings, fitted_nuisances, nuisance_words
from toolpath_stiff.inference.prequential import votes
from toolpath_stiff.inference.rivals import SERIES, entries, place_of
from toolpath_stiff.inference.votes import SMALL, chance_of_losing, closest, outvoted, standard_error, vote_words
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect

STRONG = 0.1


def test_a_rival_is_outvoted_by_all_poses_not_by_one():
    rng = np.random.default_rng(0)
    even = 1.0 + 0.2 * rng.standard_normal(20)
    assert outvoted(even) and not outvoted(-even)
    assert not outvoted(0.1 * even)  # sure, and too little to say anything (Sivula and others)
    alone = np.zeros(20)
    alone[3] = 20.0
    assert (alone - 0.3).sum() > SMALL and not outvoted(alone - 0.3)
    # Two poses out of nine say most: surely more than chance only where the rest says enough, too.
    few = np.concatenate([[9.0, 7.0, -4.0], np.zeros(6)])
    assert chance_of_losing(few) > 0.05 and not outvoted(few) and outvoted(few + np.eye(9)[1] * 2.0)
    assert not outvoted(even[:5] * 10.0)  # five poses have no spread that means anything
    assert standard_error(even) == pytest.approx(np.sqrt(20) * even.std(ddof=1))
    # Of normal votes the Bayesian bootstrap gives what a normal mean would.
    from scipy.stats import norm

    assert chance_of_losing(even - 0.95) == pytest.approx(norm.sf((even - 0.95).sum() / standard_error(even)), abs=0.03)
    assert "worse by" in vote_words("x", even) and "better by" in vote_words("x", -even)


@pytest.mark.parametrize("layout", ["tilted", "paper"])
def test_a_law_that_had_to_move_is_not_all_that_it_may_be(layout, hidden="joint_compliance"):
    """Soft joints shift the law alone, which leaves scatter; so does a load cell, and the machine is as it was."""
    found = diagnosed(7, layout, hidden, STRONG)
    assert found.verdict == "ambiguous" and found.explanations[0] == "none" and hidden in found.plausible
    assert len(found.entries) <= 3 and "the strut law is off and moves the stiffness by" in found.to_dict()["text"]
    assert not found.fits[hidden].law_free and found.fits[hidden].sizes[0][0] > 0.0
    sound = diagnosed(100, layout, "none")
    assert sound.verdict == "adequate" and not sound.main.votes


def test_entries_put_together_what_sits_at_one_place_and_reads_alike():
    found = diagnosed(7, "paper", "table_compliance", STRONG)
    fits = {family.name: family.best for family in found.main.families} | found.main.fits
    # Without what may stand in place of the first one's law beside the file's.
    heads = [[name for name in names if name == names[0] or names[0] not in name] for names in found.entries]
    named = [[c for name in names for c in fits[name].candidates if c.name not in SERIES] for names in heads]
    # One place, but for a stand that gives as a frame does: the same to every reading of the tip.
    places = [{place_of(c.effect) for c in candidates if c.name != "stand_compliance"} for candidates in named]
    assert all(len(place) <= 1 for place in places)
    assert [name for names in found.entries for name in names] == [*found.explanations]
    problem = found.main.problem
    assert entries(problem, fits, ["table_compliance", "none", "frame_sway", "x"])[1:] in (
        [("none",), ("x",)], [("none",), ("frame_sway",), ("x",)]
    )  # fmt: skip
    assert entries(problem, fits, ["weak_strut", "table_compliance"]) == [("weak_strut",), ("table_compliance",)]


def test_a_vote_is_what_a_pose_adds_to_the_density_of_those_before_it():
    """By the Cholesky factor of the dense covariance of all readings, whose whitened residuals are innovations."""
    judgement = judged(7, "paper", "weak_strut", STRONG)
    problem, base, fit = judgement.problem, judgement.base, judgement.fits["weak_strut"]
    given, point = problem.scatter.covariance, problem.predictor.data.point
    order, wild = np.argsort(point, kind="stable"), sorted({*fit.scatter.wild, *base.scatter.wild})
    dense = np.diag(given.own_variance) + given.shared.T @ given.shared
    dense += given.common * (given.groups.of[:, None] == given.groups.of)
    dense[wild, wild] += problem.scatter.widening[wild]
    lower = np.linalg.cholesky(dense[np.ix_(order, order)])

    def density(one) -> np.ndarray:
        squares = np.linalg.solve(lower, one.residual[order]) ** 2
        price = len(one.free) + 0.5 * float(one.law @ one.law) / 0.2**2
        labels = np.unique(point)
        return np.array([-0.5 * squares[point[order] == label].sum() - price / len(labels) for label in labels])

    votes_for = votes(problem, fit, {"none": base})["none"]
    assert votes_for == pytest.approx(density(fit) - density(base), abs=1e-3)
    # Of a fit with the file's strut law: two constants fewer.
    held = replace(base, law_free=False, law=np.zeros(2))
    law = 2.0 + 0.5 * float(base.law @ base.law) / 0.2**2
    assert votes(problem, fit, {"none": held})["none"].sum() == pytest.approx(votes_for.sum() - law, abs=1e-2)


def test_a_name_has_outvoted_every_rival_and_says_by_how_much():
    found = diagnosed(7, "paper", "weak_strut", STRONG)
    assert found.verdict == "identified" and all(outvoted(each) for each in found.main.votes.values())
    document = found.to_dict()
    assert document["votes"][0]["rival"] == next(iter(found.main.votes)) and document["votes"][0]["outvoted"]
    assert f"{document['votes'][0]['rival']} predicts pose after pose worse by" in document["text"]
    rivals = {entry["effect"]: entry["vote"] for entry in document["candidates"]}
    assert rivals["weak_strut"] is None and rivals["table_compliance"]["gain"] > SMALL


def test_a_name_that_leaves_more_than_the_model_alone_may_stands_beside_the_closest_rival(monkeypatch):
    found = diagnosed(7, "paper", "weak_strut", STRONG)
    monkeypatch.setattr(
        judgement,
        "absolute_gate",
        lambda *args: replace(gate := absolute_gate(*args), probability=min(gate.probability, 0.05)),
    )
    effects = [find_effect(name) for name in ("weak_strut", "table_compliance", "gauge_scale")]
    again = judgement.judge(found.main.problem, found.noise, effects, seed=0)
    assert again.verdict == "ambiguous" and again.explanations == ("weak_strut", next(iter(again.votes)))
    assert all(map(outvoted, again.votes.values()))
    text = why(replace(found, verdict="ambiguous", judgements={"": again}, main=again))
    assert any("weak_strut leaves more than noise would (p = 0.05)" in reason for reason in text)


def test_untilted_a_table_is_a_tool_whose_axes_differ():
    """The same readings to the last digit: the form that is fair to the tool predicts as well as the table."""
    judgement = judged(7, "paper", "table_compliance", STRONG)
    rivals = fair_rivals(judgement.problem, judgement.fits["table_compliance"], judgement.base)
    against = votes(judgement.problem, judgement.fits["table_compliance"], rivals)
    assert abs(against["spindle_compliance"].sum()) < 1.0
    assert judgement.verdict == "ambiguous" and "spindle_compliance" in judgement.explanations


def test_votes_against_a_rival_are_those_of_its_strongest_form():
    assert list(closest({"x": np.ones(3)}, {"x": np.zeros(3), "w": np.full(3, 2.0)})) == ["x", "w"]


def displaced(millimetres: float, hidden: str = "none"):
    """A tilted campaign, as machine file `nist` reads it if a joint of the platform stands off its place, too."""
    data = campaign(100, "tilted", hidden, size=0.1)[0]
    problem = judged(100).problem
    off = ActiveEffect(find_effect("joint_offset"), {"joint": 9, "x": 0.0, "y": 0.0, "z": millimetres / 1e3})
    change = problem.predictor.log_stiffness((0.0, 0.0), [off]) - problem.predictor.log_stiffness()
    return examined(nist(), replace(data, stiffness=data.stiffness * np.exp(change)))


def test_a_joint_off_its_place_is_told():
    found = displaced(11.0)
    entry = fitted_nuisances(found.main.base, found.noise)[0]
    assert (entry["nuisance"], entry["end"]) == ("joint", "platform") and entry["sigma"] > 3.0
    assert found.verdict != "adequate" and "joint_offset" in found.plausible
    fit = found.fits["joint_offset"]
    assert dict(fit.candidates[0].choice) == {"joint": 9}
    assert abs(fit.sizes[0][2] - 0.011) < 3.3 * fit.deviation(2)
    if found.verdict == "identified":
        assert found.to_dict()["text"].startswith("The joint of strut 3 on the platform stands off its place by about")


def test_a_joint_off_its_place_is_told_beside_another_effect():
    """Of another joint than the one that would do best alone, and as far as it stands out beside the effect alone."""
    found = displaced(8.0, "spindle_compliance")
    assert "joint_offset + spindle_compliance" in found.explanations
    fit = found.fits["joint_offset + spindle_compliance"]
    assert {"joint": 9} in [dict(candidate.choice) for candidate in fit.candidates]


def test_sound_joints_are_no_finding():
    """Bonferroni's price of 18: at three standard deviations one sound campaign in 370 has a finding."""
    for seed in (100, 101, 102):
        judgement = judged(seed)
        entries = fitted_nuisances(judgement.base, judgement.noise)
        assert len(entries) == 18 and not findings(entries)
        assert "too" in nuisance_words({**entries[0], "nuisance": "strut", "stiffness_percent": -1.0})


def test_what_an_instrument_shows_as_well_is_not_written_into_a_machine():
    """A frame that sways is a stand that gives: refused, with the reading that tells, unless the user believes it."""
    data = campaign(100, "tilted", "none")[0]
    problem = judged(100).problem
    sways = ActiveEffect(find_effect("frame_sway"), {"sideways": 4e-9, "vertical": 2e-9, "rocking": 0.0})
    change = problem.predictor.log_stiffness((0.0, 0.0), [sways]) - problem.predictor.log_stiffness()
    swaying = replace(data, stiffness=data.stiffness * np.exp(change))
    refused = build_ladder(UpdateTask(nist(), swaying, ("frame_sway",)))
    assert refused.verdict == "refused" and "stand_compliance" in refused.supports[0].instruments
    assert "an indicator on another stand" in refused.text and "--believe machine" in refused.text
    believed = build_ladder(UpdateTask(nist(), swaying, ("frame_sway",), believe=MACHINE))
    assert believed.verdict == "updated" and believed.supports[0].instruments
    # A weak strut looks like no instrument, and an instrument is no machine.
    weak = build_ladder(UpdateTask(nist(), campaign(7, "paper", "weak_strut", STRONG)[0], ("weak_strut",)))
    assert weak.verdict == "updated" and not weak.supports[0].instruments


def test_of_a_pair_each_effect_is_replaced_in_turn():
    found = diagnosed(7, "tilted", "weak_strut,gauge_scale", STRONG)
    assert found.verdict == "identified" and set(found.alike) <= {"weak_strut", "gauge_scale"}
    document = found.to_dict()["looks_the_same"]
    assert (document is None) == (not found.alike)
    for entry in (document or {"terms": []})["terms"]:
        assert entry["effect"] in found.alike


def test_a_size_beyond_the_usual_is_said_in_the_first_sentence():
    found = diagnosed(7, "paper", "weak_strut", STRONG)
    assert "more than is usual" not in found.to_dict()["text"]
    fit = found.fits["weak_strut"]
    softer = replace(found, fits={**found.fits, "weak_strut": replace(fit, sizes=(np.array([-0.65]),))})
    first = softer.to_dict()["text"].split(". ")[0]
    assert first.startswith("Strut 1 is about 65 % too soft, more than is usual (factor 0.4 to 0.9) (weak_strut, prob")
