"""Effects whose form was read off the readings that judge them: `described`, until others confirm them."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from tests.stiffness.cases import nist
from tests.updating.cases import campaign, dense, read_text
from tests.updating.test_diagnose import SADDLE
from toolpath_stiff.correction.task import MACHINE, UpdateTask
from toolpath_stiff.correction.update import update
from toolpath_stiff.diagnosis.diagnose import common_verdict, diagnose, with_plan
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.drawn import CONFIRMS, log_predictive
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.judgement import judge
from toolpath_stiff.inference.left_out import held_out
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import Predictor, scaled_law
from toolpath_stiff.readings.measurements import reading_marks
from toolpath_stiff.rig import case, exercise
from toolpath_stiff.stiffness.catalogue import effects_from_file, find_effect

CASE = (7, "paper", "saddle_overhang", 0.1)
DATA = campaign(*CASE)[0]
POINTS = np.unique(DATA.point)
OLD = np.isin(DATA.point, POINTS[::2])  # every other point


def drawn_file(tmp_path, rows):
    """The saddle as a draft from some of the readings."""
    file = tmp_path / "saddle.py"
    marks = tuple(reading_marks(DATA)[rows].tolist())
    file.write_text(f"{SADDLE}\n\nSaddle.described_from = {marks!r}\n", encoding="utf-8")
    return file


def among_few(data, file):
    """The judgement among a handful of effects, which is quick."""
    (noise,) = noise_models(data)
    effects = [find_effect(name, [file]) for name in ("saddle", "table_compliance")]
    return judge(Problem.of(Predictor(nist(), data, [file]), noise), noise, effects, seed=0)


@pytest.fixture(scope="module")
def described(tmp_path_factory):
    """Judged by the readings that it was drawn from alone."""
    file = drawn_file(tmp_path_factory.mktemp("draft_status"), slice(None))
    return with_plan(diagnose(nist(), DATA, effect_files=[file])), file


def test_the_readings_that_it_was_drawn_from_only_describe(described):
    found, _ = described
    assert (found.verdict, found.explanations) == ("described", ("saddle",))
    assert found.main.drawn.seen == len(DATA) and found.main.drawn.new == 0
    assert found.next_measurements and "between" in found.next_measurements[0]["why"]
    back = found.to_dict()
    assert back["draft_status"] == {
        "effects": ["saddle"], "readings_seen": len(DATA), "readings_new": 0, "gain": None, "rival": "",
        "confirmed": False,
    }  # fmt: skip
    assert "says nothing of others" in back["text"] and back["plausible"] == ["saddle"]
    commands = [line.split("\n")[1] for line in back["next"]]
    assert [line.split()[1] for line in commands] == ["plan", "update"]
    json.dumps(back, allow_nan=False)


def test_an_update_by_them_says_so(described):
    _, file = described
    found = update(UpdateTask(nist(), DATA, ["saddle"], effect_files=[file], files=["nist-table1"]))
    said = found.document
    assert said["verdict"] == "updated" and said["described"] == ["saddle"]
    assert "added as described, not as identified" in said["text"]
    (entry,) = found.corrected.effects
    assert entry.provenance["described"].startswith("not confirmed: ")
    stiffer = nist().with_changes(strut_law=scaled_law(nist().strut_law, np.log([1.2, 1.2])))
    found = update(UpdateTask(stiffer, DATA, ["saddle"], believe=MACHINE, effect_files=[file], files=["nist-table1"]))
    assert found.steps[-1].fit.law_free and found.steps[-1].error < 0.5 * found.steps[0].error
    assert found.verdict == "refused" and "needs another strut law" in found.text


def test_readings_that_it_has_not_seen_confirm_it(tmp_path):
    found = among_few(DATA, drawn_file(tmp_path, OLD))
    drawn = found.drawn
    assert (found.verdict, drawn.seen, drawn.new) == ("identified", OLD.sum(), (~OLD).sum())
    assert drawn.confirmed and drawn.gain > CONFIRMS
    assert "others confirm it" in drawn.reason
    # Of none of the readings it was drawn from: an effect like any other.
    assert among_few(DATA.select(~OLD), drawn_file(tmp_path, OLD)).drawn is None


def test_readings_that_do_not_show_it_do_not_confirm_it(tmp_path):
    """The new points are of a machine without the saddle: whatever is said, it is not `identified`."""
    sound = campaign(7, "paper", "none")[0]
    assert np.array_equal(sound.position, DATA.position)
    mixed = replace(DATA, stiffness=np.where(OLD, DATA.stiffness, sound.stiffness))
    assert among_few(mixed, drawn_file(tmp_path, OLD)).verdict != "identified"


def test_one_new_point_confirms_nothing(tmp_path):
    rows = POINTS[0] != DATA.point
    found = among_few(DATA, drawn_file(tmp_path, rows))
    assert found.verdict == "described" and 0 < found.drawn.new < len(DATA)
    assert "too few" in found.drawn.reason


def test_the_log_predictive_is_the_normal_distribution_given_the_other_readings(described):
    """Against dense matrices: conditional mean and covariance of each left-out point."""
    fit = described[0].fits["saddle"]
    labels = np.where(OLD, "seen", np.char.add("new ", DATA.point))
    whole, squares = dense(fit.scatter.covariance), 0.0
    moves = held_out(fit, labels).moves
    for move, label in zip(moves, np.unique(labels), strict=True):
        out = labels == label
        if label == "seen":
            continue
        residual = fit.residual - fit.jacobian @ move
        weights = np.linalg.solve(whole[np.ix_(~out, ~out)], whole[np.ix_(~out, out)]).T
        off = residual[out] - weights @ residual[~out]
        own = whole[np.ix_(out, out)] - weights @ whole[np.ix_(~out, out)]
        squares += off @ np.linalg.solve(own, off)
    assert log_predictive(fit, DATA, OLD, fit.scatter) == pytest.approx(-0.5 * squares, rel=1e-8)


def test_a_reading_is_known_again_however_its_file_is_laid_out():
    rows, _ = case.make_case(*CASE[:1], layout=CASE[1], hidden=CASE[2], size=CASE[3])
    table = list(csv.DictReader(io.StringIO(exercise.csv_text(rows))))
    columns = list(table[0])[::-1]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns)
    writer.writeheader()
    writer.writerows(table[::-1])
    again = reading_marks(read_text(stream.getvalue()))
    marks = reading_marks(DATA)
    assert again[::-1].tolist() == marks.tolist()
    assert len(set(marks.tolist())) == len(DATA)
    assert reading_marks(replace(DATA, direction=-DATA.direction)).tolist() == marks.tolist()
    moved = replace(DATA, stiffness=1.001 * DATA.stiffness)
    assert not set(reading_marks(moved).tolist()) & set(marks.tolist())


def test_marks_are_texts(tmp_path):
    file = tmp_path / "saddle.py"
    file.write_text(f"{SADDLE}\n\nSaddle.described_from = 3\n", encoding="utf-8")
    with pytest.raises(InputError, match="described_from = 3"):
        effects_from_file(file)


@pytest.mark.parametrize(
    ("verdicts", "said"),
    [
        ((("described", "a"), ("described", "a")), "described"),
        ((("described", "a"), ("identified", "a")), "described"),
        ((("described", "a"), ("described", "b")), "ambiguous"),
        ((("described", "a"), ("adequate", "none")), "ambiguous"),
    ],
)
def test_the_verdict_of_several_noise_models(verdicts, said):
    from types import SimpleNamespace

    found = common_verdict([SimpleNamespace(verdict=one, plausible=(name,)) for one, name in verdicts])
    assert found == said
