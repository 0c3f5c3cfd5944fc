"""Commands on machines of elements, against the values of `tests/machine/data` (see its README) and closed forms."""

import csv
import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from toolpath_stiff.cli.main import main

DATA = Path(__file__).parents[1] / "machine" / "data"
VALUES = json.loads((DATA / "check_values.json").read_text("utf-8"))
NAMES = ("robot200", "mill5", "mill3", "delta", "pentapod")
SOFT_JOINT = ("340.0, 460.0, 1900.0", "340.0, 920.0, 1900.0")  # torsion of the robot's third joint, twice as soft


def file(name: str) -> str:
    return str(DATA / f"{name}.toml")


def changed(folder: Path, name: str, *texts: tuple[str, str], more: str = "") -> str:
    """A machine file with texts replaced."""
    text = Path(file(name)).read_text("utf-8")
    for old, new in texts:
        assert old in text
        text = text.replace(old, new)
    path = folder / f"{name}_changed.toml"
    path.write_text(text + more, "utf-8")
    return str(path)


def poses(name: str) -> list[list[float]]:
    """X, Y, Z, roll, pitch, yaw of the tip in work axes at a file's poses."""
    rows = []
    for row, value in zip(tomllib.loads(Path(file(name)).read_text("utf-8"))["pose"], VALUES[name], strict=True):
        ((key, values),) = row.items()
        if key == "joints_deg":
            r = np.array(value["tip_frame"])
            angles = (math.atan2(r[2, 1], r[2, 2]), math.asin(-r[2, 0]), math.atan2(r[1, 0], r[0, 0]))
            rows.append([*value["tip_mm"], *map(math.degrees, angles)])
        elif key == "program_mm_deg":  # on tables A and C the tool leans against the work: Rz(-C) Rx(-A)
            rows.append([*values[:3], -values[3], 0.0, -values[4]])
        else:
            rows.append([*values, 0.0, 0.0, 0.0][:6])
    return rows


@pytest.mark.parametrize("name", NAMES)
def test_poses_have_the_stiffness_of_the_check_values(name: str) -> None:
    found = tps.pose(poses(name), file(name))
    for row, value in enumerate(VALUES[name]):
        tensor = np.array(value["tip_compliance_nm_per_N"])
        assert 1e-6 * found.along_axes[row] == pytest.approx(value["stiffness_XYZ_N_per_um"], rel=1e-8)
        assert 1e-6 * found.softest_stiffness[row] == pytest.approx(value["softest_N_per_um"], rel=1e-8)
        assert np.abs(1e9 * found.tip_compliance[row] - tensor).max() < 1e-8 * np.abs(tensor).max()
    assert found.reachable.all()


