"""Picture of an update: before and after."""

from matplotlib.figure import Figure

from toolpath_stiff.correction.result import Update
from toolpath_stiff.report.pictures.before_after import before_after


def fits(update: Update) -> Figure:
    """Differences of model and measurements, before and after."""
    first, last = update.steps[0], update.steps[-1]
    held_out, refitted = update.document["steps"][-1]["held_out_error_percent"], 100.0 * update.refitted.error
    return before_after(update.task.data.of_tip, (first.residual, last.residual), last.title, held_out, refitted)


PICTURES = {"before_after.png": fits}
