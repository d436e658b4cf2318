"""The minimum of the cost on the face of the active rows F, by conjugate gradients.

The preconditioner is the operator K_F, that of P + W on the face, see `proximal`. With
r = P x + q + G'z + A'y, z the multipliers of G, of either sign here, and mu those of
active rows, a pass takes

    (dx, dy) = K^-1 (-r, b - A x),   dmu = S^-1 (dx_F + s_F - d_F),   s = (G x, x, y),
    p = dx - sum dmu_i w_i + (e / e_old) p_old,   e = dx'(P + W) dx,

mu += dmu, y += dy, x += e / p'Pp p. There are as many passes as curvatures on the face
that are not large against W: one to three, mostly. A direction without curvature along
which no row is met and the cost falls is a ray: the QP is unbounded.
"""

from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs
from cython.cimports.namlcp.linalg.vectors import (
    add_scaled,
    copy,
    dot,
    fill,
    largest_entry,
)
from cython.cimports.namlcp.qp.active.engine import goal_of, hold_active, size_of
from cython.cimports.namlcp.qp.active.judgement import (
    LEAST_DIVISOR,
    set_change,
    set_correction,
    set_point,
    take_change,
)

# PASSES: passes at most. They end at the relative residual EXACT, and at GOOD if they
# gain less than a factor of 2 for IDLE passes.
EXACT, GOOD = 1e-15, 1e-10
# Curvature over that of D, see `weight`, up to which there is none, and the residual at
# which a direction without curvature is one of rounding errors.
FLAT, NEARLY_EXACT = 1e-13, 1e-12
# The change of x is rounding where the active rows take away all but CANCELLED of it,
# or it is TINY times x. The point is brought to its face first, up to ON_FACE, by
# STEADY passes.
CANCELLED, TINY, ON_FACE = 1e-11, 1e-14, 1e-14
# Curvature over that of W up to which a direction may be near a ray.
OPEN = 0.1
# RAY_PASSES: passes for a ray at most. RAY_GAIN: the gain of one below which it was the
# last; the largest P d over d, in the variables of `weight`, and that at which no pass
# follows.
RAY_GAIN, MOST_CURVED, CLEAN = 0.9, 1e-9, 1e-14
# Growth of a row, over its norm, along a direction of size 1, up to which it is
# rounding.
LEAST_GROWTH = 1e-11


def descend(m):
    """Minimise the cost on the face of the active rows; return how that ended."""
    idle: Py_ssize_t = 0
    energy, best = 0.0, INFINITY
    for turn in range(PASSES + 1):
        away, n = take_face(m), m.n
        cost = max(largest_entry(m.Px, n), largest_entry(m.q, n))
        rows = max(largest_entry(m.Gtz, n), largest_entry(m.Aty, n))
        slope = largest_entry(m.rhs, n) / max(max(cost, rows), LEAST_DIVISOR)
        error = max(slope, away)
        idle = 0 if error < 0.5 * best else idle + 1
        best = min(best, error)
        if error <= EXACT or turn == PASSES or (idle >= IDLE and best <= GOOD):
            break
        if is_rounding(m) or (away > ON_FACE and turn < STEADY):
            take_change(m)
            energy = 0.0
        else:
            energy = set_direction(m, energy)
            if not energy > 0.0:
                break
            found = move(m, energy, error)
            if found != MOVED:
                return found
    return FACE_SOLVED


def take_face(m):
    """Take the values and multipliers at hand as the point, with its products.

    Sets m.rhs to minus the residuals of the face, and s to the values of the point.
    Returns the largest residual of active rows and equations over their terms.
    """
    set_point(m)
    for i in range(m.k):
        if m.active[i] < m.m:
            m.z[m.active[i]] = m.multiplier[i]
    m.set_products(False)
    away, size = 0.0, max(largest_entry(m.x, m.n), largest_entry(m.b, m.p))
    for i in range(m.k):
        row = m.active[i]
        if row < m.m:
            away = max(away, fabs(m.Gx[row] - m.h[row]))
            size = max(size, fabs(m.h[row]))
        else:
            j = row - m.m
            m.multiplier[i] = -(m.Px[j] + m.q[j] + m.Gtz[j] + m.Aty[j])
            m.z_box[j] = m.multiplier[i]
    set_correction(m)
    return max(away, largest_entry(m.rhs + m.n, m.p)) / max(size, LEAST_DIVISOR)


