"""A proof that no z of the box has w = A z + q of the signs that its bounds ask for.

That w has these signs, >= 0 where z has only a lower bound, <= 0 where it has only an
upper one, 0 where it has none, is a linear program without an objective. Its optimality
conditions are a box LCP with a skew-symmetric matrix,

    [ 0  -A_R' ] [ z ]   [  0  ]
    [ A_R  0   ] [ v ] + [ q_R ],

with v signed as w is, R the rows in question; it is monotone for every A, and the
homogeneous path finds a solution, or a ray with its v in the sense of `rays.proof`
(Farkas' lemma).
"""

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP
from namlcp.lcp.distances import Distances
from namlcp.lcp.pivoting import CLEAR, CLEARER, homogeneous_path
from namlcp.lcp.shifted import Shifted, Solver
from namlcp.linalg import plan_factors

FEASIBLE = 1e-6
"""kappa / tau of the path below which the program counts as feasible."""


class SaddleSystem:
    """The matrix [0 -B'; B 0] of a linear program, and its sums with diagonals > 0.

    With the signs of the lower rows changed these are symmetric and quasi-definite.
    They are factored as such: SuperLU takes up to a hundred times as long.
    """

    def __init__(self, M: sparse.csc_array, signs: np.ndarray):
        """`signs` (m,) is 1 in the upper rows, -1 in the lower ones."""
        self.M, self.signs = M, signs
        pattern = M + sparse.diags_array(np.ones(signs.size))
        upper = sparse.csc_array(sparse.triu(sparse.diags_array(signs) @ pattern))
        upper.sort_indices()
        self.data, self.last = upper.data, upper.indptr[1:] - 1
        self.plan = plan_factors(upper.indptr, upper.indices)

    def factors(self, diagonal: np.ndarray) -> Solver | None:
        """Factor the sum; return None if it is singular."""
        self.data[self.last] = self.signs * diagonal
        try:
            self.plan.refactor(self.data)
        except ValueError:  # a pivot is 0, by rounding: exchange rows
            return Shifted(self.M).factors(diagonal)
        return self

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return the solution for b (m,), with the factors of the last sum."""
        return self.plan.solve(self.signs * b)


def farkas(lcp: LCP) -> Iterator[np.ndarray]:
    """Yield directions v (n,) that may be proofs, and 0 while there is none.

    There is one factorisation from each to the next. The last one comes where the
    linear program is feasible.
    """
    low, high = np.isfinite(lcp.lower), np.isfinite(lcp.upper)
    rows = np.flatnonzero(~(low & high))
    n = lcp.q.size
    B = sparse.csr_array(lcp.A)[rows]
    matrix = sparse.block_array([[None, -B.T], [B, None]], format="csc")
    lower = np.append(lcp.lower, np.where(low, 0.0, -np.inf)[rows])
    upper = np.append(lcp.upper, np.where(high, 0.0, np.inf)[rows])
    q = np.concatenate((np.zeros(n), lcp.q[rows]))

    def system(model: Distances) -> SaddleSystem:
        return SaddleSystem(model.M, np.where(model.kept < n, 1.0, -1.0))

    clear = CLEAR
    for point in homogeneous_path(matrix, q, lower, upper, system):
        if point.ratio < FEASIBLE:
            return
        v = np.zeros(n)
        if point.ratio > clear:
            v[rows], clear = point.z[n:], CLEARER * point.ratio
        yield v
