"""Slips of whoever writes measurements down: a mistyped row, two readings exchanged, a noise stated wrongly.

The machine is measured as it is; only what stands in the table changes. Every function returns a new table and the
truth of what it did, so that a search for such slips can be judged.

A slip of a pose or of a sign is made where a form has it once: in one row, or in all rows of a clamping.
"""

import numpy as np
from numpy.random import Generator

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.campaigns import POSE, Table
from toolpath_stiff.rig.case import DrawnCase, clamp_of, rows_of
from toolpath_stiff.rig.draws import Shape
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances, readings
from toolpath_stiff.rig.kinematics import reachable
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.sizes import Scale
from toolpath_stiff.units import MM_PER_INCH

# Kind -> what was done.
SLIPS = {
    "directions_exchanged": "two readings of one clamping and load stand under each other's direction",
    "sign_of_angle": "an angle with the wrong sign",
    "sign_of_coordinate": "x or y with the wrong sign",
    "lbf_per_in": "a stiffness in lbf/in",
    "N_per_um": "a stiffness in N/um",
    "pose_10_mm": "a coordinate off by 10 mm",
    "pose_1_deg": "an angle off by 1 degree",
    "pose_5_deg": "an angle off by 5 degrees",
}
N_PER_LBF = 4.4482216152605  # exact: 0.45359237 kg (international pound, 1959) times 9.80665 m/s2 (CGPM 1901)
WRITTEN_PER_N_PER_MM = {"lbf_per_in": MM_PER_INCH / N_PER_LBF, "N_per_um": 1e-3}
# Columns of which one is written wrongly; by how much, mm or degrees (0: with the wrong sign); the smallest value that
# is: a wrong sign of less is hardly a mistake (assumed).
MISTYPED = {
    "sign_of_angle": (POSE[3:5], 0.0, 3.0),
    "sign_of_coordinate": (POSE[:2], 0.0, 30.0),
    "pose_10_mm": (POSE[:3], 10.0, 0.0),
    "pose_1_deg": (POSE[3:], 1.0, 0.0),
    "pose_5_deg": (POSE[3:], 5.0, 0.0),
}
TRIES = 200  # draws until the written pose is one that the machine can reach
# Whitened length of a slip that is found with 80 % power at 5 % among all slips of all rows of a tilted campaign, some
# 6000: z(1 - 0.05/6000/2) + z(0.8) = 4.46 + 0.84 (normal quantiles, Bonferroni).
VISIBLE = 5.3


def with_slip(case: DrawnCase, table: Table, rng: Generator, kind: str | None = None) -> tuple[Table, Shape]:
    """A measured table of a case with one slip in it.

    Parameters
    ----------
    case
        Its nominal machine keeps poses reachable; with its nuisances for the size of the slip.
    table
        A table with `stiffness_N_per_mm`.
    kind
        One of `SLIPS`; None: drawn.

    Returns
    -------
    table
        With the slip; a copy.
    truth
        `kind`; `rows` (numbered from 1) that are wrong; `columns`; `written` and `meant`, column -> what stands in and
        what belongs into each of these rows; `detectability`: whitened length of what the slip does to the residuals of
        the nominal machine, as of the effects. `VISIBLE` and more can be found.

    Raises
    ------
    InputError
        An unknown kind, or a table in which it cannot be made.
    """
    kind = str(rng.choice(list(SLIPS))) if kind is None else kind
    if kind not in SLIPS:
        raise InputError(f"no slip called {kind!r}", expected=", ".join(SLIPS))
    if kind == "directions_exchanged":
        rows, written = _exchanged(table, rng)
    elif kind in WRITTEN_PER_N_PER_MM:
        rows = np.array([int(rng.integers(len(table["x_mm"])))])
        meant = np.asarray(table["stiffness_N_per_mm"])[rows]
        written = _with(table, "stiffness_N_per_mm", rows, np.round(meant * WRITTEN_PER_N_PER_MM[kind], 3))
    else:
        rows, written = _mistyped(table, case.nominal, kind, rng)
    before, after = (
        np.log(sheet["stiffness_N_per_mm"]) - np.log(readings(case.nominal, HiddenMachine(), rows_of(sheet)))
        for sheet in (table, written)
    )
    scale = Scale(case.nominal, rows_of(table), clamp_of(table), case.nuisances, HiddenMachine())
    changed = [name for name in table if not np.array_equal(table[name], written[name])]
    return written, {
        "kind": kind,
        "rows": [int(row) + 1 for row in rows],
        "columns": changed,
        "written": {name: np.asarray(written[name])[rows].tolist() for name in changed},
        "meant": {name: np.asarray(table[name])[rows].tolist() for name in changed},
        "detectability": scale.whitened_length(after - before),
    }


