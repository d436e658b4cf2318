"""Which constraints of a solved QP are active, and with a multiplier or without.

A constraint is strictly active if its multiplier is not 0, and weakly active if its
multiplier is 0 although it holds with equality; there the solution has a kink. The
sides (m + n,) of the rows of G and of the variables are 1 at h or ub, -1 at lb, 0 where
the constraint is not active: `strict` those of strictly active ones, `whole` of all.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import fabs, sqrt
from cython.cimports.namlcp.linalg.arrays import numbers, signs
from cython.cimports.namlcp.linalg.dense import add_times_transposed, times_rows
from cython.cimports.namlcp.linalg.vectors import dot, fill, largest_entry

from namlcp.linalg import add_transposed, times

# A multiplier counts as 0 if in no column of the stationarity condition its term
# exceeds this multiple of the largest term there; a slack counts as 0 up to this
# multiple of (1 + max |x|) times the norm of the row.
ACTIVE = 1e-8


def sides_of(qp, point):
    """Return the sides (2, m + n) int8, `strict` and `whole`, and the count of weak."""
    G, (x, y, z, z_box) = qp.G, point
    n: Py_ssize_t = x.size
    m: Py_ssize_t = z.size
    p: Py_ssize_t = y.size
    start = cython.declare(cython.p_double[12])
    step = cython.declare(Py_ssize_t[12])
    solved: Solved
    Gtz, Aty, entries = np.zeros(n), np.zeros(n), np.abs(G if qp.is_dense else G.data)
    add_transposed(G, z, Gtz)
    add_transposed(qp.A, y, Aty)
    size = np.abs((times(qp.P, x), qp.q, z_box, Gtz, Aty)).max(axis=0)
    np.divide(1.0, size, size, where=size > 0.0)
    if qp.is_dense:
        share, squares = (
            (entries * size).max(axis=1, initial=0.0),
            np.sum(G * G, axis=1),
        )
    else:
        share, squares = np.zeros(m), np.bincount(G.indices, entries * entries, m)
        np.maximum.at(share, G.indices, entries * np.repeat(size, np.diff(G.indptr)))
    sides, Gx = np.empty((2, m + n), np.int8), times(G, x)
    share, norms = z * share, np.sqrt(squares)
    strict = signs(sides, 2 * (m + n))
    arrays = None, qp.q, None, qp.h, None, qp.b, qp.lb, qp.ub
    locate((*arrays, *point), sizes_of(n, m, p), 1, start, step)
    solved.n, solved.m, solved.p = n, m, p
    set_solved(cython.address(solved), start, step, 0)
    return sides, mark(
        cython.address(solved), numbers(Gx, m), numbers(share, m), numbers(norms, m),
        numbers(size, n), strict, strict + m + n,
    )  # fmt: skip


def sides_of_lcp(q, lower, upper, slopes, z, w):
    """Return the sides (2, n) int8 of the unknowns of a solved LCP.

    `strict` is 0 where an unknown counts as free; `whole` counts unknowns at a bound
    with w = 0 as fixed, too. w_i is 0 up to ACTIVE times the largest term of (A z +
    q)_i, as far as these are known. z_i is at a bound with w_i != 0 if its distance is
    less than |w_i| over the slope of w_i in z_i.
    """
    n: Py_ssize_t = q.size
    sides = np.empty((2, n), dtype=np.int8)
    strict, cost, slope = signs(sides, 2 * n), numbers(q, n), numbers(slopes, n)
    l, u = numbers(lower, n), numbers(upper, n)
    x, v = numbers(z, n), numbers(w, n)
    for i in range(n):
        term = max(fabs(cost[i]), max(fabs(v[i] - cost[i]), fabs(slope[i] * x[i])))
        zero, near = ACTIVE * term, ACTIVE * (1.0 + fabs(x[i]))
        side: cython.int = 0
        if l[i] == u[i]:
            side = 1 if v[i] < 0.0 else -1
        elif v[i] < -zero and slope[i] * (u[i] - x[i]) < -v[i]:
            side = 1
        elif v[i] > zero and slope[i] * (x[i] - l[i]) < v[i]:
            side = -1
        strict[i] = side
        if side == 0:
            side = 1 if u[i] - x[i] <= near else (-1 if x[i] - l[i] <= near else 0)
        strict[n + i] = side
    return sides


def sizes_of(n, m, p):
    """Return how many numbers P, q, G, h, A, b, lb, ub, x, y, z and z_box have."""
    return n * n, n, m * n, m, p * n, p, n, n, n, p, m, n


def locate(arrays, sizes, count, start, step):
    """Find where arrays are that have `sizes` numbers for each one of `count` items.

    step: the numbers from item to item, 0 for an array that is that of all items. An
    absent array is nowhere.
    """
    for k in range(len(arrays)):
        start[k], step[k] = cython.NULL, 0
        if arrays[k] is not None:
            size: Py_ssize_t = sizes[k]
            if arrays[k].size != size:
                step[k] = size
                size *= count
            start[k] = numbers(arrays[k], size)
    return 0


def set_solved(qp, start, step, i):
    """Let qp be item i of the arrays that `locate` has found."""
    qp.P, qp.q = start[0] + i * step[0], start[1] + i * step[1]
    qp.G, qp.h = start[2] + i * step[2], start[3] + i * step[3]
    qp.A = start[4] + i * step[4]
    qp.lb, qp.ub = start[6] + i * step[6], start[7] + i * step[7]
    qp.x, qp.y = start[8] + i * step[8], start[9] + i * step[9]
    qp.z, qp.z_box = start[10] + i * step[10], start[11] + i * step[11]


def mark_dense(qp, work, strict, whole):
    """Set the sides; return how many constraints are weak. work: 4 (n + m) numbers."""
    n, m = qp.n, qp.m
    size, Gtz, Aty, Gx = work, work + n, work + 2 * n, work + 3 * n
    share, norms = Gx + m, Gx + 2 * m
    times_rows(qp.P, n, n, n, qp.x, size)
    times_rows(qp.G, m, n, n, qp.x, Gx)
    fill(Gtz, 0.0, 2 * n)
    add_times_transposed(qp.G, m, n, qp.z, Gtz)
    add_times_transposed(qp.A, qp.p, n, qp.y, Aty)
    for j in range(n):
        large = max(fabs(size[j]), max(fabs(qp.q[j]), fabs(qp.z_box[j])))
        large = max(large, max(fabs(Gtz[j]), fabs(Aty[j])))
        size[j] = 1.0 / large if large > 0.0 else 0.0
    for i in range(m):
        row, multiplier = qp.G + i * n, qp.z[i]
        norms[i], share[i] = sqrt(dot(row, row, n)), 0.0
        if multiplier > 0.0:
            for j in range(n):
                share[i] = max(share[i], multiplier * fabs(row[j]) * size[j])
                if share[i] > ACTIVE:
                    break
    return mark(qp, Gx, share, norms, size, strict, whole)


def mark(qp, Gx, share, norms, size, strict, whole):
    """Set the sides; return how many constraints are weak.

    A pinned variable (lb_j = ub_j) always counts as strictly active, at the bound that
    its multiplier presses on. share: a number that exceeds ACTIVE where z_i does not
    count as 0; norms: of the rows of G; size: the inverse of the
    largest term of each column of the stationarity condition, or 0.
    """
    n, m = qp.n, qp.m
    weak: Py_ssize_t = 0
    near = ACTIVE * (1.0 + largest_entry(qp.x, n))
    for i in range(m):
        strict[i] = share[i] > ACTIVE
        whole[i] = strict[i] or qp.h[i] - Gx[i] <= near * norms[i]
        weak += whole[i] - strict[i]
    for j in range(n):
        side: cython.schar = 0
        if fabs(qp.z_box[j]) * size[j] > ACTIVE or qp.lb[j] == qp.ub[j]:
            side = 1 if qp.z_box[j] > 0.0 else -1
        strict[m + j] = side
        if side == 0:
            if qp.ub[j] - qp.x[j] <= near:
                side = 1
            elif qp.x[j] - qp.lb[j] <= near:
                side = -1
            weak += side != 0
        whole[m + j] = side
    return weak
