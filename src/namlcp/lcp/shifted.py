"""Factors of M + diag(x) for one matrix M and many x."""

import contextlib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from namlcp.linalg.factors import plan_factors

# Entry of x that holds an unknown: it is 0 in the solution for a side that is.
HELD = 1e20


class ShiftedFactors(NamedTuple):
    """solve: b, (n,) or (n, k), to x. is_positive: whether the determinant is."""

    solve: Callable[[np.ndarray], np.ndarray]
    is_positive: Any = None


class Shifted:
    """A matrix M, dense or sparse, and the factors of its sums with diagonals: LU.

    With `signs` (m,), 1 in the upper rows and -1 in the lower ones of a sparse M = [B
    C'; -C D], B and D symmetric semidefinite, the sums are factored as quasi-definite
    ones: SuperLU takes up to a hundred times as long.
    """

    def __init__(self, M: Any, signs: np.ndarray | None = None):
        self.M, self.signs = M, signs
        if signs is not None:
            self.own = M.diagonal()
            pattern = M + sparse.diags_array(1.0 + np.abs(self.own))
            upper = sparse.csc_array(sparse.triu(sparse.diags_array(signs) @ pattern))
            upper.sort_indices()
            self.data, self.last = upper.data, upper.indptr[1:] - 1
            self.plan = plan_factors(upper.indptr, upper.indices)

    def factors(self, diagonal: np.ndarray) -> ShiftedFactors | None:
        """Factor M + diag(diagonal); return None if it is exactly singular.

        With signs, the next factors overwrite these, and solve takes a b (m,).
        """
        signs, M = self.signs, self.M
        if signs is not None:
            self.data[self.last] = signs * (self.own + diagonal)
            with contextlib.suppress(ValueError):  # a pivot is 0, by rounding
                self.plan.refactor(self.data)
                return ShiftedFactors(lambda b: self.plan.solve(signs * b))
        if sparse.issparse(M):
            try:
                lu = splu(sparse.csc_array(M + sparse.diags_array(diagonal)))
            except RuntimeError:
                return None
            orders = lu.perm_r, lu.perm_c
            return ShiftedFactors(
                lu.solve, lambda: is_even(lu.U.diagonal(), *map(swaps, orders))
            )
        K = M.copy(order="F")
        K[np.diag_indices_from(K)] += diagonal
        if K.size == 0:  # LAPACK refuses it
            return ShiftedFactors(np.copy)
        lu, pivots, info = dgetrf(K, overwrite_a=1)
        if info != 0:
            return None
        swapped = int(np.count_nonzero(pivots != np.arange(pivots.size)))
        return ShiftedFactors(
            lambda b: dgetrs(lu, pivots, b)[0], lambda: is_even(lu.diagonal(), swapped)
        )


def is_even(pivots: np.ndarray, *swapped: int) -> bool:
    return bool((np.count_nonzero(pivots < 0.0) + sum(swapped)) % 2 == 0)


def swaps(order: np.ndarray) -> int:
    """Return the number of transpositions of a permutation: n less its cycles."""
    n = order.size
    graph = sparse.csr_array((np.ones(n), order, np.arange(n + 1)))
    return int(n - connected_components(graph)[0])
