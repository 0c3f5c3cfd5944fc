"""Which route computes the tip compliance: the closed form, the compiled kernel, or the exact LAPACK route."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.effects.contract import DEFAULT_FORCE
from toolpath_stiff.stiffness.model import StiffnessModel, load_path

FloatArray = NDArray[np.float64]

BLOCK = 8192  # poses at a time on the exact route: bounds memory, keeps LAPACK's call overhead small


def tip_compliance(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: FloatArray | float = np.nan,
    force: float = DEFAULT_FORCE,
) -> FloatArray:
    """Compliance of the tool tip at n poses, load-dependent effects left out.

    Parameters
    ----------
    model
        Machine and effects.
    position
        (n, 3) m.
    rotation
        (n, 3, 3); None: vertical spindle.
    tool_length
        m, scalar or (n,); nan: the reference tool.
    force
        N, the size of the load.

    Returns
    -------
    (n, 3, 3) m/N; nan where the machine is singular.
    """
    compliance = np.empty((len(position), 3, 3))
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(position),))
    for start in range(0, len(position), BLOCK):
        rows = slice(start, start + BLOCK)
        turn = None if rotation is None else rotation[rows]
        path = load_path(model, position[rows], turn, lengths[rows], force)
        compliance[rows] = exact.tip_compliance(model, path)
    return compliance


def compliance_along(
    model: StiffnessModel,
    direction: FloatArray,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: FloatArray | float = np.nan,
    force: float = DEFAULT_FORCE,
) -> FloatArray:
    """Compliance of the tip along unit vectors (n, 3), load-dependent effects included: (n,) m/N."""
    result = np.empty(len(position))
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(position),))
    for start in range(0, len(position), BLOCK):
        rows = slice(start, start + BLOCK)
        turn = None if rotation is None else rotation[rows]
        path = load_path(model, position[rows], turn, lengths[rows], force)
        result[rows] = exact.compliance_along(model, path, direction[rows])
    return result
