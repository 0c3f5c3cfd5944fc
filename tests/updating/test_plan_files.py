"""Plans as files, first campaigns and the command: what is written can be read, measured, and is what was planned."""

from __future__ import annotations

import csv
import json
from collections import Counter, defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.stiffness.cases import nist
from tests.updating.planning import read_filled, rivals, table_1_design
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.repeats import repeat_groups
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.planning.campaign import Campaign, first_campaign
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.plan import plan_measurements
from toolpath_stiff.planning.result import plan_csv, plan_rows
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig import exercise as rig
from toolpath_stiff.rig.case import draw_case
from toolpath_stiff.rig.kinematics import reachable as rig_reachable
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.stiffness.catalogue import known_effects

MACHINES = ("nist", "genhexkins", "nategh_agheli")


def read_csv(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


# -- files -------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A plan and its file."""
    pair = rivals("setup_compliance", "table_compliance")
    found = plan_measurements(nist(), pair, 0.02, 4, menu=Menu.of(table_1_design()))
    file = tmp_path_factory.mktemp("plan") / "plan.csv"
    file.write_text(plan_csv(plan_rows(found.visits, found.chosen, table_1_design().point.tolist())))
    return found, file


def test_the_file_says_what_was_planned(planned):
    found, file = planned
    data = read_filled(file, nist())
    rows = np.concatenate([found.visits.rows(v) for v in found.chosen])
    meant = found.visits.readings.select(rows)
    for name in ("position", "angles", "direction", "force", "tool_extension"):
        assert getattr(data, name) == pytest.approx(getattr(meant, name), abs=1e-9), name
    assert data.setup.tolist() == meant.setup.tolist()
    assert not data.warnings
    assert len(set(data.clamp)) == len(found.chosen)


def test_points_bear_new_names_unless_the_pose_is_old(planned):
    _, file = planned
    old = {
        tuple(np.round(p, 6)): name for p, name in zip(table_1_design().position, table_1_design().point, strict=True)
    }
    data = read_filled(file, nist())
    for position, angles, name in zip(data.position, data.angles, data.point, strict=True):
        known = None if angles.any() else old.get(tuple(np.round(position, 6)))
        assert name == known if known else name not in old.values()


def test_the_rig_measures_a_plan_and_both_files_are_read_together(planned, tmp_path):
    _, file = planned
    rig.new_exercise(tmp_path / "blind", draw_case(3, "paper", "none"))
    text, count = rig.measured_again(tmp_path / "blind", str(file), 1)
    (tmp_path / "more.csv").write_text(text)
    assert count == len(read_csv(file))
    data = read_measurements([tmp_path / "blind" / "measurements.csv", tmp_path / "more.csv"], nist())
    assert len(data) == 42 + count


# -- first campaigns ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=MACHINES)
def campaign(request) -> tuple[str, Campaign]:
    return request.param, first_campaign(load_machine(request.param), 24)


def places(campaign: Campaign) -> dict[tuple[float, ...], list[int]]:
    """Poses -> numbers of their visits."""
    found = defaultdict(list)
    for k, pose in enumerate(campaign.visits.pose):
        found[tuple(np.round(pose, 5))].append(k)
    return found


def test_a_first_campaign_has_what_a_diagnosis_needs(campaign):
    _, found = campaign
    poses = np.array(list(places(found)))
    assert len(poses) == 24
    assert len(set(poses[:, 2])) >= 4
    tilt = np.degrees(np.arccos(np.cos(poses[:, 3]) * np.cos(poses[:, 4])))
    assert (tilt > 0.0).sum() == 12 and tilt[tilt > 0.0].min() >= 14.5 and tilt.max() <= 25.0 + 1e-9
    assert set(found.visits.readings.force) == {500.0, 4000.0}
    long = {tuple(np.round(p, 5)) for p in found.visits.pose[found.visits.extension > 0.1]}
    short = {tuple(np.round(p, 5)) for p in found.visits.pose[found.visits.extension == 0.0]}
    assert len(long) == 4 and long <= short
    for rows in places(found).values():
        for visit in rows:
            own = found.visits.rows(visit)
            assert Counter(found.visits.names[own]) == {"X": 2, "Y": 2, "Z": 2}


def test_one_pose_has_its_images_turned_by_120_degrees(campaign):
    """Same height and distance from the axis, azimuths a third of a turn apart, vertical."""
    _, found = campaign
    upright = np.array([p for p in places(found) if not any(p[3:])])
    off = np.hypot(upright[:, 0], upright[:, 1])
    sets = [
        np.sort(np.degrees(np.arctan2(upright[same, 1], upright[same, 0])))
        for same in (
            np.isclose(off, r, atol=2e-4) & (upright[:, 2] == z) for r, z in zip(off, upright[:, 2], strict=True)
        )
        if same.sum() == 3 and off[same].min() > 0.05
    ]
    # Positions are rounded to 0.1 mm: at 120 mm from the axis that is 0.05 degrees.
    assert any(np.allclose(np.diff(azimuths), 120.0, atol=0.1) for azimuths in sets)


def test_two_poses_are_clamped_three_times_in_each_set_up(campaign):
    _, found = campaign
    again = [rows for rows in places(found).values() if len(rows) >= 6]
    assert len(again) == 2
    for rows in again:
        standard = [k for k in rows if found.visits.extension[k] == 0.0]
        assert Counter(found.visits.setup[standard].tolist()) == {"table": 3, "riser": 3}
        for setup in ("table", "riser"):
            repeats = [found.visits.rounds[found.visits.rows(k)[0]] for k in standard if found.visits.setup[k] == setup]
            assert sorted(repeats) == [1, 2, 3]


def test_a_first_campaign_is_reachable_and_its_file_is_read(campaign, tmp_path):
    machine, found = campaign
    visits = found.visits
    assert rig_reachable(load_nominal(machine), visits.pose[:, :3], visits.pose[:, 3:], visits.extension).all()
    file = tmp_path / "plan.csv"
    file.write_text(plan_csv(plan_rows(visits, found.chosen)))
    data = read_filled(file, load_machine(machine))
    assert len(data) == 6 * len(visits) and not data.warnings
    for column in ("force_N", "setup", "clamp", "repeat", "point", "time_min", "tool_extension_mm"):
        assert column not in data.missing
    # 2 poses in 2 set-ups, 3 directions, 2 loads: 24 readings that are repeated with a new clamping.
    assert (np.bincount(repeat_groups(data)) == 3).sum() == 24


def test_set_ups_and_tools_are_changed_as_seldom_as_can_be(campaign):
    _, found = campaign
    states = list(zip(found.visits.setup, found.visits.extension, strict=True))
    assert 1 + sum(a != b for a, b in pairwise(states)) == len(set(states))


def test_order_and_poses_hang_on_the_seed():
    one, same, other = (first_campaign(nist(), 10, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.visits.pose, same.visits.pose)
    assert not np.array_equal(one.visits.pose[:10], other.visits.pose[:10])


def test_a_larger_campaign_shows_more():
    small, large = (first_campaign(nist(), n, effects=known_effects()) for n in (8, 40))
    assert set(small.sees) == set(large.sees) and len(small.sees) >= 15
    assert np.mean([large.sees[name] > small.sees[name] for name in small.sees]) > 0.8


@pytest.mark.parametrize(
    ("n", "menu", "words"),
    [
        (3, None, "8 to 200"),
        (24, Menu(heights=(0.5, 0.8)), "4 or more"),
        (24, Menu(heights=(9.0, 9.1, 9.2, 9.3)), "reaches"),
    ],
)
def test_campaigns_that_cannot_be(n, menu, words):
    with pytest.raises(InputError, match=words):
        first_campaign(nist(), n, menu=menu)


# -- the command -------------------------------------------------------------------------------------------------------


def test_without_data_a_first_campaign_is_written(tmp_path, capsys):
    assert main(["plan", "--machine", "nist", "--out", str(tmp_path / "p"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((tmp_path / "p" / "plan.json").read_text())
    assert sorted(f.name for f in (tmp_path / "p").glob("[!.]*")) == ["plan.csv", "plan.json", "plan.png"]
    assert (tmp_path / "p" / "plan.png").read_bytes().startswith(b"\x89PNG")
    assert document["kind"] == "campaign" and document["poses"] == 24
    assert len(document["visits"]) == len({row["clamp"] for row in read_csv(tmp_path / "p" / "plan.csv")})


def test_between_two_effects_fitted_to_the_data(tmp_path, capsys):
    arguments = ["plan", "nist-table1", "--between", "frame_compliance,none", "--noise", "5", "--n", "3", "--no-plots"]
    assert main([*arguments, "--out", str(tmp_path), "--json"]) == 0
    first = capsys.readouterr().out
    document = json.loads(first)
    assert [rival["name"] for rival in document["rivals"]] == ["frame_compliance", "none"]
    assert document["poses"] == 3 == len(document["visits"])
    assert sorted(f.name for f in tmp_path.glob("[!.]*")) == ["plan.csv", "plan.json"]
    assert {row["stiffness_N_per_mm"] for row in read_csv(tmp_path / "plan.csv")} == {""}
    content = (tmp_path / "plan.csv").read_bytes()
    assert main([*arguments, "--out", str(tmp_path), "--json"]) == 0
    assert (tmp_path / "plan.csv").read_bytes() == content and capsys.readouterr().out == first


def test_between_two_effects_before_any_data(tmp_path, capsys):
    arguments = ["plan", "--between", "joint_clearance,contact_nonlinearity", "--loads", "300,3000", "--no-plots"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "usual sizes" in text and "plan.csv" in text
    assert {row["force_N"] for row in read_csv(tmp_path / "plan.csv")} == {"300", "3000"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--between", "frame_compliance"], "two or more"),
        (["--between", "none,none"], "two or more"),
        (["--between", "none,frame_complianse"], "Did you mean frame_compliance"),
        (["nist-table1", "--between", "none,joint_clearance"], "force_N is missing"),
        (["nist-table1", "--between", "none,strut_law", "--n", "0"], "0 poses"),
        (["--n", "2"], "8 to 200"),
        (["--heights", "5000,5100,5200,5300"], "reaches"),
        (["--cost", "lunch=30"], "expected one of reading, pose"),
        (["--cost", "pose=-1"], "0 or more"),
        (["--loads", "0,500"], "loads of 0, 500 N"),
        (["--max-tilt", "95"], "less than 90"),
        (["--noise", "0"], "more than 0"),
        (["--seed", "-1"], "at least 0"),
        (["no_such_file.csv"], "no_such_file.csv"),
    ],
)
def test_wrong_requests_say_what_is_wrong_and_write_nothing(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["plan", *arguments]) == 2
    captured = capsys.readouterr()
    assert words in captured.err and "Traceback" not in captured.err
    assert list(tmp_path.iterdir()) == []
