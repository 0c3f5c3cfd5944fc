"""Machines whose struts have one stiffness or a measured table, from the file to a fit, against the linear law."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.stiffness import reference
from tests.stiffness.test_kernels import tensors
from toolpath_stiff.analysis.machine_check import check_machine
from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.comparison.compare import compare
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.prediction import Predictor, scaled_law
from toolpath_stiff.machine.file import load_machine, packaged_machines, parse_machine
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.readings.measurements import Readings, read_measurements
from toolpath_stiff.report.compare import text as compare_text
from toolpath_stiff.report.machine import machine_figures
from toolpath_stiff.report.update import text as update_text
from toolpath_stiff.rig import campaigns, case, exercise
from toolpath_stiff.rig.hidden import HiddenMachine, readings
from toolpath_stiff.rig.nominal import parse_nominal
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import build_model, with_parameter_moved

NIST = packaged_machines()["nist"].read_text()
LAW = "length_mm = [2561.6, 3213.2]\nstiffness_N_per_um = [46.5, 32.5]"
AT = [2561.6, 2700.0, 2950.0, 3213.2]
ON_LINE = [46.5 + (at - 2561.6) * (32.5 - 46.5) / (3213.2 - 2561.6) for at in AT]
BENT = [46.5, 45.0, 36.0, 32.5]
SLOT = "%\nG21 G90 G1 F600\nX0 Y0 Z0\nX40 Y20\nX60 Y-30 Z-5\n%\n"


def text_with(law: str) -> str:
    assert LAW in NIST
    return NIST.replace(LAW, law)


def machine_with(law: str) -> Hexapod:
    return parse_machine(text_with(law), "mine.toml")


def table_text(stiffnesses) -> str:
    return f"length_mm = {AT}\nstiffness_N_per_um = {list(stiffnesses)}"


CONSTANT = "stiffness_N_per_um = 40.0"
CONSTANT_MACHINE = machine_with(CONSTANT)
EQUAL_ENDS = machine_with("length_mm = [2200.0, 3650.0]\nstiffness_N_per_um = [40.0, 40.0]")
LINEAR = load_machine("nist")
COLLINEAR = machine_with(table_text(ON_LINE))
TABLE = machine_with(table_text(BENT))
PAIRS = [(CONSTANT_MACHINE, EQUAL_ENDS), (COLLINEAR, LINEAR)]
NAMES = ["constant", "collinear"]


def poses(n: int):
    rng = np.random.default_rng(3)
    position = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), rng.uniform(0.2, 1.4, n)])
    return position, rotation_matrices(rng.uniform(-0.3, 0.3, (n, 3)))


# -- the law ---------------------------------------------------------------------------------------------------------


def test_a_table_is_linear_between_its_points_and_goes_on_outside():
    at = np.array(AT) / 1e3
    law, k = TABLE.strut_law, np.array(BENT) * 1e6
    np.testing.assert_allclose(law.stiffness(at), k, rtol=1e-14)
    inside = np.linspace(at[0], at[-1], 101).reshape(1, 101)
    np.testing.assert_allclose(law.stiffness(inside), np.interp(inside, at, k), rtol=1e-13)
    below, above = at[0] - 0.2, at[-1] + 0.2
    expected = [k[0] - 0.2 * (k[1] - k[0]) / (at[1] - at[0]), k[-1] + 0.2 * (k[-1] - k[-2]) / (at[-1] - at[-2])]
    np.testing.assert_allclose(law.stiffness(np.array([below, above])), expected, rtol=1e-13)
    assert np.isnan(law.stiffness(np.array([np.nan]))).all()
    assert (law.room(np.array([below, at[0], at[-1], above])) < 0.0).tolist() == [True, False, False, True]
    assert (CONSTANT_MACHINE.strut_law.room(np.array([0.1, 2.0, 9.0])) > 0.0).all()


@pytest.mark.parametrize("machine", [CONSTANT_MACHINE, LINEAR, COLLINEAR, TABLE])
def test_both_constants_make_up_the_law_also_after_scaling(machine):
    law, at = machine.strut_law, np.linspace(2.3, 3.5, 40)
    first, second = law.weights(at)
    np.testing.assert_allclose(law.stiffness_1 * first + law.stiffness_2 * second, law.stiffness(at), rtol=1e-13)
    both = scaled_law(law, (0.1, 0.1))
    np.testing.assert_allclose(both.stiffness(at), np.exp(0.1) * law.stiffness(at), rtol=1e-13)
    twice, once = scaled_law(scaled_law(law, (0.1, -0.2)), (0.05, 0.1)), scaled_law(law, (0.15, -0.1))
    np.testing.assert_allclose(twice.stiffness(at), once.stiffness(at), rtol=1e-13)


def test_a_collinear_table_scales_as_the_linear_law():
    at = np.linspace(2.3, 3.5, 40)
    one, two = (scaled_law(machine.strut_law, (0.2, -0.1)).stiffness(at) for machine in (COLLINEAR, LINEAR))
    np.testing.assert_allclose(one, two, rtol=1e-12)


# -- the stiffness at the tool ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("machine", "linear"), PAIRS, ids=NAMES)
@pytest.mark.parametrize("exact", [True, False])
def test_equal_laws_give_equal_tip_compliances(machine, linear, exact):
    position, rotation = poses(300)
    found, expected = (
        core.tip_compliance(build_model(one), position, rotation) if exact else tensors(one, position, rotation)[0]
        for one in (machine, linear)
    )
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_a_table_by_the_fast_routes_the_exact_one_and_the_assembled_truss():
    position, rotation = poses(300)
    model = build_model(TABLE)
    exact = core.tip_compliance(model, position, rotation)
    found, _ = tensors(TABLE, position, rotation)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-11 * np.abs(exact).max())
    stiff = TABLE.with_changes(platform_bar_stiffness=1e13)
    for i in range(3):
        assembled = reference.tip_compliance(stiff, position[i], rotation[i])
        np.testing.assert_allclose(assembled, exact[i], rtol=0, atol=1e-4 * np.abs(exact[i]).max())
    assert core.is_closed_form(model)
    assert np.abs(exact / core.tip_compliance(build_model(LINEAR), position, rotation) - 1.0).max() > 0.01


def numbers(document) -> list[float]:
    """All numbers of a document, in order."""
    if isinstance(document, dict):
        return [value for one in document.values() for value in numbers(one)]
    if isinstance(document, list | tuple):
        return [value for one in document for value in numbers(one)]
    return [float(document)] if isinstance(document, int | float) else []


@pytest.mark.parametrize(("machine", "linear"), PAIRS, ids=NAMES)
def test_analyze_pose_and_place_agree_with_the_linear_law(machine, linear, tmp_path):
    files, slot = [], tps.Program.from_text(SLOT)
    for i, one in enumerate((machine, linear)):
        files.append(tmp_path / f"{i}.toml")
        files[-1].write_text(machine_toml(one))

    def both(command):
        found = [numbers(command(str(file))) for file in files]
        assert len(found[0]) == len(found[1]) > 10
        return found

    np.testing.assert_allclose(*both(lambda file: tps.pose([50, -40, 800, 5, 3, 10], file).to_dict()), rtol=1e-8)
    np.testing.assert_allclose(*both(lambda file: tps.analyze(slot, file).to_dict()), rtol=1e-8)
    put = [
        tps.place(slot, file, x_mm=(-60, 60), y_mm=0, z_mm=(700, 800), rotate_deg=0, step_mm=20, points=3).to_dict()
        for file in files
    ]
    means = [one["chosen"]["mean_N_per_mm"] for one in put]
    assert means[0] == pytest.approx(means[1], rel=1e-3)  # a search amplifies the last digit


# -- files -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [CONSTANT, table_text(BENT), table_text(ON_LINE), LAW])
def test_written_as_read(law):
    machine = machine_with(law)
    written = machine_toml(machine)
    again = parse_machine(written)
    np.testing.assert_allclose(again.strut_law.points, machine.strut_law.points, rtol=1e-13)
    assert (again.strut_law.constant, len(again.strut_law.shape)) == (law == CONSTANT, law.count("2700.0") * len(AT))
    assert machine_toml(again) == written
    assert law in written or law == table_text(ON_LINE)


BROKEN = [
    (
        table_text([46.5, 45.0, -3.0, 32.5]),
        43,
        "stiffness_N_per_um = -3; expected a number or 2 or more numbers",
    ),
    ("stiffness_N_per_um = -40.0", 42, "stiffness_N_per_um = -40"),
    (f"length_mm = {AT}\nstiffness_N_per_um = [46.5, 40, 30]", 43, "3 stiffnesses, but 4 lengths; expected 4 numbers"),
    ("length_mm = [2600, 2500, 2700]\nstiffness_N_per_um = [46, 45, 44]", 42, "2500 comes after 2600"),
    ("length_mm = [2600, 2600, 2700]\nstiffness_N_per_um = [46, 45, 44]", 42, "lengths 0.001 mm apart or more"),
    ("length_mm = [2600]\nstiffness_N_per_um = [46]", 42, "expected 2 or more numbers in mm"),
    ("stiffness_N_per_um = [46, 45]", None, "length_mm is missing; expected a length for each stiffness"),
    (f"length_mm = {AT}\nstiffness_N_per_um = 46.0", 42, "4 lengths, but one stiffness; expected a stiffness for each"),
    ("length_mm = [2500, 3000, 3050]\nstiffness_N_per_um = [46, 45, 5]", 55, "on this side of 3056.2 mm, where the"),
]


@pytest.mark.parametrize(("law", "line", "words"), BROKEN, ids=[words[:24] for _, _, words in BROKEN])
def test_broken_laws_are_refused(law, line, words):
    with pytest.raises(InputError) as caught:
        machine_with(law)
    assert words in str(caught.value)
    assert str(caught.value).startswith("mine.toml:" + (f"{line}:" if line else ""))


def test_what_is_said_of_the_law():
    figures = {row[0]: row[1:3] for row in machine_figures(CONSTANT_MACHINE)}
    assert figures["strut stiffness"] == ("40", "N/um at every length")
    value, unit = {row[0]: row[1:3] for row in machine_figures(TABLE)}["strut stiffness"]
    assert value.startswith("46.5 N/um at 2561.6 mm, 45 N/um at 2700, ") and unit == "mm, linear between"
    run = parse_program(SLOT)
    said = [analyze(build_model(one), run).to_dict()["assumptions"] for one in (CONSTANT_MACHINE, TABLE)]
    assert any("the same at every length" in line for line in said[0])
    assert any("extrapolated outside 2561.6 to 3213.2 mm" in line for line in said[1])
    assert not check_machine(build_model(CONSTANT_MACHINE)).wrong
    soft = check_machine(build_model(machine_with("stiffness_N_per_um = 0.04"))).wrong
    assert len(soft) == 1 and "is it in kN/um?" in soft[0]


def test_a_parameter_of_a_constant_law():
    name = "strut_law.stiffness_N_per_um"
    uncertain = f'\n[uncertainty]\nparameters = ["{name}"]\nsd = [2.0]\ncorrelation = [[1.0]]\n'
    machine = parse_machine(text_with(CONSTANT) + uncertain)
    assert machine.uncertainty.names == (name,)
    assert set(machine.strut_law.moved(name, 1.0).stiffness(np.array([2.3, 3.5])).tolist()) == {41e6}
    assert with_parameter_moved(build_model(machine), name, 1.0).machine.strut_law.stiffness_1 == 41e6
    with pytest.raises(InputError, match=r"is not a parameter of this file; expected one of strut_law\.stiffness_1"):
        parse_machine(NIST + uncertain)


# -- readings --------------------------------------------------------------------------------------------------------


@cache
def campaign(law: str) -> tuple[str, Readings]:
    """The paper's poses on a rig machine of that law, as text and as read."""
    rows, _ = case.make_case(5, "paper", "none", 0.01, parse_nominal(text_with(law), "mine.toml"))
    text = exercise.csv_text(rows)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "measurements.csv"
        file.write_text(text)
        return text, read_measurements(str(file), machine_with(law))


