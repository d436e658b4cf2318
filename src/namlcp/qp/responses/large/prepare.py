"""The factor of a large QP, and responses to the rows that are violated at first.

For a large QP these products take most of the time, and BLAS multiplies matrices ten
times as fast as `dense` does a row at a time: with V = L^-1 and the rows C,
U = C V'V are the changes of x, and U G' those of G x. Most rows that the unconstrained
minimum violates become active; the responses to others are made when asked for.
"""

import numpy as np

from namlcp.compiled import floats, kernel, part
from namlcp.linalg import multiply, product
from namlcp.qp.responses.dense import invert_factor, set_up, solve_with_factor
from namlcp.qp.responses.matrices import row_of, times_rows
from namlcp.qp.responses.rows import claim_place
from namlcp.qp.responses.run import attach_vectors
from namlcp.qp.responses.state import state_at

# Most rows for a variable for which responses are made before they are asked for.
MOST_ROWS = 2


@kernel
def prepare(address, vectors):
    """Prepare a single QP, its matrices attached; False if it is not suited.

    vectors: as for `run`; their numbers need not be allowed.
    """
    m = state_at(address)
    attach_vectors(m, vectors, vectors)  # nothing is written yet
    m.is_large = 1
    if not set_up(m):
        return False
    m.is_ready = 1
    if m.p == 0 and m.rho == 0.0 and m.m <= MOST_ROWS * m.n:
        rows = violated_rows(m)
        invert_factor(m)
        make_all(m, rows[: m.capacity])
    return True


@part
def violated_rows(m):
    """Return the rows of G that exceed h at the minimum without any constraint."""
    q, h = floats(m.q, m.n), floats(m.h, m.m)
    x, Gx, load = np.empty(m.n), np.empty(m.m), np.empty(m.n)
    for j in range(m.n):
        load[j] = -q[j]
    solve_with_factor(m, load, x)
    times_rows(m.G, m.m, m.n, x, Gx)
    rows = np.empty(m.m, dtype=np.int64)
    count = 0
    for i in range(m.m):
        if Gx[i] > h[i]:
            rows[count] = i
            count += 1
    return rows[:count]


@part
def make_all(m, rows):
    """Make the responses to some rows of G."""
    n, k = m.n, rows.size
    V = floats(m.factor, (n, n))
    C, H, W = np.empty((k, n)), np.empty((k, n)), np.empty((k, m.m))
    for i in range(k):
        row = row_of(m.G, rows[i], n)
        for j in range(n):
            C[i, j] = row[j]
    product(1.0, C, V, 0.0, H)
    multiply(H, V, C)
    product(1.0, C, floats(m.G, (m.m, n)), 0.0, W)
    for i in range(k):
        values = claim_place(m, rows[i])
        for j in range(m.m):
            values[j] = W[i, j]
        for j in range(n):
            values[m.m + j] = C[i, j]
