"""Scaling of the variables of a dense QP where the diagonal of P varies very much.

With x = c t, c_j a power of two near 1 / sqrt(p_jj), the matrix for t has a diagonal
near 1. The dual active-set method compares a violation with |row| |x|, which is far
above its rounding error where large entries of the row meet small entries of x.
"""

import numpy as np

from namlcp.compiled import part
from namlcp.qp.problem import QP

# Largest over smallest diagonal entry of P above which the QP is scaled.
SPREAD = 1e12
# Largest modulus of an exponent of 2 in c, so that p_jj c_j^2 cannot overflow.
LARGEST_EXPONENT = 500


@part
def is_badly_scaled(P):
    """Tell whether the diagonal is positive and its entries differ by over SPREAD."""
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
    with np.errstate(over="ignore"):  # residuals that are not finite are not accepted
        scaled = c[:, None] * P * c, c * q, G * c, h, A * c, b, lb / c, ub / c
    return QP(*scaled)