def _with(table: Table, name: str, rows: IntArray, written: FloatArray | float) -> Table:
    """The table with other values in some rows of a column."""
    values = np.array(table[name], dtype=float)
    values[rows] = written
    return {**table, name: values}


def slipped_case(case: DrawnCase, seed: int, kind: str | None = None, count: int = 1) -> tuple[Table, list[Shape]]:
    """The rows of a case with `count` slips in different rows, and their truths."""
    rng = np.random.default_rng([seed, 5])  # beyond the streams of `draw_case`
    table, truths, taken = case.rows, list[Shape](), set[int]()
    for _ in range(TRIES):
        if len(truths) == count:
            return table, truths
        trial, truth = with_slip(case, table, rng, kind)
        if taken.isdisjoint(truth["rows"]):
            table = trial
            taken.update(truth["rows"])
            truths.append(truth)
    raise InputError(f"{count} slips of kind {kind or 'any'}", expected="fewer: the table has no room for them")


def with_stated_noise(table: Table, nuisances: Nuisances, factor: float = 1.0) -> tuple[Table, dict[str, float]]:
    """A table that states `sd_N_per_mm`, `factor` times as large as one reading's scatter is.

    The truth: `true_percent` and `stated_percent`, repeat noise and clamping together.
    """
    true = nuisances.of_reading
    stated: Table = {}
    for name, values in table.items():
        if name != "sd_N_per_mm":
            stated[name] = values
        if name == "stiffness_N_per_mm":
            stated["sd_N_per_mm"] = np.round(np.asarray(values) * true * factor, 1)
    return stated, {"true_percent": 100.0 * true, "stated_percent": 100.0 * true * factor}


def _exchanged(table: Table, rng: Generator) -> tuple[IntArray, Table]:
    """Two rows of one clamping and one load get each other's stiffness."""
    clamps, directions = clamp_of(table), np.array(table["direction"])
    loads = table.get("force_N", np.full(len(clamps), defaults.FORCE))
    for _ in range(TRIES):
        first = int(rng.integers(len(clamps)))
        same = (clamps == clamps[first]) & (loads == loads[first])
        if len(others := np.flatnonzero(same & (directions != directions[first]))):
            rows = np.sort([first, int(rng.choice(others))])
            return rows, _with(table, "stiffness_N_per_mm", rows, np.asarray(table["stiffness_N_per_mm"])[rows[::-1]])
    raise InputError("no two directions of one clamping and load", expected="a campaign with several")


def _mistyped(table: Table, nominal: Nominal, kind: str, rng: Generator) -> tuple[IntArray, Table]:
    """A coordinate or an angle of one row, or of all rows of a clamping, is written wrongly."""
    (columns, wrong_by, smallest), clamps = MISTYPED[kind], clamp_of(table)
    for _ in range(TRIES):
        row = int(rng.integers(len(clamps)))
        rows = np.flatnonzero(clamps == clamps[row]) if rng.random() < 0.5 else np.array([row])
        name = str(rng.choice([column for column in columns if column in table]))
        before = float(table[name][row])
        if abs(before) < smallest:
            continue
        after = round(before + float(rng.choice([-1.0, 1.0])) * wrong_by, 3) if wrong_by else -before
        trial = _with(table, name, rows, after)
        tried = rows_of(trial).take(rows)
        if reachable(nominal, tried.position, tried.angles, tried.extension).all():
            return rows, trial
    raise InputError(f"no row for the slip {kind}", expected="poses off the axis, or tilted, that stay reachable")
