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

from namlcp.checks import no_rows
from namlcp.compiled import kernel, part
from namlcp.limits import NEVER, Deadline
from namlcp.linalg import (
    add_transposed,
    arrays_of,
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
# Most entries that the products a_i a_i' may add to P: for each entry of the rows that
# they replace, and in addition.
FILL, SMALL = 4, 1000
# Most entries of a_i for which a_i a_i' has no more than the removed row and column.
SHORT = 2
# What `only_entry` returns where there is no entry, or more than one.
NO_ENTRY, SEVERAL = -1, -2


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
    """Bounds with those from rows; `rows` of G and `equations` of A that are left."""

    tight: TightBounds
    rows: np.ndarray
    equations: np.ndarray

    def is_like(self, other: "RowBounds") -> bool:
        """Tell whether the same rows are left and the same bounds are infinite."""
        old = other.tight
        return (
            np.array_equal(self.rows, other.rows)
            and np.array_equal(self.equations, other.equations)
            and np.array_equal(np.isinf(self.tight.lb), np.isinf(old.lb))
            and np.array_equal(np.isinf(self.tight.ub), np.isinf(old.ub))
        )


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
        user, kept, q = self.user, self.kept, self.user.q
        h, b = user.h[self.bounds.rows], user.b[self.others]
        lb, ub = self.bounds.tight[:2]
        if self.columns.size:
            q, lb, ub = q[kept], lb[kept], ub[kept]
            slope = self.cost * user.b[self.by] / self.pivot + user.q[self.columns]
            add_transposed(self.rest, -slope / self.pivot, q)
        return QP(self.P, q, self.G, h, self.A, b, lb, ub)

    def point(self, point: Point) -> Point:
        """Return the user's point."""
        x = self.ray(point.x)
        _, y, z, z_box = self.certificate(point)
        if self.columns.size:
            x[self.columns] += self.user.b[self.by] / self.pivot
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
        lower, upper = self.bounds.tight[2:]
        give_back(tuple(lower), tuple(upper), z_box, rows)
        return Point(np.full(n, np.nan), rows[m:], rows[:m], z_box)

    def ray(self, d: np.ndarray) -> np.ndarray:
        """Return the user's direction of x."""
        if not self.columns.size:
            return d
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


@kernel
def give_back(lower, upper, z_box, rows):
    """Move the entries of z_box to the multipliers of the rows that gave the bounds.

    lower and upper = (rows, entries) as in `Givers`.
    """
    at_lower, lower_entry = lower
    at_upper, upper_entry = upper
    for j in range(z_box.size):
        if z_box[j] < 0.0 and at_lower[j] >= 0:
            rows[at_lower[j]] = z_box[j] / lower_entry[j]
            z_box[j] = 0.0
        elif z_box[j] > 0.0 and at_upper[j] >= 0:
            rows[at_upper[j]] = z_box[j] / upper_entry[j]
            z_box[j] = 0.0


def substitute(
    qp: QP, last: Substitution | None = None, deadline: Deadline = NEVER
) -> Substitution | None:
    """Return the smaller QP of a sparse one, None if nothing can be substituted.

    None, too, if lb > ub or after the deadline. The matrices of `last` are reused if qp
    has the same matrices and the same rows become bounds.
    """
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    lower, upper = (Givers(np.empty(n, np.int32), np.empty(n)) for _ in range(2))
    tight = TightBounds(qp.lb.copy(), qp.ub.copy(), lower, upper)
    left = np.empty(m + p, dtype=np.bool_)
    count = np.zeros(m + p, dtype=np.int32)
    P, G, A = (tuple(arrays_of(M)) for M in (qp.P, qp.G, qp.A))
    bounds = tight.lb, tight.ub, *lower, *upper
    taken, clashes, free = tighten(G, A, qp.h, qp.b, bounds, left, count)
    if taken < 0:
        return None
    if clashes:
        keep_clashing_rows(qp, tight, left)
    chosen, (pivot, cost, work) = np.full(p, -1, dtype=np.int32), np.empty((3, p))
    some = 0
    if free or clashes:
        some = find_free_columns(
            P, G, A, bounds[:2], (left[m:], count[m:]), chosen, (pivot, cost, work)
        )
    if some == 0 and (taken == 0 or left.all()):
        return None
    rows = RowBounds(tight, left[:m].nonzero()[0], left[m:].nonzero()[0])
    if last is not None and qp.has_matrices_of(last.user) and rows.is_like(last.bounds):
        return last._replace(user=qp, bounds=rows)
    return without_columns(qp, rows, chosen, pivot, cost, deadline)


def keep_clashing_rows(qp: QP, tight: TightBounds, left: np.ndarray) -> None:
    """Undo what made bounds clash; rows that clash stay, for certificates."""
    m = qp.h.size
    clash = tight.lb > tight.ub
    tight.lb[clash], tight.ub[clash] = qp.lb[clash], qp.ub[clash]
    tight.lower.rows[clash] = tight.upper.rows[clash] = -1
    left[without_zeros(qp.G)[:, clash].indices] = True
    left[m + without_zeros(qp.A)[:, clash].indices] = True


def without_columns(
    qp: QP,
    bounds: RowBounds,
    chosen: np.ndarray,
    pivot: np.ndarray,
    cost: np.ndarray,
    deadline: Deadline,
) -> Substitution | None:
    """Return the QP with the rows and columns left; None after the deadline.

    Row i of A substitutes column chosen[i] unless that is -1.
    """
    n = qp.q.size
    by = (chosen >= 0).nonzero()[0]
    columns, pivot, cost = chosen[by], pivot[by], cost[by]
    others, kept, rest = bounds.equations, np.arange(n), no_rows(n)
    P, G, A = (without_zeros(M) for M in (qp.P, qp.G, qp.A))
    if columns.size:
        others = others[chosen[others] < 0]
        stays = np.ones(n, dtype=np.bool_)
        stays[columns] = False
        kept = stays.nonzero()[0]
        rest = submatrix(A, by, kept)
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


@kernel
def tighten(G, A, h, b, bounds, left, count):
    """Tighten the bounds by the rows of [G; A] with one entry; see `tighten_by`.

    Returns the number of these rows, -1 if not lb <= ub on entry, and the numbers of
    clashes lb > ub and of unbounded variables in A. G and A are (indptr, indices, data)
    in CSC. bounds = (lb, ub, lower rows, lower entries, upper rows, upper entries): the
    first two are changed, the others, those of `Givers`, and `left` (m + p,) are
    overwritten. `count` (m + p,) is zero on entry and takes the entries of each row.
    """
    lb, ub, lower_row, lower_entry, upper_row, upper_entry = bounds
    for j in range(lb.size):
        if not lb[j] <= ub[j]:
            return -1, 0, 0
        lower_row[j] = upper_row[j] = -1
        lower_entry[j] = upper_entry[j] = 1.0
    for i in range(left.size):
        left[i] = True
    # not literals, which would compile `tighten_by` twice
    first, equal = np.int64(0), np.bool_(True)
    taken = tighten_by(G, h, first, not equal, bounds, left, count)
    taken += tighten_by(A, b, h.size, equal, bounds, left, count)
    clashes, free = 0, 0
    for j in range(lb.size):
        if lb[j] > ub[j]:
            clashes += 1
        if lb[j] == -np.inf and ub[j] == np.inf and A[0][j + 1] > A[0][j]:
            free += 1
    return taken, clashes, free


@part
def tighten_by(C, side, first, is_equal, bounds, left, count):
    """Tighten the bounds by the rows of C with one entry; return their number.

    `side` has the right-hand sides; row i has number first + i in [G; A]. left[first +
    i] becomes False for these rows. Rows with an infinite side are skipped, stored
    zeros are no entries.
    """
    indptr, indices, data = C
    lb, ub, lower_row, lower_entry, upper_row, upper_entry = bounds
    for t in range(indptr[lb.size]):
        if data[t] != 0.0:
            count[first + indices[t]] += 1
    taken = 0
    for j in range(lb.size):
        for t in range(indptr[j], indptr[j + 1]):
            i = first + indices[t]
            if count[i] != 1 or data[t] == 0.0 or np.isinf(side[i - first]):
                continue
            left[i] = False
            taken += 1
            value = side[i - first] / data[t]
            if (is_equal or data[t] > 0.0) and value < ub[j]:
                ub[j] = value
                upper_row[j], upper_entry[j] = i, data[t]
            if (is_equal or data[t] < 0.0) and value > lb[j]:
                lb[j] = value
                lower_row[j], lower_entry[j] = i, data[t]
    return taken


@kernel
def find_free_columns(P, G, A, bounds, equations, chosen, numbers):
    """Choose free columns to substitute; return their number.

    Free is a column without bounds (lb, ub) and without entries in G, with one entry in
    A and none in P but a diagonal one, p >= 0. P, G and A are (indptr, indices, data)
    in CSC. Of `equations` = (usable, count), all (p,), row i may be taken if usable[i],
    and has count[i] entries. Row i substitutes column chosen[i], the one with the
    largest entry, or none where that is -1. numbers = (pivot, cost, work) takes the
    entry and p; all these are overwritten.
    """
    indptr, indices, data = A
    lb, ub = bounds
    usable, _ = equations
    pivot, cost, largest = numbers
    for i in range(chosen.size):
        chosen[i] = -1
        pivot[i] = cost[i] = largest[i] = 0.0
    some = 0
    for j in range(lb.size):
        if lb[j] > -np.inf or ub[j] < np.inf:
            continue
        t = only_entry(A, j)
        if t < 0 or only_entry(G, j) != NO_ENTRY:
            continue
        i = indices[t]
        s = only_entry(P, j)
        if s == SEVERAL or (s >= 0 and (P[1][s] != j or P[2][s] < 0.0)):
            continue
        if usable[i] and abs(data[t]) > abs(pivot[i]):
            chosen[i], pivot[i] = j, data[t]
            cost[i] = P[2][s] if s >= 0 else 0.0
            some = 1
    if some == 0:
        return 0
    for t in range(indptr[lb.size]):
        i = indices[t]
        largest[i] = max(largest[i], abs(data[t]))
    for i in range(chosen.size):
        if abs(pivot[i]) < PIVOT * largest[i]:
            chosen[i] = -1
    return drop_filling_rows(A, equations, chosen, cost)


@part
def only_entry(C, j):
    """Return the position of the only nonzero entry in column j of a CSC matrix."""
    indptr, _, data = C
    found = NO_ENTRY
    for t in range(indptr[j], indptr[j + 1]):
        if data[t] != 0.0:
            if found != NO_ENTRY:
                return SEVERAL
            found = t
    return found


@part
def drop_filling_rows(A, equations, chosen, cost):
    """Set chosen[i] = -1 where squares would fill P; return how many rows are left.

    If the squares of all rows with p > 0 fill P, only the short ones of them are left.
    """
    indptr, indices, data = A
    _, count = equations
    lengths, squares, rows, left = 0, 0, 0, 0
    for i in range(chosen.size):
        if chosen[i] >= 0:
            left += 1
            if cost[i] > 0.0:
                length = np.int64(count[i]) - 1
                lengths += length
                squares += length * length
                rows += 1
    width = -rows
    for j in range(indptr.size - 1):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if data[t] != 0.0 and chosen[i] >= 0 and cost[i] > 0.0:
                width += 1
                break
    if min(squares, width * width) <= FILL * lengths + SMALL:
        return left
    for i in range(chosen.size):
        if chosen[i] >= 0 and cost[i] > 0.0 and count[i] - 1 > SHORT:
            chosen[i] = -1
            left -= 1
    return left
