"""Which constraints of a solved QP are active, and with a multiplier or without.

A constraint is strictly active if its multiplier is not 0, and weakly active if its
multiplier is 0 although it holds with equality; there the solution has a kink.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.linalg import (
    add_column_sums,
    add_columns,
    add_rmatvec,
    arrays_of,
    dot,
    largest_entry,
    matvec,
)
from namlcp.qp import QP, Point

ACTIVE = 1e-8
"""A multiplier counts as 0 if in no column of the stationarity condition its term
exceeds this multiple of the largest term there; a slack counts as 0 up to this multiple
of (1 + max |x|) times the norm of the row."""

INACTIVE, WEAK, STRICT = range(3)
"""States of a row of G."""


class ActiveSet(NamedTuple):
    """Constraints held with equality.

    equalities, rows: rows of A and of G, in rising order. side (n,) int8: -1 for a
    variable at its lower bound, 1 at the upper one, 0 for a free variable.
    """

    equalities: np.ndarray
    rows: np.ndarray
    side: np.ndarray


def active_sets(qp: QP, point: Point) -> tuple[ActiveSet, ActiveSet, int]:
    """Return the strictly active constraints, all active ones, and how many are weak.

    A pinned variable (lb_j = ub_j) always counts as strictly active, at the bound that
    its multiplier presses on.
    """
    state = np.empty(qp.h.size, dtype=np.int8)
    sides = np.empty((2, qp.q.size), dtype=np.int8)
    P, q, G, h, A, _, lb, ub = qp
    if qp.is_dense:
        weak = mark_dense((P, G, A), (q, h, lb, ub), tuple(point), state, sides)
    else:
        forms = tuple(tuple(arrays_of(M)) for M in (P, G, A))
        weak = mark_sparse(forms, (q, h, lb, ub), tuple(point), state, sides)
    every = np.arange(qp.b.size)
    strict = ActiveSet(every, (state == STRICT).nonzero()[0], sides[0])
    return strict, ActiveSet(every, state.nonzero()[0], sides[1]), weak


@kernel
def mark_dense(matrices, vectors, point, state, sides):
    """Do `mark` for dense matrices P, G and A."""
    P, G, A = matrices
    x, y, z, _ = point
    n, m = x.size, z.size
    size, terms, Gx = np.empty(n), np.zeros((2, n)), np.empty(m)
    matvec(P, x, size)
    matvec(G, x, Gx)
    add_rmatvec(G, z, terms[0])
    add_rmatvec(A, y, terms[1])
    set_sizes(vectors[0], point[3], terms, size)
    share, norms = np.zeros(m), np.empty(m)
    for i in range(m):
        row = G[i]
        norms[i] = np.sqrt(dot(row, row))
        if z[i] > 0.0:
            for j in range(n):
                share[i] = max(share[i], z[i] * abs(row[j]) * size[j])
                if share[i] > ACTIVE:
                    break
    return mark(vectors, point, (Gx, share, norms, size), state, sides)


@kernel
def mark_sparse(forms, vectors, point, state, sides):
    """Do `mark` for P, G and A in CSC, each as (indptr, indices, data)."""
    P, G, A = forms
    x, y, z, _ = point
    n, m = x.size, z.size
    size, terms, Gx = np.zeros(n), np.zeros((2, n)), np.zeros(m)
    add_columns(P[0], P[1], P[2], x, size)
    add_columns(G[0], G[1], G[2], x, Gx)
    add_column_sums(G[0], G[1], G[2], z, terms[0])
    add_column_sums(A[0], A[1], A[2], y, terms[1])
    set_sizes(vectors[0], point[3], terms, size)
    share, norms = np.zeros(m), np.zeros(m)
    indptr, indices, data = G
    for j in range(n):
        for t in range(indptr[j], indptr[j + 1]):
            i, entry = indices[t], abs(data[t])
            norms[i] += entry * entry
            share[i] = max(share[i], z[i] * entry * size[j])
    for i in range(m):
        norms[i] = np.sqrt(norms[i])
    return mark(vectors, point, (Gx, share, norms, size), state, sides)


@part
def set_sizes(q, z_box, terms, size):
    """Overwrite size, P x, by the inverse of the largest term of each column, or 0."""
    for j in range(size.size):
        large = max(abs(size[j]), abs(q[j]), abs(z_box[j]))
        large = max(large, abs(terms[0, j]), abs(terms[1, j]))
        size[j] = 1.0 / large if large > 0.0 else 0.0


@part
def mark(vectors, point, measures, state, sides):
    """Set state (m,) of the rows, and the sides (2, n) of the variables.

    sides[0] are those of strictly active bounds, sides[1] of all active bounds.
    measures = (G x, a number that exceeds ACTIVE where z_i does not count as 0, the
    norms of the rows of G, the result of `set_sizes`). Returns how many are weak.
    """
    _, h, lb, ub = vectors
    x, _, z, z_box = point
    Gx, share, norms, size = measures
    weak = 0
    near = ACTIVE * (1.0 + largest_entry(x))
    for i in range(z.size):
        state[i] = INACTIVE
        if share[i] > ACTIVE:
            state[i] = STRICT
        elif h[i] - Gx[i] <= near * norms[i]:
            state[i] = WEAK
            weak += 1
    for j in range(x.size):
        side = 0
        if abs(z_box[j]) * size[j] > ACTIVE or lb[j] == ub[j]:
            side = 1 if z_box[j] > 0.0 else -1
        sides[0, j] = side
        if side == 0:
            if ub[j] - x[j] <= near:
                side = 1
            elif x[j] - lb[j] <= near:
                side = -1
            weak += abs(side)
        sides[1, j] = side
    return weak
