"""Readings of an indicator across part of the load path, under a load at the tip: by virtual work.

A pair of equal and opposite unit forces at the indicator's two points is carried by what lies between them alone (the
six struts are statically determinate, so that the pair loads nothing else). With the real loads u = [f; w] of strut
forces and tip wrench, and those of the pair, v, the reading is the sum over the links inside the loop of v^T C u
(principle of virtual forces; Przemieniecki 1968, Theory of Matrix Structural Analysis, chapter 3). The tip's own loop
is the case v = u over all links.

| loop | v |
| --- | --- |
| spindle, table | the unit load at the tip; no strut forces |
| strut N, joint N | 1 in strut N |
| frame N | a unit force on the vertex along the indicator: `Effect.vertex_displacement` |
| strut N alone | 1 in strut N, and so is u: the strut's own compliance |
| platform | what the tip reads less what the spindle does |
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.effects.frame_compliance import frame_vertices
from toolpath_stiff.stiffness.exact import compliance_along, refuse_law_beyond_zero, under_load
from toolpath_stiff.stiffness.measuring_loop import MeasuringLoop
from toolpath_stiff.stiffness.model import StiffnessModel


def loop_compliance(
    model: StiffnessModel, path: LoadPath, direction: FloatArray, loops: Sequence[MeasuringLoop], which: IntArray
) -> FloatArray:
    """Displacement that indicators read, per load at the tip (of a strut alone: per force in it).

    Parameters
    ----------
    model
        Machine and effects; instruments are not asked.
    path
        n poses under their loads.
    direction
        (n, 3) unit vectors of the load.
    loops, which
        The loops, and which of them each reading (n,) is of.

    Returns
    -------
    (n,) m/N: positive along the load, as a strut or joint gets longer, as a vertex moves outwards or up.

    Raises
    ------
    InputError
        As `exact.compliance_along`.
    """
    compliance = np.empty(len(path))
    for number in np.unique(which).tolist():
        rows = np.flatnonzero(which == number)
        compliance[rows] = _one_loop(model, path.take(rows), direction[rows], loops[number])
    return compliance


def _one_loop(model: StiffnessModel, path: LoadPath, direction: FloatArray, loop: MeasuringLoop) -> FloatArray:
    if loop.kind in ("tip", "platform"):
        whole = compliance_along(model, path, direction)
        return whole if loop.kind == "tip" else whole - _one_loop(model, path, direction, MeasuringLoop("spindle"))
    real, pair = np.zeros((2, len(path), 12))
    if loop.kind == "alone":
        real[:, loop.number - 1] = 1.0
        path = replace(path, strut_forces=real[:, :6] * path.force[:, None])
    else:
        path, _, _, real[:, :6] = under_load(model, path, direction)
        real[:, 6:9] = direction
    if loop.kind == "frame":
        return _vertex_reading(model, path, real[:, :6], direction, loop)
    if loop.kind in ("spindle", "table"):
        pair[:, 6:9] = direction
    else:
        pair[:, loop.number - 1] = 1.0
    products, reading = pair[:, :, None] * real[:, None], np.zeros(len(path))
    in_struts = pair[:, :6] * real[:, :6]
    if "struts" in loop.links:
        law = path.machine.strut_law.stiffness(path.struts.lengths)
        refuse_law_beyond_zero(path, law)
        reading += (in_struts / law).sum(axis=1)
    for active in model.effects:
        if share := active.effect.seen_by(loop):
            series, form = active.adds("strut_compliance", path), active.adds("load_compliance", path)
            reading += 0.0 if series is None else share * (series * in_struts).sum(axis=1)
            reading += 0.0 if form is None else share * (form * products).sum(axis=(1, 2))
    return reading


def _vertex_reading(
    model: StiffnessModel, path: LoadPath, forces: FloatArray, direction: FloatArray, loop: MeasuringLoop
) -> FloatArray:
    """(n,) m/N, displacement of a vertex against the floor."""
    _, radial = frame_vertices(path.machine.frame_joints)[loop.number - 1]
    along = {"": direction, "radial": radial, "vertical": np.array([0.0, 0.0, 1.0])}[loop.where]
    reading = np.zeros(len(path))
    for active in model.effects:
        if active.effect.seen_by(loop) and active.effect.acts_on(path, active.values):
            moved = active.effect.vertex_displacement(path, active.values, forces, loop.number)
            if moved is not None:
                reading += (moved * along).sum(axis=1)
    return reading


def law_products(forces: FloatArray, loops: Sequence[MeasuringLoop], which: IntArray) -> FloatArray:
    """(n, 6) weight of each strut's own compliance in a reading: products of real and virtual strut forces.

    `forces` (n, 6) are those under the unit load.
    """
    products = np.zeros_like(forces)
    for number in np.unique(which).tolist():
        rows, loop = which == number, loops[number]
        if loop.kind in ("tip", "platform"):
            products[rows] = forces[rows] ** 2
        elif loop.kind == "strut":
            products[rows, loop.number - 1] = forces[rows, loop.number - 1]
        elif loop.kind == "alone":
            products[rows, loop.number - 1] = 1.0
    return products
