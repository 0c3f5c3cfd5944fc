"""Numbers, lines, files without end: each is refused with its place, and no reading takes time by the square."""

import contextlib
import re
import time

import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.languages import language_of
from toolpath_stiff.nc.lines import LARGEST_FILE, LONGEST_LINE
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.tables import read_offsets, read_tool_table

HEAD = "G21 G90 F600\nG1 X5\n"


@pytest.mark.parametrize(
    ("block", "place", "found"),
    [
        ("T99999999999999999999 M6", "3:1", "beyond any number that a control takes"),
        ("M61 Q99999999999999999999", "3:5", "beyond any number"),
        ("G2 X10 Y0 I1e200 J0", "3:11", "beyond any number"),
        ("G2 X10 Y0 I1e160 J0", "3:11", "beyond any number"),
        ("G2 X1 Y0 R1e300", "3:10", "beyond any number"),
        ("G81 X1 Z-1 R1e308", "3:12", "beyond any number"),
        ("G1 X1 F1e308", "3:7", "beyond any number"),
        ("G1 X1 F1e-320", "3:7", "no feed that moves"),
        ("G95 S1e-9 F1\nG1 X1", "4:1", "with the spindle at S1e-09"),
        ("G10 L1 P99999999999999999999 Z1", "3:8", "beyond any number"),
        ("G43 H99999999999999999999", "3:5", "beyond any number"),
        ("G68 X0 Y0 R1e308", "3:11", "beyond any number"),
        ("O" + "1" * 100, "3:1", "a program number of 100 digits"),
        ("M98 P" + "1" * 150, "3:5", "is beyond any number"),
        ("/" + "1" * 100 + " G1 X1", "3:1", "block-delete switch"),
        ("O" + "1" * 5000, "3", "a block of 5001 characters"),
        ("G1 " + "X1" * 3000, "3", "a block of 6002 characters"),
        ("G1 X" + "0" * 16_000 + "1", "3", "a line of 16005 characters"),
        ("G1 X1 (" + "c" * 20_000 + ")", "3", "a line of 20008 characters"),
    ],
)
def test_numbers_beyond_all_controls_are_refused_with_their_place(block, place, found):
    with pytest.raises(InputError, match=found) as caught:
        parse_program(f"{HEAD}{block}\nG1 X9\nM30\n", "p.nc")
    assert str(caught.value).startswith(f"p.nc:{place}:")
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("word", ["I1e200", "R1e300", "F1e308"])
def test_many_lines_at_a_time_refuse_them_alike(word):
    plain = "".join(f"G1 X{i}.5 Y1.5\n" for i in range(60))
    word = word.replace("e", "0" * 20 + ".")  # an exponent is not plain
    block = f"G1 X1.5 {word}" if word[0] == "F" else f"G2 X10.5 Y0. {word}"
    with pytest.raises(InputError, match="beyond any number") as caught:
        parse_program(f"{HEAD}{plain}{block}\n{plain}", "p.nc")
    assert caught.value.line == 63


@pytest.mark.parametrize("lines", [1, 60])
def test_an_arc_that_leaves_every_machine_is_refused_before_it_is_sampled(lines):
    """Its ends lie where the program's do; of an outside program with a slip of unit in its I and K."""
    plain = "".join(f"G1 X{i}.5 Y1.5\n" for i in range(lines))
    with pytest.raises(InputError, match=r"goes 2e\+06 mm away from its start; expected at most 100000 mm") as caught:
        parse_program(f"{HEAD}{plain}G3 Y1.6 I1000000 J0\n{plain}", "p.nc")
    assert caught.value.line == lines + 3
    nearly_straight = parse_program(f"{HEAD}{plain}G2 X{lines}.5 Y1.5 R1000000\n", "p.nc")
    assert nearly_straight.moves.arc_sweep[-1] == pytest.approx(-1e-6, rel=1e-3)


