"""Tridiagonal matrices: diagonals, the pivots of A, elimination of every second row.

The pivots of A itself are stored. Every segment of free unknowns begins an elimination
(the Thomas algorithm) of its own, but if A is dominant, the pivots equal those of A to
rounding after a few rows, and no divisions are needed from there on.
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.linalg import arrays_of

# Rows of `Tridiagonal.rows`: the diagonals, 1 / pivot of A itself, 1 / sqrt(a_ii).
BELOW, DIAGONAL, ABOVE, INVERSE, ROOT = range(5)


class Tridiagonal(NamedTuple):
    """A tridiagonal matrix with a positive diagonal.

    rows: (5, n). z_matrix: no off-diagonal entry is positive.
    """

    rows: np.ndarray
    z_matrix: bool


class TridiagonalLCP(NamedTuple):
    """A box LCP with the `rows` of a `Tridiagonal`, for compiled code."""

    rows: np.ndarray
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


@kernel
def read_diagonals(indptr, indices, data, rows):
    """Write the diagonals of a canonical CSR matrix; return whether it has others."""
    for i in range(indptr.size - 1):
        rows[BELOW, i] = rows[DIAGONAL, i] = rows[ABOVE, i] = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k] - i
            if j < -1 or j > 1:
                return True
            rows[j + 1, i] = data[k]
    return False


@kernel(error_model="numpy")
def eliminate_rows(rows):
    """Write rows INVERSE and ROOT; return whether all a_ii > 0, and z_matrix.

    The entries of INVERSE are NaN from the first pivot that is not positive.
    """
    z_matrix = True
    coupling = 0.0
    for i in range(rows.shape[1]):
        if not rows[DIAGONAL, i] > 0.0:
            return False, False
        z_matrix &= rows[BELOW, i] <= 0.0 and rows[ABOVE, i] <= 0.0
        pivot = rows[DIAGONAL, i] - rows[BELOW, i] * coupling
        rows[INVERSE, i] = 1.0 / pivot if pivot > 0.0 else np.nan
        coupling = rows[ABOVE, i] * rows[INVERSE, i]
        rows[ROOT, i] = 1.0 / np.sqrt(rows[DIAGONAL, i])
    return True, z_matrix


def tridiagonal_of(A: Any) -> Tridiagonal | None:
    """Return a csr_array as a Tridiagonal, None if it is none or has an a_ii <= 0."""
    n = A.shape[0]
    if n == 0 or A.nnz > 3 * n:
        return None
    rows = np.empty((5, n))
    if read_diagonals(*arrays_of(A), rows):
        return None
    positive, z_matrix = eliminate_rows(rows)
    return Tridiagonal(rows, z_matrix) if positive else None


@part
def multiply(rows, z, q, w):
    """Write w = A z + q, summed as SciPy sums it."""
    below, diagonal, above = rows[BELOW], rows[DIAGONAL], rows[ABOVE]
    left, here = 0.0, z[0]
    for i in range(z.size - 1):
        right = z[i + 1]
        w[i] = below[i] * left + diagonal[i] * here + above[i] * right + q[i]
        left, here = here, right
    i = z.size - 1
    w[i] = below[i] * left + diagonal[i] * here + q[i]


@kernel(error_model="numpy")
def halve(rows, q, rows_below, q_below):
    """Eliminate unknowns 1, 3, ...; write the diagonals and q of the system left."""
    n = q.size
    for k in range(q_below.size):
        i = 2 * k
        rows_below[BELOW, k] = rows_below[ABOVE, k] = 0.0
        d, r = rows[DIAGONAL, i], q[i]
        if i > 0:
            c = rows[BELOW, i] / rows[DIAGONAL, i - 1]
            rows_below[BELOW, k] = -c * rows[BELOW, i - 1]
            d -= c * rows[ABOVE, i - 1]
            r -= c * q[i - 1]
        if i + 1 < n:
            c = rows[ABOVE, i] / rows[DIAGONAL, i + 1]
            rows_below[ABOVE, k] = -c * rows[ABOVE, i + 1]
            d -= c * rows[BELOW, i + 1]
            r -= c * q[i + 1]
        rows_below[DIAGONAL, k], q_below[k] = d, r


@kernel(error_model="numpy")
def fill_in(rows, q, lower, upper, below, z):
    """Write z: `below` at 0, 2, ...; the others solve their rows, and are clipped."""
    n = z.size
    for i in range(0, n, 2):
        z[i] = below[i // 2]
    for i in range(1, n, 2):
        r = -q[i] - rows[BELOW, i] * z[i - 1]
        if i + 1 < n:
            r -= rows[ABOVE, i] * z[i + 1]
        z[i] = min(max(r / rows[DIAGONAL, i], lower[i]), upper[i])
