"""The closed form over poses, compiled with numba, at module level, because only then its cache on disk is found again.

Import this module only through `core.compiled_columns`.

What makes the loops vectorise, each worth a factor of 4 or more: poses last in the arrays, an unsigned loop variable
(a signed one may count from the end), the per-pose functions inlined, joints hoisted into tuples, no branches. An
argument that is None, as the rotation of a vertical spindle, takes its branch with it when numba compiles.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc, untyped-decorator, arg-type, call-overload"
# ruff: noqa: D103 - the textbook names say it

import numba
import numpy as np
from numba.extending import overload, register_jitable

from toolpath_stiff.stiffness.elimination import combine, cross, dot, forces, over_struts, strut

# No "nnan", no "ninf": singular poses must come out as such.
FAST = {"contract", "nsz", "arcp", "reassoc"}
# Inlined by LLVM: numba would copy and type each function anew wherever it is called, three times the work to compile.
INLINED = {"forceinline": True, "fastmath": FAST, "error_model": "numpy"}
inline = numba.njit(**INLINED)
for function in (cross, dot, strut, forces, over_struts):
    register_jitable(**INLINED)(function)

ROWS = 256  # poses at a time for two passes: some 50 kB, which stay in the second-level cache


def loop(function):
    """Compile, and keep the result on disk; where no folder can be written, compile in every process anew."""
    try:
        return numba.njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")(function)
    except RuntimeError:  # numba looked beside this file and in the user's cache folder: "no locator available"
        return numba.njit(nogil=True, fastmath=FAST, error_model="numpy")(function)


@overload(combine, jit_options=INLINED)
def combine_numbers(columns, x):
    def combined(columns, x):
        a, b, c = columns
        return (
            a[0] * x[0] + b[0] * x[1] + c[0] * x[2],
            a[1] * x[0] + b[1] * x[1] + c[1] * x[2],
            a[2] * x[0] + b[2] * x[1] + c[2] * x[2],
        )

    return combined


@inline
def inverse(a, b, c):
    """Columns of the inverse of the matrix with columns a, b, c, and its determinant."""
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    by = dot(a, bc)
    columns = (
        (bc[0] / by, ca[0] / by, ab[0] / by),
        (bc[1] / by, ca[1] / by, ab[1] / by),
        (bc[2] / by, ca[2] / by, ab[2] / by),
    )
    return columns, by


@inline
def turned(r, arm, i):
    """An arm in base axes, by the rotation matrix in column i."""
    return (
        r[0, i] * arm[0] + r[1, i] * arm[1] + r[2, i] * arm[2],
        r[3, i] * arm[0] + r[4, i] * arm[1] + r[5, i] * arm[2],
        r[6, i] * arm[0] + r[7, i] * arm[1] + r[8, i] * arm[2],
    )


@inline
def arms_at(r, arms, i):
    if r is None:
        return arms
    return (
        turned(r, arms[0], i),
        turned(r, arms[1], i),
        turned(r, arms[2], i),
        turned(r, arms[3], i),
        turned(r, arms[4], i),
        turned(r, arms[5], i),
    )


@inline
def strut_from(tip, arm, frame):
    return strut((tip[0] + arm[0] - frame[0], tip[1] + arm[1] - frame[1], tip[2] + arm[2] - frame[2]), arm)


@inline
def factors(tip, arms, frame, law):
    """U_A^-1 and S^-1 with their determinants, and 1 / k(L) of the struts.

    The first of these is nan, and with it the result, unless all struts have a stiffness above zero.
    """
    u0, m0, l0 = strut_from(tip, arms[0], frame[0])
    u1, m1, l1 = strut_from(tip, arms[1], frame[1])
    u2, m2, l2 = strut_from(tip, arms[2], frame[2])
    u3, m3, l3 = strut_from(tip, arms[3], frame[3])
    u4, m4, l4 = strut_from(tip, arms[4], frame[4])
    u5, m5, l5 = strut_from(tip, arms[5], frame[5])
    w, first = inverse(u0, u1, u2)
    t, moments = (combine(w, u3), combine(w, u4), combine(w, u5)), (m0, m1, m2)
    n3, n4, n5 = combine(moments, t[0]), combine(moments, t[1]), combine(moments, t[2])
    q, second = inverse(
        (m3[0] - n3[0], m3[1] - n3[1], m3[2] - n3[2]),
        (m4[0] - n4[0], m4[1] - n4[1], m4[2] - n4[2]),
        (m5[0] - n5[0], m5[1] - n5[1], m5[2] - n5[2]),
    )
    intercept, slope = law
    k0, k1, k2 = intercept + slope * l0, intercept + slope * l1, intercept + slope * l2
    k3, k4, k5 = intercept + slope * l3, intercept + slope * l4, intercept + slope * l5
    holds = (k0 > 0.0) & (k1 > 0.0) & (k2 > 0.0) & (k3 > 0.0) & (k4 > 0.0) & (k5 > 0.0)
    c = (1.0 / k0 if holds else np.nan, 1.0 / k1, 1.0 / k2, 1.0 / k3, 1.0 / k4, 1.0 / k5)
    return w, t, moments, q, first, second, c


@loop
def directed_columns(poses, joints, law, out, det, lengths):
    """Compliance along one direction a pose, the determinants, the lengths.

    `poses` are positions (3, n), rotations (9, n) or None, directions (3, n); `joints` those of platform and frame.
    """
    p, r, d = poses
    arms, frame = joints
    n = len(out)
    # Two passes, lengths apart: LLVM vectorises a loop only if at most 128 comparisons tell that no row written
    # overlaps another row (its vectorize-memory-check-threshold). One pass reads 15 rows and writes 9, which needs
    # 9 * 15 + 9 * 8 / 2 = 171: four times slower, and fast as soon as the threshold is 171.
    for start in range(0, n, ROWS):
        first, last = np.uint64(start), np.uint64(min(start + ROWS, n))
        for i in range(first, last):
            tip, load = (p[0, i], p[1, i], p[2, i]), (d[0, i], d[1, i], d[2, i])
            w, t, moments, q, det[0, i], det[1, i], c = factors(tip, arms_at(r, arms, i), frame, law)
            f = forces(t, moments, q, combine(w, load))
            out[i] = over_struts(f, f, c)
        for i in range(first, last):
            tip, moved = (p[0, i], p[1, i], p[2, i]), arms_at(r, arms, i)
            lengths[0, i] = strut_from(tip, moved[0], frame[0])[2]
            lengths[1, i] = strut_from(tip, moved[1], frame[1])[2]
            lengths[2, i] = strut_from(tip, moved[2], frame[2])[2]
            lengths[3, i] = strut_from(tip, moved[3], frame[3])[2]
            lengths[4, i] = strut_from(tip, moved[4], frame[4])[2]
            lengths[5, i] = strut_from(tip, moved[5], frame[5])[2]
