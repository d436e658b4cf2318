"""Factors of M + diag(x) for one matrix M and many x.

`Shifted` has LU factors of any M. SuperLU orders the columns of a sparse matrix on the
first call. Later calls keep this order, which saves a sixth to two fifths of their time
and changes the fill by 10 %. `Quasidefinite` has those of symmetric matrices.
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
    """A matrix M, dense or sparse, and the factors of its sums with diagonals."""

    def __init__(self, M: Any):
        self.M, self.order = M, np.arange(M.shape[0], dtype=np.int32)
        self.is_ordered = False
        if sparse.issparse(M):  # its whole diagonal is stored; equal entries are added
            M = sparse.coo_array(M)
            rows, columns = (np.append(x, self.order) for x in (M.row, M.col))
            data = np.append(M.data, np.zeros(self.order.size))
            self.M = sparse.csc_array((data, (rows, columns)), M.shape)
            self.find_diagonal()

    def find_diagonal(self) -> None:
        """Note where the diagonal entries are: column k of M is column order[k]."""
        asked = np.repeat(self.order, np.diff(self.M.indptr))
        self.diagonal = np.flatnonzero(self.M.indices == asked)

    def factors(self, diagonal: np.ndarray) -> Factors | None:
        """Factor M + diag(diagonal); return None if it is exactly singular."""
        if sparse.issparse(self.M):
            return self.sparse_factors(diagonal)
        K = self.M.copy(order="F")
        K[np.diag_indices_from(K)] += diagonal
        lu, pivots, info = dgetrf(K, overwrite_a=1)
        if info != 0:
            return None

        def is_positive() -> bool:
            swaps = np.count_nonzero(pivots != np.arange(pivots.size))
            return is_even(int(swaps), lu.diagonal())

        return Factors(lambda b: dgetrs(lu, pivots, b)[0], lu.size, is_positive)

    def sparse_factors(self, diagonal: np.ndarray) -> Factors | None:
        order, K = self.order, self.M.copy()
        K.data[self.diagonal] += diagonal[order]
        try:
            lu = splu(K, permc_spec="NATURAL" if self.is_ordered else "COLAMD")
        except RuntimeError:  # exactly singular
            return None
        if not self.is_ordered:
            self.order, self.is_ordered = np.argsort(lu.perm_c).astype(np.int32), True
            self.M = self.M[:, self.order]
            self.M.sort_indices()
            self.find_diagonal()

        def solve(b: np.ndarray) -> np.ndarray:
            x = np.empty_like(b)
            x[order] = lu.solve(b)
            return x

        def is_positive() -> bool:
            swaps = sum(map(transpositions, (lu.perm_r, lu.perm_c, order)))
            return is_even(swaps, lu.U.diagonal())

        return Factors(solve, int(lu.nnz), is_positive)


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


def transpositions(order: np.ndarray) -> int:
    """Return how many transpositions make up a permutation."""
    graph = sparse.csr_array((np.ones(order.size), order, np.arange(order.size + 1)))
    return order.size - int(connected_components(graph)[0])


def is_even(swaps: int, pivots: np.ndarray) -> bool:
    return bool((swaps + np.count_nonzero(pivots < 0.0)) % 2 == 0)
