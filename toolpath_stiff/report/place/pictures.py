"""Pictures of a placement (the front, both profiles, the workspace) and the set-up sheet for the shop floor."""

from __future__ import annotations

import io
import sys
import textwrap
from importlib.util import LazyLoader, find_spec, module_from_spec
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.analysis.grid import map_stiffness
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.placement.result import Placement, Written
from toolpath_stiff.placement.rows import FIGURES, PlacementRow
from toolpath_stiff.report.figure import BLUE, COLOUR_MAP, INK, MUTED, SECOND_ORANGE, house_style, new_figure, picture
from toolpath_stiff.report.profile import profile_curve
from toolpath_stiff.report.words import machine_text, plain
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


AROUND = 0.06  # m of the workspace shown about the paths


@picture
def front_picture(placed: Placement) -> Figure:
    """PNG of range against mean, coloured by the weakest place: the front, the chosen placement, the present one."""
    best, before = placed.chosen, placed.present
    with house_style():
        figure = new_figure(9.0, 6.2)
        axes = figure.add_axes((0.12, 0.12, 0.7, 0.69))
        mean, spread, weakest = ([getattr(row, key) for row in placed.front] for key in FIGURES.values())
        everything = [*weakest, *([before.min_N_per_mm] if before else [])]
        scale = {"vmin": min(everything), "vmax": max(*everything, min(everything) * (1.0 + 1e-6))}
        dots = axes.scatter(mean, spread, s=34, c=weakest, cmap=COLOUR_MAP, ec=INK, lw=0.4, zorder=2, **scale)
        dots.set_label("front: no placement is better in all three")
        axes.plot(
            best.mean_N_per_mm,
            best.range_N_per_mm,
            "o",
            ms=16,
            mfc="none",
            mec=SECOND_ORANGE,
            mew=2.5,
            label=f"{'picked' if placed.picked else 'recommended'}, number {best.number}",
        )
        if before:
            axes.scatter(
                [before.mean_N_per_mm], [before.range_N_per_mm], marker="s", s=90, c=[before.min_N_per_mm],
                cmap=COLOUR_MAP, ec=INK, lw=1.8, zorder=3, label="present placement", **scale,
            )  # fmt: skip
        axes.margins(0.08)
        axes.set_xlabel("mean stiffness, N/mm (more is better)")
        axes.set_ylabel("range of stiffness, N/mm (less is better)")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(lambda value, _: number(value))
        axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncol=3, fontsize=9)
        bar = figure.add_axes((0.845, 0.12, 0.022, 0.69))
        figure.colorbar(dots, cax=bar, label="weakest place, N/mm (more is better)")
        bar.yaxis.set_major_formatter(lambda value, _: number(value))
        bar.grid(visible=False)
        title = f"Placements of {plain(placed.program.name)}"
        figure.text(0.12, 0.94, title, fontsize=14, weight="bold")
        text = f"machine {machine_text(placed.machine_stated)}   ·   load {placed.best.load}"
        text += f"   ·   objective {placed.objective}"
        figure.text(0.12, 0.895, text, fontsize=10, color=MUTED)
        return figure


