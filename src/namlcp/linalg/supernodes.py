"""Sparse Cholesky factors of A + diag(shift) on the free unknowns, in dense blocks.

Every supernode is a dense block (Ng and Peyton, SIAM J. Sci. Comput. 14 (1993)
1034-1056). The blocks are laid out once, for all unknowns; an unknown that is not free
has a row and a column of the identity. The factorisation is left-looking: it computes
a block from A and from the blocks of its descendants in the elimination tree. When few
unknowns change state, it computes only their blocks and those of their ancestors again.
In descendants' blocks, the row of an unknown that is not free is computed as if it were
free, and is skipped: it is right when the unknown is free again.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import kernel, part, pasted
from namlcp.linalg.lapack import (
    add_scaled,
    backward_solve,
    cholesky,
    dot,
    product,
    solve_rows,
)
from namlcp.linalg.ldl import PIVOT_FLOOR
from namlcp.linalg.ordering import Order, Supernodes, supernodes

FEW_PRODUCTS = 64
"""Multiplications below which a product by loops is faster than by BLAS."""


class Blocks(NamedTuple):
    """The supernodes of a set of unknowns, and how each depends on its descendants.

    order (size,) lists the unknowns by position, place (n,) is its inverse, -1 for
    those left out. Run r, in run_at[s] : run_at[s + 1], is the rows top[r] : bottom[r]
    of block[r], which are columns of supernode s. room is the number of work entries
    needed: the largest product of a run, or square of a supernode.
    """

    nodes: Supernodes
    order: np.ndarray
    place: np.ndarray
    run_at: np.ndarray
    block: np.ndarray
    top: np.ndarray
    bottom: np.ndarray
    room: int


def blocks_of(indptr: np.ndarray, indices: np.ndarray, order: Order) -> Blocks:
    """Return the blocks of a symmetric matrix (n, n) in CSC."""
    nodes = supernodes(indptr, indices, order)
    chosen = np.flatnonzero(order.place >= 0)
    by_place = np.empty(chosen.size, dtype=np.int32)
    by_place[order.place[chosen]] = chosen
    # Entries of nodes.rows in block s, within the columns of supernode t.
    s = np.repeat(np.arange(nodes.parent.size), np.diff(nodes.starts))
    t = nodes.node[nodes.rows]
    begin = np.flatnonzero(np.diff(s, prepend=-1) | np.diff(t, prepend=-1))
    end = np.append(begin[1:], s.size)
    runs = np.flatnonzero(s[begin] != t[begin])
    runs = runs[np.argsort(t[begin[runs]], kind="stable")]
    block, into = s[begin[runs]], t[begin[runs]]
    begin, end = begin[runs], end[runs]
    run_at = np.searchsorted(into, np.arange(nodes.parent.size + 1))
    products = (nodes.starts[block + 1] - begin) * (end - begin)
    squares = np.diff(nodes.first).astype(np.int64) ** 2
    room = max(1, products.max(initial=0), squares.max(initial=0))
    start = nodes.starts[block]
    top, bottom = begin - start, end - start
    return Blocks(nodes, by_place, order.place, run_at, block, top, bottom, int(room))


@pasted
def panel_of(nodes, values, s):
    """Return the block of supernode s, (rows, columns)."""
    height = nodes.starts[s + 1] - nodes.starts[s]
    width = np.int64(nodes.first[s + 1] - nodes.first[s])
    return values[nodes.panels[s] : nodes.panels[s + 1]].reshape(height, width)


@pasted
def rows_below(nodes, s):
    """Return the rows of supernode s that are not columns of it."""
    begin = nodes.starts[s] + nodes.first[s + 1] - nodes.first[s]
    return nodes.rows[begin : nodes.starts[s + 1]]


@part
def solve_unit_lower(nodes, L, x):
    """Overwrite x, in elimination order, by L^-1 x; the unit diagonal is not read."""
    for s in range(nodes.first.size - 1):
        own = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        panel = panel_of(nodes, L, s)
        f, k = panel.shape
        block = x[nodes.first[s] : nodes.first[s + 1]]
        for i in range(1, k):
            block[i] -= dot(panel[i, :i], block[:i])
        for i in range(k, f):
            x[own[i]] -= dot(panel[i], block)


@part
def assemble_block(data, shift, is_free, blocks, s, where, block):
    """Set the block of supernode s to its part of A + diag(shift)."""
    nodes = blocks.nodes
    begin, end = nodes.first[s], nodes.first[s + 1]
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            block[i, j] = 0.0
    for j in range(begin, end):
        at = j - begin
        if not is_free[j]:
            block[at, at] = 1.0
            continue
        for t in range(nodes.lower[j], nodes.lower[j + 1]):
            i = nodes.below[t]
            if i >= end or is_free[i]:
                block[where[i], at] = data[nodes.source[t]]
        block[at, at] += shift[blocks.order[j]]


@part
def subtract_runs(blocks, is_free, s, where, values, work, block):
    """Subtract the contributions of the descendants of supernode s from its block."""
    nodes = blocks.nodes
    begin = nodes.first[s]
    for run in range(blocks.run_at[s], blocks.run_at[s + 1]):
        t, top = blocks.block[run], blocks.top[run]
        inside = blocks.bottom[run] - top
        rows = nodes.rows[nodes.starts[t] + top : nodes.starts[t + 1]]
        L = panel_of(nodes, values, t)[top:]
        small = L.shape[1] * inside * rows.size < FEW_PRODUCTS
        found = work[: rows.size * inside].reshape(rows.size, inside)
        if not small:
            product(1.0, L, L[:inside], 0.0, found)
        for i in range(rows.size):
            if i < inside and not is_free[rows[i]]:
                continue
            line = block[where[rows[i]]]
            for j in range(min(i + 1, inside)):
                if is_free[rows[j]]:
                    total = dot(L[i], L[j]) if small else found[i, j]
                    line[rows[j] - begin] -= total


@part
def factor_square(L, work):
    """Overwrite the lower triangle of L by its Cholesky factor; return 1.

    If LAPACK fails, pivots are raised to `PIVOT_FLOOR`, and the least pivot before that
    is returned, if it is below 1.
    """
    width = L.shape[0]
    for i in range(width):
        for j in range(i + 1):
            work[i * width + j] = L[i, j]
    if cholesky(L) == 0:
        return 1.0
    smallest = 1.0
    for i in range(width):
        for j in range(i + 1):
            L[i, j] = work[i * width + j]
    for j in range(width):
        pivot = L[j, j] - dot(L[j, :j], L[j, :j])
        smallest = min(smallest, pivot)
        L[j, j] = np.sqrt(max(pivot, PIVOT_FLOOR))
        for i in range(j + 1, width):
            L[i, j] = (L[i, j] - dot(L[i, :j], L[j, :j])) / L[j, j]
    return smallest


@kernel(error_model="numpy")
def factor_blocks(data, shift, free, changed, blocks, values):
    """Factor A + diag(shift) on the free unknowns, with the identity on the others.

    data has the entries of A (n, n) in the CSC pattern that `blocks` were made for;
    shift, free and changed are (n,), the last two bool. Of `values`, the entries of all
    blocks, only blocks of changed unknowns and their ancestors are overwritten.

    Returns (smallest, work): the least pivot before it was raised, 1 if none was
    (clearly negative means indefinite), and the fraction of `values` computed.
    """
    nodes = blocks.nodes
    size = nodes.parent.size
    dirty = np.zeros(size, dtype=np.bool_)
    for j in range(blocks.order.size):
        if changed[blocks.order[j]]:
            dirty[nodes.node[j]] = True
    work = np.empty(blocks.room)
    where = np.empty(blocks.order.size, dtype=np.int32)
    is_free = free[blocks.order]
    made = 0.0
    smallest = 1.0
    for s in range(size):
        if not dirty[s]:
            continue
        if nodes.parent[s] >= 0:
            dirty[nodes.parent[s]] = True
        rows = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        for k in range(rows.size):
            where[rows[k]] = k
        block = panel_of(nodes, values, s)
        width = block.shape[1]
        made += block.size
        assemble_block(data, shift, is_free, blocks, s, where, block)
        subtract_runs(blocks, is_free, s, where, values, work, block)
        smallest = min(smallest, factor_square(block[:width], work))
        solve_rows(block[:width], False, block[width:])
    return smallest, made / max(1.0, np.float64(values.size))


@kernel(error_model="numpy")
def solve_blocks(blocks, free, values, b, x):
    """Set the free entries of x (n,) to the solution for b (n,); the others stay."""
    nodes, order = blocks.nodes, blocks.order
    y = np.zeros(order.size)
    for k in range(order.size):
        if free[order[k]]:
            y[k] = b[order[k]]
    for s in range(nodes.parent.size):
        begin, end = nodes.first[s], nodes.first[s + 1]
        rows = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        L = panel_of(nodes, values, s)
        own = y[begin:end]
        for i in range(own.size):
            if not free[order[begin + i]]:
                own[i] = 0.0
                continue
            own[i] = (own[i] - dot(L[i, :i], own[:i])) / L[i, i]
        for k in range(own.size, rows.size):
            y[rows[k]] -= dot(L[k], own)
    for s in range(nodes.parent.size - 1, -1, -1):
        begin, end = nodes.first[s], nodes.first[s + 1]
        rows = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        L = panel_of(nodes, values, s)
        own = y[begin:end]
        for k in range(own.size, rows.size):
            if y[rows[k]] != 0.0:
                add_scaled(-y[rows[k]], L[k], own)
        backward_solve(L, own)
    for k in range(order.size):
        if free[order[k]]:
            x[order[k]] = y[k]
