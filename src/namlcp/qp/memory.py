"""What one solve leaves to the next of the same shape.

A problem whose matrices stay and whose vectors change (model predictive control, a path
of penalties) needs its presolve, its scaling and, on the same face, its factorisation
once. A problem that keeps only the pattern keeps the elimination order.
"""

import numpy as np

from namlcp.checks import QPData
from namlcp.qp.presolve import Presolved
from namlcp.qp.scaling import ScaledQP
from namlcp.qp.substitution import Substitution


class Memory:
    """Kept by the caller from solve to solve; not for two solves at a time.

    Parts are recognised by the identity of their matrices: `recognised` gives equal
    matrices the identity of the last ones.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self.qp: QPData | None = None
        self.substitution: Substitution | None = None
        self.presolved: Presolved | None = None
        self.problem: ScaledQP | None = None

    def recognised(self, qp: QPData) -> QPData:
        """Return qp with the last matrices where they are the same, and remember it."""
        if self.qp is not None and not (qp.is_dense or self.qp.is_dense):
            old = self.qp
            P, G, A = (
                known if is_same(known, new) else new
                for known, new in ((old.P, qp.P), (old.G, qp.G), (old.A, qp.A))
            )
            qp = qp._replace(P=P, G=G, A=A)
        self.qp = qp
        return qp


def is_same(M: object, N: object) -> bool:
    """Tell whether two matrices in CSC are equal, entry by entry."""
    return M.shape == N.shape and all(  # type: ignore[attr-defined]
        np.array_equal(getattr(M, part), getattr(N, part))
        for part in ("indptr", "indices", "data")
    )
