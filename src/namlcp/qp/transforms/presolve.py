"""Presolve: redundant rows and fixed variables are dropped, and mapped back.

The presolved problem has ranges, lower <= Gx <= upper, and neither infinite, empty or
proportional rows (c g'x <= d beside g'x <= h) nor fixed variables (lb = ub). The
multipliers of dropped rows are zero, those of fixed variables follow from stationarity.

A row g x_j <= h where h/g is the opposite bound fixes x_j, too: there is no interior
beside it. The z_box_j that makes x_j stationary becomes z_i = z_box_j / g if that is
positive. (A row a x_j = b leaves the interior as it is, and stays.)
"""

from typing import NamedTuple

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY, fabs
from scipy.sparse import csc_array, csr_array

from namlcp.checks import constant
from namlcp.linalg import add_transposed, submatrix, times
from namlcp.qp.problem import QP, Point
from namlcp.qp.transforms.repeated import (
    Groups,
    leading_rows,
    merge_equations,
    merge_ranges,
)

# Largest ub - lb of a fixed variable, relative to max(1, |lb|).
FIXED = 1e-12


class Contradiction(NamedTuple):
    """Why the constraints contradict each other, and multipliers of rows as proof."""

    message: str
    y: np.ndarray
    z: np.ndarray


class Presolved(NamedTuple):
    """The smaller problem of `qp` and the way back to it.

    min 1/2 x'Px + q'x, A x = b, lower <= G x <= upper, lb <= x <= ub; A and G in CSR.
    `kept` and `fixed` are columns of `qp`; fixed_by = (rows of qp.G, their entries,
    columns) has those that rows fix. `upper_of` and `lower_of` are the rows of
    qp.G that give `upper` and `lower`, -1 for none, `largest_of` and `smallest_of` the
    rows of qp.A with the extreme right-hand sides of an equation; b lies between.
    """

    qp: QP
    P: csc_array
    q: np.ndarray
    A: csr_array
    b: np.ndarray
    G: csr_array
    lower: np.ndarray
    upper: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    kept: np.ndarray
    fixed: np.ndarray
    x_fixed: np.ndarray
    largest_of: np.ndarray
    smallest_of: np.ndarray
    upper_of: np.ndarray
    lower_of: np.ndarray
    contradictions: list[Contradiction]
    A_groups: Groups
    G_groups: Groups
    fixed_by: tuple[np.ndarray, np.ndarray, np.ndarray]

    def has_matrices_of(self, other):
        """Tell whether P, A and G are the very same objects."""
        return self.P is other.P and self.A is other.A and self.G is other.G

    def can_be_renewed(self, qp, fixed):
        """Tell whether only vectors differ, but not what is fixed or infinite."""
        return (
            qp.has_matrices_of(self.qp)
            and np.array_equal(fixed, self.fixed)
            and np.array_equal(qp.h < np.inf, self.G_groups.wanted)
        )

    def primal(self, x):
        """Return the x of `qp` from that of the kept columns."""
        if not self.fixed.size:
            return x
        full = np.empty(self.qp.q.size)
        full[self.kept] = x
        full[self.fixed] = self.x_fixed
        return full

    def ray(self, d):
        """Return the direction of the x of `qp`; fixed variables do not move."""
        if not self.fixed.size:
            return d
        full = np.zeros(self.qp.q.size)
        full[self.kept] = d
        return full

    def certificate(self, y, z_upper, z_lower):
        """Return the (y, z) of `qp` that prove what those of the smaller problem do."""
        y, z = self.multipliers(y, z_upper, z_lower)
        if self.fixed_by[0].size:
            self.hold_fixed(np.zeros(self.qp.q.size), y, z)
        return y, z

    def multipliers(self, y, z_upper, z_lower):
        """Return the (y, z) of `qp`, zero at dropped rows.

        The two extreme rows of an equation share its y so that b'y does not change.
        """
        y_full, z_full = np.zeros(self.qp.b.size), np.zeros(self.qp.h.size)
        if y.size:
            pair, ratio = (self.largest_of, self.smallest_of), self.A_groups.ratio
            shared = y / (np.abs(ratio[pair[0]]) + np.abs(ratio[pair[1]]))
            for rows in pair:
                y_full[rows] += np.sign(ratio[rows]) * shared
        for rows, side in ((self.upper_of, z_upper), (self.lower_of, z_lower)):
            has = rows >= 0
            z_full[rows[has]] = side[has] / np.abs(self.G_groups.ratio[rows[has]])
        return y_full, z_full

    def hold_fixed(self, gradient, y, z):
        """Return the z_box that makes fixed variables stationary; move it to z.

        A'y + G'z is added to the gradient. The z_box of kept columns is zero.
        """
        add_transposed(self.qp.A, y, gradient)
        add_transposed(self.qp.G, z, gradient)
        z_box = np.zeros(gradient.size)
        z_box[self.fixed] = -gradient[self.fixed]
        row, entry, column = self.fixed_by
        value = z_box[column] / entry
        z[row] += np.maximum(value, 0.0)
        z_box[column[value > 0.0]] = 0.0
        return z_box

    def guess(self, guess):
        """Return (x, y, z_upper, z_lower, z_box, active) of a guess for `qp`.

        active: whether upper and lower sides of rows, upper and lower bounds are.
        """
        kept, upper, lower = self.kept, self.upper_of, self.lower_of
        most, least = self.largest_of, self.smallest_of
        y = guess.y * self.A_groups.ratio
        y = y[most] + np.where(least != most, y[least], 0.0)
        # with an entry for -1, no row
        z = np.append(guess.z * np.abs(self.G_groups.ratio), 0.0)
        m, n = guess.z.size, guess.x.size
        row, lb, ub = np.split(guess.active != 0, (m, m + n))
        row = np.append(row, False)
        active = row[upper], row[lower], ub[kept], lb[kept]
        return guess.x[kept], y, z[upper], z[lower], guess.z_box[kept], active

    def point(self, x, y, z_upper, z_lower, z_box):
        """Return the point of `qp`; z_box of a fixed variable makes its residual 0."""
        qp = self.qp
        y, z = self.multipliers(y, z_upper, z_lower)
        if not self.fixed.size:
            return Point(x, y, z, z_box)
        x = self.primal(x)
        box = self.hold_fixed(times(qp.P, x) + qp.q, y, z)
        box[self.kept] = z_box
        return Point(x, y, z, box)


