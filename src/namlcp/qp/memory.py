"""What a solve keeps for the next QP with the same matrices or the same pattern.

Where only vectors change, as in model predictive control, presolve and scaling are
reused, and the factors as long as the active set stays. Where only the pattern stays,
the elimination order is reused.
"""

from typing import Any

from namlcp.lcp import Prepared
from namlcp.limits import NEVER, Deadline
from namlcp.qp.convexity import check_convex


class Memory:
    """Kept by the caller from solve to solve; not for two solves at a time.

    `convex` is the last P found positive semidefinite; `substitution`, `presolved` and
    `scaled` are the last transforms, `box` the last P prepared for box LCPs. Matrices
    are the same as before where they are the same objects.
    `dense_failed`: whether the dense form of the QP, as it came, was tried and failed.
    """

    substitution: Any = None
    presolved: Any = None
    scaled: Any = None
    box: Prepared | None = None
    dense_failed = False

    def __init__(self, convex: Any = None) -> None:
        self.convex = convex

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
