"""Pulls on a machine of elements: read, and what a diagnosis makes of them; truths by finite turns of its joints."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.updating.planning import read_filled
from toolpath_stiff.cli.main import main
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.readings.measurements import model_stiffness
from toolpath_stiff.stiffness.element_sum import tip_compliance
from toolpath_stiff.stiffness.model import StiffnessModel, build_model, parameter_slopes, path_of_stance

ROBOT = Path(__file__).parents[1] / "machine" / "data" / "robot200.toml"
MACHINE = tps.Machine.load(ROBOT).stated
SD_UM = 15.0
HEAD = "fx_N,fy_N,fz_N,ux_um,uy_um,uz_um,sd_um"


def joints(rng: np.random.Generator, count: int) -> np.ndarray:
    """(n, 6) rad, the wrist away from its singular place."""
    low, high = MACHINE.joint_limits.T
    drawn = low + (high - low) * rng.uniform(0.2, 0.8, (4 * count, 6))
    return drawn[np.abs(np.sin(drawn[:, 4])) > 0.2][:count]


def screws(q: np.ndarray, about: str) -> np.ndarray:
    """(n, 6, 3) m by which the tip goes for each radian about z, x or y of each joint's frame, by Craig's rule."""
    rows = [(0, 0, 0, 760), (-90, 340, -90, 0), (0, 1120, 0, 0), (-90, 190, 0, 1260), (90, 0, 0, 0), (-90, 0, 0, 230)]
    tip, column = MACHINE.forward(q)[0], "xyz".index(about)
    frames, moved = np.broadcast_to(np.eye(4), (len(q), 4, 4)), []
    for (alpha, a, offset, d), angle in zip(rows, q.T, strict=True):
        turn, (ca, sa) = angle + np.radians(offset), (np.cos(np.radians(alpha)), np.sin(np.radians(alpha)))
        c, s, zero, one = np.cos(turn), np.sin(turn), 0.0 * turn, 1.0 + 0.0 * turn
        step = np.array([[c, -s, zero, a / 1e3 * one], [s * ca, c * ca, -sa * one, -sa * d / 1e3 * one],
                         [s * sa, c * sa, ca * one, ca * d / 1e3 * one], [zero, zero, zero, one]])  # fmt: skip
        frames = frames @ np.moveaxis(step, 2, 0)
        moved.append(np.cross(frames[:, :3, column], tip - frames[:, :3, 3]))
    return np.stack(moved, axis=1)


def campaign(path: Path, seed: int, fault: str, joint: int = 2, count: int = 30) -> str:
    """Readings of a robot with a fault at drawn joints under drawn forces; what is missing is added by hand."""
    rng = np.random.default_rng(seed)
    q, force = joints(rng, count), rng.normal(size=(count, 3))
    force *= rng.uniform(500.0, 1500.0, (count, 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    position, rotation = MACHINE.forward(q)
    moved = np.empty((count, 3))
    for configuration in range(8):
        stance = MACHINE.solve(position, rotation, configuration=configuration)
        here = np.abs(np.exp(1j * stance.joints) - np.exp(1j * q)).max(axis=1) < 1e-6
        moved[here] = np.einsum("nij,nj->ni", stance.tip_compliance()[:, :3, :3], force)[here]
    for axis, size in {"torsion": (("z", 800e-9),), "bending": (("x", 700e-9), ("y", 700e-9))}.get(fault, ()):
        rows = screws(q, axis)[:, joint]
        moved += size * rows * (rows * force).sum(axis=1, keepdims=True)
    if fault == "backlash":  # taken up by any load
        rows = screws(q, "z")[:, joint]
        moved += 4e-4 * np.sign((rows * force).sum(axis=1, keepdims=True)) * rows
    if fault == "unknown":  # a guide that binds: softer the further out, along one direction of the floor alone
        moved[:, 0] += 2e-6 * np.sin(3.0 * position[:, 0]) ** 2 * force[:, 0]
    moved = 1e6 * moved + SD_UM * rng.normal(size=moved.shape)
    names = ",".join(f"joint_{i}_deg" for i in range(1, 7))
    rows = np.hstack([np.degrees(q), force, moved, np.full((count, 1), SD_UM)])
    path.write_text(f"{names},{HEAD}\n" + "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows), "utf-8")
    return str(path)


CASES = (
    [("none", 0)] * 12 + [("torsion", j) for j in (0, 1, 2, 3, 4, 5)] * 2 + [("bending", j) for j in (0, 1, 2, 3)] * 2
)
CASES += [("unknown", 0)] * 6 + [("backlash", 0), ("backlash", 2)]


def test_blind_cases_of_a_robot(tmp_path: Path) -> None:
    """Right in nine of ten, a wrong name alone in one of thirty at most."""
    right = wrong = 0
    for seed, (fault, joint) in enumerate(CASES):
        found = tps.diagnose(campaign(tmp_path / f"{seed}.csv", seed, fault, joint), ROBOT)
        named = "gear_backlash" if fault == "backlash" else f"joint_{fault}"
        truth = {"none": "adequate", "unknown": "unexplained"}.get(fault, f"{named}, joint {joint + 1}")
        names = found.labels
        right += truth == found.verdict or truth in names
        wrong += found.verdict == "identified" and truth not in names
    assert right >= 0.9 * len(CASES) and wrong <= len(CASES) / 30


def test_an_update_refits_the_joints_and_adds_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Torsions in the file's place, a further effect beside them, written; refused where nothing helps."""
    data, new = campaign(tmp_path / "a.csv", 5, "torsion", 2, 43), tmp_path / "new.toml"
    assert main(["diagnose", data, "--machine", str(ROBOT), "--out", str(tmp_path / "d")]) == 0
    assert "joint 3 gives way by about" in capsys.readouterr().out
    document = json.loads((tmp_path / "d" / "diagnose.json").read_text("utf-8"))
    assert document["joints_fitted_nrad_per_Nm"]["joint 3"] == pytest.approx(460.0 + 800.0, rel=0.03)
    assert document["error_of_joints_fitted_at_left_out_poses_percent"] < document["error_as_given_percent"] / 5
    command = ["update", data, "--machine", str(ROBOT), "-o", str(new), "--out", str(tmp_path / "u")]
    assert main([*command, "--joints"]) == 0
    again = tps.Machine.load(new)
    assert again.stated.text.count("torsion_nrad_per_Nm =") == 1 and again.name == "robot200"
    assert tps.diagnose(data, again).verdict == "adequate"
    one, two = (campaign(tmp_path / f"{kind}.csv", 7, kind, 1) for kind in ("bending", "none"))
    added = tps.update(one, ROBOT, auto=True)
    (entry,) = added.machine.stated.effects
    assert entry.parameters["element"] == "joint 2" and entry.name == "joint_bending"
    assert entry.parameters["compliance_nrad_per_N_per_m"] == pytest.approx(700.0, rel=0.05)
    assert tps.diagnose(one, added.machine).verdict == "adequate"
    assert tps.update(two, ROBOT, auto=True).verdict == "nothing added"
    assert tps.update(two, ROBOT, joints=True).verdict == "refused"


