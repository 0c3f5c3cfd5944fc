"""The results of a search for a placement: page, files and text."""

from __future__ import annotations

from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.files import Content
from toolpath_stiff.placement.drawn_path import DrawnPath, drawn_path
from toolpath_stiff.placement.result import Placement, Refused, Written
from toolpath_stiff.placement.rows import COLUMNS, PlacementRow
from toolpath_stiff.report.figure import page_colours
from toolpath_stiff.report.pages import render
from toolpath_stiff.report.place.pictures import front_picture, profiles_picture, workspace_picture
from toolpath_stiff.report.place.sheet import setup_sheet
from toolpath_stiff.report.words import machine_text, plain
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, number

POINTS = (150, 800)  # of the path on the page, fewest and most


ENDS = (0.05, 0.95)  # of the path's length, all placements together, between which the colours run


VALUES = 48_000  # points times placements that the page holds, some 300 kB


def place_page(placed: Placement) -> str:
    """The page's text."""
    best, present = placed.best, placed.present
    shown = [*placed.front, *([present] if present else [])]
    path = drawn_path(
        best.model,
        placed.program,
        np.array([row.origin for row in shown]),
        best.load,
        force=best.force,
        step=best.step,
        points=int(np.clip(VALUES // len(shown), *POINTS)),
    )
    data = {
        "front": [vars(row) for row in placed.front],
        "chosen": (placed.chosen.number or 0) - 1,
        "recommended": placed.search.recommended - 1,
        "before": present.figures() if present else None,
        "before_reason": plain(placed.present_reason),
        "force": best.force,
        "keepouts": [
            {"name": plain(box.name), "box": _corners(mm_from_m(box.corners))} for box in placed.task.rules.keepouts
        ],
        "workspace": _corners(mm_from_m(best.machine.limits.workspace)),
        **_drawn(path),
        **page_colours(),
    }
    return render(
        "place.html",
        styles=["viewer.css", "place.css"],
        scripts=["stage.js", "viewer.js", "profile.js", "place.js"],
        data=data,
        title=f"Placements of {placed.program.name}",
        about=f"machine {machine_text(placed.machine_stated)} · load {best.load}, {best.force:g} N",
        objective=placed.objective,
        load=str(best.load),
        note=_note(path),
        warnings=placed.warnings,
    )


def _drawn(path: DrawnPath) -> dict[str, Any]:
    """The path in the program's axes and its stiffness; the tool's axis where it leans."""
    stiffness = n_per_mm_from_n_per_m(path.stiffness)
    about = np.isfinite(stiffness) & ~path.plunge
    if not about.any():
        about = np.isfinite(stiffness)
    finite = stiffness[about]
    length = np.broadcast_to(_lengths(path), stiffness.shape)[about]
    low, high = _scale(finite, length)
    digits = max(0, 5 - int(np.log10(max(float(finite.max()), 1.0))))  # six digits
    leaning = bool((path.axis[:, 2] < 1.0 - 1e-12).any())
    rounded = np.round(stiffness, digits)
    values = (rounded if digits else np.nan_to_num(rounded).astype(np.int64)).tolist()
    for row, column in np.argwhere(np.isnan(stiffness)):
        values[row][column] = None
    return {
        "position": np.round(mm_from_m(path.position), 3).tolist(),
        "axis": np.round(path.axis, 5).tolist() if leaning else None,
        "s": np.round(mm_from_m(path.s), 2).tolist(),
        "cut": path.cut.tolist(),
        "plunge": path.plunge.tolist() if path.plunge.any() else None,
        "stiffness": values,
        "scale": [low, high],
        "beyond": [bool(np.nanmin(stiffness) < low), bool(np.nanmax(stiffness) > high)],
    }


def _scale(stiffness: FloatArray, length: FloatArray) -> tuple[float, float]:
    """Ends of the colour scale in N/mm: a few corners would otherwise take all the contrast."""
    order = np.argsort(stiffness, kind="stable")
    along = np.cumsum(length[order])
    low, high = (float(v) for v in stiffness[order[np.searchsorted(along, np.array(ENDS) * along[-1])]])
    return (low, high) if high > low * (1.0 + 1e-6) else (low * (1.0 - 1e-3), high * (1.0 + 1e-3))


def _lengths(path: DrawnPath) -> FloatArray:
    """(m,) length in m that each drawn point stands for: half the way to its neighbours in the same cut."""
    step = np.where(np.diff(path.cut) == 0, np.diff(path.s), 0.0)
    length = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))
    return np.asarray(length if length.any() else np.ones(len(length)))


def _corners(corners: FloatArray) -> list[list[float | None]]:
    """Lower and upper corner in mm; None where the machine file sets no bound."""
    return [[round(v, 3) if np.isfinite(v) else None for v in corner] for corner in corners.tolist()]


