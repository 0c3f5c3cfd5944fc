"""Measuring, in files, figures and pictures: what to measure next, and raw records reduced to stiffnesses.

The plan is drawn as how far the rivals would be apart over the workspace, with the planned poses by kind.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content
from toolpath_stiff.planning.document import GapMap, gap_map, group_of, height_groups, plan_csv, rows_of
from toolpath_stiff.planning.next_visit import TABLES, tables_of
from toolpath_stiff.planning.plan import Plan, Proposal
from toolpath_stiff.planning.visits import Visits
from toolpath_stiff.report.figure import COLOUR_MAP, INK, MUTED, SECOND_ORANGE, house_style, new_figure, picture
from toolpath_stiff.report.history import dated, history_png, history_text
from toolpath_stiff.report.words import plain, shortened
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, um_from_m

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.planning.document import PlanDocument
    from toolpath_stiff.readings.loop_figures import LoopFigures
    from toolpath_stiff.readings.raw import Reduction
    from toolpath_stiff.readings.raw_records import Loop


# Colours told apart by eyes that see no red or green (Okabe and Ito 2008), and shapes beside them.
MARKS = (
    ("o", "#ffffff"),
    ("^", "#e69f00"),
    ("s", "#56b4e9"),
    ("D", "#cc79a7"),
    ("v", "#f0e442"),
    ("P", "#d55e00"),
    ("X", "#999999"),
)
PANEL = 3.5  # inches a side
MOST_ACROSS = 5  # panels in a row
NARROWEST = 8.0  # inches, for the headings
ROOM = 1.2  # half a panel, of the farthest pose: marks lean and have labels
CLOSE = 0.06  # m between marks whose labels would cover each other
SHORT = 6  # letters of a label that has room on either side
ARROW = 0.16  # of the panel's half width, for a tilt of 25 degrees


@picture
def plan_picture(
    visits: Visits,
    chosen: Sequence[int],
    kinds: Sequence[str],
    gap: GapMap | None,
    title: str,
    subtitle: str,
) -> Figure:
    """PNG: a column a height; with a map one row for vertical and one for tilted poses.

    Parameters
    ----------
    visits, chosen, kinds
        Planned visits in measuring order, and what each changes.
    gap
        The gap over the workspace; None: the poses alone.
    title, subtitle
        Headings.
    """
    poses = visits.pose[list(chosen)]
    groups = height_groups(poses[:, 2])
    panel_of = group_of(poses[:, 2], groups)
    tilted = poses[:, 3:5].any(axis=1)
    kinds_of_panel = ("",) if gap is None else (", vertical", f", tilted {deg_from_rad(gap.max_tilt):.3g}°")
    across = _across(len(groups))
    rows = -(-len(groups) // across) * len(kinds_of_panel)
    right = 0.35 if gap is None else 1.2
    width = max(across * PANEL + 0.75 + right, NARROWEST)
    height = rows * (PANEL + 0.35) + 1.9
    farthest = max(mm_from_m(float(np.abs(poses[:, :2]).max())), mm_from_m(gap.x[-1]) if gap is not None else 1.0)
    numbers = _numbers(visits, chosen)
    with house_style():
        figure = new_figure(width, height)
        grid = figure.add_gridspec(
            rows, across, left=0.75 / width, right=1 - right / width, bottom=1.05 / height,
            top=1 - 1.15 / height, wspace=0.12, hspace=0.2,
        )  # fmt: skip
        highest = 0.0 if gap is None else float(np.nanmax([_top(gap.vertical), _top(gap.tilted), 1e-6]))
        drawn: Any = None
        for which, group in enumerate(groups):
            for leaning, words in enumerate(kinds_of_panel):
                row, column = which // across * len(kinds_of_panel) + leaning, which % across
                axes = figure.add_subplot(grid[row, column])
                if gap is not None:
                    drawn = _map(axes, gap, (gap.vertical, gap.tilted)[leaning][which], highest)
                own = (panel_of == which) & ((tilted == bool(leaning)) | (gap is None))
                _marks(axes, poses, kinds, numbers, np.flatnonzero(own), ROOM * farthest)
                axes.set_title(f"{_height_text(group)}{words}", fontsize=10)
                below = which + across >= len(groups) and leaning == len(kinds_of_panel) - 1
                axes.set_xlabel("X mm" if below else "")
                axes.set_ylabel("Y mm" if column == 0 else "")
                axes.tick_params(labelleft=column == 0, labelbottom=below)
        if drawn is not None:
            bar = figure.add_axes((1 - 0.95 / width, 1.05 / height, 0.18 / width, 1 - 2.2 / height))
            figure.colorbar(drawn, cax=bar, label="gap at one pose, standard deviations")
            bar.grid(visible=False)
        _legend(figure, kinds)
        figure.text(0.75 / width, 1 - 0.42 / height, shortened(plain(title), 90), fontsize=14, weight="bold")
        figure.text(0.75 / width, 1 - 0.72 / height, shortened(plain(subtitle), 130), fontsize=10, color=MUTED)
        return figure


def _across(panels: int) -> int:
    """Panels in a row: as many as fit, the rows filled evenly."""
    return -(-panels // -(-panels // MOST_ACROSS))


def _height_text(group: FloatArray) -> str:
    """A panel's height, or the heights put together in it."""
    low, high = (f"{mm_from_m(float(group[end])):.5g}" for end in (0, -1))
    return f"z = {low} mm" if low == high else f"z = {low} to {high} mm"