def test_joints_and_an_effect_are_judged_beside_each_other(tmp_path: Path) -> None:
    """All torsions of the file wrong, and one joint gives way across its axis besides: both are found again."""
    true = "[620.0, 340.0, 460.0, 1900.0, 2300.0, 4800.0]"
    off = tmp_path / "off.toml"
    off.write_text(ROBOT.read_text("utf-8").replace(true, "[300.0, 700.0, 200.0, 3000.0, 1500.0, 3000.0]"), "utf-8")
    data = campaign(tmp_path / "a.csv", 77, "bending", 1, 40)
    update = tps.update(data, off, joints=True, add="joint_bending:element=joint 2")
    assert update.verdict == "updated" and "--joints" in update.provenance["command"]
    assert list(update.fitted_joints.values()) == pytest.approx(json.loads(true), rel=0.1)
    assert tps.diagnose(data, update.machine).verdict == "adequate"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({}, "nothing to update"),
        ({"strut_law": True}, "no strut law"),
        ({"add": "weak_strut"}, "on hexapods only"),
        ({"add": "joint_torsion:element=joint 9"}, "no element 'joint 9'"),
    ],
)
def test_updates_that_cannot_be_are_refused(options: dict[str, Any], told: str, tmp_path: Path) -> None:
    with pytest.raises(tps.InputError, match=told):
        tps.update(campaign(tmp_path / "a.csv", 5, "none"), ROBOT, **options)


