"""A thin QR factorisation that gains and loses one row at a time.

V' = Q'R for k rows V (k, n): the rows of Q (k, n) are orthonormal, R is upper
triangular of order k. Both are the leading parts of larger arrays. Rows are added by
Gram-Schmidt with repetition and removed by Givens rotations.
"""

import numpy as np

from namlcp.compiled import part
from namlcp.linalg import add_scaled, dot


@part
def orthogonalise(Q, k, v, d):
    """Set d (k,) = Q v and v -= Q'd; return the 2-norm of the new v.

    Gram-Schmidt is repeated, twice at most, where cancellation halves the norm.
    """
    for i in range(k):
        d[i] = 0.0
    length = np.sqrt(dot(v, v))
    for _ in range(3):
        before = length
        for i in range(k):
            c = dot(Q[i], v)
            d[i] += c
            add_scaled(-c, Q[i], v)
        length = np.sqrt(dot(v, v))
        if length > 0.5 * before:
            break
    return length


@part
def triangular_solve(R, k, d):
    """Overwrite d (k,) by R^-1 d, R upper triangular of order k."""
    for i in range(k - 1, -1, -1):
        d[i] = (d[i] - dot(R[i, i + 1 : k], d[i + 1 : k])) / R[i, i]


@part
def triangular_solve_transposed(R, k, d):
    """Overwrite d (k,) by R^-T d."""
    for i in range(k):
        d[i] /= R[i, i]
        for j in range(i + 1, k):
            d[j] -= R[i, j] * d[i]


@part
def append_row(Q, R, k, v, d, length):
    """Append a row from the d (k,), v and length of `orthogonalise` to Q and R."""
    for i in range(k):
        R[i, k] = d[i]
    R[k, k] = length
    for j in range(v.size):
        Q[k, j] = v[j] / length


@part
def remove_row(Q, R, k, leaving, active, multiplier):
    """Delete row `leaving` of k from active, multiplier, Q and R."""
    for j in range(leaving, k - 1):
        active[j] = active[j + 1]
        multiplier[j] = multiplier[j + 1]
        for i in range(j + 2):
            R[i, j] = R[i, j + 1]
    for i in range(leaving, k - 1):
        radius = np.hypot(R[i, i], R[i + 1, i])
        c, s = R[i, i] / radius, R[i + 1, i] / radius
        R[i, i] = radius
        R[i + 1, i] = 0.0
        for j in range(i + 1, k - 1):
            upper, lower = R[i, j], R[i + 1, j]
            R[i, j] = c * upper + s * lower
            R[i + 1, j] = c * lower - s * upper
        for j in range(Q.shape[1]):
            upper, lower = Q[i, j], Q[i + 1, j]
            Q[i, j] = c * upper + s * lower
            Q[i + 1, j] = c * lower - s * upper
