"""The rig's machine of finite elements: against OpenSees, closed forms, virtual work, and what its faults must do."""

from __future__ import annotations

import dataclasses
import importlib
import json
import re
from typing import Any

import numpy as np
import pytest

import toolpath_stiff as tps
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig import beams, fem, fem_parts
from toolpath_stiff.rig.case import draw_case
from toolpath_stiff.rig.effects import with_effect
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.fem_path import pulled, reference_rows
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances, readings
from toolpath_stiff.rig.kinematics import rotations
from toolpath_stiff.rig.loops import displacements
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.rig.sizes import Scale

NIST = load_nominal("nist")
SOUND = fem.sound_machine(NIST)
YOUNG, SHEAR = beams.STEEL
POSES = pulled(
    np.array([[0.1, -0.2, 0.8], [-0.15, 0.26, 1.1], [0.0, 0.0, 0.45]]),
    np.radians([[10.0, -15.0, 20.0], [0.0, 12.0, -5.0], [0.0, 0.0, 0.0]]),
)
REFERENCE = reference_rows(NIST)
COMPLETE = dataclasses.replace(  # every fault can show
    REFERENCE, time=REFERENCE.force * 0.06, force=4.0 * REFERENCE.force, setup=np.full(72, "riser"),
    extension=REFERENCE.force * 5e-5,
)  # fmt: skip


