"""Poses that follow each other are evaluated once: the figures are those of each pose by itself."""

import numpy as np

from toolpath_stiff.analysis import evaluation
from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.stiffness.model import build_model

NIST = build_model(load_machine("nist"))


def test_a_pose_under_several_loads_is_as_each_by_itself():
    generator = np.random.default_rng(1)
    often = generator.integers(1, 5, 120)
    position = np.repeat(generator.uniform([-0.1, -0.1, 0.7], [0.1, 0.1, 0.9], (120, 3)), often, axis=0)
    angles = np.repeat(generator.uniform(-0.1, 0.1, (120, 3)) * [1.0, 1.0, 0.0], often, axis=0)
    tool = np.repeat(np.where(np.arange(120) < 60, 0.1, np.nan), often)
    n = len(position)
    along = generator.normal(size=(n, 3))
    along[::17] = 0.0  # no direction: the softest stands in
    along[np.any(along != 0.0, axis=1)] /= np.linalg.norm(along[np.any(along != 0.0, axis=1)], axis=1)[:, None]
    new = evaluation._new_poses(position, angles, tool)
    assert 0.4 * n < np.count_nonzero(new) < 0.8 * n
    for load in ("tangential", "axial"):
        together = evaluation.evaluate(NIST, position, angles, along, tool, parse_load(load))
        mixed = generator.permutation(n)
        apart = evaluation.evaluate(NIST, position[mixed], angles[mixed], along[mixed], tool[mixed], parse_load(load))
        np.testing.assert_allclose(together.stiffness[mixed], apart.stiffness, rtol=1e-12)
        np.testing.assert_allclose(together.strut_lengths[mixed], apart.strut_lengths, rtol=1e-14)
        np.testing.assert_allclose(together.reach.margin[mixed], apart.reach.margin, rtol=1e-9)
        np.testing.assert_array_equal(together.substituted[mixed], apart.substituted)
