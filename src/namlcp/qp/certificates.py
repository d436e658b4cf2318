"""Certificates: multipliers that prove a QP infeasible, rays that prove it unbounded.

Primal infeasible: (y, z >= 0, z_box) with A'y + G'z + z_box = 0 and
b'y + h'z + lb'z_box^- + ub'z_box^+ = -1 (Farkas). Unbounded: a direction d, q'd = -1,
with P d = 0, A d = 0, G d <= 0, d in the recession cone of the bounds. Every form
proposes candidates; `prove_infeasible` and `prove_unbounded` alone accept them.

One bound or one row may prove it alone. Where lb_j > ub_j, z_box_j = 1 / (lb_j - ub_j)
is the multiplier of both bounds, which cancel each other in the first equation; where
lb_j = inf, ub_j = -inf or h_i = -inf, it is -1, 1 or 1. All others are 0 then.

The test of a Farkas certificate: let r be the residual of the first equation and lam
the 1-norm of the multipliers. Every x that violates no constraint by more than t has
1 <= |r|_inf |x|_1 + t lam. The certificate thus excludes all x with |x|_1 below
(1 - t lam)/|r|_inf; if r = 0, every x violates some constraint by 1/lam or more.

A test is made in the user's units, then in those that equilibrate P, A and G: without
them a column of tiny entries would have a tiny residual for any y and z, and a variable
that counts in large units one for any step along it.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, NAN, fabs, isinf

from namlcp.qp.bounds import is_box_open
from namlcp.qp.problem import Point
from namlcp.residuals import UNDEFINED

# The value of a certificate, before it is scaled to -1, must be below minus this times
# the sum of the moduli of its terms, far beyond the rounding errors of the sum.
VALUE_ROUNDING = 1e3 * 2.0**-52
# A certificate with a residual, relative to its largest entry, of at most RESIDUAL must
# exclude all x with |x|_1 up to RADIUS times max(1, |x|_1 of the current point). With a
# residual of at most EXACT_RESIDUAL, mere rounding, it need not, but must have a margin
# of at most MARGIN.
RESIDUAL, RADIUS, EXACT_RESIDUAL, MARGIN = 1e-8, 1e3, 1e-12, 0.5
# Then, largest error of its value, as a part of it: a multiplier is as inexact as the
# relative residual says, and so is each term of the sum. (Of a ray also: as inexact as
# |M d| relative to |M| |d|.)
ROUNDED_VALUE = 1e-2
# Largest |M d|, relative to |M| |d| row by row, of such a ray.
CANCELLED = 1e-10
LARGEST = float(np.finfo(float).max)


def suffices(worst, most, error, margin, moduli, cancels):
    """Tell whether a certificate is accepted.

    worst: its largest residual; most: its largest entry; error: the most that the
    residual may be at points of the current size; margin: the absolute tolerance times
    the 1-norm of the multipliers, t lam, or of the ray; moduli: as of `Claim`; cancels:
    whether a residual of rounding errors is one.
    """
    relative, radius = worst / most, RADIUS * error + margin
    within: cython.bint = relative <= RESIDUAL and radius <= 1.0
    exact: cython.bint = relative <= EXACT_RESIDUAL and margin <= MARGIN
    return within or (exact and cancels and relative * moduli <= ROUNDED_VALUE)


def weigh(c, y, z, s, z_box):
    """Set z_box to -s = -(G'z + A'y) where a bound allows, and value, moduli and lam.

    The value is b'y + h'z + lb'z_box^- + ub'z_box^+, NaN where a multiplier is.
    """
    c.value = c.moduli = c.lam = 0.0
    for i in range(c.p):
        add_term(c, c.b[i], y[i])
    for i in range(c.m):
        if z[i] != 0.0:
            add_term(c, c.h[i], z[i])
    for j in range(c.n):
        bound = c.ub[j] if s[j] < 0.0 else c.lb[j]
        z_box[j] = 0.0 if isinf(bound) else 0.0 - s[j]
        if z_box[j] != 0.0:
            add_term(c, bound, z_box[j])
        c.value += 0.0 * s[j]  # NaN where s is, for what max() may ignore


def add_term(c, side, multiplier):
    c.value += side * multiplier
    c.moduli += fabs(side * multiplier)
    c.lam += fabs(multiplier)


# ---- certificates of a QP


def prove_infeasible(c, x, y, z, z_box):
    """Make y, z and z_box a certificate with value -1, if y and z allow it at x."""
    n, p, s, factor = c.n, c.p, c.r, 1.0
    for i in range(c.m):
        if z[i] <= 0.0 or isinf(c.h[i]):  # NaN is kept
            z[i] = 0.0
    fill(s, 0.0, n)
    add_transposed(c.G, z, s)
    add_transposed(c.A, y, s)
    weigh(c, y, z, s, z_box)
    if not c.value < -VALUE_ROUNDING * c.moduli:
        return False
    factor = -1.0 / c.value
    scale(factor, y, p)
    scale(factor, z, c.m)
    scale(factor, z_box, n)
    for j in range(n):
        s[j] = factor * s[j] + z_box[j]
    c.dual = largest_entry(s, n)
    fill(c.units, 1.0, n + p + c.m)
    for has_units in range(2):
        if has_units:
            equilibrate_parts(cython.NULL, c.A, c.G, n, p, c.m, c.units, c.largest)
        worst, most = largest_in(s, c.units, n), largest_in(z_box, c.units, n)
        most = max(most, norms_per(y, c.units + n, p)[0])
        most = max(most, norms_per(z, c.units + n + p, c.m)[0])
        margin, moduli = factor * c.tol * c.lam, factor * c.moduli
        error = max(1.0, norms_per(x, c.units, n)[1]) * worst
        if not suffices(worst, most, error, margin, moduli, True):
            return False
    return True


def prove_unbounded(c, x, y, z, d):
    """Make d, clipped to the bounds' recession cone, a ray with q'd = -1, if it can be.

    (x, y, z): the point at hand; c.primal becomes the largest of |A d| and (G d)+.
    """
    n, p, m, r, value, moduli = c.n, c.p, c.m, c.r, 0.0, 0.0
    for j in range(n):
        if (d[j] > 0.0 and c.ub[j] < INFINITY) or (d[j] < 0.0 and c.lb[j] > -INFINITY):
            d[j] = 0.0
        value += c.q[j] * d[j]
        moduli += fabs(c.q[j] * d[j])
    if not value < -VALUE_ROUNDING * moduli:
        return False
    scale(-1.0 / value, d, n)
    moduli /= -value
    sizes, left = c.largest, 0.0
    fill(r, 0.0, n + p + m)
    fill(sizes, 0.0, n + p + m)
    add_products(c.P, d, r, sizes)
    add_products(c.A, d, r + n, sizes + n)
    add_products(c.G, d, r + n + p, sizes + n + p)
    for i in range(m):
        r[n + p + i] = 0.0 if isinf(c.h[i]) else max(r[n + p + i], 0.0)
    for k in range(n + p + m):
        if not sizes[k] < INFINITY:
            return False
        if sizes[k] > 0.0:
            left = max(left, fabs(r[k]) / sizes[k])
    c.dual, c.primal = largest_entry(r, n), largest_entry(r + n, p + m)
    cancels: cython.bint = left <= CANCELLED and left * moduli <= ROUNDED_VALUE
    units = c.units
    fill(units, 1.0, n + p + m)
    margin = c.tol * norms_per(d, units, n)[1]
    of_x = max(1.0, norms_per(x, units, n)[1])
    of_y = max(1.0, norms_per(y, units, p)[1])
    of_z = max(1.0, norms_per(z, units, m)[1])
    for has_units in range(2):
        if has_units:
            equilibrate_parts(c.P, c.A, c.G, n, p, m, units, c.largest)
            of_x = of_y = of_z = max(1.0, largest_in(c.q, units, n))
        cost, equation = largest_in(r, units, n), largest_in(r + n, units + n, p)
        row = largest_in(r + n + p, units + n + p, m)
        error = cost * of_x + equation * of_y + row * of_z
        worst, most = max(cost, max(equation, row)), norms_per(d, units, n)[0]
        if not suffices(worst, most, error, margin, moduli, cancels):
            return False
    return True


# ---- vectors and matrices


def scale(factor, v, n):
    for i in range(n):
        v[i] *= factor


def largest_in(v, units, n):
    largest = 0.0
    for i in range(n):
        largest = max(largest, fabs(v[i] * units[i]))
    return largest


def norms_per(v, units, n):
    """Return the largest entry and the sum of |v_i / units_i|."""
    largest = total = 0.0
    for i in range(n):
        largest = max(largest, fabs(v[i] / units[i]))
        total += fabs(v[i] / units[i])
    return largest, total


def add_products(M, d, out, sizes):
    """Add M d and |M| |d|."""
    for line in range(M.lines):
        for t in range(first_of(M, line), first_of(M, line + 1)):
            i, j = place_of(M, line, t)
            term = M.values[t] * d[j]
            out[i] += term
            sizes[i] += fabs(term)


def add_transposed(M, y, out):
    """Add M'y."""
    for line in range(M.lines):
        for t in range(first_of(M, line), first_of(M, line + 1)):
            i, j = place_of(M, line, t)
            if y[i] != 0.0:
                out[j] += M.values[t] * y[i]


