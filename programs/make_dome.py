"""Write `dome_ac_table.nc`: a dome milled in a spiral, the tool leaning with it, posted for an AC table-table machine.

Run `python programs/make_dome.py [FILE]`. The same bytes come out every time. `dome_ac_table.toml` is its controller
file. The part is a cap of a sphere; the tool stands normal to it. What a post-processor does is here on one page:

    A = acos k,  C = atan2(i, -j)                   so that the table's turn brings the tool's axis (i, j, k) upright
    X Y Z = c_A + Rx(-A) (c_C + Rz(-C) (P - c_C) - c_A)    where the part's point P then stands

with positive angles of the tool against the work (ISO 841), so that the table itself turns by -A and -C; c_A and c_C
are points of the two axes. R.-S. Lee, C.-H. She, Int J Adv Manuf Technol 13 (1997) 658-665, treat this and its
relatives.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

RADIUS = 120.0  # mm, of the sphere; its pole is program zero
STEEPEST, POINTS, TURNS = 18.0, 150, 3  # degrees off the pole
AXIS_A = (0.0, 0.0, -50.0)  # a point of each table's axis in program coordinates, mm
AXIS_C = (0.0, 0.0, -70.0)
FEED = 1500.0  # mm/min on the part

Vector = tuple[float, float, float]


def cutter_location(i: int) -> tuple[Vector, Vector]:
    """Tip and tool axis on the part at the point i of the spiral, from the rim to near the pole."""
    polar = math.radians(STEEPEST * (1.0 - 0.9 * i / POINTS))
    azimuth = 2.0 * math.pi * TURNS * i / POINTS
    axis = (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar))
    return (RADIUS * axis[0], RADIUS * axis[1], RADIUS * (axis[2] - 1.0)), axis


def table_words(tip: Vector, axis: Vector) -> tuple[float, float, float, float, float]:
    """X Y Z A C of the machine: mm, degrees."""
    a, c = math.acos(axis[2]), math.atan2(axis[0], -axis[1])
    x, y, z = (p - q for p, q in zip(tip, AXIS_C, strict=True))
    x, y = x * math.cos(c) + y * math.sin(c), y * math.cos(c) - x * math.sin(c)
    x, y, z = (p + q - r for p, q, r in zip((x, y, z), AXIS_C, AXIS_A, strict=True))
    y, z = y * math.cos(a) + z * math.sin(a), z * math.cos(a) - y * math.sin(a)
    return (x + AXIS_A[0], y + AXIS_A[1], z + AXIS_A[2], math.degrees(a), math.degrees(c))


def word(letter: str, value: float) -> str:
    """A word with four decimals, no negative zero among them."""
    return f"{letter}{round(value, 4) + 0.0:.4f}"


def program() -> str:
    """The program's text."""
    lines = [
        "%",
        "O2201 (DOME, POSTED FOR A TABLE-TABLE MACHINE WITH A AND C)",
        "G21 G17 G40 G80 G90 G94",
        "T1 M6 (BALL MILL)",
        "S12000 M3",
    ]
    turns, previous, before = 0.0, 0.0, cutter_location(0)[0]
    for i in range(POINTS + 1):
        tip, axis = cutter_location(i)
        x, y, z, a, c = table_words(tip, axis)
        turns += 360.0 * round((previous - c - turns) / 360.0)  # C winds on instead of turning back
        previous = c + turns
        if i == 0:
            lines += [f"G0 {word('A', a)} {word('C', previous)}", f"G43 H1 {word('X', x)} {word('Y', y)} Z60."]
            lines += [word("Z", z + 5.0), f"G1 {word('Z', z)} F500.", "G93"]
        else:
            words = [word(*pair) for pair in (("X", x), ("Y", y), ("Z", z), ("A", a), ("C", previous))]
            lines.append(f"G1 {' '.join(words)} F{FEED / math.dist(before, tip):.3f}")
        before = tip
    return "\n".join([*lines, "G94", "G0 Z60.", "A0. C0.", "G53 Z-250.", "M5", "M30", "%", ""])


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("dome_ac_table.nc")
    target.write_text(program(), encoding="ascii")
    print(f"wrote {target}")
