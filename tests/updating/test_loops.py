"""Indicators beside the tip: the model's virtual work against the rig's assembled elements, and by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stiffness.cases import nist
from toolpath_stiff.comparison.compare import compare
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.correction.update import update
from toolpath_stiff.diagnosis.diagnose import diagnose
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.result import plan
from toolpath_stiff.readings.measurements import measured_path, model_stiffness, read_measurements
from toolpath_stiff.report.compare import text
from toolpath_stiff.report.update import residuals_csv
from toolpath_stiff.rig.case import draw_case
from toolpath_stiff.rig.exercise import csv_text
from toolpath_stiff.rig.hidden import HiddenMachine
from toolpath_stiff.rig.loops import displacements
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.loop_response import loop_compliance
from toolpath_stiff.stiffness.measuring_loop import MeasuringLoop, measuring_loop
from toolpath_stiff.stiffness.model import build_model

POSES = np.array([[0.05, -0.1, 0.6, 0.1, -0.2, 0.05], [-0.2, 0.15, 1.1, -0.3, 0.1, 0.0], [0.0, 0.0, 0.8, 0, 0, 0]])
DIRECTIONS = np.array([[1.0, 0, 0], [0, 0.6, 0.8], [0, 0, 1.0]])
NAMES = (
    "tip", "spindle", "platform", "table", "strut 2", "strut 5 alone", "joint 4", "joint 4 frame", "frame 1",
    "frame 2 radial", "frame 3 vertical",
)  # fmt: skip
# What gives way: the model's effects with SI values, and the same of the rig's hidden machine.
CASES = {
    "nothing": ([], {}),
    "all of it": (
        [
            ("spindle_compliance", {"radial": 7e-9, "axial": 4e-9}),
            ("table_compliance", {"x": 3e-9, "y": 4e-9, "z": 5e-9, "rocking": 6e-9}),
            ("frame_compliance", {"vertex": 0, "radial": 6e-9, "vertical": 9e-9}),
            ("joint_compliance", {"compliance": 8e-9}),
            ("strut_law", {"curvature": 0.1}),
        ],
        {
            "spindle": (7e-9, 4e-9),
            "table": np.array([3e-9, 4e-9, 5e-9]),
            "rocking": 6e-9,
            "vertices": np.tile([6e-9, 9e-9], (6, 1)),
            "joint": 8e-9,
            "curvature": 0.1,
        },
    ),
    "load and moments": (
        [
            ("contact_nonlinearity", {"compliance": 6e-9}),
            ("joint_moment_stiffness", {"strut": 0, "stiffness": 1e5}),
            ("setup_compliance", {"setup": "riser", "x": 2e-9, "y": 3e-9, "z": 4e-9}),
        ],
        {"hertz": 6e-9, "moment": 1e5, "setup": "riser", "setup_compliance": np.array([2e-9, 3e-9, 4e-9])},
    ),
    "platform bars": ([("platform_flexibility", {"bar_stiffness": 5e8})], {"bars": 5e8}),
}


def rows(setup: str = "riser") -> Rows:
    n = len(POSES)
    return Rows(
        POSES[:, :3], POSES[:, 3:], DIRECTIONS, np.full(n, 2000.0), np.zeros(n), np.zeros(n), np.zeros(n),
        np.full(n, setup),
    )  # fmt: skip


def model_of(effects):
    return build_model(nist(), extra=[ActiveEffect(find_effect(name), values) for name, values in effects])


def file_of(tmp_path, lines: list[str], heading: str) -> str:
    path = tmp_path / "loops.csv"
    path.write_text("\n".join([heading, *lines]) + "\n")
    return str(path)


@pytest.fixture(scope="module")
def at_poses(tmp_path_factory):
    """The path of the three poses under 2000 N in set-up riser."""
    heading = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,dx,dy,dz,force_N,stiffness_N_per_mm,setup"
    lines = []
    for pose, d in zip(POSES, DIRECTIONS, strict=True):
        cells = [*(1e3 * pose[:3]), *np.degrees(pose[3:]), *d, 2000, 30000]
        lines.append(",".join(f"{v:.12g}" for v in cells) + ",riser")
    return read_measurements(file_of(tmp_path_factory.mktemp("loops"), lines, heading), nist())


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", NAMES)
def test_a_loop_reads_what_the_assembled_elements_move(case, name, at_poses):
    effects, hidden = CASES[case]
    model = model_of(effects)
    loop = measuring_loop(name)
    found = loop_compliance(model, measured_path(model, at_poses), DIRECTIONS, [loop], np.zeros(3, dtype=int))
    true = displacements(load_nominal("nist"), HiddenMachine(**hidden), rows(), [name] * 3, np.full(3, np.nan))
    # The rig's joints have unknowns of their own along each strut; secant iteration settles to 1e-11.
    assert found == pytest.approx(true, rel=1e-6, abs=2e-13)


def test_loops_add_up_to_the_tip(at_poses):
    """Spindle and platform are the tip; by Castigliano struts and joints, times their forces, are the rest."""
    model = model_of(
        [("spindle_compliance", {"radial": 7e-9, "axial": 4e-9}), ("joint_compliance", {"compliance": 8e-9})]
    )
    path = measured_path(model, at_poses)
    which = np.zeros(3, dtype=int)

    def read(name: str):
        return loop_compliance(model, path, DIRECTIONS, [measuring_loop(name)], which)

    assert read("spindle") + read("platform") == pytest.approx(read("tip"), rel=1e-12)
    forces = exact.under_load(model, path, DIRECTIONS)[3]
    of_struts = sum(forces[:, i] * (read(f"strut {i + 1}") + read(f"joint {i + 1}")) for i in range(6))
    assert of_struts == pytest.approx(read("platform"), rel=1e-12)
    assert read("joint 2 platform") + read("joint 2 frame") == pytest.approx(read("joint 2"), rel=1e-12)
    assert read("strut 3 alone") == pytest.approx(1.0 / nist().strut_law.stiffness(path.struts.lengths[:, 2]))


def test_words_of_the_column():
    assert str(measuring_loop(" Strut 3  Alone")) == "strut 3 alone"
    assert measuring_loop("") == measuring_loop("tip") == MeasuringLoop()
    for wrong in ("strut", "strut 7", "frame 4", "spindle 1", "joint 2 radial", "floor"):
        assert measuring_loop(wrong) is None
    for name in NAMES:
        assert str(measuring_loop(name)) == name


HEADING = "x_mm,y_mm,z_mm,direction,loop,stiffness_N_per_mm,displacement_um,force_N,sd_um,strut_force_N,length_mm"
LINES = [
    "0,0,800,X,,40000,,1000,,,",
    "0,0,800,X,table,,0,1000,0.2,,",
    "0,0,800,-X,strut 2,,-12.5,1000,,,",
    "0,0,800,Z,spindle,2e5,,1000,,,",
    ",,,,strut 3 alone,,25,,,1000,2500",
]


def test_loop_readings_arrive_as_compliances(tmp_path):
    data = read_measurements(file_of(tmp_path, LINES, HEADING), nist())
    assert data.loop.tolist() == ["", "table", "strut 2", "spindle", "strut 3 alone"]
    assert data.tip.tolist() == [True, False, False, False, False] and len(data.of_tip) == 1
    # Under -X the strut got shorter: under X it would get longer.
    assert data.compliance == pytest.approx([1 / 4e7, 0.0, 12.5e-9, 5e-9, 25e-9], abs=1e-20)
    assert data.force[4] == 1000.0 and data.beside.length[4] == 2.5
    assert (data.stiffness > 0.0).all() and len(set(data.clamp)) == 5
    # Scatter as stated: 0.2 um under 1000 N; on the scale of the logarithm by the offset.
    relative = data.sd[1] / data.stiffness[1]
    assert relative == pytest.approx(0.2e-9 / data.beside.offset[1])
    assert any("3 readings of loops beside the tip" in note for note in data.notes)
    modelled = data.beside.alone(1.0 / model_stiffness(model_of([]), data))
    law = nist().strut_law
    assert modelled[1] == pytest.approx(0.0, abs=1e-18) and modelled[3] == pytest.approx(0.0, abs=1e-18)
    assert modelled[4] == pytest.approx(1.0 / law.stiffness(np.array(2.5)), rel=1e-12)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0,0,800,X,floor,,5,1000,,,", "loop 'floor'"),
        ("0,0,800,X,table,,,1000,,,", "loop table: no reading"),
        ("0,0,800,X,table,5e4,20,1000,,,", "loop table: no reading"),
        ("0,0,800,X,table,,5,,,,", "no reading; expected displacement_um with force_N"),
        ("0,0,800,X,table,,5,1000,,700,", "strut_force_N in a row of loop table"),
        ("0,0,800,X,strut 1 alone,,-20,1000,,,", "-20 nm/N"),
        (",,,X,strut 1,,-20,1000,,,", "x_mm"),
    ],
)
def test_bad_loop_rows_are_named(tmp_path, line, message):
    with pytest.raises((InputError, InputErrors), match=message.replace("(", "\\(")):
        read_measurements(file_of(tmp_path, [LINES[0], line], HEADING), nist())


def test_the_law_enters_loops_as_by_differences(tmp_path):
    """Columns of strut law and struts on loops against central differences of the model itself."""
    lines = [LINES[0], *(f"100,-50,900,X,{name},,{5 if 'alone' not in name else 25},1000,,," for name in NAMES[1:])]
    predictor = Predictor(nist(), read_measurements(file_of(tmp_path, lines, HEADING), nist()))
    base = predictor.log_stiffness()
    step = 1e-5
    for k in range(2):
        law = np.zeros(2)
        law[k] = step
        slope = (predictor.log_stiffness(law) - predictor.log_stiffness(-law)) / (2 * step)
        assert predictor.law_columns(base)[:, k] == pytest.approx(slope, abs=1e-7)
    part, slopes = predictor.strut_part_and_slopes()
    assert predictor.strut_columns().sum(axis=1) == pytest.approx(part * np.exp(base), rel=1e-12)
    assert -slopes.sum(axis=0) == pytest.approx(part, rel=1e-12)


# -- compare, diagnose, plan -------------------------------------------------------------------------------------------


def measured_again(case, file, loops, seed: int = 1):
    """Readings of loops on the rig's hidden machine, X, Y, Z at two poses, written to a file."""
    poses = ((0.0, 0.0, 800.0), (150.0, -100.0, 600.0))
    rows = [(*pose, d, loop, 1000.0) for loop in loops for d in "XYZ" for pose in poses]
    x, y, z, direction, loop, force = zip(*rows, strict=True)
    plan = {"x_mm": np.array(x), "y_mm": np.array(y), "z_mm": np.array(z), "direction": list(direction)}
    plan |= {"loop": list(loop), "force_N": np.array(force)}
    table = case.again(plan, np.random.default_rng(seed))
    file.write_text(csv_text(table))
    return str(file)