# ---- arrays of NumPy


def accepted(qp, point, d, tol):
    """Return a certificate of value -1, its point and residuals; None if there is none.

    Of (x, y, z) at hand y and z are to prove that the QP is infeasible; a ray d, if not
    None, that it is unbounded. tol: the absolute tolerance.
    """
    P: Matrix
    G: Matrix
    A: Matrix
    c: Claim
    c.P, c.G, c.A = cython.address(P), cython.address(G), cython.address(A)
    arrays = [np.ascontiguousarray(v, float) for v in (qp.q, qp.h, qp.b, qp.lb, qp.ub)]
    n: Py_ssize_t = qp.q.size
    m: Py_ssize_t = qp.h.size
    p: Py_ssize_t = qp.b.size
    size = n + m + p
    c.n, c.m, c.p, c.tol, c.primal, c.dual = n, m, p, tol, NAN, NAN
    c.q, c.h, c.b = numbers(arrays[0], n), numbers(arrays[1], m), numbers(arrays[2], p)
    c.lb, c.ub = numbers(arrays[3], n), numbers(arrays[4], n)
    arrays += [take_matrix(c.P, qp.P), take_matrix(c.G, qp.G), take_matrix(c.A, qp.A)]
    work = np.empty(3 * size)
    c.units = numbers(work, 3 * size)
    c.largest, c.r = c.units + size, c.units + 2 * size
    x, y, z = (np.array(v, float) for v in point)
    last = np.empty(n) if d is None else np.array(d, float)
    of_x, of_y, of_z = numbers(x, n), numbers(y, p), numbers(z, m)
    of_last = numbers(last, n)
    if d is None:
        is_one = prove_infeasible(cython.address(c), of_x, of_y, of_z, of_last)
        found = Point(np.full(n, NAN), y, z, last)
    else:
        is_one = prove_unbounded(cython.address(c), of_x, of_y, of_z, of_last)
        found = Point(last, *(np.full(k, NAN) for k in (p, m, n)))
    return (found, UNDEFINED._replace(primal=c.primal, dual=c.dual)) if is_one else None