def _note(path: DrawnPath) -> str:
    shown = len(path.s)
    scale = f" Colours span the middle {100.0 * (ENDS[1] - ENDS[0]):.0f} % of the length at all placements"
    scale += ", plunges left out." if path.plunge.any() else "."
    if shown == path.samples:
        return f"All {number(shown)} samples of the cutting path are drawn.{scale}"
    return (
        f"Drawn are {number(shown)} of the {number(path.samples)} samples of the cutting path, joined by straight "
        "lines, each with the stiffness that was evaluated there; the figures in the table are of all samples." + scale
    )


def text(placed: Placement) -> str:
    """What got worse, the placement, what it brings, what it costs."""
    best, present, count = placed.chosen, placed.present, len(placed.front)
    first = len(placed.worse) + placed.search.nothing_better
    label = "picked" if placed.picked else "recommended"
    which = f"placement {best.number} of {count}, picked" if placed.picked else f"objective {placed.objective}"
    lines = [
        *(f"warning         {warning}" for warning in placed.warnings[:first]),
        f"program         {placed.program.name} on {machine_text(placed.machine_stated)}, load {placed.best.load}",
        f"{label:<16}X{best.x_mm:.3f} Y{best.y_mm:.3f} Z{best.z_mm:.3f}, turned by {best.rotation_deg:.3f} degrees "
        f"({which})",
    ]
    if best.a_deg or best.b_deg:
        lines.append(f"                set-up tilted by A{best.a_deg:.3f} B{best.b_deg:.3f} degrees")
    lines.append(f"  stiffness     {_figures_words(best)}")
    lines.append(f"  before        {_figures_words(present) if present else f'out of reach: {placed.present_reason}'}")
    if best.plunge_mean_N_per_mm is not None:
        now = f", before {number(present.plunge_mean_N_per_mm)}" if present else ""
        mean = number(best.plunge_mean_N_per_mm)
        lines.append(f"  plunges       mean {mean}{now} N/mm, along the tool axis, not counted above")
    for goal, cost in placed.trade_offs.items():
        lines.append(
            f"  best {goal:<9} {number(cost['best_on_front_N_per_mm'])} on the front, "
            f"{number(cost['chosen_N_per_mm'])} here, N/mm"
        )
    margin = min(value for value in (best.margin, best.rapid_margin, 1.0) if value is not None)
    lines.append(f"  margin        {100.0 * margin:.1f} % of a limit's span at least, rapids included")
    blocks = placed.offsets
    lines.append(f"LinuxCNC        {blocks.linuxcnc or blocks.linuxcnc_reason}")
    fanuc = (blocks.fanuc or blocks.fanuc_reason).replace("\n", "\n                ")
    lines.append(f"Fanuc-style     {fanuc}")
    evaluated = placed.search.pose_evaluations
    lines.append(f"front           {count} placements, {number(evaluated)} poses evaluated")
    lines += _written(placed.written) if placed.written else []
    lines += [f"warning         {warning}" for warning in placed.warnings[first:]]
    return "\n".join(lines)


def _figures_words(row: PlacementRow) -> str:
    return (
        f"mean {number(row.mean_N_per_mm)}, range {number(row.range_N_per_mm)}, "
        f"weakest {number(row.min_N_per_mm)} N/mm, deflection {row.mean_deflection_um:.1f} um"
    )


def _written(written: Written | Refused) -> list[str]:
    """What became of the transformed program."""
    if isinstance(written, Refused):
        return [f"not rewritten   {written.file}: {written.refused}"]
    zero, apart = written.analysed_at, written.relative_difference
    figures = ", ".join(f"{name} {value:.1e}" for name, value in apart.items())
    lines = [
        f"rewritten       {written.file}; at X{zero['x_mm']:g} Y{zero['y_mm']:g} Z{zero['z_mm']:g}, "
        f"{zero['rotation_deg']:g} degrees it differs from the placed program by (relative) {figures}"
    ]
    return lines + [f"                {note}" for note in written.notes]


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    data = ("placements.csv", "placement.json")
    return (*data, "report.html", "front.png", "profiles.png", "map.png", "setup.pdf") if plots else data


def files(placed: Placement, *, plots: bool = True) -> dict[str, Content]:
    """The front as a table, everything as JSON, and with `plots` page, pictures and set-up sheet."""
    contents: dict[str, Content] = {
        "placements.csv": csv_text(COLUMNS, ([_cell(value) for value in vars(row).values()] for row in placed.front)),
        "placement.json": placed.to_json(),
    }
    if plots:
        contents["report.html"] = place_page(placed)
        contents["front.png"] = front_picture(placed)
        contents["profiles.png"] = profiles_picture(placed.best, placed.before)
        contents["map.png"] = workspace_picture(placed.best, placed.before)
        contents["setup.pdf"] = setup_sheet(placed)
    return contents


def _cell(value: float | None) -> str:
    """A number of placements.csv; nothing where there is none."""
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.6f}"
