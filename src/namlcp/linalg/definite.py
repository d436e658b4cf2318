"""Tests whether a matrix is symmetric or positive semidefinite, up to rounding."""

from typing import Any

import numpy as np
from scipy.linalg.lapack import dpotrf
from scipy.sparse import csc_array, eye_array, issparse, triu

from namlcp.entries import dense_asymmetry, sparse_asymmetry
from namlcp.linalg.csc import as_dense
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.sparse_ldl import SparseFactors

PSD_SLACK = 1e-6
"""Negative curvature of a matrix with unit diagonal that may be due to the rounding of
its data to single precision."""

SYMMETRY_ROUNDING = 1e-14
"""Largest |A - A'|, relative to max |A|, that rounding in double precision explains."""

DENSE_ORDER = 200
"""Largest order at which a dense Cholesky factorisation tells the signs of pivots: it
takes 3 to 70 us, a sparse one 35 to 250."""


def asymmetry(C: Any) -> tuple[float, float]:
    """Return (max |C - C'|, max |C|) of a square matrix, dense or canonical CSC/CSR."""
    if type(C) is np.ndarray:
        return dense_asymmetry(C)
    return sparse_asymmetry(C.indptr, C.indices, C.data)


def is_symmetric(A: Any) -> bool:
    """Tell whether A (dense, or canonical CSC or CSR) = A' up to rounding."""
    gap, size = asymmetry(A)
    return gap <= SYMMETRY_ROUNDING * size


def is_positive_semidefinite(A: Any, tolerance: float) -> bool:
    """Tell whether A + tolerance I, symmetric or not, is positive definite."""
    if issparse(A):
        S = triu(0.5 * (A + A.T)) + tolerance * eye_array(A.shape[0])
        return has_positive_pivots(csc_array(S))
    S = 0.5 * (A + A.T)
    S[np.diag_indices_from(S)] += tolerance
    return bool(dpotrf(S, overwrite_a=1)[1] == 0)


def positive_factors(triangle: csc_array) -> SparseFactors | None:
    """Return L D L' of the matrix with this upper triangle, None unless D > 0."""
    triangle.sum_duplicates()
    n = triangle.shape[0]
    indptr, indices = (
        np.ascontiguousarray(v, np.int32) for v in (triangle.indptr, triangle.indices)
    )
    if np.any(np.diff(indptr) == 0) or np.any(indices[indptr[1:] - 1] != np.arange(n)):
        return None  # a diagonal entry is 0
    factors = SparseFactors(indptr, indices, minimum_degree(indptr, indices))
    try:
        factors.refactor(triangle.data)
    except ValueError:  # a pivot is 0
        return None
    return factors if (factors.pivots > 0.0).all() else None


def has_positive_pivots(triangle: csc_array) -> bool:
    """Tell whether L D L' of a matrix, its upper triangle given, has D > 0."""
    if triangle.shape[0] <= DENSE_ORDER:
        lower = as_dense(triangle).T  # in the order of columns, as LAPACK has it
        return bool(dpotrf(lower, lower=1, clean=0, overwrite_a=1)[1] == 0)
    return positive_factors(triangle) is not None
