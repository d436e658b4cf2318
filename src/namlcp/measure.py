"""The sums of the residuals of a QP: `namlcp.residuals` has their definition.

All that measures a point comes here: the judge of a solve with the user's matrices, and
the active-set method with the products it has at hand.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, NAN, fabs, isinf, sqrt


def measure(t, found):
    """Set the numbers of `Residuals` from the terms, in one order of all sums.

    An infinite bound or right-hand side has no term in the gap, and the modulus of its
    multiplier is a dual residual.
    """
    primal, primal_size, dual, dual_size = 0.0, 0.0, 0.0, 0.0
    xPx, qx, by, hz, bounds = 0.0, 0.0, 0.0, 0.0, 0.0
    q, lb, ub, x, z_box = t.q, t.lb, t.ub, t.x, t.z_box
    Px, Gtz, Aty = t.Px, t.Gtz, t.Aty
    for j in range(t.n):
        primal = max(primal, max(lb[j] - x[j], x[j] - ub[j]))
        if lb[j] > -INFINITY or ub[j] < INFINITY:  # else no constraint limits x_j alone
            primal_size = max(primal_size, fabs(x[j]))
        rd = Px[j] + q[j] + Gtz[j] + Aty[j] + z_box[j]  # as qpsolvers adds it
        dual = max(dual, fabs(rd))
        dual_size = max(dual_size, max(fabs(Px[j]), fabs(q[j])))
        dual_size = max(dual_size, max(fabs(Gtz[j] + Aty[j]), fabs(z_box[j])))
        if rd != rd or x[j] != x[j]:
            dual = NAN
            break
        xPx += x[j] * Px[j]
        qx += q[j] * x[j]
        if z_box[j] != 0.0:
            bound = lb[j] if z_box[j] < 0.0 else ub[j]
            if isinf(bound):
                dual = max(dual, fabs(z_box[j]))
            else:
                bounds += bound * z_box[j]
    h, z, Gx = t.h, t.z, t.Gx
    for i in range(t.m):
        if Gx[i] != Gx[i] or z[i] != z[i]:
            dual = NAN
        primal = max(primal, Gx[i] - h[i])
        if not isinf(h[i]):
            # not |h_i|, which may be huge where the row is not active
            primal_size = max(primal_size, fabs(Gx[i]))
            hz += h[i] * z[i]
        else:
            dual = max(dual, fabs(z[i]))
        dual = max(dual, -z[i])
    b, y, Ax = t.b, t.y, t.Ax
    for i in range(t.p):
        if Ax[i] != Ax[i] or y[i] != y[i]:
            dual = NAN
        primal = max(primal, fabs(Ax[i] - b[i]))
        primal_size = max(primal_size, max(fabs(Ax[i]), fabs(b[i])))
        by += b[i] * y[i]
    found.primal, found.primal_size = primal, primal_size
    found.dual, found.dual_size = dual, dual_size
    found.gap = fabs(xPx + qx + by + hz + bounds)
    found.gap_size = max(
        max(fabs(xPx), fabs(qx)), max(fabs(by), max(fabs(hz), fabs(bounds)))
    )
    found.objective = 0.5 * xPx + qx


def gap_by_products(t):
    """Return x'Px + q'x + b'y + h'z + lb'z_box^- + ub'z_box^+ as qpsolvers adds it.

    An infinite side has no term. NumPy, and so qpsolvers, takes dot products from BLAS.
    """
    size = max(t.n, t.m)
    work = new_vector(2 * size)
    finite, beside = data_of(work), data_of(work) + size
    gap = blas_dot(t.x, t.Px, t.n) + blas_dot(t.q, t.x, t.n)
    gap += finite_dot(t.h, t.z, 0.0, t.m, finite, beside)
    gap += blas_dot(t.b, t.y, t.p)
    gap += finite_dot(t.lb, t.z_box, -1.0, t.n, finite, beside)
    gap += finite_dot(t.ub, t.z_box, 1.0, t.n, finite, beside)
    return gap


def finite_dot(sides, multipliers, sign, n, finite, beside):
    """Return the product of the finite sides with multipliers not opposed to `sign`."""
    count: Py_ssize_t = 0
    for i in range(n):
        if not isinf(sides[i]):
            finite[count] = sides[i]
            beside[count] = 0.0 if sign * multipliers[i] < 0.0 else multipliers[i]
            count += 1
    return blas_dot(finite, beside, count)


# ---- arrays of NumPy


def set_terms(t, qp, point):
    """Note the vectors of a QP and of a point with multipliers.

    Raises ValueError where these are not contiguous, or of other sizes.
    """
    _, q, _, h, _, b, lb, ub = qp
    x, y, z, z_box = point
    n, m, p = q.size, h.size, b.size
    t.n, t.m, t.p = n, m, p
    t.q, t.h, t.b = numbers(q, n), numbers(h, m), numbers(b, p)
    t.lb, t.ub = numbers(lb, n), numbers(ub, n)
    t.x, t.y, t.z = numbers(x, n), numbers(y, p), numbers(z, m)
    t.z_box = numbers(z_box, n)
    return 0


def residuals_of_products(qp, point, products):
    """Return the numbers of `Residuals`; products = (Px, Gx, Ax, G'z, A'y)."""
    t: Terms
    set_terms(cython.address(t), qp, point)
    Px, Gx, Ax, Gtz, Aty = products
    t.Px, t.Gx, t.Ax = numbers(Px, t.n), numbers(Gx, t.m), numbers(Ax, t.p)
    t.Gtz, t.Aty = numbers(Gtz, t.n), numbers(Aty, t.n)
    return in_order(cython.address(t))


def residuals_of_columns(qp, point):
    """Return the numbers of `Residuals` for P, G and A as csc_array or csc_matrix."""
    t: Terms
    M: Columns
    P, _, G, _, A, _, _, _ = qp
    set_terms(cython.address(t), qp, point)
    n, m, p = t.n, t.m, t.p
    work = new_vector(3 * n + m + p)
    t.Px = data_of(work)
    t.Gtz, t.Aty = t.Px + n, t.Px + 2 * n
    t.Gx = t.Px + 3 * n
    t.Ax = t.Gx + m
    fill(t.Px, 0.0, 3 * n + m + p)
    take_columns(P, n, cython.address(M))
    columns_times(cython.address(M), n, t.x, t.Px)
    if m > 0:
        take_columns(G, n, cython.address(M))
        columns_times(cython.address(M), n, t.x, t.Gx)
        columns_times_transposed(cython.address(M), n, t.z, t.Gtz)
    if p > 0:
        take_columns(A, n, cython.address(M))
        columns_times(cython.address(M), n, t.x, t.Ax)
        columns_times_transposed(cython.address(M), n, t.y, t.Aty)
    return in_order(cython.address(t))


def in_order(t):
    """Return the numbers, with the gap as qpsolvers adds it."""
    found: Numbers
    measure(t, cython.address(found))
    found.gap = fabs(gap_by_products(t))
    return (
        found.primal, found.dual, found.gap, found.primal_size, found.dual_size,
        found.gap_size, found.objective,
    )  # fmt: skip


def largest_ratio(found, eps_abs, eps_rel):
    """Return the largest of the three residuals over its tolerance, inf for a NaN.

    A point solves the QP where it is at most 1. `found` is as `Residuals`.
    """
    largest = 0.0
    for k in range(3):
        residual: cython.double = found[k]
        size: cython.double = found[k + 3]
        ratio = residual / (eps_abs + eps_rel * size) if residual != 0.0 else 0.0
        if not ratio < INFINITY:
            return INFINITY
        largest = max(largest, ratio)
    return largest


def signed_gap(qp, point, Px):
    """Return `gap_by_products` of a QP at a point."""
    t: Terms
    set_terms(cython.address(t), qp, point)
    t.Px = numbers(Px, t.n)
    return gap_by_products(cython.address(t))


def on_bounds(x, z_box, lb, ub, moves):
    """Return (x, z_box) with x in its bounds, and signs that these allow.

    moves: also, x_j is the bound that z_box_j holds it at, where that is no further
    than |z_box_j|, and z_box_j = 0 elsewhere.
    """
    n: Py_ssize_t = x.size
    old, box = numbers(x, n), numbers(z_box, n)
    low, high = numbers(lb, n), numbers(ub, n)
    point, multipliers = new_vector(n), new_vector(n)
    new, new_box = data_of(point), data_of(multipliers)
    for j in range(n):
        new[j], new_box[j] = old[j], box[j]
        if low[j] > high[j]:  # within the tolerance of both, as they have to be
            continue
        least = box[j] if low[j] > -INFINITY else 0.0
        most = box[j] if high[j] < INFINITY else 0.0
        new_box[j] = min(least, 0.0) + max(most, 0.0)
        new[j] = clip(old[j], low[j], high[j])
        if moves:
            if old[j] - low[j] <= -box[j]:
                new[j], new_box[j] = low[j], min(box[j], 0.0)
            elif high[j] - old[j] <= box[j]:
                new[j], new_box[j] = high[j], max(box[j], 0.0)
            else:
                new_box[j] = 0.0
    return point, multipliers


# ---- box LCPs


def natural_squares(z, w, lower, upper):
    """Return the sum of squares of z - clip(z - w, lower, upper)."""
    n: cython.Py_ssize_t = z.size
    a, b = numbers(z, n), numbers(w, n)
    l, u = numbers(lower, n), numbers(upper, n)
    total = 0.0
    with cython.nogil:
        for i in range(n):
            r = deviation(a[i], b[i], l[i], u[i])
            total += r * r
    return total


def natural_residuals(z, w, lower, upper, d):
    n: cython.Py_ssize_t = z.size
    a, b, unit = numbers(z, n), numbers(w, n), numbers(d, n)
    l, u = numbers(lower, n), numbers(upper, n)
    with cython.nogil:
        found = both_residuals(a, b, l, u, unit, n)
    return found


def both_residuals(z, w, lower, upper, d, n):
    """Return Res of this LCP, and of the one with z and bounds times d, w over d."""
    here, there = 0.0, 0.0
    for i in range(n):
        r = deviation(z[i], w[i], lower[i], upper[i])
        here += r * r
        r = deviation(d[i] * z[i], w[i] / d[i], lower[i] * d[i], upper[i] * d[i])
        there += r * r
    return sqrt(here), sqrt(there)


def are_met(eps_abs, eps_rel, size, plain, scaled):
    """Tell whether a point with these Res, as given and scaled, solves the problem.

    size: Res(clip(0)) of the problem scaled to a unit diagonal.
    """
    return plain < eps_abs or scaled <= eps_rel * size < INFINITY
