"""Tests whether a matrix is symmetric or positive definite, up to rounding."""

from typing import Any

import numpy as np
from scipy.linalg.lapack import dpotrf
from scipy.sparse import csc_array

from namlcp.arrays import dense_asymmetry, sparse_asymmetry
from namlcp.limits import NEVER, PASS, Deadline
from namlcp.linalg.csc import as_dense
from namlcp.linalg.factors import plan_factors

PSD_SLACK = 1e-6
"""Negative curvature of a matrix with unit diagonal that may be due to the rounding of
its data to single precision."""

SYMMETRY_ROUNDING = 1e-14
"""Largest |A - A'|, relative to max |A|, that rounding in double precision explains."""

DENSE_ORDER, FULL_ORDER, FULL = 200, 2000, 0.6
"""Largest order at which a dense Cholesky factorisation tells the signs of pivots, and
that of a triangle with the part FULL of its entries."""


def asymmetry(C: Any) -> tuple[float, float]:
    """Return (max |C - C'|, max |C|) of a square matrix, dense or canonical CSC/CSR."""
    if type(C) is np.ndarray:
        return dense_asymmetry(C)
    return sparse_asymmetry(C.indptr, C.indices, C.data)


def is_symmetric(A: Any) -> bool:
    """Tell whether A (dense, or canonical CSC or CSR) = A' up to rounding."""
    gap, size = asymmetry(A)
    return gap <= SYMMETRY_ROUNDING * size


def has_positive_pivots(triangle: csc_array, deadline: Deadline = NEVER) -> bool:
    """Tell whether the matrix with this upper triangle has an L D L' with D > 0.

    All diagonal entries are stored, as the last of their columns. OutOfTime if the
    deadline is reached before.
    """
    n = triangle.shape[0]
    is_full = n <= FULL_ORDER and 2 * triangle.nnz >= FULL * n * n
    if n <= DENSE_ORDER or is_full:
        deadline.check(PASS * n * n)  # about as long as it takes, without the clock
        lower = as_dense(triangle).T  # in the order of columns, as LAPACK has it
        return bool(dpotrf(lower, lower=1, clean=0, overwrite_a=1)[1] == 0)
    arrays = triangle.indptr, triangle.indices
    indptr, indices = (np.asarray(v, np.int32) for v in arrays)
    factors = plan_factors(indptr, indices, deadline)
    try:
        factors.refactor(triangle.data, deadline)
    except ValueError:  # a pivot is 0
        return False
    return bool((factors.pivots > 0.0).all())
