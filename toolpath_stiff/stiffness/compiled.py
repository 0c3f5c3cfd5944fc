"""The closed form of `closed_form`, compiled with numba: one loop over poses that the compiler vectorises.

numba (in `compiled_loops`) is imported when a kernel is first asked for: 0.4 s, and some seconds to compile the first
time on a machine; the result is cached on disk. `core` chooses this route by itself for very many poses.
"""

from __future__ import annotations

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.stiffness.closed_form import SMALL_DETERMINANT, ClosedForm, well_conditioned


def available() -> bool:
    """Whether numba is installed; does not import it."""
    from importlib.util import find_spec

    return find_spec("numba") is not None


def _joints(kernel: ClosedForm) -> tuple[tuple[tuple[float, ...], ...], tuple[tuple[float, ...], ...]]:
    """Platform arms and frame joints as tuples, which the compiled loop keeps in registers."""
    arms = tuple(tuple(float(v) for v in column) for column in kernel.platform.T)
    frame = tuple(tuple(float(v) for v in column) for column in kernel.frame.T)
    return arms, frame


def _trusted(kernel: ClosedForm, det: FloatArray, values: FloatArray) -> BoolArray:
    """Where the determinants are large enough and every strut has a stiffness above zero (values are nan if not)."""
    return np.asarray(well_conditioned(kernel, det[0], det[1]) & np.isfinite(values))


def tip_compliance(
    kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, BoolArray]:
    """As `closed_form.tip_compliance`: (n, 3, 3) m/N and (n,) good, for position (n, 3) and rotation (n, 3, 3)."""
    from toolpath_stiff.stiffness import compiled_loops

    n = len(position)
    compliance, good = np.empty((n, 9)), np.empty(n, dtype=bool)
    arms, frame = _joints(kernel)
    law = (kernel.intercept, kernel.slope)
    smallest = (SMALL_DETERMINANT, SMALL_DETERMINANT * kernel.arm**3)
    rows = np.ascontiguousarray(position)
    if rotation is None:
        compiled_loops.tensor_rows_vertical(rows, arms, frame, *law, smallest, compliance, good)
    else:
        turns = np.ascontiguousarray(rotation).reshape(n, 9)
        compiled_loops.tensor_rows_tilted(rows, turns, arms, frame, *law, smallest, compliance, good)
    return compliance.reshape(n, 3, 3), good


def compliance_along_columns(
    kernel: ClosedForm, position: FloatArray, direction: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Compliance along one direction a pose, with what the limits ask for, in about the time of the tensor alone.

    Parameters
    ----------
    kernel
        From `closed_form.prepare`.
    position, direction
        (3, n) m and unit vectors, contiguous; or (k, 3, n) vectors, k a pose.
    rotation
        (9, n) rows of the rotation matrices one after the other, contiguous; None: vertical spindle.

    Returns
    -------
    compliance, determinant, lengths, good
        (n,) or (k, n) m/N; (n,) |det J| in m^3 (`kinematics.singularity_index` is its ratio to the neutral pose's);
        (6, n) m, struts in the machine's order; (n,) as in `closed_form.tip_compliance`.
    """
    from toolpath_stiff.stiffness import compiled_loops

    n, loads = position.shape[1], np.ascontiguousarray(direction if direction.ndim == 3 else direction[None])
    out, det, lengths = np.empty((len(loads), n)), np.empty((2, n)), np.empty((6, n))
    arms, frame = _joints(kernel)
    law = (kernel.intercept, kernel.slope)
    for load, along in zip(loads, out, strict=True):
        if rotation is None:
            compiled_loops.directed_vertical(n, position, load, arms, frame, *law, along, det, lengths)
        else:
            compiled_loops.directed_tilted(n, position, rotation, load, arms, frame, *law, along, det, lengths)
    in_order = np.empty_like(lengths)
    in_order[list(kernel.order)] = lengths
    good = np.asarray(_trusted(kernel, det, out).all(axis=0))
    return out if direction.ndim == 3 else out[0], np.abs(det[0] * det[1]), in_order, good
