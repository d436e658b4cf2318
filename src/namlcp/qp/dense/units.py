"""Variables in very different units, for the dense form, which has no other scaling.

With x = c t, c powers of two near 1 / sqrt(p_jj), the matrix of t has a diagonal near
1. The pivoting measures a row against |row| |x|, which says nothing of rounding where
entries of 1e8 in the row meet entries of 1e-8 in x.
"""

import numpy as np

from namlcp.compiled import part
from namlcp.qp.problem import QP

# Diagonals of P that spread further are worth the copy of all matrices.
SPREAD = 1e12
# Exponents of c beyond this are cut, so that p_jj c^2 cannot overflow.
EXPONENT = 500


@part
def is_uneven(P):
    """Tell whether the diagonal is positive and spreads over more than SPREAD."""
    low = np.inf
    high = 0.0
    for j in range(P.shape[0]):
        low = min(low, P[j, j])
        high = max(high, P[j, j])
    return low > 0.0 and high / SPREAD > low


def column_units(P: np.ndarray) -> np.ndarray:
    """Return c for a dense P with a positive diagonal."""
    exponent = np.round(-0.5 * np.log2(np.diagonal(P)))
    return np.ldexp(1.0, np.clip(exponent, -EXPONENT, EXPONENT).astype(np.int32))


def in_units(qp: QP, c: np.ndarray) -> QP:
    """Return the dense QP of t = x / c."""
    P, q, G, h, A, b, lb, ub = qp
    with np.errstate(over="ignore"):  # what overflows cannot be solved, and is judged
        scaled = c[:, None] * P * c, c * q, G * c, h, A * c, b, lb / c, ub / c
    return QP(*scaled)
