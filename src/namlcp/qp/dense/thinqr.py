"""A thin QR factorisation that gains and loses one row at a time.

V_F' = Q'R for the k active rows V_F of V = C L^-T: the rows of Q (k, n) are
orthonormal, R is upper triangular of order k. Both are the leading parts of m.Q and
m.R. Rows are added by Gram-Schmidt with repetition and removed by Givens rotations.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import add_scaled, dot


@part
def orthogonalise(m):
    """Set m.coefficients = Q v and m.rest = v - Q'Q v for v = m.rest; return its norm.

    Gram-Schmidt is repeated, twice at most, where cancellation halves the norm.
    """
    Q, v, d = floats(m.Q, (m.n, m.n)), floats(m.rest, m.n), floats(m.coefficients, m.k)
    for i in range(m.k):
        d[i] = 0.0
    length = np.sqrt(dot(v, v))
    for _ in range(3):
        before = length
        for i in range(m.k):
            c = dot(Q[i], v)
            d[i] += c
            add_scaled(-c, Q[i], v)
        length = np.sqrt(dot(v, v))
        if length > 0.5 * before:
            break
    return length


@part
def triangular_solve(m, d):
    """Overwrite d (k,) by R^-1 d."""
    R = floats(m.R, (m.n, m.n))
    for i in range(m.k - 1, -1, -1):
        d[i] = (d[i] - dot(R[i, i + 1 : m.k], d[i + 1 : m.k])) / R[i, i]


@part
def triangular_solve_transposed(m, d):
    """Overwrite d (k,) by R^-T d."""
    R = floats(m.R, (m.n, m.n))
    for i in range(m.k):
        d[i] /= R[i, i]
        for j in range(i + 1, m.k):
            d[j] -= R[i, j] * d[i]


@part
def append_row(m, index, multiplier, length):
    """Make a constraint active whose row `orthogonalise` has left, of this length."""
    Q, R, k = floats(m.Q, (m.n, m.n)), floats(m.R, (m.n, m.n)), m.k
    rest, coefficients = floats(m.rest, m.n), floats(m.coefficients, m.k)
    for i in range(k):
        R[i, k] = coefficients[i]
    R[k, k] = length
    for j in range(m.n):
        Q[k, j] = rest[j] / length
    longs(m.active, m.n + 1)[k] = index
    floats(m.multiplier, m.n + 1)[k] = multiplier
    m.k += 1


@part
def remove_row(m, leaving):
    """Remove the constraint active[leaving]."""
    Q, R, last = floats(m.Q, (m.n, m.n)), floats(m.R, (m.n, m.n)), m.k - 1
    active, multiplier = longs(m.active, m.n + 1), floats(m.multiplier, m.n + 1)
    for j in range(leaving, last):
        active[j] = active[j + 1]
        multiplier[j] = multiplier[j + 1]
        for i in range(j + 2):
            R[i, j] = R[i, j + 1]
    for i in range(leaving, last):
        radius = np.hypot(R[i, i], R[i + 1, i])
        c, s = R[i, i] / radius, R[i + 1, i] / radius
        R[i, i] = radius
        R[i + 1, i] = 0.0
        for j in range(i + 1, last):
            upper, lower = R[i, j], R[i + 1, j]
            R[i, j] = c * upper + s * lower
            R[i + 1, j] = c * lower - s * upper
        for j in range(m.n):
            upper, lower = Q[i, j], Q[i + 1, j]
            Q[i, j] = c * upper + s * lower
            Q[i + 1, j] = c * lower - s * upper
    m.k = last
