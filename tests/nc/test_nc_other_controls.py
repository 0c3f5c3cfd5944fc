"""Words and codes of Fanuc's and Haas' controls that change no path, or as their manuals say: read, and listed."""

from pathlib import Path

import numpy as np
import pytest

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import TABLE_OURS, TABLE_RS274, assert_same_path
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.controller import ALL_SWITCHES, Controller, dialect_named
from toolpath_stiff.nc.languages import lathe_program
from toolpath_stiff.nc.lines import read_lines
from toolpath_stiff.nc.moves import RAPID
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.words import read_block

HEAD = "G21 G90 F600.\nG0 Z5.\n"


def read(blocks: str, dialect: str = "generic", head: str = HEAD, **options):
    return parse_program(f"{head}{blocks}\nM30\n", "p.nc", controller=Controller(dialect_named(dialect)), **options)


def cuts(program) -> list[list[float]]:
    """Ends of its cutting moves, mm."""
    ends = program.moves.end[program.moves.motion != RAPID, :3] * 1e3
    return ends.round(6).tolist()


LISTED = {
    "Haas: limit of the look-ahead": ("G103 P1", "haas", ["G103"]),
    "Haas: smoothness": ("G187 P2 E0.01", "haas", ["G187"]),
    "Haas: no dynamic offset": ("G255", "haas", ["G255"]),
    "Fanuc: high-speed machining": ("G05 P10000", "fanuc", ["G05"]),
    "Fanuc: high-speed machining, off": ("G5 P0", "generic", ["G5"]),
    "Fanuc: contour control": ("G05.1 Q1", "fanuc", ["G05.1"]),
    "Fanuc: contour control with R": ("G05.1 Q1 R5", "generic", ["G05.1"]),
    "Fanuc: look-ahead": ("G08 P1", "fanuc", ["G08"]),
    "Fanuc: rigid tapping": ("M29 S500", "fanuc", ["M29"]),
    "D and H beside M6": ("T1 M6 D1 H1", "fanuc", ["D1", "H1"]),
    "D beside T": ("T1 D1", "generic", ["D1"]),
}


@pytest.mark.parametrize("kind", LISTED)
def test_what_changes_no_path_is_listed(kind):
    block, dialect, words = LISTED[kind]
    program = read(f"{block}\nG1 X1. Y2.", dialect)
    assert [note.word for note in program.unsupported] == words
    assert program.unsupported[0].line == 3
    assert cuts(program) == [[1, 2, 5]]
    assert not program.assumptions[1:]  # no number of it counted increments


def test_an_exact_stop_of_one_block_is_listed_beside_its_move():
    program = read("G09 G1 X1. Y2.\nG9 G2 X3. Y2. I1. J0.", "fanuc")
    assert [note.word for note in program.unsupported] == ["G09", "G9"]
    assert cuts(program) == [[1, 2, 5], [3, 2, 5]]


@pytest.mark.parametrize("dialect", ["linuxcnc", "fanuc"])
def test_a_code_of_haas_alone_is_refused_elsewhere(dialect):
    with pytest.raises(InputError, match=f"G187 is not a code of the dialect {dialect}; expected generic or haas"):
        read("G187 P1\nG1 X1.", dialect)


def test_the_same_numbers_with_axis_words_are_splines():
    for block in ("G5 X1 Y1 I1 J1 P1 Q1", "G5.1 X1 Y1 I1 J1", "G5 P1 X2", "G5.1"):
        with pytest.raises(InputError, match="is a spline"):
            read(block)


def test_a_dynamic_offset_gives_a_warning():
    program = read("G254\nG1 X1.", "haas")
    assert any(
        "line 3: G254, not acted upon: the work offset follows the part" in text for text in map(str, program.warnings)
    )


def test_a_tool_with_its_numbers(tmp_path):
    tools = tmp_path / "t.tbl"
    tools.write_text(TABLE_OURS)
    file = tmp_path / "p.nc"
    file.write_text(f"{HEAD}T1 M6 D1\nG43 H1 D1\nG1 X1.\nM30\n")
    program = read_program(file, tool_table=tools)
    assert [note.word for note in program.unsupported] == ["D1", "D1"]
    assert program.moves.tool_length[-1] == pytest.approx(0.05)
    file.write_text(f"{HEAD}G43 H1\nT1 M6 H1\nG1 X1.\nM30\n")
    with pytest.raises(InputError, match="H1 without G43, while a tool length is in force"):
        read_program(file, tool_table=tools)
    file.write_text(f"{HEAD}T1 M6 H2\nG43 Z3.\nG1 X1.\nM30\n")
    with pytest.raises(InputError, match="after another H"):
        read_program(file, tool_table=tools)
    file.write_text(f"{HEAD}G1 X1. D1\nM30\n")
    with pytest.raises(InputError, match="D1 is not used by any code of its block"):
        read_program(file, tool_table=tools)


