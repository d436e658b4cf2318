"""The choice of an order and of factors; whether a matrix is symmetric, or definite."""

import contextlib
from typing import Any

import numpy as np
from scipy.linalg.lapack import dpotrf
from scipy.sparse import csc_array

from namlcp.arrays import dense_asymmetry, sparse_asymmetry
from namlcp.limits import NEVER, PASS, Deadline
from namlcp.linalg.csc import as_dense
from namlcp.linalg.fronts import Fronts
from namlcp.linalg.ordering import Order, minimum_degree, nested_dissection
from namlcp.linalg.sparse_ldl import Factors, SparseFactors
from namlcp.linalg.threads import THREADS

PSD_SLACK = 1e-6
"""Negative curvature of a matrix with unit diagonal that may be due to the rounding of
its data to single precision."""

SYMMETRY_ROUNDING = 1e-14
"""Largest |A - A'|, relative to max |A|, that rounding in double precision explains."""

# Largest order at which a dense Cholesky factorisation tells the signs of pivots.
DENSE_ORDER = 200
# Work of a factorisation, see `Order.work`, in all and for each row, from which on
# dense fronts are used: a factorisation and six solves take as long both ways there.
HEAVY, HEAVY_ROW = 1.2e6, 1200.0
# Most entries of updates that wait at once, for each entry of L, for which they are.
MOST_WAITING = 12.0
# Work for each row, and entries of L for each one of the matrix, from which on nested
# dissection is tried, too.
DEEP, FILL = 1e5, 4.0
# Seconds for an entry that nested dissection takes, which cannot be interrupted.
DISSECTION = 2.5e-6


def plan_factors(
    indptr: np.ndarray, indices: np.ndarray, deadline: Deadline = NEVER
) -> Factors:
    """Return the factors that suit a pattern; `refactor` computes them.

    The pattern is a triangle as `sparse_ldl` takes it. Raises OutOfTime.
    """
    order = best_order(indptr, indices, deadline)
    deadline.check(PASS * order.entries)
    if order.work >= max(HEAVY, HEAVY_ROW * order.parent.size):
        with contextlib.suppress(MemoryError):  # of updates, far more than of L
            fronts = Fronts(indptr, indices, order, None, THREADS.get())
            if fronts.stack <= MOST_WAITING * order.entries:
                return fronts
    return SparseFactors(indptr, indices, order)


def plan_lu(indptr: np.ndarray, indices: np.ndarray) -> Fronts:
    """Return factors L D U for a symmetric pattern in CSC, its diagonal entries stored.

    No row is exchanged. `another` gives factors of further matrices of the pattern.
    """
    n, numbers = indptr.size - 1, np.arange(indices.size)
    # by rows, the entries of a symmetric pattern are those across the diagonal
    across = csc_array((numbers, indices, indptr), shape=(n, n)).tocsr().data
    order = best_order(indptr, indices, NEVER)
    is_below = order.place[indices] > np.repeat(order.place, np.diff(indptr))
    pairs = np.where(is_below, (numbers, across), (across, numbers))
    return Fronts(indptr, indices, order, pairs)


def best_order(indptr: np.ndarray, indices: np.ndarray, deadline: Deadline) -> Order:
    """Return the order by minimum degree, or nested dissection if that is less work."""
    order = minimum_degree(indptr, indices, deadline)
    if order.work <= DEEP * order.parent.size or order.entries < FILL * indices.size:
        return order
    if deadline.reached(DISSECTION * indices.size):
        return order
    other = nested_dissection(indptr, indices)
    return order if other is None or other.work >= order.work else other


# ---- symmetry and definiteness, up to rounding


def asymmetry(C: Any) -> tuple[float, float]:
    """Return (max |C - C'|, max |C|) of a square matrix, dense or canonical CSC/CSR."""
    if type(C) is np.ndarray:
        return dense_asymmetry(C)
    return sparse_asymmetry(C.indptr, C.indices, C.data)


def is_symmetric(A: Any) -> bool:
    """Tell whether A (dense, or canonical CSC or CSR) = A' up to rounding."""
    gap, size = asymmetry(A)
    return gap <= SYMMETRY_ROUNDING * size


def has_positive_pivots(triangle: csc_array, deadline: Deadline = NEVER) -> bool:
    """Tell whether the matrix with this upper triangle has an L D L' with D > 0.

    All diagonal entries are stored, as the last of their columns. OutOfTime if the
    deadline is reached before.
    """
    n = triangle.shape[0]
    if n <= DENSE_ORDER:
        deadline.check(PASS * n * n)  # about as long as it takes, without the clock
        lower = as_dense(triangle).T  # in the order of columns, as LAPACK has it
        return bool(dpotrf(lower, lower=1, clean=0, overwrite_a=1)[1] == 0)
    factors = plan_factors(triangle.indptr, triangle.indices, deadline)
    try:
        factors.refactor(triangle.data, deadline)
    except ValueError:  # a pivot is 0
        return False
    return bool((factors.pivots > 0.0).all())
