"""Picture of a plan: its poses, one panel per height."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.planning.plan import RivalPlan
from toolpath_stiff.planning.result import Plan
from toolpath_stiff.planning.visits import Visits
from toolpath_stiff.report.colours import INK
from toolpath_stiff.report.pictures.style import new_figure
from toolpath_stiff.report.words import plain, shortened
from toolpath_stiff.units import mm_from_m

# Colours that the colour-blind can tell apart (Okabe and Ito 2008), with different shapes.
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
MOST_LEVELS = 8  # most heights with their own panel; if there are more, neighbours share one
NARROWEST = 8.0  # inches, for the headings
ROOM = 1.2  # half a panel over the farthest pose: room for leaning marks and labels
CLOSE = 0.06  # m between marks whose labels would cover each other
ARROW = 0.16  # of the panel's half width, for a tilt of 25 degrees


def plan(of: Plan) -> Figure:
    """The visits, one panel per height."""
    choice, name = of.choice, of.machine.name
    if isinstance(choice, RivalPlan):
        first, second = (rival.name for rival in choice.rivals[:2])
        title, what = f"What tells {first} from {second}", f"{len(choice.chosen)} poses"
    else:
        title, what = "A first campaign", f"{len(choice.visits)} clampings, {len(choice.visits.readings)} readings"
    note = f"machine {name}   ·   {what}; lines: where spindles lean"
    return visits_drawn(choice.visits, choice.chosen, choice.kinds, (title, note))


def visits_drawn(visits: Visits, chosen: Sequence[int], kinds: Sequence[str], heading: tuple[str, str]) -> Figure:
    """Visits, one panel per height.

    Parameters
    ----------
    visits, chosen, kinds
        Planned visits in measuring order, and what each changes.
    heading
        Title, and what it is about.
    """
    poses = visits.pose[list(chosen)]
    heights = np.round(poses[:, 2], 4)
    groups = np.array_split(np.unique(heights), min(len(np.unique(heights)), MOST_LEVELS))
    across = -(-len(groups) // -(-len(groups) // MOST_ACROSS))  # as many as fit, the rows filled evenly
    rows = -(-len(groups) // across)
    width = max(across * PANEL + 1.1, NARROWEST)
    height = rows * (PANEL + 0.35) + 1.9
    farthest = max(mm_from_m(float(np.abs(poses[:, :2]).max())), 1.0)
    numbers = _numbers(visits, chosen)
    figure = new_figure(width, height, shortened(plain(heading[0]), 90), shortened(plain(heading[1]), 130), 0.75)
    grid = figure.add_gridspec(
        rows, across, left=0.75 / width, right=1 - 0.35 / width, bottom=1.05 / height,
        top=1 - 1.15 / height, wspace=0.12, hspace=0.2,
    )  # fmt: skip
    for which, group in enumerate(groups):
        axes = figure.add_subplot(grid[which // across, which % across])
        _marks(axes, poses, kinds, numbers, np.flatnonzero(np.isin(heights, group)), ROOM * farthest)
        low, high = (f"{mm_from_m(float(group[end])):.5g}" for end in (0, -1))
        axes.set_title(f"z = {low}{'' if low == high else f' to {high}'} mm", fontsize=10)
        below, first = which + across >= len(groups), which % across == 0
        axes.set(xlabel="X mm" if below else "", ylabel="Y mm" if first else "")
        axes.tick_params(labelleft=first, labelbottom=below)
    _legend(figure, kinds)
    return figure


def _numbers(visits: Visits, chosen: Sequence[int]) -> list[str]:
    """Labels of the visits: their numbers in measuring order; visits to one pose share a label."""
    poses = [visits.pose[v].tobytes() for v in chosen]
    return [", ".join(str(k + 1) for k, other in enumerate(poses) if other == pose) for pose in poses]


def _marks(
    axes: Axes, poses: FloatArray, kinds: Sequence[str], numbers: Sequence[str], here: IntArray, half: float
) -> None:
    """Draw poses by kind, the spindle's tilt as a line in the direction it leans, numbered in measuring order."""
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
            # Towards the middle, so that labels stay in their panel; at different places where marks crowd.
            near = [j for j in here if np.abs(poses[j, :2] - poses[k, :2]).max() < CLOSE]
            place = list(dict.fromkeys(numbers[j] for j in near)).index(numbers[k]) % 4
            left, above = (x > 0.25 * half) != (place >= 2), place % 2 == 0
            axes.annotate(
                numbers[k], (x, y), xytext=(-7 if left else 7, 6 if above else -6), textcoords="offset points",
                ha="right" if left else "left", va="bottom" if above else "top", fontsize=7.5, zorder=7, bbox=box,
            )  # fmt: skip
            labelled.add(numbers[k])
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    axes.grid(visible=False)


def _legend(figure: Figure, kinds: Sequence[str]) -> None:
    names = list(dict.fromkeys(kinds))
    marks = [MARKS[k % len(MARKS)] for k in range(len(names))]
    figure.legend(
        [Line2D([], [], marker=shape, ls="none", ms=8, mfc=colour, mec=INK) for shape, colour in marks],
        names, loc="lower left", bbox_to_anchor=(0.75 / figure.get_size_inches()[0], 0.0), handletextpad=0.2,
        ncol=min(len(names), 6), frameon=False, fontsize=9, borderaxespad=0.6,
    )  # fmt: skip


PICTURES = {"plan.png": plan}