@pytest.mark.parametrize("law", [CONSTANT, table_text(BENT)], ids=["constant", "table"])
def test_the_rig_reads_the_law_by_itself(law):
    """Readings of the nominal machine are those of the model: two programs that share no stiffness code."""
    machine, (data, nominal) = machine_with(law), (campaign(law)[1], parse_nominal(text_with(law), "mine.toml"))
    rows = case.rows_of(campaigns.paper_campaign())
    plain = readings(nominal, HiddenMachine(), rows)
    modelled = np.exp(Predictor(machine, data).log_stiffness())
    np.testing.assert_allclose(plain, modelled, rtol=1e-9)


@pytest.mark.parametrize("law", [CONSTANT, table_text(BENT)], ids=["constant", "table"])
def test_update_refits_the_law_in_its_own_form(law, tmp_path):
    """The file given to the update says 10 % more than the rig's machine has."""
    readings_file, mine, truth = tmp_path / "m.csv", tmp_path / "mine.toml", machine_with(law).strut_law
    readings_file.write_text(campaign(law)[0])
    mine.write_text(machine_toml(machine_with(law).with_changes(strut_law=scaled_law(truth, (0.1, 0.1)))))
    update = tps.update(readings_file, mine, strut_law=True)
    written = load_machine(update.save_machine(tmp_path / "new.toml"))
    found = written.strut_law
    assert (found.constant, len(found.shape)) == (truth.constant, len(truth.shape))
    at = np.linspace(2.4, 3.4, 20)
    assert np.abs(found.stiffness(at) / truth.stiffness(at) - 1.0).max() < 0.03  # struts of the rig differ by 1 %
    assert written.uncertainty.names == truth.parameters
    assert (written.uncertainty.sd < 2.0).all()
    ends = update.to_dict()["steps"][-1]["strut_law_N_per_um"]
    assert ends[0]["stiffness"] == pytest.approx(found.stiffness_1 / 1e6, rel=1e-4)
    if truth.constant:
        assert len(ends) == 1 and ends[0]["length_mm"] is None
    said = update_text(update)
    assert ("at every length" in said) == truth.constant
    assert ("at 2561.6 mm" in said) != truth.constant


