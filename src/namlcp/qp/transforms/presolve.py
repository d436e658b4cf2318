"""Presolve: redundant rows and fixed variables are dropped, and mapped back.

The presolved problem has ranges, lower <= Gx <= upper, and neither infinite, empty or
proportional rows (c g'x <= d beside g'x <= h) nor fixed variables (lb = ub). The
multipliers of dropped rows are zero, those of fixed variables follow from stationarity.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.compiled import kernel
from namlcp.linalg import add_transposed, by_rows, submatrix, times, without_zeros
from namlcp.qp.problem import QP, Point

# Largest ub - lb of a fixed variable, relative to max(1, |lb|).
FIXED = 1e-12
# Largest relative difference between entries of proportional rows, one row scaled.
SAME = 1e-13


class Contradiction(NamedTuple):
    """Why the constraints contradict each other, and multipliers of rows as proof.

    y is None where no multipliers prove it (lb > ub, h = -inf); z is None where z = 0.
    """

    message: str
    y: np.ndarray | None = None
    z: np.ndarray | None = None


class Owners(NamedTuple):
    """The rows of the QP that give one side of each range, -1 for none.

    The row of the QP is `ratio` times the row of the range.
    """

    rows: np.ndarray
    ratio: np.ndarray

    def spread(self, side: np.ndarray, full: np.ndarray) -> None:
        """Add multipliers of one side of the ranges to `full`, those of the rows."""
        has = self.rows >= 0
        full[self.rows[has]] += side[has] / np.abs(self.ratio[has])

    def gather(self, full: np.ndarray) -> np.ndarray:
        """Return the multipliers of one side of the ranges from those of the rows."""
        return np.where(self.rows >= 0, full[self.rows] * np.abs(self.ratio), 0.0)


class Groups(NamedTuple):
    """The rows of a matrix that are not dropped, and which of them are proportional.

    Rows not `wanted` (infinite) and `empty` ones are dropped. Of the kept `rows`, row i
    is ratio[i] times row leader[i], the first one of its group (both are positions in
    `rows`; leader is None if no two are proportional); `first` has the leaders.
    """

    wanted: np.ndarray
    empty: np.ndarray
    rows: np.ndarray
    leader: np.ndarray | None
    ratio: np.ndarray
    first: np.ndarray


class Presolved(NamedTuple):
    """The smaller problem of `qp` and the way back to it.

    min 1/2 x'Px + q'x, A x = b, lower <= G x <= upper, lb <= x <= ub; A and G in CSR.
    `kept` and `fixed` are columns of `qp`. `upper_of` and `lower_of` are the rows of
    qp.G that give `upper` and `lower`, `largest_of` and `smallest_of` the rows of qp.A
    with the extreme right-hand sides of an equation; b lies between these.
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
    largest_of: Owners
    smallest_of: Owners
    upper_of: Owners
    lower_of: Owners
    contradictions: list[Contradiction]
    A_groups: Groups
    G_groups: Groups

    def has_matrices_of(self, other: "Presolved") -> bool:
        """Tell whether P, A and G are the very same objects."""
        return self.P is other.P and self.A is other.A and self.G is other.G

    def can_be_renewed(self, qp: QP, fixed: np.ndarray) -> bool:
        """Tell whether only vectors differ, but not what is fixed or infinite."""
        return (
            qp.has_matrices_of(self.qp)
            and np.array_equal(fixed, self.fixed)
            and np.array_equal(qp.h < np.inf, self.G_groups.wanted)
        )

    def with_fixed(self, x: np.ndarray) -> np.ndarray:
        """Return the x of `qp` from that of the kept columns."""
        full = np.empty(self.qp.q.size)
        full[self.kept] = x
        full[self.fixed] = self.x_fixed
        return full

    def ray(self, d: np.ndarray) -> np.ndarray:
        """Return the direction of the x of `qp`; fixed variables do not move."""
        full = np.zeros(self.qp.q.size)
        full[self.kept] = d
        return full

    def certificate(
        self, y: np.ndarray, z_upper: np.ndarray, z_lower: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the (y, z) of `qp`.

        The two extreme rows of an equation share its y, so that b'y does not change
        where b is the mean of their right-hand sides.
        """
        y_full = np.zeros(self.qp.b.size)
        for owners in (self.largest_of, self.smallest_of):
            y_full[owners.rows] += 0.5 * y / owners.ratio
        z_full = np.zeros(self.qp.h.size)
        self.upper_of.spread(z_upper, z_full)
        self.lower_of.spread(z_lower, z_full)
        return y_full, z_full

    def guess(
        self, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (y, z_upper, z_lower) from multipliers of `qp`."""
        most, least = self.largest_of, self.smallest_of
        y_kept = y[most.rows] * most.ratio
        y_kept += np.where(least.rows != most.rows, y[least.rows] * least.ratio, 0.0)
        return y_kept, self.upper_of.gather(z), self.lower_of.gather(z)

    def point(
        self,
        x: np.ndarray,
        y: np.ndarray,
        z_upper: np.ndarray,
        z_lower: np.ndarray,
        z_box: np.ndarray,
    ) -> Point:
        """Return the point of `qp`; z_box of a fixed variable makes its residual 0."""
        qp = self.qp
        x = self.with_fixed(x)
        y, z = self.certificate(y, z_upper, z_lower)
        box = np.zeros(qp.q.size)
        box[self.kept] = z_box
        if self.fixed.size:
            gradient = times(qp.P, x) + qp.q
            add_transposed(qp.A, y, gradient)
            add_transposed(qp.G, z, gradient)
            box[self.fixed] = -gradient[self.fixed]
        return Point(x, y, z, box)


def presolve(
    qp: QP, eps_abs: float, eps_rel: float, last: Presolved | None = None
) -> Presolved:
    """Return the smaller problem of a QP in CSC; reuse the matrices of `last` if equal.

    The tolerances decide which constraints contradict each other.
    """
    found = contradictory_sides(qp, eps_abs, eps_rel)
    finite = np.isfinite(qp.lb) & np.isfinite(qp.ub)
    lb, ub = np.where(finite, qp.lb, 0.0), np.where(finite, qp.ub, 0.0)
    is_fixed = finite & (ub - lb <= FIXED * np.maximum(1.0, np.abs(lb)))
    kept, fixed = np.flatnonzero(~is_fixed), np.flatnonzero(is_fixed)
    x_fixed = 0.5 * (qp.lb[fixed] + qp.ub[fixed])
    q, b, h = qp.q, qp.b, qp.h
    if fixed.size:
        held = np.zeros(q.size)
        held[fixed] = x_fixed
        q = (q + times(qp.P, held))[kept]
        b, h = b - times(qp.A, held), h - times(qp.G, held)
    lb, ub = qp.lb[kept], qp.ub[kept]
    if last is not None and last.can_be_renewed(qp, fixed):
        P, A, G = last.P, last.A, last.G
        A_groups, G_groups = last.A_groups, last.G_groups
    else:
        P = submatrix(qp.P, kept, kept)
        A, G = (
            by_rows(submatrix(without_zeros(M), np.arange(M.shape[0]), kept))
            for M in (qp.A, qp.G)
        )
        A, A_groups = grouped(A, np.ones(b.size, dtype=bool))
        G, G_groups = grouped(G, h < np.inf)
    tol = eps_abs if eps_abs > 0.0 else eps_rel
    b, largest_of, smallest_of, more = equality_sides(A_groups, b, tol)
    found += more
    lower, upper, lower_of, upper_of, more = ranges(G_groups, h, tol, qp.b.size)
    found += more
    return Presolved(
        qp, P, q, A, b, G, lower, upper, lb, ub, kept, fixed, x_fixed,
        largest_of, smallest_of, upper_of, lower_of, found, A_groups, G_groups,
    )  # fmt: skip


def contradictory_sides(qp: QP, eps_abs: float, eps_rel: float) -> list[Contradiction]:
    """Return the first bound or row that contradicts itself, if any.

    Bounds do so if no x is within tolerance of both.
    """
    wrong = ~(qp.lb <= qp.ub) | (qp.lb == np.inf) | (qp.ub == -np.inf)
    if not wrong.any() and not (qp.h == -np.inf).any():
        return []
    with np.errstate(invalid="ignore"):
        size = np.maximum(np.abs(qp.lb), np.abs(qp.ub))
        gap = qp.lb - qp.ub > 2.0 * (eps_abs + eps_rel * np.minimum(size, 1e300))
    for j in np.flatnonzero(gap | (qp.lb == np.inf) | (qp.ub == -np.inf))[:1]:
        sides = f"lb = {qp.lb[j]:g}, ub = {qp.ub[j]:g}"
        return [Contradiction(f"bounds of x[{j}] contradict each other: {sides}")]
    for i in np.flatnonzero(qp.h == -np.inf)[:1]:
        return [Contradiction(f"row {i} of G has h = -inf")]
    return []


def grouped(M: csr_array, wanted: np.ndarray) -> tuple[csr_array, Groups]:
    """Return the leading rows of M, of those wanted and not empty, and the groups."""
    is_empty = np.diff(M.indptr) == 0
    rows = np.flatnonzero(wanted & ~is_empty)
    M = M if rows.size == M.shape[0] else M[rows]
    leader, ratio = proportional_rows(M)
    first = np.arange(rows.size)
    if leader is not None:
        first = np.flatnonzero(leader == first)
        M = M[first]
    return M, Groups(wanted, np.flatnonzero(is_empty), rows, leader, ratio, first)


def equality_sides(
    groups: Groups, b: np.ndarray, tol: float
) -> tuple[np.ndarray, Owners, Owners, list[Contradiction]]:
    """Return the right-hand sides, the owners of the extreme ones, contradictions.

    Proportional rows contradict each other if no value is within `tol` of all their b.
    `low` and `most` below are minima with their sign reversed.
    """
    found, p = [], b.size
    _, empty, rows, leader, ratio, first = groups
    for i in empty[np.abs(b[empty]) > tol][:1]:
        message = f"row {i} of A has no free variable, but the right-hand side {b[i]:g}"
        found.append(Contradiction(message, unit(p, i, -np.sign(b[i]))))
    b = b[rows]
    if leader is None:
        same = Owners(rows, ratio)
        return b, same, same, found
    value, margin = b / ratio, tol / np.abs(ratio)  # of the leader's row
    low, low_at = extreme(-value, leader)
    high, high_at = extreme(value, leader)
    most, most_at = extreme(-(value + margin), leader)
    least, least_at = extreme(value - margin, leader)
    for k in first[least[first] + most[first] > 0.0][:1]:
        i, j = least_at[k], most_at[k]
        y = unit(p, rows[j], 1.0 / ratio[j]) - unit(p, rows[i], 1.0 / ratio[i])
        message = f"rows {rows[i]} and {rows[j]} of A contradict each other"
        found.append(Contradiction(message, y))
    owners = [Owners(rows[at], ratio[at]) for at in (high_at[first], low_at[first])]
    mean = 0.5 * (high[first] - low[first])
    below, above = least[first], -most[first]
    b = np.where(below <= above, np.clip(mean, below, above), mean)
    return b, owners[0], owners[1], found


def ranges(
    groups: Groups, h: np.ndarray, tol: float, p: int
) -> tuple[np.ndarray, np.ndarray, Owners, Owners, list[Contradiction]]:
    """Return the lower and upper sides of the ranges, their owners, contradictions.

    `p` is the size of y in the contradictions.
    """
    found, m = [], h.size
    _, empty, rows, leader, ratio, first = groups
    for i in empty[(h[empty] < -tol) & (h[empty] > -np.inf)][:1]:
        message = f"row {i} of G has no free variable, but the right-hand side {h[i]:g}"
        found.append(Contradiction(message, np.zeros(p), unit(m, i, 1.0)))
    h = h[rows]
    if leader is None:
        none = Owners(np.full(rows.size, -1), ratio)
        return np.full(rows.size, -np.inf), h, none, Owners(rows, ratio), found
    value = h / ratio
    upper, upper_at = extreme(-np.where(ratio > 0.0, value, np.inf), leader)
    lower, lower_at = extreme(np.where(ratio < 0.0, value, -np.inf), leader)
    upper = -upper
    margin = tol / np.abs(ratio)
    margin = margin[upper_at] + margin[lower_at]
    for k in first[lower[first] > upper[first] + margin[first]][:1]:
        i, j = upper_at[k], lower_at[k]
        z = unit(m, rows[i], 1.0 / ratio[i]) + unit(m, rows[j], -1.0 / ratio[j])
        message = f"rows {rows[i]} and {rows[j]} of G contradict each other"
        found.append(Contradiction(message, np.zeros(p), z))
    owners = []
    for end, at in ((lower[first], lower_at[first]), (upper[first], upper_at[first])):
        owners.append(Owners(np.where(np.isfinite(end), rows[at], -1), ratio[at]))
    return lower[first], upper[first], owners[0], owners[1], found


def proportional_rows(M: csr_array) -> tuple[np.ndarray | None, np.ndarray]:
    """Group the rows of M, none of them empty, that are multiples of each other.

    Returns `leader`, the first row of each row's group, or None if all rows differ, and
    `ratio`: row = ratio * leader's row. Rows are compared with the first of equal key.
    """
    m = M.shape[0]
    one = np.ones(m)
    if m < 2:
        return None, one
    key = np.empty(m)
    row_keys(M.indptr, M.indices, M.data, key)
    order = np.argsort(key, kind="stable")
    same = np.zeros(m, dtype=bool)
    same[1:] = key[order[1:]] == key[order[:-1]]
    if not same.any():
        return None, one
    leader = np.arange(m)
    compare_rows(M.indptr, M.indices, M.data, order, same, leader)
    if np.array_equal(leader, np.arange(m)):
        return None, one
    lead = M.data[M.indptr[:-1]]
    return leader, lead / lead[leader]


@kernel
def row_keys(indptr, indices, data, key):
    """Set key_i = sum |a_ij| (2 + sin j) / |first a_ij| for the rows of a CSR matrix.

    It is rounded to single precision, so that rounding errors seldom change it.
    """
    for i in range(key.size):
        total = 0.0
        for t in range(indptr[i], indptr[i + 1]):
            total += abs(data[t]) * (2.0 + np.sin(float(indices[t])))
        key[i] = np.float32(total / abs(data[indptr[i]]))


@kernel
def compare_rows(indptr, indices, data, order, same, leader):
    """Set leader[row] to the first row with the same key if they are proportional.

    The matrix is in CSR; `order` sorts its rows by key; same[k] tells whether rows
    order[k] and order[k - 1] have the same key; on entry leader[row] = row.
    """
    head = order[0]
    for k in range(order.size):
        row = order[k]
        if not same[k]:
            head = row
            continue
        a = indptr[head]
        c = indptr[row]
        ratio = data[a] / data[c]
        length = indptr[head + 1] - a
        equal = indptr[row + 1] - c == length
        for t in range(length if equal else 0):
            difference = data[c + t] * ratio - data[a + t]
            if indices[a + t] != indices[c + t] or (
                abs(difference) > SAME * abs(data[a + t])
            ):
                equal = False
                break
        if equal:
            leader[row] = head


def extreme(value: np.ndarray, leader: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return, at each leader, the largest value of its group and the first such row."""
    best = np.full(leader.size, -np.inf)
    np.maximum.at(best, leader, value)
    at = leader.copy()
    hit = np.flatnonzero(value == best[leader])
    at[leader[hit[::-1]]] = hit[::-1]
    return best, at


def unit(size: int, index: int, value: float) -> np.ndarray:
    """Return value * e_index."""
    e = np.zeros(size)
    e[index] = value
    return e
