"""QP and box LCP: the one module that knows both alphabets.

QP, bounds only                       box LCP
P, q                                  A, q
lb <= x <= ub                         lower <= z <= upper
x                                     z
-z_box = P x + q                      w = A z + q
z_box <= 0 at lb, >= 0 at ub          w >= 0 at lower, <= 0 at upper
ray x, q'x = -1                       ray v, q'v = -1 (no solution)
"""

from typing import Any

import numpy as np

from namlcp.checks import QPData


def box_lcp(qp: QPData) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """Return (A, q, lower, upper) of the box LCP that a QP with bounds only is.

    P is symmetric, so that its compressed columns are its compressed rows.
    """
    A = qp.P if qp.is_dense else qp.P.T
    return A, qp.q, qp.lb, qp.ub


def bound_multipliers(
    z: np.ndarray, w: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Return z_box = -w where z is at the bound that allows its sign, else 0."""
    return np.where(
        z <= lower, -np.maximum(w, 0.0), np.where(z >= upper, -np.minimum(w, 0.0), 0.0)
    ) + np.where((z <= lower) & (z >= upper), -np.minimum(w, 0.0), 0.0)
