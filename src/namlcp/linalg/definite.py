"""Tests whether a matrix is symmetric or positive semidefinite, up to rounding."""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotrf
from scipy.sparse import csc_array, eye_array, issparse, triu

from namlcp.checks import from_arrays
from namlcp.compiled import kernel
from namlcp.linalg.columns import LEAST_DIVISOR
from namlcp.linalg.csc import as_dense
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
    n = P.shape[0]
    indptr, number = np.empty((2, n + 1), dtype=np.int32)
    indices = np.empty(P.data.size + n, dtype=np.int32)
    data = np.empty(indices.size)
    sign, i, j, order = unit_triangle(
        P.indptr, P.indices, P.data, np.empty((2, n)), number, indptr, indices, data
    )
    triangle = None
    if sign == 0:
        nnz = indptr[order]
        parts = indptr[: order + 1], indices[:nnz], data[:nnz]
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


@kernel
def unit_triangle(indptr, indices, data, work, number, up, ui, ux):
    """Write the upper triangle of R^-1 (P + t I) R^-1 + PSD_SLACK I.

    Returns sign, i and j of `Curvature` and the order k of the triangle. Here t =
    ZERO max |P| allows for rounding, and R^2 is the diagonal of P + t I; P, symmetric,
    and the triangle up (n + 1,), ui, ux (nnz(P) + n,) are in CSC. The triangle has the
    k rows and columns of P with entries beside the diagonal; j becomes number[j]. It
    and `work` (2, n) are overwritten. With sign = -1 it is not complete.
    """
    n = indptr.size - 1
    diagonal, root = work[0], work[1]
    size = 0.0
    order = 0
    for j in range(n):
        diagonal[j] = 0.0
        number[j] = -1
        for t in range(indptr[j], indptr[j + 1]):
            size = max(size, abs(data[t]))
            if indices[t] == j:
                diagonal[j] = data[t]
            elif data[t] != 0.0 and number[j] < 0:
                number[j] = order
                order += 1
    tiny = ZERO * size
    for j in range(n):
        root[j] = np.sqrt(max(diagonal[j], 0.0) + max(tiny, LEAST_DIVISOR))
    sign = 1
    nnz = 0
    up[0] = 0
    for j in range(n):
        if diagonal[j] < -tiny:
            return -1, j, j, order
        if number[j] < 0:
            continue
        rest = 0.0
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i == j or data[t] == 0.0:
                continue
            rest += abs(data[t])
            bound = np.sqrt(max(diagonal[i], 0.0) * max(diagonal[j], 0.0))
            if abs(data[t]) > bound * (1.0 + 2.0 * PSD_SLACK) + tiny:
                return -1, i, j, order
            if i < j:
                ui[nnz] = number[i]
                ux[nnz] = data[t] / (root[i] * root[j])
                nnz += 1
        if rest > diagonal[j]:
            sign = 0
        ui[nnz] = number[j]
        ux[nnz] = 1.0 + PSD_SLACK
        nnz += 1
        up[number[j] + 1] = nnz
    return sign, 0, 0, order
