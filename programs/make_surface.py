"""Write `surface_50000.nc`: a 3-D surface milled in parallel rows, 50,000 lines, as a CAM system would post it.

Run `python programs/make_surface.py [FILE]`. The same bytes come out every time.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

ROWS, POINTS = 200, 250  # 50,000 points
WIDTH, DEPTH = 160.0, 120.0  # mm


def height(x: float, y: float) -> float:
    """A bump and a trough on a gentle saddle, mm above program zero."""
    bump = 18.0 * math.exp(-((x - 25.0) ** 2 + (y - 10.0) ** 2) / 900.0)
    trough = -10.0 * math.exp(-((x + 40.0) ** 2 + (y + 25.0) ** 2) / 600.0)
    return bump + trough + 0.0012 * (x * x - y * y)


def program() -> str:
    """The program's text."""
    lines = [
        "%",
        "(3-D SURFACE, PARALLEL ROWS, BALL MILL D10)",
        "G21 G17 G40 G80 G90",
        "T2 M6",
        "S16000 M3",
        f"G0 X{-WIDTH / 2:.3f} Y{-DEPTH / 2:.3f} Z40.",
        f"G1 Z{height(-WIDTH / 2, -DEPTH / 2):.4f} F1000",
    ]
    for row in range(ROWS):
        y = -DEPTH / 2 + DEPTH * row / (ROWS - 1)
        order = range(POINTS) if row % 2 == 0 else range(POINTS - 1, -1, -1)
        for i in order:
            x = -WIDTH / 2 + WIDTH * i / (POINTS - 1)
            feed = " F3000" if row == 0 and i == 0 else ""
            lines.append(f"X{x:.4f} Y{y:.4f} Z{height(x, y):.4f}{feed}")
    return "\n".join([*lines, "G0 Z40.", "M5", "M30", "%", ""])


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("surface_50000.nc")
    target.write_text(program(), encoding="ascii")
    print(f"wrote {target}")
