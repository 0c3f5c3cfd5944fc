"""The set-up sheet for the shop floor, one page."""

import textwrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from toolpath_stiff.placement.result import Placement
from toolpath_stiff.report.colours import BLUE, INK, MUTED, ORANGE
from toolpath_stiff.report.pictures.style import Look, new_figure
from toolpath_stiff.report.place import facts
from toolpath_stiff.report.words import machine_text, plain
from toolpath_stiff.units import mm_from_m

RED = "#b3261e"
G68_NOTE = "follows the program's own G17 and G54, and holds until G69"
WIDTH, HEIGHT = 8.27, 11.69  # inch, A4
LEFT, COLUMN = 0.1, 0.34  # of the width
LINE = 0.0185  # of the height
VALUE_LETTERS, FULL_LETTERS = 66, 96  # letters that fit beside a name, and across the sheet
SMALLEST_SKETCH = 0.2  # of the height
UNDERLAY = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}  # background of names over the path


def setup_sheet(placed: Placement) -> Figure:
    """The chosen placement as in `placement.json`; warnings for which there is no room are counted."""
    warnings = [
        line
        for text in placed.warnings
        for line in textwrap.wrap(plain(text), FULL_LETTERS, initial_indent="! ", subsequent_indent="   ")
    ]
    rows = _rows(placed)
    # The sketch shrinks to make room for the text.
    below = sum(len(part) * LINE + 0.006 for _, part in rows) + 0.06
    room = int((0.86 - below - SMALLEST_SKETCH - 0.08) / LINE)
    if len(warnings) > room:
        warnings = [*warnings[: room - 1], f"! {len(placed.warnings)} warnings in all, see placement.json"]
    figure = new_figure(WIDTH, HEIGHT)
    top = _down(figure, _heading(figure, placed), warnings, 0.0165, fontsize=9.5, color=RED)
    _sketch(figure, (0.16, below + 0.045, 0.72, top - below - 0.085), placed)
    top = below - 0.01
    for name, parts in rows:
        figure.text(LEFT, top, name, fontsize=10.5, color=MUTED, va="top")
        top = _down(figure, top, parts, LINE, COLUMN, fontsize=10.5, va="top") - 0.006
    return figure


def _heading(figure: Figure, placed: Placement) -> float:
    title = textwrap.wrap(f"Set-up of {plain(placed.best.program.name)}", 52)
    which = f"recommended, objective {placed.task.rules.objective}"
    machine = f"machine {machine_text(placed.machine_stated)}: {plain(placed.best.machine.title)}"
    about = [*textwrap.wrap(machine, FULL_LETTERS), f"placement {placed.chosen.number} of {len(placed.front)}, {which}"]
    top = _down(figure, 0.945, title, 0.026, fontsize=18, weight="bold")
    return _down(figure, top, about, 0.0165, fontsize=10, color=MUTED) - 0.006


def _down(figure: Figure, top: float, lines: list[str], step: float, left: float = LEFT, **style: Any) -> float:
    """Write lines downwards from a height; returns the height reached."""
    for line in lines:
        figure.text(left, top, line, **style)
        top -= step
    return top


def _rows(placed: Placement) -> list[tuple[str, list[str]]]:
    heights, best = mm_from_m(placed.best.samples.position[placed.best.samples.cutting, 2]), placed.best
    rows = [
        *(row for row in facts(placed) if row[0] not in ("program", "front")),
        ("heights of the cut", f"Z {heights.min():.3f} to {heights.max():.3f} mm (machine)"),
        ("deflection", f"under {best.force:g} N, load {best.load}"),
        *([("G68", G68_NOTE)] if "G68" in placed.offsets.fanuc else []),
        *([("program written", placed.written.file)] if placed.written and not placed.refusal else []),
    ]

    def lines(text: str) -> list[str]:
        return [part for line in text.splitlines() for part in textwrap.wrap(plain(line), VALUE_LETTERS) or [""]]

    return [(name.strip(), lines(value)) for name, value in rows]


def _sketch(figure: Figure, box: tuple[float, float, float, float], placed: Placement) -> None:
    axes, row, best = figure.add_axes(box), placed.chosen, placed.best
    position = mm_from_m(best.samples.position[best.samples.cutting])
    axes.plot(position[:, 0], position[:, 1], color=BLUE, lw=1.0)
    x, y = row.x_mm, row.y_mm
    turn = np.deg2rad(row.rotation_deg)
    reach = 0.25 * max(float(np.ptp(position[:, :2], axis=0).max()), 1.0)
    for angle, name in ((turn, "program X"), (turn + np.pi / 2, "program Y")):
        along = np.array([np.cos(angle), np.sin(angle)])
        tip, beyond = ((x + far * along[0], y + far * along[1]) for far in (reach, 1.05 * reach))
        axes.annotate("", tip, (x, y), arrowprops={"arrowstyle": "-|>", "color": ORANGE, "lw": 2})
        side = "left" if along[0] >= 0.0 else "right"
        axes.annotate(name, beyond, ha=side, va="center", fontsize=9, color=ORANGE, bbox=UNDERLAY)
    axes.plot(x, y, "o", color=ORANGE)
    axes.plot(0, 0, "+", color=INK, ms=14, mew=2)
    away = -10.0 * np.array([np.cos(turn + np.pi / 4), np.sin(turn + np.pi / 4)])  # from the axes
    side, level = "left" if away[0] >= 0.0 else "right", "bottom" if away[1] >= 0.0 else "top"
    style: Look = {"fontsize": 9, "color": ORANGE, "bbox": UNDERLAY, "textcoords": "offset points"}
    axes.annotate("program zero", (x, y), xytext=away.tolist(), ha=side, va=level, **style)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.set(xlabel="X of the machine, mm", ylabel="Y of the machine, mm")
    axes.set_title("seen from above; + is the machine's axis", fontsize=10, color=MUTED)


PICTURES = {"setup.pdf": setup_sheet}
