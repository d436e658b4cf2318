"""Factors of the KKT matrix: of few columns at a time, or dense fronts.

One fill-reducing order is made; its counts tell the work of a factorisation. Where L is
sparse, up to four columns of it are taken at a time (`sparse_ldl`). With much fill,
dense fronts are faster (`multifrontal`).
"""

from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix

from namlcp.compiled import floats_at, ints_at, kernel, longs_at, part, record_of
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.multifrontal import Multifrontal
from namlcp.linalg.ordering import Order, nested_dissection
from namlcp.linalg.sparse_ldl.factor import factor_sparse, ldl_factor
from namlcp.linalg.sparse_ldl.pattern import Pattern, analyse
from namlcp.linalg.sparse_ldl.solve import ldl_solve_into, solve_sparse

# Work of a factorisation, see `Order.work`, from which on dense fronts are used: a
# factorisation and six solves take as long both ways there.
HEAVY = 3e8
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
    order = better_order(indptr, indices, minimum_degree(indptr, indices))
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
