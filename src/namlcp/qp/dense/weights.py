"""The factor of P + W, and the diagonal weight W that makes a singular P definite."""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import PSD_SLACK, ZERO, cholesky, copy, dot, largest_entry
from namlcp.qp.dense.active_rows import add_rows
from namlcp.qp.dense.rows import right_side, set_row

# P counts as singular if a pivot is at most this multiple of the diagonal entry of P.
ZERO_PIVOT = 1e-13
# Entries of W, relative to the largest diagonal entry of P or to `typical_curvature` if
# that is larger; from the second centre on, W is multiplied by LOWERING with each new
# centre, LOWERED times at most.
WEIGHT, LOWERING, LOWERED = 1e-4, 0.1, 5


@part
def factor_sum(m):
    """Set L L' = P + W; tell whether that is positive definite."""
    P, L = floats(m.P, (m.n, m.n)), floats(m.L, (m.n, m.n))
    weight = floats(m.weight, m.n)
    for i in range(m.n):
        copy(P[i], L[i])
        L[i, i] += weight[i]
    return cholesky(L) == 0


@part
def has_factor(m):
    """Set W = 0 and L L' = P; tell whether P is definite, see `ZERO_PIVOT`."""
    P, L = floats(m.P, (m.n, m.n)), floats(m.L, (m.n, m.n))
    weight = floats(m.weight, m.n)
    for j in range(m.n):
        weight[j] = 0.0
    if not factor_sum(m):
        return False
    for j in range(m.n):
        if L[j, j] * L[j, j] <= ZERO_PIVOT * P[j, j]:
            return False
    return True


@part
def choose_weight(m):
    """Choose W for a singular P, and factor P + W; False if P is not semidefinite.

    The first factorisation, shifted as in `convexity.check_convex`, decides that.
    """
    P, weight = floats(m.P, (m.n, m.n)), floats(m.weight, m.n)
    most = 0.0
    for j in range(m.n):
        most = max(most, abs(P[j, j]))
    for j in range(m.n):
        weight[j] = PSD_SLACK * P[j, j] + (ZERO * most if most > 0.0 else 1.0)
    if not factor_sum(m):
        return False
    scale = max(most, typical_curvature(m))
    if scale == 0.0:
        scale = 1.0
    for j in range(m.n):
        weight[j] = WEIGHT * scale
    return factor_sum(m)


@part
def typical_curvature(m):
    """Return max |q| over the geometric mean of the constraints' distances from x = 0.

    With entries of P of this size, the unconstrained minimum P^-1 q and the points
    where constraints hold with equality have similar norms.
    """
    row = floats(m.row, m.n)
    total, count = 0.0, 0
    for index in range(m.p + m.m + 2 * m.n):
        d = abs(right_side(m, index))
        if 0.0 < d < np.inf:
            size = 1.0
            if index < m.p + m.m:
                set_row(m, index)
                size = np.sqrt(dot(row, row))
            if size > 0.0:  # an empty row says nothing about x
                total += np.log(d / size)
                count += 1
    return largest_entry(floats(m.q, m.n)) / np.exp(total / max(count, 1))


@part
def lower_weight(m):
    """Lower W, and renew L, Q and R; tell whether P + W is still definite."""
    weight, count = floats(m.weight, m.n), m.k
    for j in range(m.n):
        weight[j] *= LOWERING
    if not factor_sum(m):
        return False
    m.k = 0
    add_rows(m, longs(m.active, count))  # writes no entry before it has read it
    return True