def axes(letter: str, degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array({"A": [[1, 0, 0], [0, c, -s], [0, s, c]], "C": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[letter])


def test_feeds_of_a_table_are_turned_into_machine_axes() -> None:
    """Cuts along X and Y of the work about pose 2 of the five-axis mill; its tables have turned work axes by A C."""
    program = tps.Program.from_text(
        "G21 G90\nG0 X75 Y20 Z-120 A-40 C65\nG1 X75.001 F100\nG0 X75\nG1 Y20.001\nM2", name="short.nc"
    )
    found = tps.analyze(program, file("mill5"), origin_mm_deg=(0, 0, 0))
    compliance = np.array(VALUES["mill5"][1]["tip_compliance_nm_per_N"])
    rows = found.to_frame()
    for line, along in ((3, [1.0, 0, 0]), (5, [0, 1.0, 0])):
        direction = axes("A", -40) @ axes("C", 65) @ along
        row = rows[(rows.line == line)].iloc[0]
        assert row.stiffness_N_per_mm == pytest.approx(1e6 / (direction @ compliance @ direction), rel=1e-5)
        assert (row.joint_A_deg, row.joint_C_deg) == pytest.approx((-40, 65))
    by_machine = tps.analyze(program, file("mill5"), origin_mm_deg=(0, 0, 0), load="y").to_frame()
    assert by_machine.stiffness_N_per_mm[by_machine.line == 3].iloc[0] == pytest.approx(
        1e6 / compliance[1, 1], rel=1e-8
    )


POCKET = Path(__file__).parents[2] / "programs" / "pocket.nc"


@pytest.mark.parametrize("name", NAMES)
def test_a_program_runs_on_every_kind(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["analyze", str(POCKET), "--machine", file(name), "--step", "5", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    assert summary["machine"] == name and "strut law" not in said and "extrapolated_share" not in summary
    rows = list(csv.DictReader((out / "samples.csv").open()))
    joints = np.array(
        [[float(row[key]) for key in row if key.startswith(("joint_", "strut", "carriage"))] for row in rows]
    )
    assert joints.shape[1] == {"robot200": 6, "mill3": 3, "delta": 3}.get(name, 5)
    assert np.abs(np.diff(joints, axis=0)).max() < 10.0  # mm, degrees: one configuration, no turn skipped
    if name == "robot200":
        assert any(summary["configuration"] in sentence for sentence in summary["assumptions"])
    assert main(["machine", "show", file(name), "--out", str(tmp_path / "show.png")]) == 0
    assert "strut law" not in capsys.readouterr().out
    assert main(["machine", "check", file(name), "--out", str(tmp_path / "check.png")]) == 0


def test_a_map_of_a_three_axis_mill_is_symmetric_in_x() -> None:
    """What moves with -X is alike on both sides of X = 0 but for couplings that change sign with x."""
    found = tps.map_stiffness(file("mill3"), x_mm=(-200, 200), y_mm=(-100, 100), z_mm=120, load="z", points=5)
    assert found.stiffness[0] == pytest.approx(found.stiffness[0, :, ::-1], rel=1e-12)
    assert found.reachable.all()


@pytest.mark.parametrize("name", ["robot200", "mill3"])
def test_a_placement_tried_has_the_figures_of_its_analysis(name: str) -> None:
    origin = {"robot200": (1500.0, 300.0, 700.0, 0.0, 0.0, 30.0), "mill3": (50.0, -20.0, 200.0, 0.0, 0.0, 90.0)}[name]
    tried = tps.try_placement(POCKET, file(name), step_mm=5).at(origin)
    analyzed = tps.analyze(POCKET, file(name), origin_mm_deg=origin, step_mm=5)
    assert tried["mean_N_per_mm"] == pytest.approx(analyzed.mean_N_per_mm, rel=1e-9)
    assert tried["min_N_per_mm"] == pytest.approx(analyzed.min_N_per_mm, rel=1e-9)


def test_place_finds_the_stiffer_place_of_a_mill() -> None:
    """On the column the stiffness falls with the height: the front's best mean is at the lower bound."""
    here = {"x_mm": 0, "y_mm": 0, "rotate_deg": 0, "step_mm": 20}
    found = tps.place(POCKET, file("mill3"), z_mm=(100, 300), objective="mean", **here)
    best = max(found.front, key=lambda row: row.mean_N_per_mm)
    assert found.worse == [] and best.z_mm == pytest.approx(100.0) and best.mean_N_per_mm > found.present.mean_N_per_mm


def readings(machine: str, path: Path, seed: int) -> str:
    """Readings of a robot along X, Y, Z at 12 poses, 1 % of scatter."""
    rng = np.random.default_rng(seed)
    middle, spread = np.array([1400.0, 0, 900, 0, 0, 0]), np.array([250.0, 250, 250, 12, 12, 12])
    at = middle + spread * rng.uniform(-1.0, 1.0, (30, 6))
    at = at[tps.pose(at, file("robot200")).reachable][:12]
    stiffness = 1e-3 * tps.pose(at, machine).along_axes * np.exp(0.01 * rng.normal(size=(12, 3)))
    rows = ["x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,direction,stiffness_N_per_mm"]
    for place, values in zip(at, stiffness, strict=True):
        rows += [f"{','.join(map(str, place))},{axis},{k}" for axis, k in zip("XYZ", values, strict=True)]
    path.write_text("\n".join(rows), "utf-8")
    return str(path)


def test_compare_names_the_element_that_is_softer(tmp_path: Path) -> None:
    right = tps.compare(readings(file("robot200"), tmp_path / "a.csv", 1), file("robot200"), noise_percent=1)
    assert right.to_dict()["findings"] == [] and right.summary.baseline.mean_abs_error_percent < 1.2
    assert {"base mount", "joint 3", "forearm", "spindle"} <= set(right.shares)
    total = sum(right.shares.values())
    poses_there = np.unique(right.data.position, axis=0, return_index=True)[1]
    along = right.predictor.full_path.take(poses_there)
    tensors = np.einsum("nii->ni", along.stance.tip_compliance()[:, :3, :3])
    assert total == pytest.approx(tensors.mean(axis=0), rel=1e-9)
    soft = readings(changed(tmp_path, "robot200", SOFT_JOINT), tmp_path / "b.csv", 2)
    findings = tps.compare(soft, file("robot200"), noise_percent=1).to_dict()["findings"]
    assert any("joint_3" in name for row in findings for name in (row["pattern"], *row["indistinguishable_from"]))


REFUSED = (
    (["update", "--add", "weak_strut"], "it holds on hexapods only"),
    (["update", "--strut-law"], "robot200 has no strut law. --joints refits its joints"),
)


@pytest.mark.parametrize(("words", "why"), REFUSED)
def test_what_knows_hexapods_only_says_so(
    words: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = readings(file("robot200"), tmp_path / "a.csv", 1)
    code = main([words[0], data, *words[1:], "--machine", file("robot200"), "--out", str(tmp_path / "out")])
    said = capsys.readouterr().err
    assert code == 2 and said.count("\n") == 1 and why in said
    assert not (tmp_path / "out").exists()


def entry(name: str, **values: object) -> str:
    """An `[[effect]]` of a machine file."""
    return "\n".join(["", "[[effect]]", f'name = "{name}"', *(f"{k} = {json.dumps(v)}" for k, v in values.items()), ""])


def torsion(joint: int) -> np.ndarray:
    """(3, 3) compliance in nm/N at the first pose for 1 nrad/(N m) about a joint, by turning it a little."""
    machine, value = tps.Machine.load(file("robot200")).stated, VALUES["robot200"][0]
    angles, step = np.radians(value["joints"]), 1e-6
    turned = [machine.forward((angles + sign * step * np.eye(6)[joint])[None])[0][0] for sign in (1, -1)]
    column = (turned[0] - turned[1]) / (2 * step)  # m by which the tip goes for each radian of the joint
    return np.outer(column, column)


@pytest.mark.parametrize(
    ("effect", "added"),
    [
        (entry("spindle_compliance", radial_nm_per_N=500.0, axial_nm_per_N=100.0), "tip"),
        (entry("joint_torsion", element="joint 3", compliance_nrad_per_N_per_m=700.0), 700.0),
        (entry("weak_element", element="joint 3", factor=0.5), "bending too"),
        (entry("gear_backlash", element="joint 3", gap_arcsec=20.0, closing_N_m=0.0), "gap"),
        (entry("gear_backlash", element="joint 3", gap_arcsec=20.0, closing_N_m=400.0), "gap closing over 400 N m"),
    ],
)
def test_effects_of_elements_add_what_the_mechanics_says(effect: str, added: object, tmp_path: Path) -> None:
    """The tip goes by dp/dq for each radian of a joint, and the joint carries the moment F . dp/dq (virtual work)."""
    pose, value = poses("robot200")[0], VALUES["robot200"][0]
    machine, frame = changed(tmp_path, "robot200", more=effect), np.array(value["tip_frame"])
    tensor, third = np.array(value["tip_compliance_nm_per_N"]), torsion(2)
    found = 1e9 * tps.pose(pose, machine, force_N=2000).tip_compliance[0] - tensor
    if added == "tip":
        assert found == pytest.approx(frame @ np.diag([500.0, 500.0, 100.0]) @ frame.T, rel=1e-6)
    elif added == "bending too":  # the file's 460 of torsion and 220 of bending once more
        rest = found - 460.0 * third
        across = tps.pose(pose, changed(tmp_path, "robot200", more=entry(
            "joint_bending", element="joint 3", compliance_nrad_per_N_per_m=220.0)))  # fmt: skip
        assert rest == pytest.approx(1e9 * across.tip_compliance[0] - tensor, rel=1e-5, abs=1e-4)
        assert np.linalg.eigvalsh(rest).min() > -1e-4
    elif isinstance(
        added, str
    ):  # m of the tip per N along X: gap, as far as it is closed, times its lever over the load
        lever, closing = math.sqrt(third[0, 0]), 400.0 if "400" in added else 0.0
        along = 1e9 * math.radians(20 / 3600) * lever / 2000
        along *= math.sin(math.atan2(2000 * lever, closing))
        seen = 1e9 / tps.pose(pose, machine, force_N=2000).along_axes[0, 0] - tensor[0, 0]
        assert seen == pytest.approx(along, rel=1e-4)
    else:
        assert found == pytest.approx(float(added) * third, rel=1e-5, abs=1e-4)


def test_effects_are_held_to_their_machines(tmp_path: Path) -> None:
    weak = changed(tmp_path, "robot200", more=entry("weak_strut", strut=1, factor=0.5))
    with pytest.raises(tps.InputError, match="weak_strut holds on hexapods only, robot200 is of kind serial"):
        tps.Machine.load(weak)
    nowhere = changed(tmp_path, "robot200", more=entry("weak_element", element="joint 9", factor=0.5))
    with pytest.raises(tps.InputError, match="has no element 'joint 9'; expected one of base mount, joint 1"):
        tps.pose(poses("robot200")[0], nowhere)
    assert "joint_torsion" not in {effect.name for effect in tps.effects().effects}


def test_a_path_out_of_the_arms_reach_is_told_by_line() -> None:
    program = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z0\nG1 X100 F500\nG1 X2500\nM2", name="far.nc")
    with pytest.raises(
        tps.UnreachableError, match=r"far.nc:4: .* out of reach, first .* (no joint values|J\d|elbow|wrist)"
    ):
        tps.analyze(program, file("robot200"), origin_mm_deg=(1500, 0, 700))


def test_bounds_of_a_placement_count_from_where_the_work_stands() -> None:
    """A table beside the machine's zero: the same search as with the sums said."""
    fixed = {"rotate_deg": 0, "step_mm": 40}
    here = tps.place(POCKET, file("mill3"), x_mm=0, y_mm=(-50, 50), z_mm=0, base_mm=(60, -10, 200), **fixed)
    said = tps.place(POCKET, file("mill3"), x_mm=60, y_mm=(-60, 40), z_mm=200, **fixed)
    assert here.origin_mm_deg == said.origin_mm_deg
    assert here.origin_mm_deg[0] == 60 and here.origin_mm_deg[2] == 200 and -60 <= here.origin_mm_deg[1] <= 40


def test_a_program_that_turns_the_work_is_not_turned_by_a_search() -> None:
    program = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z0\nG1 X10 A-20 F500\nM2", name="tilted.nc")
    with pytest.raises(tps.InputError, match=r"turns axes of machine mill5.*--rotate 0"):
        tps.place(program, file("mill5"))
