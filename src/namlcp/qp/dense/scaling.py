"""Scaling of the variables of a dense QP whose units are very different.

With x = c t, c powers of two near 1 / sqrt(p_jj), the matrix of t has a diagonal near
1. The dual active-set method compares a violation with |row| |x|, which says nothing
about rounding where entries of 1e8 in the row meet entries of 1e-8 in x.
"""

import numpy as np

from namlcp.compiled import part
from namlcp.qp.problem import QP

# Largest over smallest diagonal entry of P above which scaled copies are worth making.
SPREAD = 1e12
# Largest exponent of 2 in c, so that p_jj c^2 cannot overflow.
LARGEST_EXPONENT = 500


@part
def is_badly_scaled(P):
    """Tell whether the diagonal is positive and spreads over more than SPREAD."""
    low, high = np.inf, 0.0
    for j in range(P.shape[0]):
        low = min(low, P[j, j])
        high = max(high, P[j, j])
    return low > 0.0 and high / SPREAD > low


def variable_scaling(P: np.ndarray) -> np.ndarray:
    """Return c for a dense P with a positive diagonal."""
    exponent = np.round(-0.5 * np.log2(np.diagonal(P)))
    exponent = np.clip(exponent, -LARGEST_EXPONENT, LARGEST_EXPONENT)
    return np.ldexp(1.0, exponent.astype(np.int32))


def scaled_qp(qp: QP, c: np.ndarray) -> QP:
    """Return the dense QP of t = x / c."""
    P, q, G, h, A, b, lb, ub = qp
    with np.errstate(over="ignore"):  # the residuals refuse what overflows
        scaled = c[:, None] * P * c, c * q, G * c, h, A * c, b, lb / c, ub / c
    return QP(*scaled)
