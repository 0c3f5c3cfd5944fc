"""What the reader understands, against hand-computed moves, and laws over spelling, units and modes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolpath_stiff.nc.controller import ALL_SWITCHES, Controller
from toolpath_stiff.nc.moves import MOTION_NAMES
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.tables import read_offsets


def moves_of(text: str, **options):
    return parse_program(text, "part.nc", **options).moves


def ends_mm(text: str, **options) -> list[list[float]]:
    return [[round(v, 9) + 0.0 for v in 1e3 * end[:3]] for end in moves_of(text, **options).end]


def test_lines_and_their_columns_of_data():
    moves = moves_of("T3 M6\nG0 X10 Y-5\nG1 F600 Z-2\nX20\n")
    assert [MOTION_NAMES[m] for m in moves.motion] == ["rapid", "feed", "feed"]
    assert moves.line.tolist() == [2, 3, 4]
    np.testing.assert_allclose(moves.end[:, :3] * 1e3, [[10, -5, 0], [10, -5, -2], [20, -5, -2]])
    np.testing.assert_allclose(moves.feed[1:], 0.01)  # 600 mm/min
    assert np.isnan(moves.feed[0]) and (moves.tool == 3).all() and np.isnan(moves.tool_length).all()


number = st.decimals(-900, 900, places=3, allow_nan=False, allow_infinity=False)


@given(number, number, st.sampled_from(["{x}", "+{x}", "{x}0", "{x}e0", "0{x}"]), st.booleans(), st.data())
def test_spelling_does_not_matter(x, y, form, lower, data):
    def spell(value) -> str:
        text = f"{abs(value)}"
        sign = "-" if value < 0 else "+" if form.startswith("+") else ""
        return sign + form.removeprefix("+").format(x=text)

    blank = data.draw(st.sampled_from(["", " ", "\t", "  "]))
    comment = data.draw(st.sampled_from(["", " (a comment) ", " (one) (two) ; three", " ; to the end (with this"]))
    prefix = data.draw(st.sampled_from(["", "N10 ", "n0005", "/ ", "/N3"])) if blank else ""
    text = f"{prefix}G01{blank}X{blank}{spell(x)}{blank}Y{spell(y)}{blank}F100{comment}"
    text = (text.lower() if lower else text) + data.draw(st.sampled_from(["\n", "\r\n", "\r"])) + "G1 Z1"
    plain = moves_of(f"G1 X{x} Y{y} F100\nG1 Z1")
    np.testing.assert_array_equal(moves_of(text).end, plain.end)


@given(st.lists(st.tuples(number, number), min_size=1, max_size=6))
def test_incremental_is_absolute(points):
    absolute = "G90 G1 F100\n" + "".join(f"X{x} Y{y}\n" for x, y in points) + "Z1"
    last, steps = (0, 0), []
    for x, y in points:
        steps.append(f"X{x - last[0]} Y{y - last[1]}\n")
        last = (x, y)
    incremental = "G91 G1 F100\n" + "".join(steps) + "Z1"
    # Sums of decimal steps: a unit in the last place of 1 m each.
    np.testing.assert_allclose(moves_of(incremental).end, moves_of(absolute).end, atol=1e-14)


@given(number, number)
def test_inch_is_25_4_mm(x, y):
    inch = moves_of(f"G20 G1 X{x} Y{y} Z1 F10")
    metric = moves_of(f"G21 G1 X{float(x) * 25.4!r} Y{float(y) * 25.4!r} Z25.4 F254")
    np.testing.assert_allclose(inch.end, metric.end, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(inch.feed, metric.feed)


def test_encodings_and_line_ends(tmp_path):
    expected = moves_of("G1 F100 X1\nX2\n").end
    for name, content in {
        "utf8": "(Fräser Ø6)\nG1 F100 X1\nX2\n".encode(),
        "bom": "\ufeffG1 F100 X1\nX2\n".encode(),
        "latin1": "(Fräser Ø6)\nG1 F100 X1\nX2".encode("latin-1"),
        "crlf": b"%\r\nO1234 (part)\r\nG1 F100 X1\r\nX2\r\nM30\r\n%\r\n",
        "cr": b"G1 F100 X1\rX2\r",
    }.items():
        path = tmp_path / f"{name}.nc"
        path.write_bytes(content)
        np.testing.assert_array_equal(read_program(path).moves.end, expected)


def test_block_delete():
    text = "G1 F100 X1\n/X2\n/1 X3\nX4\n"
    assert len(moves_of(text)) == 4
    assert ends_mm(text, controller=Controller(switches=ALL_SWITCHES)) == [[1, 0, 0], [4, 0, 0]]


def test_radius_arcs_take_the_short_and_the_long_way():
    for word, sweep in (("R10", np.pi / 2), ("R-10", 3 * np.pi / 2)):
        moves = moves_of(f"F100 G0 X10\nG3 X0 Y10 {word}")
        assert moves.arc_sweep[-1] == pytest.approx(sweep, abs=1e-9)
    short = moves_of("F100 G0 X10\nG3 X0 Y10 R10")
    np.testing.assert_allclose(short.arc_center[-1], 0.0, atol=1e-12)


def test_helix_full_circle_and_turns():
    moves = moves_of("F100 G0 X10\nG3 I-10 Z-3 P2\nG17 G2 I-10")
    assert moves.arc_sweep[1:].tolist() == pytest.approx([4 * np.pi, -2 * np.pi])
    assert moves.end[1, 2] == pytest.approx(-0.003)


def test_absolute_centres():
    moves = moves_of("F100 G0 X10 Y5\nG90.1 G3 X0 Y15 I0 J5")
    np.testing.assert_allclose(moves.arc_center[-1], [0, 0.005, 0], atol=1e-15)
    assert moves.arc_sweep[-1] == pytest.approx(np.pi / 2)


def test_work_offsets_are_relative_to_g54():
    text = "G10 L2 P2 X100 Y0 Z5\nG1 F100 X1\nG55 X1\n"
    program = parse_program(text, default_origin=(0, 0, 0.8, 0, 0, 0))
    assert program.origin_source == "default" and program.origin[2] == pytest.approx(0.8)
    assert ends_mm(text) == [[1, 0, 0], [101, 0, 0]]


def test_g10_of_g54_is_the_origin_unless_the_option_says_otherwise():
    text = "G10 L2 P1 X10 Y20 Z30\nG10 L2 P2 X110 Y20 Z30\nG1 F100 X1\nG55 X1\n"
    program = parse_program(text)
    assert program.origin_source == "program" and program.origin[:3] == pytest.approx((0.01, 0.02, 0.03))
    assert program.moves.end[-1, 0] == pytest.approx(0.101)  # the set-up frame: 100 mm from G54
    other = parse_program(text, origin=(0, 0, 0.5, 0, 0, 0))
    assert other.origin_source == "option" and "overrides" in str(other.warnings[0])
    np.testing.assert_allclose(other.moves.end, program.moves.end, atol=1e-15)


def test_machine_coordinates_stay_when_the_work_moves():
    text = "G1 F100 X1 Y2 Z3\nG53 G0 Z900\n"
    for origin in ((0.1, 0.2, 0.8, 0, 0, 0), (0.3, -0.1, 0.7, 0.1, 0.2, 0.5)):
        program = parse_program(text, origin=origin)
        from toolpath_stiff.path.placing import place

        moves = place(program.moves, origin)
        assert moves.end[-1, 2] == pytest.approx(0.9)
        np.testing.assert_allclose(moves.end[-1, :2], moves.end[-2, :2], atol=1e-12)
        assert moves.from_machine.tolist() == [[False, False], [False, True]]


def test_tool_length_and_offsets_file(tmp_path):
    table = tmp_path / "tools.csv"
    table.write_text("tool,length_mm,diameter_mm,remark\n5,120.5,6,end mill\n")
    offsets = tmp_path / "offsets.toml"
    offsets.write_text("# fixture\nG55 = [100, 0, 0]\nG54 = [1, 2, 3]\n")
    program = tmp_path / "part.nc"
    program.write_text("T5 M6\nG43 H5\nG0 X0 Y0 Z10\nG1 F100 Z1\nG49\nG55 G1 X0 Y0 Z1\n")
    read = read_program(program, tool_table=table, controller=Controller(offsets=read_offsets(offsets)))
    np.testing.assert_allclose(read.moves.tool_length[:2], 0.1205)
    assert np.isnan(read.moves.tool_length[-1])
    assert read.origin[:3] == pytest.approx((0.001, 0.002, 0.003))
    assert read.moves.end[-1, 0] == pytest.approx(0.099)
    assert [(t.number, t.remark) for t in read.tools] == [(5, "end mill")]


def test_drilling_expands_to_its_moves():
    moves = moves_of("F100 G0 Z20\nG99 G83 X5 Y5 Z-5 R2 Q3\nX10\nG80")
    first = moves.take(moves.line == 2)
    heights = (first.end[:, 2] * 1e3).round(6).tolist()
    assert heights == [20, 2, -1, 2, -0.746, -4, 2, -3.746, -5, 2]
    assert [MOTION_NAMES[m] for m in first.motion] == [
        "rapid", "rapid", "cycle", "rapid", "rapid", "cycle", "rapid", "rapid", "cycle", "rapid",
    ]  # fmt: skip


def test_dwell_inverse_time_and_feed_per_revolution():
    moves = moves_of("G1 F600 X60\nG4 P2.5\nG93 G1 X0 F2\nG95 S1000 F0.1 G1 X10\nG94 F90 G1 A45")
    assert moves.dwell[0] == 2.5
    assert moves.feed[1] == pytest.approx(0.06 * 2 / 60)
    assert moves.feed[2] == pytest.approx(1000 * 0.1 / 60e3)
    assert moves.feed[3] == pytest.approx(np.deg2rad(90) / 60)


def test_harmless_words_are_listed_not_dropped():
    program = parse_program("M8\nG64 P0.01\nS500 M3\nG1 F100 X1\nM9\nM123 P5\nM30\nG1 X5\n")
    assert [(u.line, u.word) for u in program.unsupported] == [
        (1, "M8"), (2, "G64"), (5, "M9"), (6, "M123"), (6, "P5"),
    ]  # fmt: skip
    assert any("not part of the program" in w for w in map(str, program.warnings))
    assert any("M123" in w for w in map(str, program.warnings))
    assert not any("M8" in w for w in map(str, program.warnings))


def test_an_unknown_reference_point_is_an_assumption():
    assert any("G28" in a for a in parse_program("G1 F100 X1\nG28\nG28 Z5\n").assumptions)
    assert not any("G28" in a for a in parse_program("G1 F100 X1\nG28.1\nX2\nG28\n").assumptions)


def test_program_end_and_tape_marks():
    assert len(moves_of("%\nG1 F100 X1\nM2\nX2\n%\n")) == 1
    assert len(moves_of("%\nG1 F100 X1\n%\nX2\n")) == 1
