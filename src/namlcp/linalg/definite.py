"""Tests whether a matrix is symmetric or positive semidefinite, up to rounding."""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf
from scipy.sparse import csc_array, eye_array, issparse, triu

from namlcp.checks import from_arrays
from namlcp.linalg.columns import LEAST_DIVISOR
from namlcp.linalg.csc import arrays_of, as_dense, unit_triangle
from namlcp.linalg.factors import factor_triangle
from namlcp.linalg.sparse_ldl import SparseFactors
from namlcp.linalg.symmetry import asymmetry

PSD_SLACK = 1e-6
"""Negative curvature of a matrix with unit diagonal that may be due to the rounding of
its data to single precision."""

SYMMETRY_ROUNDING = 1e-14
"""Largest |A - A'|, relative to max |A|, that rounding in double precision explains."""

ZERO = 1e-15
"""Entry p_jj, relative to max |P|, up to which it counts as 0; row j must be 0 then."""

DENSE_ORDER = 200
"""Largest order at which a dense Cholesky factorisation tells the signs of pivots: it
takes 3 to 70 us, a sparse one 35 to 250."""


class Curvature(NamedTuple):
    """What diagonal signs, minors of order two and diagonal dominance prove.

    sign: 1 where the matrix is positive semidefinite, 0 where they do not decide, -1
    where the minor of rows i and j, for i = j a diagonal entry, is negative. triangle,
    for sign = 0: the upper triangle of the matrix scaled to a unit diagonal, plus
    `PSD_SLACK` I, without the rows and columns that have a diagonal entry alone.
    """

    sign: int
    i: int
    j: int
    triangle: csc_array | None


def curvature(P: Any) -> Curvature:
    """Return the `Curvature` of P (CSC, symmetric), found without a factorisation."""
    sign, i, j, parts = unit_triangle(*arrays_of(P), ZERO, LEAST_DIVISOR, PSD_SLACK)
    triangle = None
    if sign == 0:
        order = parts[0].size - 1
        triangle = from_arrays(parts, (order, order))
    return Curvature(sign, i, j, triangle)


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
    try:
        factors = factor_triangle(triangle)
    except ValueError:  # a pivot is 0
        return None
    return factors if (factors.pivots > 0.0).all() else None


def has_positive_pivots(triangle: csc_array) -> bool:
    """Tell whether L D L' of a matrix, its upper triangle given, has D > 0."""
    if triangle.shape[0] <= DENSE_ORDER:
        lower = as_dense(triangle).T  # in the order of columns, as LAPACK has it
        return bool(dpotrf(lower, lower=1, clean=0, overwrite_a=1)[1] == 0)
    return positive_factors(triangle) is not None
