"""`tps reduce`: records of made-up machines whose stiffness, play and friction are known."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stiffness.cases import nist
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.readings.loop_figures import reduce_loop
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.readings.raw_records import COLUMNS, read_raw
from toolpath_stiff.tables import parse_table

HEADING = "x_mm,y_mm,z_mm,direction,point,jog_um,force_N,displacement_um\n"
JOGS = (0.0, 100.0, 200.0, 100.0, 0.0, -100.0, -200.0, -100.0, 0.0)


def records(stiffness: float, gauge: float, gap: float = 0.0, friction: float = 0.0, where: str = "0,0,800,X,A") -> str:
    """Rows of a machine of that stiffness (N/um) jogged against a gauge (N/um).

    The jog y goes into the gauge, F / gauge, and into the machine: F / stiffness, a gap to each side, and friction,
    which holds the deflection back by half its width, but for the extremes where the machine was left to settle.
    """
    lines = []
    for i, jog in enumerate(JOGS):
        held = 0.0 if i == 0 or abs(jog) == 200.0 else friction / 2.0 * (1.0 if 2 < i < 6 else -1.0)
        force = (jog - (jog > 0.0) * gap + (jog < 0.0) * gap - held) / (1.0 / stiffness + 1.0 / gauge)
        lines.append(f"{where},{jog!r},{force!r},{force / gauge!r}")
    return "\n".join(lines) + "\n"


def reduced(text: str):
    (loop,) = read_raw(parse_table(HEADING + text, "raw.csv", COLUMNS))[0]
    return reduce_loop(loop)


@settings(max_examples=40, deadline=None)
@given(stiffness=st.floats(5.0, 500.0), gauge=st.floats(1.0, 500.0))
def test_the_gauges_own_compliance_cancels(stiffness, gauge):
    found = reduced(records(stiffness, gauge))
    assert found.stiffness == pytest.approx(stiffness * 1e6, rel=1e-9)
    assert found.force == pytest.approx(200.0 / (1.0 / stiffness + 1.0 / gauge), rel=1e-9)
    for nothing in (found.lost_motion, found.loop_width):
        assert abs(nothing) < 1e-12
    assert found.linearity < 1e-9


def test_equation_12_by_hand():
    """+200 um: 900 N and 170 um; -200 um: -850 N and -172 um. 1750 N over 400 - 342 = 58 um."""
    text = "".join(
        f"0,0,800,Y,A,{jog},{force},{moved}\n" for jog, force, moved in [(0, 0, 0), (200, 900, 170), (-200, -850, -172)]
    )
    found = reduced(text)
    assert found.stiffness == pytest.approx(1750.0 / 58e-6)
    assert [found.force, found.deflection] == pytest.approx([875.0, 58e-6])
    assert np.isnan(found.lost_motion)  # one record on each side gives no line


@settings(max_examples=30, deadline=None)
@given(gap=st.floats(0.1, 20.0), stiffness=st.floats(10.0, 200.0))
def test_play_is_lost_motion_and_softens_the_secant(gap, stiffness):
    found = reduced(records(stiffness, 50.0, gap=gap))
    assert found.lost_motion == pytest.approx(2.0 * gap * 1e-6, rel=1e-6)
    assert found.stiffness == pytest.approx(found.force / (found.force / (stiffness * 1e6) + gap * 1e-6), rel=1e-9)
    assert found.linearity > 0.0


def test_friction_is_the_width_of_the_loop_not_lost_motion():
    """Branches 6 um apart. The lines of the two sides go through both: their distance is a small part of that."""
    found = reduced(records(40.0, 40.0, friction=6.0))
    assert found.stiffness == pytest.approx(40e6, rel=1e-9)
    assert found.loop_width == pytest.approx(6e-6, rel=1e-9)
    assert abs(found.lost_motion) < 0.15 * found.loop_width


def test_loops_are_told_apart_and_come_in_order():
    text = records(40.0, 30.0, where="0,0,800,Z,B") + records(30.0, 30.0) + records(35.0, 30.0, where="0,0,800,Y,B")
    loops = read_raw(parse_table(HEADING + text, "raw.csv", COLUMNS))[0]
    assert [loop.place["direction"] + loop.place["point"] for loop in loops] == ["ZB", "XA", "YB"]
    assert [round(reduce_loop(loop).stiffness / 1e6, 6) for loop in loops] == [40.0, 30.0, 35.0]


@pytest.fixture
def raw(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text: str) -> str:
        Path("raw.csv").write_text(text, encoding="utf-8")
        return "raw.csv"

    return write


def test_the_command_writes_measurements_that_are_read_back(raw, capsys):
    file = raw(HEADING + records(45.0, 30.0, gap=2.0) + records(50.0, 30.0, where="100,0,800,Z,B"))
    assert main(["reduce", file]) == 0
    shown = capsys.readouterr().out
    assert "50000" in shown and "lost motion" in shown
    data = read_measurements("raw_measurements.csv", nist())
    assert data.stiffness[1] == pytest.approx(50e6, rel=1e-5)  # written to 0.1 N/mm
    assert list(data.point) == ["A", "B"] and "force_N" not in data.missing
    assert data.extra["lost_motion_um"] == pytest.approx([4.0, 0.0], abs=1e-3)
    assert Path("raw_measurements_loops.png").read_bytes().startswith(b"\x89PNG")


def test_the_same_raw_records_give_the_same_bytes(raw, capsys):
    file = raw(HEADING + records(45.0, 30.0))
    assert main(["reduce", file, "--out", "a.csv"]) == main(["reduce", file, "--out", "b.csv"]) == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()
    assert Path("a_loops.png").read_bytes() == Path("b_loops.png").read_bytes()


def test_json_without_plots(raw, capsys):
    text = HEADING + '0,0,800,X,"A, left",0,0,0\n0,0,800,X,"A, left",200,900,170\n0,0,800,X,"A, left",-200,-900,-170\n'
    assert main(["reduce", raw(text), "--json", "--no-plots", "--out", "sub/m.csv"]) == 0
    told = json.loads(capsys.readouterr().out)
    (loop,) = told["loops"]
    assert loop["stiffness_N_per_mm"] == pytest.approx(30000.0) and loop["lost_motion_um"] is None
    assert [str(p) for p in Path("sub").iterdir()] == ["sub/m.csv"] == told["files"]
    with Path("sub/m.csv").open(encoding="utf-8") as file:
        assert next(csv.DictReader(file))["point"] == "A, left"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        (HEADING, "no records"),
        (HEADING.replace("jog_um", "jog_steps") + "0,0,800,X,A,1,1,1\n", "column jog_um is missing"),
        (HEADING.replace(",jog_um", "") + "0,0,800,X,A,1,1\n", "column jog_um is missing"),
        (HEADING.replace(",direction", "") + "0,0,800,A,1,1,1\n", "column direction is missing"),
        (HEADING + "0,0,800,X,A,0,0\n", "raw.csv:2: row with 7 cells; expected 8"),
        (HEADING + "0,0,800,X,A,0,zero,0\n", "raw.csv:2: force_N = 'zero'"),
        (HEADING + "0,0,800,X,A,0,nan,0\n", "raw.csv:2: force_N = 'nan'"),
        (HEADING + "0,0,800,W,A,0,0,0\n", "raw.csv:2: direction 'W'"),
        (HEADING + "0,0,800,X,A,0,0,0\n0,0,800,X,A,200,900,170\n", "A, X: jogged from 0 to 200 um"),
        (HEADING + records(40.0, 30.0).replace(",-200.0,-", ",-200.0,9"), "force, jog"),
    ],
)
def test_wrong_records_end_in_one_message_and_no_file(raw, capsys, text, message):
    assert main(["reduce", raw(text)]) == 2
    told = capsys.readouterr().err
    assert message.lower() in told.lower() and "raw.csv" in told and "Traceback" not in told
    assert [p.name for p in Path().iterdir()] == ["raw.csv"]


def test_a_force_counted_the_other_way_is_named(raw, capsys):
    text = HEADING + "0,0,800,X,A,0,0,0\n0,0,800,X,A,200,-900,170\n0,0,800,X,A,-200,900,-170\n"
    assert main(["reduce", raw(text)]) == 2
    assert "count positive the same way" in capsys.readouterr().err


def test_the_raw_file_is_never_overwritten(raw, capsys):
    file = raw(HEADING + records(40.0, 30.0))
    before = Path(file).read_bytes()
    assert main(["reduce", file, "--out", file]) == 2
    assert Path(file).read_bytes() == before
    assert main(["reduce", "none.csv"]) == 2


def test_all_bad_loops_are_named():
    text = HEADING + "0,0,800,X,A,0,x,0\n0,0,800,Y,A,0,0,y\n"
    with pytest.raises(InputErrors) as caught:
        read_raw(parse_table(text, "raw.csv", COLUMNS))
    assert [error.line for error in caught.value.errors] == [2, 3]
    with pytest.raises(InputError):
        read_raw(parse_table("a\n", "raw.csv", COLUMNS))