def test_a_tab_within_a_word_is_a_blank_to_both_ways_of_reading():
    lines = [HEAD.strip(), *(f"G1 X\t{i}5 Y 1 {i}." for i in range(1, 60))]
    many = parse_program("\n".join(lines), "p.nc")
    blanks = parse_program("\n".join(lines).replace("\t", " "), "p.nc")
    assert many.moves.end[-1, 0] == pytest.approx(0.595)
    assert [re.sub(r"\s", "", text) for text in map(str, many.warnings)] == [
        re.sub(r"\s", "", t) for t in map(str, blanks.warnings)
    ]
    assert (many.moves.end == blanks.moves.end).all()


def seconds(text: str, tries: int = 2) -> float:
    """Processor time of reading a program, whether it is refused or not; the least of some."""
    found = []
    for _ in range(tries):
        before = time.process_time()
        with contextlib.suppress(InputError):
            parse_program(text, "p.nc")
        found.append(time.process_time() - before)
    return min(found)


# What took time by the square or the cube of its length: digits, blanks, words, comments, programs with many calls.
SLOW = {
    "digits": lambda n: "G1 X" + "0" * n + "1",
    "digits that end in a letter": lambda n: "\n".join(["G1 X" + "1" * n + "Q"] * 60),
    "blanks": lambda n: " " * n + "/" + " " * n + "O1 X",
    "comments": lambda n: "\n".join(["()" * (n // 2) + "Q"] * 60),
    "words of another language": lambda n: "A1 " * (n // 3),
}


@pytest.mark.parametrize("kind", SLOW)
def test_the_longest_line_costs_no_more_than_a_fraction_of_a_second(kind):
    assert seconds(f"{HEAD}{SLOW[kind](LONGEST_LINE // 2 - 20)}\n") < 1.0


def test_titles_before_many_calls_are_passed_once():
    calls = "M98 P7\n" * 400
    program = "{}" + HEAD + calls + "M30\nO7\nG1 X1\nG1 X2\nM99\n"
    short, long = (seconds(program.format("(title)\n" * n)) for n in (10, 4000))
    assert long < 3.0 * short + 0.2


def test_other_languages_are_looked_for_at_the_beginning_of_a_line():
    assert language_of("A1 " * 100_000) is None
    assert language_of("X1 Y1 X=5") is not None
    assert language_of('X1 Y1 T = "MILL"') is not None


def test_a_file_beyond_all_programs_is_refused(tmp_path):
    huge = tmp_path / "huge.nc"
    with huge.open("wb") as stream:
        stream.truncate(LARGEST_FILE + 1)  # sparse
    with pytest.raises(InputError, match="too large to be read; expected an NC program of at most 512 MB"):
        read_program(huge)
    with pytest.raises(InputError, match="cannot read"):
        read_program("a\0b.nc")


def test_check_names_each_of_them():
    lines = ("G21 G90 F600", "G1 X5", "T99999999999999999999 M6", "G2 X10 Y0 I1e200 J0", "G1 X6")
    checked = check(Request(lines, "p.nc"))
    assert [(finding.line, finding.severity) for finding in checked.findings][-2:] == [(3, "error"), (4, "error")]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("T² P1 Z50\n", "is not a tool"),
        (f"T{'1' * 5000} P1 Z50\n", "is not a tool"),
        (f"tool,length_mm\n1,{'5' * 140_000}\n", "not a CSV file"),
    ],
)
def test_tool_tables_without_end(tmp_path, text, found):
    file = tmp_path / "tools.tbl"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=found) as caught:
        read_tool_table(file)
    assert caught.value.line == len(text.splitlines())
    assert len(str(caught.value)) < 400


def test_offsets_without_end(tmp_path):
    file = tmp_path / "offsets.var"
    file.write_text(f"{'5' * 5000} 1.0\n", encoding="utf-8")
    with pytest.raises(InputError, match="is not TOML") as caught:
        read_offsets(file)
    assert caught.value.line == 1
