"""Changes of the active set in the dual active-set method.

active[:k] lists the k active constraints, numbered as in `rows`, multiplier[:k] their
multipliers. V_F, the active rows of V = C L^-T, is kept as V_F' = Q'R (`thinqr`).
u = L'x is updated along with x; u0 is u at the unconstrained minimum.
"""

import numpy as np

from namlcp.compiled import part
from namlcp.limits import is_over
from namlcp.linalg import add_scaled, backward_solve, copy, dot, forward_solve
from namlcp.qp.dense.rows import right_side, set_row, term_size
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
def first_blocking(multiplier, r, k, active, p):
    """Return (step, index) of the first inequality with multiplier - step r = 0."""
    step, leaving = np.inf, np.int64(-1)
    for i in range(k):
        if active[i] >= p and r[i] > 0.0 and multiplier[i] < step * r[i]:
            step, leaving = multiplier[i] / r[i], i
    return step, leaving


@part
def add_constraint(
    entering, row, d, active, multiplier, k, L, Q, R, u, x, p, level, watch
):
    """Make constraint `entering`, row'x <= d or row'x = d, active.

    Overwrites u, x, active, multiplier, Q and R. A full step ends with row'x = d; a
    partial step ends where a multiplier is zero, and its constraint is removed.
    Equalities (entering < p) have to be added before inequalities.

    Returns the number of active rows, or -1 - k if the constraint contradicts the k
    rows active then: multiplier[:k + 1] are then Farkas multipliers, that of the
    entering constraint last.
    """
    v = np.empty(row.size)
    copy(row, v)
    forward_solve(L, v)
    whole = np.sqrt(dot(v, v))
    rest = np.empty(v.size)  # part of v orthogonal to the active rows
    coefficients = np.empty(k + 1)
    r = np.empty(k + 1)
    own = 0.0  # multiplier of the entering constraint
    while not is_over(watch, 4 * v.size * v.size):
        copy(v, rest)
        length = orthogonalise(Q, k, rest, coefficients)
        dependent = k == v.size or length <= DEPENDENT * whole
        violation = dot(row, x) - d
        copy(coefficients, r)
        triangular_solve(R, k, r)
        if entering < p:
            step, leaving = np.inf, np.int64(-1)
            if dependent and abs(violation) <= REPEATED * level * term_size(row, x, d):
                return k
        else:
            step, leaving = first_blocking(multiplier, r, k, active, p)
        if dependent and leaving < 0:
            sign = 1.0 if violation > 0.0 else -1.0
            for i in range(k):
                multiplier[i] = -sign * r[i]
            multiplier[k] = sign
            return -1 - k
        full = np.inf if dependent else violation / (length * length)
        t = min(full, step)
        for i in range(k):
            multiplier[i] -= t * r[i]
        own += t
        if not dependent:
            add_scaled(-t, rest, u)
            copy(u, x)
            backward_solve(L, x)
            if t == full:
                append_row(Q, R, k, rest, coefficients, length)
                active[k] = entering
                multiplier[k] = own
                return k + 1
        remove_row(Q, R, k, leaving, active, multiplier)
        k -= 1
    return k


@part
def refit(active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x, watch):
    """Compute multiplier, u and x of the active rows anew, free of accumulated error.

    With the active rows as equations, R'R multiplier = V_F u0 - d and
    u = u0 - Q'R multiplier. Inequalities are removed, the most negative multiplier
    first, until none is negative: x solves the QP with the remaining rows alone then.
    Overwrites active, Q and R too; returns the number of rows left.
    """
    p = b.size
    row = np.empty(x.size)
    while True:
        copy(u0, x)
        backward_solve(L, x)
        for i in range(k):
            set_row(active[i], G, A, row)
            multiplier[i] = dot(row, x) - right_side(active[i], h, b, lb, ub)
        triangular_solve_transposed(R, k, multiplier)
        copy(u0, u)
        for i in range(k):
            add_scaled(-multiplier[i], Q[i], u)
        triangular_solve(R, k, multiplier)
        leaving, least = np.int64(-1), 0.0
        for i in range(k):
            if active[i] >= p and multiplier[i] < least:
                leaving, least = i, multiplier[i]
        if leaving < 0 or is_over(watch, 4 * x.size * x.size):
            copy(u, x)
            backward_solve(L, x)
            return k
        remove_row(Q, R, k, leaving, active, multiplier)
        k -= 1


@part
def add_rows(rows, active, multiplier, k, G, A, L, Q, R, watch):
    """Append those of `rows` that are independent, multipliers 0; return the new k."""
    p, n = A.shape[0], G.shape[1]
    row, d = np.empty(n), np.empty(n + 1)
    for i in range(rows.size):
        if k < n and not is_over(watch, 2 * n * n):
            set_row(rows[i], G, A, row)
            forward_solve(L, row)
            whole = np.sqrt(dot(row, row))
            length = orthogonalise(Q, k, row, d)
            if length > (DEPENDENT if rows[i] < p else DEPENDENT_GUESS) * whole:
                append_row(Q, R, k, row, d, length)
                active[k] = rows[i]
                multiplier[k] = 0.0
                k += 1
    return k
