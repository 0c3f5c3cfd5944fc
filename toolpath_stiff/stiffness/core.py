"""Which route computes the tip compliance: the exact LAPACK route, the closed form, or the compiled loops.

For linear struts on a rigid platform all three give the same to rounding; the choice is made by the number of poses.
Physical effects take the exact route. Poses at which the closed form is ill-conditioned go to the exact route, which
pivots, by themselves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness import closed_form, exact, extremes
from toolpath_stiff.stiffness.acting import acting_effects
from toolpath_stiff.stiffness.effects.contract import DEFAULT_FORCE, LoadPath
from toolpath_stiff.stiffness.model import StiffnessModel, load_path

FloatArray = NDArray[np.float64]

BLOCK = 8192  # poses at a time on the exact route: bounds memory, keeps LAPACK's call overhead small
CLOSED_FORM_FROM = 150  # poses; below, the closed form's fixed cost of some 0.2 ms a call is not earned back
# Poses; numba takes about 0.5 s to import and load from its cache, which the closed form spends on 1.5 million.
COMPILED_FROM = 1_500_000
ROUTES = ("exact", "closed_form", "compiled")


def is_closed_form(model: StiffnessModel) -> bool:
    """Whether linear struts on a rigid platform are all that acts, so that the closed form holds."""
    acting = replace(model, effects=acting_effects(model))
    return acting.is_plain and bool(np.isinf(acting.platform_bars))


def choose_route(model: StiffnessModel, poses: int) -> str:
    """One of `ROUTES` for so many poses."""
    if poses < CLOSED_FORM_FROM or not is_closed_form(model):
        return "exact"
    if poses < COMPILED_FROM:
        return "closed_form"
    from toolpath_stiff.stiffness import compiled

    return "compiled" if compiled.available() else "closed_form"


def tip_compliance(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: FloatArray | float = np.nan,
    force: float = DEFAULT_FORCE,
    route: str | None = None,
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
    route
        One of `ROUTES`; chosen by the number of poses unless given.

    Returns
    -------
    (n, 3, 3) m/N; nan where the machine is singular.
    """
    chosen = route or choose_route(model, len(position))
    if chosen == "exact":
        return _exact(model, position, rotation, tool_length, force)
    lengths = np.asarray(tool_length, dtype=float)
    if lengths.ndim == 0 or _all_equal(lengths):
        one = float(lengths.flat[0]) if lengths.size else np.nan
        return _fast(model, position, rotation, one, force, chosen)
    compliance = np.empty((len(position), 3, 3))
    for length in np.unique(lengths):  # nan counts as one value
        rows = np.isnan(lengths) if np.isnan(length) else lengths == length
        turn = None if rotation is None else rotation[rows]
        compliance[rows] = _fast(model, position[rows], turn, float(length), force, chosen)
    return compliance


def _all_equal(lengths: FloatArray) -> bool:
    return bool(np.isnan(lengths).all() or np.ptp(lengths) == 0.0)


def _fast(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None,
    tool_length: float,
    force: float,
    route: str,
) -> FloatArray:
    """Closed form or compiled loops for one tool length; doubtful poses go to the exact route."""
    kernel = closed_form.prepare(model.machine, tool_length)
    if route == "compiled":
        from toolpath_stiff.stiffness import compiled

        compliance, good = compiled.tip_compliance(kernel, position, rotation)
    else:
        compliance, good = closed_form.tip_compliance(kernel, position, rotation)
    if not good.all():
        bad = ~good
        turn = None if rotation is None else rotation[bad]
        compliance[bad] = _exact(model, position[bad], turn, tool_length, force)
    return compliance


def _exact(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None,
    tool_length: FloatArray | float,
    force: float,
) -> FloatArray:
    compliance = np.empty((len(position), 3, 3))
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(position),))
    for start in range(0, len(position), BLOCK):
        rows = slice(start, start + BLOCK)
        turn = None if rotation is None else rotation[rows]
        path = _path(model, position[rows], turn, lengths[rows], force)
        compliance[rows] = exact.tip_compliance(model, path)
    return compliance


def _path(
    model: StiffnessModel, position: FloatArray, rotation: FloatArray | None, tool_length: FloatArray, force: float
) -> LoadPath:
    """What the effects see of n poses of a program, the model's conditions included."""
    return load_path(model, position, rotation, tool_length, force, **model.conditions.columns(len(position)))


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
        path = _path(model, position[rows], turn, lengths[rows], force)
        result[rows] = exact.compliance_along(model, path, direction[rows])
    return result


def extreme_directions(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: FloatArray | float = np.nan,
    force: float = DEFAULT_FORCE,
    softest: bool = True,
    across: FloatArray | None = None,
) -> FloatArray:
    """Directions (n, 3) in which the tip gives way most, or least, load-dependent effects included.

    With `across` (n, 3), unit vectors, only directions across these are looked at. Some 300 times the work of one
    direction: without load-dependent effects the eigenvectors of the compliance say the same.
    """
    result = np.empty((len(position), 3))
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(position),))
    at_a_time = max(1, BLOCK // extremes.DIRECTIONS)
    for start in range(0, len(position), at_a_time):
        rows = slice(start, start + at_a_time)
        turn = None if rotation is None else rotation[rows]
        path = _path(model, position[rows], turn, lengths[rows], force)

        def along(directions: FloatArray, poses: NDArray[np.int64], path: LoadPath = path) -> FloatArray:
            return exact.compliance_along(model, path.take(poses), directions)

        normals = None if across is None else across[rows]
        result[rows] = extremes.extreme_directions(along, exact.tip_compliance(model, path), softest, normals)
    return result
