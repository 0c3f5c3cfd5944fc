"""The results of a search for a placement: page, files and text."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.files import Content
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.placement.document import placement_of
from toolpath_stiff.placement.evaluator import Keepout
from toolpath_stiff.placement.paths import DrawnPath, drawn_path
from toolpath_stiff.report.figure import page_colours
from toolpath_stiff.report.pages import render
from toolpath_stiff.report.place.pictures import front_picture, profiles_picture, setup_sheet, workspace_picture
from toolpath_stiff.report.words import machine_text, plain
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from toolpath_stiff.placement.placing import Placed


POINTS = (150, 800)  # of the path on the page, fewest and most


ENDS = (0.05, 0.95)  # of the path's length, all placements together, between which the colours run


VALUES = 48_000  # points times placements that the page holds, some 300 kB


def place_page(summary: dict[str, Any], best: Analysis, program: Program, keepouts: Sequence[Keepout] = ()) -> str:
    """The page's text.

    Parameters
    ----------
    summary
        As in `placement.json`.
    best
        The analysis at the chosen placement: model, load, force and step are taken from it.
    program
        In the set-up frame, as read.
    keepouts
        Boxes to draw.
    """
    front = summary["front"]
    shown = front + ([summary["before"]] if summary["before"] else [])
    placements = np.array([placement_of(row) for row in shown])
    path = drawn_path(
        best.model,
        program,
        placements,
        best.load,
        force=best.force,
        step=best.step,
        points=int(np.clip(VALUES // len(shown), *POINTS)),
    )
    data = {
        "front": front,
        "chosen": summary["chosen"]["number"] - 1,
        "recommended": summary["recommended"]["number"] - 1,
        "before": summary["before"],
        "before_reason": plain(summary["before_reason"] or ""),
        "force": best.force,
        "keepouts": [{"name": plain(box.name), "box": _box(box.low, box.high)} for box in keepouts],
        "workspace": _workspace(best),
        **_drawn(path),
        **page_colours(),
    }
    return render(
        "place.html",
        styles=["viewer.css", "place.css"],
        scripts=["stage.js", "viewer.js", "profile.js", "place.js"],
        data=data,
        title=f"Placements of {summary['program']}",
        about=f"machine {machine_text(summary)} · load {summary['load']}, {summary['force_N']:g} N",
        objective=summary["objective"],
        load=summary["load"],
        note=_note(path),
        warnings=summary["warnings"],
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


def _workspace(best: Analysis) -> list[list[float | None]]:
    """Lower and upper corner in mm; None where the machine file sets no bound."""
    corners = mm_from_m(best.machine.limits.workspace)
    return [[round(float(v), 3) if np.isfinite(v) else None for v in corner] for corner in corners]


def _box(low: Sequence[float], high: Sequence[float]) -> list[list[float]]:
    return [[round(mm_from_m(v), 3) for v in corner] for corner in (low, high)]


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


def text(summary: dict[str, Any]) -> str:
    """What got worse, the placement, what it brings, what it costs; `summary` as in `placement.json`."""
    best, before = summary["chosen"], summary["before"]
    first = len(summary["worse"]) + bool(summary["search"].get("nothing_better"))
    which = f"placement {best['number']} of {len(summary['front'])}, picked" if summary["picked"] else "recommended"
    lines = [
        *(f"warning         {text}" for text in summary["warnings"][:first]),
        f"program         {summary['program']} on {machine_text(summary)}, load {summary['load']}",
        f"{'picked' if summary['picked'] else 'recommended':<16}X{best['x_mm']:.3f} Y{best['y_mm']:.3f} "
        f"Z{best['z_mm']:.3f}, turned by {best['rotation_deg']:.3f} degrees "
        f"({which if summary['picked'] else 'objective ' + summary['objective']})",
    ]
    if best["a_deg"] or best["b_deg"]:
        lines.append(f"                set-up tilted by A{best['a_deg']:.3f} B{best['b_deg']:.3f} degrees")
    for name, row in (("  stiffness", best), ("  before", before)):
        lines.append(f"{name:<16}{_figures_words(row) if row else 'out of reach: ' + summary['before_reason']}")
    lines += _plunges_words(best, before)
    for goal, cost in summary["trade_offs"].items():
        lines.append(
            f"  best {goal:<9} {number(cost['best_on_front_N_per_mm'])} on the front, "
            f"{number(cost['chosen_N_per_mm'])} here, N/mm"
        )
    lines.append(f"  margin        {100.0 * _smallest_margin(best):.1f} % of a limit's span at least, rapids included")
    blocks = summary["offset_blocks"]
    lines.append(f"LinuxCNC        {blocks['linuxcnc'] or blocks['linuxcnc_reason']}")
    fanuc = (blocks["fanuc"] or blocks["fanuc_reason"]).replace("\n", "\n                ")
    lines.append(f"Fanuc-style     {fanuc}")
    evaluated = summary["search"]["pose_evaluations"]
    lines.append(f"front           {len(summary['front'])} placements, {number(evaluated)} poses evaluated")
    lines += _written(summary["written"]) if summary["written"] else []
    lines += [f"warning         {text}" for text in summary["warnings"][first:]]
    return "\n".join(lines)


def _figures_words(row: dict[str, Any]) -> str:
    return (
        f"mean {number(row['mean_N_per_mm'])}, range {number(row['range_N_per_mm'])}, "
        f"weakest {number(row['min_N_per_mm'])} N/mm, "
        f"deflection {row['mean_deflection_um']:.1f} um"
    )


def _plunges_words(best: dict[str, Any], before: dict[str, Any] | None) -> list[str]:
    """The plunges, where they stand beside the other figures."""
    if best["plunge_mean_N_per_mm"] is None:
        return []
    now = f", before {number(before['plunge_mean_N_per_mm'])}" if before else ""
    return [
        f"  plunges       mean {number(best['plunge_mean_N_per_mm'])}{now} N/mm, along the tool axis, not counted above"
    ]


def _smallest_margin(row: dict[str, Any]) -> float:
    return float(min(value for value in (row["margin"], row["rapid_margin"], 1.0) if value is not None))


def _written(written: dict[str, Any]) -> list[str]:
    """What became of the transformed program."""
    if "refused" in written:
        return [f"not rewritten   {written['file']}: {written['refused']}"]
    at, apart = written["analysed_at"], written["relative_difference"]
    figures = ", ".join(f"{name} {value:.1e}" for name, value in apart.items())
    lines = [
        f"rewritten       {written['file']}; at X{at['x_mm']:g} Y{at['y_mm']:g} Z{at['z_mm']:g}, "
        f"{at['rotation_deg']:g} degrees it differs from the placed program by (relative) {figures}"
    ]
    return lines + [f"                {note}" for note in written["notes"]]


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes."""
    data = ("placements.csv", "placement.json")
    return (*data, "report.html", "front.png", "profiles.png", "map.png", "setup.pdf") if plots else data


def files(placed: Placed, *, plots: bool = True) -> dict[str, Content]:
    """The front as a table, everything as JSON, and with `plots` page, pictures and set-up sheet."""
    from toolpath_stiff.placement.document import COLUMNS

    summary = placed.summary
    rows = [[_cell(row[name]) for name in COLUMNS] for row in summary["front"]]
    contents: dict[str, Content] = {
        "placements.csv": csv_text(COLUMNS, rows),
        "placement.json": json.dumps(summary, indent=2) + "\n",
    }
    if plots:
        contents["report.html"] = place_page(summary, placed.best, placed.program, placed.task.rules.keepouts)
        contents["front.png"] = front_picture(summary)
        contents["profiles.png"] = profiles_picture(placed.best, placed.before)
        contents["map.png"] = workspace_picture(placed.best, placed.before)
        contents["setup.pdf"] = setup_sheet(summary, placed.best)
    return contents


def _cell(value: float | None) -> str:
    """A number of placements.csv; nothing where there is none."""
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.6f}"
