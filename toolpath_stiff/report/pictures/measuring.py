"""The pictures of raw records reduced to stiffnesses."""

from matplotlib.figure import Figure

from toolpath_stiff.readings.raw import Reduction
from toolpath_stiff.report.pictures.history import history, loops


def recorded(reduction: Reduction) -> Figure | None:
    """Force against deflection of each loop."""
    return loops(reduction.recorded, reduction.title) if reduction.recorded else None


def over_dates(reduction: Reduction) -> Figure | None:
    """Struts over their dates."""
    return history(reduction.history)


PICTURES = {"loops.png": recorded, "history.png": over_dates}
