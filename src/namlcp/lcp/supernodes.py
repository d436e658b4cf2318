"""Sparse Cholesky factors of A + diag(shift) in dense blocks, for large faces.

Neighbouring columns of L with (nearly) the same rows make a supernode, a dense block,
so that BLAS does the work (Ng and Peyton, SIAM J. Sci. Comput. 14 (1993) 1034-1056).
The blocks are made once, for all unknowns; one that is not free is a row and a column
of the identity. Left-looking: a block is made from A and from the blocks below it in
the elimination tree, so when few unknowns change state only the blocks of those and of
their ancestors are made anew. The
rows of a bounded unknown in the blocks below its own stay what they would be if it were
free: they are skipped, and are right when it is free again.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from namlcp.lapack import cholesky, dot, inner, multiply, triangular_solve
from namlcp.lcp.ldl import NONE, PIVOT_FLOOR, symbolic

# Supernodes merge up to so many columns if that makes at most such a share of zeros.
RELAXED = np.array(((4, 0.95), (16, 0.6), (48, 0.15), (1 << 30, 0.05)))


DIRECT = 64
"""Products with fewer multiplications are not worth a call of BLAS."""


class Blocks(NamedTuple):
    """Where everything is; positions count along `order`.

    Supernode s has the columns first[s] : first[s + 1]; below them come its rows,
    rows[row_at[s] : row_at[s + 1]], ascending. Its block, row-major, begins at
    value_at[s] and starts with the square of its columns. The blocks below it that
    have rows in its columns are source[source_at[s] : source_at[s + 1], 0], with the
    rows from column 1 to column 2.
    """

    order: np.ndarray
    place: np.ndarray
    node: np.ndarray
    parent: np.ndarray
    first: np.ndarray
    row_at: np.ndarray
    rows: np.ndarray
    value_at: np.ndarray
    source_at: np.ndarray
    source: np.ndarray


@inner
def postorder(parent):
    """Return the nodes of a forest, children before parents, subtree by subtree."""
    n = parent.size
    links = np.full((2, n), NONE, dtype=np.int32)
    head, after = links[0], links[1]
    for j in range(n - 1, -1, -1):
        if parent[j] >= 0:
            after[j] = head[parent[j]]
            head[parent[j]] = j
    found = np.empty(n, dtype=np.int32)
    stack = np.empty(n, dtype=np.int32)
    done = 0
    for root in range(n):
        if parent[root] >= 0:
            continue
        stack[0] = root
        top = 1
        while top > 0:
            j = stack[top - 1]
            child = head[j]
            if child >= 0:
                head[j] = after[child]
                stack[top] = child
                top += 1
            else:
                top -= 1
                found[done] = j
                done += 1
    return found


@inner
def elimination_tree(indices, indptr, order):
    """Return place (the inverse of order, else -1), tree, counts of L's columns."""
    n = order.size
    place = np.full(indptr.size - 1, NONE, dtype=np.int32)
    for k in range(n):
        place[order[k]] = k
    tree = np.empty((2, n), dtype=np.int32)
    symbolic(indices, indptr, order, place, tree[0], tree[1])
    return place, tree[0], tree[1]


@inner
def entries(columns, rows):
    """Return how many numbers a supernode has."""
    return columns * (rows - 0.5 * (columns - 1.0))


@inner
def merge(parent, counts, limits):
    """Return first, lengths: the supernodes of a postordered tree and all their rows.

    A column joins the one before if that is its child; limits (k, 2) says, for so many
    columns together, which share of zeros is worth it.
    """
    n = parent.size
    first = np.empty(n + 1, dtype=np.int32)
    lengths = np.empty(n, dtype=np.int32)
    filled = np.empty(n)  # numbers that are not zero by the merging
    size = 0
    for j in range(n):
        first[size] = j
        lengths[size] = counts[j] + 1
        filled[size] = counts[j] + 1.0
        size += 1
        while size > 1 and first[size - 2] < first[size - 1]:
            last = first[size - 1] - 1
            if parent[last] < 0 or parent[last] > j:
                break
            columns = j + 1 - first[size - 2]
            rows = lengths[size - 1] + first[size - 1] - first[size - 2]
            share = 1.0 - (filled[size - 1] + filled[size - 2]) / entries(columns, rows)
            k = 0
            while columns > limits[k, 0]:
                k += 1
            if share > limits[k, 1]:
                break
            filled[size - 2] += filled[size - 1]
            lengths[size - 2] = rows
            size -= 1
    first[size] = n
    return first[: size + 1].copy(), lengths[:size].copy()


