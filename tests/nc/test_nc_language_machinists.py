"""Additional offsets, local calls, block-delete switches, Fanuc's G10: what LinuxCNC has not, by hand."""

from __future__ import annotations

import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import Controller, dialect_named, read_controller
from toolpath_stiff.nc.program import Program
from toolpath_stiff.nc.reader import parse_program


def ends_mm(text: str, **options) -> list[tuple[float, ...]]:
    """Ends of the moves in the set-up frame, mm."""
    moves = parse_program(text, **options).moves
    return [tuple(round(v * 1e3, 6) for v in end[:3]) for end in moves.end]


def control(tmp_path, text: str) -> Controller:
    file = tmp_path / "control.toml"
    file.write_text(text)
    return read_controller(file)


ADDITIONAL = "G21 G90 F100\nG54.1 P3 G1 X1. Y2.\nG54 X0.\nM30\n"


@pytest.mark.parametrize("dialect", ["generic", "fanuc"])
@pytest.mark.parametrize("key", ["G54.1 P3", "G54.1P3", "G154 P3"])
def test_additional_offsets_are_the_controller_files(tmp_path, key, dialect):
    given = control(tmp_path, f'dialect = "{dialect}"\n[offsets]\nG54 = [1, 0, 0]\n"{key}" = [11, 20, 5]\n')
    assert ends_mm(ADDITIONAL, controller=given) == [(11.0, 22.0, 0.0), (0.0, 22.0, 0.0)]


def test_haas_has_them_as_g154(tmp_path):
    given = control(tmp_path, 'dialect = "haas"\n[offsets]\n"G154 P99" = [10, 20, 5]\n')
    assert ends_mm("G154 P99 G1 X1. F100.\nM30\n", controller=given) == [(11.0, 0.0, 0.0)]
    with pytest.raises(InputError, match=r"2:1: G54\.1 is not a code of the dialect haas"):
        parse_program("G1 X1. F100.\nG54.1 P1\nM30\n", controller=given)


