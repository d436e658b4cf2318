"""What a solve keeps for the next QP with the same matrices or the same pattern.

Where only vectors change, as in model predictive control, presolve and scaling are
reused, and the factors as long as the active set stays. Where only the pattern stays,
the elimination order is reused.
"""

from typing import Any

import numpy as np

from namlcp.lcp import Prepared
from namlcp.limits import NEVER, Deadline
from namlcp.linalg import arrays_of
from namlcp.qp.convexity import check_convex
from namlcp.qp.problem import QP


class Memory:
    """Kept by the caller from solve to solve; not for two solves at a time.

    `matrices` are copies of the last P, G and A. `recognised` replaces equal matrices
    by them, so that identity tells whether what was made from a matrix still fits.
    `convex` is the last P found positive semidefinite; `substitution`, `presolved` and
    `scaled` are the last transforms, `box` the last P prepared for box LCPs.
    `dense_failed`: whether the dense form of the QP, as it came, was tried and failed.
    """

    matrices: tuple[Any, ...] = (None, None, None)
    convex: Any = None
    substitution: Any = None
    presolved: Any = None
    scaled: Any = None
    box: Prepared | None = None
    dense_failed = False

    def __init__(self, qp: QP | None = None) -> None:
        """Know the matrices of `qp`, as `adopt` takes them."""
        if qp is not None:
            self.adopt(qp)

    def __reduce__(self) -> tuple[type["Memory"], tuple[()]]:
        """Let a copy start empty: the factors cannot be copied."""
        return Memory, ()

    def adopt(self, qp: QP) -> None:
        """Take the matrices of `qp` as they are, where nobody will change their values.

        P was found positive semidefinite.
        """
        if not qp.is_dense:
            self.matrices = qp.P, qp.G, qp.A
            self.convex = qp.P

    def recognised(self, qp: QP) -> QP:
        """Return qp with the copies of matrices that are equal; others are copied."""
        if qp.is_dense:
            return qp
        pairs = zip(self.matrices, (qp.P, qp.G, qp.A), strict=True)
        self.matrices = tuple(
            old if old is not None and is_same(old, M) else M.copy() for old, M in pairs
        )
        P, G, A = self.matrices
        return qp._replace(P=P, G=G, A=A)

    def ensure_convex(self, P: Any, deadline: Deadline = NEVER) -> None:
        """Raise NotConvex unless P is positive semidefinite; test the same P once."""
        if self.convex is not P:
            check_convex(P, deadline)
            self.convex = P

    def prepared(self, P: Any) -> Prepared:
        """Return P prepared for box LCPs, as before if P is the same."""
        if self.box is None or self.box.A.data is not P.data:
            self.box = Prepared(P.T)
        return self.box


def is_same(M: Any, N: Any) -> bool:
    """Tell whether two matrices in CSC are equal, entry by entry."""
    return M is N or (
        M.shape == N.shape and all(map(are_equal, arrays_of(M), arrays_of(N)))
    )


def are_equal(v: np.ndarray, w: np.ndarray) -> bool:
    """Return np.array_equal(v, w), of short vectors in a fifth of its time."""
    return v is w or (v.shape == w.shape and np.count_nonzero(v == w) == v.size)