HOMES = {
    "G0 G28": ("G0 G28 Z7.\nX3.", "G28 Z7.\nG0\nX3."),
    "G91 G28 G00": ("G91 G28 G00 Z0.\nG90 X3.", "G91 G28 Z0.\nG90 G0 X3."),
    "U0 W0": ("G1 X2. Y3.\nG28 U0 W0\nX4.", "G1 X2. Y3.\nG91 G28 X0 Z0\nG90 X4."),
    "V0": ("G1 X2. Y3.\nG30 V0.\nX4.", "G1 X2. Y3.\nG91 G30 Y0\nG90 X4."),
}


@pytest.mark.parametrize("kind", HOMES)
def test_going_home_in_other_words(kind):
    ours, plain = (read(f"G1 Y1.\n{blocks}\nG1 Y9.").moves for blocks in HOMES[kind])
    assert np.allclose(ours.end, plain.end)
    assert (ours.motion == plain.motion).all()
    assert (ours.from_machine == plain.from_machine).all()


@pytest.mark.parametrize("block", ["G28 U1. W0", "G1 U0", "U0 G92 X1."])
def test_other_axes_are_still_refused(block):
    with pytest.raises(InputError, match="moves an axis that this machine does not have"):
        read(block)


def test_a_slash_in_the_middle_of_a_block():
    text = f"{HEAD}G1 X1. / Y2.\nN10 /2 X3.\nX4. /3 M8 Y7.\nM30\n"
    assert cuts(parse_program(text)) == [[1, 2, 5], [3, 2, 5], [4, 7, 5]]
    assert cuts(parse_program(text, controller=Controller(switches=ALL_SWITCHES))) == [[1, 0, 5], [4, 0, 5]]
    assert cuts(parse_program(text, controller=Controller(switches=frozenset({2})))) == [[1, 2, 5], [4, 7, 5]]
    block = read_block("G1 X1. /3 M8", 1, "p.nc")
    assert (block.optional, block.switch, block.rest) == (False, 3, 2)
    with pytest.raises(InputError, match=r"p\.nc:1:4: block-delete switch '/12'"):
        read_block("X1./12 Y2", 1, "p.nc")


def test_a_centre_word_of_no_plane():
    text = "G2 X2. Y0. I1. J0. K0.\nG18 G3 X4. Z5. I1. K0. J0"
    assert cuts(read(text)) == [[2, 0, 5], [4, 0, 5]]
    many = "".join(f"G1 X{i}. Y0.\nG2 X{i + 1}. Y0. I.5 J0. K0.\n" for i in range(60))
    assert (read(many).moves.arc_sweep != 0.0).sum() == 60
    with pytest.raises(InputError, match=r"K1\. is off the plane G17"):
        read("G2 X2. Y0. I1. J0. K1.")


COMMENTS = {
    "after the end of a block": ("G1 X1. ; (to the edge)", "fanuc"),
    "two of them": ("G1 X1. ; (to) ;; (the edge)", "haas"),
    "within each other": ("(drill (5 mm) holes) G1 X1. (a (b (c)) d)", "haas"),
    "within each other, alone": ("(op 1 (rough))\nG1 X1.", "generic"),
    "beside the number": ("O1234(PART (REV A))\nG1 X1.", "generic"),
}


@pytest.mark.parametrize("kind", COMMENTS)
def test_comments(kind):
    block, dialect = COMMENTS[kind]
    head = "" if block.startswith("O") else HEAD
    ends = cuts(read(block, dialect, head or "") if head else read(f"{block} F600.", dialect, "%\n"))
    assert ends[-1][0] == 1.0


@pytest.mark.parametrize("block", ["(a (b) G1 X1.", "a) G1 X1.", "G1 X1. ; X2."])
def test_comments_that_are_none(block):
    with pytest.raises(InputError):
        read(block, "haas")


def test_a_million_semicolons_are_one():
    assert read_block("G1 X1" + ";" * 5000, 1, "p.nc", semicolon=False).words[1].value == 1.0


