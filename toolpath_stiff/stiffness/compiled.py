"""The closed form of `closed_form`, compiled with numba: one loop over poses that the compiler vectorises.

numba (in `compiled_loops`) is imported when a kernel is first asked for: 0.4 s, and some seconds to compile the first
time on a machine; the result is cached on disk. `core` chooses this route by itself for very many poses.
"""

from __future__ import annotations

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.stiffness.closed_form import SMALL_DETERMINANT, ClosedForm, well_conditioned

Triples = tuple[tuple[float, ...], ...]


def available() -> bool:
    """Whether numba is installed; does not import it."""
    from importlib.util import find_spec

    return find_spec("numba") is not None


def _constants(kernel: ClosedForm) -> tuple[Triples, Triples, float, float]:
    """Platform arms and frame joints as tuples, which the compiled loop keeps in registers; strut law."""
    arms, frame = (tuple(map(tuple, joints.T.tolist())) for joints in (kernel.platform, kernel.frame))
    return arms, frame, kernel.law.intercept, kernel.law.slope


def tip_compliance(
    kernel: ClosedForm, position: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, BoolArray]:
    """As `closed_form.tip_compliance`: (n, 3, 3) m/N and (n,) good, for position (n, 3) and rotation (n, 3, 3)."""
    from toolpath_stiff.stiffness import compiled_loops

    n = len(position)
    compliance, good = np.empty((n, 9)), np.empty(n, dtype=bool)
    smallest = (SMALL_DETERMINANT, SMALL_DETERMINANT * kernel.arm**3)
    turns = None if rotation is None else np.ascontiguousarray(rotation).reshape(n, 9)
    compiled_loops.tensor_rows(np.ascontiguousarray(position), turns, *_constants(kernel), smallest, compliance, good)
    return compliance.reshape(n, 3, 3), good


def compliance_along_columns(
    kernel: ClosedForm, position: FloatArray, direction: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """As `closed_form.compliance_along_columns`, of contiguous arrays, in about the time of the tensor alone."""
    from toolpath_stiff.stiffness import compiled_loops

    n, loads = position.shape[1], np.ascontiguousarray(direction if direction.ndim == 3 else direction[None])
    out, det, lengths = np.empty((len(loads), n)), np.empty((2, n)), np.empty((6, n))
    for load, along in zip(loads, out, strict=True):
        compiled_loops.directed_columns(n, position, rotation, load, *_constants(kernel), along, det, lengths)
    in_order = np.empty_like(lengths)
    in_order[kernel.order] = lengths
    # Values are nan where a strut has no stiffness above zero.
    good = np.asarray((well_conditioned(kernel, det[0], det[1]) & np.isfinite(out)).all(axis=0))
    return out if direction.ndim == 3 else out[0], np.abs(det[0] * det[1]), in_order, good