def test_components_in_turned_axes_and_poses_without_joints(tmp_path: Path) -> None:
    """The same pulls with the sensor turned, with poses instead of joints, with cells that were not read."""
    plain = Path(campaign(tmp_path / "a.csv", 3, "torsion", 1))
    head, *rows = [line.split(",") for line in plain.read_text("utf-8").splitlines()]
    turned = [[*row[:9], row[10], f"-{row[9]}".replace("--", ""), *row[11:], "90"] for row in rows]

    def write(name: str, heading: list[str], lines: list[list[str]]) -> None:
        (tmp_path / name).write_text("\n".join(map(",".join, [heading, *lines])), "utf-8")

    write("turned.csv", [*head, "sensor_axes_c_deg"], turned)
    write("asked.csv", head, [row[:-1] for row in turned])
    asked = tps.diagnose(str(tmp_path / "asked.csv"), ROBOT)
    assert asked.verdict == "unexplained" and "is the sensor in other axes?" in str(asked)
    gaps = [[*row[:10], "NaN" if i % 4 else row[10], *row[11:]] for i, row in enumerate(rows)]
    write("gaps.csv", head, [*gaps, [*rows[0][:9], "", "n/a", "", rows[0][-1]]])
    as_read, other = (tps.diagnose(str(tmp_path / name), ROBOT) for name in ("a.csv", "turned.csv"))
    assert other.labels == as_read.labels == ["joint_torsion, joint 2"]
    assert other.error_as_given == pytest.approx(as_read.error_as_given, rel=1e-9)
    assert tps.diagnose(str(tmp_path / "gaps.csv"), ROBOT).labels == as_read.labels


def test_a_cable_off_the_tip_is_the_wrench_that_it_makes(tmp_path: Path) -> None:
    """The same pull, said by tension and pulley and by its vector; and a dial, said as a component."""
    position, rotation = MACHINE.forward(joints(np.random.default_rng(1), 1))
    hook, (x, y, z) = position[0] + rotation[0] @ [0.02, 0.0, 0.05], 1e3 * position[0]
    force = 900.0 * np.array([0.6, 0.0, 0.8])
    pulley = 1e3 * (hook + 2.0 * np.array([0.6, 0.0, 0.8]))
    angles = np.degrees([np.arctan2(rotation[0][2, 1], rotation[0][2, 2]), -np.arcsin(rotation[0][2, 0]),
                         np.arctan2(rotation[0][1, 0], rotation[0][0, 0])])  # fmt: skip
    pose, off = ",".join(map(str, (x, y, z, *angles))), "20,0,50"
    head = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,pull_dx_mm,pull_dy_mm,pull_dz_mm"
    by_cable, by_force = tmp_path / "cable.csv", tmp_path / "force.csv"
    cable, vector = ",".join(map(str, pulley)), ",".join
    rows = [(f"{900 * k},{cable},0,0,2,{100 * k}", f"{vector(map(str, k * force))},,,{100 * k}")
            for k in range(1, 7)]  # fmt: skip
    heads = (
        "tension_N,cable_x_mm,cable_y_mm,cable_z_mm,dial_x,dial_y,dial_z,displacement_um",
        HEAD.removesuffix(",sd_um"),
    )
    for path, more, lines in zip((by_cable, by_force), heads, zip(*rows, strict=True), strict=True):
        path.write_text("\n".join([f"{head},{more}", *(f"{pose},{off},{line}" for line in lines)]), "utf-8")
    one, other = (tps.diagnose(str(path), ROBOT, noise_percent=5) for path in (by_cable, by_force))
    assert one.problem.predicted == pytest.approx(other.problem.predicted, rel=1e-9)