def _top(values: FloatArray) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else 0.0


def _map(axes: Axes, gap: GapMap, values: FloatArray, highest: float) -> Any:
    x, y = mm_from_m(gap.x), mm_from_m(gap.y)
    axes.set_facecolor("#eceff3")
    return axes.pcolormesh(x, y, values, cmap=COLOUR_MAP, vmin=0.0, vmax=highest, shading="nearest", rasterized=True)


def _numbers(visits: Visits, chosen: Sequence[int]) -> list[str]:
    """Where each visit stands in measuring order; visits to one pose share a label."""
    poses = [visits.pose[v].tobytes() for v in chosen]
    return [", ".join(str(k + 1) for k, other in enumerate(poses) if other == pose) for pose in poses]


def _marks(
    axes: Axes, poses: FloatArray, kinds: Sequence[str], numbers: Sequence[str], own: NDArray[np.int64], half: float
) -> None:
    """Poses by kind, the tilt of the spindle as a line toward where it leans, numbered in measuring order."""
    names = list(dict.fromkeys(kinds))
    labelled: set[str] = set()
    for k in own:
        x, y = (float(v) for v in mm_from_m(poses[k, :2]))
        # The spindle's axis R z leans toward (sin b cos a, -sin a) for small yaw.
        lean = np.array([np.sin(poses[k, 4]) * np.cos(poses[k, 3]), -np.sin(poses[k, 3])])
        if lean.any():
            dx, dy = (ARROW * half * lean / np.sin(np.radians(25.0))).tolist()
            axes.plot([x, x + dx], [y, y + dy], color=INK, lw=2.6, zorder=4)
            axes.plot([x, x + dx], [y, y + dy], color="white", lw=1.4, zorder=5)
        marker, colour = MARKS[names.index(kinds[k]) % len(MARKS)]
        axes.plot(x, y, marker, ms=8, mfc=colour, mec=INK, mew=1.2, zorder=6, ls="none")
        if numbers[k] not in labelled:
            box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.8}
            # Towards the middle, so that labels stay in their panel; each elsewhere where marks crowd.
            near = [j for j in own if np.abs(poses[j, :2] - poses[k, :2]).max() < CLOSE]
            place = list(dict.fromkeys(numbers[j] for j in near)).index(numbers[k]) % 4
            left, above = (x > 0.25 * half) != (place >= 2), place % 2 == 0
            if lean.any() and place == 0 and len(numbers[k]) < SHORT:  # not upon the line
                left, above = bool(lean[0] > 0.0), bool(lean[1] <= 0.0)
            axes.annotate(
                numbers[k],
                (x, y),
                xytext=(-7 if left else 7, 6 if above else -6),
                textcoords="offset points",
                ha="right" if left else "left",
                va="bottom" if above else "top",
                fontsize=7.5,
                zorder=7,
                bbox=box,
            )
            labelled.add(numbers[k])
    axes.set_xlim(-half, half)
    axes.set_ylim(-half, half)
    axes.set_aspect("equal")
    axes.grid(visible=False)