def test_a_cycle_that_is_only_prepared():
    for letter, dialect in (("L", "haas"), ("K", "fanuc"), ("L", "generic")):
        program = read(f"G99 G81 X1. Y1. Z-2. R1. {letter}0\nX3.\nY4.\nG80", dialect)
        assert cuts(program) == [[3, 0, -2], [3, 4, -2]]


def test_a_subprogram_that_returns_elsewhere():
    text = "M98 P2\nG1 X1.\nN10 G1 X2.\nM30\nO2\nG1 X7.\nM99 P10"
    assert cuts(read(text)) == [[7, 0, 5], [2, 0, 5]]
    assert cuts(read("M99 P10\nG1 X1.\nN10 G1 X2.")) == [[2, 0, 5]]
    back = read("N10 G1 X1.\nG1 X2.\nM99 P10")
    assert cuts(back) == [[1, 0, 5], [2, 0, 5]]
    assert "read once" in str(back.warnings[0])
    with pytest.raises(InputError, match="M99 P goes to N11, which no block has"):
        read("M99 P11\nG1 X1.\nN10 G1 X2.")
    with pytest.raises(InputError, match="goes back to line 3 of the caller"):
        read("N10 G1 X3.\nM98 P2\nM30\nO2\nG1 X7.\nM99 P10")


# -- cycles ------------------------------------------------------------------------------------------------------------

TAPS = {
    "G84": "S100 M3\nG98 G84 X1 Y1 Z-2 R1 P1 F50\nX5 L2\nG99 X7\nG80",
    "G74": "S100 M4\nG99 G74 X1 Y1 Z-2 R1 P.5 F50\nG91 X5 Z-1 R0\nX2\nG80 G90",
    "G86": "S100 M3\nG98 G86 X1 Y1 Z-2 R1 P.5 F50\nX5\nX7 L2\nG86 Z-3 P0\nG80",
    "G86 in another plane": "S100 M3\nG18 G98 G86 X1 Z1 Y-2 R1 P0 F50\nX5\nG80",
}


@pytest.mark.parametrize("kind", TAPS)
def test_tapping_and_boring_as_linuxcnc(kind, tmp_path):
    file = tmp_path / "p.ngc"
    file.write_text(f"G21 G90 F600\nG0 Y5 Z5\n{TAPS[kind]}\nG1 X9\nM2\n")
    program = read_program(file)
    assert not any("not supported" in note.reason for note in program.unsupported)
    assert (program.moves.motion == 3).sum() >= 2
    if rs274.AVAILABLE:
        canon = rs274.run(file, tmp_path, TABLE_RS274)
        assert not canon.error
        assert_same_path(program, canon)


def test_a_tap_of_fanuc_feeds_out_to_its_r_plane():
    program = read("M29 S100\nG98 G84 X1. Z-2. R1. P500\nG80", "fanuc")
    assert cuts(program) == [[1, 0, -2], [1, 0, 1]]
    assert program.moves.end[-1, 2] == pytest.approx(5e-3)
    assert program.moves.dwell.max() == pytest.approx(0.5)
    with pytest.raises(InputError, match="along another axis"):  # rs274 2.9 does
        read("G18 G84 X1 Z1 Y-2 R1")
    assert cuts(read("G18 G99 G84 X1. Z1. Y-2. R1.", "fanuc")) == [[1, -2, 1], [1, 1, 1]]
    with pytest.raises(InputError, match="is a tap in pecks"):
        read("G84 X1. Z-2. R1. Q.5", "fanuc")
    assert [note.word for note in read("G84 X1. Z-2. R1. J2", "haas").unsupported] == ["J2"]


def test_fine_boring_is_that_of_the_control_that_is_named():
    program = read("G99 G76 X1. Z-2. R1. Q.1 P100", "fanuc")
    assert cuts(program) == [[1, 0, -2]]
    assert [note.word for note in program.unsupported] == ["Q.1"]
    assert [note.word for note in read("G76 X1. Z-2. R1. I.1 J0. P100", "haas").unsupported] == ["I.1", "J0."]
    for other in ("generic", "linuxcnc"):
        with pytest.raises(
            InputError, match=f"G76 is not a code of the dialect {other}; expected fanuc or haas"
        ) as error:
            read("G76 X1. Z-2. R1. Q.1", other)
        assert error.value.hint == "there it is fine boring, rapid out: name the control with --dialect"


