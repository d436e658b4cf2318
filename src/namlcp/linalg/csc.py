"""Operations on sparse matrices, each in one compiled pass.

SciPy takes 30 to 100 us for each of these on a matrix of a few hundred entries, longer
than the whole solve. All matrices are canonical (sorted, no duplicates) with int32
indices, but `times` and `add_transposed` take any: products of other kinds are those of
`@`. The order of summation is SciPy's.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import fabs, sqrt
from scipy.sparse import csr_array

from namlcp.arrays import constant, from_arrays, transposed
from namlcp.checks import as_sparse
from namlcp.limits import NEVER

# Density of B above which P + B'WB is computed with dense matrices.
DENSE = 0.2
# Entries at most of a dense P + B'WB, and of the dense rows multiplied at a time.
MOST_DENSE, STRIP = 20_000_000, 1_000_000


def arrays_of(M):
    return M.indptr, M.indices, M.data


def as_dense(C):
    M: Columns
    n: Py_ssize_t = C.shape[1]
    dense = np.zeros(C.shape)
    out: cython.double[:, ::1] = dense
    take_columns(C, n, cython.address(M))
    for j in range(n):
        for t in range(M.indptr[j], M.indptr[j + 1]):
            out[M.indices[t], j] = M.data[t]
    return dense


def without_zeros(M):
    """Return M without stored zeros, M itself if there are none."""
    if np.count_nonzero(M.data) < M.data.size:
        M = M.copy()
        M.eliminate_zeros()
    return M


def submatrix(M, rows, columns):
    """Return the rows and columns of M, given in rising order; M itself if all are."""
    if (rows.size, columns.size) == M.shape:
        return M
    C: Columns
    n: Py_ssize_t = M.shape[1]
    count: Py_ssize_t = columns.size
    take_columns(M, n, cython.address(C))
    rows, columns = (np.ascontiguousarray(v, np.intp) for v in (rows, columns))
    row, column = longs(rows, rows.size), longs(columns, count)
    size: Py_ssize_t = M.shape[0]
    numbered = same_places(size, -1)
    number = places(numbered, size)
    for k in range(cython.cast(Py_ssize_t, rows.size)):
        number[row[k]] = k
    most: Py_ssize_t = M.data.size
    starts, indices, entries = new_places(count + 1), new_places(most), new_vector(most)
    start, place = places(starts, count + 1), places(indices, most)
    value = numbers(entries, most)
    start[0] = 0
    nnz: cython.int = 0
    for k in range(count):
        for t in range(C.indptr[column[k]], C.indptr[column[k] + 1]):
            i = number[C.indices[t]]
            if i >= 0:
                place[nnz], value[nnz] = i, C.data[t]
                nnz += 1
        start[k + 1] = nnz
    parts = starts, indices[:nnz], entries[:nnz]
    return from_arrays(parts, (rows.size, columns.size))


def by_rows(M):
    return from_arrays(transposed(*arrays_of(M), M.shape[0]), M.shape, csr_array)


def with_squares(P, B, weight, deadline=NEVER):
    """Return P + B' diag(weight) B; OutOfTime if the deadline is reached before."""
    rows, columns = B.shape
    if DENSE * rows * columns < B.nnz and columns**2 <= MOST_DENSE:
        S, everything = as_dense(P), np.arange(columns)
        step = max(1, STRIP // columns)
        for i in range(0, rows, step):
            deadline.check()
            strip = np.arange(i, min(i + step, rows))
            half = as_dense(submatrix(B, strip, everything))
            half *= np.sqrt(weight[strip])[:, None]
            S += half.T @ half
        return as_sparse(S)
    turned = by_rows(B)  # as columns, B'
    parts: Columns[3]
    take_columns(P, columns, cython.address(parts[0]))
    take_columns(B, columns, cython.address(parts[1]))
    take_columns(turned, rows, cython.address(parts[2]))
    capacity = P.data.size + 4 * B.data.size + columns
    while True:
        starts, indices = np.zeros(columns + 1, np.int32), np.empty(capacity, np.int32)
        entries = np.empty(capacity)
        nnz = write_squares(parts, weight, starts, indices, entries)
        if nnz >= 0:
            break
        capacity *= 2
    # The matrix is symmetric (to rounding): its transpose is itself, but sorted.
    sums = transposed(starts, indices[:nnz], entries[:nnz], columns)
    return from_arrays(sums, P.shape)


def times(M, x):
    """Return M x. Raises ValueError where the sizes disagree."""
    rows, n = M.shape
    if x.shape != (n,):
        raise ValueError(f"x must have shape ({n},), got {x.shape}")
    if rows == 0:
        return np.zeros(0)
    if not is_clean_csc(M):
        return (M @ x).reshape(rows)  # a coo_array of one row gives a scalar
    C: Columns
    x, out = np.ascontiguousarray(x, float), np.zeros(rows)
    take_columns(M, n, cython.address(C))
    columns_times(cython.address(C), n, numbers(x, n), numbers(out, rows))
    return out


def add_transposed(M, z, out):
    """Add M'z to `out`. Raises ValueError where the sizes disagree."""
    rows, n = M.shape
    if z.shape != (rows,) or out.shape != (n,):
        raise ValueError(f"z must have shape ({rows},), got {z.shape}")
    if rows == 0:
        return
    if not is_clean_csc(M):
        out += z @ M
    else:
        C: Columns
        z = np.ascontiguousarray(z, float)
        take_columns(M, n, cython.address(C))
        z_at, out_at = numbers(z, rows), numbers(out, n)
        columns_times_transposed(cython.address(C), n, z_at, out_at)


def is_clean_csc(M):
    """Tell whether M is a CSC matrix whose arrays can go to compiled code."""
    if type(M) is np.ndarray or getattr(M, "format", "") != "csc":
        return False
    size, indptr, indices = M.data.size, M.indptr, M.indices
    is_clean = fits(M.data, 1) and are_places(indices) and are_places(indptr)
    return is_clean and size == indices.size == indptr[-1]


def write_squares(parts, weight, indptr, indices, data):
    """Write P + B' diag(weight) B with columns that are not sorted.

    Column by column with a dense accumulator (Gustavson, ACM Trans. Math. Softw. 4
    (1978) 250-269). parts: P and B by columns, B by rows. Returns the number of
    entries, -1 if there is no room for them.
    """
    P, B, rows = parts[0], parts[1], parts[2]
    n, capacity = indptr.shape[0] - 1, data.shape[0]
    sums: cython.double[::1] = np.zeros(n)
    seen: cython.int[::1] = constant(n, -1, np.int32)
    nnz: Py_ssize_t = 0
    for j in range(n):
        if nnz + n > capacity:
            return -1
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
            for k in range(rows.indptr[row], rows.indptr[row + 1]):
                i = rows.indices[k]
                if seen[i] != j:
                    seen[i] = j
                    sums[i] = 0.0
                    indices[nnz] = i
                    nnz += 1
                sums[i] += factor * rows.data[k]
        for t in range(start, nnz):
            data[t] = sums[indices[t]]
        indptr[j + 1] = nnz
    return nnz


def unit_triangle(P, zero, least, slack):
    """Return sign, i, j and a triangle: what tells whether P is positive semidefinite.

    sign: 1 where diagonal signs, minors of order two and diagonal dominance prove it, 0
    where they do not decide, -1 where the minor of rows i and j, for i = j a diagonal
    entry, is negative. With 0 comes the upper triangle of R^-1 (P + t I) R^-1 + slack I
    without rows and columns that have a diagonal entry alone. Here t = zero max |P|, at
    least `least`, allows for rounding, and R^2 is the diagonal of P + t I.
    """
    C: Columns
    n: Py_ssize_t = P.shape[1]
    take_columns(P, n, cython.address(C))
    indptr, indices, data, size = C.indptr, C.indices, C.data, 0.0
    parts, numbered = new_vector(2 * n), same_places(n, -1)
    diagonal, number = numbers(parts, 2 * n), places(numbered, n)
    root = diagonal + n
    order: cython.int = 0
    for j in range(n):
        diagonal[j] = 0.0
        for t in range(indptr[j], indptr[j + 1]):
            size = max(size, fabs(data[t]))
            if indices[t] == j:
                diagonal[j] = data[t]
            elif data[t] != 0.0 and number[j] < 0:
                number[j] = order
                order += 1
    tiny = zero * size
    for j in range(n):
        root[j] = sqrt(max(diagonal[j], 0.0) + max(tiny, least))
    most = indptr[n] + n
    starts, rows, entries = new_places(order + 1), new_places(most), new_vector(most)
    start, place = places(starts, order + 1), places(rows, most)
    start[0] = 0
    value = numbers(entries, most)
    sign: cython.int = 1
    nnz: Py_ssize_t = 0
    for j in range(n):
        if diagonal[j] < -tiny:
            return -1, j, j, None
        if number[j] < 0:
            continue
        rest = 0.0
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i == j or data[t] == 0.0:
                continue
            rest += fabs(data[t])
            bound = sqrt(max(diagonal[i], 0.0)) * sqrt(max(diagonal[j], 0.0))
            if fabs(data[t]) > bound * (1.0 + 2.0 * slack) + tiny:
                return -1, i, j, None
            if i < j:
                place[nnz], value[nnz] = number[i], data[t] / (root[i] * root[j])
                nnz += 1
        if rest > diagonal[j]:
            sign = 0
        place[nnz], value[nnz] = number[j], 1.0 + slack
        nnz += 1
        start[number[j] + 1] = nnz
    return sign, 0, 0, (starts, rows[:nnz], entries[:nnz])


def take_columns(M, n, out):
    """Note where the arrays of a matrix of n columns are."""
    indptr, indices, data = M.indptr, M.indices, M.data
    out.indptr = places(indptr, n + 1)
    out.indices = places(indices, indices.size)
    out.data = numbers(data, indices.size)
    return 0


def columns_times(M, n, x, out):
    """Add M x to `out`."""
    for j in range(n):
        x_j = x[j]
        for t in range(M.indptr[j], M.indptr[j + 1]):
            out[M.indices[t]] += M.data[t] * x_j


def columns_times_transposed(M, n, z, out):
    """Add M'z to `out`."""
    for j in range(n):
        total = 0.0
        for t in range(M.indptr[j], M.indptr[j + 1]):
            total += M.data[t] * z[M.indices[t]]
        out[j] += total