@inner
def lay_out(indices, indptr, order, place, tree, first, lengths):
    """Return the `Blocks` of these supernodes."""
    n, size = order.size, lengths.size
    node = np.empty(n, dtype=np.int32)
    parent = np.empty(size, dtype=np.int32)
    row_at = np.zeros(size + 1, dtype=np.int64)
    value_at = np.zeros(size + 1, dtype=np.int64)
    for s in range(size):
        columns = first[s + 1] - first[s]
        row_at[s + 1] = row_at[s] + lengths[s] - columns
        value_at[s + 1] = value_at[s] + columns * lengths[s]
        for j in range(first[s], first[s + 1]):
            node[j] = s
    for s in range(size):
        above = tree[first[s + 1] - 1]
        parent[s] = node[above] if above >= 0 else NONE
    rows = np.empty(row_at[size], dtype=np.int32)
    filled = row_at.copy()
    seen = np.full(size, NONE, dtype=np.int32)
    for k in range(n):
        seen[node[k]] = k
        for p in range(indptr[order[k]], indptr[order[k] + 1]):
            i = place[indices[p]]
            if 0 <= i < k:
                s = node[i]
                while seen[s] != k:
                    seen[s] = k
                    rows[filled[s]] = k
                    filled[s] += 1
                    s = parent[s]
    # Runs of rows within the columns of one supernode: first counted, then written.
    source_at = np.zeros(size + 1, dtype=np.int64)
    source = np.empty((0, 3), dtype=np.int32)
    for write in range(2):
        for s in range(size):
            begin = row_at[s]
            while begin < row_at[s + 1]:
                t = node[rows[begin]]
                end = begin + 1
                while end < row_at[s + 1] and node[rows[end]] == t:
                    end += 1
                if write:
                    source[seen[t], 0] = s
                    source[seen[t], 1] = begin - row_at[s]
                    source[seen[t], 2] = end - row_at[s]
                    seen[t] += 1
                else:
                    source_at[t + 1] += 1
                begin = end
        if not write:
            for t in range(size):
                source_at[t + 1] += source_at[t]
                seen[t] = source_at[t]
            source = np.empty((source_at[size], 3), dtype=np.int32)
    return Blocks(
        order, place, node, parent, first, row_at, rows, value_at, source_at, source
    )


@njit(cache=True, nogil=True, error_model="numpy")
def blocks_of(indices, indptr, order, limits):
    """Return the blocks of a symmetric pattern (n, n) in that elimination order.

    order (m,) int32 lists the unknowns that may be free; it becomes a postorder of its
    elimination tree. limits is `RELAXED`.
    """
    place, tree, counts = elimination_tree(indices, indptr, order)
    order = order[postorder(tree)]
    place, tree, counts = elimination_tree(indices, indptr, order)
    first, lengths = merge(tree, counts, limits)
    return lay_out(indices, indptr, order, place, tree, first, lengths)


@inner
def assemble(columns, shift, open_, blocks, s, where, block):
    """Write the part of A + diag(shift) that belongs to supernode s to its block."""
    order, place = blocks.order, blocks.place
    begin, end = blocks.first[s], blocks.first[s + 1]
    width = end - begin
    for k in range(block.size):
        block[k] = 0.0
    for j in range(begin, end):
        at = j - begin
        if not open_[j]:
            block[at * (width + 1)] = 1.0
            continue
        i = order[j]
        for p in range(columns.indptr[i], columns.indptr[i + 1]):
            k = place[columns.indices[p]]
            if k >= end:
                block[where[k] * width + at] = columns.data[p]
            elif k >= j and open_[k]:
                block[(k - begin) * width + at] = columns.data[p]
        block[at * (width + 1)] += shift[i]


@inner
def subtract_sources(blocks, open_, s, where, values, product, block):
    """Subtract what the blocks below supernode s contribute to its own."""
    begin, end = blocks.first[s], blocks.first[s + 1]
    width = end - begin
    for at in range(blocks.source_at[s], blocks.source_at[s + 1]):
        t, top = blocks.source[at, 0], blocks.source[at, 1]
        inside = blocks.source[at, 2] - top
        rows = blocks.rows[blocks.row_at[t] + top : blocks.row_at[t + 1]]
        across = blocks.first[t + 1] - blocks.first[t]
        start = blocks.value_at[t] + (across + top) * across
        L = values[start : blocks.value_at[t + 1]]
        small = across * inside * rows.size < DIRECT
        if not small:
            multiply(L, rows.size, L, inside, across, product)
        for i in range(rows.size):
            row = where[rows[i]]
            if i < inside:
                row = rows[i] - begin
                if not open_[rows[i]]:
                    continue
            for j in range(min(i + 1, inside)):
                if not open_[rows[j]]:
                    continue
                if small:
                    total = 0.0
                    for k in range(across):
                        total += L[i * across + k] * L[j * across + k]
                else:
                    total = product[i * inside + j]
                block[row * width + rows[j] - begin] -= total


