"""Pictures of an update: before and after, and the paper's Figure 3."""

from matplotlib.figure import Figure

from toolpath_stiff.correction.result import Update
from toolpath_stiff.report.colours import BLUE, MUTED
from toolpath_stiff.report.pictures.before_after import before_after
from toolpath_stiff.report.pictures.style import new_figure, panel
from toolpath_stiff.report.words import significant


def figure3(update: Update) -> Figure | None:
    """The paper's Figure 3: mean error against the stiffness of the platform's bars.

    With the machine's own strut law, and with the one that makes the error smallest for each platform.
    """
    if (curve := update.bars) is None:
        return None
    bars, given, refitted = curve.bars[:-1], 100.0 * curve.error[:-1], 100.0 * curve.error_refitted[:-1]
    paper = "Figure 3 of Clinton, Zhang and Wavering (1997), computed here"
    figure = new_figure(11.0, 5.2, "How stiff must the platform be taken?", paper)
    axes = panel(figure, 0.99, 0.68, 9.57, 3.54)
    axes.plot(bars, given, color=BLUE, lw=2.0, label="with the machine file's strut law")
    axes.plot(bars, refitted, color=MUTED, lw=1.5, ls="--", label="strut law refitted for each platform")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(lambda value, _: significant(value, 1))
    axes.set(xlabel="stiffness of each platform bar, N/m", ylabel="mean |modelled - measured| / measured, %")
    axes.legend(frameon=False)
    return figure


def fits(update: Update) -> Figure:
    """Where model and measurements differ, before and after."""
    first, last = update.steps[0], update.steps[-1]
    held_out, refitted = update.document["steps"][-1]["held_out_error_percent"], 100.0 * update.refitted.error
    return before_after(update.task.data.of_tip, (first.residual, last.residual), last.title, held_out, refitted)


PICTURES = {"before_after.png": fits, "figure3.png": figure3}
