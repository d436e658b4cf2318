"""Factors of the KKT matrix: of few columns at a time, dense fronts, a dense border.

One fill-reducing order is made; its counts tell the work of a factorisation. Where L is
sparse, up to four columns of it are taken at a time (`sparse_ldl`). With much fill,
dense fronts are faster (`multifrontal`). Where some rows and columns are dense (a dense
data matrix in a support vector machine, a dense P), most of a sparse factorisation is
spent on one dense block. There the matrix is split into a sparse part R and a dense
border D,

    K = [K_R  B  ]      X = K_R^-1 B,   S = K_D - B'X,
        [B'   K_D]      K u = r:  u_D = S^-1 (r_D - B' K_R^-1 r_R),
                                  u_R = K_R^-1 r_R - X u_D

with a sparse L D L' of K_R and LAPACK for S.
"""

from typing import Protocol

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs, dsytrf, dsytrf_lwork, dsytrs
from scipy.sparse import csc_matrix

from namlcp.compiled import floats_at, ints_at, kernel, longs_at, part, record_of
from namlcp.linalg.csc import MOST_DENSE
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.multifrontal import Multifrontal
from namlcp.linalg.ordering import Order, degrees, nested_dissection
from namlcp.linalg.sparse_ldl import (
    Pattern,
    analyse,
    factor_sparse,
    ldl_factor,
    ldl_solve_into,
    solve_sparse,
)

# Entries of the upper triangle of K from which on a border is looked for.
BORDER_ENTRIES = 20_000
# Off-diagonal entries of a row of K up to which it always stays in the sparse part.
SPARSE_DEGREE = 16
# Rows of a border at least and at most.
LEAST_BORDER, MOST_BORDER = 50, 3000
# Density of B from which a border pays. A border of WIDE rows pays with a sparser B too
# if the upper triangle of K_D has FULL_D times its order squared entries (0.5 is all).
DENSE_B, WIDE, FULL_D = 0.1, 600, 0.2
# Work of a factorisation, see `Order.work`, from which on a dense border is looked for,
# and from which on dense fronts are used: there a factorisation and six solves take as
# long both ways.
SOME, HEAVY = 2e6, 3e8
# Work for each row from which on nested dissection is tried, too.
DEEP = 1e5