@pytest.mark.parametrize("law", [CONSTANT, table_text(BENT)], ids=["constant", "table"])
def test_the_fit_has_the_right_slopes(law):
    machine, data = machine_with(law), campaign(law)[1]
    predictor, at, step = Predictor(machine, data), np.array([0.05, -0.03]), 1e-6
    columns = predictor.law_columns(predictor.log_stiffness(at), at)
    part, slopes = predictor.strut_part_and_slopes(at)
    np.testing.assert_allclose(part, np.exp(-predictor.log_stiffness(at)), rtol=1e-10)
    for k in range(2):
        moved = at + step * np.eye(2)[k]
        numeric = (predictor.log_stiffness(moved) - predictor.log_stiffness(at)) / step
        np.testing.assert_allclose(columns[:, k], numeric, atol=1e-5)
        np.testing.assert_allclose(-slopes[k] / part, numeric, atol=1e-5)


@pytest.mark.parametrize("law", [CONSTANT, table_text(BENT)], ids=["constant", "table"])
def test_compare_refits_the_law_too(law):
    found = compare(machine_with(law), campaign(law)[1], draws=50)
    figures = found.document["baseline"]["strut_law_refitted"]
    assert figures["mean_abs_error_percent"] < 2.0
    assert len(figures["N_per_um"]) == (1 if law == CONSTANT else 2)
    assert "strut law refitted " in compare_text(found)
