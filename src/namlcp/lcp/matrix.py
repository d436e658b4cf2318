"""The matrix of a box LCP as compiled code sees it: its columns, dense or compressed.

Compiled code only ever walks **columns**: a moved unknown changes w = A z + q by a
multiple of its column, and unknowns at zero cost nothing. For a symmetric matrix the
columns are its rows, so no copy is made.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy import sparse

SMALL = 24
"""Below this order everything is dense."""


class Columns(NamedTuple):
    """Columns of A. Row j of `dense` (n, n), or of the CSR arrays, is column j of A.

    The kind that is not in use is empty; both are there so that one compiled function
    serves the two.
    """

    dense: np.ndarray
    data: np.ndarray
    indices: np.ndarray
    indptr: np.ndarray

    @property
    def size(self) -> int:
        """Order n of the matrix."""
        return self.dense.shape[0] or self.indptr.size - 1


NO_DENSE = np.empty((0, 0))
NO_DATA = np.empty(0)
NO_INDICES = np.empty(0, dtype=np.int32)


def columns_of(A: Any, symmetric: bool) -> Columns:
    """Return the columns of A, in whichever storage is cheaper to work with."""
    n = A.shape[0]
    if isinstance(A, np.ndarray):
        if n > 4 * SMALL and np.count_nonzero(A) < n * n // 8:
            A = sparse.csr_array(A)
    elif n <= SMALL or A.nnz > n * n // 4:
        A = A.toarray()
    if isinstance(A, np.ndarray):
        dense = A if symmetric else np.ascontiguousarray(A.T)
        return Columns(dense, NO_DATA, NO_INDICES, NO_INDICES)
    if not symmetric:
        A = A.T.tocsr()
        A.sort_indices()
    return Columns(
        NO_DENSE,
        A.data,
        A.indices.astype(np.int32, copy=False),
        A.indptr.astype(np.int32, copy=False),
    )


@njit(cache=True, nogil=True)
def is_symmetric(columns):
    """Tell whether A = A', exactly; the columns must be sorted and free of duplicates.

    Compressed: the upper part of every row is consumed from left to right by the lower
    parts of the rows below it, so one pass decides.
    """
    dense, data, indices, indptr = columns
    n = dense.shape[0]
    if n > 0:
        for i in range(n):
            for j in range(i):
                if dense[i, j] != dense[j, i]:
                    return False
        return True
    n = indptr.size - 1
    upper = np.empty(n, dtype=np.int32)
    for i in range(n):
        k = indptr[i]
        while k < indptr[i + 1] and indices[k] < i:
            j = indices[k]
            p = upper[j]
            if p >= indptr[j + 1] or indices[p] != i or data[p] != data[k]:
                return False
            upper[j] = p + 1
            k += 1
        if k < indptr[i + 1] and indices[k] == i:
            k += 1
        upper[i] = k
    for i in range(n):
        if upper[i] != indptr[i + 1]:
            return False
    return True


@njit(cache=True, nogil=True)
def diagonal(columns, out):
    """Write the diagonal of A to out (n,)."""
    dense, data, indices, indptr = columns
    for j in range(out.size):
        if dense.shape[0] > 0:
            out[j] = dense[j, j]
            continue
        out[j] = 0.0
        for k in range(indptr[j], indptr[j + 1]):
            if indices[k] == j:
                out[j] = data[k]


@njit(cache=True, nogil=True)
def scale(columns, d, scaled):
    """Write diag(d) A diag(d) to the values of `scaled`."""
    dense, data, indices, indptr = columns
    n = d.size
    if dense.shape[0] > 0:
        for j in range(n):
            for i in range(n):
                scaled.dense[j, i] = dense[j, i] * d[j] * d[i]
        return
    for j in range(n):
        for k in range(indptr[j], indptr[j + 1]):
            scaled.data[k] = data[k] * d[j] * d[indices[k]]


@njit(cache=True, nogil=True)
def add_column(columns, j, t, w):
    """Add t times column j of A to w (n,)."""
    dense, data, indices, indptr = columns
    if dense.shape[0] > 0:
        column = dense[j]
        for i in range(w.size):
            w[i] += t * column[i]
    else:
        for k in range(indptr[j], indptr[j + 1]):
            w[indices[k]] += t * data[k]


@njit(cache=True, nogil=True)
def add_product(columns, z, w):
    """Add A z to w (n,)."""
    for j in range(z.size):
        if z[j] != 0.0:
            add_column(columns, j, z[j], w)
