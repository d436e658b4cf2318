"""The matrices s a b' + t c d' and their entries."""

import cython
import numpy as np
from cython.cimports.namlcp.linalg.arrays import numbers, places


def write_rank_two(s, a, b, t, c, d, rows, columns, out):
    """Set out (rows, columns) to s a b' + t c d'."""
    for i in range(rows):
        first, second, row = s * a[i], t * c[i], out + i * columns
        for j in range(columns):
            row[j] = first * b[j] + second * d[j]


def rank_two(s: cython.double, a, b, t: cython.double, c, d):
    """Return s a b' + t c d' as an array."""
    rows: cython.Py_ssize_t = a.size
    columns: cython.Py_ssize_t = b.size
    out = np.empty((rows, columns))
    write_rank_two(
        s, numbers(a, rows), numbers(b, columns), t, numbers(c, rows),
        numbers(d, columns), rows, columns, numbers(out, rows * columns),
    )  # fmt: skip
    return out


def add_rank_two_at(
    pattern, s: cython.double, a, b, t: cython.double, c, d, data
):  # fmt: skip
    """Add the entries of s a b' + t c d' at the places of a matrix in CSC to data."""
    rows: cython.Py_ssize_t = a.size
    columns: cython.Py_ssize_t = b.size
    count: cython.Py_ssize_t = data.size
    indptr = places(pattern.indptr, columns + 1)
    indices = places(pattern.indices, count)
    of_a, of_b, of_c = numbers(a, rows), numbers(b, columns), numbers(c, rows)
    of_d, out = numbers(d, columns), numbers(data, count)
    with cython.nogil:
        for j in range(columns):
            left, right = s * of_b[j], t * of_d[j]
            for k in range(indptr[j], indptr[j + 1]):
                i = indices[k]
                out[k] += of_a[i] * left + of_c[i] * right