def alone(qp, eps_abs, eps_rel):
    """Return why one bound, or one row, proves that no x is feasible, if one does."""
    empty = (qp.h == -np.inf).nonzero()[0]
    if is_box_open(qp.lb, qp.ub) and not empty.size:
        return None
    size = np.minimum(np.maximum(np.abs(qp.lb), np.abs(qp.ub)), LARGEST)
    crossed = 0.5 * qp.lb - 0.5 * qp.ub > eps_abs + eps_rel * size  # NaN for inf - inf
    wrong = (crossed | (qp.lb == np.inf) | (qp.ub == -np.inf)).nonzero()[0]
    proof = qp.point(np.full(qp.q.size, np.nan))
    found = proof, UNDEFINED._replace(dual=0.0)
    for j in wrong[:1]:
        low, high = float(qp.lb[j]), float(qp.ub[j])
        proof.z_box[j] = -1.0 if low == np.inf else 1.0
        if np.isfinite((low, high)).all():
            proof.z_box[j] = 0.5 / (0.5 * low - 0.5 * high)
        return f"bounds of x[{j}] contradict each other: lb = {low}, ub = {high}", found
    for i in empty[:1]:
        proof.z[i] = 1.0
        return f"row {i} of G has h = -inf", found
    return None


def largest(*vectors):
    return max(float(np.abs(v).max(initial=0.0)) for v in vectors)
