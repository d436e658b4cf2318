"""Sparse L D L' of a principal submatrix, read from the columns of the whole matrix.

Up-looking factorisation after Davis, "Algorithm 849: LDL", ACM TOMS 31 (2005) 587-591:
row k of L is a sparse triangular solve along the elimination tree. `order` (m,) lists
the rows of the submatrix in elimination order, `position` (n,) is its inverse, -1 for
rows outside, which are skipped. An elimination order of the whole matrix, restricted to
a submatrix, causes no more fill there than in the matrix: one order serves all.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import part

PIVOT_FLOOR = 1e-14
"""Smallest pivot, for matrices with unit diagonal: smaller ones count as rounding."""


class Triangle(NamedTuple):
    """L and D of a submatrix of order m, in elimination order.

    Column j of L, without its unit diagonal, has values[p] in rows[p] for p in
    starts[j] : starts[j + 1]; parent is the elimination tree.
    """

    parent: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    values: np.ndarray
    D: np.ndarray


@part
def ldl_symbolic(indptr, indices, order, position, parent, counts):
    """Set parent and counts (m,) to the elimination tree and the columns' nonzeros.

    Returns the number of flops of the numeric factorisation.
    """
    m = order.size
    flag = np.empty(m, dtype=np.int32)
    for k in range(m):
        parent[k] = -1
        counts[k] = 0
        flag[k] = k
        j = order[k]
        for p in range(indptr[j], indptr[j + 1]):
            i = position[indices[p]]
            if 0 <= i < k:
                while flag[i] != k:
                    flag[i] = k
                    counts[i] += 1
                    if parent[i] < 0:
                        parent[i] = k
                    i = parent[i]
    flops = 0.0
    for k in range(m):
        flops += counts[k] * (counts[k] + 3.0)
    return flops


@part
def ldl_numeric(columns, shift, order, position, factor):
    """Factor the submatrix + diag(shift), shift (n,): set rows, values, D of `factor`.

    Its parent and starts are given. Pivots below `PIVOT_FLOOR` are raised to it.
    Returns the smallest pivot before that; clearly negative means indefinite.
    """
    indptr, indices, data = columns.indptr, columns.indices, columns.data
    parent, starts, rows, values, D = factor
    m = order.size
    y, ends = np.empty(m), np.empty(m, dtype=np.int64)
    pattern, flag = np.empty(m, dtype=np.int32), np.empty(m, dtype=np.int32)
    for k in range(m):
        y[k] = 0.0
        ends[k] = starts[k]
    smallest = np.inf
    for k in range(m):
        flag[k] = k
        top = m
        j = order[k]
        pivot = shift[j]
        for p in range(indptr[j], indptr[j + 1]):
            i = position[indices[p]]
            if i < 0 or i > k:
                continue
            if i == k:
                pivot += data[p]
                continue
            y[i] = data[p]
            length = 0
            while flag[i] != k:
                pattern[length] = i
                length += 1
                flag[i] = k
                i = parent[i]
            while length > 0:
                length -= 1
                top -= 1
                pattern[top] = pattern[length]
        for t in range(top, m):
            i = pattern[t]
            y_i = y[i]
            y[i] = 0.0
            # Unsigned indices need no sign test: this is a quarter faster.
            for p in range(np.uint64(starts[i]), np.uint64(ends[i])):
                y[np.uint32(rows[p])] -= values[p] * y_i
            l_ki = y_i / D[i]
            pivot -= l_ki * y_i
            rows[ends[i]] = k
            values[ends[i]] = l_ki
            ends[i] += 1
        smallest = min(smallest, pivot)
        D[k] = max(pivot, PIVOT_FLOOR)
    return smallest


@part
def ldl_solve(factor, x):
    """Overwrite x (m,), in elimination order, by the solution of L D L' x = b."""
    _, starts, rows, values, D = factor
    m = x.size
    for j in range(m):
        x_j = x[j]
        for p in range(starts[j], starts[j + 1]):
            x[rows[p]] -= values[p] * x_j
    for j in range(m - 1, -1, -1):
        x_j = x[j] / D[j]
        for p in range(starts[j], starts[j + 1]):
            x_j -= values[p] * x[rows[p]]
        x[j] = x_j
