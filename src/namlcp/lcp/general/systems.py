"""The linear systems M + D of interior paths, D > 0 diagonal.

Contact with friction has a speed g beside the impulses b_j along each direction. Its
diagonal entry in M is 0, its column has v_j > 0 in the rows of the b_j, its row -v_j
there and one entry more. Such an M + D is factored without exchanges of rows, whatever
D is, in one order for all D: SuperLU, which exchanges some, takes two to four times as
long. No pivot was too small, and one of fifty solutions needed a correction, in all the
problems of `validation.general`.
"""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.shifted import Shifted, ShiftedFactors
from namlcp.linalg import plan_lu

# Largest difference of entries of M, with a diagonal of 1 and 0, that counts as 0.
SAME = 1e-11
# Error of a solution, relative to the largest entry of its side, that is corrected.
WRONG = 1e-12


def has_friction(M: Any) -> bool:
    """Tell whether all unknowns of a sparse M with the diagonal entry 0 are speeds."""
    g = np.flatnonzero(M.diagonal() == 0.0)
    columns = sparse.csc_array(M)[:, g]
    rest = sparse.csr_array(sparse.csr_array(M)[g] + columns.T)
    rest.data[np.abs(rest.data) <= SAME] = 0.0
    rest.eliminate_zeros()
    is_one = (np.diff(rest.indptr) == 1).all()
    return bool(g.size > 0 and is_one and columns.data.min(initial=1.0) > 0.0)


class WithFriction:
    """A sparse M with friction, and factors of its sums with diagonals > 0."""

    def __init__(self, M: Any):
        self.plain = Shifted(M)
        N, every = sparse.coo_array(M), np.arange(M.shape[0])
        # all entries across the diagonal from others are stored, and the diagonal
        rows = np.concatenate((N.row, N.col, every))
        columns = np.concatenate((N.col, N.row, every))
        data = np.append(N.data, np.zeros(rows.size - N.nnz))
        self.K = sparse.csc_array((data, (rows, columns)), shape=N.shape)
        self.K.sort_indices()
        own = np.repeat(every, np.diff(self.K.indptr))
        self.diagonal = np.flatnonzero(self.K.indices == own)
        self.plan = plan_lu(self.K.indptr, self.K.indices)

    def factors(self, diagonal: np.ndarray) -> ShiftedFactors | None:
        """Factor M + diag(diagonal); return None if it is exactly singular."""
        K, lu = self.K.copy(), self.plan.another()
        K.data[self.diagonal] += diagonal
        try:
            lu.refactor(K.data)
        except ValueError:  # a pivot is 0: rows must be exchanged
            return self.plain.factors(diagonal)

        def solve(b: np.ndarray) -> np.ndarray:
            if b.ndim == 2:
                return np.column_stack([solve(column) for column in b.T])
            x = lu.solve(np.ascontiguousarray(b))
            error = b - K @ x
            if np.abs(error).max() > WRONG * np.abs(b).max():
                x += lu.solve(error)
            return x

        def is_positive() -> bool:
            return bool(np.count_nonzero(lu.pivots < 0.0) % 2 == 0)

        return ShiftedFactors(solve, lu.entries, is_positive)


System = Shifted | WithFriction


def system_of(M: Any) -> System:
    if sparse.issparse(M) and has_friction(M):
        return WithFriction(M)
    return Shifted(M)
