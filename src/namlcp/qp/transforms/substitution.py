"""Substitution of free columns.

Modelling languages give every residual of a least-squares cost a variable of its own.
A column t without bounds that has the cost p t^2/2 + q_t t, p >= 0, and one entry a_it,
in row i of A, is eliminated together with that row:

    t = (b_i - a_i'x) / a_it,  y_i = -(p t + q_t) / a_it,
    P + (p/a_it^2) a_i a_i',   q - (p b_i/a_it + q_t) / a_it a_i

y_i follows from stationarity in t. A column is substituted only where the products
a_i a_i' do not fill P.
"""

from typing import NamedTuple

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs
from cython.cimports.namlcp.linalg.arrays import numbers
from cython.cimports.namlcp.linalg.csc import Columns, take_columns
from scipy.sparse import csc_array

from namlcp.entries import constant
from namlcp.limits import NEVER, PASS
from namlcp.linalg.csc import (
    add_transposed,
    submatrix,
    times,
    with_squares,
    without_zeros,
)
from namlcp.qp.problem import QP, Guess, Point, check_convex

# Least |a_it|, relative to the largest entry of its row, against rounding errors.
PIVOT = 1e-3
# FILL, SMALL: most entries that the products a_i a_i' may add to P, for each entry of
# the rows that they replace, and in addition. SHORT: most entries of a_i for which
# a_i a_i' has no more than the removed row and column. NO_ENTRY, SEVERAL: what
# `only_entry` returns where there is no entry, or more than one.


class Substitution(NamedTuple):
    """The smaller QP and the way back to `user`, the QP before.

    The free `columns` are substituted by the rows `by` of A; a_it is `pivot`, p is
    `cost`, and `rest` is A[by, kept]. The columns `kept` and the rows `others` of A
    remain.
    """

    user: QP
    kept: np.ndarray
    columns: np.ndarray
    by: np.ndarray
    pivot: np.ndarray
    cost: np.ndarray
    others: np.ndarray
    rest: csc_array
    P: csc_array
    G: csc_array
    A: csc_array

    @property
    def problem(self):
        user, kept = self.user, self.kept
        q = user.q[kept]
        slope = self.cost * user.b[self.by] / self.pivot + user.q[self.columns]
        add_transposed(self.rest, -slope / self.pivot, q)
        b, lb, ub = user.b[self.others], user.lb[kept], user.ub[kept]
        return QP(self.P, q, self.G, user.h, self.A, b, lb, ub)

    def point(self, x, y, z, z_box, data=1.0):
        user, by, columns = self.user, self.by, self.columns
        x_full, y_full, _, box = user.point()
        x_full[self.kept], y_full[self.others], box[self.kept] = x, y, z_box
        x_full[columns] = data * user.b[by] / self.pivot
        x_full[columns] -= times(self.rest, x) / self.pivot
        gradient = self.cost * x_full[columns] + data * user.q[columns]
        y_full[by] = -gradient / self.pivot
        return Point(x_full, y_full, z, box)

    def guess(self, guess):
        if not guess.x.size:
            return guess
        m, n, kept = self.user.h.size, self.user.q.size, self.kept
        at_row, at_lb, at_ub = np.split(guess.active, (m, m + n))
        active = np.concatenate((at_row, at_lb[kept], at_ub[kept]))
        return Guess(
            guess.x[kept], guess.y[self.others], guess.z, guess.z_box[kept], active
        )


