"""`tps rig`: folders written, measured again, opened; the seal; broken input."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest

from toolpath_stiff.cli.main import main
from toolpath_stiff.rig.effects import CATALOGUE
from toolpath_stiff.rig.exercise import score
from toolpath_stiff.rig.unknowns import OUTSIDE

BLIND = ["--seed", "7", "--hidden", "weak_strut", "--layout", "paper"]
PLAN = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,setup,clamp\n0,0,800,X,,table,1\n0,0,800,Z,,riser,2\n"


def table(file):
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def blind(tmp_path, capsys):
    folder = tmp_path / "blind"
    assert main(["rig", "new", *BLIND, "--out", str(folder)]) == 0
    said = capsys.readouterr().out
    assert not any(name in said for name in (*CATALOGUE, *OUTSIDE))
    return folder


def test_an_exercise_is_written_and_written_again_alike(blind, tmp_path):
    other = tmp_path / "other"
    assert main(["rig", "new", *BLIND, "--out", str(other)]) == 0
    assert sorted(file.name for file in blind.glob("[!.]*")) == ["machine.toml", "measurements.csv", "sealed.bin"]
    for file in blind.iterdir():
        assert file.read_bytes() == (other / file.name).read_bytes()


def test_the_sealed_truth_is_no_text_and_its_size_tells_nothing(blind, tmp_path):
    sealed = (blind / "sealed.bin").read_bytes()
    body = sealed.split(b"\n", 1)[1]
    # Chance makes runs of seven or eight letters in eight thousand random bytes; words and keys would be far longer.
    assert not re.search(rb"[A-Za-z_]{12,}", body)
    assert not any(name.encode() in body for name in (*CATALOGUE, *OUTSIDE))
    counts = np.bincount(np.frombuffer(body, dtype=np.uint8), minlength=256)
    assert counts.max() < 4 * counts.mean()  # padding and JSON would pile up on a few bytes
    for hidden in ("none", "two", "screw_lead"):
        folder = tmp_path / hidden
        assert main(["rig", "new", "--seed", "9", "--layout", "paper", "--out", str(folder), "--hidden", hidden]) == 0
        assert len((folder / "sealed.bin").read_bytes()) == len(sealed)


@pytest.mark.parametrize("place", [0, 20, 60, 4000, -1])
def test_tampering_is_noticed(blind, capsys, place):
    file = blind / "sealed.bin"
    content = bytearray(file.read_bytes())
    content[place] ^= 1
    file.write_bytes(bytes(content))
    assert main(["rig", "reveal", str(blind), "--claim", "none"]) == 2
    assert "seal is broken" in capsys.readouterr().err


def test_a_truncated_or_missing_seal_is_one_message(blind, capsys):
    (blind / "sealed.bin").write_bytes(b"")
    assert main(["rig", "reveal", str(blind), "--claim", "none"]) == 2
    (blind / "sealed.bin").unlink()
    assert main(["rig", "reveal", str(blind), "--claim", "none"]) == 2
    assert capsys.readouterr().err.count("tps: error") == 2


def test_reveal_scores_and_tells(blind, capsys):
    assert main(["rig", "reveal", str(blind), "--claim", "weak_strut", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["verdict"], found["hidden"]) == ("right", ["weak_strut"])
    assert set(found["effects"][0]["parameters"]) == {"strut", "factor"}
    assert main(["rig", "reveal", str(blind), "--claim", "weak_strut,frame_compliance"]) == 0
    assert "partly" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("hidden", "claim", "verdict"),
    [
        ([], ["none"], "correctly none"),
        ([], ["weak_strut"], "wrong"),
        (["weak_strut"], ["none"], "wrong"),
        (["weak_strut"], ["unexplained"], "wrong"),
        (["weak_strut", "strut_law"], ["strut_law", "weak_strut"], "right"),
        (["weak_strut", "strut_law"], ["strut_law"], "partly"),
        (["cracked_bed"], ["unexplained"], "right"),
        (["cracked_bed"], ["described"], "right"),
        (["weak_strut"], ["described"], "wrong"),
        (["cracked_bed"], ["cracked_bed"], "right"),
        (["cracked_bed"], ["table_compliance"], "wrong"),
        (["cracked_bed", "strut_law"], ["outside"], "partly"),
    ],
)
def test_scores(hidden, claim, verdict):
    assert score(hidden, claim) == verdict


def test_measuring_again_is_the_same_machine_with_new_noise(tmp_path):
    """Without noise the same rows would come out: averaged over many readings they do."""
    blind = tmp_path / "tilted"
    assert main(["rig", "new", "--seed", "7", "--hidden", "weak_strut", "--out", str(blind)]) == 0
    plan = tmp_path / "plan.csv"
    first = table(blind / "measurements.csv")
    keep = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "direction", "force_N", "setup", "tool_extension_mm"]
    with plan.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, [*keep, "stiffness_N_per_mm"], extrasaction="ignore", restval="")
        writer.writeheader()
        writer.writerows({name: row[name] for name in keep} for row in first)
    again = tmp_path / "more.csv"
    assert main(["rig", "measure", str(blind), "--at", str(plan), "--out", str(again)]) == 0
    before, after = (
        np.array([float(row["stiffness_N_per_mm"]) for row in table(f)]) for f in (blind / "measurements.csv", again)
    )
    change = np.log(after / before)
    assert np.abs(change).max() > 0.005
    # 288 differences of two readings, sd sqrt(2) x 2.3 % (outliers) and clamps: four sampling errors of the mean.
    assert abs(change.mean()) < 4.0 * (0.033 / np.sqrt(288) + 0.014 / np.sqrt(24))
    clamps = {row["clamp"] for row in table(again)}
    assert clamps.isdisjoint({row["clamp"] for row in first})


def test_a_visit_has_its_own_noise_and_repeats_itself(blind, tmp_path):
    plan = tmp_path / "plan.csv"
    plan.write_text(PLAN)
    contents = []
    for name, visit in (("a.csv", "1"), ("b.csv", "1"), ("c.csv", "2")):
        out = tmp_path / name
        assert main(["rig", "measure", str(blind), "--at", str(plan), "--out", str(out), "--visit", visit]) == 0
        contents.append(out.read_bytes())
    assert contents[0] == contents[1] != contents[2]


def test_custom_campaign_and_paper_layout(tmp_path):
    plan = tmp_path / "plan.csv"
    plan.write_text(PLAN)
    own = tmp_path / "own"
    assert main(["rig", "new", "--seed", "1", "--out", str(own), "--layout", "campaign", "--at", str(plan)]) == 0
    assert len(table(own / "measurements.csv")) == 2
    assert main(["rig", "new", "--seed", "1", "--out", str(tmp_path / "paper"), "--layout", "paper"]) == 0
    rows = table(tmp_path / "paper" / "measurements.csv")
    sd, k = (np.array([float(row[name]) for row in rows]) for name in ("sd_N_per_mm", "stiffness_N_per_mm"))
    assert sd / k == pytest.approx(np.full(42, np.hypot(0.02, 0.01)), rel=1e-3)  # sd is printed in whole N/mm


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "no poses"),
        ("x_mm,y_mm,z_mm,direction\n", "no poses"),
        ("x_mm,y_mm,direction\n0,0,X\n", "z_mm is missing"),
        ("x_mm,y_mm,z_mm\n0,0,800\n", "directions unclear"),
        ("x_mm,y_mm,z_mm,direction\n0,0,800,W\n", "plan.csv:2: direction 'W'"),
        ("x_mm,y_mm,z_mm,direction\n0,zero,800,X\n", "plan.csv:2: y_mm 'zero'"),
        ("x_mm,y_mm,z_mm,direction\n0,0,nan,X\n", "plan.csv:2: z_mm 'nan'"),
        ("x_mm,y_mm,z_mm,direction,force_N\n0,0,800,X,-5\n", "plan.csv:2: force_N '-5'"),
        ("x_mm,y_mm,z_mm,direction\n0,0,9000,X\n", "plan.csv:2: machine nist cannot reach"),
        ("x_mm,y_mm,z_mm,dx,dy,dz\n0,0,800,0,0,0\n", "no length"),
        ("x_mm,y_mm,z_mm,direction,mood\n0,0,800,X,good\n", "unknown column 'mood'"),
        ("x_mm,y_mm,z_mm,direction,loop\n0,0,800,X,floor\n", "loop 'floor'"),
        ("x_mm,y_mm,z_mm,direction,clamp\n0,0,800,X,1.5\n", "whole number"),
        (f"x_mm,y_mm,z_mm,direction,clamp\n0,0,800,X,{'1' * 5000}\n", "whole number"),
        ("x_mm,y_mm,z_mm,direction\r0,0,800,X\r0,0,800,W\r", "plan.csv:3: direction 'W'"),
        (f"x_mm,y_mm,z_mm,direction\n0,0,800,{'X' * 140_000}\n", "plan.csv:2: not a CSV file: field larger"),
    ],
)
def test_bad_plans_are_named_and_nothing_is_written(blind, tmp_path, capsys, content, message):
    plan, out = tmp_path / "plan.csv", tmp_path / "more.csv"
    plan.write_text(content)
    assert main(["rig", "measure", str(blind), "--at", str(plan), "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    "words",
    [
        ["new", "--seed", "-1"],
        ["new", "--seed", "1", "--hidden", "gremlin"],
        ["new", "--seed", "1", "--noise", "-2"],
        ["new", "--seed", "1", "--machine", "nowhere"],
        ["new", "--seed", "1", "--layout", "campaign"],
        ["new", "--seed", "1", "--layout", "paper", "--hidden", "thermal_drift"],
    ],
)
def test_a_wrong_exercise_is_one_message_and_no_folder(tmp_path, capsys, words):
    assert main(["rig", *words, "--out", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err.startswith("tps: error: ")
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("claim", ["", "gremlin", "none,weak_strut"])
def test_wrong_claims(blind, capsys, claim):
    assert main(["rig", "reveal", str(blind), "--claim", claim]) == 2
    assert "claim" in capsys.readouterr().err