def opensees_compliance(machine: fem.FemMachine, tip: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """(3, 3) m/N at the tip as OpenSees assembles frame, struts and platform, member by member from the drawing."""
    ops: Any = importlib.import_module("openseespy.opensees")
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    tags, stiff = iter(range(1, 10_000)), fem_parts.scale(NIST)

    def node(place):
        tag = next(tags)
        ops.node(tag, *map(float, place))
        return tag

    def beam(i, j, section, factor=1.0):
        area, sheared, second, torsion = section
        aside = np.eye(3)[np.argmin(np.abs(np.subtract(ops.nodeCoord(j), ops.nodeCoord(i))))]
        young, shear, tag = YOUNG * stiff * factor, SHEAR * stiff * factor, next(tags)
        ops.geomTransf("Linear", tag, *map(float, aside))
        figures = map(float, (young, shear, area, torsion, second, second, sheared, sheared))
        ops.element("ElasticTimoshenkoBeam", tag, i, j, *figures, tag)

    def spring(i, j, stiffness, x, y):
        materials = [next(tags) for _ in range(6)]
        for tag, value in zip(materials, stiffness, strict=True):
            ops.uniaxialMaterial("Elastic", tag, float(value))
        about = ("-dir", *range(1, 7), "-orient", *map(float, [*x, *y]))
        ops.element("zeroLength", next(tags), i, j, "-mat", *materials, *about)

    corners = fem_parts.frame_corners(NIST)  # at 60, 180 and 300 degrees: the third has the lowest azimuth
    radius = float(np.linalg.norm(corners[:, :2], axis=1).mean())
    upper = [node(corner) for corner in corners[[2, 0, 1]]]
    low = fem_parts.table_top(NIST) - 0.3 * radius
    lower = [node([radius * np.cos(angle), radius * np.sin(angle), low]) for angle in np.radians([0.0, 120.0, 240.0])]
    ring = [(0, 1), (1, 2), (2, 0)]
    pairs = [(upper[i], upper[j]) for i, j in ring] + [(lower[i], lower[j]) for i, j in ring]
    pairs += [pair for i, j in ring for pair in ((upper[i], lower[i]), (upper[j], lower[i]))]
    for pair, factor in zip(pairs, machine.members, strict=False):
        beam(*pair, beams.square(0.18 * radius), factor)
    for foot, factor in zip(lower, machine.feet, strict=False):
        ground = node(ops.nodeCoord(foot))
        ops.fix(ground, *[1] * 6)
        spring(ground, foot, stiff * fem_parts.FEET * factor * np.array([1, 1, 1, 0, 0, 0]), [1, 0, 0], [0, 1, 0])
    size = float(np.linalg.norm(NIST.platform_joints[:, :2], axis=1).mean())
    joints = [node(tip + turned @ joint) for joint in NIST.platform_joints]
    heights = (NIST.platform_joints[0, 2], NIST.tool_length, NIST.tool_length, 0.0)
    hub, nose, shaft, end = (node(tip + turned[:, 2] * height) for height in heights)
    for k in range(6):  # joints at 30, 90 ... 330 degrees: the fourth has the lowest azimuth
        beam(joints[k], joints[(k + 1) % 6], beams.square(size), machine.rim[(k + 3) % 6])
        beam(joints[k], hub, beams.square(size), machine.spokes[(k + 3) % 6])
    beam(hub, nose, beams.bar(1.1 * size))
    beam(shaft, end, beams.bar(0.9 * size * machine.tool))
    bearings = 1.0 / (1.0 / (stiff * np.array(fem_parts.BEARINGS)) + np.array([*machine.bearings, 0, 0, 0]))
    spring(nose, shaft, bearings, turned[:, 0], turned[:, 1])
    for k, (joint, corner) in enumerate(zip(joints, NIST.vertices, strict=True)):
        arm = node(NIST.frame_joints[k])
        ops.rigidLink("beam", upper[(corner + 1) % 3], arm)
        length = float(np.linalg.norm(np.subtract(ops.nodeCoord(joint), NIST.frame_joints[k])))
        share = (length - 2.5616) / (3.2132 - 2.5616)
        law = (46.5e6 * (1.0 - share) + 32.5e6 * share) / (machine.law[0] * (1.0 - share) + machine.law[1] * share)
        material = next(tags)
        ops.uniaxialMaterial("Elastic", material, law * length)
        ops.element("Truss", next(tags), arm, joint, 1.0, material)
    ops.system("FullGeneral")
    ops.numberer("Plain")
    ops.constraints("Transformation")
    ops.integrator("LoadControl", 1.0)
    ops.algorithm("Linear")
    ops.analysis("Static")
    columns = np.zeros((3, 3))
    for axis in range(3):
        ops.timeSeries("Constant", axis + 1)
        ops.pattern("Plain", axis + 1, axis + 1)
        ops.load(end, *(float(k == axis) for k in range(6)))
        assert ops.analyze(1) == 0
        columns[:, axis] = ops.nodeDisp(end)[:3]
        ops.remove("loadPattern", axis + 1)
    ops.wipe()
    return columns


@pytest.mark.parametrize(
    "fault",
    [
        {},
        {"members": 1.0 / np.arange(1.0, 25.0), "feet": np.array([0.01, 1, 0.1, 1, 1, 1])},
        {"rim": 1.0 / np.arange(1.0, 7.0), "spokes": 0.2 / np.arange(1.0, 7.0) ** 2, "tool": 0.4},
        {"bearings": np.array([2e-9, 5e-9, 1e-9])},
    ],
)
def test_opensees_assembles_the_same_machine(fault):
    pytest.importorskip("openseespy.opensees")
    machine = dataclasses.replace(SOUND, turning=np.zeros(6), **fault)
    _, pose, _, give = fem.solved(NIST, machine, POSES)
    for row, turned in list(enumerate(rotations(POSES.angles)))[::3]:
        theirs = opensees_compliance(machine, POSES.position[row], turned)
        assert np.abs(give[pose[row]][6:9, 6:9] - theirs).max() < 1e-9 * np.abs(theirs).max()


def test_a_cantilever_of_three_pieces_in_space_is_the_closed_form():
    """P L^3 / 3 EI + P L / G A_s across, P L / E A along, T L / G J about."""
    way = np.array([2.0, -1.0, 2.0]) / 3.0
    nodes, section = np.outer([0.0, 0.4, 0.5, 1.5], way), beams.bar(0.1)
    stiffness = beams.beams(nodes, [(0, 1), (1, 2), (2, 3)], section)
    give = np.linalg.inv(beams.condensed(stiffness[6:, 6:], [2]))
    area, sheared, second, torsion = section
    across = 1.5**3 / (3.0 * YOUNG * second) + 1.5 / (SHEAR * sheared)
    aside = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
    assert aside @ give[:3, :3] @ aside == pytest.approx(across, rel=1e-9)
    assert way @ give[:3, :3] @ way == pytest.approx(1.5 / (YOUNG * area), rel=1e-9)
    assert way @ give[3:, 3:] @ way == pytest.approx(1.5 / (SHEAR * torsion), rel=1e-9)
    # A load across at the tip turns it by P L^2 / 2 EI about way x aside.
    assert np.cross(way, aside) @ give[3:, :3] @ aside == pytest.approx(1.5**2 / (2.0 * YOUNG * second), rel=1e-9)


@pytest.mark.parametrize("spring", [1e3, 1e5, 1e9])
def test_a_strut_between_springs_sways_by_the_closed_form(spring):
    """12 EI / L^3 / (1 + 6 EI / (kappa L)): both ends turn alike, and each end's moment is kappa times its slope."""
    bent = fem._bending(np.full((1, 6), 2.8), np.full(6, spring))[0, 0]
    second = YOUNG * np.pi * fem.STRUT**4 / 64.0
    sway = 12.0 * second / 2.8**3 / (1.0 + 6.0 * second / (spring * 2.8))
    assert bent[0, 0] == pytest.approx(sway, rel=1e-6)
    assert bent[0, 2] == pytest.approx(-sway, rel=1e-6)


def test_a_stiff_table_on_soft_mounts_is_a_rigid_plate_on_four_springs():
    """1 / 4k up; 1 / 4k + z^2 / (4 k a^2) across at height z above it, a from the middle to each mount along x."""
    soft, height = 1e-5, 0.9
    point = np.array([[0.0, 0.0, fem_parts.table_top(NIST) + height]])
    give = fem_parts.table_give(NIST, point, np.full(4, soft), 1e3, np.zeros(3))[0]
    spring = 4.0 * fem_parts.scale(NIST) * fem_parts.MOUNTS * soft
    reach = 0.3 * fem_parts.mean_radius(NIST.frame_joints)
    assert give[2, 2] == pytest.approx(1.0 / spring, rel=1e-4)
    assert give[0, 0] == pytest.approx((1.0 + height**2 / reach**2) / spring, rel=1e-3)


@pytest.mark.parametrize(("name", "within"), [("nist", 0.005), ("nategh_agheli", 0.012), ("genhexkins", 0.025)])
def test_a_sound_machine_is_as_the_nominal_one_describes_it(name, within):
    nominal = load_nominal(name)
    rows = reference_rows(nominal)
    ratio = readings(nominal, fem.sound_machine(nominal), rows) / readings(nominal, HiddenMachine(), rows)
    assert np.sqrt(np.mean(np.log(ratio) ** 2)) < within


@pytest.mark.parametrize("kind", [{"clearance": 4e-5}, {"hertz": 2e-8}, {"opening": 1e-8}])
def test_nonlinear_joints_obey_virtual_work(kind):
    """The tip moves by what the joints give, each times its strut's force per unit load, whatever their law."""
    plain = dataclasses.replace(SOUND, turning=np.zeros(6))
    machine = dataclasses.replace(plain, **kind)
    heavy = dataclasses.replace(POSES, force=np.full(9, 6000.0))
    _, pose, struts, give = fem.solved(NIST, machine, heavy)
    _, pull, extra = fem.moved(machine, heavy, struts[pose], give[pose])
    _, unit, _ = fem.moved(plain, heavy, struts[pose], give[pose])
    assert pull == pytest.approx(unit, rel=1e-6, abs=1e-3)  # pinned struts: the forces are equilibrium's
    work = np.einsum("nk,nk->n", unit / 6000.0, extra)
    assert work.max() > 5e-7
    more = fem.between(NIST, machine, heavy, 0.0) - fem.between(NIST, plain, heavy, 0.0)
    assert more == pytest.approx(work, rel=1e-6, abs=1e-12)


def test_the_weight_closes_a_play_until_the_load_opens_it():
    loose = dataclasses.replace(SOUND, clearance=4e-5)
    light, heavy = (dataclasses.replace(POSES, force=np.full(9, force)) for force in (100.0, 20_000.0))
    give = [1.0 - loose.stiffness(NIST, rows) / SOUND.stiffness(NIST, rows) for rows in (light, heavy)]
    assert np.abs(give[0]).max() < 1e-4
    assert give[1].max() > 0.02


def test_indicators_beside_the_tip_add_up():
    machine = dataclasses.replace(SOUND, joint=3e-9, riser=1e-9, bearings=np.full(3, 1e-9))
    loops = ["tip", "spindle", "platform", "table", "strut 2", "joint 2", "frame 1"]
    read = {loop: displacements(NIST, machine, COMPLETE, [loop] * 72, np.full(72, np.nan)) for loop in loops}
    assert read["tip"] == pytest.approx(1.0 / machine.stiffness(NIST, COMPLETE), rel=1e-12)
    assert read["spindle"] + read["platform"] == pytest.approx(read["tip"], rel=1e-12)
    stiff = dataclasses.replace(machine, riser=0.0)
    rest = displacements(NIST, stiff, COMPLETE, ["table"] * 72, np.full(72, np.nan))
    riser = np.tile([1e-9, 1e-9, 0.0], 24)
    assert read["table"] - rest == pytest.approx(riser, rel=1e-9, abs=1e-18)
    assert read["tip"] - 1.0 / stiff.stiffness(NIST, COMPLETE) == pytest.approx(riser, rel=1e-6, abs=1e-15)
    alone = displacements(NIST, machine, COMPLETE, ["strut 2 alone"] * 72, np.full(72, 2.5616))
    assert alone == pytest.approx(1.0 / 46.5e6, rel=1e-9)
    assert 0.0 < np.abs(read["joint 2"]).min() < np.abs(read["strut 2"]).min()
    assert np.all(np.abs(read["frame 1"]) < 1e-9)


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_changes_what_its_link_says(name):
    """An instrument's fault changes readings alone; another the stiffness itself, and grows with its size."""
    fault, shape = FAULTS[name], FAULTS[name].shape(np.random.default_rng(3), 3, ["riser"])
    assert fault.names <= set(tps.effects().to_frame()["name"])
    machines = [with_effect(SOUND, name, fault.grown(strength, shape)) for strength in (0.02, 0.2)]
    true, shown = ([np.log(f(m) / f(SOUND)) for m in machines] for f in (
        lambda m: m.stiffness(NIST, COMPLETE), lambda m: readings(NIST, m, COMPLETE)
    ))  # fmt: skip
    assert 0.0 < np.abs(shown[0]).max() < np.abs(shown[1]).max()
    assert (np.abs(true[1]).max() == 0.0) == ("instrument" in fault.links)


def test_without_scatter_the_readings_are_the_truth_and_the_same_seed_gives_the_same():
    plan = {"x_mm": [0.0, 100.0], "y_mm": [0.0, 50.0], "z_mm": [800.0, 900.0], "direction": ["X", "Z"]}
    plan = {key: values if key == "direction" else np.array(values) for key, values in plan.items()}
    cases = [draw_case(4, "campaign", "floor_tilts", Nuisances.none(), plan=plan, size=0.1, built="fem") for _ in "ab"]
    assert cases[0].truth == cases[1].truth
    assert cases[0].rows["stiffness_N_per_mm"] == pytest.approx(cases[1].rows["stiffness_N_per_mm"], rel=0)
    size = cases[0].truth["effects"][0]["size"]
    assert size == pytest.approx(0.1, rel=0.02)
    path = cases[0].truth["path"]
    assert len(path["x_N_per_mm"]) == 36
    assert path["measured_near"].count(True) == 24


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        ({"built": "wood"}, "a machine built 'wood'"),
        ({"hidden": "weak_strut"}, "nothing called 'weak_strut' to hide"),
        ({"hidden": ("floor_tilts", "floor_tilts")}, "each once"),
        ({"hidden": "riser_soft"}, "riser_soft needs the column setup"),
    ],
)
def test_what_cannot_be_hidden_is_refused(asked, fault):
    plan = {"x_mm": np.zeros(1), "y_mm": np.zeros(1), "z_mm": np.array([800.0]), "direction": ["X"]}
    with pytest.raises(InputError, match=re.escape(fault)):
        draw_case(1, "campaign", **{"built": "fem", "hidden": "none", **asked}, plan=plan)


