"""Cutter-location files through the commands, the sample file, operations, and mutated files."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path

import numpy as np
import pytest

from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.cutter_location import reader as cutter_location
from toolpath_stiff.nc.languages import looks_like_cutter_location
from toolpath_stiff.nc.moves import ARC, CYCLE, FEED
from toolpath_stiff.nc.operations import operations
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.nc.request import Request
from toolpath_stiff.rewriting.offset_blocks import offset_blocks
from toolpath_stiff.rotations import rotation_matrices

FOLDER = Path(__file__).parents[2] / "programs"
SAMPLE = FOLDER / "conical_boss.apt"
SLOT = "UNITS/MM\nMULTAX/ON\nFEDRAT/500,MMPM\nGOTO/0,0,5,0,0,1\nGOTO/0,0,-1\nGOTO/20,0,-1,0.2588190,0,0.9659258\nFINI\n"


def test_sample_has_the_lengths_of_its_geometry():
    program = read_program(SAMPLE)
    moves, length = program.moves, move_lengths(program.moves) * 1e3
    assert length[moves.motion == ARC].sum() == pytest.approx(math.tau * 15)
    assert length[moves.motion == CYCLE].sum() == pytest.approx(4 * (18 + 2 + 3 * 0.254))  # 4 holes, 4 pecks each
    sides = 2 * 24 * math.sin(math.pi / 24)  # of a polygon about a circle of radius 1
    wall = (moves.tool == 8) & (moves.motion == FEED) & (moves.start[:, 2] == moves.end[:, 2])
    assert length[wall].sum() == pytest.approx(sides * (40 + 41.7) + 4 * 8, abs=1e-3)
    lean = np.degrees(np.arccos(rotation_matrices(moves.end[wall, 3:])[:, 2, 2]))
    np.testing.assert_allclose(lean, 12, atol=1e-3)
    assert not program.warnings and [tool.number for tool in program.tools] == [8, 9, 10]
    np.testing.assert_allclose([tool.length for tool in program.tools], [120.0, 95.0, 130.0])


def test_long_files_give_the_same_moves(monkeypatch):
    """Moves are packed now and then; pauses, tools and arcs go on over that."""
    text = SAMPLE.read_text().replace("RAPID\n", "DELAY/1\nRAPID\n")
    whole = parse_program(text, "part.apt").moves
    monkeypatch.setattr(cutter_location, "PACKED_AT", 1)
    packed = parse_program(text, "part.apt").moves
    for column in vars(whole):
        np.testing.assert_array_equal(getattr(packed, column), getattr(whole, column))


def test_operations_are_those_of_the_file():
    """CATIA names them in comments, NX in TOOL PATH/."""
    names = [row.name for row in operations(read_program(SAMPLE)).rows]
    assert names == ["WALL, 2 ROUNDS", "GROOVE IN THE TOP", "4 HOLES"]
    path = (
        "TOOL PATH/{},TOOL,MILL_D10\nTLDATA/MILL,10.0,0.0,50.0\nRAPID\nGOTO/0,0,9\nFEDRAT/MMPM,100.\nGOTO/0,0,1\n"
        "END-OF-PATH\n"
    )
    nx = parse_program(path.format("FACE_1") + path.format("POCKET_2"), "part.cls")
    assert [row.name for row in operations(nx).rows] == ["FACE_1", "POCKET_2"]
    other = parse_program(path.format("A") + path.format("B").replace("D10", "D6"), "part.cls")
    assert other.tools[0].remark == "several tools without numbers"
    assert nx.tools[0].remark == "MILL_D10" and nx.tools[0].diameter == pytest.approx(10.0)


def test_commands_take_it(tmp_path, capsys):
    assert main(["analyze", str(SAMPLE), "--no-plots", "--json", "--out", str(tmp_path / "out")]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["warnings"] == [] and summary["out_of_reach_samples"] == 0
    assert any("yaw" in text for text in summary["assumptions"])
    assert main(["path", str(SAMPLE), "--step", "5", "--out", str(tmp_path / "path.csv")]) == 0
    assert "PARTNO" in capsys.readouterr().err
    assert main(["check", str(SAMPLE), "--json"]) == 0
    checked = json.loads(capsys.readouterr().out)
    assert checked["dialect"] == "cutter-location file" and checked["complete"]
    assert checked["times_s"]["cutting"] > 0
    counts = {row["code"]: (row["line"], row["count"]) for row in checked["used"]}
    assert counts["CIRCLE"][1] == 2 and counts["GOTO"] == (13, 67)


def test_a_placement_is_not_written_into_it(tmp_path, capsys):
    """Refused before the search; nor are there offsets to key in, and the reason does not send one to --write."""
    program, written = tmp_path / "slot.apt", tmp_path / "placed.apt"
    program.write_text(SLOT)
    out = tmp_path / "out"
    assert main(["place", str(program), "--rotate", "30", "--out", str(out), "--write", str(written)]) == 2
    assert "for a post processor (a cutter-location file)" in capsys.readouterr().err
    assert not written.exists() and not out.exists()
    blocks = offset_blocks(read_program(program), (0.1, 0, 0.8, 0, 0, 0.5))
    assert not blocks.linuxcnc and "posted from it" in blocks.linuxcnc_reason


def test_second_interpreter_refuses_and_auto_reads(tmp_path, capsys):
    program = tmp_path / "slot.txt"
    program.write_text(SLOT)
    assert main(["path", str(program), "--interpreter", "linuxcnc"]) == 2
    error = capsys.readouterr().err
    assert "reads no cutter-location files" in error and error.count("tps: error") == 1
    assert main(["path", str(program), "--interpreter", "auto"]) == 0


def test_what_belongs_to_a_control_is_warned_about(tmp_path):
    program = parse_program(SLOT, controller=Controller(DIALECTS["fanuc"], frozenset({1})))
    assert len(program.warnings) == 2 and "dialect" in str(program.warnings[0])
    assert program.origin_source == "default"
    placed = parse_program(SLOT, origin=(0.1, 0, 0.8, 0, 0, 0.5))
    assert placed.origin == (0.1, 0, 0.8, 0, 0, 0.5) and placed.origin_source == "option"


@pytest.mark.parametrize(
    "head",
    [
        "PARTNO X\n", "PPRINT/'x'\n", "MULTAX\n", "UNITS / MM\n", "TOOL PATH/A,TOOL,B\n", "N1 GOTO/1,2,3\n", "RAPID\n",
        "$$ many\n" * 80 + "GOTO / 1,2,3\n",
    ],
)  # fmt: skip
def test_recognised_by_how_it_begins(head):
    assert looks_like_cutter_location(tuple(head.splitlines()), "part.txt")


@pytest.mark.parametrize(
    "text",
    [
        "%\nO1 (GOTO/1,2,3)\nG1 X1\n",
        "G0 X1\nIF [#1 GT 1] GOTO 10\n",
        "(PARTNO 5)\nG1 X2\n",
        "; RAPID\nM30\n",
        "TRANS X10\n",
    ],
)
def test_g_code_is_not_taken_for_one(text):
    assert not looks_like_cutter_location(tuple(text.splitlines()), "part.nc")


def test_check_goes_on_after_errors():
    text = SLOT.replace("FINI\n", "COPY/1\nGOTO/1,x,0\nTLRGT\nGOTO/9,9,9\nCIRCLE/0,9,9,0,0,1,9\n")
    checked = check(Request(tuple(text.splitlines()), "part.apt"))
    errors = [finding for finding in checked.findings if finding.severity == "error"]
    assert [finding.line for finding in errors] == [7, 8, 9, 11] and not checked.complete
    assert checked.program.moves.line[-1] == 10


def test_mutated_files_are_read_or_refused_with_their_line():
    """Bytes dropped, doubled, swapped; seeded. The benchmark `benchmarks.mutations` does more of them."""
    lines = SAMPLE.read_bytes().splitlines(keepends=True)
    arcs = b"GOTO/5,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,2,INTOF,$\n(LINE/0,0,0,0,-5,0)\n"
    original = b"".join([*lines[:24], *lines[-45:-4], arcs, b"MOVARC/0,0,0,0,0,1,5,ANGLE,90\nGOTO/5,0,0\nFINI\n"])
    chance, outcomes = random.Random(7), {"read": 0, "refused": 0}
    for _ in range(300):
        content = bytearray(original)
        for _ in range(chance.randint(1, 5)):
            at, kind = chance.randrange(len(content)), chance.randrange(3)
            if kind == 0:
                del content[at]
            elif kind == 1:
                content.insert(at, content[at])
            else:
                other = chance.randrange(len(content))
                content[at], content[other] = content[other], content[at]
        text = content.decode("latin-1")
        try:
            parse_program(text, "part.apt")
            outcomes["read"] += 1
        except InputError as error:
            assert error.line is not None or "no cutting move" in str(error)
            outcomes["refused"] += 1
        check(Request(tuple(text.splitlines()), "part.apt"))
    assert min(outcomes.values()) > 25


CUTS = "UNITS/MM\nFEDRAT/600,MMPM\nFROM/0,0,50\nGOTO/0,0,9\n"


def test_a_tap_feeds_in_and_out():
    program = parse_program(
        f"{CUTS}CYCLE/TAP,DEPTH,8,CLEAR,2,MMPM,100,RETURN,5\nGOTO/1,0,0\nCYCLE/OFF\nFINI\n", "p.apt"
    )
    cuts = program.moves.end[program.moves.motion == 3, 2] * 1e3
    assert cuts.round(9).tolist() == [-8, 2]
    assert program.moves.end[-1, 2] * 1e3 == pytest.approx(5)


@pytest.mark.parametrize("word", ["ROTABL/ATANGL,0", "ROTABL/0,BAXIS", "ROTATE/TABLE,INCR,0.0"])
def test_a_table_that_turns_by_nothing_is_listed(word):
    program = parse_program(f"{CUTS}{word}\nGOTO/4,0,9\nFINI\n", "p.apt")
    assert [(note.line, note.reason) for note in program.unsupported] == [(5, "0 changes nothing")]
    with pytest.raises(InputError, match="turns the work or the head"):
        parse_program(f"{CUTS}{word.replace('0', '30', 1)}\nGOTO/4,0,9\nFINI\n", "p.apt")


@pytest.mark.parametrize("word", ["MODE/TURN"])
def test_turning_is_doubted(word):
    program = parse_program(f"{CUTS}{word}\nGOTO/4,0,9\nFINI\n", "p.apt")
    assert any(text.startswith(f"line 5: {word}: turning") for text in map(str, program.warnings))


def test_notes_behind_the_end_are_not_read():
    program = parse_program(f"{CUTS}GOTO/4,0,9\nEND\n*** 3 operations = 4 min\nG1 X5\n", "p.apt")
    assert any("line 7: what follows END is no statement" in text for text in map(str, program.warnings))
    assert len(program.moves) == 2
    with pytest.raises(InputError) as refusal:
        parse_program(f"{CUTS}GOTO/4,0,9\nEND\n*** = 4\nGOTO/9,9,9\nFINI\n", "p.apt")
    assert refusal.value.line == 7
