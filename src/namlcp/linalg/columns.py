"""The matrix of a box LCP as `lcp.pivoting` takes it: its columns, dense or compressed.

They are **columns** because a change of one unknown changes w = A z + q by a
multiple of its column, and unknowns at zero need no operation. The columns of a
symmetric matrix are its rows, so no copy is made.
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import as_sparse
from namlcp.entries import transposed

SMALL_ORDER = 24
"""Largest order of a sparse matrix that is always stored as a dense one."""

LEAST_DIVISOR = 1e-300
"""What a divisor >= 0 is raised to if it is smaller, so that 0 over it is 0."""


class Columns(NamedTuple):
    """Columns of A: row j of `dense` (n, n), or of the compressed arrays, is column j.

    The other form is empty, so that one class has both.
    """

    dense: np.ndarray
    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray


NO_DENSE = np.empty((0, 0))
NO_SPARSE = *np.empty((2, 0), dtype=np.int32), np.empty(0)


def columns_of(A: Any, symmetric: bool) -> Columns:
    """Return the columns of A, dense or in CSR, after its order and density."""
    n = A.shape[0]
    if isinstance(A, np.ndarray):
        is_dense = n <= 4 * SMALL_ORDER or np.count_nonzero(A) >= n * n // 8
        A = A if is_dense else as_sparse(A)
    else:
        is_dense = n <= SMALL_ORDER or A.nnz > n * n // 4
        A = A.toarray() if is_dense else A
    if is_dense:
        return Columns(np.ascontiguousarray(A if symmetric else A.T), *NO_SPARSE)
    parts = A.indptr, A.indices, A.data
    if not symmetric and A.format == "csr":
        parts = transposed(*parts, n)
    return Columns(NO_DENSE, *parts)