@pytest.mark.parametrize(
    ("head", "row", "told"),
    [
        ("x_mm,y_mm,z_mm,ux_um", "1800,0,900,5", "column"),
        ("x_mm,y_mm,z_mm,fx_N,fy_N,fz_N,ux_um", "1800,0,900,1,2,,5", "fz_N"),
        ("x_mm,y_mm,z_mm,fx_N,fy_N,fz_N,ux_um", "1800,0,900,1,2,inf,5", "fz_N"),
        ("x_mm,y_mm,z_mm,fx_N,fy_N,fz_N,ux_um", "1800,0,900,1,2,3,", "nothing read"),
        ("x_mm,y_mm,z_mm,fx_N,fy_N,fz_N,ux_um", "9800,0,900,1,2,3,5", "no joint values lead to the pose"),
        ("joint_1_deg,fx_N,fy_N,fz_N,ux_um", "5,1,2,3,5", "column joint_2_deg is missing"),
        (
            "x_mm,y_mm,z_mm,joint_1_deg,joint_2_deg,joint_3_deg,joint_4_deg,joint_5_deg,joint_6_deg,fx_N,fy_N,fz_N,ux_um",
            "1800,0,900,5,12,45,-30,-60,-165,1,2,3,5",
            "pose and joints are .* mm apart",
        ),
        ("x_mm,y_mm,z_mm,tension_N,ux_um", "1800,0,900,100,5", "column cable_x_mm is missing"),
        ("x_mm,y_mm,z_mm,load_kg,fz_N", "1800,0,900,100,5", "column ux_um is missing"),
        ("x_mm,y_mm,z_mm,fz_N,ux_um,force_axes", "1800,0,900,100,5,tcp", "axes tcp; expected one of base, tip, work"),
        ("x_mm,y_mm,z_mm,fx_N,fy_N,fz_N,ux_um", "1800,0,900,0,0,0,5", "no force"),
        ("x_mm,y_mm,z_mm,fx_N,fy_N,fz_N,ux_um,uy_um", "1800,0,900,1,2,3,0,nan", "nothing read"),
    ],
)
def test_rows_that_are_no_pulls_are_told_by_line(head: str, row: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(f"{head}\n{row}\n", "utf-8")
    with pytest.raises((tps.InputError, tps.TpsError), match=rf"bad.csv:[12].*{told}"):
        tps.diagnose(str(path), ROBOT, noise_percent=5)


@pytest.mark.parametrize("kind", ["robot200", "mill5", "delta", "pentapod"])
def test_a_plan_tells_elements_apart_on_every_kind(kind: str, tmp_path: Path) -> None:
    """Its rows are a measurement file, which a diagnosis reads once it is filled in: here with one element softer."""
    machine = tps.Machine.load(ROBOT.parent / f"{kind}.toml")
    first, second = [row.name for row in machine.stated.elements if row.link != "tool"][1:3]
    effect = "joint_torsion" if kind == "robot200" else "weak_element"
    plan = tps.plan(machine=machine, between=(f"{effect}:{first}", f"{effect}:{second}"), n=8)
    assert plan.choice.separable and len(plan.choice.chosen) == 8
    keys = {"compliance_nrad_per_N_per_m": 300.0} if kind == "robot200" else {"factor": 0.5}
    softer = tmp_path / "softer.toml"
    entry = "\n".join(f"{key} = {value}" for key, value in keys.items())
    softer.write_text(f'{machine.stated.text}\n[[effect]]\nname = "{effect}"\nelement = "{first}"\n{entry}\n', "utf-8")
    plan.save(tmp_path / "plan", plots=False)
    head, *rows = (tmp_path / "plan" / "plan.csv").read_text("utf-8").splitlines()
    planned = read_filled(tmp_path / "plan" / "plan.csv", machine.stated)
    read = model_stiffness(tps.Machine.load(softer).model, planned) / 1e3
    column = head.split(",").index("stiffness_N_per_mm")
    cells = [row.split(",") for row in rows]
    filled = [[*row[:column], f"{k:.7g}", *row[column + 1 :]] for row, k in zip(cells, read, strict=True)]
    (tmp_path / "read.csv").write_text("\n".join([head, *map(",".join, filled)]), "utf-8")
    found = tps.diagnose(str(tmp_path / "read.csv"), machine, noise_percent=2)
    assert f"{effect}, {first}" == found.labels[0] and f"{effect}, {second}" not in found.labels


def rows_of(path: str) -> tuple[list[str], np.ndarray]:
    head, *rows = Path(path).read_text("utf-8").splitlines()
    return head.split(","), np.array([[float(cell) for cell in row.split(",")] for row in rows])


def written(path: Path, head: list[str], rows: np.ndarray) -> str:
    path.write_text("\n".join([",".join(head), *(",".join(f"{v:.9g}" for v in row) for row in rows)]), "utf-8")
    return str(path)


def test_mistakes_that_people_make_lead_on(tmp_path: Path) -> None:
    """Radians for degrees, mm for um, the force on the sensor for that on the tool."""
    head, rows = rows_of(campaign(tmp_path / "a.csv", 9, "none", 0, 20))
    (radians, reversed_), millimetres = rows.copy()[None].repeat(2, axis=0), rows.copy()
    radians[:, :6] = np.radians(rows[:, :6])
    with pytest.raises(tps.TpsError, match=r"degrees.*joint_1_deg:rad"):
        tps.diagnose(written(tmp_path / "r.csv", head, radians), ROBOT)
    millimetres[:, 9:] /= 1e3
    found = tps.diagnose(written(tmp_path / "m.csv", head[:-1], millimetres[:, :-1]), ROBOT)
    assert "Are the units right" in found.to_dict()["question"] and found.verdict == "unexplained"
    reversed_[:, 6:9] *= -1.0
    found = tps.diagnose(written(tmp_path / "s.csv", head, reversed_), ROBOT)
    assert "reversed" in found.to_dict()["question"] and found.verdict == "unexplained"


def test_other_honest_columns_say_the_same(tmp_path: Path) -> None:
    """A force along a direction at joint values; components that are not there; a moment beside the force."""
    head, rows = rows_of(campaign(tmp_path / "a.csv", 9, "none", 0, 20))
    along_z = rows[np.abs(rows[:, 8]) > 100.0]
    zeros, force, moved = np.zeros((len(along_z), 2)), along_z[:, 8:9], along_z[:, 11:12]
    signed = np.hstack([along_z[:, :6], np.abs(force), zeros, np.ones_like(force), moved * np.sign(force)])
    by_direction = written(tmp_path / "d.csv", [*head[:6], "force_N", "dx", "dy", "dz", "displacement_um"], signed)
    only = np.hstack([along_z[:, :6], along_z[:, 8:9], along_z[:, 11:12]])
    by_component = written(tmp_path / "z.csv", [*head[:6], "fz_N", "uz_um"], only)
    models = [tps.compare(file, ROBOT, noise_percent=5).problem for file in (by_component, by_direction)]
    stance = MACHINE.standing(np.radians(along_z[:, :6]))
    expected = stance.tip_compliance()[:, 2, 2] * along_z[:, 8]
    np.testing.assert_allclose(models[0].predicted, expected, rtol=1e-6)
    np.testing.assert_allclose(np.abs(models[1].predicted), np.abs(expected), rtol=1e-6)
    arm = np.hstack([only[:, :7], np.full((len(only), 1), 40.0), only[:, 7:]])
    found = tps.compare(written(tmp_path / "m.csv", [*head[:6], "fz_N", "mx_Nm", "uz_um"], arm), ROBOT, noise_percent=5)
    np.testing.assert_allclose(found.problem.predicted, expected + 40.0 * stance.tip_compliance()[:, 2, 3], rtol=1e-6)


def test_errors_are_shown_as_vectors_and_by_component(tmp_path: Path) -> None:
    found = tps.compare(campaign(tmp_path / "a.csv", 5, "torsion", 2, 20), ROBOT)
    columns, document = found.vectors(), found.to_dict()
    size = np.linalg.norm([columns[f"u{axis}_um"] for axis in "xyz"], axis=0)
    error = np.linalg.norm([columns[f"error_{axis}_um"] for axis in "xyz"], axis=0)
    np.testing.assert_allclose(columns["error_percent"], 100.0 * error / size)
    assert len(size) == 20 and (columns["angle_deg"] < 90.0).all()
    total = sum(part["error_rms_um"] ** 2 for part in document["components"])
    assert total == pytest.approx(float((error**2).mean()))
    assert "vectors.csv" in found.files(plots=False)


def test_bands_hold_what_refitted_joints_leave_open(tmp_path: Path) -> None:
    """The band of a pose's stiffness is that of the torsions' covariance: sd of d^T C d by the joints' rows."""
    data = campaign(tmp_path / "a.csv", 5, "torsion", 2, 20)
    machine = tps.update(data, ROBOT, joints=True).machine.stated
    known = machine.uncertainty
    assert known.names[2] == "joint 3.torsion_nrad_per_Nm" and len(known.names) == 6
    model = build_model(machine)
    stance = machine.standing(joints(np.random.default_rng(3), 1))
    rows = screws(stance.joints, "z")[0][:, 1]  # along Y
    slopes = parameter_slopes(model, lambda m: np.array([_along_y(m, stance)]), np.array([_along_y(model, stance)]))
    found = np.array([slopes[i][0] for i in range(6)])
    np.testing.assert_allclose(found, 1e-9 * known.sd * rows**2, rtol=1e-6)


def _along_y(model: StiffnessModel, stance: Stance) -> float:
    """Compliance of the tip along Y, m/N."""
    return float(tip_compliance(model, path_of_stance(model, stance))[0, 1, 1])


def test_auto_refits_the_joints_where_all_of_them_are_wrong(tmp_path: Path) -> None:
    """Else it would explain six wrong torsions by four effects; what is named by hand is refused with the way out."""
    off = tmp_path / "off.toml"
    true = "[620.0, 340.0, 460.0, 1900.0, 2300.0, 4800.0]"
    off.write_text(ROBOT.read_text("utf-8").replace(true, "[1000.0, 1000.0, 1000.0, 1000.0, 1000.0, 1000.0]"), "utf-8")
    data = campaign(tmp_path / "a.csv", 78, "none", 0, 40)
    update = tps.update(data, off, auto=True)
    assert update.added == ["joints refitted"]
    assert list(update.fitted_joints.values()) == pytest.approx(json.loads(true), rel=0.05)
    assert "(--joints)" in tps.update(data, off, add="spindle_compliance").text


def test_repeats_tell_the_scatter(tmp_path: Path) -> None:
    """Of pulls read four times each, against the scatter that was drawn; too small a stated one is overruled."""
    head, rows = rows_of(campaign(tmp_path / "a.csv", 9, "none", 0, 20))
    again = rows.repeat(4, axis=0)
    again[:, 9:12] += 40.0 * np.random.default_rng(1).normal(size=(80, 3))
    found = tps.diagnose(written(tmp_path / "r.csv", head[:-1], again[:, :-1]), ROBOT)
    size = np.linalg.norm(again[:, 9:12], axis=1)
    drawn = float(np.sqrt(np.mean((40.0 / size) ** 2)))
    assert found.problem.noise.typical == pytest.approx(drawn, rel=0.2)
    assert "180 differences between repeats" in found.problem.noise.origin and found.verdict == "adequate"
    stated = tps.diagnose(written(tmp_path / "s.csv", head, again), ROBOT)
    assert "sd_um of each row is too little" in stated.problem.noise.origin
    copies = tps.diagnose(written(tmp_path / "c.csv", head[:-1], rows[:, :-1].repeat(2, axis=0)), ROBOT)
    assert "repeats" not in copies.problem.noise.origin


def test_components_in_the_tip_axes(tmp_path: Path) -> None:
    """Forces written in the tip's axes are asked about, and read so where it is said."""
    head, rows = rows_of(campaign(tmp_path / "a.csv", 9, "none", 0, 20))
    turned = rows.copy()
    turned[:, 6:9] = np.einsum("nji,nj->ni", MACHINE.forward(np.radians(rows[:, :6]))[1], rows[:, 6:9])
    data = written(tmp_path / "t.csv", head, turned)
    assert '"force_axes==tip"' in tps.diagnose(data, ROBOT).to_dict()["question"]
    assert tps.diagnose(data, ROBOT, columns="force_axes==tip").verdict == "adequate"


def test_a_pull_far_off_is_named_and_not_counted(tmp_path: Path) -> None:
    """A slip of a decimal point among pulls that no single effect explains; and rows of no load are passed over."""
    off = tmp_path / "off.toml"
    off.write_text(ROBOT.read_text("utf-8").replace("[620.0, 340.0, 460.0,", "[900.0, 500.0, 300.0,"), "utf-8")
    head, rows = rows_of(campaign(tmp_path / "a.csv", 9, "bending", 2, 30))
    rows[4, 9:12] *= 10.0
    none = np.zeros((1, rows.shape[1]))
    none[0, :6], none[0, 12] = rows[0, :6], SD_UM
    found = tps.diagnose(written(tmp_path / "w.csv", head, np.vstack([rows, none])), off)
    assert found.verdict == "unexplained" and f"{tmp_path / 'w.csv'}:6 x" in found.wild and len(found.wild) == 3
    assert found.error_as_given < 40.0 and "1 rows of no force, or of which nothing" in str(found)


def test_tables_of_pulls_are_refused_where_stiffnesses_are_read(tmp_path: Path) -> None:
    """`reduce` and the studio say what to do instead; angles of another order are told by pose and joints."""
    data = campaign(tmp_path / "a.csv", 9, "none", 0, 20)
    for read in (tps.reduce, lambda file: tps.Case.open(tmp_path / "case").add_data(file)):
        with pytest.raises(tps.TpsError, match=r"pulls on a machine of elements.*diagnose"):
            read(data)
    head, rows = rows_of(data)
    position, rotation = MACHINE.forward(np.radians(rows[:, :6]))
    yaw, pitch, roll = np.degrees([np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]), -np.arcsin(rotation[:, 2, 0]),
                                   np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])])  # fmt: skip
    pose = np.column_stack([1e3 * position, yaw, pitch, roll])
    both = written(tmp_path / "b.csv", ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", *head],
                   np.hstack([pose, rows]))  # fmt: skip
    with pytest.raises(tps.TpsError, match=r"degrees apart.*a=c_deg"):
        tps.diagnose(both, ROBOT)
    assert tps.diagnose(both, ROBOT, columns="a=c_deg, c=a_deg").verdict == "adequate"


