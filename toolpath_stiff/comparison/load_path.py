"""Compliance at the measured poses, link by link of the load path."""

from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.repeats import repeat_groups
from toolpath_stiff.readings.measurements import Readings, measured_path
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.model import StiffnessModel


@dataclass(frozen=True)
class LinkShares:
    """Compliance by link.

    Attributes
    ----------
    links
        "strut 1" to "strut 6", then names of effects.
    compliance
        (3, links) m/N along X, Y, Z, mean over the measured poses.
    poses
        How many poses.
    """

    links: tuple[str, ...]
    compliance: FloatArray
    poses: int


def load_path_shares(model: StiffnessModel, data: Readings) -> LinkShares:
    """Shares at the measured poses, each counted once."""
    poses = repeat_groups(data, apart=("direction", "force", "loop"))
    distinct = data.select(np.unique(poses, return_index=True)[1])
    by_axis = []
    for axis in np.eye(3):
        rows = replace(distinct, direction=np.broadcast_to(axis, (len(distinct), 3)).copy())
        by_axis.append(_by_link(model, rows).mean(axis=0))
    names = tuple(f"strut {i + 1}" for i in range(6)) + tuple(active.effect.name for active in model.effects)
    return LinkShares(names, np.array(by_axis), len(distinct))


def _by_link(model: StiffnessModel, data: Readings) -> FloatArray:
    """(n, links) m/N along each row's direction."""
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
        if beside is not None:  # its motion x is that of the platform: J x = Q_ff f + Q_fw w
            stretch = np.einsum("nij,nj->ni", whole[:, :6], loads)
            motion = np.linalg.solve(path.struts.jacobian, stretch[..., None])[..., 0]
            energy += np.einsum("ni,nij,nj->n", motion, beside, motion)
        columns.append(energy)
    return np.stack(columns, axis=1)
