"""The closed form of `closed_form`, compiled with numba: one loop over poses that the compiler vectorises.

numba (in `compiled_loops`) is imported when a kernel is first asked for: 0.4 s, and some seconds to compile the first
time on a machine; the result is cached on disk. `core` chooses this route by itself for very many poses.
"""

from importlib.util import find_spec

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.stiffness.closed_form import ClosedForm, well_conditioned


def available() -> bool:
    """Whether numba is installed; does not import it."""
    return find_spec("numba") is not None


def compliance_along_columns(
    kernel: ClosedForm, position: FloatArray, direction: FloatArray, rotation: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """As `closed_form.compliance_along_columns`, of contiguous arrays and a law that is a straight line."""
    from toolpath_stiff.stiffness import compiled_loops

    # Tuples, which the compiled loop keeps in registers.
    arms, frame = (tuple(map(tuple, joints.T.tolist())) for joints in (kernel.platform, kernel.frame))
    law, n = (kernel.law.intercept, kernel.law.slope), position.shape[1]
    loads = np.ascontiguousarray(direction if direction.ndim == 3 else direction[None])
    out, det, lengths = np.empty((len(loads), n)), np.empty((2, n)), np.empty((6, n))
    for load, along in zip(loads, out, strict=True):
        compiled_loops.directed_columns((position, rotation, load), (arms, frame), law, along, det, lengths)
    in_order = np.empty_like(lengths)
    in_order[kernel.order] = lengths
    # Values are nan where a strut has no stiffness above zero.
    good = np.asarray((well_conditioned(kernel, det[0], det[1]) & np.isfinite(out)).all(axis=0))
    return out if direction.ndim == 3 else out[0], np.abs(det[0] * det[1]), in_order, good
