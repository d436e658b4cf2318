"""Free systems (A_FF + diag(shift)_F) x = b: Cholesky, LU or sparse L D L'.

F is the set of free unknowns, state 0. Sparse symmetric systems are factored by
`linalg.ldl` where that takes less time, all others by dense Cholesky or LU.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import floats, ints, part
from namlcp.lcp.pivoting.state import matrix_of
from namlcp.linalg.columns import SMALL_ORDER
from namlcp.linalg.definite import PSD_SLACK
from namlcp.linalg.lapack import cholesky, cholesky_solve, declare, lu, lu_solve
from namlcp.linalg.ldl import (
    Triangle,
    ldl_numeric,
    ldl_solve,
    ldl_symbolic,
)
from namlcp.linalg.minimum_degree import OUTSIDE, VARIABLE

order_by_degree = declare(
    "namlcp.linalg.minimum_degree", "order_by_degree", "iinii", "i"
)

JITTER = 1e-11
"""Added to the unit diagonal where Cholesky fails, so that a singular A_FF succeeds."""

LEAST_PIVOT = -1e-7
"""Pivot of L D L', for a unit diagonal, below which A_FF counts as indefinite."""

CALL, DENSE_SPEED = 5000.0, 10.0
"""Cost of a dense factorisation beside its multiplications, counted in these; speed of
dense multiplications relative to sparse ones."""


class Factor(NamedTuple):
    """Factors of the system of the unknowns `order`: dense and pivots, or `sparse`."""

    order: np.ndarray
    dense: np.ndarray
    pivots: np.ndarray
    sparse: Triangle


@part
def gather(m, shift, order, out):
    """Write the transpose of A_FF + diag(shift)_F to out (count, count), F = order."""
    count, local = order.size, ints(m.local, m.n)
    dense, indptr, indices, data = matrix_of(m, m.scaled)
    if dense.shape[0] > 0:
        for k in range(count):
            column = dense[order[k]]
            for t in range(count):
                out[k, t] = column[order[t]]
    else:
        set_positions(order, local)
        for k in range(count):
            for t in range(count):
                out[k, t] = 0.0
            for p in range(indptr[order[k]], indptr[order[k] + 1]):
                if local[indices[p]] >= 0:
                    out[k, local[indices[p]]] = data[p]
        clear_positions(order, local)
    for k in range(count):
        out[k, k] += shift[order[k]]


@part
def set_positions(order, local):
    """Write the position of every unknown of `order` to local (n,)."""
    for k in range(order.size):
        local[order[k]] = k


@part
def clear_positions(order, local):
    """Undo `set_positions`."""
    for k in range(order.size):
        local[order[k]] = -1


@part
def dense_factor(m, shift, factor):
    """Overwrite factor.dense; return whether A_FF is regular, definite if symmetric."""
    count = factor.order.size
    M = factor.dense
    gather(m, shift, factor.order, M)
    if m.symmetric:
        if cholesky(M) == 0:
            return True
        gather(m, shift, factor.order, M)
        for k in range(count):
            M[k, k] += JITTER
        if cholesky(M) != 0:
            for k in range(count):  # not a factor of A_FF, but a solve stays possible
                M[k, k] = max(M[k, k], JITTER)
        return False
    for k in range(count):
        for t in range(k):
            M[k, t], M[t, k] = M[t, k], M[k, t]
    return lu(M, factor.pivots) == 0


@part
def may_stay_sparse(m, count):
    """Tell whether a free system of this order may be factored by `linalg.ldl`."""
    return m.symmetric and not m.is_dense and count > SMALL_ORDER


@part
def free_order(m, state):
    """Return the unknowns with state 0, in elimination order if A_FF may stay sparse.

    The first order covers these unknowns, the second also all those of the first, the
    third all n: most solves meet one or two sets F that differ little. With ask_convex,
    which factors A in the end, the first covers all n already.
    """
    sequence, rank = ints(m.sequence, m.n), ints(m.rank, m.n)
    count = 0
    missing = False
    for i in range(m.n):
        if state[i] == 0:
            count += 1
            missing |= rank[i] < 0
    sparse = may_stay_sparse(m, count)
    if sparse and missing:
        kind = np.empty(m.n, dtype=np.int32)
        of_all = m.ask_convex or m.orderings >= 2
        for i in range(m.n):
            chosen = of_all or state[i] == 0 or rank[i] >= 0
            kind[i] = VARIABLE if chosen else OUTSIDE
        _, indptr, indices, _ = matrix_of(m, m.scaled)
        if not order_by_degree(
            indptr.ctypes, indices.ctypes, m.n, kind.ctypes, rank.ctypes
        ):
            raise MemoryError("no memory for an elimination order")
        m.ordered = 0
        for i in range(m.n):
            if rank[i] >= 0:
                sequence[rank[i]] = i
                m.ordered += 1
        m.orderings += 1
    order = np.empty(count, dtype=np.int32)
    count = 0
    for k in range(m.ordered if sparse else m.n):
        i = sequence[k] if sparse else k
        if state[i] == 0:
            order[count] = i
            count += 1
    return order


