"""All constraints of a dense QP under one index.

Equalities are 0..p-1, rows of G p..p+m-1, then come the lower bounds (row -e_j), then
the upper ones (row e_j): row'x <= d, or row'x = d for the first p.
"""

import numpy as np

from namlcp.compiled import part
from namlcp.linalg import copy, dot, largest_entry, matvec

# Constraints contradict each other if d'multiplier, d their right-hand sides, is below
# -CONTRADICTION times the sum of the moduli of its terms.
CONTRADICTION = 1e-10
# Entries of a ray d, of P d and of G d count as 0 up to this times max |d|, times the
# largest diagonal entry of P or the norm of the row of G.
RAY_ZERO = 1e-9
# Divisors that may be 0 are replaced by this.
LEAST_DIVISOR = 1e-300


@part
def row_norms(C, norms):
    """Set norms (m,) to the Euclidean norms of the rows of C, 1 for empty rows."""
    for i in range(C.shape[0]):
        norms[i] = np.sqrt(dot(C[i], C[i]))
        if norms[i] == 0.0:
            norms[i] = 1.0


@part
def set_row(k, G, A, row):
    """Set row (n,) to the row of constraint k."""
    p, m, n = A.shape[0], G.shape[0], row.size
    if k < p:
        copy(A[k], row)
    elif k < p + m:
        copy(G[k - p], row)
    else:
        for j in range(n):
            row[j] = 0.0
        if k < p + m + n:
            row[k - p - m] = -1.0
        else:
            row[k - p - m - n] = 1.0


@part
def right_side(k, h, b, lb, ub):
    """Return the right-hand side d of constraint k."""
    p, m, n = b.size, h.size, lb.size
    if k < p:
        return b[k]
    if k < p + m:
        return h[k - p]
    if k < p + m + n:
        return -lb[k - p - m]
    return ub[k - p - m - n]


@part
def most_violated(x, Gx, h, lb, ub, norms, level, p):
    """Return the inequality with the largest violation of x over its norm, or -1.

    A violation up to `level` times the moduli of its terms counts as rounding.
    """
    m, n = h.size, x.size
    size = largest_entry(x)
    best, worst = -1, 0.0
    for i in range(m):
        violation = (Gx[i] - h[i]) / norms[i]
        if violation > worst and violation > level * (abs(h[i]) / norms[i] + size):
            best, worst = p + i, violation
    for j in range(n):
        violation = lb[j] - x[j]
        if violation > worst and violation > level * (abs(lb[j]) + size):
            best, worst = p + m + j, violation
        violation = x[j] - ub[j]
        if violation > worst and violation > level * (abs(ub[j]) + size):
            best, worst = p + m + n + j, violation
    return best


@part
def term_size(row, x, d):
    """Return the sum of the moduli of the terms of row'x - d."""
    size = abs(d)
    for j in range(x.size):
        size += abs(row[j] * x[j])
    return size


@part
def contradicts(active, multiplier, k, h, b, lb, ub):
    """Tell whether d'multiplier of k Farkas multipliers is negative beyond rounding."""
    value, size = 0.0, 0.0
    for i in range(k):
        term = multiplier[i] * right_side(active[i], h, b, lb, ub)
        value += term
        size += abs(term)
    return value < -CONTRADICTION * size


@part
def spread_multipliers(active, multiplier, k, y, z, z_box):
    """Set y, z, z_box to the multipliers of the k active rows, 0 elsewhere."""
    n, m, p = z_box.size, z.size, y.size
    for vector in (y, z, z_box):
        for i in range(vector.size):
            vector[i] = 0.0
    for i in range(k):
        index = active[i]
        if index < p:
            y[index] = multiplier[i]
        elif index < p + m:
            z[index - p] = multiplier[i]
        elif index < p + m + n:
            z_box[index - p - m] -= multiplier[i]
        else:
            z_box[index - p - m - n] += multiplier[i]


@part
def is_ray(d, P, q, G, h, lb, ub, norms, Pd, Gd):
    """Tell whether the cost falls without bound along d, where A d = 0 is known.

    Pd (n,) and Gd (m,) are overwritten by P d and G d.
    """
    zero = RAY_ZERO * largest_entry(d)
    if not dot(q, d) < 0.0:
        return False
    matvec(P, d, Pd)
    curvature = 0.0
    for j in range(d.size):
        curvature = max(curvature, P[j, j])
        if (d[j] < -zero and lb[j] > -np.inf) or (d[j] > zero and ub[j] < np.inf):
            return False
    matvec(G, d, Gd)
    for i in range(Gd.size):
        if Gd[i] > zero * norms[i] and h[i] < np.inf:
            return False
    return largest_entry(Pd) <= curvature * zero


@part
def typical_curvature(q, G, h, A, b, lb, ub):
    """Return max |q| over the geometric mean of the constraints' distances from x = 0.

    With entries of P of this size, the unconstrained minimum P^-1 q and the points
    where constraints hold with equality have similar norms.
    """
    p, m = b.size, h.size
    total, count = 0.0, 0
    for k in range(p + m + 2 * q.size):
        d = abs(right_side(k, h, b, lb, ub))
        if 0.0 < d < np.inf:
            size = 1.0
            if k < p + m:
                row = A[k] if k < p else G[k - p]
                size = np.sqrt(dot(row, row))
            if size > 0.0:  # an empty row says nothing about x
                total += np.log(d / size)
                count += 1
    return largest_entry(q) / np.exp(total / max(count, 1))
