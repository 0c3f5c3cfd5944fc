"""LinuxCNC's interpreter as a witness: its canonical motions as straight and arc moves in machine coordinates, mm.

What it prints are program coordinates (relative to work offset, G92 and rotation, in the active unit) of the
controlled point; the frame is printed when it changes. World = Rz(rotation) (p + g92) + g5x.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

AVAILABLE = shutil.which("rs274") is not None
CALL = re.compile(r"^\s*\d+\s+N\S*\s+(\w+)\((.*)\)\s*$")
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")
# Comments that make LinuxCNC run Python, and user M codes that it runs as programs: never given to it.
UNSAFE = re.compile(r";\s*py|\(\s*py|M1\d\d\b", re.IGNORECASE)


@dataclass
class Canon:
    """Moves in order: (kind, start, end, arc) with kind rapid, feed or arc; positions (6,) in mm and degrees."""

    moves: list[tuple[str, np.ndarray, np.ndarray, tuple | None]] = field(default_factory=list)
    error: str = ""


def run(program: Path, folder: Path, tool_table: str = "") -> Canon:
    """Run rs274 on a program in `folder` (which becomes its HOME)."""
    table = folder / "tool.tbl"
    table.write_text(tool_table)
    out = folder / "canon.txt"
    done = subprocess.run(
        ["rs274", "-g", "-t", str(table), "-v", str(folder / "rs274.var"), str(program), str(out)],
        env={"HOME": str(folder), "PATH": "/usr/bin:/bin"},
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=60,
        check=False,
    )
    text = out.read_text(errors="replace") if out.exists() else ""
    canon = parse(text)
    if done.returncode != 0 or "PROGRAM_END" not in text:
        canon.error = done.stderr.strip() or f"exit {done.returncode}"
    return canon


def parse(text: str) -> Canon:
    """Follow the canonical calls. Plain numbers on the way, arrays at the end: a program may have 50,000 calls."""
    moves: list[tuple[str, list[float], list[float], tuple | None]] = []
    unit, plane = 1.0, "XY"
    g5x, g92, tool = [0.0] * 6, [0.0] * 6, [0.0] * 3
    rotation, turned = 0.0, (1.0, 0.0)
    nose = [0.0] * 6  # spindle nose: stands still when a frame or tool length changes
    units6 = [1.0] * 6

    def world(p: list[float]) -> list[float]:
        q = [v * u + shift for v, u, shift in zip(p, units6, g92, strict=True)]
        c, s = turned
        return [v + shift for v, shift in zip([c * q[0] - s * q[1], s * q[0] + c * q[1], *q[2:]], g5x, strict=True)]

    for raw in text.splitlines():
        match = CALL.match(raw)
        if not match:
            continue
        name, inner = match.groups()
        numbers = [float(v) for v in NUMBER.findall(inner)]
        if name == "USE_LENGTH_UNITS":
            unit = 25.4 if "INCH" in inner else 1.0
            units6 = [unit] * 3 + [1.0] * 3
        elif name == "SET_G5X_OFFSET":
            g5x = [v * u for v, u in zip(numbers[1:7], units6, strict=True)]
        elif name == "SET_G92_OFFSET":
            g92 = [v * u for v, u in zip(numbers[:6], units6, strict=True)]
        elif name == "SET_XY_ROTATION":
            rotation = math.radians(numbers[0])
            turned = math.cos(rotation), math.sin(rotation)
        elif name == "USE_TOOL_LENGTH_OFFSET":
            tool = [v * unit for v in numbers[:3]]
        elif name == "SELECT_PLANE":
            plane = re.search(r"CANON_PLANE_(\w+)", inner)[1]
        elif name == "RIGID_TAP":  # to the point, and back
            start = [n - t for n, t in zip(nose, (*tool, 0.0, 0.0, 0.0), strict=True)]
            end = [*world([*numbers[:3], 0.0, 0.0, 0.0])[:3], *start[3:]]
            moves += [("feed", start, end, None), ("feed", end, start, None)]
        elif name in ("STRAIGHT_FEED", "STRAIGHT_TRAVERSE", "ARC_FEED"):
            start = [n - t for n, t in zip(nose, (*tool, 0.0, 0.0, 0.0), strict=True)]
            if name == "ARC_FEED":
                e1, e2, c1, c2, turns, axis_end = numbers[:6]
                order = {"XY": (0, 1, 2), "XZ": (2, 0, 1), "YZ": (1, 2, 0)}[plane]
                p, c, normal = [0.0] * 6, [0.0] * 6, [0.0] * 3
                p[order[0]], p[order[1]], p[order[2]] = e1, e2, axis_end
                p[3:] = numbers[6:9]
                c[order[0]], c[order[1]], c[order[2]] = c1, c2, axis_end
                end = world(p)
                normal[order[2]] = 1.0
                if rotation:
                    co, si = turned
                    normal = [co * normal[0] - si * normal[1], si * normal[0] + co * normal[1], normal[2]]
                moves.append(("arc", start, end, (np.array(world(c)[:3]), np.array(normal), int(turns))))
            else:
                end = world(numbers[:6])
                moves.append(("feed" if name == "STRAIGHT_FEED" else "rapid", start, end, None))
            nose = [e + t for e, t in zip(end, (*tool, 0.0, 0.0, 0.0), strict=True)]
    return _canon(moves)


def _canon(moves: list[tuple[str, list[float], list[float], tuple | None]]) -> Canon:
    """Without straight moves of no length."""
    if not moves:
        return Canon()
    starts, ends = (np.array([move[i] for move in moves]) for i in (1, 2))
    still = np.isclose(starts, ends, atol=1e-9).all(axis=1)
    kept = [i for i, (kind, *_) in enumerate(moves) if kind == "arc" or not still[i]]
    return Canon([(moves[i][0], starts[i], ends[i], moves[i][3]) for i in kept])
