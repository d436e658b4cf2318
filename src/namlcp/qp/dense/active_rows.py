"""Changes of the active set in the dual active-set method.

m.active lists the k active constraints, numbered as in `rows`, m.multiplier their
multipliers. V_F, the active rows of V = C L^-T, is kept as V_F' = Q'R (`thinqr`).
u = L'x is updated along with x; u0 is u at the unconstrained minimum.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.limits import WATCH_SIZE, is_over
from namlcp.linalg import add_scaled, backward_solve, copy, dot, forward_solve
from namlcp.qp.dense.rows import right_side, set_row
from namlcp.qp.dense.thinqr import (
    append_row,
    orthogonalise,
    remove_row,
    triangular_solve,
    triangular_solve_transposed,
)

# A row depends on the active ones if the norm of its part orthogonal to them over its
# own norm is at most DEPENDENT; for inequalities in `add_rows`, DEPENDENT_GUESS.
DEPENDENT, DEPENDENT_GUESS = 1e-10, 1e-6
# A dependent equality counts as satisfied, and is skipped, if its violation is at most
# REPEATED * level times the sum of the moduli of its terms.
REPEATED = 1e3


@part
def is_late(m, operations):
    """Count operations; tell whether to stop, see `limits.is_over`."""
    return is_over(longs(m.watch, WATCH_SIZE), operations)


@part
def set_point(m):
    """Set x = L^-T u."""
    x = floats(m.x, m.n)
    copy(floats(m.u, m.n), x)
    backward_solve(floats(m.L, (m.n, m.n)), x)


@part
def term_size(m, d):
    """Return the sum of the moduli of the terms of row'x - d."""
    row, x, size = floats(m.row, m.n), floats(m.x, m.n), abs(d)
    for j in range(m.n):
        size += abs(row[j] * x[j])
    return size


@part
def first_blocking(m):
    """Return (step, i) of the first inequality with multiplier - step ratio = 0."""
    active, multiplier = longs(m.active, m.n + 1), floats(m.multiplier, m.n + 1)
    ratios = floats(m.ratios, m.k)
    step, leaving = np.inf, np.int64(-1)
    for i in range(m.k):
        if active[i] < m.p or not ratios[i] > 0.0:
            continue
        if multiplier[i] < step * ratios[i]:
            step, leaving = multiplier[i] / ratios[i], i
    return step, leaving


@part
def add_constraint(m, entering):
    """Make constraint `entering`, row'x <= d or row'x = d, active.

    A full step ends with row'x = d; a partial step ends where a multiplier is zero, and
    its constraint is removed. Equalities have to be added before inequalities.

    Returns False if the constraint contradicts those active then: the first k + 1
    multipliers are then Farkas multipliers, that of the entering constraint last.
    """
    n = m.n
    x, u, row = floats(m.x, n), floats(m.u, n), floats(m.row, n)
    v, rest = floats(m.v, n), floats(m.rest, n)
    multiplier, ratios = floats(m.multiplier, n + 1), floats(m.ratios, n + 1)
    set_row(m, entering)
    d = right_side(m, entering)
    copy(row, v)
    forward_solve(floats(m.L, (n, n)), v)
    whole = np.sqrt(dot(v, v))
    own = 0.0  # multiplier of the entering constraint
    while not is_late(m, 4 * n * n):
        copy(v, rest)
        length = orthogonalise(m)
        dependent = m.k == n or length <= DEPENDENT * whole
        violation = dot(row, x) - d
        copy(floats(m.coefficients, m.k), ratios)
        triangular_solve(m, ratios)
        step, leaving = np.inf, np.int64(-1)
        if entering >= m.p:
            step, leaving = first_blocking(m)
        elif dependent and abs(violation) <= REPEATED * m.level * term_size(m, d):
            return True
        if dependent and leaving < 0:
            sign = 1.0 if violation > 0.0 else -1.0
            for i in range(m.k):
                multiplier[i] = -sign * ratios[i]
            multiplier[m.k] = sign
            longs(m.active, n + 1)[m.k] = entering
            return False
        full = np.inf if dependent else violation / (length * length)
        t = min(full, step)
        for i in range(m.k):
            multiplier[i] -= t * ratios[i]
        own += t
        if not dependent:
            add_scaled(-t, rest, u)
            set_point(m)
            if t == full:
                append_row(m, entering, own, length)
                return True
        remove_row(m, leaving)
    return True


@part
def refit(m):
    """Compute multipliers, u and x of the active rows anew, free of accumulated error.

    With the active rows as equations, R'R multiplier = V_F u0 - d and
    u = u0 - Q'R multiplier. Inequalities are removed, the most negative multiplier
    first, until none is negative: x solves the QP with the remaining rows alone then.
    """
    n = m.n
    x, u, u0, row = floats(m.x, n), floats(m.u, n), floats(m.u0, n), floats(m.row, n)
    active, multiplier = longs(m.active, n + 1), floats(m.multiplier, n + 1)
    Q = floats(m.Q, (n, n))
    while True:
        copy(u0, u)
        set_point(m)
        for i in range(m.k):
            set_row(m, active[i])
            multiplier[i] = dot(row, x) - right_side(m, active[i])
        triangular_solve_transposed(m, multiplier)
        for i in range(m.k):
            add_scaled(-multiplier[i], Q[i], u)
        triangular_solve(m, multiplier)
        leaving, least = np.int64(-1), 0.0
        for i in range(m.k):
            if active[i] >= m.p and multiplier[i] < least:
                leaving, least = i, multiplier[i]
        if leaving < 0 or is_late(m, 4 * n * n):
            set_point(m)
            return
        remove_row(m, leaving)


@part
def add_rows(m, rows):
    """Make those of `rows` active that are independent, with multipliers 0."""
    n = m.n
    L, row, rest = floats(m.L, (n, n)), floats(m.row, n), floats(m.rest, n)
    for i in range(rows.size):
        if m.k < n and not is_late(m, 2 * n * n):
            set_row(m, rows[i])
            copy(row, rest)
            forward_solve(L, rest)
            whole = np.sqrt(dot(rest, rest))
            length = orthogonalise(m)
            if length > (DEPENDENT if rows[i] < m.p else DEPENDENT_GUESS) * whole:
                append_row(m, rows[i], 0.0, length)