@inner
def factor_square(square, width, copy_of):
    """Overwrite the lower triangle by its Cholesky factor; return the least pivot.

    Where LAPACK refuses, pivots are raised to `PIVOT_FLOOR` and the least is told.
    """
    for k in range(width * width):
        copy_of[k] = square[k]
    L = square.reshape((width, width))
    if cholesky(L) == 0:
        return 1.0
    for k in range(width * width):
        square[k] = copy_of[k]
    smallest = 1.0
    for j in range(width):
        pivot = L[j, j] - dot(L[j, :j], L[j, :j])
        smallest = min(smallest, pivot)
        L[j, j] = np.sqrt(max(pivot, PIVOT_FLOOR))
        for i in range(j + 1, width):
            L[i, j] = (L[i, j] - dot(L[i, :j], L[j, :j])) / L[j, j]
    return smallest


@njit(cache=True, nogil=True, error_model="numpy")
def factor_blocks(columns, shift, free, changed, blocks, values):
    """Factor A + diag(shift) on the free unknowns, with the identity on the others.

    Parameters
    ----------
    columns : Columns
        Compressed columns of A (n, n), symmetric.
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
    size = blocks.parent.size
    dirty = np.zeros(size, dtype=np.bool_)
    for i in range(changed.size):
        if changed[i] and blocks.place[i] >= 0:
            dirty[blocks.node[blocks.place[i]]] = True
    widest, largest = np.int64(0), np.int64(0)
    made = 0.0
    for s in range(size):
        if dirty[s]:
            made += blocks.value_at[s + 1] - blocks.value_at[s]
            if blocks.parent[s] >= 0:
                dirty[blocks.parent[s]] = True
        widest = max(widest, np.int64(blocks.first[s + 1] - blocks.first[s]))
        largest = max(largest, blocks.row_at[s + 1] - blocks.row_at[s])
    for at in range(blocks.source.shape[0]):
        rows = (
            blocks.row_at[blocks.source[at, 0] + 1]
            - blocks.row_at[blocks.source[at, 0]]
        )
        inside = np.int64(blocks.source[at, 2] - blocks.source[at, 1])
        largest = max(largest, (rows - blocks.source[at, 1]) * inside)
    product = np.empty(max(largest, widest * widest))
    where = np.empty(changed.size, dtype=np.int32)
    open_ = free[blocks.order]
    smallest = 1.0
    for s in range(size):
        if not dirty[s]:
            continue
        width = blocks.first[s + 1] - blocks.first[s]
        rows = blocks.rows[blocks.row_at[s] : blocks.row_at[s + 1]]
        for k in range(rows.size):
            where[rows[k]] = width + k
        block = values[blocks.value_at[s] : blocks.value_at[s + 1]]
        assemble(columns, shift, open_, blocks, s, where, block)
        subtract_sources(blocks, open_, s, where, values, product, block)
        pivot = factor_square(block[: width * width], width, product)
        smallest = min(smallest, pivot)
        triangular_solve(
            block[: width * width], width, block[width * width :], rows.size
        )
    return smallest, made / max(1.0, np.float64(values.size))


@njit(cache=True, nogil=True, error_model="numpy")
def solve_blocks(blocks, free, values, b, x):
    """Write the solution for b (n,) on the free unknowns to x (n,); others stay."""
    n = blocks.order.size
    y = np.zeros(n)
    for k in range(n):
        if free[blocks.order[k]]:
            y[k] = b[blocks.order[k]]
    size = blocks.parent.size
    for s in range(size):
        begin, width = blocks.first[s], blocks.first[s + 1] - blocks.first[s]
        rows = blocks.rows[blocks.row_at[s] : blocks.row_at[s + 1]]
        L = values[blocks.value_at[s] : blocks.value_at[s + 1]]
        own = y[begin : begin + width]
        for i in range(width):
            if not free[blocks.order[begin + i]]:
                own[i] = 0.0
                continue
            own[i] = (own[i] - dot(L[i * width : i * width + i], own[:i])) / L[
                i * (width + 1)
            ]
        for k in range(rows.size):
            i = (width + k) * width
            y[rows[k]] -= dot(L[i : i + width], own)
    for s in range(size - 1, -1, -1):
        begin, width = blocks.first[s], blocks.first[s + 1] - blocks.first[s]
        rows = blocks.rows[blocks.row_at[s] : blocks.row_at[s + 1]]
        L = values[blocks.value_at[s] : blocks.value_at[s + 1]]
        own = y[begin : begin + width]
        for k in range(rows.size):
            y_k = y[rows[k]]
            if y_k != 0.0:
                i = (width + k) * width
                for j in range(width):
                    own[j] -= y_k * L[i + j]
        for i in range(width - 1, -1, -1):
            own[i] /= L[i * (width + 1)]
            for j in range(i):
                own[j] -= own[i] * L[i * width + j]
    for k in range(n):
        if free[blocks.order[k]]:
            x[blocks.order[k]] = y[k]