def test_pecks_that_get_shallower():
    """Haas' manual, G83: the first peck is I deep, each further one J less, none less than K."""
    program = read("G99 G83 X1. Z-10. R1. I4. J1. K2.", "haas")
    assert [z for _, _, z in cuts(program)] == [-3, -6, -8, -10]
    program = read("G99 G73 X1. Z-7. R1. I3. J2. K2.5", "haas")
    assert [z for _, _, z in cuts(program)] == [-2, -4.5, -7]
    for block in ("G83 X1. Z-10. R1. I4. J1.", "G83 X1. Z-10. R1. J1. K2.", "G83 X1. Z-10. R1. Q1. I4. J1. K2."):
        with pytest.raises(InputError, match="beside Q, or without I or K"):
            read(block, "haas")
    with pytest.raises(InputError):
        read("G83 X1. Z-10. R1. I4. J1. K2.", "generic")


# -- corners -----------------------------------------------------------------------------------------------------------


def test_a_chamfer_and_a_rounding():
    program = read("G1 X10. ,C2.\nY10. ,R3.\nX20. Y20.", "fanuc")
    turn = np.pi / 4.0
    along = 3.0 * np.tan(turn / 2.0)
    expected = [[8, 0, 5], [10, 2, 5], [10, 10 - along, 5], [10 + along * np.sin(turn), 10 + along * np.cos(turn), 5]]
    assert np.allclose(cuts(program), [*expected, [20, 20, 5]], atol=1e-6)
    arc = np.flatnonzero(program.moves.arc_sweep)
    assert len(arc) == 1
    assert program.moves.arc_sweep[arc[0]] == pytest.approx(-turn)
    center = program.moves.arc_center[arc[0]] * 1e3
    for point in (program.moves.start[arc[0], :3], program.moves.end[arc[0], :3]):
        assert np.linalg.norm(point * 1e3 - center) == pytest.approx(3.0)
    assert np.allclose(program.moves.feed[program.moves.motion != RAPID] * 60e3, 600.0)
    assert (program.moves.start[1:] == program.moves.end[:-1]).all()


def test_corners_in_steps_and_planes_and_inches():
    steps = read("G91 G1 X10. ,C2.\nY10.\nX10.\nG90", "haas")
    assert np.allclose(cuts(steps), [[8, 0, 5], [10, 2, 5], [10, 10, 5], [20, 10, 5]])
    plane = read("G18\nG1 X10. ,R2.\nZ15.", "haas")
    assert np.allclose(cuts(plane), [[8, 0, 5], [10, 0, 7], [10, 0, 15]])
    sweep = plane.moves.arc_sweep[np.flatnonzero(plane.moves.arc_sweep)[0]]
    assert sweep == pytest.approx(-np.pi / 2.0)  # about +Y, from +X to +Z
    inch = read("G20 F20.\nG1 X1. ,C.1\nY1.", "haas")
    assert np.allclose(cuts(inch)[1], [25.4, 2.54, 5.0])


def test_a_corner_that_is_none():
    assert cuts(read("G1 X10. ,R2.\nX20.", "fanuc")) == [[10, 0, 5], [20, 0, 5]]


@pytest.mark.parametrize(
    ("blocks", "line", "found"),
    [
        ("G1 X10. ,R2.\nM8\nY10.", 4, "makes a corner"),
        ("G1 X10. ,R2.\nG0 Y10.", 4, "makes a corner"),
        ("G1 X10. ,R2.\nG55 Y10.", 4, "beside other codes"),
        ("G1 X10. ,R12.\nY10.", 4, "does not fit its contour elements"),
        ("G1 X10. ,R2.\nX0.", 4, "goes straight back"),
        ("G1 X10. ,R2.\nZ10.", 4, "do not lie in the plane"),
        ("G1 X10. ,R2. ,C2.\nY10.", 3, "beside another corner"),
        ("G1 X10. ,R-2.\nY10.", 3, "is the size of a corner"),
        ("G0 X10. ,R2.\nG1 Y10.", 3, "without a feed move"),
        ("G1 ,R2.\nG1 Y10.", 3, "without a feed move"),
        ("G1 X10. ,A2.\nG1 Y10.", 3, "is not a word"),
    ],
)
def test_a_corner_that_cannot_be_made(blocks, line, found):
    with pytest.raises(InputError, match=found) as refusal:
        read(blocks, "fanuc")
    assert refusal.value.line == line


def test_corners_are_no_words_of_linuxcnc():
    with pytest.raises(InputError, match="not a word of the dialect linuxcnc"):
        read("G1 X10 ,R2\nY10", "linuxcnc")


# -- messages ----------------------------------------------------------------------------------------------------------


