"""Factors of the KKT matrix: qdldl, dense fronts, or qdldl and a dense border.

qdldl works entry by entry, which is best where L is sparse. Where the symbolic analysis
counts much fill, dense fronts are ten times faster (`multifrontal`). Where some rows
and columns are dense (a dense data matrix in a support vector machine, a dense P), most
of a sparse factorisation is spent on one dense block. There the matrix is split into a
sparse part R and a dense border D,

    K = [K_R  B  ]      X = K_R^-1 B,   S = K_D - B'X,
        [B'   K_D]      K u = r:  u_D = S^-1 (r_D - B' K_R^-1 r_R),
                                  u_R = K_R^-1 r_R - X u_D

with qdldl for K_R and LAPACK for S.
"""

from typing import Protocol

import numpy as np
import qdldl
from scipy.linalg.lapack import dpotrf, dpotrs, dsytrf, dsytrf_lwork, dsytrs
from scipy.sparse import csc_array, csc_matrix

from namlcp.compiled import kernel
from namlcp.linalg.csc import MOST_DENSE
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.multifrontal import Multifrontal
from namlcp.linalg.ordering import Order, degrees, nested_dissection

# Entries of the upper triangle of K from which on a border is looked for.
BORDER_ENTRIES = 20_000
# Off-diagonal entries of a row of K up to which it always stays in the sparse part.
SPARSE_DEGREE = 16
# Rows of a border at least and at most.
LEAST_BORDER, MOST_BORDER = 50, 3000
# Density of B from which a border pays. A border of WIDE rows pays with a sparser B too
# if the upper triangle of K_D has FULL_D times its order squared entries (0.5 is all).
DENSE_B, WIDE, FULL_D = 0.1, 600, 0.2
# Multiplications of a factorisation from which dense fronts pay; multiplications a row
# from which nested dissection is tried too.
HEAVY, DEEP = 1.5e7, 1e5
# A row with more entries than this times the square root of the order is a hub. Around
# hubs, no order for dense fronts is sought.
HUB = 10.0
# Fill is counted if K has at least so many entries, and so many a column, for one pair.
COUNT_FILL = (200_000, 0), (20_000, 3), (5_000, 4)


class Factors(Protocol):
    """Factors of a quasi-definite matrix; ValueError if a pivot is 0."""

    def refactor(self, data: np.ndarray) -> None:
        """Factor again with other values in the same pattern."""

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""


def factor(matrix: csc_array) -> Factors:
    """Return factors of a quasi-definite matrix, its upper triangle given in CSC."""
    border = dense_border(matrix.indptr, matrix.indices)
    if border.size:
        return Bordered(matrix, border)
    order = heavy_order(matrix.indptr, matrix.indices)
    return SparseFactors(matrix) if order is None else Multifrontal(matrix, order)


class SparseFactors:
    """L D L' by qdldl."""

    def __init__(self, matrix: csc_array | csc_matrix) -> None:
        self.matrix = matrix
        self.solver = qdldl.Solver(matrix, upper=True)

    def refactor(self, data: np.ndarray) -> None:
        """Factor again with other values."""
        if data is not self.matrix.data:
            self.matrix.data[:] = data
        self.solver.update(self.matrix, upper=True)

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""
        return self.solver.solve(rhs)


class Diagonal:
    """A diagonal matrix as its own factors."""

    def __init__(self, matrix: csc_matrix) -> None:
        self.entries = matrix.data

    def refactor(self, data: np.ndarray) -> None:
        """Take other entries."""
        self.entries = data

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side."""
        return rhs / self.entries


class Bordered:
    """qdldl for the sparse part, LAPACK for the Schur complement on the border.

    border: the rows of D in rising order.
    """

    def __init__(self, matrix: csc_array, border: np.ndarray) -> None:
        size = matrix.shape[0]
        self.indptr, self.indices = matrix.indptr, matrix.indices
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
        self.refactor(matrix.data)

    def refactor(self, data: np.ndarray) -> None:
        """Factor again with other values."""
        inner, B, S = self.inner, self.B, self.S
        S[:] = 0.0
        split(
            self.indptr, self.indices, data, self.place, inner.indices, inner.data, B, S
        )
        if self.factors is None:
            is_diagonal = inner.nnz == self.rest.size
            self.factors = Diagonal(inner) if is_diagonal else SparseFactors(inner)
        else:
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


def heavy_order(indptr: np.ndarray, indices: np.ndarray) -> Order | None:
    """Return the order for dense fronts, None if they do not pay."""
    size = indptr.size - 1
    if not any(indices.size >= max(least, few * size) for least, few in COUNT_FILL):
        return None
    degree = degrees(indptr, indices, np.ones(size, dtype=np.bool_))
    if degree.max() > HUB * np.sqrt(size):
        return None
    order = minimum_degree(indptr, indices)
    if order.work >= DEEP * size:
        other = nested_dissection(indptr, indices)
        if other is not None and other.work < order.work:
            order = other
    return order if order.work >= HEAVY else None


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
