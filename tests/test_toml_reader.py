"""Errors of TOML files name the line of what is wrong: keys, tables in lists, keys in quotes, tables on one line."""

from __future__ import annotations

import pytest

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import read_controller
from toolpath_stiff.toml_reader import TomlReader

TEXT = """dialect = "haas"
[[tools]]
number = 1
length_mm = 100.0
[[tools]]
number = 2
[offsets]
"G54.1 P1" = [1, 2, 3]
G54 = [1.0]
[kinematics]
type = "table"
head = { letter = "A" }
"""


@pytest.mark.parametrize(
    ("where", "line"),
    [
        ("dialect", 1),
        ("tools[1].number", 3),
        ("tools[2].number", 6),
        ("tools[2].length_mm", 5),  # missing: the table's heading
        ("tools[2]", 5),
        ("offsets", 7),
        ("offsets.G54.1 P1", 8),
        ("offsets.G54", 9),
        ("kinematics.type", 11),
        ("kinematics.head.letter", 12),
        ("kinematics.tcp", 10),
        ("nothing", None),
    ],
)
def test_the_line_of_a_dotted_name(where, line):
    assert TomlReader(TEXT, "control.toml").line_at(where) == line


def test_rows_of_arrays_are_no_headings_and_headings_may_hold_blanks():
    text = """[joints]
mm = [
    [1.5],
    [-2],
]
origin = "guessed"
[ kinematics . head ]
letter = "A"
['G54']
"""
    file = TomlReader(text, "mine.toml")
    found = [file.line_at(where) for where in ("joints.origin", "kinematics.head.letter", "kinematics", "G54")]
    assert found == [6, 8, 7, 9]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"haas"', '"hass"', "1: dialect = 'hass'; expected generic or linuxcnc or fanuc or haas"),
        ("[1, 2, 3]", '[1, "2"]', "8: offsets.G54.1 P1 = '2'; expected a number within"),
        ("number = 2", "number = 1", "6: tools[2]: tool 1 appears twice"),
        ("number = 2", "number = true", "5: tools[2]: tool number True; expected a whole number"),
        ("head =", "hand =", "12: kinematics.hand is not known in the type 'table'; expected type, tcp"),
        ("[1.0]", "[1.0", "10:1: the controller file is not TOML: "),
    ],
)
def test_a_controller_file_names_the_line(tmp_path, old, new, message):
    file = tmp_path / "control.toml"
    file.write_text(TEXT.replace(old, new), "utf-8")
    with pytest.raises(InputError) as caught:
        read_controller(file)
    assert str(caught.value).startswith(f"{file}:{message}")


def test_a_file_that_is_no_text_is_refused(tmp_path):
    file = tmp_path / "control.toml"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="the controller file is not a text file"):
        TomlReader.read(file, "the controller file")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = 1\nb = 1" + "0" * 20_000 + "\n", "x.toml:2: not valid TOML: Exceeds the limit"),
        ("a = 1\nb = " + "[" * 90_000 + "\n", "x.toml:2: not valid TOML: maximum recursion depth"),
        ("#" * 4_000_001, "more than 4 MB"),
    ],
    ids=["20000 digits", "90000", "size"],
)
def test_what_no_number_or_reader_can_hold_is_refused(text, message):
    with pytest.raises(InputError) as error:
        TomlReader(text, "x.toml")
    assert message in str(error.value) and len(str(error.value)) < 3000
