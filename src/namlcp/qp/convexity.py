"""Is P positive semidefinite? Asked of P itself, before anything is believed.

The KKT matrix hides negative curvature behind its constraints, and a stationary point
of a non-convex problem passes every residual. So: signs of the diagonal, minors of
order two, diagonal dominance; a large P may be an H+ matrix; if none of that decides,
the pivots of P scaled to a unit diagonal plus `SLACK` I.
"""

from typing import Any

from namlcp.linalg import (
    CONVEX,
    MINOR,
    NEGATIVE,
    SLACK,
    UNDECIDED,
    curvature,
    has_positive_pivots,
)
from namlcp.theory import is_h_plus

# From this order on a factorisation may cost far more than the multigrid of is_h_plus.
LARGE = 50_000


class NotConvex(ValueError):
    """P is not positive semidefinite."""


def check_convex(P: Any) -> None:
    """Raise NotConvex unless P (CSC, symmetric) is positive semidefinite."""
    code, i, j, triangle = curvature(P)
    if code == CONVEX:
        return
    if code == UNDECIDED and P.shape[0] >= LARGE and is_h_plus(P.T):
        return
    reason = f"an eigenvalue of P with its diagonal scaled to 1 is below -{SLACK:g}"
    if code == NEGATIVE:
        reason = f"its diagonal entry {j} is negative"
    elif code == MINOR:
        reason = f"the determinant of its rows and columns {i} and {j} is negative"
    elif has_positive_pivots(triangle):
        return
    raise NotConvex(f"P must be positive semidefinite: {reason}")
