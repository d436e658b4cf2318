"""Sparse Cholesky factors of A + diag(shift) in dense blocks, for large faces.

Every supernode is a dense block (Ng and Peyton, SIAM J. Sci. Comput. 14 (1993)
1034-1056). The blocks are laid out once, for all unknowns; one that is not free is a
row and a column of the identity. Left-looking: a block is made from A and from the
blocks below it in the elimination tree, so when few unknowns change state only the
blocks of those and of their ancestors are made anew. The rows of a bounded unknown in
the blocks below its own stay what they would be if it were free: they are skipped, and
are right when it is free again.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import kernel, part
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

DIRECT = 64
"""Products with fewer multiplications are not worth a call of BLAS."""


class Blocks(NamedTuple):
    """The supernodes of a face, and what each of them takes from those below it.

    order (size,) lists the unknowns by position, place (n,) is its inverse, -1 for
    those left out. The blocks with rows in the columns of supernode s are
    run[run_at[s] : run_at[s + 1], 0], with their rows from column 1 to column 2.
    """

    nodes: Supernodes
    order: np.ndarray
    place: np.ndarray
    run_at: np.ndarray
    run: np.ndarray


def blocks_of(indptr: np.ndarray, indices: np.ndarray, order: Order) -> Blocks:
    """Return the blocks of a symmetric matrix (n, n) in compressed columns."""
    nodes = supernodes(indptr, indices, order)
    chosen = np.flatnonzero(order.place >= 0)
    by_place = np.empty(chosen.size, dtype=np.int32)
    by_place[order.place[chosen]] = chosen
    return Blocks(nodes, by_place, order.place, *runs(nodes))


@kernel
def runs(nodes):
    """Return the rows of blocks that lie within the columns of one supernode."""
    size = nodes.parent.size
    run_at = np.zeros(size + 1, dtype=np.int64)
    run = np.empty((0, 3), dtype=np.int32)
    free = np.empty(size, dtype=np.int64)
    for write in range(2):  # first they are counted
        for s in range(size):
            start, stop = nodes.starts[s], nodes.starts[s + 1]
            begin = start + nodes.first[s + 1] - nodes.first[s]
            while begin < stop:
                t = nodes.node[nodes.rows[begin]]
                end = begin + 1
                while end < stop and nodes.node[nodes.rows[end]] == t:
                    end += 1
                if write:
                    run[free[t], 0] = s
                    run[free[t], 1] = begin - start
                    run[free[t], 2] = end - start
                    free[t] += 1
                else:
                    run_at[t + 1] += 1
                begin = end
        if not write:
            for t in range(size):
                run_at[t + 1] += run_at[t]
                free[t] = run_at[t]
            run = np.empty((run_at[size], 3), dtype=np.int32)
    return run_at, run


@part
def panel(nodes, values, s):
    """Return the block of supernode s: its rows in its columns."""
    height = nodes.starts[s + 1] - nodes.starts[s]
    width = np.int64(nodes.first[s + 1] - nodes.first[s])
    return values[nodes.panels[s] : nodes.panels[s + 1]].reshape(height, width)


@part
def assemble(data, shift, open_, blocks, s, where, block):
    """Write the part of A + diag(shift) that belongs to supernode s to its block."""
    nodes = blocks.nodes
    begin, end = nodes.first[s], nodes.first[s + 1]
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            block[i, j] = 0.0
    for j in range(begin, end):
        at = j - begin
        if not open_[j]:
            block[at, at] = 1.0
            continue
        for t in range(nodes.lower[j], nodes.lower[j + 1]):
            i = nodes.below[t]
            if i >= end or open_[i]:
                block[where[i], at] = data[nodes.source[t]]
        block[at, at] += shift[blocks.order[j]]


@part
def subtract_runs(blocks, open_, s, where, values, work, block):
    """Subtract what the blocks below supernode s contribute to its own."""
    nodes = blocks.nodes
    begin = nodes.first[s]
    for at in range(blocks.run_at[s], blocks.run_at[s + 1]):
        t, top = blocks.run[at, 0], blocks.run[at, 1]
        inside = np.int64(blocks.run[at, 2] - top)
        rows = nodes.rows[nodes.starts[t] + top : nodes.starts[t + 1]]
        L = panel(nodes, values, t)[top:]
        small = L.shape[1] * inside * rows.size < DIRECT
        found = work[: rows.size * inside].reshape(rows.size, inside)
        if not small:
            product(1.0, L, L[:inside], 0.0, found)
        for i in range(rows.size):
            if i < inside and not open_[rows[i]]:
                continue
            line = block[where[rows[i]]]
            for j in range(min(i + 1, inside)):
                if open_[rows[j]]:
                    total = dot(L[i], L[j]) if small else found[i, j]
                    line[rows[j] - begin] -= total


@part
def factor_square(L, work):
    """Overwrite the lower triangle by its Cholesky factor; return the least pivot.

    Where LAPACK refuses, pivots are raised to `PIVOT_FLOOR` and the least is told.
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


