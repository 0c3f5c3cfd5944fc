"""Analyses of paths made by hand on the default machine, for the tests of reports."""

from __future__ import annotations

import numpy as np

from tests.moves_factory import make_moves
from toolpath_stiff.analysis.results import Analysis, analyze
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.moves import RAPID, ReadProgram, Unsupported
from toolpath_stiff.nc.tables import ToolEntry


def make_analysis(
    moves: list[dict[str, object]],
    *,
    name: str = "part.nc",
    source: list[str] | None = None,
    warnings: tuple[str, ...] = (),
    tools: tuple[ToolEntry, ...] = (),
    unsupported: tuple[Unsupported, ...] = (),
    **options: object,
) -> Analysis:
    rows = make_moves(moves)
    lines = source or [f"G1 X{end[0] * 1e3:.3f} Y{end[1] * 1e3:.3f} Z{end[2] * 1e3:.3f}" for end in rows.end]
    program = ReadProgram(
        name=name,
        path=name,
        source=tuple(lines),
        moves=rows,
        warnings=warnings,
        tools=tools,
        unsupported=unsupported,
    )
    return analyze(load_machine("nist"), program, **options)  # type: ignore[arg-type]


def spiral_moves(turns: int = 5, radius: float = 0.25, per_turn: int = 36) -> list[dict[str, object]]:
    """A rapid above, a plunge, a flat spiral outwards with a second tool from half way, a rapid home."""
    moves: list[dict[str, object]] = [
        {"end": (0.0, 0.0, 0.05), "motion": RAPID, "tool": 1, "feed": np.nan, "start": (-0.3, -0.3, 0.1)},
        {"end": (0.0, 0.0, -0.02), "tool": 1},
    ]
    count = turns * per_turn
    for i in range(1, count + 1):
        angle, r = 2 * np.pi * i / per_turn, radius * i / count
        if i == count // 2:
            here = moves[-1]["end"]
            moves.append({"end": (here[0], here[1], 0.05), "motion": RAPID, "tool": 1, "feed": np.nan})  # type: ignore[index]
            moves.append({"end": here, "tool": 2})
        tool = 1 if i < count // 2 else 2
        moves.append({"end": (r * np.cos(angle), r * np.sin(angle), -0.02 - 0.02 * i / count), "tool": tool})
    moves.append({"end": (radius, 0.0, 0.1), "motion": RAPID, "tool": 2, "feed": np.nan})
    return moves


def spiral(**options: object) -> Analysis:
    tools = (ToolEntry(1, np.nan, 10.0, "end mill"), ToolEntry(2, np.nan, 6.0, "ball nose"))
    return make_analysis(spiral_moves(), **{"tools": tools, "name": "spiral.nc", **options})  # type: ignore[arg-type]


def short(**options: object) -> Analysis:
    """Two short cuts: quick to evaluate and draw."""
    return make_analysis([{"end": (0.1, 0.0, 0.0)}, {"end": (0.1, 0.05, 0.0)}], **options)  # type: ignore[arg-type]