def presolve(qp, eps_abs, eps_rel, last=None):
    """Return the smaller problem of a QP in CSC; reuse the matrices of `last` if equal.

    The tolerances decide which constraints contradict each other.
    """
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    q, b, h, lb, ub = qp.q, qp.b, qp.h, qp.lb.copy(), qp.ub.copy()
    by, entry = np.full(n, -1, dtype=np.int32), np.empty(n)
    fix_by_rows(qp.G.indptr, qp.G.indices, qp.G.data, h, lb, ub, by, entry)
    column = (by >= 0).nonzero()[0]
    is_fixed = np.isfinite(lb) & np.isfinite(ub)
    is_fixed &= ub - lb <= FIXED * np.maximum(1.0, np.abs(lb))
    fixed = is_fixed.nonzero()[0]
    kept, x_fixed = (~is_fixed).nonzero()[0], 0.5 * (lb[fixed] + ub[fixed])
    if fixed.size:
        held = np.zeros(n)
        held[fixed] = x_fixed
        q = (q + times(qp.P, held))[kept]
        b, h = b - times(qp.A, held), h - times(qp.G, held)
        lb, ub = lb[kept], ub[kept]
    if last is not None and last.can_be_renewed(qp, fixed):
        P, A, G = last.P, last.A, last.G
        A_groups, G_groups = last.A_groups, last.G_groups
    else:
        P = submatrix(qp.P, kept, kept)
        A, A_groups = leading_rows(qp.A, kept, np.ones(p, dtype=np.bool_))
        G, G_groups = leading_rows(qp.G, kept, h < np.inf)
    tol = eps_abs if eps_abs > 0.0 else eps_rel
    b, largest_of, smallest_of, of_A = equality_sides(A_groups, b, tol)
    lower, upper, lower_of, upper_of, of_G = ranges(G_groups, h, tol)
    found = [Contradiction(message, y, np.zeros(m)) for message, y in of_A]
    found += [Contradiction(message, np.zeros(p), z) for message, z in of_G]
    return Presolved(
        qp, P, q, A, b, G, lower, upper, lb, ub, kept, fixed, x_fixed,
        largest_of, smallest_of, upper_of, lower_of, found, A_groups, G_groups,
        (by[column], entry[column], column),
    )  # fmt: skip


