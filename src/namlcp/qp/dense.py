"""Small dense strictly convex QPs: principal pivoting on their multipliers' LCP.

With P = L L' and C the rows of all constraints, the multipliers solve an LCP whose
matrix is V V', V = C L^-T: positive semidefinite, never formed. It is solved by
parametric principal pivoting, one index at a time: index p enters, its multiplier grows
until its row holds (full step) or another multiplier reaches zero and leaves (partial
step). In the letters of the QP that is the dual active-set method of Goldfarb and
Idnani (Math. Programming 27 (1983) 1-33), which ends after finitely many steps for
every definite P, tells infeasible problems, and needs no start. The active rows are
kept as a thin QR factorisation V_F' = Q R, so that dependent rows are seen; at the end
the KKT system of the active set is solved with refinement on the unfactored data.

Constraints have one index: equalities 0..p-1, rows of G p..p+m-1, then the lower bounds
(row -e_j), then the upper ones (row e_j).
"""

import numpy as np
from numba import njit

from namlcp.lapack import (
    add_rmatvec,
    add_scaled,
    backward_solve,
    cholesky,
    copy,
    dot,
    forward_solve,
    inner,
    matvec,
    pasted,
)
from namlcp.qp.thinqr import (
    append,
    project,
    remove,
    triangular_solve,
    triangular_solve_transposed,
)
from namlcp.residuals import qp_residuals_of_products

SOLVED, INFEASIBLE, NOT_DEFINITE, STALLED = 0, 1, 2, 3

# A row whose part outside the active rows is smaller than this is dependent on them.
DEPENDENT = 1e-10
# A Farkas sum below minus this, relative to its terms, is a contradiction.
CONTRADICTION = 1e-10
# Pivots after which multipliers and x are computed anew, against drift.
REFIT = 32
# After IDLE pivots in a row on violations below NOISE roundings, `level`, what counts
# as rounding, grows tenfold.
IDLE, NOISE = 10, 1e3
# A pivot of P below this multiple of its diagonal entry counts as zero.
DEFINITE = 1e-13


@inner
def row_norms(C, norms):
    """Set norms (m,) to the Euclidean norms of the rows of C, 1 for empty rows."""
    for i in range(C.shape[0]):
        norms[i] = np.sqrt(dot(C[i], C[i]))
        if norms[i] == 0.0:
            norms[i] = 1.0


@inner
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


@inner
def right_side(k, h, b, lb, ub):
    """Return d of constraint k, row'x <= d."""
    p, m, n = b.size, h.size, lb.size
    if k < p:
        return b[k]
    if k < p + m:
        return h[k - p]
    if k < p + m + n:
        return -lb[k - p - m]
    return ub[k - p - m - n]


@inner
def most_violated(x, Gx, h, lb, ub, norms, level, p):
    """Return the inequality with the largest scaled violation above rounding, or -1.

    The violation is measured along the unit normal; `level` times the size of the terms
    is taken for rounding.
    """
    m, n = h.size, x.size
    size = 0.0
    for j in range(n):
        size = max(size, abs(x[j]))
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


@inner
def blocking(multiplier, r, k, active, p):
    """Return (step, index) of the first multiplier to reach zero; inf, -1 if none."""
    step, leaving = np.inf, np.int64(-1)
    for i in range(k):
        if active[i] >= p and r[i] > 0.0 and multiplier[i] < step * r[i]:
            step, leaving = multiplier[i] / r[i], i
    return step, leaving


@inner
def term_size(row, x, d):
    """Return the sum of the moduli of the terms of row'x - d."""
    size = abs(d)
    for j in range(x.size):
        size += abs(row[j] * x[j])
    return size


