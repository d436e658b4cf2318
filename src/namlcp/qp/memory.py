"""What one solve leaves to the next of the same shape.

A problem whose matrices stay and whose vectors change (model predictive control, a path
of penalties) needs its presolve, its scaling and, as long as the active set stays, its
factorisation once. A problem that keeps only the pattern keeps the elimination order.
"""

from typing import Any

import numpy as np
from scipy.sparse import csc_array

from namlcp.lcp import Prepared
from namlcp.qp.convexity import check_convex
from namlcp.qp.problem import QP
from namlcp.qp.transforms import Presolved, ScaledQP, Substitution


class Memory:
    """Kept by the caller from solve to solve; not for two solves at a time.

    `matrices` are copies of the last P, G and A: `recognised` puts them in the place of
    equal ones, so that what was made from them is recognised by their identity.
    `convex` is the last P found positive semidefinite, `scaled` the last scaled QP, of
    whose presolve and factors the next one takes over what still fits.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self.matrices: list[Any] = []
        self.convex: Any = None
        self.substitution: Substitution | None = None
        self.presolved: Presolved | None = None
        self.scaled: ScaledQP | None = None
        self.rows: Prepared | None = None

    def __reduce__(self) -> tuple[type["Memory"], tuple[()]]:
        """Let a copy begin empty: the factors cannot be copied."""
        return Memory, ()

    def known(self, *matrices: Any) -> list[Any]:
        """Return P, G and A, in CSC, or our copies where they are the same.

        Those are checked already.
        """
        if not self.matrices:
            return list(matrices)
        pairs = zip(self.matrices, matrices, strict=True)
        return [old if is_same(old, M) else M for old, M in pairs]

    def recognised(self, qp: QP) -> QP:
        """Return qp with our copies of its matrices, the last ones where they fit."""
        if qp.is_dense:
            return qp
        kept = self.known(qp.P, qp.G, qp.A)
        ours = {id(M) for M in self.matrices}
        self.matrices = [M if id(M) in ours else M.copy() for M in kept]
        P, G, A = self.matrices
        return qp._replace(P=P, G=G, A=A)

    def ensure_convex(self, P: csc_array) -> None:
        """Raise NotConvex unless P is positive semidefinite; ask once."""
        if self.convex is not P:
            check_convex(P)
            self.convex = P

    def prepared(self, P: csc_array) -> Prepared:
        """Return P, its columns being its rows, for one LCP after another."""
        rows = self.rows
        if rows is None or rows.A.data is not P.data:
            rows = self.rows = Prepared(P.T)
        return rows


def is_same(M: Any, N: Any) -> bool:
    """Tell whether two matrices in CSC are equal, entry by entry."""
    return M is N or (
        M.shape == N.shape
        and np.array_equal(M.indptr, N.indptr)
        and np.array_equal(M.indices, N.indices)
        and np.array_equal(M.data, N.data)
    )