# -- lathes, feeds -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("block", ["G50 S2000", "G50 X100. Z50."])
def test_a_lathe_s_limit_of_speed_is_refused(block):
    with pytest.raises(InputError, match="is a lathe's code") as refusal:
        read(f"{block}\nG1 X1.")
    assert refusal.value.line == 3


def test_what_looks_like_a_lathe_s_program_gives_a_warning():
    for blocks in ("G96 S100\nG1 X1.", "G95 S100 F.1\nG1 X1. Z-3."):
        assert any("looks like a lathe's program" in text for text in map(str, read(blocks).warnings))
        checked = check(Request(tuple(f"{HEAD}{blocks}".splitlines()), "p.nc"))
        assert any("looks like a lathe's program" in finding.text for finding in checked.findings)
    for blocks in ("G96 S100\nG1 X1. Y1.", "G95 S100 F.1\nG1 X1.\nG2 X3. I1.", "G1 X1.\nG50"):
        assert not any("lathe" in text for text in map(str, read(blocks).warnings))


LATHE = {  # a sign alone, which is no more than doubted, and its name
    "T0101\nG1 X1. Z-3.": "T with four digits and no M6",
    "G18\nG1 X1. Z-3.": "G18 and never Y",
    "G99\nG1 X1. F.1": "G99 and a feed below 1 a revolution",
    "G28 U0 W0\nG1 X1. F9.": "G28 with U or W",
    "G96 S200\nG1 X1. F9.": "G96 and never Y",
}


@pytest.mark.parametrize("pair", [(a, b) for a in LATHE for b in LATHE if a < b])
def test_two_signs_of_a_lathe_are_refused_by_name(pair):
    text = HEAD + "\n".join(pair)
    for interpreter in ("builtin", "auto"):
        with pytest.raises(InputError, match=r"a lathe's program: .*X is a diameter") as refusal:
            parse_program(text, "p.nc", interpreter=interpreter)
    assert all(LATHE[blocks] in str(refusal.value) for blocks in pair) and refusal.value.line in (3, 4)
    checked = check(Request(tuple(text.splitlines()), "p.nc"))
    assert not checked.complete and "a lathe's program" in checked.findings[0].text
    for blocks in pair:
        read(blocks)


def test_u_and_w_beside_another_sign_are_a_lathe_s():
    with pytest.raises(InputError, match=r"no M6 \(line 3\), a U or W word \(line 4\)"):
        read("T0101\nG1 U-2. W1.")


@pytest.mark.parametrize(
    "blocks",
    [
        "T0101\nM6\nG28 U0 W0\nG1 X1.",  # the tool is changed
        "G28 U0 W0\nG99 G81 X1. Z-3. R1. F.5\nG80",  # G99 of a drilling cycle
        "G18\n(T0101 F.1 G99)\nG2 X2. Z5. I1.",  # a comment
        "G28 U0 W0\nG18\nG1 X1.\n" + "X2.\nX1.\n" * 1500 + "G17 Y1.",  # Y, far behind
    ],
)
def test_a_mill_s_program_with_one_sign_is_read(blocks):
    read(blocks)


def test_no_packaged_program_looks_like_a_lathe_s():
    programs = sorted((Path(__file__).parents[2] / "programs").glob("*.nc"))
    assert len(programs) > 10
    assert not [p.name for p in programs if lathe_program(read_lines(p), p.name)]


def test_a_feed_for_programs_without_one():
    control = Controller(feed=300.0)
    program = parse_program("G21 G90\nG1 X10\nG1 Z5 F100\nM30\n", "p.nc", controller=control)
    assert np.allclose(program.moves.feed * 60e3, [300, 100])
    assert "cuts before the first feed of the program have 300 mm/min, as asked for" in program.assumptions
    later = parse_program("G21 G90 F100\nG1 X10\nM30\n", "p.nc", controller=control)
    assert np.allclose(later.moves.feed * 60e3, 100)
    assert not any("as asked for" in text for text in later.assumptions)
    with pytest.raises(InputError, match="expected F above 0, or --feed MM_PER_MIN"):
        parse_program("G21 G90\nG1 X10\nM30\n", "p.nc")
    apt = "UNITS/MM\nFROM/0,0,50\nGOTO/0,0,0\nGOTO/40,0,0\nFINI\n"
    program = parse_program(apt, "p.apt", controller=control)
    assert np.allclose(program.moves.feed * 60e3, 300)
    assert "as asked for" in program.assumptions[-1]
    with pytest.raises(InputError, match="--feed MM_PER_MIN"):
        parse_program(apt, "p.apt")
