"""What `tps check` says of each tool and of each operation: extents, lengths, times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from toolpath_stiff.analysis.program_check import Figures, figures_of_parts
from toolpath_stiff.nc.checking import Checked
from toolpath_stiff.nc.operations import find_operations
from toolpath_stiff.path import RAPID_FEED


def check_parts(
    checked: Checked, lines: Sequence[str], name: str, rapid_feed: float = RAPID_FEED
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Tools in order of use, and operations in the order of the run: rows of `--json`, mm, degrees, s.

    Parameters
    ----------
    checked
        What the check found; without moves there are no rows.
    lines, name
        The program.
    rapid_feed
        Of rapids, m/s.
    """
    moves = checked.moves
    if moves is None:
        return [], []
    numbers, first, of_move = np.unique(moves.tool, return_index=True, return_inverse=True)
    found = figures_of_parts(moves, of_move, len(numbers), rapid_feed)
    tools = [
        {"tool": int(numbers[i]), "remark": checked.remarks.get(int(numbers[i]), ""), **figure_rows(found[i])}
        for i in np.argsort(first).tolist()
    ]
    operations = find_operations(lines, moves, name, checked.remarks, checked.marks, checked.jumps)
    parts = figures_of_parts(moves, operations.of_move, len(operations.rows), rapid_feed)
    return tools, [
        {
            "operation": row.number,
            "name": row.name,
            "tool": row.tool,
            "first_line": row.first_line,
            "last_line": row.last_line,
            **figure_rows(part),
        }
        for row, part in zip(operations.rows, parts, strict=True)
    ]


def figure_rows(found: Figures) -> dict[str, Any]:
    """Figures under the names that `--json` gives them."""
    return {
        "extents_mm": {axis: found.cutting_extents[axis] for axis in "xyz" if found.cutting_extents},
        "extents_deg": {axis: found.cutting_extents[axis] for axis in "abc" if found.cutting_extents},
        "extents_with_rapids_mm": {axis: found.all_extents[axis] for axis in "xyz" if found.all_extents},
        "lengths_mm": found.lengths,
        "times_s": found.times,
    }
