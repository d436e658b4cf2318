"""The point of the active rows as the user sees it, measured and refined on the data.

The residuals are those of the arguments as given, by their one definition (see
`namlcp.residuals`). Refinement is iterative, with these residuals and the operators at
hand, from the point that `finish` computed: like that, it depends on the active rows
alone.
"""

import cython
from cython.cimports.libc.math import INFINITY, fabs
from cython.cimports.namlcp.box import clip
from cython.cimports.namlcp.linalg.vectors import add_scaled, copy, fill
from cython.cimports.namlcp.measure import Terms
from cython.cimports.namlcp.measure import measure as measure_terms
from cython.cimports.namlcp.qp.active.engine import (
    DONE,
    LATE,
    STUCK,
    SUMMED,
    VIOLATION_ROUNDING,
    drop_wrong_signs,
    goal_of,
    is_pinned,
    pivot,
    subtract_active,
)

from namlcp import checks
from namlcp.linalg import columns

# Nothing is refined where residuals over the moduli of their terms are at most
# ACCURATE, and the residuals themselves at most RESERVE times the absolute tolerance;
# or no more than their own rounding error, which is ROUNDING over these moduli, and at
# most a tenth of the tolerance, a half for the gap, which refinement hardly changes.
ACCURATE, RESERVE, ROUNDING = 1e-12, 0.05, 4e-15
# The factor by which each of the PASSES of refinement has to lower the error.
GAIN = 0.5
# In place of 0 where a size is divided by; what is infinite beside sides of about 1.
LEAST_DIVISOR, INFINITE = columns.LEAST_DIVISOR, checks.INFINITE


def set_point(m):
    """Set x, y and z from the values and multipliers, x to active bounds exactly."""
    copy(m.s + m.m, m.x, m.n)
    copy(m.s + m.rows, m.y, m.p)
    fill(m.z_box, 0.0, m.n)
    fill(m.z, 0.0, m.m)
    for i in range(m.k):
        row = m.active[i]
        if row < m.m:
            m.z[row] = max(m.multiplier[i], 0.0)
        else:
            m.x[row - m.m] = goal_of(m, row, m.side[row])


def clip_point(m):
    """Move x into its bounds, which rounding may have left; tell whether it was out."""
    x, lb, ub = m.x, m.lb, m.ub
    was_out: cython.bint = False
    for j in range(m.n):
        if x[j] < lb[j] or x[j] > ub[j]:
            x[j] = clip(x[j], lb[j], ub[j])
            was_out = True
    return was_out


def measure(m):
    """Set z_box to minus the gradient at active bounds; measure the point.

    Needs the products of the point. Returns the largest residual over the moduli of its
    terms, with the active rows as equations.
    """
    t: Terms
    primal = 0.0
    for i in range(m.k):
        row = m.active[i]
        if row < m.m:
            primal = max(primal, fabs(m.Gx[row] - m.h[row]))
        else:
            j = row - m.m
            gradient = m.Px[j] + m.q[j] + m.Gtz[j] + m.Aty[j]
            sign, m.z_box[j] = m.side[row], -gradient
            if sign * gradient > 0.0 and not is_pinned(m, row):
                m.z_box[j] = 0.0
    t.n, t.m, t.p = m.n, m.m, m.p
    t.q, t.h, t.b, t.lb, t.ub = m.q, m.h, m.b, m.lb, m.ub
    t.x, t.y, t.z, t.z_box = m.x, m.y, m.z, m.z_box
    t.Px, t.Gx, t.Ax, t.Gtz, t.Aty = m.Px, m.Gx, m.Ax, m.Gtz, m.Aty
    found = cython.address(m.found)
    measure_terms(cython.address(t), found)
    return max(
        max(primal, found.primal) / max(found.primal_size, LEAST_DIVISOR),
        found.dual / max(found.dual_size, LEAST_DIVISOR),
    )


def is_low(m, residual, size, most_reserve):
    """Tell whether a residual is far below its tolerance, or due to rounding."""
    rounding = min(ROUNDING * size, most_reserve * m.eps_abs)
    return m.eps_abs <= 0.0 or residual <= max(RESERVE * m.eps_abs, rounding)


def is_accurate(m, error):
    """Tell whether a point with this error of `measure` needs no refinement."""
    found = cython.address(m.found)
    return (
        error <= ACCURATE
        and is_low(m, found.primal, found.primal_size, 0.1)
        and is_low(m, found.dual, found.dual_size, 0.1)
        and is_low(m, found.gap, found.gap_size, 0.5)
    )


