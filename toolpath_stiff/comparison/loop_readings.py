"""Readings of indicators beside the tip against the model: how much each loop gives way, and how much it should."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions
from toolpath_stiff.inference.covariances import Covariance
from toolpath_stiff.readings.dates import day_of, short_dates
from toolpath_stiff.readings.history import NOTHING, HistoryDocument, Readings, history
from toolpath_stiff.readings.measurements import Measurements

STANDS_OUT = 3.0  # standard deviations from which a loop is said to read something else than the model has


class LoopReadingEntry(TypedDict):
    """One reading; nm per N of load at the tip (of a strut alone: of force in it)."""

    file: str
    line: int
    point: str
    loop: str
    direction: str
    force_N: float
    read_nm_per_N: float
    model_nm_per_N: float
    off_nm_per_N: float
    sd_nm_per_N: float
    standard_deviations: float


class LoopEntry(TypedDict):
    """All readings of one loop; counted in the direction in which the machine file's struts would move it."""

    loop: str
    readings: int
    read_nm_per_N: float
    model_nm_per_N: float
    off_nm_per_N: float
    sd_nm_per_N: float
    standard_deviations: float
    text: str


class LoopsDocument(TypedDict):
    """Loops beside the tip: by loop, and reading by reading."""

    by_loop: list[LoopEntry]
    readings: list[LoopReadingEntry]


def loops_document(data: Measurements, log_model: FloatArray, spread: Covariance) -> LoopsDocument:
    """Readings of loops beside the tip.

    Parameters
    ----------
    data
        n readings, of the tip or of loops.
    log_model
        (n,) ln(N/m) that they should show, loops with their offsets.
    spread
        Their covariance; of ln readings.
    """
    beside = data.beside
    if beside is None:
        return {"by_loop": [], "readings": []}
    read, joined = data.compliance, np.exp(-log_model)
    model = beside.alone(joined)
    sd = np.sqrt(spread.diagonal) * joined
    rows = np.flatnonzero(beside.beside)
    along = directions(data)
    readings: list[LoopReadingEntry] = [
        {
            "file": str(data.file[i]),
            "line": int(data.line[i]),
            "point": str(data.point[i]),
            "loop": str(data.loop[i]),
            "direction": str(along[i]),
            "force_N": float(data.force[i]),
            "read_nm_per_N": 1e9 * float(read[i]),
            "model_nm_per_N": 1e9 * float(model[i]),
            "off_nm_per_N": 1e9 * float(read[i] - model[i]),
            "sd_nm_per_N": 1e9 * float(sd[i]),
            "standard_deviations": float((read[i] - model[i]) / sd[i]),
        }
        for i in rows.tolist()
    ]
    by_loop = []
    for name in dict.fromkeys(data.loop[rows].tolist()):
        own = data.loop == name
        weights = np.where(own, 1.0 / sd**2, 0.0)
        weights /= weights.sum()
        toward = beside.toward * weights
        off = float((toward * (read - model)).sum())
        error = float(np.sqrt(spread.squares(toward * joined)))
        by_loop.append(_entry(name, int(own.sum()), float(toward @ read), float(toward @ model), off, error))
    return {"by_loop": by_loop, "readings": readings}


def _entry(name: str, count: int, read: float, model: float, off: float, error: float) -> LoopEntry:
    ratio = off / error
    text = f"{name}: {1e9 * read:.2f} nm/N read in the mean of {count}, {1e9 * model:.2f} nm/N modelled"
    side = "more" if off > 0.0 else "less"
    text += f": {abs(ratio):.1f} standard deviations {side}" if abs(ratio) >= STANDS_OUT else ", which agrees"
    return {
        "loop": name,
        "readings": count,
        "read_nm_per_N": 1e9 * read,
        "model_nm_per_N": 1e9 * model,
        "off_nm_per_N": 1e9 * off,
        "sd_nm_per_N": 1e9 * error,
        "standard_deviations": ratio,
        "text": text,
    }


def strut_history(data: Measurements, log_model: FloatArray, seed: int) -> HistoryDocument:
    """Struts measured alone, over their dates and by the sign of their force.

    Readings at several lengths are reduced to the mean of these by the model's own stiffness, `log_model` (n,).
    """
    if data.beside is None:
        return NOTHING
    alone = np.array([loop.kind == "alone" for loop in data.beside.loops])[data.beside.which]
    names, log_read = data.loop[alone], np.log(data.stiffness[alone])
    modelled = log_model[alone]
    for name in np.unique(names):
        own = names == name
        log_read[own] -= modelled[own] - modelled[own].mean()
    dates = [""] * len(names) if data.date is None else data.date[alone].tolist()
    day = np.array([day_of(text) for text in dates], dtype=float)
    return history(Readings(names, day, log_read, data.beside.side[alone], short_dates(dates)), seed=seed)
