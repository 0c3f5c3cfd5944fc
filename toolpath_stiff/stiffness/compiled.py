"""The closed form of `closed_form`, compiled with numba: one loop over poses that the compiler vectorises.

numba (in `compiled_loops`) is imported when a kernel is first asked for: 0.4 s, and some seconds to compile the first
time on a machine; the result is cached on disk. `core` chooses this route by itself for very many poses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness.closed_form import SMALL_DETERMINANT, ClosedForm

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BLOCK = 4096  # poses that are transposed at a time


def available() -> bool:
    """Whether numba is installed; does not import it."""
    from importlib.util import find_spec

    return find_spec("numba") is not None


def _joints(kernel: ClosedForm) -> tuple[tuple[tuple[float, ...], ...], tuple[tuple[float, ...], ...]]:
    """Platform arms and frame joints as tuples, which the compiled loop keeps in registers."""
    arms = tuple(tuple(float(v) for v in column) for column in kernel.platform.T)
    frame = tuple(tuple(float(v) for v in column) for column in kernel.frame.T)
    return arms, frame


def _trusted(kernel: ClosedForm, position: FloatArray, det: FloatArray, values: FloatArray) -> BoolArray:
    """Where the determinants are large enough and every strut has a stiffness above zero."""
    small = SMALL_DETERMINANT
    good = (np.abs(det[0]) > small) & (np.abs(det[1]) > small * kernel.arm**3) & np.isfinite(values)
    return np.asarray(good if _law_holds(kernel, position) else good & False)


def _law_holds(kernel: ClosedForm, position: FloatArray) -> bool:
    """Whether no strut can be so long or short that the law leaves it no stiffness; checked on the positions' box.

    A distance is largest at a corner of the box, and a strut is longer than that by an arm at the most. Where the box
    cannot tell, the answer is no: the exact route then looks at every pose.
    """
    if not position.size:
        return True
    corners = np.stack(np.meshgrid(*zip(position.min(axis=1), position.max(axis=1), strict=True)), axis=-1)
    reach = np.linalg.norm(corners.reshape(-1, 1, 3) - kernel.frame.T, axis=-1).max()
    longest = reach + np.linalg.norm(kernel.platform, axis=0).max()
    return bool(kernel.intercept > 0.0 and kernel.intercept + kernel.slope * longest > 0.0)


def tip_compliance_columns(
    kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, BoolArray]:
    """Tip compliance with poses last, the fastest form.

    Parameters
    ----------
    kernel
        From `closed_form.prepare`.
    position
        (3, n) m, contiguous.
    rotation
        (9, n) rows of the rotation matrices one after the other, contiguous; None: vertical spindle.

    Returns
    -------
    compliance, good
        (6, n) m/N: xx, yy, zz, xy, xz, yz; (n,) as in `closed_form.tip_compliance`.
    """
    from toolpath_stiff.stiffness import compiled_loops

    n = position.shape[1]
    out, det = np.empty((6, n)), np.empty((2, n))
    arms, frame = _joints(kernel)
    if rotation is None:
        compiled_loops.tensor_vertical(n, position, arms, frame, kernel.intercept, kernel.slope, out, det)
    else:
        compiled_loops.tensor_tilted(n, position, rotation, arms, frame, kernel.intercept, kernel.slope, out, det)
    return out, _trusted(kernel, position, det, out[2])


def tip_compliance(
    kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, BoolArray]:
    """As `closed_form.tip_compliance`: (n, 3, 3) m/N and (n,) good, for position (n, 3) and rotation (n, 3, 3)."""
    n = len(position)
    compliance, good = np.empty((n, 3, 3)), np.empty(n, dtype=bool)
    for start in range(0, n, BLOCK):
        rows = slice(start, min(start + BLOCK, n))
        turn = None if rotation is None else np.ascontiguousarray(rotation[rows].reshape(-1, 9).T)
        columns, good[rows] = tip_compliance_columns(kernel, np.ascontiguousarray(position[rows].T), turn)
        for column, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
            compliance[rows, i, j] = compliance[rows, j, i] = columns[column]
    return compliance, good


def compliance_along_columns(
    kernel: ClosedForm, position: FloatArray, direction: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Compliance along one direction a pose, with what the limits ask for; cheaper than the whole tensor.

    Parameters
    ----------
    kernel
        From `closed_form.prepare`.
    position, direction
        (3, n) m and unit vectors, contiguous.
    rotation
        (9, n) or None, as in `tip_compliance_columns`.

    Returns
    -------
    compliance, determinant, lengths, good
        (n,) m/N; (n,) |det J| in m^3 (`kinematics.singularity_index` is its ratio to the neutral pose's); (6, n) m,
        struts in the machine's order; (n,) as in `closed_form.tip_compliance`.
    """
    from toolpath_stiff.stiffness import compiled_loops

    n = position.shape[1]
    out, det, lengths = np.empty(n), np.empty((2, n)), np.empty((6, n))
    arms, frame = _joints(kernel)
    law = (kernel.intercept, kernel.slope)
    if rotation is None:
        compiled_loops.directed_vertical(n, position, direction, arms, frame, *law, out, det, lengths)
    else:
        compiled_loops.directed_tilted(n, position, rotation, direction, arms, frame, *law, out, det, lengths)
    in_order = np.empty_like(lengths)
    in_order[list(kernel.order)] = lengths
    return out, np.abs(det[0] * det[1]), in_order, _trusted(kernel, position, det, out)
