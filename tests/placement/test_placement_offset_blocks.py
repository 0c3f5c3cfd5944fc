"""Offset blocks are read back: keyed in before the program they place it as `--origin` does."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.nc import rs274
from toolpath_stiff.analysis.results import analyze
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.reader import parse_program, read_program
from toolpath_stiff.path.placing import place
from toolpath_stiff.rewriting.offset_blocks import offset_blocks

PROGRAMS = Path(__file__).parents[2] / "programs"
PLACEMENT = (0.030, -0.045, 0.900, 0.0, 0.0, math.radians(37.0))
FIGURES = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")


def keyed_in(name: str, block: str):
    """The program with the block before its first word."""
    lines = (PROGRAMS / name).read_text().splitlines()
    at = 1 if lines[0].strip() == "%" else 0
    return parse_program("\n".join([*lines[:at], block, *lines[at:]]) + "\n", name)


@pytest.mark.parametrize("name", ["pocket.nc", "arcs_in_planes.nc", "helix_bore.nc", "drilling.nc", "inch_bracket.nc"])
def test_linuxcnc_block_places_as_the_origin_does(name):
    machine, program = load_machine("nist"), read_program(PROGRAMS / name)
    blocks = offset_blocks(program, PLACEMENT, decimals=6)
    there = analyze(machine, keyed_in(name, blocks.linuxcnc), step=2e-3).to_dict()
    wanted = analyze(machine, program, origin=PLACEMENT, step=2e-3).to_dict()
    for figure in FIGURES:  # six decimals of a millimetre; the summary itself is rounded
        assert there[figure] == pytest.approx(wanted[figure], rel=1e-6, abs=0.11)


def test_blocks_as_text():
    blocks = offset_blocks(read_program(PROGRAMS / "pocket.nc"), PLACEMENT)
    assert blocks.linuxcnc == "G21 G10 L2 P1 X30 Y-45 Z900 R37"
    assert blocks.fanuc == "G54: X30 Y-45 Z900\nG17 G54 G68 X0 Y0 R37"


def test_no_rotation_needs_no_g68():
    blocks = offset_blocks(read_program(PROGRAMS / "arcs_in_planes.nc"), (0.03, 0.0, 0.9, 0.0, 0.0, 0.0))
    assert blocks.fanuc == "G54: X30 Y0 Z900"


@pytest.mark.parametrize(
    ("name", "placement", "reason"),
    [
        ("pocket.nc", (0.0, 0.0, 0.9, 0.1, 0.0, 0.0), "set-up is tilted"),
        ("tilted_five_axis.nc", PLACEMENT, "tool is tilted"),
        ("two_fixtures.nc", PLACEMENT, "G10|beside G54"),
    ],
)
def test_what_offsets_cannot_express_is_refused_with_the_way_out(name, placement, reason):
    blocks = offset_blocks(read_program(PROGRAMS / name), placement)
    assert blocks.linuxcnc == blocks.fanuc == ""
    assert any(part in blocks.linuxcnc_reason for part in reason.split("|"))
    assert "--write" in blocks.fanuc_reason


def test_arcs_off_the_plane_are_none_for_g68():
    blocks = offset_blocks(read_program(PROGRAMS / "arcs_in_planes.nc"), PLACEMENT)
    assert blocks.linuxcnc
    assert "G18" in blocks.fanuc_reason


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
def test_linuxcnc_itself_places_it_there(tmp_path):
    program = read_program(PROGRAMS / "pocket.nc")
    lines = list(program.source)
    lines.insert(1, offset_blocks(program, PLACEMENT, decimals=6).linuxcnc)
    (tmp_path / "keyed_in.ngc").write_text("\n".join(lines) + "\n")
    canon = rs274.run(tmp_path / "keyed_in.ngc", tmp_path, "T1 P1 Z0 D10\n")
    assert canon.error == ""
    wanted = 1e3 * place(program.moves, PLACEMENT).end[:, :3]
    found = np.array([end[:3] for _, _, end, _ in canon.moves])
    # rs274 prints four decimals, and its coordinates pass through the offset once more.
    np.testing.assert_allclose(found[-len(wanted) + 1 :], wanted[1:], atol=2e-4)


@pytest.mark.parametrize("word", ["G55", "g 5 5", "G(second)055", "G59.1", "G10 L2 P2 X1"])
def test_another_offset_is_found_however_it_is_written(word):
    program = parse_program(f"G21 G90 F100\nG1 X5 (G54 and 55)\n{word}\nG1 X7\nM2\n", "part.nc")
    assert "line 3" in offset_blocks(program, PLACEMENT).linuxcnc_reason
