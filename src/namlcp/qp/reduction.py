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

    P is symmetric, so that its compressed columns pass for compressed rows.
    """
    return qp.P, qp.q, qp.lb, qp.ub


def box_point(
    z: np.ndarray, w: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (x, z_box): x on its bound and z_box = -w where z - w leaves the box.

    Elsewhere z_box = 0; the sign is right by construction (0 at an infinite bound).
    """
    s = z - w
    x = np.where(s <= lower, lower, np.where(s >= upper, upper, z))
    return x, np.where((s <= lower) | (s >= upper), -w, 0.0)