@inner
def enter(entering, row, d, active, multiplier, k, L, Q, R, u, x, p, level):
    """Let constraint `entering` (row'x <= d, or = d) in by partial and full steps.

    Moves u = L'x, x and multiplier[:k]; equalities must enter before inequalities.
    Returns the new number of active rows. A negative number -1 - k says that the
    constraint contradicts the k active ones; multiplier[:k + 1] is then their part of a
    Farkas certificate, the entering constraint's last.
    """
    v = np.empty(row.size)
    copy(row, v)
    forward_solve(L, v)
    whole = np.sqrt(dot(v, v))
    rest = np.empty(v.size)
    coefficients = np.empty(k + 1)
    r = np.empty(k + 1)
    own = 0.0
    while True:
        copy(v, rest)
        length = project(Q, k, rest, coefficients)
        dependent = k == v.size or length <= DEPENDENT * whole
        violation = dot(row, x) - d
        copy(coefficients, r)
        triangular_solve(R, k, r)
        if entering < p:
            step, leaving = np.inf, np.int64(-1)
            if dependent and abs(violation) <= 1e3 * level * term_size(row, x, d):
                return k  # it follows from the others
        else:
            step, leaving = blocking(multiplier, r, k, active, p)
        if dependent and leaving < 0:
            sign = 1.0 if violation > 0.0 else -1.0
            for i in range(k):
                multiplier[i] = -sign * r[i]
            multiplier[k] = sign
            return -1 - k
        full = np.inf if dependent else violation / length**2
        t = min(full, step)
        for i in range(k):
            multiplier[i] -= t * r[i]
        own += t
        if not dependent:
            add_scaled(-t, rest, u)
            copy(u, x)
            backward_solve(L, x)
            if t == full:
                append(Q, R, k, rest, coefficients, length)
                active[k] = entering
                multiplier[k] = own
                return k + 1
        remove(Q, R, k, leaving, active, multiplier)
        k -= 1


