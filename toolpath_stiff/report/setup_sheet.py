"""The set-up sheet: one page for the shop floor with sketch, offset, heights, figures, and every warning."""

from __future__ import annotations

import io
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.analysis import Analysis
from toolpath_stiff.report.figure import INK, MUTED, SECOND_ORANGE, house_style, new_figure
from toolpath_stiff.report.wording import machine_text, number, plain
from toolpath_stiff.units import mm_from_m

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, RED = "#2457a6", "#b3261e"
G68_NOTE = "G68 follows the program's own G17 and G54, and holds until G69"
WIDTH, HEIGHT = 8.27, 11.69  # inch, A4
LEFT, COLUMN = 0.1, 0.34  # of the width
LINE = 0.0185  # of the height
VALUE_LETTERS, FULL_LETTERS = 66, 96  # that fit beside a name, and across the sheet
SMALLEST_SKETCH = 0.2  # of the height
UNDERLAY = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}  # of names over the path


def setup_sheet(summary: dict[str, Any], best: Analysis) -> bytes:
    """PDF of one page (more where warnings are many): what `placement.json` says of the chosen placement."""
    from matplotlib.backends.backend_pdf import PdfPages

    warnings = [line for text in summary["warnings"] for line in _bullet(plain(text))]
    rows = _rows(summary, best)
    buffer = io.BytesIO()
    empty = {"CreationDate": None, "Producer": None, "Creator": None}
    with house_style(), PdfPages(buffer, metadata=empty) as pages:
        # The sketch gives way to the text; what warnings find no room go on to a second page.
        below = sum(len(part) * LINE + 0.006 for _, part in rows) + 0.06
        room = int((0.86 - below - SMALLEST_SKETCH - 0.08) / LINE)
        shown, rest = (warnings, []) if len(warnings) <= room else (warnings[: room - 1], warnings[room - 1 :])
        if rest:
            shown = [*shown, "(more warnings on the next page)"]
        figure = new_figure(WIDTH, HEIGHT)
        at = _heading(figure, summary, best)
        at = _paragraph(figure, at, shown)
        _sketch(figure, (0.16, below + 0.045, 0.72, at - below - 0.085), summary["chosen"], best)
        _table(figure, below - 0.01, rows)
        pages.savefig(figure)
        while rest:
            figure = new_figure(WIDTH, HEIGHT)
            _paragraph(figure, _heading(figure, summary, best), rest[:40])
            pages.savefig(figure)
            rest = rest[40:]
    return buffer.getvalue()


def _heading(figure: Figure, summary: dict[str, Any], best: Analysis) -> float:
    """Title and machine; returns how far down the page it reaches."""
    at = 0.945
    for line in textwrap.wrap(f"Set-up of {plain(summary['program'])}", 52):
        figure.text(LEFT, at, line, fontsize=18, weight="bold")
        at -= 0.026
    about = f"machine {machine_text(summary)}: {plain(best.machine.title)}"
    row = summary["chosen"]
    which = "picked from the front" if summary["picked"] else f"recommended, objective {summary['objective']}"
    about = f"{about}\nplacement {row['number']} of {len(summary['front'])}, {which}"
    for line in (part for text in about.splitlines() for part in textwrap.wrap(text, FULL_LETTERS)):
        figure.text(LEFT, at, line, fontsize=10, color=MUTED)
        at -= 0.0165
    return at - 0.006


def _bullet(text: str) -> list[str]:
    return textwrap.wrap(text, FULL_LETTERS, initial_indent="! ", subsequent_indent="   ")


def _paragraph(figure: Figure, at: float, lines: list[str]) -> float:
    for line in lines:
        figure.text(LEFT, at, line, fontsize=9.5, color=RED)
        at -= 0.0165
    return at


