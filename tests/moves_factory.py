"""Moves made by hand, for tests that need no program text."""

from __future__ import annotations

import numpy as np

from toolpath_stiff.nc.moves import ARC, FEED, Moves


def make_moves(rows: list[dict[str, object]]) -> Moves:
    """Moves from dicts; `end` (6) is required, everything else has a default, `start` follows the last end."""
    columns: dict[str, list[object]] = {name: [] for name in Moves.__dataclass_fields__}
    last = np.zeros(6)
    for i, row in enumerate(rows):
        end = np.zeros(6)
        end[: len(row["end"])] = row["end"]  # type: ignore[arg-type, index]
        start = np.asarray(row.get("start", last), dtype=float)
        sweep = row.get("sweep", 0.0)
        values = {
            "line": row.get("line", i + 1),
            "motion": row.get("motion", ARC if sweep else FEED),
            "start": np.concatenate([start, np.zeros(6 - len(start))]),
            "end": end,
            "arc_sweep": sweep,
            "arc_center": row.get("center", np.zeros(3)),
            "arc_normal": row.get("normal", [0.0, 0.0, 1.0] if sweep else np.zeros(3)),
            "feed": row.get("feed", 0.01),
            "dwell": row.get("dwell", 0.0),
            "tool": row.get("tool", 0),
            "tool_length": row.get("tool_length", np.nan),
            "spindle": row.get("spindle", 0.0),
            "from_machine": [False, False],
        }
        for name, value in values.items():
            columns[name].append(value)
        last = end
    whole = ("line", "motion", "tool")
    return Moves(
        **{
            name: np.array(column, dtype=np.int64 if name in whole else bool if name == "from_machine" else float)
            for name, column in columns.items()
        }
    )
