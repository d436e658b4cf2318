"""The inverse factor of P, and responses to the rows that are violated at first.

For a large QP these products take most of the time, and BLAS multiplies matrices ten
times as fast as `dense` does a row at a time: with V = L^-1 and the rows C,
U = C V'V are the changes of x, and U G' those of G x. Most rows that the unconstrained
minimum violates become active; the responses to others are made when asked for.
"""

import numpy as np

from namlcp.compiled import floats, kernel, part
from namlcp.linalg import cholesky, invert_lower, multiply, product
from namlcp.qp.responses.dense import (
    MOST_SPREAD,
    copy_cost,
    forget_responses,
    is_sound,
    row_of,
    set_curvature,
    solve_with_factor,
    times_rows,
)
from namlcp.qp.responses.rows import claim_place
from namlcp.qp.responses.state import state_at

# Most variables and rows of a QP that is prepared like that; most rows for a variable:
# with more, about as many rows become active as there are variables, and the pivots
# take so long that nothing is gained over `qp/dense`.
MOST_LARGE, MOST_ROWS = 4000, 2


@kernel
def prepare(address, q, h):
    """Prepare a QP without equations, its matrices attached; False if it is not suited.

    q and h: its vectors, whose numbers need not be allowed.
    """
    m = state_at(address)
    n = m.n
    if m.p > 0 or m.m > MOST_ROWS * n or not is_sound(m):
        return False
    m.pull = 0.0
    copy_cost(m, 0.0)
    V = floats(m.factor, (n, n))
    if not is_well_factored(V):
        return False
    rows = violated_rows(m, q, h)
    if invert_lower(V) != 0:
        return False
    for i in range(n):
        for j in range(i + 1, n):
            V[i, j] = 0.0
    forget_responses(m)
    set_curvature(m)
    m.is_inverted, m.is_ready = 1, 1
    make_all(m, V, rows[: m.capacity])
    return True


@part
def is_well_factored(L):
    """Overwrite the lower triangle of P by L; tell whether its pivots are similar."""
    if cholesky(L) != 0:
        return False
    low, high = np.inf, 0.0
    for i in range(L.shape[0]):
        pivot = L[i, i] * L[i, i]
        low, high = min(low, pivot), max(high, pivot)
    return high <= MOST_SPREAD * low


@part
def violated_rows(m, q, h):
    """Return the rows of G that exceed h at the minimum without any constraint."""
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
def make_all(m, V, rows):
    """Make the responses to some rows of G."""
    n, k = m.n, rows.size
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
