"""Views of a search for a placement: page, files and text."""

from collections.abc import Iterator, Mapping

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.documents import number
from toolpath_stiff.placement.result import Placement, PlacementRow, Written
from toolpath_stiff.report.pages import render
from toolpath_stiff.report.place_path import drawn_path
from toolpath_stiff.report.words import counted, machine_text, plain
from toolpath_stiff.units import mm_from_m

COSTS = ("best_on_front_N_per_mm", "chosen_N_per_mm")


def text(placed: Placement) -> str:
    """A placement in words: what got worse, the placement, its benefits, its cost."""
    first = len(placed.alarms)
    before, after = (
        [("warning", text) for text in part] for part in (placed.warnings[:first], placed.warnings[first:])
    )
    rows = [*before, *facts(placed), *(_written(placed.written) if placed.written else []), *after]
    return "\n".join(f"{label:<16}{text}".replace("\n", "\n" + 16 * " ") for label, text in rows)


def facts(placed: Placement) -> list[tuple[str, str]]:
    """The chosen placement in words, each fact with its label."""
    best, present, blocks = placed.chosen, placed.present, placed.offsets
    which = f"(objective {placed.task.rules.objective})"
    zero = f"X{best.x_mm:.3f} Y{best.y_mm:.3f} Z{best.z_mm:.3f}, turned by {best.rotation_deg:.3f} degrees {which}"
    turned = f"the tool turned about its axis by {best.tool_turn_deg:.3f} degrees" if best.tool_turn_deg else ""
    tilt = f"set-up tilted by A{best.a_deg:.3f} B{best.b_deg:.3f} degrees"
    mean, now = best.plunge_mean_N_per_mm, f", before {number(present.plunge_mean_N_per_mm)}" if present else ""
    margin = min(1.0, float(placed.best.at.reach.margin.min()))  # includes moves that do not follow the work
    costs = [
        (f"  best {goal:<9} ", "{} on the front, {} here, N/mm".format(*(number(cost[name]) for name in COSTS)))
        for goal, cost in placed.trade_offs.items()
    ]
    return [
        ("program", f"{placed.best.program.name} on {machine_text(placed.machine_stated)}, load {placed.best.load}"),
        ("recommended", zero),
        *([("", tilt)] if best.a_deg or best.b_deg else []),
        *([("", turned)] if turned else []),
        ("  stiffness", _figures_words(best)),
        ("  before", _figures_words(present) if present else f"out of reach: {placed.present_reason}"),
        *([("  plunges", f"mean {number(mean)}{now} N/mm, along the tool axis, not counted above")] if mean else []),
        *costs,
        *([("  surface error", _error_words(placed.surface_error_um))] if placed.surface_error_um else []),
        ("  margin", f"{100.0 * margin:.1f} % of a limit's span at least, rapids included"),
        ("LinuxCNC", blocks.linuxcnc or blocks.linuxcnc_reason),
        ("Fanuc-style", blocks.fanuc or blocks.fanuc_reason),
        ("front", f"{counted(len(placed.front), 'placement')}, {number(placed.pose_evaluations)} poses evaluated"),
    ]


def _error_words(errors: Mapping[str, float]) -> str:
    before = f", before {errors['before']:.2f} um" if "before" in errors else ""
    return f"95 % of the final walls within {errors['chosen']:.2f} um{before} (mean over the height)"


def _figures_words(row: PlacementRow) -> str:
    return (
        f"mean {number(row.mean_N_per_mm)}, range {number(row.range_N_per_mm)}, "
        f"weakest {number(row.min_N_per_mm)} N/mm, deflection {row.mean_deflection_um:.1f} um"
    )


def _written(written: Written) -> list[tuple[str, str]]:
    if written.refused:
        return [("not rewritten", f"{written.file}: {written.refused}")]
    zero, apart = written.analysed_at, written.relative_difference
    figures = ", ".join(f"{name} {value:.1e}" for name, value in apart.items())
    where = f"X{zero['x_mm']:g} Y{zero['y_mm']:g} Z{zero['z_mm']:g}, {zero['rotation_deg']:g} degrees"
    text = f"{written.file}; at {where} it differs from the placed program by (relative) {figures}"
    return [("rewritten", text), *(("", note) for note in written.notes)]


def _table(placed: Placement) -> str:
    rows = [row.cells for row in placed.front]
    return csv_text(rows[0], ([_cell(value) for value in row.values()] for row in rows))


def _cell(value: float | None) -> str:
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.6f}"


def page(placed: Placement, drawn: Mapping[str, bytes]) -> Iterator[str]:
    """The page, in pieces."""
    best, present = placed.best, placed.present
    rows = [*placed.front, *([present] if present else [])]
    path, note = drawn_path(placed, rows)
    data = {
        "front": [row.cells for row in placed.front],
        "recommended": (placed.chosen.number or 0) - 1,
        "before": present.cells if present else None,
        "force": best.force,
        "keepouts": [
            {"name": plain(box.name), "box": _corners(mm_from_m(box.corners))} for box in placed.task.rules.keepouts
        ],
        "workspace": _corners(mm_from_m(best.machine.limits.workspace)),
        **path,
    }
    weakest = [row.min_N_per_mm for row in rows]
    digits = max(0, 2 - int(np.log10(path["scale"][1] - path["scale"][0])))  # soft machines need decimals
    return render(
        "place.html",
        styles=["viewer.css", "place.css"],
        scripts=["stage.js", "elements.js", "viewer.js", "solids.js", "machine.js", "profile.js", "place.js"],
        data=data,
        title=f"Placements of {placed.best.program.name}",
        about=f"machine {machine_text(placed.machine_stated)} · load {best.load}, {best.force:g} N",
        objective=placed.task.rules.objective + (f" · {_error_words(e)}" if (e := placed.surface_error_um) else ""),
        load=str(best.load),
        note=note,
        warnings=placed.warnings,
        before=present is not None,
        reason=placed.present_reason,
        low=f"{'≤ ' * path['beyond'][0]}{number(path['scale'][0], digits)}",
        high=f"{'≥ ' * path['beyond'][1]}{number(path['scale'][1], digits)}",
        weakest=[number(end) for end in (min(weakest), max(weakest))],
    )


def _corners(corners: FloatArray) -> list[list[float | None]]:
    """Lower and upper corner in mm; None where the machine file sets no bound."""
    return [[round(v, 3) if np.isfinite(v) else None for v in corner] for corner in corners.tolist()]


DATA = {"placements.csv": _table, "placement.json": Placement.to_json}
PAGE = "report.html"