@picture
def profiles_picture(best: Analysis, before: Analysis | None) -> Figure:
    """PNG of stiffness along the path, before and after, on one axis, which plunges do not set."""
    with house_style():
        figure = new_figure(12.0, 5.0)
        axes = figure.add_axes((0.08, 0.13, 0.89, 0.7))
        ends: list[float] = []
        plunges: list[float] = []
        for analysis, colour, label in ((before, "#9aa5b1", "present"), (best, BLUE, "chosen")):
            if analysis is not None:
                s, stiffness = profile_curve(analysis, with_plunges=False)
                axes.plot(s, stiffness, color=colour, lw=1.5, label=label)
                values = n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.headline])
                ends += [float(values.min()), float(values.max())]
                beside = n_per_mm_from_n_per_m(analysis.at.stiffness[analysis.set_aside])
                plunges += [float(beside.min()), float(beside.max())] if len(beside) else []
        room = max(0.06 * (max(ends) - min(ends)), 1e-3 * max(ends))
        axes.set_ylim(min(ends) - room, max(ends) + room)
        axes.set_xlabel("path length, mm (rapids included)")
        axes.set_ylabel("stiffness along the load, N/mm")
        axes.yaxis.set_major_formatter(lambda value, _: number(value))
        axes.legend(frameon=False, ncol=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
        figure.text(0.08, 0.91, "Stiffness along the path, before and after", fontsize=14, weight="bold")
        if plunges:
            text = f"plunges along the tool axis are left out: {number(min(plunges))} to {number(max(plunges))} N/mm"
            figure.text(0.08, 0.86, text, fontsize=10, color=MUTED)
        return figure


@picture
def workspace_picture(best: Analysis, before: Analysis | None) -> Figure:
    """PNG of the radial stiffness at the chosen height, with the path before and after."""
    paths = [a for a in (before, best) if a is not None]
    points = np.concatenate([a.samples.position[a.samples.cutting, :2] for a in paths])
    low, high = points.min(axis=0) - AROUND, points.max(axis=0) + AROUND
    height = float(np.average(best.samples.position[best.samples.cutting, 2]))
    found = map_stiffness(best.model, (low[0], high[0]), (low[1], high[1]), [height], Load("radial"))
    with house_style():
        figure = new_figure(8.6, 7.6)
        axes = figure.add_axes((0.1, 0.09, 0.72, 0.78))
        mesh = axes.pcolormesh(
            mm_from_m(found.x), mm_from_m(found.y), n_per_mm_from_n_per_m(found.stiffness[0]), cmap=COLOUR_MAP,
            shading="gouraud", rasterized=True,
        )  # fmt: skip
        for analysis, colour, label in ((before, "white", "present"), (best, SECOND_ORANGE, "chosen")):
            if analysis is not None:
                x, y = mm_from_m(analysis.samples.position[analysis.samples.cutting, :2]).T
                axes.plot(x, y, color=colour, lw=1.4, label=label)
        axes.set_aspect("equal")
        axes.set_facecolor("#eceff3")
        axes.grid(visible=False)
        axes.set_xlabel("X mm")
        axes.set_ylabel("Y mm")
        axes.legend(loc="upper right", facecolor="#616e7c", labelcolor="white")
        bar = figure.add_axes((0.85, 0.15, 0.025, 0.66))
        figure.colorbar(mesh, cax=bar, label="radial stiffness, N/mm")
        bar.yaxis.set_major_formatter(lambda value, _: number(value))
        bar.grid(visible=False)
        title = f"Workspace at z = {mm_from_m(height):.0f} mm, path before and after"
        figure.text(0.1, 0.93, title, fontsize=14, weight="bold")
        return figure


RED = "#b3261e"


G68_NOTE = "G68 follows the program's own G17 and G54, and holds until G69"


WIDTH, HEIGHT = 8.27, 11.69  # inch, A4


LEFT, COLUMN = 0.1, 0.34  # of the width


LINE = 0.0185  # of the height


VALUE_LETTERS, FULL_LETTERS = 66, 96  # that fit beside a name, and across the sheet


SMALLEST_SKETCH = 0.2  # of the height


UNDERLAY = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}  # of names over the path


def setup_sheet(placed: Placement) -> bytes:
    """PDF of one page (more where warnings are many): what `placement.json` says of the chosen placement."""
    _put_off("fontTools", "subset")  # a third of the sheet's time; asked for where fonts are embedded as Type 42
    from matplotlib.backends.backend_pdf import PdfPages

    warnings = [line for text in placed.warnings for line in _bullet(plain(text))]
    rows = _rows(placed)
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
        at = _heading(figure, placed)
        at = _paragraph(figure, at, shown)
        _sketch(figure, (0.16, below + 0.045, 0.72, at - below - 0.085), placed)
        _table(figure, below - 0.01, rows)
        pages.savefig(figure)
        while rest:
            figure = new_figure(WIDTH, HEIGHT)
            _paragraph(figure, _heading(figure, placed), rest[:40])
            pages.savefig(figure)
            rest = rest[40:]
    return buffer.getvalue()


