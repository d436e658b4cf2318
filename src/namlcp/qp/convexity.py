"""Is P positive semidefinite? Asked of P itself, before anything is believed.

The KKT matrix hides negative curvature behind its constraints, and a stationary point
of a non-convex problem passes every residual. So: signs of the diagonal, minors of
order two, diagonal dominance; a large P may be an H+ matrix; if none of that decides,
the pivots of P scaled to a unit diagonal plus `SLACK` I.
"""

from typing import Any

import numpy as np
import qdldl
from numba import njit
from scipy.sparse import csc_matrix

from namlcp.lcp.comparison import is_h_plus
from namlcp.lcp.pivoting import SLACK

# A diagonal entry below this times max |P| counts as zero, and so must its row.
ZERO = 1e-15
# From this order on a factorisation may cost far more than the multigrid of is_h_plus.
LARGE = 50_000

CONVEX, NEGATIVE, MINOR, UNDECIDED = 0, 1, 2, 3


class NotConvex(ValueError):
    """P is not positive semidefinite."""


def check_convex(P: Any) -> None:
    """Raise NotConvex unless P (CSC, symmetric) is positive semidefinite."""
    code, i, j, indptr, indices, data = unit_triangle(P.indptr, P.indices, P.data)
    if code == CONVEX:
        return
    if code == UNDECIDED and P.shape[0] >= LARGE and is_h_plus(P.T):
        return
    reason = f"an eigenvalue of P with its diagonal scaled to 1 is below -{SLACK:g}"
    if code == NEGATIVE:
        reason = f"its diagonal entry {j} is negative"
    elif code == MINOR:
        reason = f"the determinant of its rows and columns {i} and {j} is negative"
    elif has_positive_pivots(csc_matrix((data, indices, indptr), shape=P.shape)):
        return
    raise NotConvex(f"P must be positive semidefinite: {reason}")


def has_positive_pivots(triangle: csc_matrix) -> bool:
    """Tell whether L D L' of a matrix, its upper triangle given, has D > 0."""
    try:
        pivots = qdldl.Solver(triangle, upper=True).factors()[1]
    except (RuntimeError, ValueError):  # a pivot is exactly zero
        return False
    return bool((pivots > 0.0).all())


@njit(cache=True, nogil=True)
def unit_triangle(indptr, indices, data):
    """Return (code, i, j) and the upper triangle of R^-1 (P + t I) R^-1 + SLACK I.

    t = ZERO max |P| stands for rounding, R has the roots of the diagonal of P + t I.
    i and j say where NEGATIVE (j) or MINOR was found.
    """
    n = indptr.size - 1
    diagonal = np.zeros(n)
    size = 0.0
    for j in range(n):
        for t in range(indptr[j], indptr[j + 1]):
            size = max(size, abs(data[t]))
            if indices[t] == j:
                diagonal[j] = data[t]
    tiny = ZERO * size
    up = np.zeros(n + 1, dtype=np.int32)
    ui = np.empty(data.size + n, dtype=np.int32)
    ux = np.empty(data.size + n)
    root = np.sqrt(np.maximum(diagonal, 0.0) + max(tiny, 1e-300))
    code = CONVEX
    nnz = 0
    for j in range(n):
        if diagonal[j] < -tiny:
            return NEGATIVE, j, j, up, ui, ux
        rest = 0.0
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i == j:
                continue
            rest += abs(data[t])
            bound = np.sqrt(max(diagonal[i], 0.0) * max(diagonal[j], 0.0))
            if abs(data[t]) > bound * (1.0 + 2.0 * SLACK) + tiny:
                return MINOR, i, j, up, ui, ux
            if i < j:
                ui[nnz] = i
                ux[nnz] = data[t] / (root[i] * root[j])
                nnz += 1
        if rest > diagonal[j]:
            code = UNDECIDED
        ui[nnz] = j
        ux[nnz] = 1.0 + SLACK
        nnz += 1
        up[j + 1] = nnz
    return code, 0, 0, up, ui[:nnz], ux[:nnz]
