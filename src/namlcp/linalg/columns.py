"""The matrix of a box LCP as kernels take it: its columns, dense or compressed.

Kernels use **columns** because a change of one unknown changes w = A z + q by a
multiple of its column, and unknowns at zero need no operation. The columns of a
symmetric matrix are its rows, so no copy is made.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.compiled import part

SMALL_ORDER = 24
"""Largest order of a sparse matrix that is always stored as a dense one."""

LEAST_DIVISOR = 1e-300
"""What a divisor >= 0 is raised to if it is smaller, so that 0 over it is 0."""


class Columns(NamedTuple):
    """Columns of A: row j of `dense` (n, n), or of the compressed arrays, is column j.

    The other form is empty, so that one compiled function serves both.
    """

    dense: np.ndarray
    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray


NO_DENSE = np.empty((0, 0))
NO_DATA = np.empty(0)
NO_INDICES = np.empty(0, dtype=np.int32)


def columns_of(A: Any, symmetric: bool) -> Columns:
    """Return the columns of A, dense or compressed after its order and density."""
    n = A.shape[0]
    if isinstance(A, np.ndarray):
        if n > 4 * SMALL_ORDER and np.count_nonzero(A) < n * n // 8:
            A = sparse.csr_array(A)
    elif n <= SMALL_ORDER or A.nnz > n * n // 4:
        A = A.toarray()
    if isinstance(A, np.ndarray):
        dense = A if symmetric else A.T
        return Columns(np.ascontiguousarray(dense), NO_INDICES, NO_INDICES, NO_DATA)
    if not symmetric:
        A = A.T.tocsr()
        A.sort_indices()
    indices, indptr = A.indices, A.indptr
    if indices.dtype != np.int32:
        indices, indptr = indices.astype(np.int32), indptr.astype(np.int32)
    return Columns(NO_DENSE, indptr, indices, A.data)


@part
def write_diagonal(columns, out):
    """Write the diagonal of A to out (n,)."""
    dense, indptr, indices, data = columns
    for j in range(out.size):
        if dense.shape[0] > 0:
            out[j] = dense[j, j]
        else:
            out[j] = 0.0
            for k in range(indptr[j], indptr[j + 1]):
                if indices[k] == j:
                    out[j] = data[k]


@part
def scale_columns(columns, d, scaled):
    """Write diag(d) A diag(d) to `scaled`, Columns with the pattern of A."""
    dense, indptr, indices, data = columns
    n = d.size
    if dense.shape[0] > 0:
        for j in range(n):
            for i in range(n):
                scaled.dense[j, i] = dense[j, i] * d[j] * d[i]
    else:
        for j in range(n):
            for k in range(indptr[j], indptr[j + 1]):
                scaled.data[k] = data[k] * d[j] * d[indices[k]]


@part
def add_product(columns, z, w):
    """Add A z to w (n,), skipping zeros of z; unsigned indices need no sign test."""
    dense, indptr, indices, data = columns
    if dense.shape[0] > 0:
        for j in range(z.size):
            if z[j] != 0.0:
                for i in range(w.size):
                    w[i] += z[j] * dense[j, i]
    else:
        for j in range(z.size):
            if z[j] != 0.0:
                for p in range(np.uint32(indptr[j]), np.uint32(indptr[j + 1])):
                    w[np.uint32(indices[p])] += z[j] * data[p]


@part
def largest_entry(x):
    """Return max |x_i|."""
    size = 0.0
    for i in range(x.size):
        size = max(size, abs(x[i]))
    return size


@part
def all_finite(x):
    """Tell whether there is neither NaN nor infinity in x."""
    for i in range(x.size):
        if not abs(x[i]) < np.inf:
            return False
    return True
