"""The same words on different controls; what a control's file says; other languages refused by name."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.controller import DIALECTS, Controller, read_controller
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.rewriting.program import rewrite_program

PLAIN, LINUXCNC, FANUC, HAAS = (Controller(DIALECTS[name]) for name in ("generic", "linuxcnc", "fanuc", "haas"))


def moves_of(text: str, controller: Controller = PLAIN):
    return parse_program(text, "part.nc", controller=controller).moves


def ends_mm(text: str, controller: Controller = PLAIN) -> list[list[float]]:
    return [[round(float(v), 7) + 0.0 for v in 1e3 * end[:3]] for end in moves_of(text, controller).end]


@given(st.lists(st.integers(-99999, 99999).filter(bool), min_size=3, max_size=9, unique=True), st.booleans())
def test_without_a_point_fanuc_and_haas_count_increments(numbers, inch):
    """IS-B: X10 is 0.01 mm or 0.001 inch, as X0.01 and X0.001 say it; angles 0.001 degrees."""
    unit, decimals = ("G20", 4) if inch else ("G21", 3)
    counted = "".join(f"X{n} Y{-n} Z{n} A{n} C{-n}\n" for n in numbers)
    spelt = "".join(
        f"X{n / 10**decimals:.4f} Y{-n / 10**decimals:.4f} Z{n / 10**decimals:.4f} A{n / 1e3:.3f} C{-n / 1e3:.3f}\n"
        for n in numbers
    )
    for control in (FANUC, HAAS):
        one, other = (moves_of(f"{unit} G1 F10.\n{body}", control) for body in (counted, spelt))
        np.testing.assert_allclose(one.end, other.end, rtol=1e-15)
    np.testing.assert_array_equal(
        moves_of(f"{unit} G1 F10.\n{spelt}").end, moves_of(f"{unit} G1 F10.\n{spelt}", FANUC).end
    )


def test_the_rule_holds_for_centres_radii_cycles_and_angles():
    text = "G1 F100. X10. Y0.\nG3 X0. Y10. {}\nG98 G83 X5. Z{} R{} Q{}\nG80\nG0 Z9.\nG68 X0. Y0. R{}\nG1 X1. Y0.\nG69"
    counted = moves_of(text.format("I-10000", "-3000", "2000", "1000", "90000"), FANUC)
    spelt = moves_of(text.format("I-10.", "-3.", "2.", "1.", "90."), FANUC)
    np.testing.assert_array_equal(counted.end, spelt.end)
    np.testing.assert_allclose(counted.end[-1, :2], [0, 0.001], atol=1e-15)
    assert ends_mm("G16 G1 F100. X10000 Y90000", FANUC) == [[0, 10, 0]]


def test_what_was_counted_is_said_and_a_mixed_program_is_warned_of():
    assert any("0.001 mm" in a and "fanuc" in a for a in parse_program("G1 F100. X10", controller=FANUC).assumptions)
    assert not any("fanuc" in a for a in parse_program("G1 F100. X10.", controller=FANUC).assumptions)
    mixed = [*map(str, parse_program("G1 F100 X10.\nX0\nY20\nX5.\nZ3").warnings)]
    assert [w for w in mixed if "line 3: " in w and "Y20" in w and "--dialect" in w]
    assert not any("--dialect" in w for w in map(str, parse_program("G1 F100 X10.\nX0\nY2.5\nX0.").warnings))
    assert not any("--dialect" in w for w in map(str, parse_program("G1 F100 X10\nX0\nY20\nX5.5").warnings))


@pytest.mark.parametrize(
    ("text", "controller", "seconds"),
    [
        ("G4 P2", PLAIN, 2.0),
        ("G4 P2", LINUXCNC, 2.0),
        ("G4 P1500", FANUC, 1.5),
        ("G4 X1.5", FANUC, 1.5),
        ("G20 G4 X1500", FANUC, 1.5),
        ("G4 P1500", HAAS, 1.5),
        ("G4 P1.5", HAAS, 1.5),
        ("G4 S2", PLAIN, 2.0),  # Marlin
        ("G4 X1.5", PLAIN, 1.5),  # Fanuc
        ("G4", PLAIN, 0.0),  # an exact stop (Fanuc)
        ("G4", FANUC, 0.0),
        ("G82 Z-1. R1. P500", FANUC, 0.5),
        ("G82 Z-1. R1. P0.5", PLAIN, 0.5),
    ],
)
def test_times_of_dwells(text, controller, seconds):
    assert moves_of(f"G1 F10. X1.\n{text} {'X2.' if 'G82' in text else ''}", controller).dwell.max() == seconds


def test_cycles_start_at_the_initial_level_on_fanuc_and_keep_their_heights():
    text = "G0 Z20.\nF100.\nG81 X5. Y0. Z-3. R2.\n{}X5.\nG80"
    assert ends_mm(text.format(""), FANUC)[-1][2] == 20
    assert ends_mm(text.format(""))[-1][2] == 2
    assert min(z for _, _, z in ends_mm(text.format("G91 "), FANUC)) == -3
    # LinuxCNC reads R and Z anew: the hole goes 3 mm down from 2 mm above the level of 20.
    assert ends_mm("G99 " + text.format("G91 "), LINUXCNC)[-2][2] == 19
    with pytest.raises(InputError, match="controls differ"):
        moves_of(text.format("G91 "))
    bolts = "G98 G16 F100\nG0 Z20.\nG81 X50. Y0. Z-3. R2.\nG91 Y60. L2\nG80 G15"
    assert min(z for _, _, z in ends_mm(bolts)) == -3


def test_fanuc_counts_holes_with_k():
    text = "G91 G99 G81 X5. Z-3. R-2. {} F100.\nG80"
    assert ends_mm(text.format("K3"), FANUC) == ends_mm(text.format("L3"))
    with pytest.raises(InputError, match="not used"):
        moves_of(text.format("K3"))


def test_g70_and_g71():
    assert ends_mm("G70 G1 F1. X1.", FANUC) == [[25.4, 0, 0]]
    assert ends_mm("N20 G70 G91.1\nG1 F1. X1.", PLAIN) == [[25.4, 0, 0]]  # Mach3's posts
    for controller, text, words in (
        (PLAIN, "G71 P5", "on some controls"), (LINUXCNC, "G71", "dialect linuxcnc"), (HAAS, "G71", "dialect haas"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            moves_of(f"{text}\nG1 F1. X1.", controller)


def test_subprograms_with_repeats_in_p():
    text = "G91 G1 F10. X1.\nM98 P{}\nM30\nO1000\nY1.\nM99\nO21000\nZ1.\nM99"
    assert ends_mm(text.format(21000), FANUC)[-1] == [1, 2, 0]
    assert ends_mm(text.format(21000), HAAS)[-1] == [1, 0, 1]


@pytest.mark.parametrize(
    ("text", "controller", "words"),
    [
        ("G1 X1. F10", HAAS, "parameters"),
        ("G20 G1 X1. F10", FANUC, "parameters"),
        ("G4 P1.5", FANUC, "decimal point"),
        ("G4 X2", PLAIN, "X2. alone, for seconds"),
        ("G4 X2. Y3", PLAIN, "X2. alone, for seconds"),
        ("G4 S2", LINUXCNC, "needs its time"),
        ("G4", LINUXCNC, "needs its time"),
        ("%00229", PLAIN, "`%` among other words"),
        ("%00229", HAAS, "`%` among other words"),
        ("M98 Q10\nM30\nN10 M99", PLAIN, "Q10 beside M98 .*a subprogram of its own"),
        ("M98 P5 Q10\nM30\nO5\nX1.\nN10 M99", FANUC, "Q10 beside M98 .* a subprogram of its own"),
        ("G1 X1. F10. ; G1 X2.", FANUC, "ends the block"),
        ("/0 G1 X1 F10", PLAIN, "block-delete switch"),
        ("/12 G1 X1 F10", PLAIN, "block-delete switch"),
    ],
)
def test_refusals_of_a_dialect(text, controller, words):
    with pytest.raises(InputError, match=words):
        parse_program(text + "\nG1 F10. X3.", "part.nc", controller=controller)


def test_numbers_in_increments_that_look_like_millimetres():
    arc = "G0 X10 Y5\nG1 F100. X30\nG2 X40.5 Y15.5 R10.5\nM30\n"
    with pytest.raises(InputError, match=r"cannot reach .* without a point are read in 0\.001 mm .--dialect fanuc"):
        parse_program(arc, "p.nc", controller=FANUC)
    with pytest.raises(InputError) as pointed:
        parse_program("G1 F100. X1.\nG2 X40.5 Y15.5 R10.5\n", "p.nc", controller=FANUC)
    assert not pointed.value.hint
    for text, warned in ((".5", True), (".", False), ("", False)):
        lines = f"G1 F100. X10 (Y5.5)\nY20{text}\n"
        warnings = [*map(str, parse_program(lines, "p.nc", controller=FANUC).warnings)]
        assert any("X10 stands beside numbers with decimals" in w for w in warnings) is warned
        findings = check(Request(tuple(lines.splitlines()), "p.nc", controller=FANUC)).findings
        assert any("X10 stands beside numbers with decimals" in f.text for f in findings) is warned


def test_a_controller_file(tmp_path):
    (tmp_path / "g55.var").write_text("5221 10\n5241 100\n")
    path = tmp_path / "control.toml"
    path.write_text(
        'dialect = "haas"\narc_centers = "absolute"\ninch_metric = "G70 G71"\nblock_delete = [2]\n'
        'offsets = "g55.var"\n[[tools]]\nnumber = 3\nlength_mm = 120.5\ndiameter_mm = 6\nstick_out_mm = 40.0\n'
        'material = "carbide"\nremark = "end mill"\n'
    )
    program = tmp_path / "part.nc"
    program.write_text(
        "G71 T3 M6\nG43 H3\nG0 X10. Y5.\nG3 F100. X0. Y15. I0. J5.\n/2 X99.\n/G1 X1. Y1.\nG55 G1 X0. Y0.\nM30\n"
    )
    read = read_program(program, controller=read_controller(path))
    assert read.moves.tool_length[-1] == pytest.approx(0.1205)
    assert read.moves.line.tolist() == [3, 4, 6, 7]
    assert read.moves.arc_center[1, :2] == pytest.approx([0.0, 0.005])
    assert read.moves.end[-1, 0] == pytest.approx(0.09)
    (tool,) = read.tools
    assert (tool.number, tool.stick_out, tool.material, tool.remark) == (3, 40.0, "carbide", "end mill")
    assert read.dialect.startswith("haas, changed")
    assert read_program(program, controller=read_controller(path, "linuxcnc")).dialect.startswith("linuxcnc, changed")
    with pytest.raises(InputError, match="without --write"):
        rewrite_program(read, (0.0,) * 6, (0.0,) * 6)
    with pytest.raises(InputError, match="its own dialect only"):
        read_program(program, controller=read_controller(path), interpreter="linuxcnc")


def test_inline_offsets_and_linuxcnc_s_own_files(tmp_path):
    path = tmp_path / "control.toml"
    path.write_text(
        "block_delete = true\n[offsets]\nG54 = [1, 2, 3]\nG55 = [101, 2, 3, 0, 0, 0, 90]\nG28 = [0, 0, 9]\n"
    )
    program = parse_program("G1 F1 X1\n/3 X7\nG55 X1 Y0", controller=read_controller(path))
    assert program.origin[:3] == pytest.approx((0.001, 0.002, 0.003))
    assert program.moves.end[-1, :2] == pytest.approx([0.1, 0.001])
    table = tmp_path / "tool.tbl"
    table.write_text("T1 P1 Z50 D6 ;mill\n")
    control = read_controller(table)
    assert control.dialect.name == "linuxcnc" and control.tools[1].length == 50.0
    (tmp_path / "a.var").write_text("5221 12.5\n")
    assert read_controller(tmp_path / "a.var").offsets.table[0].axes[0] == 12.5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("dialect = ", "not TOML"),
        ('dialect = "mazak"', "generic or linuxcnc or fanuc or haas"),
        ("dialect = 3", "generic or linuxcnc"),
        ("colour = 3", "'colour' is not known"),
        ('kinematics = "table-table"', "a table .kinematics"),
        ("block_delete = [0]", "switches 1 to 9"),
        ("block_delete = [true]", "switches 1 to 9"),
        ("offsets = 3", "a table G54"),
        ("[offsets]\nG60 = [1]", "not an offset"),
        ("[offsets]\nG54 = []", "1 to 7 numbers"),
        ('[offsets]\nG54 = ["a"]', "a number within"),
        ("[offsets]\nG54 = [nan]", "a number within"),
        ("tools = 3", "list of tables"),
        ("[[tools]]\nlength_mm = 3", "a whole number"),
        ("[[tools]]\nnumber = 1\nlength = 3", "length is not known"),
        ("[[tools]]\nnumber = 1\n[[tools]]\nnumber = 1", "appears twice"),
        ("[[tools]]\nnumber = 1\ndiameter_mm = 0", "more than 0"),
        ("[[tools]]\nnumber = 1\nmaterial = 3", "expected texts"),
        ('offsets = "nothing.var"', "cannot read"),
    ],
)
def test_bad_controller_files(tmp_path, text, words):
    path = tmp_path / "control.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_controller(path)


def test_the_options_of_the_command_line(tmp_path, capsys):
    program = tmp_path / "part.nc"
    program.write_text("G1 F100 X10000\nX0.\n")
    control = tmp_path / "control.toml"
    control.write_text('dialect = "fanuc"\n')
    lines = []
    for options in (["--dialect", "fanuc"], ["--controller", str(control)]):
        assert main(["path", str(program), "--step", "5", *options]) == 0
        lines.append(capsys.readouterr().out)
    assert lines[0] == lines[1] and ",10.0" in lines[0].replace("10,", "10.0,")
    control.write_text("dialect = 3\n")
    assert main(["path", str(program), "--controller", str(control)]) == 2
    assert "control.toml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "language", "line"),
    [
        ("G0 X1\n" * 60 + "5 L X+10 Y+5 R0 FMAX\n", "Heidenhain", 61),
        ("G21\nN10 #SLOPE[TYPE=STEP]\n", "ISG", 2),
        ("%PLATE G71 *\nN10 G01 X+10 F200 *\n", "DIN/ISO", 1),
        ("SLOPE[TYPE=HSC]\n", "ISG", 1),
        (': (PGM, NAME="1001")\n: G90 G40 G94\n', "Acramatic", 1),
        ("sub _tool_change[#tool] {\nG90\n}\n", "neither LinuxCNC's", 1),
    ],
)
def test_other_languages_are_refused_by_name(text, language, line):
    with pytest.raises(InputError, match=language) as caught:
        parse_program(text, "part.nc")
    assert caught.value.line == line and "as ISO G code" in str(caught.value)


@given(st.text("GXYZABCIJKRLMFSTN0123456789.+- ()=;%/:", max_size=30) | st.sampled_from(["F=0", "TRANS", "R1=2"]))
def test_plain_g_code_is_not_taken_for_another_language(noise):
    from toolpath_stiff.nc.languages import language_of

    for line in ("N10 G1 X+10. Y-5. F100", "(L X+10 FMAX)", "; MSG(", "%", "O1234 (DEF REAL)", "T1 M6", "S1000 M3"):
        assert language_of(line) is None
    if language_of(noise) is not None:  # then it is no block of G code either
        with pytest.raises(InputError):
            read_block(noise, 1, "part.nc")
