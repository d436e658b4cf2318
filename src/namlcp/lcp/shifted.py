"""Factors of M + diag(x) for one matrix M and many x.

`Shifted` has LU factors of any M, `Quasidefinite` those of symmetric matrices.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy import sparse
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from namlcp.linalg.factors import plan_factors

# Entry of x that holds an unknown: it is 0 in the solution for a side that is.
HELD = 1e20


class Factors(NamedTuple):
    """Factors of a sum, with as many entries.

    solve: b, (n,) or (n, k), to the solution. is_positive: whether the determinant is.
    """

    solve: Callable[[np.ndarray], np.ndarray]
    entries: int
    is_positive: Callable[[], bool]


class System(Protocol):
    """A matrix, and the factors of its sums with diagonals."""

    def factors(self, diagonal: np.ndarray) -> Any:
        """Return the `Factors` of a sum, or what has their names; None if singular."""


class Shifted:
    """A matrix M, dense or sparse, and LU factors of its sums with diagonals."""

    def __init__(self, M: Any):
        self.M = M

    def factors(self, diagonal: np.ndarray) -> Factors | None:
        """Factor M + diag(diagonal); return None if it is exactly singular."""
        if sparse.issparse(self.M):
            K = sparse.csc_array(self.M + sparse.diags_array(diagonal))
            try:
                lu = splu(K)
            except RuntimeError:
                return None
            return Factors(
                lu.solve,
                int(lu.nnz),
                lambda: is_even(lu.U.diagonal(), lu.perm_r, lu.perm_c),
            )
        K = self.M.copy(order="F")
        K[np.diag_indices_from(K)] += diagonal
        lu, pivots, info = dgetrf(K, overwrite_a=1)
        if info != 0:
            return None

        def is_positive() -> bool:
            swaps = np.count_nonzero(pivots != np.arange(pivots.size))
            return bool((swaps + np.count_nonzero(lu.diagonal() < 0.0)) % 2 == 0)

        return Factors(lambda b: dgetrs(lu, pivots, b)[0], lu.size, is_positive)


class Quasidefinite:
    """A sparse matrix M that is symmetric but for signs, and its sums with x > 0.

    M = [B C'; -C D] with symmetric B and D becomes symmetric when the signs of its
    lower rows are changed; if B and D are semidefinite, the sums are quasi-definite.
    They are factored as such: SuperLU takes up to a hundred times as long.
    """

    def __init__(self, M: sparse.csc_array, signs: np.ndarray):
        """`signs` (m,) is 1 in the upper rows, -1 in the lower ones."""
        self.M, self.signs, self.own = M, signs, M.diagonal()
        pattern = M + sparse.diags_array(1.0 + np.abs(self.own))
        upper = sparse.csc_array(sparse.triu(sparse.diags_array(signs) @ pattern))
        upper.sort_indices()
        self.data, self.last = upper.data, upper.indptr[1:] - 1
        self.plan = plan_factors(upper.indptr, upper.indices)

    def factors(self, diagonal: np.ndarray) -> Any:
        self.data[self.last] = self.signs * (self.own + diagonal)
        try:
            self.plan.refactor(self.data)
        except ValueError:  # a pivot is 0, by rounding: exchange rows
            return Shifted(self.M).factors(diagonal)
        return self

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return the solution for b (m,), with the factors of the last sum."""
        return self.plan.solve(self.signs * b)


def is_even(pivots: np.ndarray, *orders: np.ndarray) -> bool:
    """Tell whether pivots and permutations make a determinant > 0."""
    changes = np.count_nonzero(pivots < 0.0)
    for order in orders:  # n less the cycles is the number of transpositions
        n = order.size
        graph = sparse.csr_array((np.ones(n), order, np.arange(n + 1)))
        changes += n - connected_components(graph)[0]
    return bool(changes % 2 == 0)