@inner
def refit(active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x):
    """Drop inequalities until the multipliers of the active rows are >= 0.

    For the active rows held as equations: R'R multiplier = V u0 - d and
    u = u0 - Q'R multiplier. What is left is optimal for the problem that has the active
    rows alone, hence a legal start of the pivoting. Returns the number of rows left.
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
        if leaving < 0:
            copy(u, x)
            backward_solve(L, x)
            return k
        remove(Q, R, k, leaving, active, multiplier)
        k -= 1


@inner
def start_from(hint, active, multiplier, k, G, A, L, Q, R):
    """Append the independent ones of the inequalities that are marked in hint."""
    p, n = A.shape[0], G.shape[1]
    row, d = np.empty(n), np.empty(n + 1)
    for i in range(hint.size):
        if hint[i] and k < n:
            set_row(p + i, G, A, row)
            forward_solve(L, row)
            whole = np.sqrt(dot(row, row))
            length = project(Q, k, row, d)
            if length > 1e-6 * whole:
                append(Q, R, k, row, d, length)
                active[k] = p + i
                multiplier[k] = 0.0
                k += 1
    return k


@inner
def refine(active, multiplier, k, P, q, G, h, A, b, lb, ub, L, Q, R, x):
    """Improve x and multiplier on the unfactored KKT system of the active rows.

    [P N'; N 0] [dx; dm] = -[rd; rp] by R'(R dm + Q g) = rp, L'dx = -(g + Q'R dm),
    g = L^-1 rd. Stops when a step gains less than a factor 2.
    """
    n = x.size
    row, g, dx = np.empty(n), np.empty(n), np.empty(n)
    dm, trial = np.empty(k), np.empty(n)
    new_multiplier = np.empty(k)
    best = np.inf
    for _ in range(5):
        copy(x, trial)
        for i in range(k):
            new_multiplier[i] = multiplier[i]
        if best < np.inf:
            add_scaled(1.0, dx, trial)
            add_scaled(1.0, dm, new_multiplier)
        matvec(P, trial, g)
        add_scaled(1.0, q, g)
        worst = 0.0
        for i in range(k):
            set_row(active[i], G, A, row)
            add_scaled(new_multiplier[i], row, g)
            residual = dot(row, trial) - right_side(active[i], h, b, lb, ub)
            dm[i] = residual
            worst = max(worst, abs(residual))
        for j in range(n):
            worst = max(worst, abs(g[j]))
        if not worst < best:
            return
        copy(trial, x)
        copy(new_multiplier, multiplier)
        if worst > 0.5 * best or worst == 0.0:
            return
        best = worst
        forward_solve(L, g)
        triangular_solve_transposed(R, k, dm)
        for i in range(k):
            dm[i] -= dot(Q[i], g)
        for j in range(n):
            dx[j] = -g[j]
        for i in range(k):
            add_scaled(-dm[i], Q[i], dx)
        triangular_solve(R, k, dm)
        backward_solve(L, dx)


@inner
def clear(y, z, z_box):
    """Set all multipliers to zero."""
    for i in range(y.size):
        y[i] = 0.0
    for i in range(z.size):
        z[i] = 0.0
    for j in range(z_box.size):
        z_box[j] = 0.0


@inner
def recover(active, multiplier, k, P, q, G, A, lb, ub, x, y, z, z_box):
    """Set y, z, z_box from the active rows; active bounds hold to the last bit.

    The multiplier of an active bound is minus the stationarity residual, so that
    P x + q + G'z + A'y + z_box = 0 holds there exactly.
    """
    n, m, p = x.size, z.size, y.size
    clear(y, z, z_box)
    for i in range(k):
        index = active[i]
        if index < p:
            y[index] = multiplier[i]
        elif index < p + m:
            z[index - p] = max(multiplier[i], 0.0)
        elif index < p + m + n:
            x[index - p - m] = lb[index - p - m]
        else:
            x[index - p - m - n] = ub[index - p - m - n]
    gradient = np.empty(n)
    matvec(P, x, gradient)
    add_scaled(1.0, q, gradient)
    add_rmatvec(A, y, gradient)
    add_rmatvec(G, z, gradient)
    for i in range(k):
        if active[i] >= p + m + n:
            j = active[i] - p - m - n
            z_box[j] = max(-gradient[j], 0.0)
        elif active[i] >= p + m:
            j = active[i] - p - m
            z_box[j] = min(-gradient[j], 0.0)


@inner
def contradicts(active, multiplier, k, h, b, lb, ub):
    """Tell whether the Farkas sum d'multiplier is negative beyond rounding."""
    value, size = 0.0, 0.0
    for i in range(k):
        term = multiplier[i] * right_side(active[i], h, b, lb, ub)
        value += term
        size += abs(term)
    return value < -CONTRADICTION * size


@inner
def certificate(active, multiplier, k, p, y, z, z_box):
    """Set y, z, z_box to the Farkas multipliers of k contradicting rows."""
    n, m = z_box.size, z.size
    clear(y, z, z_box)
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


