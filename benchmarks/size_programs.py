"""Programs as CAM systems write them, of any number of lines: the same bytes for the same number."""

import math
from collections.abc import Iterator

HEAD = "%\n(PART 1)\nG21 G90 G17 G94\nT1 M6\nS12000 M3\nG0 X0. Y0. Z10.\nG1 Z0. F800.\n"
TAIL = "M5\nM30\n%\n"


def three_axis(lines: int) -> Iterator[str]:
    """Modal X Y Z moves of 0.1 to 0.3 mm with new feeds, and every tenth line a small arc."""
    yield HEAD
    x = y = 0.0
    for i in range(lines):
        t = i * 0.002
        if i % 10 == 9:  # a quarter of a circle of 0.2 mm, in the direction that leads on
            yield f"G3 X{x + 0.2:.3f} Y{y + 0.2:.3f} I0. J0.2\n"
            x, y = round(x + 0.2, 3), round(y + 0.2, 3)
            continue
        x, y, z = 100.0 * math.sin(0.7 * t), 100.0 * math.cos(0.31 * t), 5.0 * math.sin(3.0 * t)
        mode = "G1" if i % 10 == 0 else ""
        feed = f" F{600 + 50 * (i // 100 % 7)}." if i % 100 == 0 else ""
        x, y, z = round(x, 3), round(y, 3), round(z, 3)
        yield f"{mode} X{x:.3f} Y{y:.3f}{f' Z{z:.3f}' if i % 3 == 0 else ''}{feed}\n".lstrip()
    yield TAIL


def five_axis(lines: int) -> Iterator[str]:
    """Numbered X Y Z A B moves, four decimals."""
    yield HEAD
    for i in range(lines):
        t = i * 0.002
        x, y, z = 100.0 * math.sin(0.7 * t), 100.0 * math.cos(0.31 * t), 5.0 * math.sin(3.0 * t)
        yield f"N{i + 10} G1 X{x:.4f} Y{y:.4f} Z{z:.4f} A{8.0 * math.sin(t):.3f} B{8.0 * math.cos(t):.3f}\n"
    yield TAIL


KINDS = {"3-axis": three_axis, "5-axis": five_axis}


def program(kind: str, lines: int) -> str:
    """A program of `KINDS` with that many lines of moves."""
    return "".join(KINDS[kind](lines))
