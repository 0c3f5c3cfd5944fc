"""The same path, told from the moves alone: what tests of the rewriter compare."""

from __future__ import annotations

import numpy as np

from toolpath_stiff.nc.moves import RAPID, ReadProgram
from toolpath_stiff.path.placing import place, place_orientations
from toolpath_stiff.rotations import rotation_matrices


def cutting_moves(program: ReadProgram, origin) -> list[tuple]:
    """Start and end (m), their rotations, arc, line of every cutting move."""
    moves = place(program.moves, origin)
    moves = moves.take(moves.motion != RAPID)
    start, end = (place_orientations(ends[:, 3:], origin) for ends in (moves.start, moves.end))
    turned = np.stack([rotation_matrices(start), rotation_matrices(end)], axis=1)
    columns = (moves.start[:, :3], moves.end[:, :3], turned, moves.arc_center, moves.arc_normal, moves.arc_sweep)
    return list(zip(*columns, moves.line, strict=True))


def assert_same_path(program: ReadProgram, placement, written: ReadProgram, origin, unit_mm: float) -> None:
    """The cutting moves of both lie on each other but for the rounding to `unit_mm` (mm and degrees).

    Half a unit per axis, of start and end each, is 1.7 units; a centre adds its own words and what an R may miss.
    Straight moves of a few units may vanish by rounding, or come to be: lines that have one are left out.
    """
    unit = unit_mm * 1e-3
    wanted, found = (cutting_moves(p, o) for p, o in ((program, placement), (written, origin)))

    def short(move) -> bool:
        return move[5] == 0.0 and max(np.abs(move[1] - move[0]).max(), np.abs(move[2][1] - move[2][0]).max()) < 4 * unit

    left_out = {move[6] for move in wanted if short(move)}
    left_out |= {move[6] for move in found if short(move)} - {move[6] for move in wanted}
    wanted, found = ([move for move in moves if move[6] not in left_out] for moves in (wanted, found))
    assert len(found) == len(wanted)
    for one, other in zip(wanted, found, strict=True):
        np.testing.assert_allclose(other[0], one[0], atol=2.0 * unit, rtol=0)
        np.testing.assert_allclose(other[1], one[1], atol=2.0 * unit, rtol=0)
        np.testing.assert_allclose(other[2], one[2], atol=4.0 * np.radians(unit_mm) + 1e-12, rtol=0)
        normal, sweep = one[4], one[5]
        assert (sweep == 0.0) == (other[5] == 0.0)
        if sweep:
            sense = float(normal @ other[4])
            assert abs(abs(sense) - 1.0) < 1e-9
            assert np.linalg.norm(np.cross(one[3] - other[3], normal)) < 6.0 * unit
            radius = np.linalg.norm(np.cross(one[0] - one[3], normal))
            assert abs(sweep - sense * other[5]) * radius < 24.0 * unit