@part
def work_room(blocks):
    """Return the largest product of a run, or square, of all supernodes."""
    nodes = blocks.nodes
    room = np.int64(1)
    for s in range(nodes.parent.size):
        width = np.int64(nodes.first[s + 1] - nodes.first[s])
        room = max(room, width * width)
    for at in range(blocks.run.shape[0]):
        s, top = blocks.run[at, 0], np.int64(blocks.run[at, 1])
        height = nodes.starts[s + 1] - nodes.starts[s] - top
        room = max(room, height * (blocks.run[at, 2] - top))
    return room


@kernel(error_model="numpy")
def factor_blocks(data, shift, free, changed, blocks, values):
    """Factor A + diag(shift) on the free unknowns, with the identity on the others.

    Parameters
    ----------
    data : array
        Entries of the compressed columns of A (n, n) that the blocks were made for.
    shift : (n,) array
    free, changed : (n,) bool array
        Only blocks of changed unknowns and their ancestors are made; the others stay.
    blocks : Blocks
    values : array
        The blocks, overwritten.

    Returns
    -------
    smallest : float
        The least pivot before it was raised, 1 if none was; clearly negative means
        indefinite.
    work : float
        Numbers in the blocks made over numbers in all.
    """
    nodes = blocks.nodes
    size = nodes.parent.size
    dirty = np.zeros(size, dtype=np.bool_)
    for j in range(blocks.order.size):
        if changed[blocks.order[j]]:
            dirty[nodes.node[j]] = True
    work = np.empty(work_room(blocks))
    where = np.empty(blocks.order.size, dtype=np.int32)
    open_ = free[blocks.order]
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
        block = panel(nodes, values, s)
        width = block.shape[1]
        made += block.size
        assemble(data, shift, open_, blocks, s, where, block)
        subtract_runs(blocks, open_, s, where, values, work, block)
        smallest = min(smallest, factor_square(block[:width], work))
        solve_rows(block[:width], False, block[width:])
    return smallest, made / max(1.0, np.float64(values.size))


@kernel(error_model="numpy")
def solve_blocks(blocks, free, values, b, x):
    """Write the solution for b (n,) on the free unknowns to x (n,); others stay."""
    nodes, order = blocks.nodes, blocks.order
    y = np.zeros(order.size)
    for k in range(order.size):
        if free[order[k]]:
            y[k] = b[order[k]]
    for s in range(nodes.parent.size):
        begin, end = nodes.first[s], nodes.first[s + 1]
        rows = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        L = panel(nodes, values, s)
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
        L = panel(nodes, values, s)
        own = y[begin:end]
        for k in range(own.size, rows.size):
            if y[rows[k]] != 0.0:
                add_scaled(-y[rows[k]], L[k], own)
        backward_solve(L, own)
    for k in range(order.size):
        if free[order[k]]:
            x[order[k]] = y[k]