def _put_off(package: str, name: str) -> None:
    """Let a module of a package be imported when it is first used, whoever imports it."""
    full = f"{package}.{name}"
    spec = None if full in sys.modules else find_spec(full)
    if spec is not None and spec.loader is not None:
        spec.loader = LazyLoader(spec.loader)
        sys.modules[full] = module_from_spec(spec)
        spec.loader.exec_module(sys.modules[full])
        setattr(sys.modules[package], name, sys.modules[full])  # else the import machinery looks into it at once


def _heading(figure: Figure, placed: Placement) -> float:
    """Title and machine; returns how far down the page it reaches."""
    at = 0.945
    for line in textwrap.wrap(f"Set-up of {plain(placed.program.name)}", 52):
        figure.text(LEFT, at, line, fontsize=18, weight="bold")
        at -= 0.026
    about = f"machine {machine_text(placed.machine_stated)}: {plain(placed.best.machine.title)}"
    which = "picked from the front" if placed.picked else f"recommended, objective {placed.objective}"
    about = f"{about}\nplacement {placed.chosen.number} of {len(placed.front)}, {which}"
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


def _rows(placed: Placement) -> list[tuple[str, list[str]]]:
    """Names and the lines of their values."""
    row, blocks, best = placed.chosen, placed.offsets, placed.best
    heights = mm_from_m(best.samples.position[best.samples.cutting, 2])
    fanuc = blocks.fanuc or blocks.fanuc_reason
    plunges = row.plunge_mean_N_per_mm
    before, written = placed.present, placed.written
    lines = [
        ("program zero (G54)", f"X {row.x_mm:.4f}   Y {row.y_mm:.4f}   Z {row.z_mm:.4f} mm"),
        ("turn of the work about Z", f"{row.rotation_deg:.4f} degrees"),
        *_tilt_line(row),
        ("heights of the cut", f"Z {heights.min():.3f} to {heights.max():.3f} mm (machine)"),
        ("LinuxCNC", blocks.linuxcnc or blocks.linuxcnc_reason),
        ("Fanuc-style", fanuc + (f"\n{G68_NOTE}" if "G68" in blocks.fanuc else "")),
        *([("program written", written.file)] if isinstance(written, Written) else []),
        ("mean stiffness", _both(row, before, "mean_N_per_mm")),
        ("range", _both(row, before, "range_N_per_mm")),
        ("weakest place", _both(row, before, "min_N_per_mm")),
        *([] if plunges is None else [("plunges, mean", f"{number(plunges)} N/mm along the tool axis")]),
        (
            "mean deflection",
            f"{row.mean_deflection_um:.1f} um under {best.force:g} N, load {best.load}",
        ),
    ]
    return [(name, _wrapped(value)) for name, value in lines]


def _both(row: PlacementRow, before: PlacementRow | None, key: str) -> str:
    now = f" (present placement {number(getattr(before, key))})" if before else ""
    return f"{number(getattr(row, key))} N/mm{now}"


def _table(figure: Figure, at: float, rows: list[tuple[str, list[str]]]) -> None:
    for name, parts in rows:
        figure.text(LEFT, at, name, fontsize=10.5, color=MUTED, va="top")
        for part in parts:
            figure.text(COLUMN, at, part, fontsize=10.5, va="top")
            at -= LINE
        at -= 0.006


def _sketch(figure: Figure, box: tuple[float, float, float, float], placed: Placement) -> None:
    """The path from above in machine coordinates, program zero and its axes, the machine's axis."""
    axes, row, best = figure.add_axes(box), placed.chosen, placed.best
    position = mm_from_m(best.samples.position[best.samples.cutting])
    axes.plot(position[:, 0], position[:, 1], color=BLUE, lw=1.0)
    x, y = row.x_mm, row.y_mm
    turn = np.deg2rad(row.rotation_deg)
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


def _tilt_line(row: PlacementRow) -> list[tuple[str, str]]:
    if not (row.a_deg or row.b_deg):
        return []
    return [("tilt of the set-up", f"A {row.a_deg:.4f}, B {row.b_deg:.4f} degrees (about X first, then Y, then Z)")]


def _wrapped(text: str) -> list[str]:
    return [part for line in text.splitlines() for part in textwrap.wrap(plain(line), VALUE_LETTERS) or [""]]