@pasted
def pivot(P, q, G, h, A, b, lb, ub, L, hint, x, y, z, z_box, max_iter):
    """Run the pivoting with P = L L'; set x and the multipliers; return (code, pivots).

    INFEASIBLE leaves a candidate for a Farkas certificate in y, z, z_box.
    """
    n, m, p = q.size, h.size, b.size
    Q, R = np.empty((n, n)), np.empty((n, n))
    active, multiplier = np.empty(n + 1, dtype=np.int64), np.empty(n + 1)
    row, norms, u0, u = np.empty(n), np.ones(m), np.empty(n), np.empty(n)
    Gx = np.empty(m)
    for j in range(n):
        u0[j] = -q[j]
    forward_solve(L, u0)
    copy(u0, u)
    copy(u, x)
    backward_solve(L, x)
    # np.int64, because a literal would compile every callee once more
    k, pivots, idle, level = np.int64(0), 0, 0, 1e-14
    matvec(G, x, Gx)
    if p == 0 and most_violated(x, Gx, h, lb, ub, norms, level, p) < 0:
        refine(active, multiplier, k, P, q, G, h, A, b, lb, ub, L, Q, R, x)
        recover(active, multiplier, k, P, q, G, A, lb, ub, x, y, z, z_box)
        return SOLVED, 0
    row_norms(G, norms)
    for i in range(p):
        k = enter(i, A[i], b[i], active, multiplier, k, L, Q, R, u, x, p, level)
        if k < 0:
            active[-1 - k] = i
            certificate(active, multiplier, -k, p, y, z, z_box)
            return INFEASIBLE, pivots
    if hint.size > 0:
        k = start_from(hint, active, multiplier, k, G, A, L, Q, R)
        k = refit(active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x)
    for _ in range(4):
        while pivots < max_iter:
            matvec(G, x, Gx)
            entering = most_violated(x, Gx, h, lb, ub, norms, level, p)
            if entering < 0:
                break
            pivots += 1
            if pivots % REFIT == 0:
                k = refit(active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x)
            set_row(entering, G, A, row)
            d = right_side(entering, h, b, lb, ub)
            size = abs(d) + np.sqrt(dot(row, row)) * np.abs(x).max()
            if dot(row, x) - d <= NOISE * level * size:
                idle += 1
            else:
                idle = 0
            if idle == IDLE:
                level *= 10.0  # rounding, not the problem, keeps it busy
                idle = 0
            k = enter(entering, row, d, active, multiplier, k, L, Q, R, u, x, p, level)
            if k < 0:
                active[-1 - k] = entering
                if contradicts(active, multiplier, -k, h, b, lb, ub):
                    certificate(active, multiplier, -k, p, y, z, z_box)
                    return INFEASIBLE, pivots
                level *= 10.0  # dependent rows that disagree by rounding
                k = refit(
                    active, multiplier, -1 - k, G, h, A, b, lb, ub, u0, L, Q, R, u, x
                )
        refine(active, multiplier, k, P, q, G, h, A, b, lb, ub, L, Q, R, x)
        recover(active, multiplier, k, P, q, G, A, lb, ub, x, y, z, z_box)
        matvec(G, x, Gx)
        if pivots >= max_iter:
            return STALLED, pivots
        level *= 10.0
        if most_violated(x, Gx, h, lb, ub, norms, level, p) < 0:
            return SOLVED, pivots
        k = refit(active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x)
    return STALLED, pivots


@njit(cache=True, nogil=True, error_model="numpy")
def solve(P, q, G, h, A, b, lb, ub, hint, max_iter):
    """Solve min 1/2 x'Px + q'x, Gx <= h, Ax = b, lb <= x <= ub for definite P.

    All arrays are float64 and C-contiguous; absent parts have zero rows, absent bounds
    are infinite; hint, (m + 2 n,) int8 or empty, marks inequalities to begin with.
    Returns (code, pivots, x, y, z, z_box, residuals), the last as in `Residuals`.
    """
    n = q.size
    x, y, z, z_box = np.zeros(n), np.zeros(b.size), np.zeros(h.size), np.zeros(n)
    L = np.empty((n, n))
    for j in range(n):
        copy(P[j], L[j])
    definite = cholesky(L) == 0
    if definite:
        for j in range(n):
            if L[j, j] * L[j, j] <= DEFINITE * P[j, j]:
                definite = False
    code, pivots = NOT_DEFINITE, 0
    if definite:
        code, pivots = pivot(
            P, q, G, h, A, b, lb, ub, L, hint, x, y, z, z_box, max_iter
        )
    Px, Gx, Ax, Aty_Gtz = np.empty(n), np.empty(h.size), np.empty(b.size), np.zeros(n)
    matvec(P, x, Px)
    matvec(G, x, Gx)
    matvec(A, x, Ax)
    add_rmatvec(A, y, Aty_Gtz)
    add_rmatvec(G, z, Aty_Gtz)
    residuals = qp_residuals_of_products(
        q, h, b, lb, ub, x, y, z, z_box, Px, Gx, Ax, Aty_Gtz
    )
    return code, pivots, x, y, z, z_box, residuals