def _legend(figure: Any, kinds: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    names = list(dict.fromkeys(kinds))
    handles = [
        Line2D([], [], marker=MARKS[k % len(MARKS)][0], ls="none", ms=8, mfc=MARKS[k % len(MARKS)][1], mec=INK)
        for k in range(len(names))
    ]
    left = 0.75 / figure.get_size_inches()[0]
    figure.legend(
        handles,
        names,
        loc="lower left",
        bbox_to_anchor=(left, 0.0),
        handletextpad=0.2,
        ncol=min(len(names), 6),
        frameon=False,
        fontsize=9,
        borderaxespad=0.6,
    )


def picture_arguments(proposal: Proposal) -> tuple[Any, ...]:
    """What `plan_picture` takes: the visits, and of a plan between rivals how well each place tells them apart."""
    found, name = proposal.plan, proposal.machine.name
    if isinstance(found, Plan):
        gap = gap_map(proposal.machine, found, proposal.menu, proposal.effect_files)
        title = f"What tells {gap.pair[0]} from {gap.pair[1]}"
        text = f"machine {name}   ·   colour: gap of one pose with the reference tool, X, Y and Z read"
        return found.visits, found.chosen, found.kinds, gap, title, text
    clampings, readings = len(found.visits), len(found.visits.readings)
    text = f"machine {name}   ·   {clampings} clampings, {readings} readings; lines: where spindles lean"
    return found.visits, range(clampings), found.purposes, None, "A first campaign", text


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    return ("plan.csv", "plan.json", TABLES, *(("plan.png",) if plots else ()))


def files(proposal: Proposal, document: PlanDocument, *, plots: bool = True) -> dict[str, Content]:
    """The measurement file to fill in, `document` as JSON, and with `plots` the picture."""
    contents: dict[str, Content] = {
        "plan.csv": plan_csv(rows_of(proposal)),
        "plan.json": json.dumps(document, indent=2, ensure_ascii=False) + "\n",
    }
    if isinstance(proposal.plan, Plan):
        contents[TABLES] = tables_of(proposal)
    return contents | ({"plan.png": plan_picture(*picture_arguments(proposal))} if plots else {})


def text(document: PlanDocument) -> str:
    """The visits in measuring order, then what is to be expected; that before them where it is nothing."""
    promise = list(document["text"])
    lines = [] if document.get("worth_measuring", True) else [promise.pop(0), ""]
    lines += [
        f"{'':>4} {'x':>7} {'y':>7} {'z':>7} mm {'a':>6} {'b':>6} deg {'tool':>5} mm  load N     set-up, directions"
    ]
    for visit in document["visits"]:
        loads = "/".join(f"{force:g}" for force in visit["forces_N"])
        where = ", ".join([*([visit["setup"]] if visit["setup"] else []), " ".join(visit["directions"])])
        lines.append(
            f"{visit['clamp']:>4} {visit['x_mm']:>7.1f} {visit['y_mm']:>7.1f} {visit['z_mm']:>7.1f}    "
            f"{visit['a_deg']:>6.1f} {visit['b_deg']:>6.1f}     {visit['tool_extension_mm']:>5g}     {loads:<10} "
            f"{where}"
        )
        if document["kind"] == "rivals":
            lines.append(f"{'':>5}{visit['why']}")
    lines += ["", *promise]
    lines += [f"note: {note}" for note in document["notes"]]
    return "\n".join(lines)


# -- raw records reduced -----------------------------------------------------------------------------------------------

COLUMNS = 4
MOST = 60  # loops in one picture; further ones are counted in its heading


@picture
def loops_png(loops: Sequence[tuple[Loop, LoopFigures]], title: str) -> Figure:
    """One small diagram a loop, in the order of the file, as PNG."""
    shown = min(len(loops), MOST)
    columns = min(COLUMNS, shown)
    rows = math.ceil(shown / columns)
    with house_style():
        figure = new_figure(max(6.0, 3.4 * columns), 2.9 * rows + 0.9)
        more = f"; the first {MOST} of {len(loops)} loops" if len(loops) > MOST else ""
        figure.suptitle(f"{title}: force over deflection{more}", x=0.02, ha="left", weight="bold", color=INK)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for ax, (loop, one) in zip(axes, loops, strict=False):
            deflection = um_from_m(loop.deflection)
            ends = [int(np.argmin(loop.drive)), int(np.argmax(loop.drive))]
            ax.plot(deflection[ends], loop.force[ends], color=SECOND_ORANGE, linewidth=1.6, label="secant")
            ax.plot(deflection, loop.force, color=MUTED, linewidth=1.0, marker="o", markersize=3.5)
            ax.set_title(loop.title, fontsize=8.5)
            ax.text(
                0.04,
                0.95,
                f"{n_per_mm_from_n_per_m(one.stiffness):,.0f} N/mm",
                transform=ax.transAxes,
                va="top",
                fontsize=9,
                color=SECOND_ORANGE,
            )
            ax.set_xlabel("deflection in \u00b5m", fontsize=8)
            ax.set_ylabel("force in N", fontsize=8)
            ax.tick_params(labelsize=8)
        for ax in axes[shown:]:
            ax.set_axis_off()
        height = figure.get_size_inches()[1]
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.35 / height))
        return figure


