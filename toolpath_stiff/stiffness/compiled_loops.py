"""The compiled loops of `compiled`: numba at module level, because only then its cache on disk is found again.

Import this module only through `compiled`, which does so when a kernel is first asked for.

What makes the loops vectorise, each worth a factor of 4 or more: poses last in the arrays, an unsigned loop variable
(a signed one may count from the end), the per-pose functions inlined, joints hoisted into tuples, no branches.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc, untyped-decorator"
# ruff: noqa: D103 - the textbook names say it

from __future__ import annotations

import numba
import numpy as np

# No "nnan", no "ninf": singular poses must come out as such.
FAST = {"contract", "nsz", "arcp", "reassoc"}
# Inlined by LLVM: numba would copy and type each function anew wherever it is called, three times the work to compile.
inline = numba.njit(forceinline=True, fastmath=FAST, error_model="numpy")


def loop(function):
    """Compile, and keep the result on disk; where no folder can be written, compile in every process anew."""
    try:
        return numba.njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")(function)
    except RuntimeError:  # numba looked beside this file and in the user's cache folder: "no locator available"
        return numba.njit(nogil=True, fastmath=FAST, error_model="numpy")(function)


@inline
def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inline
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def scale(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


@inline
def combine(columns, x):
    """Columns of a 3 x 3 matrix times a vector."""
    a, b, c = columns
    return (
        a[0] * x[0] + b[0] * x[1] + c[0] * x[2],
        a[1] * x[0] + b[1] * x[1] + c[1] * x[2],
        a[2] * x[0] + b[2] * x[1] + c[2] * x[2],
    )


@inline
def rows_times(rows, x):
    return (dot(rows[0], x), dot(rows[1], x), dot(rows[2], x))


@inline
def inverse(a, b, c):
    """Rows of the inverse of the matrix with columns a, b, c, and its determinant."""
    bc = cross(b, c)
    determinant = dot(a, bc)
    over = 1.0 / determinant
    return (scale(bc, over), scale(cross(c, a), over), scale(cross(a, b), over)), determinant


@inline
def strut(tip, arm, frame):
    """Direction, moment about the tip and length of one strut."""
    s = (tip[0] + arm[0] - frame[0], tip[1] + arm[1] - frame[1], tip[2] + arm[2] - frame[2])
    length = np.sqrt(dot(s, s))
    u = scale(s, 1.0 / length)
    return u, cross(arm, u), length


@inline
def strut_lengths(tip, arms, frame):
    return (
        strut(tip, arms[0], frame[0])[2],
        strut(tip, arms[1], frame[1])[2],
        strut(tip, arms[2], frame[2])[2],
        strut(tip, arms[3], frame[3])[2],
        strut(tip, arms[4], frame[4])[2],
        strut(tip, arms[5], frame[5])[2],
    )


@inline
def turned(r, a):
    return (
        r[0] * a[0] + r[1] * a[1] + r[2] * a[2],
        r[3] * a[0] + r[4] * a[1] + r[5] * a[2],
        r[6] * a[0] + r[7] * a[1] + r[8] * a[2],
    )


@inline
def turned_arms(r, arms, i):
    """The six arms in base axes, by the rotation matrix in column i."""
    turn = (r[0, i], r[1, i], r[2, i], r[3, i], r[4, i], r[5, i], r[6, i], r[7, i], r[8, i])
    return (
        turned(turn, arms[0]),
        turned(turn, arms[1]),
        turned(turn, arms[2]),
        turned(turn, arms[3]),
        turned(turn, arms[4]),
        turned(turn, arms[5]),
    )


@inline
def factors(tip, arms, frame):
    """Struts and the two inverses of the elimination: U_A^-1 and S^-1, with their determinants."""
    u0, m0, l0 = strut(tip, arms[0], frame[0])
    u1, m1, l1 = strut(tip, arms[1], frame[1])
    u2, m2, l2 = strut(tip, arms[2], frame[2])
    u3, m3, l3 = strut(tip, arms[3], frame[3])
    u4, m4, l4 = strut(tip, arms[4], frame[4])
    u5, m5, l5 = strut(tip, arms[5], frame[5])
    w, first = inverse(u0, u1, u2)
    t3, t4, t5 = rows_times(w, u3), rows_times(w, u4), rows_times(w, u5)
    moments = (m0, m1, m2)
    n3, n4, n5 = combine(moments, t3), combine(moments, t4), combine(moments, t5)
    s3 = (m3[0] - n3[0], m3[1] - n3[1], m3[2] - n3[2])
    s4 = (m4[0] - n4[0], m4[1] - n4[1], m4[2] - n4[2])
    s5 = (m5[0] - n5[0], m5[1] - n5[1], m5[2] - n5[2])
    q, second = inverse(s3, s4, s5)
    return w, (t3, t4, t5), moments, q, first, second, (l0, l1, l2, l3, l4, l5)


@inline
def forces(w, t, moments, q, load):
    """Strut forces in equilibrium with a force at the tip."""
    a = rows_times(w, load)
    b = rows_times(q, combine(moments, a))
    back = combine(t, b)
    return (a[0] + back[0], a[1] + back[1], a[2] + back[2], -b[0], -b[1], -b[2])


@inline
def six(a, b, c):
    """Sum of a_i b_i c_i over the struts."""
    return (
        a[0] * b[0] * c[0]
        + a[1] * b[1] * c[1]
        + a[2] * b[2] * c[2]
        + a[3] * b[3] * c[3]
        + a[4] * b[4] * c[4]
        + a[5] * b[5] * c[5]
    )


@inline
def compliances(lengths, intercept, slope):
    """1 / k(L) of the struts; the first is nan, and with it the result, unless all have a stiffness above zero."""
    k0, k1, k2 = intercept + slope * lengths[0], intercept + slope * lengths[1], intercept + slope * lengths[2]
    k3, k4, k5 = intercept + slope * lengths[3], intercept + slope * lengths[4], intercept + slope * lengths[5]
    holds = (k0 > 0.0) & (k1 > 0.0) & (k2 > 0.0) & (k3 > 0.0) & (k4 > 0.0) & (k5 > 0.0)
    return (1.0 / k0 if holds else np.nan, 1.0 / k1, 1.0 / k2, 1.0 / k3, 1.0 / k4, 1.0 / k5)


@inline
def tensor(tip, arms, frame, intercept, slope, out, det, i):
    w, t, moments, q, first, second, lengths = factors(tip, arms, frame)
    c = compliances(lengths, intercept, slope)
    fx = forces(w, t, moments, q, (1.0, 0.0, 0.0))
    fy = forces(w, t, moments, q, (0.0, 1.0, 0.0))
    fz = forces(w, t, moments, q, (0.0, 0.0, 1.0))
    out[0, i] = six(fx, fx, c)
    out[1, i] = six(fy, fy, c)
    out[2, i] = six(fz, fz, c)
    out[3, i] = six(fx, fy, c)
    out[4, i] = six(fx, fz, c)
    out[5, i] = six(fy, fz, c)
    det[0, i] = first
    det[1, i] = second


@inline
def directed(tip, arms, frame, intercept, slope, load, out, det, i):
    """Compliance along one direction and the determinants; returns the lengths."""
    w, t, moments, q, first, second, lengths = factors(tip, arms, frame)
    c = compliances(lengths, intercept, slope)
    f = forces(w, t, moments, q, load)
    out[i] = six(f, f, c)
    det[0, i] = first
    det[1, i] = second
    return lengths


@inline
def store(lengths, out, i):
    out[0, i] = lengths[0]
    out[1, i] = lengths[1]
    out[2, i] = lengths[2]
    out[3, i] = lengths[3]
    out[4, i] = lengths[4]
    out[5, i] = lengths[5]


@loop
def tensor_vertical(n, p, arms, frame, intercept, slope, out, det):
    for i in range(np.uint64(0), np.uint64(n)):
        tensor((p[0, i], p[1, i], p[2, i]), arms, frame, intercept, slope, out, det, i)


@loop
def tensor_tilted(n, p, r, arms, frame, intercept, slope, out, det):
    for i in range(np.uint64(0), np.uint64(n)):
        moved = turned_arms(r, arms, i)
        tensor((p[0, i], p[1, i], p[2, i]), moved, frame, intercept, slope, out, det, i)


ROWS = 256  # poses at a time for work arrays and for two passes: some 50 kB, which stay in the second-level cache


@loop
def directed_vertical(n, p, d, arms, frame, intercept, slope, out, det, lengths):
    for i in range(np.uint64(0), np.uint64(n)):
        load = (d[0, i], d[1, i], d[2, i])
        tip = (p[0, i], p[1, i], p[2, i])
        store(directed(tip, arms, frame, intercept, slope, load, out, det, i), lengths, i)


@loop
def directed_tilted(n, p, r, d, arms, frame, intercept, slope, out, det, lengths):
    # Two passes, lengths apart: LLVM vectorises a loop only if at most 128 comparisons tell that no row written
    # overlaps another row (its vectorize-memory-check-threshold). One pass reads 15 rows and writes 9, which needs
    # 9 * 15 + 9 * 8 / 2 = 171: four times slower, and fast as soon as the threshold is 171.
    for start in range(0, n, ROWS):
        first, last = np.uint64(start), np.uint64(min(start + ROWS, n))
        for i in range(first, last):
            load = (d[0, i], d[1, i], d[2, i])
            tip = (p[0, i], p[1, i], p[2, i])
            directed(tip, turned_arms(r, arms, i), frame, intercept, slope, load, out, det, i)
        for i in range(first, last):
            store(strut_lengths((p[0, i], p[1, i], p[2, i]), turned_arms(r, arms, i), frame), lengths, i)


@inline
def scatter(m, c, d, smallest, out, good, base):
    """Six columns xx, yy, zz, xy, xz, yz to rows of nine, and whether the determinants d are large enough."""
    for i in range(np.uint64(0), np.uint64(m)):
        finite = abs(c[2, i]) < np.inf
        good[base + i] = (abs(d[0, i]) > smallest[0]) & (abs(d[1, i]) > smallest[1]) & finite
        out[base + i, 0] = c[0, i]
        out[base + i, 4] = c[1, i]
        out[base + i, 8] = c[2, i]
        out[base + i, 1] = out[base + i, 3] = c[3, i]
        out[base + i, 2] = out[base + i, 6] = c[4, i]
        out[base + i, 5] = out[base + i, 7] = c[5, i]


@inline
def gather(m, position, base, p):
    """Rows of positions to columns."""
    for i in range(np.uint64(0), np.uint64(m)):
        p[0, i] = position[base + i, 0]
        p[1, i] = position[base + i, 1]
        p[2, i] = position[base + i, 2]


@loop
def tensor_rows_vertical(position, arms, frame, intercept, slope, smallest, out, good):
    """As `tensor_vertical` with poses in rows: position (n, 3), out (n, 9); `smallest` determinants that are good."""
    p, c, d = np.empty((3, ROWS)), np.empty((6, ROWS)), np.empty((2, ROWS))
    for start in range(0, len(position), ROWS):
        m, base = min(ROWS, len(position) - start), np.uint64(start)
        gather(m, position, base, p)
        tensor_vertical(m, p, arms, frame, intercept, slope, c, d)
        scatter(m, c, d, smallest, out, good, base)


@loop
def tensor_rows_tilted(position, rotation, arms, frame, intercept, slope, smallest, out, good):
    """As `tensor_tilted` with poses in rows: position (n, 3), rotation and out (n, 9)."""
    p, r = np.empty((3, ROWS)), np.empty((9, ROWS))
    c, d = np.empty((6, ROWS)), np.empty((2, ROWS))
    for start in range(0, len(position), ROWS):
        m, base = min(ROWS, len(position) - start), np.uint64(start)
        gather(m, position, base, p)
        for i in range(np.uint64(0), np.uint64(m)):
            for k in range(9):
                r[np.uint64(k), i] = rotation[base + i, np.uint64(k)]
        tensor_tilted(m, p, r, arms, frame, intercept, slope, c, d)
        scatter(m, c, d, smallest, out, good, base)