def test_an_offsets_file_may_hold_them(tmp_path):
    from toolpath_stiff.nc.tables import read_offsets

    file = tmp_path / "offsets.txt"
    file.write_text("G54 = [1]\nG54.1 P2 = [5, 6, 7]\n")
    assert ends_mm("G54.1 P2\nG1 X1 F100\n", controller=Controller(offsets=read_offsets(file))) == [(5.0, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("text", "dialect", "message"),
    [
        ("G54.1 P3 G1 X1. F9.", "generic", r"G54.1 P3, an offset that nothing defines.*controller file"),
        ("G54.1 G1 X1. F9.", "fanuc", "needs the number of its offset"),
        ("G54.1 P301 X1.", "fanuc", "P1 to P300"),
        ("G154 P100 X1.", "haas", "P1 to P99"),
        ("G54.1 P1.5", "generic", "not a count"),
        ("G54.1 P3", "linuxcnc", "is not a code of the dialect linuxcnc"),
        ("G154 P3", "fanuc", "is not a code of the dialect fanuc"),
        ("G54 G54.1 P1", "generic", "work offset"),
    ],
)
def test_an_offset_that_is_not_known_is_refused(text, dialect, message):
    with pytest.raises(InputError, match=message):
        parse_program(f"{text}\nM30\n", controller=Controller(dialect_named(dialect)))


def test_a_controller_file_with_the_same_offset_twice_or_beyond_is_refused(tmp_path):
    with pytest.raises(InputError, match="twice"):
        control(tmp_path, '[offsets]\n"G54.1 P3" = [1]\n"G154 P3" = [2]\n')
    with pytest.raises(InputError, match="is not an offset"):
        control(tmp_path, '[offsets]\n"G154 P100" = [1]\n')


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_their_g10_sets_offsets_and_lengths(dialect):
    additional = "G54.1" if dialect == "fanuc" else "G154"
    text = (
        "G90 G21\nG10 L2 P1 X1. Y1.\nG10 L2 P2 X10. Y0.\nG10 L20 P7 X100. Z3.\nG10 L10 P4 R50.\n"
        f"G1 X0. Y0. F100.\nG55 X1.\n{additional} P7 X1. Z0.\nG43 H4 Z1.\nM30\n"
    )
    moves = ends_mm(text, controller=Controller(dialect_named(dialect)))
    # In the frame of G54, whose zero is at 1, 1, 0; Y keeps its number of G54 until it is programmed again.
    assert moves == [(0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (100.0, 0.0, 3.0), (100.0, 0.0, 4.0)]
    program = parse_program(text, controller=Controller(dialect_named(dialect)))
    assert program.moves.tool_length[-1] == pytest.approx(0.05)


@pytest.mark.parametrize("words", ["L2 P0 X1.", "L2 P7 X1.", "L2 P1 R5.", "L1 P1 Z5.", "L20 X1.", "L10 P1", "P1 R2."])
def test_their_other_g10_are_refused(words):
    """L2 P0 shifts all offsets there, and the active one on LinuxCNC; R turns on LinuxCNC alone."""
    with pytest.raises(InputError, match=r":2:"):
        parse_program(f"G1 X1. F100.\nG10 {words}\nM30\n", controller=Controller(dialect_named("fanuc")))
    with pytest.raises(InputError, match=r"G91"):
        parse_program("G91 G1 X1. F100.\nG10 L2 P1 X1.\nM30\n", controller=Controller(dialect_named("fanuc")))


HAAS = Controller(dialect_named("haas"))
LOCAL = "G91 G1 F100.\nM97 P100 L2\nY1.\nM30\nN100 X1.\nM97 P200\nM99\nN200 Z1.\nM99\n"


def test_m97_calls_a_block_by_its_number():
    ends = ends_mm(LOCAL, controller=HAAS)
    assert ends == [(1.0, 0.0, 0.0), (1.0, 0.0, 1.0), (2.0, 0.0, 1.0), (2.0, 0.0, 2.0), (2.0, 1.0, 2.0)]
    program = parse_program(LOCAL, controller=HAAS)
    assert list(program.moves.line) == [5, 8, 5, 8, 3] and not program.warnings


@pytest.mark.parametrize(
    ("text", "dialect", "message"),
    [
        (LOCAL, "generic", r"2:1: M97 is not a code .* haas. There it is call by line number.*--dialect"),
        (LOCAL, "linuxcnc", "M97 is not a code of the dialect linuxcnc"),
        (LOCAL.replace("P100", "P300"), "haas", "no block has"),
        (LOCAL.replace("N200", "N100"), "haas", "lines 5, 8"),
        (LOCAL.replace("P200", "P100"), "haas", "more than 10 subprograms within each other, N100"),
        (LOCAL.replace("P100", ""), "haas", "without P"),
        (LOCAL.replace("M99\nN200", "N200").replace("Z1.\nM99", "Z1."), "haas", "has no end"),
        (LOCAL.replace("L2", "L10000"), "haas", "repeats"),
    ],
)
def test_an_m97_that_cannot_be_followed_is_refused(text, dialect, message):
    with pytest.raises(InputError, match=message):
        parse_program(text, controller=Controller(dialect_named(dialect)))


def test_m61_names_the_tool_and_leaves_what_is_selected():
    """As rs274 does: M6 takes the tool of the last T."""
    program = parse_program("F100 T2\nM61 Q5\nG1 X1\nM6\nG1 X2\nM2\n")
    assert list(program.moves.tool) == [5, 2]


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_h0_is_no_offset_there(dialect):
    text = "G90 F100. G10 L10 P1 R20.\nG43 H1\nG1 X1. Z1.\nG43 H0 Z2.\nM30\n"
    moves = parse_program(text, controller=Controller(dialect_named(dialect))).moves
    assert moves.start[1, 2] == pytest.approx(0.021) and moves.end[1, 2] == pytest.approx(0.002)


SWITCHED = "G1 X1 F100\n/X2\n/1 X3\n/2 X4\n/ 3 X5\nM30\n"


@pytest.mark.parametrize(
    ("switches", "kept"),
    [(False, [1, 2, 3, 4, 5]), (True, [1]), ({1}, [1, 4, 5]), ({2, 3}, [1, 2, 3]), ((), [1, 2, 3, 4, 5])],
)
def test_block_delete_by_switches(switches, kept):
    program = Program.from_text(SWITCHED, block_delete=switches)
    assert [round(x) for x in program.to_frame()["end_x_mm"]] == kept


def test_switches_that_are_asked_for_win_over_the_controller_file(tmp_path):
    given = control(tmp_path, "block_delete = [2]\n")
    assert [x for x, _, _ in ends_mm(SWITCHED, controller=given)] == [1, 2, 3, 5]
    program = Program.from_text(SWITCHED, controller=tmp_path / "control.toml", block_delete=[3])
    assert [round(x) for x in program.to_frame()["end_x_mm"]] == [1, 2, 3, 4]


def test_single_switches_are_not_for_linuxcnc():
    with pytest.raises(InputError, match="single block-delete switches"):
        parse_program(SWITCHED, controller=Controller(switches=frozenset({2})), interpreter="linuxcnc")


@pytest.mark.parametrize(
    ("options", "length"),
    [
        ([], 5.0),
        (["--block-delete"], 1.0),
        (["--block-delete", "2,3"], 3.0),
        (["--block-delete=1"], 5.0),
    ],
)
def test_the_option_with_and_without_switches(tmp_path, capsys, options, length):
    import json

    from toolpath_stiff.cli.main import main

    file = tmp_path / "part.nc"
    file.write_text(SWITCHED)
    for arguments in ([*options, str(file)], [str(file), *options]):
        assert main(["check", *arguments, "--machine", "none", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["lengths_mm"]["cutting"] == pytest.approx(length)
    assert main(["check", str(file), "--block-delete=0"]) == 2
