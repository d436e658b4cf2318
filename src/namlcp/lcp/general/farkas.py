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
from namlcp.lcp.general.homogeneous import homogeneous_path
from namlcp.lcp.shifted import Quasidefinite

CLEAR, CLEARER = 1e3, 10.0
"""A proof is sought once kappa / tau of the path exceeds CLEAR, and again whenever it
has grown by the factor CLEARER."""

FEASIBLE = 1e-6
"""kappa / tau of the path below which the program counts as feasible."""


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

    def system(model: Distances) -> Quasidefinite:
        return Quasidefinite(model.M, np.where(model.kept < n, 1.0, -1.0))

    clear = CLEAR
    for ratio, ray in homogeneous_path(matrix, q, lower, upper, system):
        if ratio < FEASIBLE:
            return
        v = np.zeros(n)
        if ratio > clear:
            v[rows], clear = ray[n:], CLEARER * ratio
        yield v
