"""Operations on sparse matrices, each in one compiled pass.

SciPy takes 30 to 100 us for each of these on a matrix of a few hundred entries, longer
than the whole solve. All matrices are canonical (sorted, no duplicates) with int32
indices, but `times` and `add_transposed` take any: products of other kinds are those of
`@`. The order of summation is SciPy's.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.checks import as_sparse, from_arrays, has_clean_arrays, transposed
from namlcp.compiled import kernel
from namlcp.limits import NEVER, Deadline

# Density of B above which P + B'WB is computed with dense matrices.
DENSE = 0.2
# Entries at most of a dense P + B'WB, and of the dense rows multiplied at a time.
MOST_DENSE, STRIP = 20_000_000, 4_000_000


class Compressed(NamedTuple):
    """The arrays of a matrix in CSC or CSR."""

    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray


def arrays_of(M: Any) -> Compressed:
    """Return the arrays of a matrix in CSC or CSR."""
    return Compressed(M.indptr, M.indices, M.data)


def as_dense(C: Any) -> np.ndarray:
    """Return a CSC matrix as a dense one."""
    out = np.zeros(C.shape)
    scatter(C.indptr, C.indices, C.data, out)
    return out


@kernel
def scatter(indptr, indices, data, out):
    """Write the entries of a CSC matrix into `out`, which is zero."""
    for j in range(indptr.size - 1):
        for t in range(indptr[j], indptr[j + 1]):
            out[indices[t], j] = data[t]


def without_zeros(M: csc_array) -> csc_array:
    """Return M without stored zeros, M itself if there are none."""
    if not M.data.all():
        M = M.copy()
        M.eliminate_zeros()
    return M


def submatrix(M: csc_array, rows: np.ndarray, columns: np.ndarray) -> csc_array:
    """Return the rows and columns of M, given in rising order; M itself if all are."""
    if (rows.size, columns.size) == M.shape:
        return M
    parts = select_part(M.indptr, M.indices, M.data, M.shape[0], rows, columns)
    return from_arrays(parts, (rows.size, columns.size))


def by_rows(M: csc_array) -> csr_array:
    """Return M in CSR."""
    parts = transposed(M.indptr, M.indices, M.data, M.shape[0])
    return from_arrays(parts, M.shape, csr_array)


def with_squares(
    P: csc_array, B: csc_array, weight: np.ndarray, deadline: Deadline = NEVER
) -> csc_array | None:
    """Return P + B' diag(weight) B, None if the deadline is reached before."""
    rows, columns = B.shape
    if DENSE * rows * columns < B.nnz and columns**2 <= MOST_DENSE:
        S, C = as_dense(P), by_rows(B)
        step = max(1, STRIP // columns)
        for i in range(0, rows, step):
            if deadline.reached():
                return None
            half = C[i : i + step].toarray() * np.sqrt(weight[i : i + step])[:, None]
            S += half.T @ half
        return as_sparse(S)
    return from_arrays(add_squares(arrays_of(P), arrays_of(B), weight), P.shape)


def times(M: Any, x: np.ndarray) -> np.ndarray:
    """Return M x. Raises ValueError where the sizes disagree."""
    if x.shape != (M.shape[1],):
        raise ValueError(f"x must have shape ({M.shape[1]},), got {x.shape}")
    if not is_csc(M):
        return (M @ x).reshape(M.shape[0])  # a coo_array of one row gives a scalar
    out = np.zeros(M.shape[0])
    add_columns(M.indptr, M.indices, M.data, x, out)
    return out


def add_transposed(M: Any, z: np.ndarray, out: np.ndarray) -> None:
    """Add M'z to `out`. Raises ValueError where the sizes disagree."""
    if z.shape != (M.shape[0],) or out.shape != (M.shape[1],):
        raise ValueError(f"z must have shape ({M.shape[0]},), got {z.shape}")
    if not is_csc(M):
        out += z @ M
    elif z.size:
        add_column_sums(M.indptr, M.indices, M.data, z, out)


def is_csc(M: Any) -> bool:
    """Tell whether M is a CSC matrix of float64."""
    return getattr(M, "format", "") == "csc" and M.dtype == np.float64


def compiled_form(M: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return (indptr, indices, data) of a CSC matrix in float64 and int32, or None."""
    if getattr(M, "format", "") == "csc" and has_clean_arrays(M):
        return M.indptr, M.indices, M.data
    return None


@kernel
def select_part(indptr, indices, data, height, rows, columns):
    """Return the CSC arrays of some rows and columns of a matrix of this height."""
    number = np.full(height, -1, dtype=np.int32)
    for i in range(rows.size):
        number[rows[i]] = i
    start = np.zeros(columns.size + 1, dtype=np.int32)
    for k in range(columns.size):
        start[k + 1] = start[k]
        for t in range(indptr[columns[k]], indptr[columns[k] + 1]):
            start[k + 1] += number[indices[t]] >= 0
    place, value = np.empty(start[-1], dtype=np.int32), np.empty(start[-1])
    nnz = 0
    for j in columns:
        for t in range(indptr[j], indptr[j + 1]):
            i = number[indices[t]]
            if i >= 0:
                place[nnz], value[nnz] = i, data[t]
                nnz += 1
    return start, place, value


@kernel
def add_squares(P, B, weight):
    """Return P + B' diag(weight) B, all in CSC.

    Column by column with a dense accumulator (Gustavson, ACM Trans. Math. Softw. 4
    (1978) 250-269).
    """
    n = B.indptr.size - 1
    # B by rows
    start_of, column_of, value_of = transposed(B.indptr, B.indices, B.data, weight.size)
    sums = np.zeros(n)
    seen = np.full(n, -1)
    indptr = np.zeros(n + 1, dtype=np.int32)
    capacity = P.data.size + 4 * B.data.size + n
    indices = np.empty(capacity, dtype=np.int32)
    data = np.empty(capacity)
    nnz = 0
    for j in range(n):
        if nnz + n > capacity:
            capacity = 2 * capacity + n
            indices = np.append(indices, np.empty(capacity, dtype=np.int32))
            data = np.append(data, np.empty(capacity))
            capacity = data.size
        start = nnz
        for t in range(P.indptr[j], P.indptr[j + 1]):
            i = P.indices[t]
            seen[i] = j
            sums[i] = P.data[t]
            indices[nnz] = i
            nnz += 1
        for t in range(B.indptr[j], B.indptr[j + 1]):
            row = B.indices[t]
            factor = weight[row] * B.data[t]
            if factor == 0.0:
                continue
            for k in range(start_of[row], start_of[row + 1]):
                i = column_of[k]
                if seen[i] != j:
                    seen[i] = j
                    sums[i] = 0.0
                    indices[nnz] = i
                    nnz += 1
                sums[i] += factor * value_of[k]
        for t in range(start, nnz):
            data[t] = sums[indices[t]]
        indptr[j + 1] = nnz
    # The matrix is symmetric (to rounding): its transpose is itself, but sorted.
    return transposed(indptr, indices[:nnz], data[:nnz], n)


@kernel
def add_columns(indptr, indices, data, x, out):
    """Add M x to `out`."""
    for j in range(x.size):
        xj = x[j]
        for t in range(indptr[j], indptr[j + 1]):
            out[indices[t]] += data[t] * xj


@kernel
def add_column_sums(indptr, indices, data, z, out):
    """Add M'z to `out`."""
    for j in range(out.size):
        total = 0.0
        for t in range(indptr[j], indptr[j + 1]):
            total += data[t] * z[indices[t]]
        out[j] += total
