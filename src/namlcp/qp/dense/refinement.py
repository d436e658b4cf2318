"""The point of the active rows, refined on the unfactored data, and its multipliers."""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import (
    LEAST_DIVISOR,
    add_rmatvec,
    add_scaled,
    backward_solve,
    copy,
    dot,
    forward_solve,
    largest_entry,
    matvec,
)
from namlcp.qp.dense.rows import right_side, set_row, spread_multipliers
from namlcp.qp.dense.thinqr import triangular_solve, triangular_solve_transposed


@part
def refine_point(m, passes):
    """Refine x and the multipliers on the KKT system of the k active rows N.

    Ends where a pass does not halve the relative residual, or after `passes`; returns
    the least one. With W != 0 a pass is a step of the proximal point method on the
    active set.
    """
    x, trial = floats(m.x, m.n), floats(m.trial, m.n)
    multiplier, next_one = floats(m.multiplier, m.k), floats(m.trial_multiplier, m.k)
    best = np.inf
    for turn in range(passes):
        copy(x, trial)
        copy(multiplier, next_one)
        if turn > 0:
            add_scaled(1.0, floats(m.change, m.n), trial)
            add_scaled(1.0, floats(m.multiplier_change, m.k), next_one)
        worst = set_residuals(m)
        if not worst < best:
            break
        copy(trial, x)
        copy(next_one, multiplier)
        gained = worst <= 0.5 * best
        best = worst
        if not gained or worst == 0.0:
            break
        solve_system(m)
    return best


@part
def set_residuals(m):
    """Set the residuals of the KKT system, with P itself, at the trial point.

    m.gradient = P x + q + N' multiplier, m.multiplier_change = N x - d. Returns the
    larger one of the two, relative to the terms of each.
    """
    trial, multiplier = floats(m.trial, m.n), floats(m.trial_multiplier, m.k)
    gradient, rows = floats(m.gradient, m.n), floats(m.multiplier_change, m.k)
    q, row, active = floats(m.q, m.n), floats(m.row, m.n), longs(m.active, m.k)
    matvec(floats(m.P, (m.n, m.n)), trial, gradient)
    size = max(largest_entry(q), largest_entry(gradient))
    add_scaled(1.0, q, gradient)
    primal, primal_size = 0.0, largest_entry(trial)
    for i in range(m.k):
        set_row(m, active[i])
        add_scaled(multiplier[i], row, gradient)
        d = right_side(m, active[i])
        residual = dot(row, trial) - d
        rows[i] = residual
        primal = max(primal, abs(residual))
        primal_size = max(primal_size, abs(d))
    return max(
        largest_entry(gradient) / max(size, LEAST_DIVISOR),
        primal / max(primal_size, LEAST_DIVISOR),
    )


@part
def solve_system(m):
    """Set the step that removes the residuals rd, rp of `set_residuals`.

    [L L', N'; N, 0] [dx; dm] = -[rd; rp] is solved by g = L^-1 rd,
    R'(R dm + Q g) = rp, L'dx = -(g + Q'R dm).
    """
    L, Q = floats(m.L, (m.n, m.n)), floats(m.Q, (m.n, m.n))
    g, dx = floats(m.gradient, m.n), floats(m.change, m.n)
    dm = floats(m.multiplier_change, m.k)
    forward_solve(L, g)
    triangular_solve_transposed(m, dm)
    for i in range(m.k):
        dm[i] -= dot(Q[i], g)
    for j in range(m.n):
        dx[j] = -g[j]
    for i in range(m.k):
        add_scaled(-dm[i], Q[i], dx)
    triangular_solve(m, dm)
    backward_solve(L, dx)


@part
def set_multipliers(m):
    """Set y, z, z_box from the active rows, and x to its active bounds exactly.

    The multipliers of active bounds follow from P x + q + G'z + A'y + z_box = 0; those
    of inequalities that have the wrong sign are set to 0. Returns the largest residual
    of this equation, relative to max(|q|, |P x|).
    """
    x, gradient, q = floats(m.x, m.n), floats(m.gradient, m.n), floats(m.q, m.n)
    lb, ub = floats(m.lb, m.n), floats(m.ub, m.n)
    y, z, z_box = floats(m.y, m.p), floats(m.z, m.m), floats(m.z_box, m.n)
    active = longs(m.active, m.k)
    spread_multipliers(m, m.k)
    for i in range(m.m):
        z[i] = max(z[i], 0.0)
    for i in range(m.k):
        j = active[i] - m.p - m.m
        if j >= m.n:
            x[j - m.n] = ub[j - m.n]
        elif j >= 0:
            x[j] = lb[j]
    matvec(floats(m.P, (m.n, m.n)), x, gradient)
    size = max(largest_entry(q), largest_entry(gradient))
    add_scaled(1.0, q, gradient)
    add_rmatvec(floats(m.A, (m.p, m.n)), y, gradient)
    add_rmatvec(floats(m.G, (m.m, m.n)), z, gradient)
    for i in range(m.k):
        j = active[i] - m.p - m.m
        if j >= m.n:
            z_box[j - m.n] = max(-gradient[j - m.n], 0.0)
        elif j >= 0:
            z_box[j] = min(-gradient[j], 0.0)
    add_scaled(1.0, z_box, gradient)
    return largest_entry(gradient) / max(size, LEAST_DIVISOR)
