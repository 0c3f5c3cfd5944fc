"""Indicators beside the tip: their readings from the displacements of the assembled elements.

An indicator reads the displacement of one point against another: the give of a joint, a vertex of the frame, the
spindle, the table. The machine says what moves (`Motions`), whether it is built of springs or of finite elements.
"""

from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.campaigns import Table
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.unknown import Z
from toolpath_stiff.units import m_from_mm, um_from_m

TIP = ("", "tip")
LOOP_PATTERN = (
    r"|tip|spindle|platform|table|strut [1-6]( alone)?|joint [1-6]( (platform|frame))?|frame [1-3]( (radial|vertical))?"
)
LOOP_WORDS = "tip, spindle, platform, table, strut 1 (alone), joint 1 (platform, frame), frame 1 (radial, vertical)"
# An indicator on its stand, one sd of a reading in m, and the load with the indicator's slant, relative; assumed.
INDICATOR, SLANT = 0.2e-6, 0.01
PRINTED = 0.1  # um, resolution of the indicator; assumed


def displacements(
    nominal: Nominal, hidden: HiddenMachine, rows: Rows, loops: list[str], lengths: FloatArray
) -> FloatArray:
    """(n,) m per N at the tip, of a strut alone per N in it.

    `lengths` (n,) m of struts measured alone; nan: as the pose has it.
    """
    motions, read = hidden.motions(nominal, rows, lengths), np.empty(len(loops))
    for k, loop in enumerate(loops):
        kind, number, way = (*loop.split(), "", "", "")[:3]
        part = int(number or 1) - 1
        if kind in ("spindle", "table"):
            read[k] = getattr(motions, kind)[k]
        elif kind == "platform":
            read[k] = motions.tip[k] - motions.spindle[k]
        elif kind == "strut":
            read[k] = (motions.alone if way else motions.struts)[k, part]
        elif kind == "joint":  # both ends of a strut give alike
            read[k] = motions.joints[k, part] * (0.5 if way else 1.0)
        elif kind == "frame":
            along = {"radial": motions.outward[k, part], "vertical": Z}.get(way, rows.direction[k])
            read[k] = along @ motions.vertices[k, part]
        else:
            read[k] = motions.tip[k]
    return read


def with_loops(
    nominal: Nominal, hidden: HiddenMachine, measured: Table, rows: Rows, nuisances: Nuisances, rng: Generator
) -> Table:
    """A measured table in which rows of loops beside the tip hold indicator readings, um, in place of a stiffness."""
    loops = list(measured.get("loop", ()))
    beside = np.array([loop not in TIP for loop in loops], dtype=bool)
    if not beside.any():
        return {name: values for name, values in measured.items() if name != "loop"}
    lengths = m_from_mm(np.asarray(measured.get("length_mm", np.full(len(loops), np.nan)), dtype=float))
    where = np.flatnonzero(beside)
    words, some = [loops[k] for k in where], rows.take(where)
    moved = displacements(nominal, hidden, some, words, lengths[where]) * some.force
    if nuisances.repeat > 0.0:
        moved = moved * np.exp(SLANT * rng.standard_normal(len(where))) + INDICATOR * rng.standard_normal(len(where))
    shown = np.zeros(len(loops))
    shown[where] = PRINTED * np.round(um_from_m(moved) / PRINTED) if nuisances.rounded else um_from_m(moved)
    empty = {"stiffness_N_per_mm": beside, "sd_N_per_mm": beside, "length_mm": np.isnan(lengths)}
    table: Table = {}
    for name, values in measured.items():
        table[name] = _emptied(values, empty[name]) if name in empty else values
        if name == "stiffness_N_per_mm":
            table["displacement_um"] = _emptied(shown, ~beside)
    table.setdefault("force_N", np.full(len(loops), defaults.FORCE))
    return table


def _emptied(values: Any, rows: Any) -> list[str]:
    return ["" if gone else f"{float(value) + 0.0:.10g}" for value, gone in zip(values, rows, strict=True)]
