"""A plan in a picture, files and text: how far its rivals would be apart over the workspace, and the planned poses."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.files import Content
from toolpath_stiff.planning.gap_map import GapMap, gap_map, group_of, height_groups
from toolpath_stiff.planning.plan import RivalPlan
from toolpath_stiff.planning.result import Plan
from toolpath_stiff.planning.rows import plan_csv
from toolpath_stiff.planning.tables import TABLES, tables_of
from toolpath_stiff.planning.visits import Visits
from toolpath_stiff.report.axes import colour_scale, heading
from toolpath_stiff.report.figure import COLOUR_MAP, INK, new_figure, picture
from toolpath_stiff.report.words import plain, shortened
from toolpath_stiff.units import deg_from_rad, mm_from_m

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
    across = -(-len(groups) // -(-len(groups) // MOST_ACROSS))  # as many as fit, the rows filled evenly
    rows = -(-len(groups) // across) * len(kinds_of_panel)
    right = 0.35 if gap is None else 1.2
    width = max(across * PANEL + 0.75 + right, NARROWEST)
    height = rows * (PANEL + 0.35) + 1.9
    farthest = max(mm_from_m(float(np.abs(poses[:, :2]).max())), mm_from_m(gap.x[-1]) if gap is not None else 1.0)
    numbers = _numbers(visits, chosen)
    figure = new_figure(width, height)
    grid = figure.add_gridspec(
        rows, across, left=0.75 / width, right=1 - right / width, bottom=1.05 / height,
        top=1 - 1.15 / height, wspace=0.12, hspace=0.2,
    )  # fmt: skip
    gaps = [] if gap is None else [gap.vertical.ravel(), gap.tilted.ravel()]
    highest = float(np.nanmax(np.concatenate([[1e-6], *gaps])))
    drawn: Any = None
    for (which, group), (leaning, words) in product(enumerate(groups), enumerate(kinds_of_panel)):
        row, column = which // across * len(kinds_of_panel) + leaning, which % across
        axes = figure.add_subplot(grid[row, column])
        if gap is not None:
            axes.set_facecolor("#eceff3")
            drawn = axes.pcolormesh(
                mm_from_m(gap.x), mm_from_m(gap.y), (gap.vertical, gap.tilted)[leaning][which], cmap=COLOUR_MAP,
                vmin=0.0, vmax=highest, shading="nearest", rasterized=True,
            )  # fmt: skip
        here = (panel_of == which) & ((tilted == bool(leaning)) | (gap is None))
        _marks(axes, poses, kinds, numbers, np.flatnonzero(here), ROOM * farthest)
        low, high = (f"{mm_from_m(float(group[end])):.5g}" for end in (0, -1))
        axes.set_title(f"z = {low}{'' if low == high else f' to {high}'} mm{words}", fontsize=10)
        below = which + across >= len(groups) and leaning == len(kinds_of_panel) - 1
        axes.set_xlabel("X mm" if below else "")
        axes.set_ylabel("Y mm" if column == 0 else "")
        axes.tick_params(labelleft=column == 0, labelbottom=below)
    if drawn is not None:
        box = (1 - 0.95 / width, 1.05 / height, 0.18 / width, 1 - 2.2 / height)
        colour_scale(figure, drawn, box, "gap at one pose, standard deviations", thousands=False)
    _legend(figure, kinds)
    left, top = 0.75 / width, 1 - 0.42 / height
    heading(figure, left, top, shortened(plain(title), 90), 0.3 / height, shortened(plain(subtitle), 130))
    return figure


def _numbers(visits: Visits, chosen: Sequence[int]) -> list[str]:
    """Labels of the visits, their numbers in measuring order; visits to one pose share a label."""
    poses = [visits.pose[v].tobytes() for v in chosen]
    return [", ".join(str(k + 1) for k, other in enumerate(poses) if other == pose) for pose in poses]


def _marks(
    axes: Axes, poses: FloatArray, kinds: Sequence[str], numbers: Sequence[str], here: IntArray, half: float
) -> None:
    """Poses by kind, the tilt of the spindle as a line toward where it leans, numbered in measuring order."""
    names = list(dict.fromkeys(kinds))
    labelled: set[str] = set()
    for k in here:
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
            near = [j for j in here if np.abs(poses[j, :2] - poses[k, :2]).max() < CLOSE]
            place = list(dict.fromkeys(numbers[j] for j in near)).index(numbers[k]) % 4
            left, above = (x > 0.25 * half) != (place >= 2), place % 2 == 0
            if lean.any() and place == 0 and len(numbers[k]) < SHORT:  # not upon the line
                left, above = bool(lean[0] > 0.0), bool(lean[1] <= 0.0)
            axes.annotate(
                numbers[k], (x, y), xytext=(-7 if left else 7, 6 if above else -6), textcoords="offset points",
                ha="right" if left else "left", va="bottom" if above else "top", fontsize=7.5, zorder=7, bbox=box,
            )  # fmt: skip
            labelled.add(numbers[k])
    axes.set_xlim(-half, half)
    axes.set_ylim(-half, half)
    axes.set_aspect("equal")
    axes.grid(visible=False)


def _legend(figure: Any, kinds: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    names = list(dict.fromkeys(kinds))
    marks = [MARKS[k % len(MARKS)] for k in range(len(names))]
    figure.legend(
        [Line2D([], [], marker=shape, ls="none", ms=8, mfc=colour, mec=INK) for shape, colour in marks],
        names, loc="lower left", bbox_to_anchor=(0.75 / figure.get_size_inches()[0], 0.0), handletextpad=0.2,
        ncol=min(len(names), 6), frameon=False, fontsize=9, borderaxespad=0.6,
    )  # fmt: skip


def figure(plan: Plan) -> Figure:
    """The visits, and of a plan between rivals how well each place tells them apart."""
    return plan_picture.figure(*_picture_arguments(plan))


def _picture_arguments(plan: Plan) -> tuple[Any, ...]:
    choice, name = plan.choice, plan.machine.name
    if isinstance(choice, RivalPlan):
        gap = gap_map(plan.machine, choice, plan.effect_files)
        title = f"What tells {gap.pair[0]} from {gap.pair[1]}"
        text = f"machine {name}   ·   colour: gap of one pose with the reference tool, X, Y and Z read"
        return choice.visits, choice.chosen, choice.kinds, gap, title, text
    clampings, readings = len(choice.visits), len(choice.visits.readings)
    text = f"machine {name}   ·   {clampings} clampings, {readings} readings; lines: where spindles lean"
    return choice.visits, choice.chosen, choice.kinds, None, "A first campaign", text


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    return ("plan.csv", "plan.json", TABLES, *(("plan.png",) if plots else ()))


def files(plan: Plan, *, plots: bool = True) -> dict[str, Content]:
    """The measurement file to fill in, the document as JSON, and with `plots` the picture."""
    contents: dict[str, Content] = {"plan.csv": plan_csv(plan.rows), "plan.json": plan.to_json()}
    if isinstance(plan.choice, RivalPlan):
        contents[TABLES] = tables_of(plan.choice)
    return contents | ({"plan.png": plan_picture(*_picture_arguments(plan))} if plots else {})


def text(plan: Plan) -> str:
    """The visits in measuring order, then what is to be expected; that before them where it is nothing."""
    promise, between = plan.choice.sentences, isinstance(plan.choice, RivalPlan)
    lines = [promise.pop(0), ""] if isinstance(plan.choice, RivalPlan) and not plan.choice.gains else []
    lines += [
        f"{'':>4} {'x':>7} {'y':>7} {'z':>7} mm {'a':>6} {'b':>6} deg {'tool':>5} mm  load N     set-up, directions"
    ]
    for visit in plan.visits:
        loads = "/".join(f"{force:g}" for force in visit["forces_N"])
        where = ", ".join([*([visit["setup"]] if visit["setup"] else []), " ".join(visit["directions"])])
        lines.append(
            f"{visit['clamp']:>4} {visit['x_mm']:>7.1f} {visit['y_mm']:>7.1f} {visit['z_mm']:>7.1f}    "
            f"{visit['a_deg']:>6.1f} {visit['b_deg']:>6.1f}     {visit['tool_extension_mm']:>5g}     {loads:<10} "
            f"{where}"
        )
        if between:
            lines.append(f"{'':>5}{visit['why']}")
    return "\n".join([*lines, "", *promise, *(f"note: {note}" for note in plan.choice.notes)])
