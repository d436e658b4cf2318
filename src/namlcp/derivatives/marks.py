"""Which constraints of a solved QP are active, and with a multiplier or without.

A constraint is strictly active if its multiplier is not 0, and weakly active if its
multiplier is 0 although it holds with equality; there the solution has a kink. The
sides of constraints are 1 for a row and at ub, -1 at lb, 0 where the constraint is not
active: `strict` those of strictly active ones, `whole` of all. A pinned variable (lb_j
= ub_j) always counts as strictly active, at the bound that its multiplier presses on.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import fabs
from cython.cimports.namlcp.linalg.arrays import numbers, signs
from cython.cimports.namlcp.linalg.vectors import largest_entry
from cython.cimports.namlcp.measure import Terms, set_terms

from namlcp.checks import as_sparse
from namlcp.linalg.csc import add_transposed, times

# A multiplier counts as 0 if in no column of the stationarity condition its term
# exceeds this multiple of the largest term there; a slack counts as 0 up to this
# multiple of (1 + max |x|) times the norm of the row.
ACTIVE = 1e-8


def sides_of(qp, point):
    """Return `strict` and `whole` (p + m + n,), and how many constraints are weak.

    These are the sides of the rows of A, of those of G, and of the variables.
    """
    t: Terms
    (P, q, _, h, A, b, lb, ub), (x, y, z, z_box) = qp, point
    set_terms(cython.address(t), (q, h, b, lb, ub), tuple(point))
    n, m, p, G = t.n, t.m, t.p, as_sparse(qp.G)
    Gtz, Aty = np.zeros((2, n))
    add_transposed(qp.G, z, Gtz)
    add_transposed(A, y, Aty)
    size = np.abs((times(P, x), q, z_box, Gtz, Aty)).max(axis=0)
    np.divide(1.0, size, size, where=size > 0.0)
    entries, share = np.abs(G.data), np.zeros(m)
    np.maximum.at(share, G.indices, entries * np.repeat(size, np.diff(G.indptr)))
    share *= z
    norms, Gx = np.sqrt(np.bincount(G.indices, entries * entries, m)), times(qp.G, x)
    sides = np.ones((2, p + m + n), np.int8)
    strict = signs(sides, 2 * (p + m + n)) + p
    t.Gx = numbers(Gx, m)
    weak = mark(
        cython.address(t), numbers(share, m), numbers(norms, m), numbers(size, n),
        strict, strict + p + m + n,
    )  # fmt: skip
    return *sides, weak


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


def mark(t, share, norms, size, strict, whole):
    """Set the sides; return how many constraints are weak.

    share: a number that exceeds ACTIVE where z_i does not
    count as 0; norms: of the rows of G; size: the inverse of the
    largest term of each column of the stationarity condition, or 0.
    """
    n, m = t.n, t.m
    weak: Py_ssize_t = 0
    near = ACTIVE * (1.0 + largest_entry(t.x, n))
    for i in range(m):
        strict[i] = share[i] > ACTIVE
        whole[i] = strict[i] or t.h[i] - t.Gx[i] <= near * norms[i]
        weak += whole[i] - strict[i]
    for j in range(n):
        side: cython.schar = 0
        if fabs(t.z_box[j]) * size[j] > ACTIVE or t.lb[j] == t.ub[j]:
            side = 1 if t.z_box[j] > 0.0 else -1
        strict[m + j] = side
        if side == 0:
            if t.ub[j] - t.x[j] <= near:
                side = 1
            elif t.x[j] - t.lb[j] <= near:
                side = -1
            weak += side != 0
        whole[m + j] = side
    return weak
