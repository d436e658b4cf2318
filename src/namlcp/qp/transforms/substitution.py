"""Substitution: rows with one entry become bounds, free columns are eliminated.

Modelling languages give every residual of a least-squares cost a variable of its own,
and write every bound as a row. Both are reversed here:

    row g x_j <= h of G                 bound of x_j, its z is z_box_j / g
    row a x_j = b of A                  lb_j = ub_j = b / a, its y is z_box_j / a
    free column t with the cost         t = (b_i - a_i'x) / a_it,
    p t^2/2 + q_t t, p >= 0, and one      y_i = -(p t + q_t) / a_it,
    entry a_it, in row i of A           P + (p/a_it^2) a_i a_i',
                                        q - (p b_i/a_it + q_t) / a_it a_i

The multipliers follow from stationarity in x_j and in t. A column is substituted only
where the products a_i a_i' do not fill P.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array

from namlcp.compiled import kernel
from namlcp.limits import NEVER, Deadline
from namlcp.linalg import add_transposed, submatrix, times, with_squares, without_zeros
from namlcp.qp.convexity import check_convex
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point

# Least |a_it|, relative to the largest entry of its row, against rounding errors.
PIVOT = 1e-3
# Most entries that the products a_i a_i' may add to P: for each entry of the rows that
# they replace, and in addition.
FILL, SMALL = 4, 1000
# Most entries of a_i for which a_i a_i' has no more than the removed row and column.
SHORT = 2


class Givers(NamedTuple):
    """Rows of [G; A] that became bounds, -1 where the bound is the user's; entries."""

    rows: np.ndarray
    entry: np.ndarray


class TightBounds(NamedTuple):
    """Bounds and the rows that gave them."""

    lb: np.ndarray
    ub: np.ndarray
    lower: Givers
    upper: Givers


class RowBounds(NamedTuple):
    """Bounds with those from rows; `rows` of G and `equations` of A that are left.

    infinite (2, n) tells where lb = -inf and where ub = +inf.
    """

    tight: TightBounds
    rows: np.ndarray
    equations: np.ndarray
    infinite: np.ndarray

    def is_like(self, other: "RowBounds") -> bool:
        """Tell whether the same rows are left and the same bounds are infinite."""
        return all(map(np.array_equal, self[1:], other[1:]))


class Substitution(NamedTuple):
    """The smaller QP and the way back to `user`, the QP before.

    The free `columns` are substituted by the rows `by` of A; a_it is `pivot`, p is
    `cost`, and `rest` is A[by, kept]. The columns `kept` and the rows `others` of A
    remain.
    """

    user: QP
    bounds: RowBounds
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
        if self.columns.size:
            slope = self.cost * user.b[self.by] / self.pivot + user.q[self.columns]
            add_transposed(self.rest, -slope / self.pivot, q)
        h, b = user.h[self.bounds.rows], user.b[self.others]
        lb, ub = (bound[kept] for bound in self.bounds.tight[:2])
        return QP(self.P, q, self.G, h, self.A, b, lb, ub)

    def point(self, point: Point) -> Point:
        """Return the user's point."""
        x = self.ray(point.x)
        x[self.columns] += self.user.b[self.by] / self.pivot
        _, y, z, z_box = self.certificate(point)
        gradient = self.cost * x[self.columns] + self.user.q[self.columns]
        y[self.by] = -gradient / self.pivot
        return Point(x, y, z, z_box)

    def certificate(self, point: Point) -> Point:
        """Return the user's (NaN, y, z, z_box) with y = 0 at the rows substituted."""
        n, m = self.user.q.size, self.user.h.size
        rows = np.zeros(m + self.user.b.size)
        rows[self.bounds.rows] = point.z
        rows[m + self.others] = point.y
        z_box = np.zeros(n)
        z_box[self.kept] = point.z_box
        for givers, sign in zip(self.bounds.tight[2:], (-1.0, 1.0), strict=True):
            at = np.flatnonzero((givers.rows >= 0) & (sign * z_box > 0.0))
            rows[givers.rows[at]] = z_box[at] / givers.entry[at]
            z_box[at] = 0.0
        return Point(np.full(n, np.nan), rows[m:], rows[:m], z_box)

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
        m, n = self.user.h.size, self.user.q.size
        at_row, at_lb, at_ub = np.split(guess.active.copy(), (m, m + n))
        row_active = np.concatenate((at_row, np.ones(guess.y.size, at_row.dtype)))
        multiplier = np.concatenate((guess.z, guess.y))
        _, _, lower, upper = self.bounds.tight
        z_box = guess.z_box.copy()
        for givers, active in ((lower, at_lb), (upper, at_ub)):
            at = np.flatnonzero(givers.rows >= 0)
            active[at] = row_active[givers.rows[at]]
            if givers is upper:  # an equation that gives both bounds counts once
                at = at[upper.rows[at] != lower.rows[at]]
            z_box[at] += multiplier[givers.rows[at]] * givers.entry[at]
        rows, kept = self.bounds.rows, self.kept
        return Guess(
            guess.x[kept],
            guess.y[self.others],
            guess.z[rows],
            z_box[kept],
            np.concatenate((at_row[rows], at_lb[kept], at_ub[kept])),
        )