def is_rounding(m):
    """Set m.change to the preconditioned residual, m.work to dmu.

    Returns whether the change of x is rounding.
    """
    m.set_values(m.rhs, m.change)
    whole = size_of(m, m.change)
    set_change(m)
    size = size_of(m, m.change)
    return size <= CANCELLED * whole or size <= TINY * size_of(m, m.s)


def add_weighted(m, v, sum):
    """Return sum + v'W v."""
    for j in range(m.n):
        sum += m.weight[j] * v[j] * v[j]
    return sum


def set_direction(m, before):
    """Set m.along to the next conjugate direction, and m.Palong; return the energy e.

    before: the energy of the last pass, 0 if there is none.
    """
    dx = m.change + m.m
    m.times_cost(dx, m.Palong)
    energy = add_weighted(m, dx, dot(dx, m.Palong, m.n))
    if before > 0.0:
        add_scaled(energy / before, m.along, m.change, m.rows)
        m.times_cost(dx, m.Palong)
    copy(m.change, m.along, m.rows)
    return energy


def move(m, energy, error):
    """Go along the direction: to its minimum, or the first row. MOVED, or an end."""
    p = m.along + m.m
    curvature, full = dot(p, m.Palong, m.n), INFINITY
    of_weight = add_weighted(m, p, 0.0)
    if curvature > FLAT / m.rho * of_weight:
        full = energy / curvature
    elif error <= NEARLY_EXACT:
        return FACE_SOLVED
    longest = longest_step(m, m.along)
    add_scaled(1.0, m.work, m.multiplier, m.k)
    add_scaled(1.0, m.change + m.rows, m.s + m.rows, m.p)
    if not curvature > OPEN * of_weight and is_ray(m):
        return RAY
    if full == longest:
        return LOST
    add_scaled(min(longest, full), m.along, m.s, m.rows)
    return BLOCKED if longest < full else MOVED


def longest_step(m, along):
    """Return the step along a direction up to the first row that is not active."""
    t, least = INFINITY, LEAST_GROWTH * size_of(m, along)
    for i in range(m.rows):
        growth = along[i] * m.scale[i]
        if m.side[i] != 0 or not fabs(growth) > least:
            continue
        if growth > 0.0:
            t = min(t, max(goal_of(m, i, 1) - m.s[i], 0.0) / along[i])
        elif i >= m.m:
            t = min(t, max(m.s[i] - goal_of(m, i, -1), 0.0) / -along[i])
    return t


def is_ray(m):
    """Tell whether a direction d near m.along, without curvature, is a ray in z_box.

    Inverse iteration on the face, d = K_F^-1 W d, takes away what is curved. Overwrites
    m.change, m.work and m.Palong.
    """
    n, ray = m.n, m.z_box
    ratio, last = 0.0, INFINITY
    copy(m.along + m.m, ray, n)
    fill(m.rhs + n, 0.0, m.p)
    for _ in range(RAY_PASSES):
        for j in range(n):
            m.rhs[j] = m.weight[j] * ray[j]
        m.set_values(m.rhs, m.change)
        hold_active(m, m.change)
        copy(m.change + m.m, ray, n)
        for i in range(m.k):
            if m.active[i] >= m.m:
                ray[m.active[i] - m.m] = 0.0
        m.times_cost(ray, m.Palong)
        curved = 0.0
        for j in range(n):
            curved = max(curved, fabs(m.Palong[j]) / m.scale[m.m + j])
        ratio = curved / max(size_of(m, m.change), LEAST_DIVISOR)
        if not CLEAN < ratio < RAY_GAIN * last:
            break
        last = ratio
    if not (dot(m.q, ray, n) < 0.0 and ratio <= MOST_CURVED):
        return False
    return longest_step(m, m.change) == INFINITY
