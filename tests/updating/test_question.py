"""Readings that have nothing to do with the machine: the question is asked, no effect is named, nothing is written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.stiffness.cases import nist
from tests.updating.cases import campaign, examined, predictor_for, table_1
from toolpath_stiff.comparison.compare import compare
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.correction.update import update
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.file import load_machine

ASKED = "Are these readings of this machine?"
TABLE = table_1()
CONSTANT = replace(TABLE, stiffness=np.full(len(TABLE), 5e7))
SHUFFLED = replace(TABLE, stiffness=np.random.default_rng(0).permutation(TABLE.stiffness))
TENFOLD = replace(TABLE, stiffness=10.0 * TABLE.stiffness)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (CONSTANT, "do not follow the model"),
        (SHUFFLED, "do not follow the model"),
        (replace(TABLE, stiffness=TABLE.stiffness[::-1]), "do not follow the model"),
        (TENFOLD, "9.9 times what the model says"),
        (replace(TABLE, stiffness=TABLE.stiffness / 3.74), "1 / 3.8 of what the model says"),  # 274 % off
    ],
)
def test_readings_of_something_else_are_asked_about(data, reason):
    asked = question(predictor_for(data))
    assert asked.startswith(ASKED) and reason in asked


@pytest.mark.parametrize("name", ["genhexkins", "nategh_agheli"])
def test_readings_of_another_machine_are_asked_about(name):
    assert question(Predictor(load_machine(name), TABLE)).startswith(ASKED)


@pytest.mark.parametrize("layout", ["paper", "tilted"])
@pytest.mark.parametrize(
    "hidden", ["none", "table_compliance", "setup_compliance", "weak_strut", "frame_compliance", "cable_drag"]
)
def test_a_machine_with_a_strong_fault_is_still_this_machine(layout, hidden):
    """30 % rms of the stiffness, three times the strongest of the benchmark."""
    assert question(predictor_for(campaign(7, layout, hidden, 0.3)[0])) == ""


def test_few_readings_and_readings_that_should_be_alike_are_not_asked_about():
    assert question(predictor_for(TABLE)) == ""
    assert question(predictor_for(CONSTANT.select(np.arange(5)))) == ""
    along_x = TABLE.direction[:, 0] > 0.5
    upper = TABLE.position[:, 2] > 1.0
    assert question(predictor_for(CONSTANT.select(along_x & upper))) == ""  # the model says 58 to 61 N/um


def test_the_verdict_is_unexplained_and_the_question_is_put():
    some = np.r_[0:9, 21:30]
    found = examined(nist(), SHUFFLED.select(some), noise=0.10)
    assert (found.verdict, found.plausible) == ("unexplained", [])
    written = found.to_dict()
    assert written["question"].startswith(ASKED) and written["text"].startswith(ASKED)
    assert not any("tps update" in line for line in written["next"])
    assert ASKED in compare(nist(), SHUFFLED.select(some), noise=0.10, draws=50).document["text"]


def test_nothing_is_written_of_readings_of_something_else_but_by_force():
    refused, forced = (update(UpdateTask(nist(), TENFOLD, strut_law=True, force=force)) for force in (False, True))
    assert refused.corrected is None and forced.corrected is not None
    assert [one.verdict for one in (refused, forced)] == ["refused", "forced"]
    assert all(ASKED in one.document["text"] for one in (refused, forced))


def test_a_machine_that_fits_worse_is_never_written():
    """The strut law of the second packaged machine, fitted to the paper's readings: 77 to 388 %."""
    found = update(UpdateTask(load_machine("nategh_agheli"), TABLE, strut_law=True, force=True))
    before, after = (step.fit.errors.mean() for step in found.steps)
    assert after > 2.0 * before
    assert found.worse and found.corrected is None
    assert "would fit worse" in found.document["text"] and found.verdict == "refused"


def test_a_mean_error_that_rises_within_rounding_is_no_worse_fit():
    found = update(UpdateTask(nist(), TABLE, strut_law=True, force=True))
    before, after = (step.fit.errors.mean() for step in found.steps)
    assert after > before  # 9.62 to 9.72 %: likelier, by fewer readings far off
    assert not found.worse and found.corrected is not None


@pytest.mark.parametrize("command", [compare, update])
def test_repeats_that_agree_exactly_tell_nothing_of_the_scatter(command):
    """Copied rows, as spreadsheets make them: the noise is guessed as without repeats."""
    few = TABLE.select(np.tile(np.r_[0:6, 21:27], 2))
    if command is compare:
        origins = [one["origin"] for one in compare(nist(), few, draws=50).document["noise"]]
    else:
        origins = [update(UpdateTask(nist(), few, strut_law=True)).noise.origin]
    assert origins and all("agree exactly" in origin for origin in origins)
