"""`tps check` tool by tool and operation by operation."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from toolpath_stiff.analysis.program_check import figures, operation_rows, tool_rows
from toolpath_stiff.cli.main import main
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.request import Request

TEXT = """(PLATE)
T1 M6 (ROUGHER)
G0 X0 Y0 Z5
G1 Z0 F600
X60
G4 P2
G0 Z5
(WALL)
G0 Y20
G1 Z0
G3 X0 I-30 J0
T2 M6
G0 Z50
G1 Y60
M30
"""


def parts(text: str, rapid_feed: float = 0.1):
    program = check(Request(tuple(text.split("\n")), "part.nc")).program
    return program, tool_rows(program, rapid_feed), operation_rows(program, rapid_feed)


def test_parts_by_hand():
    _, tools, operations = parts(TEXT)
    assert [(row["tool"], row["lengths_mm"]["cutting"]) for row in tools] == [
        (1, pytest.approx(65 + 5 + 30 * 3.141592653589793)),
        (2, pytest.approx(40)),
    ]
    rough, wall, last = operations
    assert [row["name"] for row in operations] == ["T1 ROUGHER", "WALL", "T2"]
    assert rough["times_s"] == pytest.approx({"cutting": 6.5, "rapid": 0.1, "dwell": 2.0, "total": 8.6})
    assert rough["extents_mm"] == {"x": [0, 60], "y": [0, 0], "z": [0, 5]}
    assert wall["extents_mm"]["y"] == pytest.approx([20, 50])  # half a circle of 30 mm, its bulge
    assert (last["first_line"], last["last_line"], last["tool"]) == (12, 14, 2)


@pytest.mark.parametrize(
    "program", sorted((Path(__file__).parents[2] / "programs").glob("[a-p]*.nc")), ids=lambda p: p.stem
)
def test_parts_make_the_whole(program):
    read, tools, operations = parts(program.read_text())
    whole = figures(read.moves, 0.1)
    for rows in (tools, operations):
        for key, total in (("lengths_mm", whole.lengths_mm), ("times_s", whole.times_s)):
            for name, value in total.items():
                assert sum(row[key][name] for row in rows) == pytest.approx(value, abs=1e-9)
        for axis in "xyz":
            ends = [row["extents_mm"][axis] for row in rows if row["extents_mm"]]
            assert [min(low for low, _ in ends), max(high for _, high in ends)] == whole.extents_mm[axis]


def test_nothing_to_tell_of_a_program_without_moves_or_cuts():
    assert parts("G41 D1 X5\n")[1:] == ((), ())
    _, tools, operations = parts("G0 X5\n")
    assert operations == ()
    assert tools[0]["extents_mm"] == {}
    assert tools[0]["lengths_mm"]["rapid"] == pytest.approx(5)


def test_the_command_prints_both(tmp_path, capsys):
    program = tmp_path / "part.nc"
    program.write_text(TEXT)
    assert main(["check", str(program), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in document["operations"]] == ["T1 ROUGHER", "WALL", "T2"]
    assert [row["tool"] for row in document["tools"]] == [1, 2]
    assert main(["check", str(program)]) == 0
    text = capsys.readouterr().out
    for row in document["operations"]:
        assert f"{row['operation']} {row['name']}" in text
        assert f"{row['first_line']}-{row['last_line']}" in text
    program.write_text("G1 X10 F100\nX0\n")
    assert main(["check", str(program)]) == 0
    assert "operation" not in capsys.readouterr().out  # one of them is the whole
    program.write_text(
        "G1 X10 F100\n" + "".join(f"(A NAME SO LONG THAT IT {'IS CUT ' * 20}{i})\nX{i}\n" for i in range(99))
    )
    assert main(["check", str(program)]) == 0
    table = capsys.readouterr().out
    assert "more operations in --json" in table
    assert max(len(line) for line in table.splitlines() if "NAME" in line) <= 100
