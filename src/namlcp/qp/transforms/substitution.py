"""Substitution of free columns.

Modelling languages give every residual of a least-squares cost a variable of its own.
A column t without bounds that has the cost p t^2/2 + q_t t, p >= 0, and one entry a_it,
in row i of A, is eliminated together with that row:

    t = (b_i - a_i'x) / a_it,  y_i = -(p t + q_t) / a_it,
    P + (p/a_it^2) a_i a_i',   q - (p b_i/a_it + q_t) / a_it a_i

y_i follows from stationarity in t. A column is substituted only where the products
a_i a_i' do not fill P.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array

from namlcp.limits import NEVER, PASS, Deadline
from namlcp.linalg import (
    add_transposed,
    submatrix,
    times,
    with_squares,
    without_zeros,
)
from namlcp.qp.convexity import check_convex
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point

# Least |a_it|, relative to the largest entry of its row, against rounding errors.
PIVOT = 1e-3
# Most entries that the products a_i a_i' may add to P, for each entry of the rows that
# they replace, and in addition.
FILL, SMALL = 4, 1000
# Most entries of a_i for which a_i a_i' has no more than the removed row and column.
SHORT = 2


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
    def problem(self) -> QP:
        """The smaller QP."""
        user, kept = self.user, self.kept
        q = user.q[kept]
        slope = self.cost * user.b[self.by] / self.pivot + user.q[self.columns]
        add_transposed(self.rest, -slope / self.pivot, q)
        b, lb, ub = user.b[self.others], user.lb[kept], user.ub[kept]
        return QP(self.P, q, self.G, user.h, self.A, b, lb, ub)

    def fits(self, qp: QP) -> bool:
        """Tell whether the QP has the same matrices and the same infinite bounds."""
        user = self.user
        return (
            qp.has_matrices_of(user)
            and np.array_equal(np.isinf(qp.lb), np.isinf(user.lb))
            and np.array_equal(np.isinf(qp.ub), np.isinf(user.ub))
        )

    def point(
        self, x: np.ndarray, y: np.ndarray, z: np.ndarray, z_box: np.ndarray
    ) -> Point:
        """Return the user's point."""
        user, x = self.user, self.primal(x)
        y, z = self.certificate(y, z)
        gradient = self.cost * x[self.columns] + user.q[self.columns]
        y[self.by] = -gradient / self.pivot
        full = np.zeros(user.q.size)
        full[self.kept] = z_box
        return Point(x, y, z, full)

    def primal(self, x: np.ndarray) -> np.ndarray:
        """Return the user's x."""
        full = self.ray(x)
        full[self.columns] += self.user.b[self.by] / self.pivot
        return full

    def certificate(self, y: np.ndarray, z: np.ndarray) -> tuple[Any, Any]:
        """Return the user's (y, z) with y = 0 at the rows substituted."""
        full = np.zeros(self.user.b.size)
        full[self.others] = y
        return full, z

    def ray(self, d: np.ndarray) -> np.ndarray:
        """Return the user's direction of x."""
        full = np.empty(self.user.q.size)
        full[self.kept] = d
        full[self.columns] = -times(self.rest, d) / self.pivot
        return full

    def guess(self, guess: Guess) -> Guess:
        """Return a guess for the smaller QP."""
        if not guess.x.size:
            return guess
        m, n, kept = self.user.h.size, self.user.q.size, self.kept
        at_row, at_lb, at_ub = np.split(guess.active, (m, m + n))
        active = np.concatenate((at_row, at_lb[kept], at_ub[kept]))
        return Guess(
            guess.x[kept], guess.y[self.others], guess.z, guess.z_box[kept], active
        )


def substitute(
    qp: QP, last: Substitution | None = None, deadline: Deadline = NEVER
) -> Substitution | None:
    """Return the smaller QP of a sparse one, None if nothing can be substituted.

    None, too, if lb > ub. The matrices of `last` are reused if qp has the same matrices
    and the same infinite bounds. Raises OutOfTime.
    """
    if last is not None and last.fits(qp):
        return last._replace(user=qp)
    free = ((qp.lb == -np.inf) & (qp.ub == np.inf)).nonzero()[0]
    if not (free.size and qp.b.size):
        return None
    deadline.check(PASS * qp.A.nnz)
    P, G, A = (without_zeros(M) for M in (qp.P, qp.G, qp.A))
    columns, by, pivot, cost = free_columns(free, P, G, A)
    if not (columns.size and (qp.lb <= qp.ub).all()):
        return None
    deadline.check(PASS * qp.A.nnz)
    kept = np.delete(np.arange(qp.q.size), columns)
    others = np.delete(np.arange(qp.b.size), by)
    rest = submatrix(A, by, kept)
    # the squares added below would hide negative curvature
    check_convex(qp.P, deadline)
    deadline.check()
    P = with_squares(submatrix(P, kept, kept), rest, cost / pivot**2, deadline)
    G, A = submatrix(G, np.arange(qp.h.size), kept), submatrix(A, others, kept)
    return Substitution(qp, kept, columns, by, pivot, cost, others, rest, P, G, A)


def free_columns(free: np.ndarray, P: csc_array, G: csc_array, A: csc_array) -> Any:
    """Choose columns to substitute; return them, their rows in A, a_it and p.

    They are those of the unbounded ones, `free`, without entries in G, with one entry
    in A and none in P but a diagonal one, p >= 0. Each row of A, in rising order,
    substitutes one column at most, the one with the largest entry.
    """
    in_A, in_G, in_P = (np.diff(M.indptr)[free] for M in (A, G, P))
    fits = (in_A == 1) & (in_G == 0) & (in_P <= 1)
    columns, own = free[fits], in_P[fits] == 1
    cost = np.zeros(columns.size)
    at = P.indptr[columns[own]]
    cost[own] = np.where(P.indices[at] == columns[own], P.data[at], -1.0)
    columns, cost = columns[cost >= 0.0], cost[cost >= 0.0]
    at = A.indptr[columns]
    by, size = A.indices[at], np.abs(A.data[at])
    order = np.lexsort((-columns, size, by))  # the last one of each row is the largest
    order = order[np.append(by[order][1:] != by[order][:-1], True)[: order.size]]
    largest = np.zeros(A.shape[0])
    np.maximum.at(largest, A.indices, np.abs(A.data))
    order = order[size[order] >= PIVOT * largest[by[order]]]
    columns, by, pivot, cost = columns[order], by[order], A.data[at[order]], cost[order]
    stays = stays_sparse(A, by, cost)
    return columns[stays], by[stays], pivot[stays], cost[stays]


def stays_sparse(A: csc_array, by: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """Tell which rows can substitute without that their squares fill P.

    If the squares of all rows with p > 0 fill P, only the short ones of them can.
    """
    length = np.bincount(A.indices, minlength=A.shape[0])[by] - 1
    lengths = length[cost > 0.0].astype(float)
    width = float(np.count_nonzero(np.diff(A.indptr)) - lengths.size)
    if min((lengths**2).sum(), width**2) <= FILL * lengths.sum() + SMALL:
        return np.ones(by.size, np.bool_)
    return (cost == 0.0) | (length <= SHORT)
