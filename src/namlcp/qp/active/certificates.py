"""Certificates of dense QPs: `namlcp.qp.certificates` for candidates left by a solve.

The tests are those of `acceptance`, first in the user's units, then in those that
equilibrate the KKT matrix (see `transforms.scaling`), row by row.
"""

import cython
from cython.cimports.libc.math import INFINITY, NAN, fabs, isinf, sqrt
from cython.cimports.namlcp.linalg.dense import times_rows
from cython.cimports.namlcp.linalg.vectors import copy, fill
from cython.cimports.namlcp.qp.acceptance import (
    Farkas,
    is_clear,
    is_contradiction,
    is_ray,
    weigh,
)
from cython.cimports.namlcp.qp.transforms.scaling import (
    EQUAL,
    LEAST_FACTOR,
    MOST_FACTOR,
    ROUNDS,
)


def prove_infeasible(m):
    """Make y and z a certificate (NaN, y, z, z_box) with value -1, if they allow it."""
    n, p = m.n, m.p
    found: Farkas
    for i in range(m.m):
        if m.z[i] <= 0.0 or isinf(m.h[i]):  # NaN is kept
            m.z[i] = 0.0
    m.set_row_products()
    s = m.Gtz
    for j in range(n):
        s[j] += m.Aty[j]
    weigh(cython.address(found), m.b, m.y, p, m.h, m.z, m.m, m.lb, m.ub, s, m.z_box, n)
    if not is_clear(found.value, found.moduli):
        return False
    factor = -1.0 / found.value
    scale_by(factor, m.y, p)
    scale_by(factor, m.z, m.m)
    scale_by(factor, m.z_box, n)
    for j in range(n):
        s[j] = factor * s[j] + m.z_box[j]
    margin, moduli = factor * m.eps_abs * found.lam, factor * found.moduli
    fill(m.best, 1.0, m.length)
    m.found.dual = largest_in_units(s, m.best, n)
    if not contradicts(m, m.best, margin, moduli):
        return False
    if not contradicts(m, equilibrate(m, False), margin, moduli):
        return False
    fill(m.x, NAN, n)
    return True


def contradicts(m, units, margin, moduli):
    """Tell whether multipliers with the residual in Gtz are a contradiction."""
    n, p = m.n, m.p
    worst = largest_in_units(m.Gtz, units, n)
    most = largest_in_units(m.z_box, units, n)
    most = max(most, largest_per_unit(m.y, units + n, p))
    most = max(most, largest_per_unit(m.z, units + n + p, m.m))
    return is_contradiction(worst, most, size_of(m.x, units, n), margin, moduli)


def prove_unbounded(m):
    """Make x the ray in z_box, all else NaN, with q'x = -1, if that allows it."""
    n, p, d = m.n, m.p, m.z_box
    sizes = cython.declare(cython.double[3])
    value, moduli = 0.0, 0.0
    for j in range(n):
        if (d[j] > 0.0 and m.ub[j] < INFINITY) or (d[j] < 0.0 and m.lb[j] > -INFINITY):
            d[j] = 0.0
        value += m.q[j] * d[j]
        moduli += fabs(m.q[j] * d[j])
    if not is_clear(value, moduli):
        return False
    scale_by(-1.0 / value, d, n)
    moduli /= -value
    times_rows(m.P, n, n, n, d, m.Px)
    times_rows(m.A, p, n, n, d, m.Ax)
    times_rows(m.G, m.m, n, n, d, m.Gx)
    for i in range(m.m):
        m.Gx[i] = 0.0 if isinf(m.h[i]) else max(m.Gx[i], 0.0)
    left = max(uncancelled(m.P, d, m.Px, n, n), uncancelled(m.A, d, m.Ax, p, n))
    left = max(left, uncancelled(m.G, d, m.Gx, m.m, n))
    if not left < INFINITY:
        return False
    units = m.best
    fill(units, 1.0, m.length)
    m.found.dual = largest_in_units(m.Px, units, n)
    m.found.primal = largest_in_units(m.Ax, units, p)
    m.found.primal = max(m.found.primal, largest_in_units(m.Gx, units, m.m))
    margin = m.eps_abs * size_of(d, units, n)
    sizes[0] = max(1.0, size_of(m.x, units, n))
    sizes[1] = max(1.0, size_of(m.y, units, p))
    sizes[2] = max(1.0, size_of(m.z, units, m.m))
    if not is_recession(m, units, sizes, margin, moduli, left):
        return False
    units = equilibrate(m, True)
    sizes[0] = sizes[1] = sizes[2] = max(1.0, largest_in_units(m.q, units, n))
    if not is_recession(m, units, sizes, margin, moduli, left):
        return False
    copy(d, m.x, n)
    fill(d, NAN, n)
    fill(m.y, NAN, p)
    fill(m.z, NAN, m.m)
    return True