def substitute(qp, last=None, deadline=NEVER):
    """Return the smaller QP of a sparse one, None if nothing can be substituted.

    None, too, if lb > ub. The matrices of `last` are reused if qp has the same matrices
    and the same infinite bounds. Raises OutOfTime.
    """
    if last is not None and (
        qp.has_matrices_of(last.user)
        and np.array_equal(np.isinf(qp.lb), np.isinf(last.user.lb))
        and np.array_equal(np.isinf(qp.ub), np.isinf(last.user.ub))
    ):
        return last._replace(user=qp)
    deadline.check(PASS * qp.A.data.size)
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    chosen, (pivot, cost, work) = np.empty(p, dtype=np.int32), np.empty((3, p))
    find_free_columns(qp, chosen, pivot, cost, work)
    by = (chosen >= 0).nonzero()[0]
    if not by.size or not (qp.lb <= qp.ub).all():
        return None
    deadline.check(PASS * qp.A.data.size)
    others, columns = (chosen < 0).nonzero()[0], chosen[by]
    pivot, cost = pivot[by], cost[by]
    stays = constant(n, True, np.bool_)
    stays[columns] = False
    kept = stays.nonzero()[0]
    P, G, A = (without_zeros(M) for M in (qp.P, qp.G, qp.A))
    rest = submatrix(A, by, kept)
    # the squares added below would hide negative curvature
    check_convex(qp.P, deadline)
    deadline.check()
    priced = cost.nonzero()[0]
    squared = submatrix(rest, priced, np.arange(kept.size))
    weight = cost[priced] / pivot[priced] ** 2
    P = with_squares(submatrix(P, kept, kept), squared, weight, deadline)
    return Substitution(
        qp, kept, columns, by, pivot, cost, others, rest,
        P, submatrix(G, np.arange(m), kept), submatrix(A, others, kept),
    )  # fmt: skip


def find_free_columns(qp, chosen, pivot, cost, largest):
    """Choose free columns to substitute.

    Free is a column without bounds (lb, ub) and without entries in G, with one entry in
    A and none in P but a diagonal one, p >= 0. Row i of A substitutes column chosen[i],
    the one with the largest entry, or none where that is -1; pivot and cost take the
    entry and p. All these (p,) are overwritten.
    """
    P: Columns
    G: Columns
    A: Columns
    n: Py_ssize_t = qp.q.size
    some: cython.bint = False
    take_columns(qp.P, n, cython.address(P))
    take_columns(qp.G, n, cython.address(G))
    take_columns(qp.A, n, cython.address(A))
    lb, ub = numbers(qp.lb, n), numbers(qp.ub, n)
    for i in range(chosen.shape[0]):
        chosen[i] = -1
        pivot[i], cost[i], largest[i] = 0.0, 0.0, 0.0
    for j in range(n):
        if lb[j] > -INFINITY or ub[j] < INFINITY:
            continue
        t = only_entry(cython.address(A), j)
        if t < 0 or only_entry(cython.address(G), j) != NO_ENTRY:
            continue
        i = A.indices[t]
        s = only_entry(cython.address(P), j)
        if s == SEVERAL or (s >= 0 and (P.indices[s] != j or P.data[s] < 0.0)):
            continue
        if fabs(A.data[t]) > fabs(pivot[i]):
            chosen[i], pivot[i] = j, A.data[t]
            cost[i] = P.data[s] if s >= 0 else 0.0
            some = True
    if some:
        for t in range(A.indptr[n]):
            i = A.indices[t]
            largest[i] = max(largest[i], fabs(A.data[t]))
        for i in range(chosen.shape[0]):
            if fabs(pivot[i]) < PIVOT * largest[i]:
                chosen[i], cost[i] = -1, 0.0
        drop_filling_rows(cython.address(A), n, chosen, cost)
    return 0


def only_entry(C, j):
    """Return the position of the only nonzero entry in column j."""
    found: Py_ssize_t = NO_ENTRY
    for t in range(C.indptr[j], C.indptr[j + 1]):
        if C.data[t] != 0.0:
            if found != NO_ENTRY:
                return SEVERAL
            found = t
    return found


def drop_filling_rows(A, n, chosen, cost):
    """If the squares of all rows with p > 0 fill P, set chosen[i] = -1 in long ones."""
    rows = chosen.shape[0]
    count: cython.longlong[::1] = np.zeros(rows, np.longlong)
    lengths: cython.longlong = 0
    squares: cython.longlong = 0
    width: cython.longlong = 0
    for j in range(n):
        is_met: cython.bint = False
        for t in range(A.indptr[j], A.indptr[j + 1]):
            if A.data[t] != 0.0 and cost[A.indices[t]] > 0.0:
                count[A.indices[t]] += 1
                is_met = True
        width += is_met
    for i in range(rows):
        if cost[i] > 0.0:
            length = count[i] - 1
            lengths += length
            squares += length * length
            width -= 1  # the column that goes
    if min(squares, width * width) > FILL * lengths + SMALL:
        for i in range(rows):
            if count[i] - 1 > SHORT:
                chosen[i] = -1
    return 0
