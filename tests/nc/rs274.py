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
    """Follow the canonical calls."""
    canon = Canon()
    unit, plane = 1.0, "XY"
    g5x, g92, tool = np.zeros(6), np.zeros(6), np.zeros(3)
    rotation = 0.0
    nose = np.zeros(6)  # spindle nose: stands still when a frame or tool length changes
    units6 = np.ones(6)

    def world(p: np.ndarray) -> np.ndarray:
        q = p * units6 + g92
        c, s = math.cos(rotation), math.sin(rotation)
        q = np.concatenate([[c * q[0] - s * q[1], s * q[0] + c * q[1]], q[2:]])
        return q + g5x

    for raw in text.splitlines():
        match = CALL.match(raw)
        if not match:
            continue
        name, inner = match.groups()
        numbers = [float(v) for v in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", inner)]
        if name == "USE_LENGTH_UNITS":
            unit = 25.4 if "INCH" in inner else 1.0
            units6 = np.array([unit] * 3 + [1.0] * 3)
        elif name == "SET_G5X_OFFSET":
            g5x = np.array(numbers[1:7]) * units6
        elif name == "SET_G92_OFFSET":
            g92 = np.array(numbers[:6]) * units6
        elif name == "SET_XY_ROTATION":
            rotation = math.radians(numbers[0])
        elif name == "USE_TOOL_LENGTH_OFFSET":
            tool = np.array(numbers[:3]) * unit
        elif name == "SELECT_PLANE":
            plane = re.search(r"CANON_PLANE_(\w+)", inner)[1]
        elif name in ("STRAIGHT_FEED", "STRAIGHT_TRAVERSE", "ARC_FEED"):
            offset = np.concatenate([tool, np.zeros(3)])
            start = nose - offset
            if name == "ARC_FEED":
                e1, e2, c1, c2, turns, axis_end = numbers[:6]
                order = {"XY": (0, 1, 2), "XZ": (2, 0, 1), "YZ": (1, 2, 0)}[plane]
                p, c = np.zeros(6), np.zeros(6)
                p[[*order]] = e1, e2, axis_end
                p[3:] = numbers[6:9]
                c[[*order]] = c1, c2, axis_end
                end = world(p)
                normal = np.eye(3)[order[2]]
                if rotation:
                    co, si = math.cos(rotation), math.sin(rotation)
                    normal = np.array([co * normal[0] - si * normal[1], si * normal[0] + co * normal[1], normal[2]])
                canon.moves.append(("arc", start, end, (world(c)[:3], normal, int(turns))))
            else:
                end = world(np.array(numbers[:6]))
                kind = "feed" if name == "STRAIGHT_FEED" else "rapid"
                if not np.allclose(start, end, atol=1e-9):
                    canon.moves.append((kind, start, end, None))
            nose = end + offset
    return canon
