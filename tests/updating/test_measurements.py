"""Measurement files: what is read, what is pointed out, what is refused and how."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effects.cases import model_with, readings
from tests.stiffness.cases import nist, table_1_positions, table_1_stiffness
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.readings.measurements import model_stiffness, read_measurements
from toolpath_stiff.readings.raw_records import COLUMNS, read_raw
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects
from toolpath_stiff.tables import parse_table

SHORT = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n"
FULL = (
    "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,direction,stiffness_N_per_mm,force_N,sd_N_per_mm,setup,clamp,repeat,point,"
    "time_min,tool_extension_mm,loop,temperature_C\n"
)


@pytest.fixture
def write(tmp_path):
    def file(text: str, name: str = "data.csv") -> str:
        (tmp_path / name).write_text(text, encoding="utf-8")
        return str(tmp_path / name)

    return file


def test_table_1_is_the_papers_42_readings():
    data = read_measurements("nist-table1", nist())
    assert data.stiffness.reshape(14, 3) / 1e3 == pytest.approx(table_1_stiffness("measured"), rel=1e-12)
    assert data.position[::3] == pytest.approx(table_1_positions())
    assert len(set(data.point)) == 14 and len(set(data.clamp)) == 14
    assert set(data.setup[:21]) == {"riser"} and set(data.setup[21:]) == {"no riser"}
    assert "force_N" in data.missing and "setup" not in data.missing
    assert any("1000 N assumed" in note for note in data.notes)
    assert any("Figure 6" in note for note in data.notes)
    assert not data.warnings
    error = np.abs(model_stiffness(model_with(), data) / data.stiffness - 1.0)
    assert error.mean() == pytest.approx(0.0962, abs=5e-5)  # as the theory page derives from the printed table


def test_every_column_arrives_in_si(write):
    row = "100,-200,800,10,-15,20,y,40000,500,800,riser,3,2,A,90,150,tip,21.5\n"
    data = read_measurements(write(FULL + row), nist())
    assert data.position[0] == pytest.approx([0.1, -0.2, 0.8])
    assert data.angles[0] == pytest.approx(np.radians([10, -15, 20]))
    assert data.direction[0] == pytest.approx([0, 1, 0])
    assert [data.stiffness[0], data.force[0], data.sd[0]] == pytest.approx([4e7, 500.0, 8e5])
    assert [data.time[0], data.tool_extension[0], data.temperature[0]] == pytest.approx([5400.0, 0.15, 21.5])
    assert (data.setup[0], data.repeat[0], data.point[0], data.loop[0]) == ("riser", "2", "A", "")
    assert data.missing == ("loop",) and not data.notes  # the tip's own loop, as where nothing is said


def test_force_over_displacement_and_oblique_directions(write):
    text = "x_mm,y_mm,z_mm,dx,dy,dz,force_N,displacement_um\n0,0,800,3,0,4,900,30\n"
    data = read_measurements(write(text), nist())
    assert data.stiffness[0] == pytest.approx(900 / 30e-6)
    assert data.direction[0] == pytest.approx([0.6, 0.0, 0.8])
    assert data.force[0] == 900.0


def test_lines_that_say_nothing_are_passed_over(write):
    text = "\ufeff# made by hand\n\n" + SHORT + "0,0,800,X,40000\n\n# pause\n0,0,800,-Y,41000\n"
    data = read_measurements(write(text), nist())
    assert list(data.line) == [4, 7]
    assert data.direction[1] == pytest.approx([0, 1, 0])


def test_rows_of_one_clamping_belong_together(write):
    text = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,setup,clamp\n"
    text += "0,0,800,X,40000,riser,1\n0,0,800,Y,40000,riser,1\n0,0,800,X,40100,riser,2\n50,0,800,X,41000,,\n"
    data = read_measurements(write(text), nist())
    assert data.clamp[0] == data.clamp[1] and len(set(data.clamp)) == 3
    assert data.point[0] == data.point[1] == data.point[2] != data.point[3]
    assert "clamp" in data.missing and "setup" not in data.missing
    assert any("column clamp is empty in 1 of 4" in note for note in data.notes)


def test_clamp_numbers_start_anew_in_every_file(write):
    text = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,clamp\n0,0,800,X,{},1\n"
    data = read_measurements([write(text.format(40000), "a.csv"), write(text.format(40500), "b.csv")], nist())
    assert len(set(data.clamp)) == 2 and len(set(data.point)) == 1


def test_points_made_up_do_not_take_a_users_name(write):
    text = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,point\n0,0,800,X,40000,\n50,0,800,X,40000,P1\n"
    assert len(set(read_measurements(write(text), nist()).point)) == 2


def test_numeric_columns_of_the_users_own_are_kept(write):
    text = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,humidity,operator\n0,0,800,X,40000,45,Ann\n"
    data = read_measurements(write(text), nist())
    assert data.extra["humidity"] == pytest.approx([45.0])
    assert any("operator" in note for note in data.notes)


def test_what_these_data_cannot_test(write):
    data = read_measurements(write(SHORT + "0,0,800,X,40000\n"), nist())
    lacking = data.cannot_test(known_effects().values())
    assert lacking == {
        "joint_clearance": ("force_N",),
        "contact_nonlinearity": ("force_N",),
        "setup_compliance": ("setup",),
        "thermal_drift": ("time_min",),
        "load_cell_curvature": ("force_N",),
        "tool_bending": ("tool_extension_mm",),
    }


def test_a_plan_is_filled_in_before_it_is_read(write):
    with pytest.raises(InputErrors, match="no stiffness"):
        read_measurements(write(SHORT + "0,0,800,X,\n"), nist())


def test_a_pose_beyond_an_assumed_limit_is_a_warning(write):
    data = read_measurements(write(SHORT + "800,0,800,X,40000\n"), nist())
    assert len(data) == 1
    assert "workspace x max, assumed" in data.warnings[0] and "(800, 0, 800) mm" in data.warnings[0]


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        # Struts of over 4.7 m: the linear law has come down to nothing.
        ("0,0,-1500,0,0,0", "is impossible: strut 2 would have no stiffness left"),
        # Yawing the platform on the axis, |det J| vanishes at this angle (found by bisection).
        ("0,0,800,0,0,75.80369735175395", "at (0, 0, 75.8) deg is singular"),
    ],
)
def test_poses_that_cannot_be(write, pose, message):
    heading = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,direction,stiffness_N_per_mm\n"
    with pytest.raises(InputErrors, match=r"data\.csv:2: ") as caught:
        read_measurements(write(f"{heading}{pose},X,40000\n"), nist())
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0,0,800,X,-40000", "stiffness_N_per_mm = -40000; expected 100 to 1e+07"),
        ("0,0,800,X,40", "is the unit right?"),
        ("0,0,800,X,4e10", "is the unit right?"),
        ("0,0,800,X,nan", "stiffness_N_per_mm = 'nan'; expected a finite number"),
        ("0,0,800,X,inf", "expected a finite number"),
        ("0,0,800,X,stiff", "stiffness_N_per_mm = 'stiff'"),
        ("0,0,800,X,", "no stiffness"),
        ("0,0,800,W,40000", "direction 'W'; expected X, Y or Z"),
        ("0,0,800,,40000", "direction ''"),
        ("0,0,800,X", "row with 4 cells; expected 5"),
        ("0,0,800,X,40000,1", "row with 6 cells"),
        (",0,800,X,40000", "x_mm = ''"),
        ("0,0,1e9,X,40000", "z_mm = 1e9; expected -100000 to 100000; is the unit right?"),
        ("0,0,700,X,39000", "row repeats line 2. Number repeated readings"),
    ],
)
def test_a_bad_row_is_named(write, row, message):
    with pytest.raises(InputErrors, match=r"data\.csv:3: ") as caught:
        read_measurements(write(f"{SHORT}0,0,700,X,39000\n{row}\n"), nist())
    assert message in str(caught.value) and len(caught.value.errors) == 1


def test_all_bad_rows_are_named_none_dropped(write):
    files = [
        write(SHORT + "0,0,800,X,-1\n0,0,800,Y,40000\n0,0,800,Q,40000\n", "a.csv"),
        write(SHORT + "0,0,800,X,nan\n", "b.csv"),
    ]
    with pytest.raises(InputErrors) as caught:
        read_measurements(files, nist())
    lines = [(str(e.file)[-5:], e.line) for e in caught.value.errors]
    assert lines == [("a.csv", 2), ("a.csv", 4), ("b.csv", 2)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        (SHORT + '"' + "0" * 200_000, "not a CSV file"),
        (SHORT, "no rows below the heading"),
        ("x_mm,y_mm,z_mm,direction\n0,0,800,X\n", "column stiffness_N_per_mm is missing"),
        ("x_mm,y_mm,direction,stiffness_N_per_mm\n0,0,X,40000\n", "column z_mm is missing"),
        ("x_mm,y_mm,z_mm,stiffness_N_per_mm\n0,0,800,40000\n", "column direction is missing"),
        ("x_mm,y_mm,z_mm,dx,dy,stiffness_N_per_mm\n0,0,800,1,0,40000\n", "column dz is missing"),
        ("x_mm,y_mm,z_mm,a_deg,direction,stiffness_N_per_mm\n0,0,800,1,X,40000\n", "column b_deg is missing"),
        ("x_mm,y_mm,z_mm,direction,stifness_N_per_mm\n0,0,800,X,4\n", "Did you mean stiffness_N_per_mm?"),
        ("x_mm,y_mm,z_mm,direction,stiffness_N_per_um\n0,0,800,X,4\n", "Did you mean stiffness_N_per_mm?"),
        ("x_mm,x_mm,z_mm,direction,stiffness_N_per_mm\n0,0,800,X,4\n", "column x_mm stands twice"),
        ("x_mm,y_mm,z_mm,,direction,stiffness_N_per_mm\n0,0,800,,X,4e4\n", "a column without a name"),
    ],
)
def test_a_wrong_heading_is_one_error(write, text, message):
    with pytest.raises(InputError) as caught:
        read_measurements(write(text), nist())
    assert message in str(caught.value) and "data.csv" in str(caught.value)


def test_stiffness_must_agree_with_force_over_displacement(write):
    text = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,force_N,displacement_um\n0,0,800,X,40000,1000,{}\n"
    assert read_measurements(write(text.format(25)), nist()).stiffness[0] == 4e7
    with pytest.raises(InputErrors, match="force over displacement, is"):
        read_measurements(write(text.format(0.025)), nist())


def test_repeats(write):
    heading = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,repeat\n"
    good = heading + "0,0,800,X,40000,1\n0,0,800,X,40000,2\n"
    assert list(read_measurements(write(good), nist()).repeat) == ["1", "2"]
    with pytest.raises(InputErrors, match="row repeats line 2"):
        read_measurements(write(heading + "0,0,800,X,40000,1\n0,0,800,X,40100,1\n"), nist())


def test_the_same_readings_in_two_files(write):
    row = SHORT + "0,0,800,X,40000\n"
    first, second = write(row, "a.csv"), write(row, "b.csv")
    with pytest.raises(InputErrors, match=r"row repeats line 2 of .*a\.csv"):
        read_measurements([first, second], nist())
    with pytest.raises(InputError, match="given twice"):
        read_measurements([first, first], nist())
    with pytest.raises(InputError, match="cannot read measurements"):
        read_measurements(first + "x", nist())


@settings(max_examples=30, deadline=None)
@given(
    x=st.floats(-300, 300),
    k=st.floats(1e3, 1e6),
    force=st.floats(10, 1e5),
    direction=st.sampled_from("XYZxyz"),
)
def test_what_is_written_is_read(tmp_path_factory, x, k, force, direction):
    file = tmp_path_factory.mktemp("m") / "d.csv"
    file.write_text(f"x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,force_N\n{x!r},0,800,{direction},{k!r},{force!r}\n")
    data = read_measurements(file, nist())
    assert data.position[0, 0] == pytest.approx(x / 1e3, rel=1e-12, abs=1e-300)
    assert [data.stiffness[0], data.force[0]] == pytest.approx([k * 1e3, force], rel=1e-12)
    assert data.direction[0] @ [1, 2, 3] == {"x": 1, "y": 2, "z": 3}[direction.lower()]


def test_the_model_answers_row_by_row(write):
    """Load size, set-up, time and tool length of each row reach the effects: against one call for each row."""
    text = "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm,force_N,setup,time_min,tool_extension_mm\n"
    text += "0,0,800,X,40000,500,riser,1,0\n0,0,800,X,41000,4000,riser,1,0\n0,0,800,Z,90000,500,bare,60,150\n"
    data = read_measurements(write(text), nist())
    clearance = model_stiffness(model_with("joint_clearance", lost_motion=2e-6), data)
    assert clearance[0] < 0.95 * clearance[1]
    one = readings(model_with("joint_clearance", lost_motion=2e-6), data.position[:1], data.direction[:1], force=500.0)
    assert clearance[0] == pytest.approx(one[0], rel=1e-12)
    riser = model_stiffness(model_with("setup_compliance", x=5e-9, z=5e-9), data)
    plain = model_stiffness(model_with(), data)
    assert 1.0 / riser - 1.0 / plain == pytest.approx([5e-9, 5e-9, 0.0], abs=1e-18)
    drift = model_stiffness(model_with("thermal_drift", rate=1e-6 / 3600.0), data)  # 1 um an hour
    assert data.force / drift - data.force / plain == pytest.approx([1e-6 / 60, 1e-6 / 60, 1e-6], rel=1e-6)
    longer = model_stiffness(model_with("tool_length_error", error=0.0), data.select(np.array([2])))
    assert longer[0] == pytest.approx(plain[2], rel=1e-12)


def test_effects_whose_column_is_missing_do_nothing(write):
    data = read_measurements(write(SHORT + "0,0,800,X,40000\n"), nist())
    assert find_effect("thermal_drift").needs == ("time_min",)
    plain = model_stiffness(model_with(), data)
    for name, values in (("thermal_drift", {"rate": 1e-6}), ("setup_compliance", {"x": 1e-8})):
        assert np.array_equal(model_stiffness(model_with(name, **values), data), plain)


def test_the_walk_through_of_the_documentation_works():
    page = (Path(__file__).parents[2] / "docs" / "measurements.md").read_text("utf-8")
    code = page.split("```python\n")[1].split("```")[0]
    told: dict[str, np.ndarray] = {}
    exec(code, told)
    assert f"{100 * np.abs(told['error']).mean():.2f} %" in code


CELLS = st.sampled_from(
    ["0", "800", "-1", "1e400", "nan", "", "X", '"', "#", "\x00", "40000", "\ufeff", "4,5", "ä", "1_0"]
)


@settings(max_examples=150, deadline=None)
@given(rows=st.lists(st.lists(CELLS, min_size=4, max_size=6), max_size=4), long=st.booleans())
def test_whatever_stands_in_a_file_is_read_or_refused(tmp_path_factory, rows, long):
    """Nothing but an input error, with its file, comes out of a broken file."""
    heading = SHORT if long else "x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um\n"
    text = heading + "\n".join(",".join(row) for row in rows)
    file = tmp_path_factory.mktemp("m") / "data.csv"
    file.write_text(text, encoding="utf-8")
    try:
        if long:
            assert len(read_measurements(file, nist())) >= 1
        else:
            assert len(read_raw(parse_table(text, "data.csv", COLUMNS))[0]) >= 1
    except (InputError, InputErrors) as error:
        assert "data.csv" in str(error)
