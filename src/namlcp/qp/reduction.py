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
from namlcp.compiled import kernel


def box_lcp(qp: QPData) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """Return (A, q, lower, upper) of the box LCP that a QP with bounds only is.

    P is symmetric, so that its compressed columns pass for compressed rows.
    """
    return qp.P, qp.q, qp.lb, qp.ub


@kernel
def box_point(z, w, lower, upper):
    """Return (x, z_box): x on its bound and z_box = -w where z - w leaves the box.

    Elsewhere z_box = 0; a w of the wrong sign, too small to move z - w off its bound,
    is left to the residual.
    """
    x, z_box = np.empty(z.size), np.empty(z.size)
    for j in range(z.size):
        s = z[j] - w[j]
        x[j], z_box[j] = z[j], 0.0
        if s <= lower[j]:
            x[j], z_box[j] = lower[j], min(-w[j], 0.0)
        elif s >= upper[j]:
            x[j], z_box[j] = upper[j], max(-w[j], 0.0)
    return x, z_box


@kernel
def is_box_open(lower, upper):
    """Tell whether there is a finite point in the box."""
    for j in range(lower.size):
        if lower[j] > upper[j] or lower[j] == np.inf or upper[j] == -np.inf:
            return False
    return True