def test_an_exercise_on_elements_is_made_measured_and_opened(tmp_path, capsys):
    folder, plan = str(tmp_path / "blind"), tmp_path / "plan.csv"
    plan.write_text("x_mm,y_mm,z_mm,direction,loop\n0,0,800,X,\n0,0,800,X,strut 1\n")
    made = ["--layout", "paper", "--hidden", "table_mounts_soft", "--built", "fem"]
    assert main(["rig", "new", "--seed", "5", "--out", folder, *made]) == 0
    assert main(["rig", "measure", folder, "--at", str(plan), "--out", str(tmp_path / "more.csv")]) == 0
    assert len((tmp_path / "more.csv").read_text().splitlines()) == 3
    capsys.readouterr()
    claims = {"table_compliance": "right", "outside": "wrong", "frame_compliance": "wrong", "frame_sway": "wrong"}
    for claim, verdict in claims.items():
        assert main(["rig", "reveal", folder, "--claim", claim, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["verdict"] == verdict
    assert main(["rig", "reveal", folder, "--claim", "table_compliance"]) == 0
    assert "it is in: table" in capsys.readouterr().out


def test_a_machine_that_cannot_take_a_pose_has_too_much_of_its_fault():
    """Frame joints three metres off: no struts of these lengths reach."""
    machine = dataclasses.replace(SOUND, frame_errors=np.full((6, 3), 5.0) * np.eye(6)[:, :3])
    scale = Scale(NIST, REFERENCE, np.arange(len(REFERENCE.force)), Nuisances(0.02), SOUND)
    assert np.isinf(scale.change(machine)).all() and np.isfinite(scale.change(SOUND)).all()