class Factors(Protocol):
    """Factors of a quasi-definite matrix; ValueError if a pivot is 0."""

    def refactor(self, data: np.ndarray) -> None:
        """Factor the matrix with these values in its pattern."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""


def plan_factors(indptr: np.ndarray, indices: np.ndarray) -> Factors:
    """Return the factors that suit a pattern; `refactor` computes them.

    The pattern is the upper triangle of a quasi-definite matrix in CSC. All diagonal
    entries are stored, as the last of their columns.
    """
    order = minimum_degree(indptr, indices)
    if order.work >= SOME:
        border = dense_border(indptr, indices)
        if border.size:
            return Bordered(indptr, indices, border)
        order = better_order(indptr, indices, order)
        if order.work >= HEAVY:
            return Multifrontal(indptr, indices, order)
    return SparseFactors(indptr, indices, order)


def better_order(indptr: np.ndarray, indices: np.ndarray, order: Order) -> Order:
    """Return an order by nested dissection where it causes less work."""
    if order.work < DEEP * order.parent.size:
        return order
    other = nested_dissection(indptr, indices)
    return order if other is None or other.work >= order.work else other


class SparseFactors:
    """L D L' by chunks of columns (`sparse_ldl`).

    Attributes
    ----------
    order : the fill-reducing order
    pattern, values, inverse : L and D^-1, as the functions of `sparse_ldl` take them
    """

    def __init__(self, indptr: np.ndarray, indices: np.ndarray, order: Order) -> None:
        self.order = order
        self.pattern = analyse(indptr, indices, order)
        self.values = np.empty(self.pattern.below.size)
        self.inverse, self.work = np.empty((2, order.place.size))

    def refactor(self, data: np.ndarray) -> None:
        """Factor the matrix with these values."""
        if not factor_sparse(self.pattern, data, self.values, self.inverse, self.work):
            raise ValueError("a pivot vanishes")

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""
        x = np.empty(rhs.size)
        solve_sparse(self.pattern, self.values, self.inverse, rhs, x, self.work)
        return x


FACTORS = (
    "l_place l_diagonal l_columns l_rows l_source l_starts l_below l_lines l_chunks "
    "l_width l_done l_reach l_values l_inverse l_work"
)
"""Fields of a record for the addresses of `SparseFactors`."""


@kernel
def attach_factors(state, pattern, numbers):
    """Set the fields FACTORS of state[0]; numbers: values, inverse and work."""
    m = record_of(state)
    values, inverse, work = numbers
    m.l_place, m.l_diagonal = pattern.place.ctypes.data, pattern.diagonal.ctypes.data
    m.l_columns, m.l_rows = pattern.columns.ctypes.data, pattern.rows.ctypes.data
    m.l_source, m.l_starts = pattern.source.ctypes.data, pattern.starts.ctypes.data
    m.l_below, m.l_lines = pattern.below.ctypes.data, pattern.lines.ctypes.data
    m.l_chunks, m.l_width = pattern.chunks.ctypes.data, pattern.width.ctypes.data
    m.l_done, m.l_reach = pattern.done.ctypes.data, pattern.reach.ctypes.data
    m.l_values = values.ctypes.data
    m.l_inverse, m.l_work = inverse.ctypes.data, work.ctypes.data


@part
def pattern_of(m):
    """Return the pattern whose addresses the record m holds; m.size is the order."""
    size = m.size
    columns, starts = ints_at(m.l_columns, size + 1), longs_at(m.l_starts, size + 1)
    lines = longs_at(m.l_lines, size + 1)
    nnz = np.int64(columns[size])
    return Pattern(
        ints_at(m.l_place, size),
        ints_at(m.l_diagonal, size),
        columns,
        ints_at(m.l_rows, nnz),
        ints_at(m.l_source, nnz),
        starts,
        ints_at(m.l_below, starts[size]),
        lines,
        ints_at(m.l_chunks, lines[size]),
        ints_at(m.l_width, size),
        longs_at(m.l_done, size),
        ints_at(m.l_reach, size),
    )


@part
def numbers_of(m):
    """Return the values, the inverse and the scratch that the record m points to."""
    entries = longs_at(m.l_starts, m.size + 1)[m.size]
    values, inverse = floats_at(m.l_values, entries), floats_at(m.l_inverse, m.size)
    return values, inverse, floats_at(m.l_work, m.size)


@part
def factor_record(m, data):
    """Factor the matrix with these values; tell whether that succeeds."""
    values, inverse, work = numbers_of(m)
    return ldl_factor(m.size, pattern_of(m), data, values, inverse, work)


@part
def solve_record(m, rhs, x):
    """Solve K x = rhs by the factors that the record m points to; x may be rhs."""
    values, inverse, work = numbers_of(m)
    ldl_solve_into(m.size, pattern_of(m), values, inverse, rhs, x, work)


def factor_triangle(triangle: csc_matrix) -> SparseFactors:
    """Return L D L' of a symmetric matrix, its upper triangle given.

    Raises ValueError if a diagonal entry is not stored, or a pivot is 0.
    """
    triangle.sum_duplicates()
    indptr, indices = triangle.indptr, triangle.indices
    last = indptr[1:] - 1
    every = np.arange(last.size)
    if np.any(np.diff(indptr) == 0) or np.any(indices[last] != every):
        raise ValueError("a pivot vanishes")
    factors = SparseFactors(indptr, indices, minimum_degree(indptr, indices))
    factors.refactor(triangle.data)
    return factors


class Diagonal:
    """A diagonal matrix as its own factors."""

    entries = np.empty(0)

    def refactor(self, data: np.ndarray) -> None:
        """Take other entries."""
        if not np.all(data) or not np.all(np.isfinite(data)):
            raise ValueError("a pivot vanishes")
        self.entries = data

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""
        return rhs / self.entries


class Bordered:
    """Sparse factors of K_R, LAPACK for the Schur complement on the border.

    border: the rows of D in rising order.
    """

    def __init__(
        self, indptr: np.ndarray, indices: np.ndarray, border: np.ndarray
    ) -> None:
        size = indptr.size - 1
        self.indptr, self.indices = indptr, indices
        self.border = border
        self.rest = np.delete(np.arange(size), border)
        self.place = np.empty(size, dtype=np.int32)
        self.place[self.rest] = np.arange(self.rest.size)
        self.place[border] = -1 - np.arange(border.size)
        counts = count_rest(self.indptr, self.indices, self.place)
        indptr = np.concatenate(([0], np.cumsum(counts[self.rest]))).astype(np.int32)
        empty = np.zeros(indptr[-1]), np.zeros(indptr[-1], dtype=np.int32), indptr
        self.inner = csc_matrix(empty, shape=(self.rest.size, self.rest.size))
        self.factors: SparseFactors | Diagonal | None = None
        self.B = np.zeros((self.rest.size, border.size), order="F")
        self.S = np.zeros((border.size, border.size), order="F")

    def refactor(self, data: np.ndarray) -> None:
        """Factor again with other values."""
        inner, B, S = self.inner, self.B, self.S
        S[:] = 0.0
        split(
            self.indptr, self.indices, data, self.place, inner.indices, inner.data, B, S
        )
        if self.factors is None:
            if inner.nnz == self.rest.size:
                self.factors = Diagonal()
            else:
                order = minimum_degree(inner.indptr, inner.indices)
                self.factors = SparseFactors(inner.indptr, inner.indices, order)
        self.factors.refactor(inner.data)
        X = np.empty_like(B)
        for j in range(B.shape[1]):
            X[:, j] = self.factors.solve(B[:, j])
        S -= B.T @ X
        self.X = X
        self.L, info = dpotrf(S, lower=0)
        self.is_definite = info == 0
        if not self.is_definite:
            # without a large lwork dsytrf is unblocked
            lwork = int(dsytrf_lwork(S.shape[0], lower=0)[0])
            self.L, self.pivots, info = dsytrf(S, lower=0, lwork=lwork)
            if info != 0:
                raise ValueError("the Schur complement is singular")

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""
        assert self.factors is not None
        u = np.empty_like(rhs)
        inner = self.factors.solve(rhs[self.rest])
        goal = rhs[self.border] - self.B.T @ inner
        if self.is_definite:
            outer = dpotrs(self.L, goal, lower=0)[0]
        else:
            outer = dsytrs(self.L, self.pivots, goal, lower=0)[0]
        u[self.border] = outer
        u[self.rest] = inner - self.X @ outer
        return u


def dense_border(indptr: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Return the rows of the border, none if it does not pay."""
    none = np.empty(0, dtype=np.intp)
    size = indptr.size - 1
    if indices.size < BORDER_ENTRIES:
        return none
    outside = np.zeros(size, dtype=np.bool_)
    while True:
        degree = degrees(indptr, indices, ~outside)
        highest = degree.max()
        if highest <= SPARSE_DEGREE:
            break
        outside |= degree > max(highest // 2, SPARSE_DEGREE)
        if np.count_nonzero(outside) > MOST_BORDER:
            return none
    border = np.flatnonzero(outside)
    rest = size - border.size
    if border.size < LEAST_BORDER or border.size * rest > MOST_DENSE:
        return none
    inside, crossing = count_entries(indptr, indices, outside)
    is_full = border.size >= WIDE and inside >= FULL_D * border.size**2
    return border if is_full or crossing >= DENSE_B * border.size * rest else none


@kernel
def count_entries(indptr, indices, outside):
    """Count the entries of K_D (its upper triangle) and of B."""
    inside = 0
    crossing = 0
    for j in range(outside.size):
        for t in range(indptr[j], indptr[j + 1]):
            if outside[indices[t]] != outside[j]:
                crossing += 1
            elif outside[j]:
                inside += 1
    return inside, crossing


@kernel
def count_rest(indptr, indices, place):
    """Count the entries of each column of K that belong to K_R."""
    counts = np.zeros(place.size, dtype=np.int32)
    for j in range(place.size):
        if place[j] >= 0:
            for t in range(indptr[j], indptr[j + 1]):
                if place[indices[t]] >= 0:
                    counts[j] += 1
    return counts


@kernel
def split(indptr, indices, data, place, inner_indices, inner_data, B, S):
    """Write the upper triangle of K to that of K_R (inner), B and both of S = K_D.

    place[j] is the row in K_R of row j of K, or -1 minus its row in the border.
    """
    nnz = 0
    for j in range(place.size):
        to = place[j]
        for t in range(indptr[j], indptr[j + 1]):
            row = place[indices[t]]
            if row >= 0 and to >= 0:
                inner_indices[nnz] = row
                inner_data[nnz] = data[t]
                nnz += 1
            elif row >= 0:
                B[row, -1 - to] = data[t]
            elif to >= 0:
                B[to, -1 - row] = data[t]
            else:
                S[-1 - row, -1 - to] = data[t]
                S[-1 - to, -1 - row] = data[t]
