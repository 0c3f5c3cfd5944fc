"""What terms do per unit of their sizes: loads of links, compliances of struts, errors of readings."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.effects.frame_compliance import frame_vertices
from toolpath_stiff.stiffness.terms import AXES, PINS, Term, shaped


def carriers(link: str, action: str, direction: str, where: int | None, path: LoadPath) -> FloatArray:
    """(n, k, 12) h of the link's generalised forces h . [f; w] under strut forces f and the tip's wrench w.

    The compliance along a load is the sum of their squares times that of the link.
    """
    if action == "vertex":
        return _vertex_carriers(link, direction, where, path)
    axes = _axes(link, action, direction, path)
    rows = np.zeros((len(path), axes.shape[1], 12))
    rows[:, :, 6:9] = axes
    return rows


def _axes(link: str, action: str, direction: str, path: LoadPath) -> FloatArray:
    """(n, k, 3) a: the link's generalised forces are a . F of the tip's force F."""
    n = len(path)
    if link in ("tool", "platform"):
        columns = {"X": [0], "Y": [1], "Z": [2], "axial": [2], "radial": [0, 1], "all": [0, 1, 2]}[direction]
        axes = np.swapaxes(path.rotation, 1, 2)[:, columns]  # rows R e
        if action == "tilting":  # (lever x F) . (R e_z x R e) = F . ((R e_z x R e) x lever)
            lever = -path.struts.arms.mean(axis=1)
            about = np.cross(path.rotation[:, None, :, 2], axes)
            return np.cross(about, lever[:, None])
        return axes
    x, y, z = path.position.T
    none = np.zeros(n)
    if action == "rocking":  # moments of F at p about Y, X and Z
        of = {"X": (z, none, -x), "Y": (none, z, -y), "tangential": (-y, x, none)}
        chosen = ("X", "Y") if direction == "all" else (direction,)
        return np.stack([np.stack(of[axis], axis=1) for axis in chosen], axis=1)
    if direction in ("radial", "tangential"):
        reach = np.maximum(np.hypot(x, y), 1e-9)
        ends = (x, y, none) if direction == "radial" else (-y, x, none)
        return np.asarray((np.stack(ends, axis=1) / reach[:, None])[:, None])
    columns = {"all": [0, 1, 2], "horizontal": [0, 1]}.get(direction) or [AXES[direction]]
    return np.broadcast_to(np.eye(3)[columns], (n, len(columns), 3))


def _vertex_carriers(link: str, direction: str, where: int | None, path: LoadPath) -> FloatArray:
    """(n, k, 12) of the vertices of frame or platform: the force of two struts along the vertex's own axes."""
    joints = path.machine.frame_joints if link == "frame" else path.machine.platform_joints
    carried = []
    for number, (pair, outward) in enumerate(frame_vertices(joints), start=1):
        if where not in (None, number):
            continue
        row = np.zeros((len(path), 12))
        if direction == "along the struts":  # what both carry together
            row[:, pair] = 1.0
        else:
            across = np.array([-outward[1], outward[0], 0.0])
            upright = np.array([0.0, 0.0, 1.0])
            along = {"radial": outward, "tangential": across, "Z": upright, "axial": upright}[direction]
            axis = np.broadcast_to(along, (len(path), 3)) if link == "frame" else path.rotation @ along
            row[:, pair] = np.einsum("nij,nj->ni", path.struts.directions[:, pair], axis)
        carried.append(row)
    return np.stack(carried, axis=1)


def along_pins(action: str, direction: str, path: LoadPath) -> FloatArray:
    """(n, 6) share of each strut's force that is along the pin of its joint."""
    joints = path.machine.frame_joints if action == "frame pin" else path.machine.platform_joints
    x, y = joints[:, :2].T / np.linalg.norm(joints[:, :2], axis=1)
    pins = np.stack([x, y, 0.0 * x] if direction == "radial" else [-y, x, 0.0 * x], axis=1)
    turned = pins if action == "frame pin" else pins @ np.swapaxes(path.rotation, 1, 2)
    return np.asarray((path.struts.directions * turned).sum(axis=-1))


def strut_share(term: Term, path: LoadPath) -> FloatArray:
    """(n, 6) of each strut per unit of a size: compliance of what is in series with it, stiffness of `turning`."""
    shape = shaped(term, path)
    each = np.array(np.broadcast_to(shape[:, None] if shape.ndim == 1 else shape, (len(path), 6)), dtype=float)
    if term.where is not None:
        each[:, np.arange(6) != term.where - 1] = 0.0
    if term.action == "strut factor":
        each = np.asarray(each / path.machine.strut_law.stiffness(path.struts.lengths))
    if term.action in PINS:
        each = np.asarray(each * along_pins(term.action, term.direction, path) ** 2)
    return each


def coupled(term: Term) -> tuple[int, int]:
    """Indices from 0 of the struts of a `coupling`."""
    return int(term.constants["first"]) - 1, int(term.constants["second"]) - 1


def pair_stiffness(term: Term, path: LoadPath) -> FloatArray:
    """(n,) N/m, the geometric mean of the struts of a `coupling`."""
    stiffness = path.machine.strut_law.stiffness(path.struts.lengths[:, coupled(term)])
    return np.asarray(np.sqrt(stiffness.prod(axis=1)))


def reading_share(term: Term, path: LoadPath) -> FloatArray:
    """(n,) by how much a `reading` is off per unit of the term's size: a share, or a displacement in m."""
    shape = shaped(term, path)
    if term.direction in AXES:
        assert path.direction is not None
        shape = shape * path.direction[:, AXES[term.direction]] ** 2
    return np.asarray(shape)