def _rows(summary: dict[str, Any], best: Analysis) -> list[tuple[str, list[str]]]:
    """Names and the lines of their values."""
    row, blocks = summary["chosen"], summary["offset_blocks"]
    heights = mm_from_m(best.samples.position[best.samples.cutting, 2])
    fanuc = blocks["fanuc"] or blocks["fanuc_reason"]
    plunges = row["plunge_mean_N_per_mm"]
    before = summary["before"]
    lines = [
        ("program zero (G54)", f"X {row['x_mm']:.4f}   Y {row['y_mm']:.4f}   Z {row['z_mm']:.4f} mm"),
        ("turn of the work about Z", f"{row['rotation_deg']:.4f} degrees"),
        *_tilt_line(row),
        ("heights of the cut", f"Z {heights.min():.3f} to {heights.max():.3f} mm (machine)"),
        ("LinuxCNC", blocks["linuxcnc"] or blocks["linuxcnc_reason"]),
        ("Fanuc-style", fanuc + (f"\n{G68_NOTE}" if "G68" in (blocks["fanuc"] or "") else "")),
        *([("program written", summary["written"]["file"])] if summary["written"] else []),
        ("mean stiffness", _both(row, before, "mean_N_per_mm")),
        ("range", _both(row, before, "range_N_per_mm")),
        ("weakest place", _both(row, before, "min_N_per_mm")),
        *([] if plunges is None else [("plunges, mean", f"{number(plunges)} N/mm along the tool axis")]),
        (
            "mean deflection",
            f"{row['mean_deflection_um']:.1f} um under {summary['force_N']:g} N, load {summary['load']}",
        ),
    ]
    return [(name, _wrapped(value)) for name, value in lines]


def _both(row: dict[str, Any], before: dict[str, Any] | None, key: str) -> str:
    now = f" (present placement {number(before[key])})" if before else ""
    return f"{number(row[key])} N/mm{now}"


def _table(figure: Figure, at: float, rows: list[tuple[str, list[str]]]) -> None:
    for name, parts in rows:
        figure.text(LEFT, at, name, fontsize=10.5, color=MUTED, va="top")
        for part in parts:
            figure.text(COLUMN, at, part, fontsize=10.5, va="top")
            at -= LINE
        at -= 0.006


def _sketch(figure: Figure, box: tuple[float, float, float, float], row: dict[str, Any], best: Analysis) -> None:
    """The path from above in machine coordinates, program zero and its axes, the machine's axis."""
    axes = figure.add_axes(box)
    position = mm_from_m(best.samples.position[best.samples.cutting])
    axes.plot(position[:, 0], position[:, 1], color=BLUE, lw=1.0)
    x, y = row["x_mm"], row["y_mm"]
    turn = np.deg2rad(row["rotation_deg"])
    reach = 0.25 * max(float(np.ptp(position[:, :2], axis=0).max()), 1.0)
    for angle, name in ((turn, "program X"), (turn + np.pi / 2, "program Y")):
        along = np.array([np.cos(angle), np.sin(angle)])
        tip, beyond = ((x + far * along[0], y + far * along[1]) for far in (reach, 1.05 * reach))
        axes.annotate("", tip, (x, y), arrowprops={"arrowstyle": "-|>", "color": SECOND_ORANGE, "lw": 2})
        side = "left" if along[0] >= 0.0 else "right"
        axes.annotate(name, beyond, ha=side, va="center", fontsize=9, color=SECOND_ORANGE, bbox=UNDERLAY)
    axes.plot(x, y, "o", color=SECOND_ORANGE)
    axes.plot(0, 0, "+", color=INK, ms=14, mew=2)
    _name_zero(axes, (x, y), turn)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.set_xlabel("X of the machine, mm")
    axes.set_ylabel("Y of the machine, mm")
    axes.set_title("seen from above; + is the machine's axis", fontsize=10, color=MUTED)


def _name_zero(axes: Axes, zero: tuple[float, float], turn: float) -> None:
    """The name of program zero, on the side away from its axes."""
    away = (-10.0 * np.cos(turn + np.pi / 4), -10.0 * np.sin(turn + np.pi / 4))
    axes.annotate(
        "program zero",
        zero,
        xytext=away,
        textcoords="offset points",
        ha="left" if away[0] >= 0.0 else "right",
        va="bottom" if away[1] >= 0.0 else "top",
        fontsize=9,
        color=SECOND_ORANGE,
        bbox=UNDERLAY,
    )


def _tilt_line(row: dict[str, Any]) -> list[tuple[str, str]]:
    if not (row["a_deg"] or row["b_deg"]):
        return []
    return [
        ("tilt of the set-up", f"A {row['a_deg']:.4f}, B {row['b_deg']:.4f} degrees (about X first, then Y, then Z)")
    ]


def _wrapped(text: str) -> list[str]:
    return [part for line in text.splitlines() for part in textwrap.wrap(plain(line), VALUE_LETTERS) or [""]]