def is_recession(m, units, sizes, margin, moduli, left):
    """Tell whether the ray in z_box passes in these units, see `is_ray`."""
    n, p = m.n, m.p
    cost = largest_in_units(m.Px, units, n)
    equation = largest_in_units(m.Ax, units + n, p)
    row = largest_in_units(m.Gx, units + n + p, m.m)
    error = cost * sizes[0] + equation * sizes[1] + row * sizes[2]
    most = largest_per_unit(m.z_box, units, n)
    worst = max(cost, max(equation, row))
    return is_ray(worst, most, error, margin, moduli, left)


def uncancelled(C, d, Cd, count, n):
    """Return the largest |C d| over |C| |d| row by row; inf if that overflows."""
    largest = 0.0
    for i in range(count):
        row, terms = C + i * n, 0.0
        for j in range(n):
            terms += fabs(row[j] * d[j])
        if not terms < INFINITY:
            return INFINITY
        if terms > 0.0:
            largest = max(largest, fabs(Cd[i]) / terms)
    return largest


# ---- vectors


def scale_by(factor, v, n):
    """Multiply a vector by a number."""
    for i in range(n):
        v[i] *= factor


def size_of(v, units, n):
    """Return the sum of |v_i / units_i|."""
    total = 0.0
    for i in range(n):
        total += fabs(v[i] / units[i])
    return total


def largest_in_units(v, units, n):
    """Return max |v_i units_i|."""
    largest = 0.0
    for i in range(n):
        largest = max(largest, fabs(v[i] * units[i]))
    return largest


def largest_per_unit(v, units, n):
    """Return max |v_i / units_i|."""
    largest = 0.0
    for i in range(n):
        largest = max(largest, fabs(v[i] / units[i]))
    return largest


# ---- equilibration


def equilibrate(m, has_cost):
    """Return factors of x, y and z that equilibrate P (or 0), A and G.

    They are those of `transforms.scaling.equilibrate` for the KKT matrix.
    """
    n, p, scale, largest = m.n, m.p, m.best, m.change
    fill(scale, 1.0, m.length)
    for _ in range(ROUNDS):
        fill(largest, 0.0, m.length)
        if has_cost:
            note_rows(m.P, n, n, scale, 0, largest)
        note_rows(m.A, p, n, scale, n, largest)
        note_rows(m.G, m.m, n, scale, n + p, largest)
        if next_factors(scale, largest, m.length) <= EQUAL:
            break
        copy(largest, scale, m.length)
    return scale


def note_rows(C, count, n, scale, at, largest):
    """Note the largest scaled entries of rows at, at + 1, ... and of their columns."""
    for i in range(count):
        row, most, factor = C + i * n, 0.0, scale[at + i]
        for j in range(n):
            value = fabs(row[j]) * factor * scale[j]
            largest[j] = max(largest[j], value)
            most = max(most, value)
        largest[at + i] = max(largest[at + i], most)


def next_factors(scale, largest, size):
    """Turn the largest entries into new factors; return how far from 1 they were."""
    off = 0.0
    for j in range(size):
        factor = scale[j]
        if largest[j] > 0.0:
            off = max(off, fabs(1.0 - largest[j]))
            factor /= sqrt(largest[j])
        largest[j] = min(max(factor, LEAST_FACTOR), MOST_FACTOR)
    return off