@part
def analyse(m, order):
    """Return memory for the `Factor` of the unknowns in `order`, the cheaper kind."""
    count, local = order.size, ints(m.local, m.n)
    parent, counts = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    starts = np.zeros(count + 1, dtype=np.int64)
    size = count  # of the dense factor
    if may_stay_sparse(m, count):
        _, indptr, indices, _ = matrix_of(m, m.scaled)
        set_positions(order, local)
        flops = ldl_symbolic(indptr, indices, order, local, parent, counts)
        clear_positions(order, local)
        if DENSE_SPEED * flops <= count * (count * (count / 3.0)) + CALL:
            size = 0
            for k in range(count):
                starts[k + 1] = starts[k] + counts[k]
    rows, values = np.empty(starts[count], dtype=np.int32), np.empty(starts[count])
    triangle = Triangle(parent, starts, rows, values, np.empty(count - size))
    pivots = np.empty(size, dtype=np.int32)
    return Factor(order, np.empty((size, size)), pivots, triangle)


@part
def refactor(m, shift, factor):
    """Overwrite the numbers of `factor`; return what `dense_factor` does."""
    order, local = factor.order, ints(m.local, m.n)
    if factor.dense.shape[0] == order.size:
        return dense_factor(m, shift, factor)
    set_positions(order, local)
    scaled = matrix_of(m, m.scaled)
    smallest = ldl_numeric(scaled, shift, order, local, factor.sparse)
    clear_positions(order, local)
    return smallest >= LEAST_PIVOT


@part
def solve_free(symmetric, factor, b, x):
    """Write the solution for b (n,) to the free entries of x (n,), and no others."""
    order = factor.order
    count = order.size
    u = np.empty(count)
    for k in range(count):
        u[k] = b[order[k]]
    if factor.dense.shape[0] < count:
        ldl_solve(factor.sparse, u)
    elif symmetric:
        cholesky_solve(factor.dense, u)
    else:
        lu_solve(factor.dense, factor.pivots, u)
    for k in range(count):
        x[order[k]] = u[k]


@part
def has_unit_diagonal(m):
    """Tell whether all a_ii > 0, which are 1 after scaling."""
    has_unit = ints(m.has_unit, m.n)
    for i in range(m.n):
        if not has_unit[i]:
            return False
    return True


@part
def is_definite(m, is_free_definite):
    """Tell whether A + `PSD_SLACK` I is positive definite; False where an a_ii <= 0.

    is_free_definite: whether that is known of A_FF, F the free unknowns.
    """
    if not has_unit_diagonal(m):
        return False
    state, shift = ints(m.state, m.n), floats(m.shift, m.n)
    if is_free_definite and not m.is_dense:
        free_blocks_of_bounded(m)
    else:
        for i in range(m.n):
            state[i] = 0
    for i in range(m.n):
        shift[i] = PSD_SLACK
    factor = analyse(m, free_order(m, state))
    return refactor(m, shift, factor)


@part
def free_blocks_of_bounded(m):
    """Free each diagonal block of A that has a bounded unknown; bound all the others.

    Contacts of separate bodies make many blocks, few of which have one.
    """
    state, queue = ints(m.state, m.n), ints(m.goal, m.n)
    _, indptr, indices, _ = matrix_of(m, m.scaled)
    count, done = 0, 0
    for i in range(m.n):
        if state[i] != 0:
            queue[count] = i
            count += 1
        state[i] = 1 if state[i] == 0 else 0
    while done < count:
        i = queue[done]
        done += 1
        for p in range(indptr[i], indptr[i + 1]):
            j = indices[p]
            if state[j] != 0:
                state[j] = 0
                queue[count] = j
                count += 1
