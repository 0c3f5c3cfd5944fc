"""Single kinds of blocks, rewritten: what is written, what is refused and why; random programs keep their path."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import TABLE_RS274, TOOLS, Writer, cycle_program
from tests.nc.test_nc_against_rs274 import assert_same_path as assert_linuxcnc_agrees
from tests.placement.rewriting import assert_same_path, cutting_moves
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import ALL_SWITCHES, Controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import Offsets, ToolEntry, WorkOffset
from toolpath_stiff.rewriting.program import rewrite_program

HERE = (0.0,) * 6
TOOL_TABLE = {number: ToolEntry(number, length, 6.0) for number, length in TOOLS.items()}


def at(x=0.0, y=0.0, z=0.0, turn=0.0, a=0.0, b=0.0):
    """A placement in mm and degrees."""
    return (x * 1e-3, y * 1e-3, z * 1e-3, math.radians(a), math.radians(b), math.radians(turn))


def rewrite(text: str, there, origin=HERE, **options):
    """Rewrite, assert that the path is the placed one, return the lines."""
    tools = options.pop("tools", None)
    program = parse_program(text, origin=there, controller=Controller(tools=tools))
    rewritten = rewrite_program(program, there, origin, control=Controller(tools=tools), **options)
    again = parse_program(rewritten.text, origin=origin, controller=Controller(tools=tools))
    if options.get("linearise") is None:
        unit = 10.0 ** -(options.get("decimals") or 4) * (25.4 if "G20" in text else 1.0)
        assert_same_path(program, there, again, origin, unit)
    return rewritten.text.splitlines()


START = "G21 G90 F500\nG0 X0 Y0 Z0\n"


def body(text: str, there, **options) -> list[str]:
    """The lines after START."""
    return rewrite(START + text, there, **options)[2:]


QUARTER = at(10, 20, 30, 90)


@pytest.mark.parametrize(
    ("text", "there", "written"),
    [
        # Only what moves is written; a turn couples X and Y, and X comes before Y.
        ("G1 X5", at(10), ["G1 X15"]),
        ("G1 X5", at(0, 10), ["G1 X5"]),
        ("G1 X5", QUARTER, ["G1 X10 Y25"]),
        ("G1 Y5 F100", QUARTER, ["G1 X5 Y20 F100"]),
        ("G1X5.F100", QUARTER, ["G1X10.Y25.F100"]),
        ("g1 x5 ; out", at(10), ["g1 x15 ; out"]),
        ("N7 G1 (in) X+5 (out) Z -2", at(10), ["N7 G1 (in) X15 (out) Z -2"]),
        ("/1 G1 X5", at(10), ["/1 G1 X15"]),
        ("G1 X5.25 Z1", at(0.001, 0, 0.00049), ["G1 X5.251 Z1.0005"]),
        ("G20 G1 X1", at(25.4), ["G20 G1 X2"]),
        # Increments turn and do not move.
        ("G91 G1 X5\nX5 Y1\nG90 X0", QUARTER, ["G91 G1 X0 Y5", "X-1 Y5", "G90 X9 Y20"]),
        # Arcs: centres turn, planes change, senses keep as seen from the work.
        ("G3 X0 Y10 J5", at(1, 2, 3), ["G3 X1 Y12 J5"]),
        ("G3 X0 Y10 J5", QUARTER, ["G3 X0 Y20 I-5 J0"]),
        ("G2 X8 Y0 I4 P2", QUARTER, ["G2 X10 Y28 I0 J4 P2"]),
        ("G90.1 G3 X0 Y10 I0 J5", QUARTER, ["G90.1 G3 X0 Y20 I5 J20"]),
        ("G18 G2 X8 Z0 I4 K0", at(turn=90), ["G19 G3 X0 Y8 Z0 J4 K0"]),
        ("G18 G2 X8 Z0 I4 K0", at(turn=180), ["G18 G3 X-8 Z0 I-4 K0"]),
        ("G19 G2 Y8 Z0 J4 K0", at(turn=270), ["G18 G3 X8 Y0 Z0 I4 K0"]),
        ("G18\nG2 X8 I4\nX0 I-4", at(turn=180), ["G18", "G3 X-8 I-4", "X0 I4"]),
        # A full circle ends where it begins, without words that might be rounded off it.
        ("G3 X0 Y0 I4", at(1, 2), ["G3 I4"]),
        ("G3 I4", QUARTER, ["G3 I0 J4"]),
        # A radius becomes a centre, which does not hang on the last digit near half a circle.
        ("G3 X5 Y5 R5", at(turn=37), ["G3 X0.9841 Y7.0023 I-3.0091 J3.9932"]),
        ("G3 X0 Y10 R5", at(turn=37), ["G3 X-6.0182 Y7.9864 I-3.0091 J3.9932"]),
        # Cycles: the hole turns and moves, heights move; increments are no heights.
        ("G81 X5 Y0 Z-3 R2\nX6\nG80", QUARTER, ["G81 X10 Y25 Z27 R32", "X10 Y26", "G80"]),
        ("G83 X5 Z-3 R2 Q1.5\nG80", at(1, 0, 3), ["G83 X6 Z0 R5 Q1.5", "G80"]),
        ("G91 G81 X5 Y1 Z-3 R2 L3", QUARTER, ["G91 G81 X-1 Y5 Z-3 R2 L3"]),
        # Machine coordinates stay; what follows is written in full.
        ("G53 G1 X7 Y8 Z9\nG1 X1", at(0, 0, 5), ["G53 G1 X7 Y8 Z9", "G1 X1"]),
        ("G53 G0 Z9\nG1 X1", at(10, 0, 5), ["G53 G0 Z9", "G1 X11"]),
        ("G28 Z5\nG0 X0 Y0 Z1\nG1 X1", at(10, 0, 5), ["G28 Z10", "G0 X10 Y0 Z6", "G1 X11"]),
        ("G28\nG0 X0 Y0 Z1\nG1 X1", at(10, 0, 5), ["G28", "G0 X10 Y0 Z6", "G1 X11"]),
        ("G30 X1 Y2\nG0 X0 Y0\nG1 X1", QUARTER, ["G30 X8 Y21", "G0 X10 Y20", "G1 X10 Y21"]),
        # Offsets of the program are left alone; the words are written in whatever they make of them.
        ("G92 X0\nG1 X5", at(10), ["G92 X0", "G1 X5"]),
        ("G52 X1\nG1 X5", at(10), ["G52 X1", "G1 X15"]),
        ("G10 L2 P2 X100\nG55\nG1 X5", at(10), ["G10 L2 P2 X100", "G55", "G1 X15"]),
        ("G10 L2 P2 X100 R90\nG55\nG1 X5", at(turn=90), ["G10 L2 P2 X100 R90", "G55", "G1 X0 Y105"]),
        ("G10 L20 P2 X50\nG55\nG1 X51", at(10), ["G10 L20 P2 X50", "G55", "G1 X51"]),
        # The tool's axis turns with the work; a vertical one does not yaw.
        ("G1 X5 A10", at(turn=180), ["G1 X-5 A-10"]),
        ("G1 X5 C10", at(turn=37), ["G1 X3.9932 Y3.0091 C10"]),
        # Lines that do not move.
        ("M8\n\nT2 M6 (next)\nG4 P1\nG1 X1", at(10), ["M8", "", "T2 M6 (next)", "G4 P1", "G1 X11"]),
    ],
)
def test_what_is_written(text, there, written):
    assert body(text, there) == written


def test_roundings_of_increments_do_not_add_up():
    lines = START + "G91\n" + "G1 X0.01 Y0.0033\n" * 2000
    there = at(turn=37)
    program = parse_program(lines, origin=there)
    again = parse_program(rewrite_program(program, there, HERE).text)
    wanted, found = (p.moves.end[-1, :2] * 1e3 for p in (program, again))
    cos, sin = math.cos(math.radians(37)), math.sin(math.radians(37))
    turned = np.array([[cos, -sin], [sin, cos]]) @ wanted
    assert np.abs(found - turned).max() < 0.6e-4  # half a unit of the last decimal, after two thousand blocks


def test_a_tilted_set_up_tilts_the_tool_and_its_tool_length_follows_the_control():
    text = "G21 G90 F500\nT1 M6\nG0 X0 Y0\nG43 H1 Z5\nG1 X10\nY10\nM2\n"
    lines = rewrite(text, at(0, 0, 100, a=5), tools=TOOL_TABLE)
    assert lines[2] == "G0 X0 Y0 Z100 A5"
    assert lines[4] == "G1 X10"


def test_offsets_of_a_file_are_taken_into_account():
    offsets = Offsets()
    offsets.table[1] = WorkOffset([10.0, 20.0, 30.0, 0.0, 0.0, 0.0], rotation=30.0, given=True)
    there = at(1, 2, 3, 45)
    text = START + "G55 G0 X0 Y0 Z0\nG1 X5\nG3 Y10 J5\nM2\n"
    program = parse_program(text, origin=there, controller=Controller(offsets=offsets))
    rewritten = rewrite_program(program, there, HERE, control=Controller(offsets=offsets))
    assert_same_path(program, there, parse_program(rewritten.text, controller=Controller(offsets=offsets)), HERE, 1e-4)


@pytest.mark.parametrize("turn", [30.0, 90.0, 211.0])
def test_a_tilted_original_set_up(turn):
    origin = at(5, 6, 700, turn=10, a=4)
    rewrite(START + "G1 X10\nX20 Y5 A-3\nG0 Z9\nM2\n", at(1, 2, 900, turn=turn, b=3), origin, linearise=1e-5)


@pytest.mark.parametrize(
    ("text", "there", "line", "message"),
    [
        ("G18 G2 X8 Z0 I4 K0", at(turn=37), 3, "an arc of G18.*--linearise"),
        ("G2 X8 I4", at(a=3), 3, "an arc of G17.*--linearise"),
        ("G81 X1 Z-3 R2", at(a=3), 3, "drills along Z.*--linearise"),
        ("G1 A30 B40", at(turn=90), 3, "lean.*--linearise"),
        ("G28 X1", at(turn=37), 3, "G28.*without Y.*name Y"),
        ("G28 Y1", at(a=3), 3, "without Z.*name Z"),
    ],
)
def test_refusals_give_line_and_reason(text, there, line, message):
    program = parse_program(START + text + "\nG80 G1 X9\n", "part.nc", origin=there)
    with pytest.raises(InputError, match=f"(?is){message}") as caught:
        rewrite_program(program, there, HERE)
    assert (caught.value.file, caught.value.line) == ("part.nc", line)


def test_what_the_decimals_cannot_hold_is_refused():
    program = parse_program(START + "G1 X0.004\nG3 X0 Y0.004 R0.004\nG80 G1 X9\n", "part.nc", origin=at(turn=37))
    with pytest.raises(InputError, match="decimals") as caught:
        rewrite_program(program, at(turn=37), HERE, decimals=2)
    assert caught.value.line == 4


def test_a_first_cut_from_nowhere_is_refused():
    """Where the control stands when it is switched on does not move with the work."""
    program = parse_program("G0 X1 Y1\nG1 X5 F100\n", origin=at(0, 0, 10))
    with pytest.raises(InputError, match="osition Z in rapid") as caught:
        rewrite_program(program, at(0, 0, 10), HERE)
    assert caught.value.line == 2


def test_a_first_cut_whose_tool_axis_is_nowhere_given_names_the_rotary_axes():
    """X, Y and Z stand where the program put them; the tilt of the set-up has no A, B, C word to go into."""
    program = parse_program("G53 G0 X10 Z50\nG1 X1 Y1 Z0 F100\n", origin=at(10, 0, 700, 17, a=6, b=-11))
    with pytest.raises(InputError, match=r"tool axis .* degrees off.*osition X, Y, Z and the rotary axes in rapid"):
        rewrite_program(program, at(10, 0, 700, 17, a=6, b=-11), HERE, linearise=1e-4)


def test_no_axis_is_moved_that_the_program_left_alone():
    """`G0 X Y` before Z is known must not plunge to where Z 0 would be."""
    assert rewrite("G0 X1 Y1\nZ5\nG1 Z-1 F100\n", at(1, 1, -50, 30))[0] == "G0 X1.366 Y2.366"


def test_a_tolerance_below_the_rounding_is_refused():
    program = parse_program(START + "G18 G2 X8 I4\n", origin=at(turn=37))
    with pytest.raises(InputError, match="rounding to 4 decimals"):
        rewrite_program(program, at(turn=37), HERE, linearise=1e-7)


def test_blocks_left_out_are_refused_and_taken_ones_noted():
    text = START + "/G1 X5\nG1 X6\n"
    program = parse_program(text, origin=at(10), controller=Controller(switches=ALL_SWITCHES))
    with pytest.raises(InputError, match="block-delete") as caught:
        rewrite_program(program, at(10), HERE, control=Controller(switches=ALL_SWITCHES))
    assert caught.value.line == 3
    rewritten = rewrite_program(parse_program(text), at(10), HERE)
    assert any("switch off" in note for note in rewritten.notes)


def test_an_arc_in_pieces_keeps_what_stands_beside_it():
    lines = body("/N4 g18 g2 x8 z0 i4 k0 f200 (saddle)\ng2 x0 i-4\nG17 G1 X1", at(turn=37), linearise=0.5e-3)
    assert lines[0].startswith("/N4 g18 g1 x")
    assert lines[0].endswith("f200 (saddle)")
    assert not any(letter in " ".join(lines) for letter in "ijk")
    second = next(i for i, line in enumerate(lines) if line.startswith("g1 x"))
    assert second > 2
    assert all(line.startswith("/x") for line in lines[1:second])
    assert lines[-1].startswith("G17 G1 X")


def test_modal_arcs_after_pieces_are_arcs_again():
    lines = body("G10 L2 P2 R0\nG18 G2 X8 I4\nG17\nG2 X16 I4\nX24 I4", at(turn=37), linearise=1e-4)
    assert lines[-2].startswith("G2 ")
    assert lines[-1].startswith("X")
    # The plane's own arc, without its code, where straight pieces stand before it.
    lines = body("G18 G2 X8 I4\nG17 X16 I4", at(turn=37), linearise=1e-4)
    assert lines[-1].startswith("G2 G17 X") or lines[-1].startswith("G17 G2 X")


def test_pieces_before_the_end_of_the_program_are_refused():
    for words, what in (("M2", "M2 in a block"), ("G93 F2", "inverse-time feed")):
        program = parse_program(f"{START}G18 G2 X8 I4 {words}\n", origin=at(turn=37))
        with pytest.raises(InputError, match=what):
            rewrite_program(program, at(turn=37), HERE, linearise=1e-4)


def test_large_turns_of_the_tool_are_cut_until_they_lean_no_more():
    there = at(turn=90)
    text = START + "G1 X10 A30 B40\nM2\n"
    lines = rewrite(text, there, linearise=1e-5, decimals=6)
    program, again = parse_program(text, origin=there), parse_program("\n".join(lines) + "\n")
    wanted = cutting_moves(program, there)[0]
    found = cutting_moves(again, HERE)
    np.testing.assert_allclose(found[-1][2][1], wanted[2][1], atol=1e-6)
    assert len(found) > 3
    middle = len(found) // 2
    share = np.linalg.norm(found[middle][0] - wanted[0]) / 0.010
    half = parse_program(START + f"G1 X{10 * share:.9f} A{30 * share:.9f} B{40 * share:.9f}\n", origin=there)
    np.testing.assert_allclose(found[middle][2][0], cutting_moves(half, there)[0][2][1], atol=1e-6)


def test_an_arc_during_which_the_tool_turns_stays_within_the_tolerance():
    """Its plane is turned into itself, but the turn of the tool wants pieces: these are chords of the circle."""
    there = at(turn=90)
    lines = rewrite(START + "G3 X0 Y0 I20 A8 B10\n", there, linearise=1e-5, decimals=6)
    program = parse_program("\n".join(lines) + "\n")
    ends = 1e3 * np.array([(move[0][:2], move[1][:2]) for move in cutting_moves(program, HERE)])
    centre = np.array([0.0, 20.0])
    middles = np.linalg.norm(ends.mean(axis=1) - centre, axis=1)
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - centre, axis=1), 20.0, atol=2e-6)
    assert middles.min() > 20.0 - 0.01


@pytest.mark.parametrize("seed", range(25))
def test_random_programs_of_every_code_keep_their_path_or_are_refused(seed):
    """Those that LinuxCNC reads as we do, with offsets, rotations, G92, tool lengths, G53, G28, inches."""
    turns = (0.0, 90.0, 180.0, 270.0, 37.0)
    program_text = Writer(seed).program(15)
    there = at(30, -20, 900, turn=turns[seed % 5])
    try:
        rewrite(program_text, there, at(0, 0, 800), tools=TOOL_TABLE)
    except InputError as error:
        assert error.line is not None  # of a kind that test_refusals_give_line_and_reason names
        assert any(word in str(error) for word in ("--linearise", "turned work has no such axis")), error
        assert turns[seed % 5] != 0.0


@pytest.mark.parametrize("seed", range(25))
def test_runs_of_cycles_keep_their_path(seed):
    text = "G0 X0 Y0 Z0\n" + cycle_program(seed)
    there = at(30, -20, 900, turn=37.0 * seed)
    try:
        parse_program(text)
    except InputError:
        return  # a hole above its R plane
    rewrite(text, there, linearise=None if "G17" in text else 1e-5)


coordinate = st.integers(-40_000, 40_000).map(lambda v: f"{v / 1000:.3f}")


@st.composite
def small_programs(draw) -> str:
    """Lines, increments, arcs by R and by centre, helices, cycles and shifts, valid whatever is drawn."""
    lines = ["G21 G17 G90 F500", "G0 X1 Y2 Z30"]
    for kind in draw(st.lists(st.sampled_from("LLIARHDS"), min_size=1, max_size=12)):
        x, y, z = (draw(coordinate) for _ in "xyz")
        radius = draw(st.integers(1000, 20_000)) / 1000
        code = draw(st.sampled_from(["G2", "G3"]))
        axes = draw(st.sampled_from([f"X{x}", f"Y{y}", f"Z{z}", f"X{x} Y{y}", f"X{x} Z{z}", f"X{x} Y{y} Z{z}"]))
        if kind == "L":
            lines.append(f"{draw(st.sampled_from(['G0', 'G1']))} {axes}")
        elif kind == "I":
            lines += [f"G91 G1 {axes}", "G90"]
        elif kind == "A":  # half circle, by its centre
            lines += [f"G91 {code} X{2 * radius:.3f} I{radius:.3f}", "G90"]
        elif kind == "R":  # a quarter, by its radius
            lines += [f"G91 {code} X{radius:.3f} Y{radius:.3f} R{radius:.3f}", "G90"]
        elif kind == "H":
            lines += [f"{code} Z{z} J{radius:.3f} P{draw(st.integers(1, 3))}"]
        elif kind == "D":
            lines += [f"G0 Z60\nG81 X{x} Y{y} Z-5 R{radius:.3f}", f"Y{x}", "G80"]
        else:
            lines.append(draw(st.sampled_from([f"G92 X{x}", f"G52 Y{y} Z{z}", f"G10 L20 P1 X{x}", "G92.1"])))
    return "\n".join([*lines, "G1 X3.25 Y3", "M2", ""])


@settings(max_examples=60, deadline=None)
@given(
    text=small_programs(),
    shift=st.tuples(*[st.integers(-300_000, 300_000)] * 3),
    turn=st.one_of(st.sampled_from([0.0, 90.0, 180.0]), st.floats(-360.0, 360.0)),
    decimals=st.integers(3, 7),
)
@example(text=START + "G1 X1\nG3 X1 Y0 I-1\nG1 X2\nM2\n", shift=(1, 1, 1), turn=1e-7, decimals=4)
def test_any_small_program_keeps_its_path(text, shift, turn, decimals):
    try:
        rewrite(text, at(*(v / 1000 for v in shift), turn), decimals=decimals)
    except InputError as refused:  # rounded to 0.001 mm a small arc may miss its circle by more than a control allows
        assert decimals == 3
        assert "mm off its circle" in refused.found
        assert refused.hint == "give more --decimals"


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("seed", range(12))
def test_linuxcnc_reads_random_rewritten_programs_as_we_do(seed, tmp_path):
    """What rs274 makes of the written text is what we make of it; that this is the placed path is tested above."""
    text, there = Writer(seed).program(12), at(30, -20, 0, turn=180.0 if seed % 2 else 0.0)
    program = parse_program(text, origin=there, controller=Controller(tools=TOOL_TABLE))
    rewritten = rewrite_program(program, there, HERE, control=Controller(tools=TOOL_TABLE), linearise=1e-4)
    path = tmp_path / "written.ngc"
    path.write_bytes(rewritten.content)
    canon = rs274.run(path, tmp_path, TABLE_RS274)
    assert not canon.error, canon.error
    assert_linuxcnc_agrees(parse_program(rewritten.text, controller=Controller(tools=TOOL_TABLE)), canon)
