"""The choice of an order, and of factors: few columns (`sparse_ldl`), or `fronts`."""

import numpy as np
from scipy.sparse import csc_array

from namlcp.limits import NEVER, PASS, Deadline
from namlcp.linalg.fronts import Fronts
from namlcp.linalg.ordering import (
    Order,
    chained,
    minimum_degree,
    nested_dissection,
)
from namlcp.linalg.sparse_ldl import Factors, SparseFactors
from namlcp.linalg.threads import THREADS

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
        fronts = Fronts(indptr, indices, chained(order), None, THREADS.get())
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
