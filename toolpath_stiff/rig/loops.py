"""Indicators beside the tip: what they read of the assembled elements' displacements.

An indicator reads the displacement of one point against another. Every such pair is one unknown of `structure`, or the
elongation of a strut, so that nothing is derived: the give of a joint, a vertex of the frame, the spindle, the table.
"""

from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.campaigns import Table
from toolpath_stiff.rig.fem import FemMachine, displacements
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances, assembled
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Geometry, Links, solved
from toolpath_stiff.units import m_from_mm, um_from_m

TIP = ("", "tip")
LOOP_PATTERN = (
    r"|tip|spindle|platform|table|strut [1-6]( alone)?|joint [1-6]( (platform|frame))?|frame [1-3]( (radial|vertical))?"
)
LOOP_WORDS = "tip, spindle, platform, table, strut 1 (alone), joint 1 (platform, frame), frame 1 (radial, vertical)"
# An indicator on its stand, one sd of a reading in m, and the load with the indicator's slant, relative; assumed.
INDICATOR, SLANT = 0.2e-6, 0.01
PRINTED = 0.1  # um, resolution of the indicator; assumed


def true_displacements(
    nominal: Nominal, hidden: HiddenMachine, rows: Rows, loops: list[str], lengths: FloatArray
) -> FloatArray:
    """(n,) m per N at the tip, of a strut alone per N in it.

    `lengths` (n,) m of struts measured alone; nan: as the pose has it.
    """
    given = np.repeat(np.nan_to_num(lengths)[:, None], 6, axis=1)
    place, links = assembled(nominal, hidden, rows, given)
    compliance, moved, stretch = solved(place, links, rows.direction, rows.force)
    read = np.empty(len(loops))
    for k, loop in enumerate(loops):
        kind, *rest = loop.split()
        first = moved.shape[1] - links.count
        ends, number = first + 6 + links.vertices.size, int(rest[0]) - 1 if rest else 0
        if kind in ("spindle", "table"):
            read[k] = _give(k, kind, links, rows, moved[k, ends:])
        elif kind == "platform":
            read[k] = compliance[k] - _give(k, "spindle", links, rows, moved[k, ends:])
        elif kind == "strut":
            alone = bool(rest[1:])
            read[k] = np.linalg.inv(links.struts[k])[number, number] if alone else stretch[k, number] @ moved[k]
        elif kind == "joint":  # the rig's joint is one element: each end of the strut gives half
            read[k] = moved[k, first + number] * (0.5 if rest[1:] else 1.0)
        elif kind == "frame":
            read[k] = _vertex(k, number, "".join(rest[1:]), place, rows.direction[k], moved[k, first + 6 : ends])
        else:
            read[k] = compliance[k]
    return read


def _give(k: int, link: str, links: Links, rows: Rows, unknowns: FloatArray) -> float:
    """Displacement along the load of what sits at a link, of the unknowns of the ends."""
    ends = zip(links.ends, unknowns, strict=True)
    return float(sum(rows.direction[k] @ end.lever[k] * size for end, size in ends if end.link == link))


def _vertex(k: int, number: int, way: str, place: Geometry, direction: FloatArray, unknowns: FloatArray) -> float:
    """Displacement of a vertex outwards, upwards or along the load."""
    outward, upward = unknowns[2 * number : 2 * number + 2].tolist()
    if way:
        return float(outward if way == "radial" else upward)
    joints = place.frame_joints[k][place.vertices == number].mean(axis=0)[:2]
    return float(direction[:2] @ joints / np.linalg.norm(joints) * outward + direction[2] * upward)


def with_loops(
    nominal: Nominal, hidden: HiddenMachine, measured: Table, rows: Rows, nuisances: Nuisances, rng: Generator
) -> Table:
    """A measured table whose rows of loops beside the tip hold what their indicators read, in um, for a stiffness."""
    loops = list(measured.get("loop", ()))
    beside = np.array([loop not in TIP for loop in loops], dtype=bool)
    if not beside.any():
        return {name: values for name, values in measured.items() if name != "loop"}
    lengths = m_from_mm(np.asarray(measured.get("length_mm", np.full(len(loops), np.nan)), dtype=float))
    where = np.flatnonzero(beside)
    words, some = [loops[k] for k in where], rows.take(where)
    if isinstance(hidden, FemMachine):
        moved = displacements(nominal, hidden, some, words, lengths[where]) * some.force
    else:
        moved = true_displacements(nominal, hidden, some, words, lengths[where]) * some.force
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
