"""Face systems (A_FF + diag(shift)_F) x = b: Cholesky, LU or sparse L D L'.

F is the set of unknowns strictly between their bounds, state 0. Small, dense and
nonsymmetric faces go to LAPACK, sparse symmetric ones to `ldl`, whichever takes fewer
operations.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import part
from namlcp.linalg import (
    SMALL,
    bitset_minimum_degree,
    cholesky,
    cholesky_solve,
    ldl_numeric,
    ldl_solve,
    ldl_symbolic,
    lu,
    lu_solve,
)

REGULAR = 0
SINGULAR = 1
INDEFINITE = 2

JITTER = 1e-11
"""Added to the diagonal of a face that Cholesky refuses."""

LEAST_MINOR = 1e-10
"""Pivots of LU below it leave the sign of the determinant open."""

LEAST_PIVOT = -1e-7
"""A smaller pivot of L D L' is no rounding error: the matrix is indefinite."""


class Ordering(NamedTuple):
    """Elimination order of the unknowns met so far.

    sequence (n,) int32 begins with the number[0] unknowns in order; rank (n,) int32 is
    their place in it, -1 for others; number[1] counts how often an order was made.
    local (n,) int32 is -1 between calls.
    """

    sequence: np.ndarray
    rank: np.ndarray
    local: np.ndarray
    number: np.ndarray


class Factor(NamedTuple):
    """Factors of one face: dense with or without pivots, or L (Lp, Li, Lx) and D."""

    order: np.ndarray
    dense: np.ndarray
    pivots: np.ndarray
    parent: np.ndarray
    Lp: np.ndarray
    Li: np.ndarray
    Lx: np.ndarray
    D: np.ndarray


@part
def gather(columns, shift, order, local, out):
    """Write the transpose of A_FF + diag(shift)_F to out (m, m), F = order."""
    m = order.size
    dense, data, indices, indptr = columns
    if dense.shape[0] > 0:
        for k in range(m):
            column = dense[order[k]]
            for t in range(m):
                out[k, t] = column[order[t]]
    else:
        for k in range(m):
            local[order[k]] = k
            for t in range(m):
                out[k, t] = 0.0
        for k in range(m):
            for p in range(indptr[order[k]], indptr[order[k] + 1]):
                if local[indices[p]] >= 0:
                    out[k, local[indices[p]]] = data[p]
        for k in range(m):
            local[order[k]] = -1
    for k in range(m):
        out[k, k] += shift[order[k]]


@part
def dense_factor(columns, symmetric, shift, factor, local):
    """Factor the face into factor.dense; return REGULAR, SINGULAR or INDEFINITE."""
    m = factor.order.size
    M = factor.dense
    gather(columns, shift, factor.order, local, M)
    if symmetric:
        if cholesky(M) == 0:
            return REGULAR
        gather(columns, shift, factor.order, local, M)
        for k in range(m):
            M[k, k] += JITTER
        if cholesky(M) == 0:
            return SINGULAR
        for k in range(m):  # no more than a point to go on from
            M[k, k] = max(M[k, k], JITTER)
        return INDEFINITE
    for k in range(m):
        for t in range(k):
            M[k, t], M[t, k] = M[t, k], M[k, t]
    if lu(M, factor.pivots) > 0:
        return SINGULAR
    positive = True
    least = np.inf
    for k in range(m):
        least = min(least, abs(M[k, k]))
        positive ^= M[k, k] < 0.0
        positive ^= factor.pivots[k] != k + 1
    # No P-matrix has a negative minor, but the sign of a tiny one is rounding.
    return INDEFINITE if least > LEAST_MINOR and not positive else REGULAR


@part
def face_order(columns, symmetric, state, ordering):
    """Return the face {state = 0}, in elimination order where it may be sparse.

    The first order is made on the face, the second on it and all unknowns met before,
    the third on all n: most solves see one or two faces that differ little.
    """
    sequence, rank, number = ordering.sequence, ordering.rank, ordering.number
    n = state.size
    m = 0
    missing = False
    for i in range(n):
        if state[i] == 0:
            m += 1
            missing |= rank[i] < 0
    sparse = symmetric and m > SMALL and columns.dense.shape[0] == 0
    if sparse and missing:
        nodes = np.empty(n, dtype=np.int32)
        size = 0
        for i in range(n):
            if state[i] == 0 or rank[i] >= 0 or number[1] >= 2:
                nodes[size] = i
                size += 1
        bitset_minimum_degree(
            columns.indices, columns.indptr, nodes[:size], ordering.local, sequence
        )
        for k in range(size):
            rank[sequence[k]] = k
        number[0] = size
        number[1] += 1
    order = np.empty(m, dtype=np.int32)
    m = 0
    for k in range(number[0] if sparse else n):
        i = sequence[k] if sparse else k
        if state[i] == 0:
            order[m] = i
            m += 1
    return order


@part
def analyse(columns, symmetric, order, ordering):
    """Return an empty `Factor` for the face `order`, its storage chosen by cost."""
    m = order.size
    tree = np.empty((2, m), dtype=np.int32)
    local, parent, counts = ordering.local, tree[0], tree[1]
    Lp = np.zeros(m + 1, dtype=np.int64)
    size = m  # of the dense factor
    if symmetric and m > SMALL and columns.dense.shape[0] == 0:
        for k in range(m):
            local[order[k]] = k
        flops = ldl_symbolic(
            columns.indices, columns.indptr, order, local, parent, counts
        )
        for k in range(m):
            local[order[k]] = -1
        if 10.0 * flops <= m * (m * (m / 3.0)) + 5000.0:
            size = 0
            for k in range(m):
                Lp[k + 1] = Lp[k] + counts[k]
    return Factor(
        order,
        np.empty((size, size)),
        np.empty(size, dtype=np.int32),
        parent,
        Lp,
        np.empty(Lp[m], dtype=np.int32),
        np.empty(Lp[m]),
        np.empty(m - size),
    )


@part
def refactor(columns, symmetric, shift, factor, local):
    """Compute the numbers of `factor`; return REGULAR, SINGULAR or INDEFINITE."""
    m = factor.order.size
    if factor.dense.shape[0] == m:
        return dense_factor(columns, symmetric, shift, factor, local)
    order = factor.order
    for k in range(m):
        local[order[k]] = k
    smallest = ldl_numeric(
        columns, shift, order, local, factor.parent,
        factor.Lp, factor.Li, factor.Lx, factor.D,
    )  # fmt: skip
    for k in range(m):
        local[order[k]] = -1
    return INDEFINITE if smallest < LEAST_PIVOT else REGULAR


@part
def solve_face(symmetric, factor, b, x):
    """Write the solution for b (n,) on the face to x (n,); other entries stay."""
    order = factor.order
    m = order.size
    u = np.empty(m)
    for k in range(m):
        u[k] = b[order[k]]
    if factor.dense.shape[0] < m:
        ldl_solve(factor.Lp, factor.Li, factor.Lx, factor.D, u)
    elif symmetric:
        cholesky_solve(factor.dense, u)
    else:
        lu_solve(factor.dense, factor.pivots, u)
    for k in range(m):
        x[order[k]] = u[k]
