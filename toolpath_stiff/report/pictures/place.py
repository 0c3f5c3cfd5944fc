"""Pictures of a placement: the front, and the set-up sheet."""

from matplotlib.figure import Figure

from toolpath_stiff.placement.result import FIGURES, Placement
from toolpath_stiff.report.colours import INK, ORANGE, STIFFNESS
from toolpath_stiff.report.pictures.setup_sheet import setup_sheet
from toolpath_stiff.report.pictures.style import Look, colour_scale, in_thousands, new_figure, panel
from toolpath_stiff.report.words import machine_text, plain


def front(placed: Placement) -> Figure:
    """Range against mean, coloured by the weakest place: the front, the chosen placement, the present one."""
    best, before = placed.chosen, placed.present
    note = f"machine {machine_text(placed.machine_stated)}   ·   load {placed.best.load}"
    note += f"   ·   objective {placed.task.rules.objective}"
    figure = new_figure(9.0, 6.2, f"Placements of {plain(placed.best.program.name)}", note, 1.08)
    axes = panel(figure, 1.08, 0.74, 6.3, 4.28)
    mean, spread, weakest = ([getattr(row, key) for row in placed.front] for key in FIGURES.values())
    everything = [*weakest, *([before.min_N_per_mm] if before else [])]
    scale: Look = {"vmin": min(everything), "vmax": max(*everything, min(everything) * (1.0 + 1e-6))}
    dots = axes.scatter(mean, spread, s=34, c=weakest, cmap=STIFFNESS, ec=INK, lw=0.4, zorder=2, **scale)
    dots.set_label("front: no placement is better in all three")
    which = f"recommended, number {best.number}"
    ring: Look = {"ms": 16, "mfc": "none", "mec": ORANGE, "mew": 2.5}
    axes.plot(best.mean_N_per_mm, best.range_N_per_mm, "o", label=which, **ring)
    if before:
        look: Look = {
            "marker": "s",
            "s": 90,
            "c": [before.min_N_per_mm],
            "cmap": STIFFNESS,
            "ec": INK,
            "lw": 1.8,
            **scale,
        }
        axes.scatter([before.mean_N_per_mm], [before.range_N_per_mm], zorder=3, label="present placement", **look)
    axes.margins(0.08)
    axes.set(xlabel="mean stiffness, N/mm (more is better)", ylabel="range of stiffness, N/mm (less is better)")
    in_thousands(axes.xaxis, axes.yaxis)
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncol=3, fontsize=9)
    colour_scale(dots, panel(figure, 7.6, 0.74, 0.2, 4.28), "weakest place, N/mm (more is better)")
    return figure


PICTURES = {"front.png": front, "setup.pdf": setup_sheet}
