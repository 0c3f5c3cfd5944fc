"""Compliance at the measured poses, link by link of the load path."""

from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.repeats import repeat_groups
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.readings.measurements import Readings, measured_path
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.element_sum import energies, stance_of
from toolpath_stiff.stiffness.model import StiffnessModel


def load_path_shares(model: StiffnessModel, data: Readings) -> dict[str, FloatArray]:
    """Element or link, "strut 1" to "strut 6" and effects -> (3,) m/N along X, Y, Z, mean over the measured poses."""
    poses = repeat_groups(data, apart=("direction", "force", "loop"))
    distinct = data.select(np.unique(poses, return_index=True)[1])
    axes = (np.broadcast_to(axis, (len(distinct), 3)).copy() for axis in np.eye(3))
    by_axis = [_by_link(model, replace(distinct, direction=axis)).mean(axis=0) for axis in axes]
    machine = model.machine
    elements = [f"strut {i + 1}" for i in range(6)]
    if not isinstance(machine, Hexapod):
        elements = [element.name for element in machine.elements]
    names = [*elements, *(active.effect.name for active in model.effects)]
    return dict(zip(names, np.array(by_axis).T, strict=True))


def _by_link(model: StiffnessModel, data: Readings) -> FloatArray:
    """(n, links) m/N along each row's direction."""
    if not isinstance(model.machine, Hexapod):
        return _by_element(model, data)
    path, whole, _, f = exact.under_load(model, measured_path(model, data), data.direction)
    loads = np.concatenate([f, data.direction, np.zeros((len(data), 3))], axis=1)  # [f; w]
    columns = [*(f**2 / path.machine.strut_law.stiffness(path.struts.lengths)).T]
    for active in model.effects:
        energy = np.zeros(len(data))
        series, form = active.adds("strut_compliance", path), active.adds("load_compliance", path)
        beside = active.adds("parallel_stiffness", path)
        if series is not None:
            energy += (series * f**2).sum(axis=1)
        if form is not None:
            energy += np.einsum("ni,nij,nj->n", loads, form, loads)
        if beside is not None:  # its motion x is the platform's: J x = Q_ff f + Q_fw w
            stretch = np.einsum("nij,nj->ni", whole[:, :6], loads)
            motion = np.linalg.solve(path.struts.jacobian, stretch[..., None])[..., 0]
            energy += np.einsum("ni,nij,nj->n", motion, beside, motion)
        columns.append(energy)
    return np.stack(columns, axis=1)


def _by_element(model: StiffnessModel, data: Readings) -> FloatArray:
    """(n, elements and effects) m/N along each row's direction, for a machine made of elements."""
    path = measured_path(model, data)
    columns = energies(stance_of(path), data.direction)
    for active in model.effects:
        form = active.adds("load_compliance", path)
        added = np.zeros((len(data), 3, 3)) if form is None else form[:, 6:9, 6:9]
        columns.append(np.einsum("ni,nij,nj->n", data.direction, added, data.direction))
    return np.stack(columns, axis=1)
