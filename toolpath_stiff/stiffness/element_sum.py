"""Compliance of a machine of elements: the sum over the load path, C = sum S^T diag(c) S, effects included.

Along a direction d the tip gives sum c (s . d)^2 for a force along it (Castigliano's second theorem; equilibrium alone
gives what each element carries). That runs over columns, poses last: three numbers a spring, no matrix a pose.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.elements import Spring, Stance
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.model import StiffnessModel


def stance_of(path: LoadPath) -> Stance:
    """Stance of a machine of elements on a load path."""
    assert isinstance(path.stance, Stance)
    return path.stance


def tip_compliance(model: StiffnessModel, path: LoadPath) -> FloatArray:
    """(n, 3, 3) m/N, base axes: displacements of the tip under forces on it; nan where nothing holds the tip.

    Effects that depend on the load are left out.
    """
    compliance = stance_of(path).tip_compliance()[:, :3, :3]
    at_tip, in_elements = added_by(model.effects, path)
    if at_tip is not None:
        compliance = compliance + at_tip[:, :3, :3]
    if in_elements is not None:
        rows = element_rows(stance_of(path))
        compliance = compliance + np.einsum("nri,nr,nrj->nij", rows, in_elements, rows)
    return exact.possible(model, path, compliance)


def compliance_along(model: StiffnessModel, path: LoadPath, direction: FloatArray) -> FloatArray:
    """(n,) m/N, displacement along unit vectors (n, 3), base axes, per force along them, effects under that load."""
    along, loads = sum(energies(stance_of(path), direction), start=np.zeros(len(path))), None
    if model.effects:
        if model.load_dependent:
            loads = np.einsum("nri,ni->nr", element_rows(stance_of(path)), direction)
            path = replace(path, element_loads=loads * path.force[:, None])
        at_tip, in_elements = added_by(model.effects, path)
        if at_tip is not None:
            along = along + np.einsum("ni,nij,nj->n", direction, at_tip[:, :3, :3], direction)
        if in_elements is not None:
            rows = np.einsum("nri,ni->nr", element_rows(stance_of(path)), direction) if loads is None else loads
            along = along + (in_elements * rows**2).sum(axis=1)
    return exact.possible(model, path, along[:, None, None])[:, 0, 0]


def added_by(effects: Iterable[ActiveEffect], path: LoadPath) -> tuple[FloatArray | None, FloatArray | None]:
    """Contributions of effects: (n, 6, 6) at the tip, (n, r) m/N and rad/(N m) in the elements' loads; or None."""
    at_tip: FloatArray | None = None
    in_elements: FloatArray | None = None
    for active in effects:
        form, more = active.adds("load_compliance", path), active.adds("element_compliance", path)
        if form is not None:
            at_tip = form[:, 6:, 6:] if at_tip is None else at_tip + form[:, 6:, 6:]
        if more is not None:
            in_elements = more if in_elements is None else in_elements + more
    return at_tip, in_elements


def element_rows(stance: Stance) -> FloatArray:
    """(n, r, 3) all loads of the elements, one after the other, per unit force at the tip in base axes."""
    return np.concatenate([load.rows(stance.position)[:, :, :3] for load in stance.loads], axis=1)


def energies(stance: Stance, direction: FloatArray) -> list[FloatArray]:
    """(n,) m/N of each element along unit vectors (n, 3), base axes: twice the energy under a force of 1 N."""
    tip, along = (np.ascontiguousarray(values.T) for values in (stance.position, direction))
    shares = []
    for load in stance.loads:
        if isinstance(load, Spring):
            shares.append(_spring_energy(load, tip, along))
        else:
            forces = np.einsum("nki,ni->nk", load.loads[:, :, :3], direction)
            shares.append(np.asarray((load.compliance * forces**2).sum(axis=1)))
    return shares


def _spring_energy(spring: Spring, tip: FloatArray, force: FloatArray) -> FloatArray:
    """(n,) m/N of a spring, twice its energy under forces (3, n) at the tip (3, n)."""
    axes = spring.axes
    if axes is not None and axes.ndim == 3:
        axes = np.moveaxis(axes, 0, -1)
    compliance = spring.compliance.T  # (6,) or (6, n)
    energy = _quadratic(compliance[:3], axes, force)
    if compliance[3:].any():
        arm = tip - (spring.place.T if spring.place.ndim == 2 else spring.place[:, None])
        moment = np.empty_like(arm)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            np.multiply(arm[j], force[k], out=moment[i])
            moment[i] -= arm[k] * force[j]
        energy = energy + _quadratic(compliance[3:], axes, moment)
    return np.broadcast_to(energy, tip.shape[1:])


def _quadratic(compliance: FloatArray, axes: FloatArray | None, vector: FloatArray) -> FloatArray | float:
    """(n,) sum of c_k (a_k . v)^2 over three axes; axes with equal compliance are counted by the length of v."""
    if compliance.ndim == 2:
        alike, rest = 0.0, list(enumerate(compliance))
    else:
        values = compliance.tolist()
        alike = max(values, key=lambda value: (values.count(value), -value))
        rest = [(k, value - alike) for k, value in enumerate(values) if value != alike]
    total: FloatArray | float = 0.0
    if alike:
        total = alike * (vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    for k, value in rest:
        if axes is None:
            part = vector[k]
        else:
            part = axes[0, k] * vector[0]
            part += axes[1, k] * vector[1]
            part += axes[2, k] * vector[2]
        total = total + value * (part * part)
    return total
