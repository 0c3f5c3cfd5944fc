"""How far the tip gives way in the frame of a station: the machine with all its effects, and the tool's own beam."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff.arrays import FloatArray, product
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.path.placing import place_orientations
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import StiffnessModel, parameter_slopes


def station_axes(heading: FloatArray, origin: ArrayLike) -> FloatArray:
    """(n, 3, 3) in machine coordinates, columns x (feed), y (left), z (up); `heading` (n,) rad in the set-up frame."""
    axes = rotation_matrices(np.stack([np.zeros_like(heading), np.zeros_like(heading), heading], axis=1))
    return product(rotation_matrices(np.asarray(origin, dtype=float)[3:])[None], axes)


def tip_compliances(
    model: StiffnessModel, samples: Samples, origin: ArrayLike, axes: FloatArray, force: FloatArray
) -> FloatArray:
    """(n, 3, 3) m/N of the machine at samples of the set-up frame, in frames of `axes` (n, 3, 3).

    `force` (n, 3) N in these frames is the one that acts, for effects that depend on it.
    """
    zero, upright = np.asarray(origin, dtype=float), place_orientations(samples.abc, origin)
    position = product(samples.position, rotation_matrices(zero[3:]).T) + zero[:3]
    rotation = rotation_matrices(upright) if upright.any() else None
    load = product(axes, force[:, :, None])[..., 0] if model.load_dependent else None
    tensor = core.tip_compliance(model, position, rotation, samples.tool_length, load=load)
    return product(product(np.swapaxes(axes, 1, 2), tensor), axes)


def with_tools(compliance: FloatArray, samples: Samples, cutters: Mapping[int, Cutter]) -> FloatArray:
    """The same with each tool's own beam, where it is known."""
    total = compliance.copy()
    for number, cutter in cutters.items():
        beam = np.nan_to_num([cutter.lateral_compliance, cutter.lateral_compliance, cutter.axial_compliance])
        total[samples.tool == number] += np.diag(beam)
    return total


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