def are_within(m, rounding):
    """Tell whether the residuals are within tolerance with that much of their terms."""
    found, eps = cython.address(m.found), m.eps_abs
    relative = m.eps_rel - rounding
    return (
        found.primal <= eps + relative * found.primal_size
        and found.dual <= eps + relative * found.dual_size
        and found.gap <= eps + relative * found.gap_size
    )


def verdict(m):
    """Return STUCK where the point is not within tolerance, else DONE or SUMMED."""
    if not are_within(m, 0.0) or is_far(m):
        return STUCK
    return DONE if are_within(m, ROUNDING) else SUMMED


def is_far(m):
    """Tell whether rows hold by a size of terms that is infinite beside their sides.

    There, where P curves by the rounding of its entries alone, any rows seem to hold.
    """
    if m.found.primal <= m.eps_abs or m.found.primal_size < INFINITE:
        return False
    most = max(1.0, largest_side(m.h, m.m), largest_side(m.b, m.p))
    most = max(most, largest_side(m.lb, m.n), largest_side(m.ub, m.n))
    return m.found.primal_size >= INFINITE * most


def largest_side(side, n):
    """Return the largest modulus of the finite sides."""
    most = 0.0
    for i in range(n):
        if fabs(side[i]) < INFINITY:
            most = max(most, fabs(side[i]))
    return most


# ---- refinement


def set_correction(m):
    """Set m.rhs = -(dual residual, A x - b), and s to the values of the point."""
    for j in range(m.n):
        m.rhs[j] = -(m.Px[j] + m.q[j] + m.Gtz[j] + m.Aty[j] + m.z_box[j])
        m.s[m.m + j] = m.x[j]
    for i in range(m.p):
        m.rhs[m.n + i] = m.b[i] - m.Ax[i]
        m.s[m.rows + i] = m.y[i]
    copy(m.Gx, m.s, m.m)


def set_change(m):
    """Let m.change lead to the active sides: less sum dmu_i w_i, with dmu in m.work.

    It holds the values of K^-1 m.rhs before.
    """
    for i in range(m.k):
        row = m.active[i]
        m.work[i] = m.change[row] + m.s[row] - goal_of(m, row, m.side[row])
    subtract_active(m, m.change)


def take_change(m):
    """Add m.change to s and m.work to mu."""
    add_scaled(1.0, m.change, m.s, m.length)
    add_scaled(1.0, m.work, m.multiplier, m.k)


def judge(m, found):
    """Measure the point, and refine it as long as it is not accurate and that pays.

    found: how the pivots ended. After LATE the point is measured alone.
    """
    error, passes = INFINITY, PASSES
    while True:
        set_point(m)
        m.set_products(not clip_point(m) and m.k == 0 and m.pivots == 0)
        before, error = error, measure(m)
        if found == LATE:
            return LATE
        if not error < before:
            if before == INFINITY:  # there is no better point to go back to
                return STUCK
            m.s, m.best = m.best, m.s
            m.multiplier, m.best_multiplier = m.best_multiplier, m.multiplier
            error, passes = INFINITY, 0
        elif passes > 0 and error <= GAIN * before and not is_accurate(m, error):
            copy(m.s, m.best, m.length)
            copy(m.multiplier, m.best_multiplier, m.k)
            set_correction(m)
            m.set_values(m.rhs, m.change)
            if not m.on_face:
                set_change(m)
            take_change(m)
            passes -= 1
        else:
            return verdict(m)


# ---- a whole solve


def is_faulty(m):
    """Tell whether a number in the vectors is not allowed, or two sides are opposed.

    Not allowed are NaN, infinite entries of q and b, and sides beyond `INFINITE`.
    """
    fine: cython.bint = True
    most = INFINITE
    for j in range(m.n):
        fine = fine and fabs(m.q[j]) < INFINITY and m.lb[j] <= m.ub[j]
        fine = fine and (-most < m.lb[j] < most or m.lb[j] == -INFINITY)
        fine = fine and (-most < m.ub[j] < most or m.ub[j] == INFINITY)
    for i in range(m.p):
        fine = fine and fabs(m.b[i]) < INFINITY
    for i in range(m.m):
        fine = fine and (-most < m.h[i] < most or m.h[i] == INFINITY)
    return not fine


def follow(m):
    """Solve the QP by `engine`, from the active rows at hand, and judge."""
    m.entering, m.level = -1, VIOLATION_ROUNDING
    if not (m.begin() and drop_wrong_signs(m)):
        return STUCK
    found = pivot(m)
    if found == DONE and not m.finish():
        return STUCK
    return judge(m, found) if found == DONE or found == LATE else found