def reduction_figure(reduction: Reduction) -> Figure:
    """Force against deflection of each loop; without records the struts over their dates. Raises `InputError`."""
    if reduction.recorded:
        return loops_png.figure(reduction.recorded, reduction.title)
    if not dated(reduction.history):
        raise InputError("nothing to draw: neither records nor several dates")
    return history_png.figure(reduction.history)


def reduction_pictures(reduction: Reduction, out: Path) -> dict[Path, Content]:
    """The loops drawn, and dated struts over their dates, beside the measurement file `out`."""
    pictures: dict[Path, Content] = {}
    if reduction.recorded:
        pictures[out.with_name(f"{out.stem}_loops.png")] = loops_png(reduction.recorded, reduction.title)
    if dated(reduction.history):
        pictures[out.with_name(f"{out.stem}_history.png")] = history_png(reduction.history)
    return pictures


def reduction_text(reduction: Reduction) -> str:
    """The figures of the loops and the struts' histories; rows of a table of stiffnesses say nothing themselves."""
    pairs = zip(reduction.to_dict()["loops"], reduction.loops, strict=True)
    recorded = [entry for entry, loop in pairs if len(loop.force)]
    history = history_text(reduction.history, undated=not recorded)
    return "\n".join([loops_text(recorded), *history]) if recorded else "\n".join(history).lstrip("\n")


def loops_text(entries: Sequence[Mapping[str, Any]]) -> str:
    """The figures for people: a line a loop."""
    heading = ("loop", "N/mm", "force N", "deflection um", "lost motion um", "width um", "linearity %", "closure um")
    rows: list[tuple[str, ...]] = [heading]
    for one in entries:
        force = "-" if one["force_N"] is None else f"{one['force_N']:.0f}"
        cells = [one["loop"], f"{one['stiffness_N_per_mm']:.0f}", force]
        for name in ("deflection_um", "lost_motion_um", "loop_width_um", "linearity_percent", "closure_um"):
            cells.append("-" if one[name] is None else f"{one[name] + 0.0:.1f}")
        rows.append(tuple(cells))
    widths = [max(len(row[i]) for row in rows) for i in range(len(heading))]
    lines = [
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]
    return "\n".join([*lines, *(f"{one['loop']}: {one['shape']['text']}" for one in entries if one["shape"]["text"])])
