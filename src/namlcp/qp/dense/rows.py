"""All constraints of a dense QP under one index.

Equalities are 0..p-1, rows of G p..p+m-1, then come the lower bounds (row -e_j), then
the upper ones (row e_j): row'x <= d, or row'x = d for the first p.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import copy, dot, largest_entry, matvec

# Constraints contradict each other if d'multiplier, d their right-hand sides, is below
# -CONTRADICTION times the sum of the moduli of its terms.
CONTRADICTION = 1e-10
# Entries of a ray d, of P d and of G d count as 0 up to this times max |d|, times the
# largest diagonal entry of P or the norm of the row of G.
RAY_ZERO = 1e-9


@part
def set_norms(m):
    """Set the Euclidean norms of the rows of G, 1 for empty rows."""
    G, norms = floats(m.G, (m.m, m.n)), floats(m.norms, m.m)
    for i in range(m.m):
        norms[i] = np.sqrt(dot(G[i], G[i]))
        if norms[i] == 0.0:
            norms[i] = 1.0


@part
def set_row(m, index):
    """Set m.row to the row of a constraint."""
    row = floats(m.row, m.n)
    if index < m.p:
        copy(floats(m.A, (m.p, m.n))[index], row)
    elif index < m.p + m.m:
        copy(floats(m.G, (m.m, m.n))[index - m.p], row)
    else:
        for j in range(m.n):
            row[j] = 0.0
        j = index - m.p - m.m
        if j < m.n:
            row[j] = -1.0
        else:
            row[j - m.n] = 1.0


@part
def right_side(m, index):
    """Return the right-hand side d of a constraint."""
    if index < m.p:
        return floats(m.b, m.p)[index]
    if index < m.p + m.m:
        return floats(m.h, m.m)[index - m.p]
    j = index - m.p - m.m
    if j < m.n:
        return -floats(m.lb, m.n)[j]
    return floats(m.ub, m.n)[j - m.n]


@part
def most_violated(m, level):
    """Return the inequality with the largest violation of x over its norm, or -1.

    A violation up to `level` times the moduli of its terms counts as rounding.
    """
    x, lb, ub = floats(m.x, m.n), floats(m.lb, m.n), floats(m.ub, m.n)
    h, norms, Gx = floats(m.h, m.m), floats(m.norms, m.m), floats(m.Gx, m.m)
    matvec(floats(m.G, (m.m, m.n)), x, Gx)
    size = largest_entry(x)
    best, worst = -1, 0.0
    for i in range(h.size):
        violation = (Gx[i] - h[i]) / norms[i]
        if violation > worst and violation > level * (abs(h[i]) / norms[i] + size):
            best, worst = m.p + i, violation
    for j in range(x.size):
        violation = lb[j] - x[j]
        if violation > worst and violation > level * (abs(lb[j]) + size):
            best, worst = m.p + m.m + j, violation
        violation = x[j] - ub[j]
        if violation > worst and violation > level * (abs(ub[j]) + size):
            best, worst = m.p + m.m + m.n + j, violation
    return best


@part
def is_contradiction(m):
    """Tell whether d'multiplier of k + 1 Farkas multipliers is negative.

    It has to exceed rounding; the constraints are those after `add_constraint`.
    """
    active, multiplier = longs(m.active, m.n + 1), floats(m.multiplier, m.n + 1)
    value, size = 0.0, 0.0
    for i in range(m.k + 1):
        term = multiplier[i] * right_side(m, active[i])
        value += term
        size += abs(term)
    return value < -CONTRADICTION * size


@part
def spread_multipliers(m, count):
    """Set y, z, z_box to the first `count` multipliers in `active`, 0 elsewhere."""
    active, multiplier = longs(m.active, m.n + 1), floats(m.multiplier, m.n + 1)
    y, z, z_box = floats(m.y, m.p), floats(m.z, m.m), floats(m.z_box, m.n)
    for vector in (y, z, z_box):
        for i in range(vector.size):
            vector[i] = 0.0
    for i in range(count):
        j = active[i] - m.p - m.m
        if j >= m.n:
            z_box[j - m.n] += multiplier[i]
        elif j >= 0:
            z_box[j] -= multiplier[i]
        elif active[i] >= m.p:
            z[active[i] - m.p] = multiplier[i]
        else:
            y[active[i]] = multiplier[i]


@part
def is_ray(m, d):
    """Tell whether the cost falls without bound along d, where A d = 0 is known.

    Overwrites m.Px and m.Gx.
    """
    P, G = floats(m.P, (m.n, m.n)), floats(m.G, (m.m, m.n))
    lb, ub = floats(m.lb, m.n), floats(m.ub, m.n)
    h, norms = floats(m.h, m.m), floats(m.norms, m.m)
    Pd, Gd = floats(m.Px, m.n), floats(m.Gx, m.m)
    zero = RAY_ZERO * largest_entry(d)
    if not dot(floats(m.q, m.n), d) < 0.0:
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
