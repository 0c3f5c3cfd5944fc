"""Strut forces by elimination: the arithmetic of the closed form, for many poses at a time.

Equilibrium J^T f = w of the exact route, solved by 3 x 3 blocks instead of a pivoted 6 x 6: the struts are split into
two triplets A and B, forces are eliminated first,

    f_A = U_A^-1 (F - U_B f_B),    (M_B - M_A U_A^-1 U_B) f_B = -M_A U_A^-1 F,

with U the strut directions and M = r x u their moments about the tip as columns. 3 x 3 inverses are cross products.

A vector is three components, a matrix its three columns; a component is an array over poses. Components may be those
of several vectors at once: dimensions before the poses. Terms are added in the order in which they are written, so that
numbers are the same to the last bit in every version.
"""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray

Vector = FloatArray | Sequence[FloatArray]


def cross(a: Vector, b: Vector) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Vector product a x b."""
    x, y, z = a[1] * b[2], a[2] * b[0], a[0] * b[1]
    x -= a[2] * b[1]
    y -= a[0] * b[2]
    z -= a[1] * b[0]
    return (x, y, z)


def dot(a: Vector, b: Vector) -> FloatArray:
    """Scalar product a . b, or a matrix of the columns a times the vector b."""
    total = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def strut(s: Vector, arm: Vector) -> tuple[Sequence[FloatArray], Sequence[FloatArray], FloatArray]:
    """Direction, moment about the tip and length of strut s, whose platform joint is at `arm` from the tip."""
    length = np.sqrt(dot(s, s))
    over = 1.0 / length
    u = (s[0] * over, s[1] * over, s[2] * over)
    return u, cross(arm, u), length


def forces(t: Vector, moments: Vector, q: Vector, a: Vector) -> Sequence[FloatArray]:
    """Forces in the six struts that balance a force F at the tip, from a = U_A^-1 F.

    `t` is U_A^-1 U_B, `moments` is M_A, `q` the inverse of S = M_B - M_A U_A^-1 U_B.
    """
    b = dot(q, dot(moments, a))
    back = dot(t, b)
    return (a[0] + back[0], a[1] + back[1], a[2] + back[2], -b[0], -b[1], -b[2])


def over_struts(a: Vector, b: Vector, c: Vector) -> FloatArray:
    """Sum of a_i b_i c_i over the six struts."""
    total = a[0] * b[0] * c[0]
    for i in range(1, 6):
        total += a[i] * b[i] * c[i]
    return total
