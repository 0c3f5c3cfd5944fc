"""Cuts across the tool axis and cuts along it: two classes of their own where the load follows the motion.

A load along the motion points along the tool axis while the tool plunges. There a hexapod is twice as stiff as across
(Clinton, Zhang, Wavering 1997, Table 1: Z against X and Y), so three plunges of a few millimetres would rule
the range of a whole program. The headline figures are therefore those of the cuts across the axis; plunges have theirs
beside them.

Only a tangential load makes the difference. A normal load is always across the tool axis, at a plunge as well (the
softest direction across it), so its figures are all of one kind; the other loads do not look at the motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import rad_from_deg

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

PLUNGE_ANGLE = rad_from_deg(5.0)  # rad between motion and tool axis; helical and ramping entries are well beyond it
ACROSS, PLUNGES_ONLY, ALL_CUTS = "across the tool axis", "plunges only", "all cuts"
BLOCK = 16_384  # samples at a time: nine numbers for each


def along_tool_axis(tangent: FloatArray, abc: FloatArray) -> BoolArray:
    """Whether the tip moves along the tool axis, in either sense, within `PLUNGE_ANGLE`.

    Parameters
    ----------
    tangent
        (n, 3) unit vectors of the motion; 0 where the tip does not move, which is not along the axis.
    abc
        (n, 3) rad, roll, pitch, yaw of the platform; the tool axis is its z.

    Returns
    -------
    (n,) bool.
    """
    along = np.empty(len(tangent))
    for start in range(0, len(tangent), BLOCK):
        rows = slice(start, start + BLOCK)
        if abc[rows, :2].any():
            along[rows] = np.einsum("ni,ni->n", tangent[rows], rotation_matrices(abc[rows])[:, :, 2])
        else:  # upright
            along[rows] = tangent[rows, 2]
    return np.asarray(np.abs(along) >= np.cos(PLUNGE_ANGLE))


def plunging_rows(load: Load, tangent: FloatArray, abc: FloatArray, counted: BoolArray) -> BoolArray:
    """(n,) the counted samples of plunges; none where the load does not follow the motion. As `headline_rows`."""
    if load.kind != "tangential":
        return np.zeros(len(counted), dtype=bool)
    return np.asarray(counted & along_tool_axis(tangent, abc))


def headline_rows(load: Load, tangent: FloatArray, abc: FloatArray, counted: BoolArray) -> BoolArray:
    """(n,) the counted samples that mean, range and weakest place of a path are about.

    Those across the tool axis under a load that follows the motion; all of them under another load, and of a program
    that only plunges.

    Parameters
    ----------
    load
        Direction of the load.
    tangent, abc
        (n, 3) and (n, 3) as in `along_tool_axis`.
    counted
        (n,) the samples of the statistics.
    """
    return headline_of(counted, plunging_rows(load, tangent, abc, counted))


def headline_of(counted: BoolArray, plunging: BoolArray) -> BoolArray:
    """(n,) the counted samples that do not plunge; all of them where every one does. Also of a part of a path."""
    across = counted & ~plunging
    return np.asarray(across if across.any() else counted)


def headline_words(load: Load, counted: BoolArray, plunging: BoolArray) -> str:
    """What the headline figures of these samples (n,) are about: `ACROSS`, `PLUNGES_ONLY` or `ALL_CUTS`."""
    if load.kind != "tangential" or not counted.any():
        return ALL_CUTS
    return PLUNGES_ONLY if plunging[counted].all() else ACROSS
