"""Large dense QPs, one at a time: many responses at once, by products of matrices.

The rows of G that the minimum without constraints violates mostly enter sooner or
later. One by one their responses would be limited by the speed of memory.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.stdlib import free, malloc
from cython.cimports.namlcp.linalg.blas import times, times_transposed
from cython.cimports.namlcp.linalg.vectors import copy
from cython.cimports.namlcp.qp.active.rows import claim_place

# MOST_ROWS: most rows for a variable for which responses are made before they are asked
# for.


def prepare(m):
    """Make the responses to the violated rows of G, from V."""
    if m.p > 0 or m.m > MOST_ROWS * m.n:
        return
    k: Py_ssize_t = violated_rows(m, m.s, m.active)
    space = cython.cast(cython.p_double, malloc(8 * k * (2 * m.n + m.m) + 8))
    if space != cython.NULL:  # else they are made one by one
        make_all(m, m.active, k, space)
        free(space)


def violated_rows(m, values, rows):
    """List rows of G that exceed h at the minimum without constraints, m.most at most.

    values: room for (G x, x).
    """
    count: Py_ssize_t = 0
    for j in range(m.n):
        m.rhs[j] = -m.q[j]
    m.set_values(m.rhs, values)
    for i in range(m.m):
        if values[i] > m.h[i] and count < m.most:
            rows[count] = i
            count += 1
    return count


def make_all(m, rows, k, space):
    """Make the responses to k rows of G; space: for k (2 n + m) numbers."""
    n = m.n
    C, H, W = space, space + k * n, space + 2 * k * n
    for i in range(k):
        copy(m.G + rows[i] * n, C + i * n, n)
    times_transposed(C, m.factor, H, k, n, n)
    times(H, m.factor, C, k, n, n)
    times_transposed(C, m.G, W, k, m.m, n)
    for i in range(k):
        values = claim_place(m, rows[i])
        copy(W + i * m.m, values, m.m)
        copy(C + i * n, values + m.m, n)
