"""Finite elements of beams: their stiffness in base axes, springs, rigid arms, and static condensation.

The beam is Timoshenko's with two nodes, exact for loads at its ends: J. S. Przemieniecki, Theory of Matrix Structural
Analysis (1968), equation 5.116. Each node has three displacements and three rotations; a rotation is a vector.
"""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray

STEEL = (2.1e11, 8.1e10)  # Pa, Young's and shear modulus (textbook)
NODE = 6
SHEAR_SHARE = 5.0 / 6.0  # of the cross-section that takes shear (rectangle; Timoshenko)

Section = tuple[float, float, float, float]  # m^2 area and area in shear; m^4 second moment (both axes) and torsion's


def bar(diameter: float) -> Section:
    """Round bar, shear share 0.9."""
    area, second = np.pi * diameter**2 / 4.0, np.pi * diameter**4 / 64.0
    return area, 0.9 * area, second, 2.0 * second


def square(side: float) -> Section:
    """Solid square; torsion constant 0.1406 a^4 (Saint-Venant)."""
    return side**2, SHEAR_SHARE * side**2, side**4 / 12.0, 0.1406 * side**4


def bending(stiffness: FloatArray, length: FloatArray, soft: FloatArray) -> FloatArray:
    """(..., 4, 4) of displacement and slope at both ends; EI in N m^2, `soft` 12 EI / (G A_s L^2)."""
    unit, half = np.ones_like(length), length / 2.0
    pushed = np.stack([unit, half, -unit, half], axis=-1)  # the shear force 12 EI / L^3 per unit of displacement
    turned = np.stack([0.0 * unit, unit, 0.0 * unit, -unit], axis=-1)  # pure bending, EI / L
    shear = 12.0 * stiffness / (length**3 * (1.0 + soft))
    first = shear[..., None, None] * pushed[..., :, None] * pushed[..., None, :]
    return np.asarray(first + (stiffness / length)[..., None, None] * turned[..., :, None] * turned[..., None, :])


def spread(along: FloatArray, axial: FloatArray, torsion: FloatArray, bent: FloatArray) -> FloatArray:
    """(..., 12, 12) stiffness between two nodes in base axes.

    `along` (..., 3) unit vector from the first to the second; `axial` and `torsion` (...,) N/m and N m/rad; `bent`
    (..., 4, 4) of `bending`, alike in all planes: a slope is rotation x unit vector.
    """
    x, y, z = np.moveaxis(along, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([np.stack([zero, z, -y], -1), np.stack([-z, zero, x], -1), np.stack([y, -x, zero], -1)], -2)
    onto = along[..., :, None] * along[..., None, :]
    across = np.eye(3) - onto
    parts = (across, cross, across, cross)  # rotation -> slope: theta x u
    total = np.zeros((*along.shape[:-1], 12, 12))
    for i, left in enumerate(parts):
        for j, right in enumerate(parts):
            turned = np.swapaxes(left, -1, -2) @ right
            total[..., 3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = bent[..., i, j, None, None] * turned
    for first, spring in ((0, axial), (3, torsion)):
        for i, j, sign in ((0, 0, 1.0), (0, 6, -1.0), (6, 0, -1.0), (6, 6, 1.0)):
            rows, columns = slice(first + i, first + i + 3), slice(first + j, first + j + 3)
            total[..., rows, columns] += sign * np.asarray(spring)[..., None, None] * onto
    return total


def beams(
    nodes: FloatArray, pairs: Sequence[Sequence[int]], section: Section, factors: FloatArray | float = 1.0
) -> FloatArray:
    """(6 k, 6 k) of steel beams between `pairs` of nodes (k, 3) m; `factors` on the stiffness of each."""
    young, shear = STEEL
    area, sheared, second, twisted = section
    ends = np.array(pairs)
    vector = nodes[ends[:, 1]] - nodes[ends[:, 0]]
    length = np.linalg.norm(vector, axis=1)
    soft = 12.0 * young * second / (shear * sheared * length**2)
    bent = bending(np.full(len(length), young * second), length, soft)
    each = spread(vector / length[:, None], young * area / length, shear * twisted / length, bent)
    each = each * np.broadcast_to(np.asarray(factors), (len(length),))[:, None, None]
    total = np.zeros((NODE * len(nodes), NODE * len(nodes)))
    for pair, stiffness in zip(pairs, each, strict=True):
        add(total, pair, stiffness)
    return total


def add(total: FloatArray, nodes: Sequence[int], stiffness: FloatArray) -> None:
    """Add an element's stiffness, six rows a node, at its nodes in `total`; both may be stacks."""
    where = np.concatenate([np.arange(NODE * node, NODE * node + NODE) for node in nodes])
    total[..., where[:, None], where] += stiffness


def arm(reach: FloatArray) -> FloatArray:
    """(..., 6, 6) motion of a point at `reach` (..., 3) m from a node, rigidly held by it: u + theta x r, theta."""
    move = np.zeros((*reach.shape[:-1], 6, 6))
    move[..., range(6), range(6)] = 1.0
    for axis in range(3):
        move[..., :3, 3 + axis] = np.cross(np.eye(3)[axis], reach)
    return move


def springs(stiffness: FloatArray, reach: FloatArray) -> FloatArray:
    """(12, 12) of springs (6, 6) between the first node's rigid arm `reach` (3,) m and the second node."""
    both = np.concatenate([-arm(reach), np.eye(NODE)], axis=1)
    return np.asarray(both.T @ stiffness @ both)


def condensed(stiffness: FloatArray, kept: Sequence[int]) -> FloatArray:
    """Stiffness seen at the kept nodes when the others carry no load (static condensation, Guyan 1965)."""
    rows = (NODE * np.array(kept)[:, None] + np.arange(NODE)).ravel()
    rest = np.setdiff1d(np.arange(len(stiffness)), rows)
    inner = np.linalg.solve(stiffness[np.ix_(rest, rest)], stiffness[np.ix_(rest, rows)])
    return np.asarray(stiffness[np.ix_(rows, rows)] - stiffness[np.ix_(rows, rest)] @ inner)
