"""Candidates for certificates: of equations and rows, and rays; refined on the data."""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import LEAST_DIVISOR, copy, dot
from namlcp.qp.responses.active import size_of
from namlcp.qp.responses.judgement import parts_of_result
from namlcp.qp.responses.matrices import row_of
from namlcp.qp.responses.proximal.operator import (
    set_other_products,
    set_values_of,
    times_cost,
)
from namlcp.qp.responses.rows import hold_active

# Passes of refinement of multipliers.
REFINEMENTS = 2
# Residual of a dependent equation over its terms from which on it contradicts others.
CONTRADICTED = 1e-9
# The same up to which one that was left out is called dependent.
LEFT = 1e-11
# Passes for a ray at most, and the gain of one below which it was the last; the largest
# P d over d, in the variables of `weight`, and that at which no pass follows.
RAY_PASSES, RAY_GAIN, MOST_CURVED, FLAT = 40, 0.9, 1e-9, 1e-14
# Growth of a row, over its norm, along a direction of size 1, up to which it is
# rounding.
LEAST_GROWTH = 1e-11


@part
def refine_contradiction(m):
    """Refine y and z, multipliers that contradict the rows: G'z + A'y = 0 off bounds.

    Rows with multipliers are active, or entering. P does not matter here.
    """
    y, z = parts_of_result(m)[1], parts_of_result(m)[2]
    active, n = longs(m.active, m.most + 1), m.n
    change, work = floats(m.change, m.length), floats(m.work, m.most + 1)
    rhs, Gtz, Aty = floats(m.rhs, n + m.p), floats(m.Gtz, n), floats(m.Aty, n)
    for _ in range(REFINEMENTS):
        set_other_products(m)
        for j in range(n):
            rhs[j] = -(Gtz[j] + Aty[j])
        for i in range(m.p):
            rhs[n + i] = 0.0
        for i in range(m.k):
            if active[i] >= m.m:
                rhs[active[i] - m.m] = 0.0
        if m.entering >= m.m:
            rhs[m.entering - m.m] = 0.0
        set_values_of(m, rhs, change)
        hold_active(m, change)
        for i in range(m.k):
            if active[i] < m.m:
                z[active[i]] += work[i]
        for i in range(m.p):
            y[i] += change[m.rows + i]


@part
def contradicts_equations(m):
    """Tell whether a dependent equation contradicts the others: y is the candidate.

    The matrices are dense. It contradicts them where the solution of these violates it.
    """
    x, y, z, z_box = parts_of_result(m)
    s, rhs, b = floats(m.s, m.length), floats(m.rhs, m.n + m.p), floats(m.b, m.p)
    for j in range(m.n):
        rhs[j] = 0.0
    copy(b, rhs[m.n :])
    set_values_of(m, rhs, s)
    worst, at = CONTRADICTED, -1
    for i in range(m.p):
        row = row_of(m.A, i, m.n)
        rest, size = -b[i], abs(b[i])
        for j in range(m.n):
            term = row[j] * s[m.m + j]
            rest += term
            size += abs(term)
        if abs(rest) > worst * size:
            worst, at = abs(rest) / size, i
    if at < 0:
        return False
    copy(s[m.m : m.rows], x)
    for vector in (y, z, z_box):
        for i in range(vector.size):
            vector[i] = 0.0
    y[at] = 1.0
    k, m.k, m.entering = m.k, 0, -1
    refine_contradiction(m)
    m.k = k
    if dot(b, y) > 0.0:
        for i in range(m.p):
            y[i] = -y[i]
    return True


@part
def leaves_equations(m):
    """Tell whether the result violates an equation by more than rounding.

    Then one that was left out depends on the others but for a small part.
    """
    x, b = parts_of_result(m)[0], floats(m.b, m.p)
    for i in range(m.p):
        row = row_of(m.A, i, m.n)
        rest, size = -b[i], abs(b[i])
        for j in range(m.n):
            rest += row[j] * x[j]
            size += abs(row[j] * x[j])
        if abs(rest) > LEFT * size:
            return True
    return False


@part
def longest_step(m, along):
    """Return the step along a direction up to the first row that is not active."""
    s, side = floats(m.s, m.length), longs(m.side, m.rows)
    h, lb, ub = floats(m.h, m.m), floats(m.lb, m.n), floats(m.ub, m.n)
    scale, t = floats(m.scale, m.rows), np.inf
    least = LEAST_GROWTH * size_of(m, along)
    for i in range(m.rows):
        growth = along[i] * scale[i]
        if side[i] != 0 or not abs(growth) > least:
            continue
        if i >= m.m and growth < 0.0:
            t = min(t, max(s[i] - lb[i - m.m], 0.0) / -along[i])
        elif growth > 0.0:
            goal = h[i] if i < m.m else ub[i - m.m]
            t = min(t, max(goal - s[i], 0.0) / along[i])
    return t


@part
def is_ray(m):
    """Tell whether a direction d near m.along, without curvature, is a ray in z_box.

    Inverse iteration on the face, d = K_F^-1 W d, takes away what is curved. Overwrites
    m.change, m.work and m.Palong.
    """
    n, ray = m.n, parts_of_result(m)[3]
    change, weight = floats(m.change, m.length), floats(m.weight, n)
    rhs, Pd = floats(m.rhs, n + m.p), floats(m.Palong, n)
    active, unit = longs(m.active, m.most + 1), floats(m.scale, m.rows)[m.m :]
    copy(floats(m.along, m.length)[m.m : m.rows], ray)
    for i in range(m.p):
        rhs[n + i] = 0.0
    ratio, last, turn = 0.0, np.inf, 0
    while turn == 0 or (FLAT < ratio < RAY_GAIN * last and turn < RAY_PASSES):
        last = ratio if turn > 0 else np.inf
        turn += 1
        for j in range(n):
            rhs[j] = weight[j] * ray[j]
        set_values_of(m, rhs, change)
        hold_active(m, change)
        copy(change[m.m : m.rows], ray)
        for i in range(m.k):
            if active[i] >= m.m:
                ray[active[i] - m.m] = 0.0
        times_cost(m, ray, Pd)
        curved = 0.0
        for j in range(n):
            curved = max(curved, abs(Pd[j]) / unit[j])
        ratio = curved / max(size_of(m, change), LEAST_DIVISOR)
    if not (dot(floats(m.q, n), ray) < 0.0 and ratio <= MOST_CURVED):
        return False
    return longest_step(m, change) == np.inf