@pytest.fixture(scope="module")
def joints(tmp_path_factory):
    """The paper's layout on a machine whose joints give way, then indicators across a joint, a strut, the table."""
    folder = tmp_path_factory.mktemp("joints")
    case = draw_case(3, "paper", "joint_compliance", 0.02)
    (folder / "tip.csv").write_text(csv_text(case.rows))
    loops = measured_again(case, folder / "loops.csv", ["joint 1", "strut 1", "table"])
    return str(folder / "tip.csv"), loops


def test_what_the_tip_cannot_tell_an_indicator_names(joints):
    """A constant compliance in series with every strut is a strut law to the tip; across a joint it is nothing else."""
    alone = diagnose(nist(), read_measurements(joints[0], nist()))
    assert alone.verdict == "ambiguous" and {"none", "joint_compliance"} <= set(alone.plausible)
    found = diagnose(nist(), read_measurements(list(joints), nist()))
    assert (found.verdict, found.plausible) == ("identified", ["joint_compliance"])
    written = found.to_dict()
    # Errors are those of the tip's readings; the loops stand beside them.
    assert written["readings"] == 42 == len(found.as_given.residual)
    assert [one["loop"] for one in written["loops"]] == ["joint 1", "strut 1", "table"]
    assert all(abs(one["standard_deviations"]) < 4.0 for one in written["loops"])