def fix_by_rows(indptr, indices, data, h, lb, ub, by, entry):
    """Set lb_j = ub_j where a row of G, in CSC, with one nonzero entry fixes x_j.

    by[j] and entry[j] take the row and its entry.
    """
    n = lb.shape[0]
    count: cython.int[::1] = np.zeros(h.shape[0], np.int32)
    for t in range(indptr[n]):
        if data[t] != 0.0:
            count[indices[t]] += 1
    for j in range(n):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if count[i] != 1 or data[t] == 0.0 or not lb[j] < ub[j]:
                continue
            value, opposite = h[i] / data[t], lb[j] if data[t] > 0.0 else ub[j]
            if fabs(value - opposite) <= FIXED * max(1.0, fabs(opposite)) < INFINITY:
                lb[j], ub[j] = opposite, opposite
                by[j], entry[j] = i, data[t]


def equality_sides(groups, b, tol):
    """Return the right-hand sides of the equations and the rows of extreme ones.

    Proportional rows contradict each other if no value is within `tol` of all their b.
    Such contradictions are returned, too: messages and multipliers y.
    """
    first, found = groups.first, []
    for i in groups.empty[np.abs(b[groups.empty]) > tol][:1]:
        message = f"row {i} of A has no free variable, but the right-hand side {b[i]:g}"
        found.append((message, unit(b.size, i, -np.sign(b[i]))))
    if not groups.repeated:
        return b[first], first, first, found
    sides = np.empty(first.size)
    most, least = np.empty((2, first.size), dtype=np.intp)
    k = merge_equations(*groups.merged_by, b, tol, sides, most, least)
    if k >= 0:
        i, j = least[k], most[k]
        y = unit(b.size, i, 1.0 / groups.ratio[i])
        y[j] = -1.0 / groups.ratio[j]
        found.append((f"rows {j} and {i} of A contradict each other", y))
    return sides, most, least, found


def ranges(groups, h, tol):
    """Return the lower and upper sides of the ranges and the rows that give them.

    Contradictions are returned, too: messages and multipliers z.
    """
    first, found = groups.first, []
    sides = h[groups.empty]
    for i in groups.empty[(sides < -tol) & (sides > -np.inf)][:1]:
        message = f"row {i} of G has no free variable, but the right-hand side {h[i]:g}"
        found.append((message, unit(h.size, i, 1.0)))
    count = first.size
    if not groups.repeated:
        upper = h[first]
        rows = np.where(upper > -np.inf, first, -1)
        return constant(count, -np.inf), upper, np.full(count, -1), rows, found
    lower, upper = np.empty((2, count))
    low_at, up_at = np.empty((2, count), dtype=np.intp)
    k = merge_ranges(*groups.merged_by, h, tol, lower, upper, low_at, up_at)
    if k >= 0:
        i, j = up_at[k], low_at[k]
        z = unit(h.size, i, 1.0 / groups.ratio[i])
        z[j] = -1.0 / groups.ratio[j]
        found.append((f"rows {i} and {j} of G contradict each other", z))
    return lower, upper, low_at, up_at, found


def unit(size, index, value):
    """Return value * e_index."""
    e = np.zeros(size)
    e[index] = value
    return e