def test_poses_in_other_axes_than_the_joints(tmp_path: Path) -> None:
    """A tracker's axes, near the base's or not: noted, or refused with the [work] that reads all of it as it stands."""
    head, rows = rows_of(campaign(tmp_path / "a.csv", 9, "none", 0, 20))
    places = ["x_mm", "y_mm", "z_mm"]
    for angle, shift in ((0.3, [3.0, -8.0, 2.0]), (90.0, [250.0, -180.0, 900.0])):
        turn = np.array([[np.cos(np.radians(angle)), -np.sin(np.radians(angle)), 0.0],
                         [np.sin(np.radians(angle)), np.cos(np.radians(angle)), 0.0], [0.0, 0.0, 1.0]])  # fmt: skip
        pose = 1e3 * MACHINE.forward(np.radians(rows[:, :6]))[0] @ turn.T + shift
        both = np.hstack([pose, rows[:, :6], rows[:, 6:9] @ turn.T, rows[:, 9:12] @ turn.T, rows[:, 12:]])
        data = written(tmp_path / f"{angle:g}.csv", [*places, *head], both)
        if angle < 1.0:
            assert f"other axes, xyz_mm = {(-turn.T @ shift).round(1).tolist()}" in str(tps.diagnose(data, ROBOT))
            continue
        with pytest.raises(tps.TpsError, match=r"90.csv:2: .*and in 19 more rows\); expected .*\[work\] (.*)") as error:
            tps.diagnose(data, ROBOT)
        keys = str(error.value).split("[work] ")[1].split(". ")[0].replace(", rpy", "\nrpy")
        work = tmp_path / "work.toml"
        work.write_text(f"{ROBOT.read_text('utf-8')}\n[work]\n{keys}\n", "utf-8")
        found = tps.diagnose(data, work, columns="force_axes==work, sensor_axes==work")
        plain = tps.diagnose(str(tmp_path / "a.csv"), ROBOT)
        assert found.error_as_given == pytest.approx(plain.error_as_given, rel=1e-3) and found.verdict == "adequate"


def test_a_dial_that_hardly_moves_does_not_judge_the_joints(tmp_path: Path) -> None:
    """Dials across the force read next to nothing at some pulls, where any error is many times the reading."""
    off = tmp_path / "off.toml"
    off.write_text(ROBOT.read_text("utf-8").replace("[620.0, 340.0, 460.0,", "[900.0, 500.0, 300.0,"), "utf-8")
    head, rows = rows_of(campaign(tmp_path / "a.csv", 9, "none", 0, 43))
    dial = np.cross(rows[:, 6:9], rows[:, 9:12])  # square to what moves and to the force
    dial[::2] = np.eye(3)[np.arange(22) % 3]
    dial /= np.linalg.norm(dial, axis=1, keepdims=True)
    read = (dial * rows[:, 9:12]).sum(axis=1, keepdims=True) + 3.0
    names = [*head[:9], "dial_x", "dial_y", "dial_z", "displacement_um", "sd_um"]
    data = written(tmp_path / "d.csv", names, np.hstack([rows[:, :9], dial, read, rows[:, 12:]]))
    update = tps.update(data, off, joints=True)
    assert update.verdict == "updated" and update.steps[-1].error < 0.1
