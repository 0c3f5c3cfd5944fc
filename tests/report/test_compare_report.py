"""Comparison as pictures, page, table and command: all of it for any data, nothing from a file runs."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.image import imread

from tests.stiffness.cases import nist
from tests.updating.cases import campaign, readings_by_hand, table_1
from toolpath_stiff.cli.main import main
from toolpath_stiff.comparison.compare import Comparison, compare
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.report.compare import page as compare_html
from toolpath_stiff.report.compare import residuals_csv
from toolpath_stiff.report.compare import text as terminal_text
from toolpath_stiff.report.pictures.compare import PICTURES
from toolpath_stiff.report.pictures.files import SHARP, picture_file

NASTY = '<script>alert("1")</script>$x^2$'


def quick(data: Readings) -> Comparison:
    return compare(nist(), data, draws=100)


def one_reading() -> Readings:
    return readings_by_hand([55e6], position=(0.0, 0.0, 1.0))


def oblique() -> Readings:
    """Directions that are no axis, poses all alike, names that would like to be code."""
    direction = np.random.default_rng(0).normal(size=(9, 3))
    return readings_by_hand(
        np.linspace(4e7, 6e7, 9), (0.0, 0.0, 1.0), direction, setup=[NASTY] * 4 + [""] * 5, point=[NASTY] * 9
    )


def with_a_wild_reading() -> Readings:
    data = campaign(60, layout="paper")[0]
    return replace(data, stiffness=np.where(np.arange(len(data)) == 10, 3.0 * data.stiffness, data.stiffness))


DATA = {"paper": table_1, "one": one_reading, "oblique": oblique, "wild": with_a_wild_reading}


@cache
def compared(name: str) -> tuple[Comparison, dict[str, bytes]]:
    """The comparison and its pictures; of the paper's readings with the draws that the command takes."""
    found = compare(nist(), table_1()) if name == "paper" else quick(DATA[name]())
    drawn = {name: picture_file(name, draw, found, SHARP) for name, draw in PICTURES.items()}
    return found, {name: picture for name, picture in drawn.items() if picture}


@pytest.mark.parametrize("name", DATA)
def test_pictures_and_page_for_any_data(name):
    found, pictures = compared(name)
    assert set(PICTURES) == set(pictures)
    for picture in pictures.values():
        height, width = imread(io.BytesIO(picture), format="png").shape[:2]
        assert 1000 <= width <= 2500
        assert height >= 200
    page = compare_html(found, pictures)
    assert page.count("<script") == 1  # the one that saves pictures: nothing of the data runs
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    assert page.count("<img ") == len(pictures)
    assert "{{" not in page


def test_the_page_says_what_the_figures_are():
    found, _ = compared("paper")
    page = compare_html(found, {})
    assert "9.62 %" in page
    assert "No pattern stands out from scatter" in page
    for title in ("Checks without a model", "Errors by direction, plane and set-up", "How much readings scatter"):
        assert title in page
    assert "no pose was measured at two loads" in page


def test_residuals_as_a_table_say_what_they_are():
    data = table_1()
    found, _ = compared("paper")
    rows = list(csv.DictReader(io.StringIO(residuals_csv(found))))
    assert len(rows) == len(data)
    for row, stiffness, residual in zip(rows, data.stiffness, found.residual, strict=True):
        measured, modelled = float(row["measured_N_per_mm"]), float(row["modelled_N_per_mm"])
        assert measured == pytest.approx(stiffness / 1e3, rel=1e-5)
        # Minus: softer than modelled.
        assert float(row["deviation_percent"]) == pytest.approx(100.0 * (measured / modelled - 1.0), abs=0.01)
        assert float(row["deviation_percent"]) == pytest.approx(100.0 * np.expm1(residual), abs=0.01)
        shares = [float(row[f"share_of_strut_{i}_percent"]) for i in range(1, 7)]
        assert sum(shares) == pytest.approx(100.0, abs=0.01)
    assert {"radius_mm", "mean_strut_length_mm", "deflection_um", "model_stiffness_N_per_mm"} <= rows[0].keys()


def test_terminal_steers_nothing_and_names_a_wild_reading():
    text = terminal_text(compared("wild")[0])
    assert "readings far off" in text
    assert "+2" in text.split("readings far off")[1]
    data = replace(oblique(), setup=np.array(["\x1b[31mred"] * 9))
    assert "\x1b" not in terminal_text(quick(data))


def test_the_command_writes_everything_and_the_same_bytes_again(tmp_path, capsys):
    out = tmp_path / "here"
    assert main(["compare", "nist-table1", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "as given 9.62 %" in said
    names = {"compare.json", "residuals.csv", "report.html", *compared("paper")[1]}
    assert {file.name for file in out.glob("[!.]*")} == names
    for name, picture in compared("paper")[1].items():
        assert (out / name).read_bytes() == picture, name
    document = json.loads((out / "compare.json").read_text())
    assert {"baseline", "by_direction", "by_setup", "findings"} <= document.keys()
    # Again without pictures: those of the first run do not stay beside figures that they do not belong to.
    assert main(["compare", "nist-table1", "--out", str(out), "--no-plots", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == document
    assert {file.name for file in out.glob("[!.]*")} == {"compare.json", "residuals.csv"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["no_such_file.csv"], "no_such_file.csv"),
        (["nist-table1", "--machine", "no-such-machine"], "no-such-machine"),
        (["nist-table1", "--noise", "-3"], "noise"),
        (["nist-table1", "--seed", "-1"], "seed -1"),
    ],
)
def test_errors_are_one_line_and_write_nothing(arguments, said, tmp_path, capsys):
    out = tmp_path / "out"
    try:
        code = main(["compare", *arguments, "--out", str(out)])
    except SystemExit as stop:
        code = stop.code
    assert code == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error
    assert not out.exists()


def test_a_bad_row_is_named_by_its_line(tmp_path, capsys):
    file = tmp_path / "bad.csv"
    file.write_text("x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n0,0,900,X,50000\n0,0,900,Y,-5\n")
    assert main(["compare", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "bad.csv:3" in capsys.readouterr().err


def test_a_machine_with_effects_shows_them_in_the_load_path():
    entries = (
        EffectEntry(
            "table_compliance",
            {"x_nm_per_N": 5.0, "y_nm_per_N": 4.0, "z_nm_per_N": 3.0, "rocking_nrad_per_N_per_m": 0.0},
        ),
        EffectEntry("spindle_compliance", {"radial_nm_per_N": 8.0, "axial_nm_per_N": 2.0}),
    )
    found = compare(load_machine("nist").with_changes(effects=entries), table_1(), draws=100)
    assert tuple(found.shares)[:6] == tuple(f"strut {i}" for i in range(1, 7))
    assert len(found.shares) == 8
    # The table is 5, 4, 3 nm/N soft along X, Y, Z whatever the pose, the upright spindle 8, 8, 2.
    assert np.array([*found.shares.values()]).T[:, 6:] * 1e9 == pytest.approx(
        np.array([[5.0, 8.0], [4.0, 8.0], [3.0, 2.0]])
    )
