"""Oddities: faults outside the catalogue for blind draws, which test the verdict "something else is missing".

Each is one formula on table or readings that the columns of any campaign show; `size` scales it. They are invented for
the purpose, with the shapes that damaged or badly set machines show; no source gives figures for them.
"""

from functools import partial

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import signed
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Links
from toolpath_stiff.rig.unknown import REACH, SOFT, CommandedRows, Kind, Unknown, X, Y, kind

ODDITIES: dict[str, Kind] = {}
act = partial(kind, ODDITIES, "act")
read = partial(kind, ODDITIES, "read")


@act("", "", SOFT)
def cracked_bed(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The workpiece side gives way where y is positive only; m/N."""
    give = np.where(state.rows.position[:, 1] > 0.0, u.size, 0.0)
    return links.with_ends((X, give), (Y, give))


@act("", "", SOFT)
def saddle_overhang(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The workpiece side gives way along X, growing with the square of y; m/N."""
    return links.with_ends((X, u.size * (state.rows.position[:, 1] / REACH) ** 2))


@read("", "", 0.5, shape=signed)
def cable_drag(rows: Rows, u: Unknown) -> FloatArray:
    """A cable pulls along X in proportion to x, and the gauge reads it."""
    return np.asarray(1.0 + u.size * rows.position[:, 0] / REACH * np.abs(rows.direction[:, 0]))
