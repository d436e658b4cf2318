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
from namlcp.lcp.pivoting import homogeneous_path

FEASIBLE = 1e-6
"""kappa / tau of the path at which the program counts as feasible."""


def farkas(lcp: LCP) -> Iterator[np.ndarray]:
    """Yield directions v (n,) that may be proofs, and 0 while there is none.

    There is one factorisation from each to the next. The last one comes where the
    linear program is feasible.
    """
    low, high = np.isfinite(lcp.lower), np.isfinite(lcp.upper)
    rows = np.flatnonzero(~(low & high))
    n = lcp.q.size
    A = sparse.csr_array(lcp.A)[rows]
    matrix = sparse.block_array([[None, -A.T], [A, None]], format="csc")
    lower = np.append(lcp.lower, np.where(low, 0.0, -np.inf)[rows])
    upper = np.append(lcp.upper, np.where(high, 0.0, np.inf)[rows])
    q = np.concatenate((np.zeros(n), lcp.q[rows]))
    for point in homogeneous_path(matrix, q, lower, upper):
        if point.ratio < FEASIBLE:
            return
        v = np.zeros(n)
        if point.ratio > 1.0:
            v[rows] = point.z[n:]
        yield v
