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
from cython.cimports.namlcp.linalg.csc import (
    Columns,
    columns_times,
    columns_times_transposed,
    take_columns,
)
from cython.cimports.namlcp.linalg.dense import add_times_transposed, times_rows
from cython.cimports.namlcp.linalg.vectors import dot, fill, largest_entry

# A multiplier counts as 0 if in no column of the stationarity condition its term
# exceeds this multiple of the largest term there; a slack counts as 0 up to this
# multiple of (1 + max |x|) times the norm of the row.
ACTIVE = 1e-8


def sides_of(qp, point):
    """Return the sides (2, m + n) int8, `strict` and `whole`, and the count of weak."""
    n: Py_ssize_t = qp.q.size
    m: Py_ssize_t = qp.h.size
    p: Py_ssize_t = qp.b.size
    start = cython.declare(cython.p_double[12])
    step = cython.declare(Py_ssize_t[12])
    solved: Solved
    P: Columns
    G: Columns
    A: Columns
    sides, work = np.empty((2, m + n), dtype=np.int8), np.empty(4 * (m + n))
    strict, room = signs(sides, 2 * (m + n)), numbers(work, 4 * (m + n))
    whole = strict + m + n
    solved.n, solved.m, solved.p = n, m, p
    is_dense: cython.bint = qp.is_dense
    matrices = (qp.P, qp.G, qp.A) if is_dense else (None, None, None)
    arrays = matrices[0], qp.q, matrices[1], qp.h, matrices[2], qp.b, qp.lb, qp.ub
    locate((*arrays, *point), sizes_of(n, m, p), 1, start, step)
    set_solved(cython.address(solved), start, step, 0)
    if is_dense:
        return sides, mark_dense(cython.address(solved), room, strict, whole)
    take_columns(qp.P, n, cython.address(P))
    take_columns(qp.G, n, cython.address(G))
    take_columns(qp.A, n, cython.address(A))
    return sides, mark_sparse(
        cython.address(solved), cython.address(P), cython.address(G),
        cython.address(A), room, strict, whole,
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
    set_sizes(qp, Gtz, Aty, size)
    for i in range(m):
        row, multiplier = qp.G + i * n, qp.z[i]
        norms[i], share[i] = sqrt(dot(row, row, n)), 0.0
        if multiplier > 0.0:
            for j in range(n):
                share[i] = max(share[i], multiplier * fabs(row[j]) * size[j])
                if share[i] > ACTIVE:
                    break
    return mark(qp, Gx, share, norms, size, strict, whole)


def mark_sparse(qp, P, G, A, work, strict, whole):
    """Do as `mark_dense` for matrices in CSC."""
    n, m = qp.n, qp.m
    size, Gtz, Aty, Gx = work, work + n, work + 2 * n, work + 3 * n
    share, norms = Gx + m, Gx + 2 * m
    fill(work, 0.0, 3 * (n + m))
    columns_times(P, n, qp.x, size)
    columns_times(G, n, qp.x, Gx)
    columns_times_transposed(G, n, qp.z, Gtz)
    columns_times_transposed(A, n, qp.y, Aty)
    set_sizes(qp, Gtz, Aty, size)
    for j in range(n):
        for t in range(G.indptr[j], G.indptr[j + 1]):
            i, entry = G.indices[t], fabs(G.data[t])
            norms[i] += entry * entry
            share[i] = max(share[i], qp.z[i] * entry * size[j])
    for i in range(m):
        norms[i] = sqrt(norms[i])
    return mark(qp, Gx, share, norms, size, strict, whole)


def set_sizes(qp, Gtz, Aty, size):
    """Overwrite size, P x, by the inverse of the largest term of each column, or 0."""
    for j in range(qp.n):
        large = max(fabs(size[j]), max(fabs(qp.q[j]), fabs(qp.z_box[j])))
        large = max(large, max(fabs(Gtz[j]), fabs(Aty[j])))
        size[j] = 1.0 / large if large > 0.0 else 0.0


def mark(qp, Gx, share, norms, size, strict, whole):
    """Set the sides; return how many constraints are weak.

    A pinned variable (lb_j = ub_j) always counts as strictly active, at the bound that
    its multiplier presses on. share: a number that exceeds ACTIVE where z_i does not
    count as 0; norms: of the rows of G; size: the result of `set_sizes`.
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