def test_compare_shows_loops_in_a_section_of_their_own(joints):
    data = read_measurements(list(joints), nist())
    comparison = compare(nist(), data, draws=200)
    found = comparison.document
    alone = compare(nist(), read_measurements(joints[0], nist()), draws=200).document
    assert found["baseline"] == alone["baseline"] and alone["loops"] == []
    across = {one["loop"]: one for one in found["loops"]}
    assert across["joint 1"]["standard_deviations"] > 4.0 and abs(across["table"]["standard_deviations"]) < 4.0
    one = across["joint 1"]
    assert one["off_nm_per_N"] == pytest.approx(one["read_nm_per_N"] - one["model_nm_per_N"], abs=1e-6)
    assert "indicators beside the tip" in text(comparison)


def test_update_counts_errors_over_the_tip_as_compare_does(joints):
    data = read_measurements(list(joints), nist())
    compared, found = compare(nist(), data, draws=20).document, update(UpdateTask(nist(), data, strut_law=True))
    written = found.document
    assert written["readings"] == compared["readings"] == 42 < len(found.task.data)
    step, given = compared["baseline"], written["steps"][0]
    for name in ("mean_abs_error_percent", "bias_percent", "rms_percent"):
        assert given[name] == pytest.approx(step[name], abs=1e-3)
    assert sum(one["readings"] for one in given["by_direction"].values()) == 42
    assert found.provenance["mean_error_before_percent"] == pytest.approx(step["mean_abs_error_percent"], abs=1e-3)
    assert len(residuals_csv(found).splitlines()) == 1 + 42


def test_a_plan_sets_an_indicator_where_the_tip_tells_less():
    found = plan(
        nist(),
        between=("joint_compliance", "none"),
        n=3,
        noise=0.02,
        menu=Menu(setups=("table", "riser"), indicators=True),
    )
    loops = {found.choice.visits.loop[visit] for visit in found.choice.chosen}
    # A size that is known to half of itself keeps any gap near two.
    assert loops == {"joint 1"} and found.choice.pairs[0].separation_sigma > 2.0
    rows = found.rows
    assert {row["loop"] for row in rows} == {"", "joint 1"}
    assert [row["direction"] for row in rows if row["clamp"] == 1 and row["loop"]] == [
        row["direction"] for row in rows if row["clamp"] == 1 and not row["loop"]
    ]
    without = plan(nist(), between=("joint_compliance", "none"), n=3, noise=0.02)
    assert not any(without.choice.visits.loop[visit] for visit in without.choice.chosen)
    assert without.choice.pairs[0].separation_sigma < 0.7 * found.choice.pairs[0].separation_sigma