def substitute(
    qp: QP, last: Substitution | None = None, deadline: Deadline = NEVER
) -> Substitution | None:
    """Return the smaller QP of a sparse one, None if nothing can be substituted.

    None, too, if lb > ub or after the deadline. The matrices of `last` are reused if qp
    has the same matrices and the same rows become bounds.
    """
    if not (qp.lb <= qp.ub).all():
        return None
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    G, A = without_zeros(qp.G), without_zeros(qp.A)
    bounds = bounds_from_rows(qp, G, A)
    if last is not None and qp.has_matrices_of(last.user):
        if bounds.is_like(last.bounds):
            return last._replace(user=qp, bounds=bounds)
    P = without_zeros(qp.P)
    columns, by, pivot, cost, others = free_columns(P, G, A, bounds)
    if bounds.rows.size == m and others.size == p:
        return None
    kept = np.delete(np.arange(n), columns)
    rest = submatrix(A, by, kept)
    if columns.size:
        check_convex(qp.P)  # the squares added below would hide negative curvature
        if deadline.reached():
            return None
        P = with_squares(submatrix(P, kept, kept), rest, cost / pivot**2, deadline)
        if P is None:
            return None
    return Substitution(
        qp, bounds, kept, columns, by, pivot, cost, others, rest,
        P, submatrix(G, bounds.rows, kept), submatrix(A, others, kept),
    )  # fmt: skip


def bounds_from_rows(qp: QP, G: csc_array, A: csc_array) -> RowBounds:
    """Turn rows into bounds; rows that clash with bounds stay, for certificates."""
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    lower, upper = (Givers(np.full(n, -1), np.ones(n)) for _ in range(2))
    tight = TightBounds(qp.lb.copy(), qp.ub.copy(), lower, upper)
    rows, equations = np.ones(m, dtype=np.bool_), np.ones(p, dtype=np.bool_)
    tighten(G.indptr, G.indices, G.data, qp.h, 0, False, tight, rows)
    tighten(A.indptr, A.indices, A.data, qp.b, m, True, tight, equations)
    clash = tight.lb > tight.ub
    if clash.any():
        tight.lb[clash], tight.ub[clash] = qp.lb[clash], qp.ub[clash]
        lower.rows[clash] = upper.rows[clash] = -1
        rows[G[:, clash].indices] = equations[A[:, clash].indices] = True
    infinite = np.isinf(tight[:2])
    return RowBounds(tight, np.flatnonzero(rows), np.flatnonzero(equations), infinite)


@kernel
def tighten(indptr, indices, data, side, first, is_equal, tight, left):
    """Tighten the bounds by the rows, of a CSC matrix, with one entry.

    `side` has the right-hand sides; row i has number first + i in [G; A]. `tight`, a
    TightBounds, is overwritten; left[i] becomes False for these rows. Rows with an
    infinite side are skipped.
    """
    lb, ub, lower, upper = tight
    entries = np.zeros(side.size, dtype=np.int32)
    for i in indices:
        entries[i] += 1
    for j in range(lb.size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if entries[i] != 1 or np.isinf(side[i]):
                continue
            left[i] = False
            value = side[i] / data[t]
            if (is_equal or data[t] > 0.0) and value < ub[j]:
                ub[j] = value
                upper.rows[j], upper.entry[j] = first + i, data[t]
            if (is_equal or data[t] < 0.0) and value > lb[j]:
                lb[j] = value
                lower.rows[j], lower.entry[j] = first + i, data[t]


def free_columns(
    P: csc_array, G: csc_array, A: csc_array, bounds: RowBounds
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (columns, by, pivot, cost, others) of the substitution.

    A row substitutes at most one column, that with the largest entry.
    """
    diagonal = P.diagonal()
    is_free = (
        (np.diff(A.indptr) == 1)
        & (np.diff(G.indptr) == 0)
        & bounds.infinite.all(axis=0)
        & (diagonal >= 0.0)
        & (np.diff(P.indptr) == (diagonal != 0.0))
    )
    columns = np.flatnonzero(is_free)
    at = A.indptr[columns]
    row, entry = A.indices[at].astype(np.intp), A.data[at]
    size = np.zeros(A.shape[0])
    np.maximum.at(size, A.indices, np.abs(A.data))
    usable = np.zeros(size.size, dtype=bool)
    usable[bounds.equations] = True
    order = np.flatnonzero(usable[row] & (np.abs(entry) >= PIVOT * size[row]))
    order = order[np.argsort(-np.abs(entry[order]), kind="stable")]
    order = order[np.unique(row[order], return_index=True)[1]]
    order = order[worth_it(A, row[order], diagonal[columns[order]] > 0.0)]
    columns, row, entry = columns[order], row[order], entry[order]
    usable[row] = False
    return columns, row, entry, diagonal[columns], np.flatnonzero(usable)


def worth_it(A: csc_array, row: np.ndarray, squared: np.ndarray) -> np.ndarray:
    """Tell which rows to substitute: all, or, if their squares would fill P, some.

    Those are the rows that need no square (p = 0) and the short ones.
    """
    length = np.bincount(A.indices, minlength=A.shape[0])[row] - 1
    lengths = length[squared]  # of the rows whose squares are added to P
    touched = np.zeros(A.shape[0], dtype=bool)
    touched[row[squared]] = True
    width = count_columns(A.indptr, A.indices, touched) - lengths.size
    if min((lengths**2).sum(), width**2) <= FILL * lengths.sum() + SMALL:
        return np.ones(row.size, dtype=bool)
    return ~squared | (length <= SHORT)


@kernel
def count_columns(indptr, indices, touched):
    """Count the columns with an entry in a touched row."""
    count = 0
    for j in range(indptr.size - 1):
        for t in range(indptr[j], indptr[j + 1]):
            if touched[indices[t]]:
                count += 1
                break
    return count
