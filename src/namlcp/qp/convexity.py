"""The test whether P is positive semidefinite, made before a solution is accepted.

Constraints can hide negative curvature in the KKT matrix, and a stationary point of a
non-convex problem passes every residual check. The tests are, in this order: the signs
of the diagonal, minors of order two, diagonal dominance, whether a large P is an H+
matrix, and the pivots of P, scaled to a unit diagonal, plus `PSD_SLACK` times I.
"""

from typing import Any

import numpy as np
from scipy.linalg.lapack import dpotrf

from namlcp.checks import as_sparse, from_arrays
from namlcp.limits import NEVER, Deadline
from namlcp.linalg import (
    LEAST_DIVISOR,
    PSD_SLACK,
    arrays_of,
    has_positive_pivots,
    unit_triangle,
)
from namlcp.theory import is_h_plus

# Least order of P for which `is_h_plus`, a multigrid method, is tried before a
# factorisation, which may cost far more.
MULTIGRID_ORDER = 50_000
# Entry p_jj, relative to max |P|, up to which it counts as 0; row j must be 0 then.
ZERO = 1e-15


class NotConvex(ValueError):
    """P is not positive semidefinite: the QP is not convex.

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> try:
    ...     namlcp.solve_qp(-np.eye(1), np.zeros(1))
    ... except namlcp.NotConvex as error:
    ...     print(error)
    P must be positive semidefinite: its diagonal entry 0 is negative
    """


def check_convex(P: Any, deadline: Deadline = NEVER) -> None:
    """Raise NotConvex unless P, symmetric, dense or CSC, is positive semidefinite.

    OutOfTime if the deadline is reached before.
    """
    if type(P) is np.ndarray:
        if dpotrf(P)[1] == 0:
            return  # definite, as most are: this takes a tenth of the time
        P = as_sparse(P)
    sign, i, j, parts = unit_triangle(*arrays_of(P), ZERO, LEAST_DIVISOR, PSD_SLACK)
    if sign > 0:
        return
    if sign == 0:
        if P.shape[0] >= MULTIGRID_ORDER and is_h_plus(P.T):
            return
        order = parts[0].size - 1
        if has_positive_pivots(from_arrays(parts, (order, order)), deadline):
            return
        reason = (
            f"an eigenvalue of P with its diagonal scaled to 1 is below -{PSD_SLACK:g}"
        )
    elif i == j:
        reason = f"its diagonal entry {j} is negative"
    else:
        reason = (
            f"the determinant of its rows and columns {i} and {j} is negative, and so "
            "is an eigenvalue"
        )
    raise NotConvex(f"P must be positive semidefinite: {reason}")
