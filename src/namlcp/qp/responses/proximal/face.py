"""The minimum of the cost on a face, by conjugate gradients: see the door of this room.

z stands for the multipliers of G, of either sign here, and `s` for the values of rows.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import LEAST_DIVISOR, add_scaled, dot, largest_entry
from namlcp.qp.responses.active import size_of
from namlcp.qp.responses.judgement import (
    parts_of_result,
    set_correction,
    set_result,
    set_step,
    take_step,
)
from namlcp.qp.responses.proximal.certificates import is_ray, longest_step
from namlcp.qp.responses.proximal.operator import (
    set_products,
    set_values_of,
    times_cost,
)

# Results of `descend`: the minimum; a point where a row is met that is not active; a
# ray in z_box; a direction without curvature that is none.
FACE_SOLVED, BLOCKED, RAY, LOST, MOVED = range(5)
# Passes at most. Relative residual at which they end, and the one at which they do if
# they gain less than a factor of 2 for IDLE passes.
PASSES, EXACT, GOOD, IDLE = 60, 1e-15, 1e-10, 3
# Curvature over that of D, see `weight`, up to which there is none, and the residual at
# which a direction without curvature is one of rounding errors.
FLAT, NEARLY_EXACT = 1e-13, 1e-12
# The change of x is rounding where the active rows take away all but CANCELLED of it,
# or it is TINY times x. The point is brought to its face first, up to ON_FACE, by
# STEADY passes.
CANCELLED, TINY, ON_FACE, STEADY = 1e-11, 1e-14, 1e-14, 2
# Curvature over that of W up to which a direction may be near a ray.
OPEN = 0.1


@part
def descend(m):
    """Minimise the cost on the face of the active rows; see the results above."""
    before, best, idle, turn = 0.0, np.inf, 0, 0
    while True:
        error, away = take_face(m)
        idle = 0 if error < 0.5 * best else idle + 1
        best = min(best, error)
        if error <= EXACT or turn == PASSES or (idle >= IDLE and best <= GOOD):
            return FACE_SOLVED
        is_rounding = set_change(m)
        if is_rounding or (away > ON_FACE and turn < STEADY):
            take_step(m)
            before = 0.0
        else:
            energy = set_direction(m, before)
            if not energy > 0.0:
                return FACE_SOLVED
            before = energy
            found = move(m, energy, error)
            if found != MOVED:
                return found
        turn += 1


@part
def take_face(m):
    """Take the values and multipliers at hand as the result, and measure it.

    Returns the largest residual of the face over its terms, and that of its rows. Sets
    m.rhs to minus the residuals, and s to the values of the result.
    """
    set_result(m)
    _, _, z, z_box = parts_of_result(m)
    active, multiplier = longs(m.active, m.most + 1), floats(m.multiplier, m.most + 1)
    for i in range(m.k):
        if active[i] < m.m:
            z[active[i]] = multiplier[i]
    set_products(m)
    q, b, h, rhs = floats(m.q, m.n), floats(m.b, m.p), floats(m.h, m.m), m.rhs
    Px, Gx = floats(m.Px, m.n), floats(m.Gx, m.m)
    Gtz, Aty = floats(m.Gtz, m.n), floats(m.Aty, m.n)
    away, size = 0.0, largest_entry(floats(m.out, m.n))
    for i in range(m.k):
        row = active[i]
        if row < m.m:
            away = max(away, abs(Gx[row] - h[row]))
            size = max(size, abs(h[row]))
        else:
            j = row - m.m
            z_box[j] = multiplier[i] = -(Px[j] + q[j] + Gtz[j] + Aty[j])
    set_correction(m)
    away = max(away, largest_entry(floats(rhs + 8 * m.n, m.p)))
    away /= max(size, largest_entry(b), LEAST_DIVISOR)
    slope = max(largest_entry(Px), largest_entry(q))
    slope = max(slope, largest_entry(Gtz), largest_entry(Aty), LEAST_DIVISOR)
    return max(largest_entry(floats(rhs, m.n)) / slope, away), away


@part
def set_change(m):
    """Set m.change to the preconditioned residual, m.work to dmu.

    Returns whether the change of x is rounding.
    """
    s, change = floats(m.s, m.length), floats(m.change, m.length)
    set_values_of(m, floats(m.rhs, m.n + m.p), change)
    whole = size_of(m, change)
    set_step(m)
    size = size_of(m, change)
    return size <= CANCELLED * whole or size <= TINY * size_of(m, s)


@part
def set_direction(m, before):
    """Set m.along to the next conjugate direction, and m.Palong; return the energy e.

    before: the energy of the last pass, 0 if there is none.
    """
    along, change = floats(m.along, m.length), floats(m.change, m.length)
    weight, Palong = floats(m.weight, m.n), floats(m.Palong, m.n)
    dx = change[m.m : m.rows]
    times_cost(m, dx, Palong)
    energy = dot(dx, Palong)
    for j in range(m.n):
        energy += weight[j] * dx[j] * dx[j]
    if before > 0.0:
        ratio = energy / before
        for i in range(m.rows):
            along[i] = change[i] + ratio * along[i]
        times_cost(m, along[m.m : m.rows], Palong)
    else:
        for i in range(m.rows):
            along[i] = change[i]
    return energy


@part
def move(m, energy, error):
    """Go along the direction: to its minimum, or the first row. MOVED, or a result."""
    along, Palong = floats(m.along, m.length), floats(m.Palong, m.n)
    s, change = floats(m.s, m.length), floats(m.change, m.length)
    multiplier, work = floats(m.multiplier, m.most + 1), floats(m.work, m.most + 1)
    weight, p = floats(m.weight, m.n), along[m.m : m.rows]
    curvature, full, of_weight = dot(p, Palong), np.inf, 0.0
    for j in range(m.n):
        of_weight += weight[j] * p[j] * p[j]
    if curvature > FLAT / m.rho * of_weight:
        full = energy / curvature
    elif error <= NEARLY_EXACT:
        return FACE_SOLVED
    longest = longest_step(m, along)
    for i in range(m.k):
        multiplier[i] += work[i]
    for i in range(m.rows, m.length):
        s[i] += change[i]
    if not curvature > OPEN * of_weight and is_ray(m):
        return RAY
    if full == longest:
        return LOST
    add_scaled(min(longest, full), along[: m.rows], s[: m.rows])
    return BLOCKED if longest < full else MOVED
