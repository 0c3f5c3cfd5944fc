"""Compliance of the tip in the frame of a station: the machine with all its effects, and the tool's own bending."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray, IntArray, product
from toolpath_stiff.cutting.cutters import Cutter, of_tools
from toolpath_stiff.path.placing import place_orientations
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.rotations import along_tool_axis, rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import StiffnessModel, parameter_slopes

ALONG = 1e-12  # a smaller component of a unit vector across the tool is rounding


def station_axes(samples: Samples, origin: ArrayLike) -> FloatArray:
    """(n, 3, 3) `axes_at` in machine coordinates, of samples in the set-up frame."""
    return product(rotation_matrices(np.asarray(origin, dtype=float)[3:])[None], axes_at(samples))


def axes_at(samples: Samples) -> FloatArray:
    """(n, 3, 3) frames of stations as columns: x along the feed square to the tool, y to its left, z along the tool."""
    axes = rotation_matrices(samples.abc)
    level = samples.tangent - along_tool_axis(samples.tangent, samples.abc)[:, None] * axes[:, :, 2]
    length = np.linalg.norm(level, axis=1)[:, None]
    axes[:, :, 0] = np.where(length > ALONG, level / np.where(length > 0.0, length, 1.0), axes[:, :, 0])
    axes[:, :, 1] = np.cross(axes[:, :, 2], axes[:, :, 0])
    return axes


def walls_beside(
    samples: Samples, cutters: Mapping[int, Cutter], rows: IntArray, sides: IntArray
) -> tuple[FloatArray, FloatArray]:
    """(m, 3) m, foot of the wall beside each sample (`sides`: 0 left, 1 right), and its normal into the part."""
    some = samples.take(rows)
    into = axes_at(some)[:, :, 1] * np.where(sides == 0, 1.0, -1.0)[:, None]
    return some.position + of_tools(cutters, some.tool, "radius")[:, None] * into, into


def tip_compliances(
    model: StiffnessModel, samples: Samples, origin: ArrayLike, axes: FloatArray, force: FloatArray
) -> FloatArray:
    """(n, 3, 3) m/N of the machine at samples in the set-up frame, in frames of `axes` (n, 3, 3).

    `force` (n, 3) N in these frames is the one that acts, for effects that depend on it.
    """
    zero, upright = np.asarray(origin, dtype=float), place_orientations(samples.abc, origin)
    position = product(samples.position, rotation_matrices(zero[3:]).T) + zero[:3]
    rotation = rotation_matrices(upright) if upright.any() else None
    load = product(axes, force[:, :, None])[..., 0] if model.load_dependent else None
    tensor = core.tip_compliance(model, position, rotation, samples.tool_length, load=load, in_work=True)
    return product(product(np.swapaxes(axes, 1, 2), tensor), axes)


def with_tools(compliance: FloatArray, samples: Samples, cutters: Mapping[int, Cutter]) -> FloatArray:
    """The compliance with that of each tool added, where it is known."""
    lateral, axial = (of_tools(cutters, samples.tool, f"{which}_compliance") for which in ("lateral", "axial"))
    return compliance + np.eye(3) * np.nan_to_num(np.stack([lateral, lateral, axial], axis=1))[:, None]


def machine_deviation(
    model: StiffnessModel, samples: Samples, origin: ArrayLike, axes: FloatArray, force: FloatArray, here: FloatArray
) -> FloatArray:
    """(n, 2) standard deviations of the machine's compliance across the feed and along the tool, m/N.

    Linear, from the fitted parameters of the machine file (JCGM 100:2008, equation 13); 0 where it states none. `here`
    (n, 3, 3) is that of `tip_compliances`, to which the other arguments belong.
    """

    def compliance(moved: StiffnessModel) -> FloatArray:
        return tip_compliances(moved, samples, origin, axes, force)

    slopes = parameter_slopes(model, compliance, here)
    uncertainty, kept = model.given.uncertainty if model.given is not None else None, [*slopes]
    if uncertainty is None or not kept:
        return np.zeros((len(samples), 2))
    each = np.stack([slope[:, (1, 2), (1, 2)] for slope in slopes.values()])
    variance = np.einsum("pna,pq,qna->na", each, uncertainty.correlation[np.ix_(kept, kept)], each)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
