"""Pictures of a placement: the front, both profiles, and the workspace with the path before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

from toolpath_stiff.analysis import Analysis
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.stiffness_map import map_stiffness
from toolpath_stiff.report.figure import COLOUR_MAP, INK, MUTED, SECOND_ORANGE, house_style, new_figure, png_bytes
from toolpath_stiff.report.profile_picture import profile_curve
from toolpath_stiff.report.wording import number, plain
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

BLUE = "#2457a6"
G68_NOTE = "G68 follows the program's own G17 and G54, and holds until G69"
AROUND = 0.06  # m of the workspace shown about the paths


def front_picture(summary: dict[str, Any]) -> bytes:
    """PNG of range against mean: the front, the recommended placement, the original one."""
    front, best, before = summary["front"], summary["recommended"], summary["before"]
    with house_style():
        figure = new_figure(9.0, 6.0)
        axes = figure.add_axes((0.12, 0.12, 0.83, 0.7))
        mean, spread = ([row[key] for row in front] for key in ("mean_N_per_mm", "range_N_per_mm"))
        axes.plot(mean, spread, "-", color="#cbd2d9", lw=1.2, zorder=1)
        axes.scatter(mean, spread, s=26, color=BLUE, zorder=2, label="front: no placement is better in both")
        axes.plot(
            best["mean_N_per_mm"], best["range_N_per_mm"], "*", ms=18, color=SECOND_ORANGE, mec=INK, label="recommended"
        )
        if before:
            axes.plot(
                before["mean_N_per_mm"],
                before["range_N_per_mm"],
                "s",
                ms=9,
                mfc="white",
                mec=INK,
                mew=1.8,
                label="original",
            )
        axes.set_xlabel("mean stiffness, N/mm (more is better)")
        axes.set_ylabel("range of stiffness, N/mm (less is better)")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(lambda value, _: number(value))
        axes.legend(frameon=False, loc="best")
        title = f"Placements of {plain(summary['program'])}"
        figure.text(0.12, 0.93, title, fontsize=14, weight="bold")
        text = f"machine {summary['machine']}   ·   load {summary['load']}   ·   objective {summary['objective']}"
        figure.text(0.12, 0.875, text, fontsize=10, color=MUTED)
        return png_bytes(figure)


def profiles_picture(best: Analysis, before: Analysis | None) -> bytes:
    """PNG of stiffness along the path, before and after, on one axis."""
    with house_style():
        figure = new_figure(12.0, 5.0)
        axes = figure.add_axes((0.08, 0.13, 0.89, 0.7))
        for analysis, colour, label in ((before, "#9aa5b1", "original"), (best, BLUE, "recommended")):
            if analysis is not None:
                s, stiffness = profile_curve(analysis)[:2]
                axes.plot(s, stiffness, color=colour, lw=1.5, label=label)
        axes.set_xlabel("path length, mm (rapids included)")
        axes.set_ylabel("stiffness along the load, N/mm")
        axes.yaxis.set_major_formatter(lambda value, _: number(value))
        axes.legend(frameon=False, ncol=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
        figure.text(0.08, 0.91, "Stiffness along the path, before and after", fontsize=14, weight="bold")
        return png_bytes(figure)


def workspace_picture(best: Analysis, before: Analysis | None) -> bytes:
    """PNG of the radial stiffness at the recommended height, with the path before and after."""
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
        for analysis, colour, label in ((before, "white", "original"), (best, SECOND_ORANGE, "recommended")):
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
        return png_bytes(figure)


def setup_sheet(summary: dict[str, Any], best: Analysis) -> bytes:
    """PDF of one page for the shop floor: sketch, offset, heights, figures."""
    import io

    row = summary["recommended"]
    cutting = best.samples.cutting
    position = mm_from_m(best.samples.position[cutting])
    with house_style():
        figure = new_figure(8.27, 11.69)
        figure.text(0.1, 0.94, f"Set-up of {plain(summary['program'])}", fontsize=18, weight="bold")
        figure.text(0.1, 0.915, f"machine {summary['machine']}: {plain(best.machine.title)}", fontsize=10, color=MUTED)
        axes = figure.add_axes((0.14, 0.46, 0.74, 0.42))
        axes.plot(position[:, 0], position[:, 1], color=BLUE, lw=1.0)
        x, y, turn = row["x_mm"], row["y_mm"], np.deg2rad(row["rotation_deg"])
        reach = 0.25 * max(float(np.ptp(position[:, :2], axis=0).max()), 1.0)
        for angle, name in ((turn, "X"), (turn + np.pi / 2, "Y")):
            tip = (x + reach * np.cos(angle), y + reach * np.sin(angle))
            axes.annotate("", tip, (x, y), arrowprops={"arrowstyle": "-|>", "color": SECOND_ORANGE, "lw": 2})
            axes.annotate(f"{name} of the program", tip, fontsize=8, color=SECOND_ORANGE)
        axes.plot(x, y, "o", color=SECOND_ORANGE)
        axes.plot(0, 0, "+", color=INK, ms=14, mew=2)
        axes.annotate("machine axis", (0, 0), xytext=(5, 5), textcoords="offset points", fontsize=8)
        axes.set_aspect("equal")
        axes.margins(0.1)
        axes.set_xlabel("X of the machine, mm")
        axes.set_ylabel("Y of the machine, mm")
        axes.set_title("seen from above")
        blocks = summary["offset_blocks"]
        lines = [
            ("program zero (G54)", f"X {x:.4f}   Y {y:.4f}   Z {row['z_mm']:.4f} mm"),
            ("turn of the work about Z", f"{row['rotation_deg']:.4f} degrees"),
            *_tilt_line(row),
            ("heights of the cut", f"Z {position[:, 2].min():.3f} to {position[:, 2].max():.3f} mm (machine)"),
            ("LinuxCNC", blocks["linuxcnc"] or blocks["linuxcnc_reason"]),
            ("Fanuc-style", blocks["fanuc"] or blocks["fanuc_reason"]),
            *([("", G68_NOTE)] if "G68" in (blocks["fanuc"] or "") else []),
            ("mean stiffness", f"{number(row['mean_N_per_mm'])} N/mm"),
            ("range, weakest", f"{number(row['range_N_per_mm'])} N/mm, {number(row['min_N_per_mm'])} N/mm"),
            (
                "mean deflection",
                f"{row['mean_deflection_um']:.1f} um under {summary['force_N']:g} N, load {summary['load']}",
            ),
        ]
        at = 0.39
        for name, value in lines:
            figure.text(0.1, at, name, fontsize=11, color=MUTED, va="top")
            for part in (
                plain(str(value).replace("\n", "   ")).split("\n") if len(str(value)) < 62 else _wrapped(str(value))
            ):
                figure.text(0.36, at, part, fontsize=11, va="top")
                at -= 0.022
            at -= 0.012
        buffer = io.BytesIO()
        figure.savefig(buffer, format="pdf", metadata={"CreationDate": None, "Producer": None, "Creator": None})
        return buffer.getvalue()


def _tilt_line(row: dict[str, Any]) -> list[tuple[str, str]]:
    if not (row["a_deg"] or row["b_deg"]):
        return []
    return [
        ("tilt of the set-up", f"A {row['a_deg']:.4f}, B {row['b_deg']:.4f} degrees (about X first, then Y, then Z)")
    ]


def _wrapped(text: str) -> list[str]:
    import textwrap

    return [part for line in text.splitlines() for part in textwrap.wrap(plain(line), 62)]
