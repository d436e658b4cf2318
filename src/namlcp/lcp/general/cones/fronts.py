"""L U of a large matrix of symmetric pattern, by dense fronts without row exchanges.

The multifrontal method of `linalg.multifrontal` for matrices that are not symmetric:
supernode s has a panel (f, k) of L and one of U', whose squares are triangular, and
leaves an update of order f - k to its parent, a product by BLAS. The order and the
layout are made once for a pattern.

Pivots are taken from the diagonal in this order, whatever they are. That no row is
exchanged is justified by measurement alone: of piles, walls, chains, balls and cubes in
contact, the residuals of linear systems are those of SuperLU with row exchanges.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse

from namlcp.compiled import kernel, part
from namlcp.linalg.factors import better_order
from namlcp.linalg.lapack import add_scaled, dot, product
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.multifrontal import (
    panel_of,
    rows_below,
    solve_unit_lower,
    stack_size,
)
from namlcp.linalg.ordering import Supernodes, supernodes

BLOCK = 24
"""Columns eliminated by loops, before those to the right are updated by BLAS."""


class LU(NamedTuple):
    """Panels of L and of U', by supernode, and how many pivots are negative."""

    rank: np.ndarray
    nodes: Supernodes
    L: np.ndarray
    U: np.ndarray
    negative: int

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return the solution for b (n,)."""
        x = np.empty(b.size)
        x[self.rank] = b
        solve_panels(self.nodes, self.L, self.U, x)
        return x[self.rank]


class Fronts:
    """The layout of L and U for one pattern, and the memory of a factorisation."""

    def __init__(self, indptr: np.ndarray, indices: np.ndarray):
        """Take the pattern of a CSC matrix, symmetric, with all diagonal entries."""
        n = indptr.size - 1
        numbers = np.arange(indices.size)
        columns = np.repeat(np.arange(n), np.diff(indptr))
        # by rows, the entries of a symmetric pattern are those across the diagonal
        across = sparse.csc_array((numbers, indices, indptr), shape=(n, n)).tocsr().data
        above = indices <= columns
        rows, columns = indices[above].astype(np.int32), columns[above]
        counts = np.bincount(columns, minlength=n)
        starts = np.concatenate(([0], np.cumsum(counts))).astype(np.int32)
        order = better_order(starts, rows, minimum_degree(starts, rows))
        self.rank = rank = order.place
        self.nodes = nodes = supernodes(starts, rows, order)
        entries = np.array([numbers[above], across[above]])
        is_below = rank[rows] > rank[columns]  # in the order of elimination
        sources = np.where(is_below, entries, entries[::-1])
        self.sources = np.ascontiguousarray(sources[:, nodes.source])
        updates = np.diff(nodes.starts) - np.diff(nodes.first)
        self.position = np.empty(n, dtype=np.int32)
        self.stack = np.empty(stack_size(nodes.parent, updates))
        self.front = np.empty(int((updates**2).max(initial=0)))

    def factors(self, data: np.ndarray) -> LU | None:
        """Factor the matrix with these entries; return None if a pivot is 0."""
        L, U = np.empty((2, self.nodes.panels[-1]))
        negative = factorise(
            self.nodes, data, self.sources, L, U, self.position, self.stack, self.front
        )
        return None if negative < 0 else LU(self.rank, self.nodes, L, U, negative)


@kernel(error_model="numpy")
def factorise(nodes, data, sources, L, U, position, stack, front):
    """Set the panels of L and U'; return the number of pivots < 0, -1 if one is 0.

    Entry t of the layout is data[sources[0, t]] below the diagonal, data[sources[1, t]]
    above it. position, stack and front are overwritten. When a supernode is eliminated,
    the updates of its children are on top of the stack.
    """
    first, parent, starts, rows = nodes.first, nodes.parent, nodes.starts, nodes.rows
    number = first.size - 1
    waiting = np.zeros(number, dtype=np.int32)
    left = np.empty(number, dtype=np.int32)  # supernodes whose update is on the stack
    count, top, negative = 0, 0, 0
    for s in range(number):
        own = rows[starts[s] : starts[s + 1]]
        lower, upper = panel_of(nodes, L, s), panel_of(nodes, U, s)
        f, k = lower.shape
        u = f - k
        update = front[: u * u].reshape(u, u)
        for i in range(f):
            position[own[i]] = i
        lower[:] = 0.0
        upper[:] = 0.0
        update[:] = 0.0
        for j in range(k):
            for t in range(nodes.lower[first[s] + j], nodes.lower[first[s] + j + 1]):
                i = position[nodes.below[t]]
                lower[i, j] = data[sources[0, t]]
                upper[i, j] = data[sources[1, t]]
        for _ in range(waiting[s]):
            count -= 1
            child = left[count]
            theirs = rows_below(nodes, child)
            top -= theirs.size * theirs.size
            add_update(stack[top:], theirs, position, lower, upper, update)
        found = eliminate(lower, upper)
        if found < 0:
            return -1
        negative += found
        if u > 0:
            product(-1.0, lower[k:], upper[k:], 1.0, update)
            for i in range(u * u):
                stack[top + i] = front[i]
            top += u * u
            left[count] = s
            count += 1
            waiting[parent[s]] += 1
    return negative


@part
def add_update(child, rows, position, lower, upper, update):
    """Add the update of a child, on `rows`, to the panels and to the update."""
    k, u = lower.shape[1], rows.size
    inside = 0  # rows that are columns of this supernode
    while inside < u and position[rows[inside]] < k:
        inside += 1
    for i in range(u):
        row = position[rows[i]]
        line = child[i * u : i * u + u]
        for j in range(min(inside, i + 1)):
            lower[row, position[rows[j]]] += line[j]
        if i < inside:
            for j in range(i + 1, u):
                upper[position[rows[j]], row] += line[j]
        else:
            target = update[row - k]
            for j in range(inside, u):
                target[position[rows[j]] - k] += line[j]


@part
def eliminate(L, U):
    """Overwrite panels by those of L and U'; return the pivots < 0, -1 if one is 0.

    The diagonal entries are read in L. What is above the diagonals has no meaning. All
    rows of a column are eliminated by loops: triangular solves by BLAS take longer, as
    most panels have few columns.
    """
    f, k = L.shape
    negative = 0
    for start in range(0, k, BLOCK):
        stop = min(start + BLOCK, k)
        for j in range(start, stop):
            left, across = L[j, start:j], U[j, start:j]
            pivot = L[j, j] - dot(left, across)
            if not abs(pivot) > 0.0:
                return -1
            negative += pivot < 0.0
            U[j, j] = pivot
            for i in range(j + 1, f):
                U[i, j] -= dot(left, U[i, start:j])
                L[i, j] = (L[i, j] - dot(across, L[i, start:j])) / pivot
        rows, columns = slice(stop, f), slice(stop, k)
        product(
            -1.0, L[rows, start:stop], U[columns, start:stop], 1.0, L[rows, columns]
        )
        product(
            -1.0, U[rows, start:stop], L[columns, start:stop], 1.0, U[rows, columns]
        )
    return negative


@kernel(error_model="numpy")
def solve_panels(nodes, L, U, x):
    """Overwrite x, in elimination order, by the solution of L U y = x."""
    first, starts, rows = nodes.first, nodes.starts, nodes.rows
    solve_unit_lower(nodes, L, x)
    for s in range(first.size - 2, -1, -1):
        own = rows[starts[s] : starts[s + 1]]
        panel = panel_of(nodes, U, s)
        f, k = panel.shape
        block = x[first[s] : first[s + 1]]
        for i in range(k, f):
            add_scaled(-x[own[i]], panel[i], block)
        for i in range(k - 1, -1, -1):
            block[i] /= panel[i, i]
            add_scaled(-block[i], panel[i, :i], block[:i])
