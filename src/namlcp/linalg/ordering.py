"""Symbolic analysis for a sparse factorisation: order, elimination tree, supernodes.

The parent of a column of L in the elimination tree is the row of its first entry below
the diagonal; below that row, the pattern of a column is a subset of its parent's.
Columns of L with nearly the same pattern form a *supernode*, a dense block for BLAS.
The order is that of `minimum_degree`, or METIS's nested dissection. Tree and counts: J.
Liu, SIAM J. Matrix Anal. Appl. 11 (1990) 134-172; supernodes are relaxed as in CHOLMOD
(Chen, Davis, Hager, Rajamanickam, ACM Trans. Math. Softw. 35, 2008). Of a symmetric
matrix, in CSC, only the upper triangle is read.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix

from namlcp.checks import refuse_size, transposed
from namlcp.compiled import kernel, part

MERGE = np.array(((4, 0.5), (16, 0.3), (48, 0.1), (1 << 30, 0.05)))
"""(Columns, fraction): supernodes are merged into one of at most so many columns if at
most that fraction of its entries are explicit zeros."""

WHOLE, STRICT = 0, 1
"""The upper triangle with and without the diagonal: least j - i of its entries."""


class Order(NamedTuple):
    """A fill-reducing order in which every column follows its descendants.

    place (n,) has the new position of every row, -1 for those left out, parent (size,)
    the elimination tree in new positions, counts (size,) the entries of L below the
    diagonal.
    """

    place: np.ndarray
    parent: np.ndarray
    counts: np.ndarray

    @property
    def work(self) -> float:
        """Multiplications of a factorisation, about half of them in the updates."""
        counts = self.counts.astype(np.float64)
        return float(counts @ counts)


class Supernodes(NamedTuple):
    """The layout of L; all indices are positions in the order.

    Supernode s has the columns first[s] : first[s + 1], its rows are rows[starts[s] :
    starts[s + 1]], ascending, its own columns first. Its block, row-major, is
    panels[s] : panels[s + 1] of the values, parent[s] the supernode of its first row
    below the block, -1 if there is none. node (size,) tells the supernode of a column.
    Column j of the matrix has the entries data[source[t]] in the rows below[t], for t
    in lower[j] : lower[j + 1], the diagonal included.
    """

    first: np.ndarray
    parent: np.ndarray
    node: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    panels: np.ndarray
    lower: np.ndarray
    below: np.ndarray
    source: np.ndarray


def nested_dissection(indptr: np.ndarray, indices: np.ndarray) -> Order | None:
    """Order a symmetric matrix by METIS; None without pymetis (the extra `large`).

    Separators come last (A. George, SIAM J. Numer. Anal. 10, 1973): for large matrices
    without structure this causes less fill than minimum degree, in ten times the time.
    """
    try:
        import pymetis  # here, because few problems are so large
    except ImportError:
        return None
    size = indptr.size - 1
    if size == 0:  # METIS would divide by zero
        return None
    upper = csc_matrix((np.ones(indices.size), indices, indptr), shape=(size, size))
    graph = (upper + upper.T).tocsr()
    graph.setdiag(0.0)
    graph.eliminate_zeros()
    adjacency = pymetis.CSRAdjacency(graph.indptr, graph.indices)
    _, place = pymetis.nested_dissection(adjacency)
    return postordered(indptr, indices, np.array(place, dtype=np.int32))


def postordered(indptr: np.ndarray, indices: np.ndarray, place: np.ndarray) -> Order:
    """Return the postordered equivalent of the order `place`, which is overwritten."""
    return Order(place, *postordered_tree(indptr, indices, place))


def supernodes(indptr: np.ndarray, indices: np.ndarray, order: Order) -> Supernodes:
    """Return the layout of L for a symmetric matrix in this order."""
    size = order.parent.size
    columns, upper, source = permuted(indptr, indices, order.place, size, WHOLE)
    lower, below, source = transposed(columns, upper, source.astype(float), size)
    source = source.astype(np.int32)
    first = merged(order.parent, order.counts, lower, below, MERGE)
    last = first[1:] - 1
    k = np.diff(first).astype(np.int64)
    f = k + order.counts[last]
    starts = np.concatenate(([0], np.cumsum(f)))
    panels = np.concatenate(([0], np.cumsum(f * k)))
    refuse_size("the factors", int(panels[-1]))
    node = np.repeat(np.arange(k.size, dtype=np.int32), k)
    above = order.parent[last]
    parent = np.where(above < 0, -1, node[above]).astype(np.int32)
    rows = np.empty(starts[-1], dtype=np.int32)
    row_patterns(columns, upper, starts, parent, node, rows)
    return Supernodes(first, parent, node, starts, rows, panels, lower, below, source)


@part
def count_inside(indptr, indices, member, size, degree):
    """Set degree[i] to the neighbours in `member` of row i, of `size`; 0 outside."""
    for j in range(size):
        degree[j] = 0
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i < j and member[i] and member[j]:
                degree[i] += 1
                degree[j] += 1


@kernel
def permuted(indptr, indices, place, size, least):
    """Return the permuted upper triangle in CSC, and where its entries come from.

    `least` is WHOLE or STRICT. The entries of a column are in their original order.
    """
    columns = np.empty(size + 1, dtype=np.int32)
    for k in range(size + 1):
        columns[k] = 0
    for j in range(place.size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i <= j - least and place[i] >= 0 and place[j] >= 0:
                columns[max(place[i], place[j])] += 1
    for k in range(1, size + 1):
        columns[k] += columns[k - 1]
    # columns[k] is the end of column k, then decreases to its first entry
    rows = np.empty(columns[size], dtype=np.int32)
    source = np.empty(columns[size], dtype=np.int32)
    for j in range(place.size - 1, -1, -1):
        for t in range(indptr[j + 1] - 1, indptr[j] - 1, -1):
            i = indices[t]
            if i <= j - least and place[i] >= 0 and place[j] >= 0:
                k = max(place[i], place[j])
                columns[k] -= 1
                rows[columns[k]] = min(place[i], place[j])
                source[columns[k]] = t
    return columns, rows, source


@part
def climb(i, k, parent, count, seen):
    """Follow the entry (k, i) of L up the tree to a column that row k has seen."""
    while seen[i] != k:
        seen[i] = k
        count[i] += 1
        if parent[i] < 0:
            parent[i] = k
        i = parent[i]


@kernel
def elimination_tree(columns, rows):
    """Return each column's parent, -1 at a root, and its entries below the diagonal."""
    size = columns.size - 1
    parent = np.empty(size, dtype=np.int32)
    count = np.empty(size, dtype=np.int32)
    seen = np.empty(size, dtype=np.int32)
    for k in range(size):
        parent[k] = -1
        count[k] = 0
        seen[k] = k
        for t in range(columns[k], columns[k + 1]):
            climb(rows[t], k, parent, count, seen)
    return parent, count


@part
def postorder(parent):
    """Return the position of every node when each follows its descendants."""
    size = parent.size
    head = np.empty(size + 1, dtype=np.int32)  # the last list: the roots
    for k in range(size + 1):
        head[k] = -1
    following = np.empty(size, dtype=np.int32)
    for j in range(size - 1, -1, -1):
        k = parent[j] if parent[j] >= 0 else size
        following[j] = head[k]
        head[k] = j
    place = np.empty(size, dtype=np.int32)
    path = np.empty(size + 1, dtype=np.int32)
    path[0] = size
    depth = 0
    done = 0
    while depth >= 0:
        k = path[depth]
        child = head[k]
        if child >= 0:
            head[k] = following[child]
            depth += 1
            path[depth] = child
        else:
            if k < size:
                place[k] = done
                done += 1
            depth -= 1
    return place


@kernel
def postordered_tree(indptr, indices, place):
    """Return the parents and the counts of an `Order`; `place` becomes its place."""
    size = 0
    for i in range(place.size):
        size += place[i] >= 0
    columns, rows, _ = permuted(indptr, indices, place, size, STRICT)
    parent, counts = elimination_tree(columns, rows)
    position = postorder(parent)
    for i in range(place.size):
        if place[i] >= 0:
            place[i] = position[place[i]]
    new_parent = np.empty(parent.size, dtype=np.int32)
    new_counts = np.empty(parent.size, dtype=np.int32)
    for j in range(parent.size):
        above = parent[j]
        new_parent[position[j]] = position[above] if above >= 0 else above
        new_counts[position[j]] = counts[j]
    return new_parent, new_counts


@kernel
def merged(parent, counts, lower, below, limits):
    """Return the first column of every supernode, and the number of columns.

    The supernode that ends with a column is merged with the one before if that is its
    child, or if both are leaves with the same rows, and the `limits` on explicit zeros
    allow it, see `MERGE`.
    """
    size = parent.size
    first = np.empty(size + 1, dtype=np.int32)
    filled = np.empty(size)  # entries without explicit zeros
    found = 0
    for j in range(size):
        first[found] = j
        filled[found] = counts[j] + 1.0
        found += 1
        while found > 1:
            before = first[found - 1] - 1
            is_child = before < parent[before] <= j
            if not is_child and not are_twins(before, j, parent, lower, below):
                break
            columns = j + 1 - first[found - 2]
            entries = columns * (0.5 * (columns + 1.0) + counts[j])
            k = 0
            while columns > limits[k, 0]:
                k += 1
            true = filled[found - 1] + filled[found - 2]
            if entries - true > limits[k, 1] * entries:
                break
            filled[found - 2] = true
            found -= 1
    first[found] = size
    return first[: found + 1].copy()


@part
def are_twins(i, j, parent, lower, below):
    """Tell whether the columns i and j = i + 1 are leaves with the same rows of L.

    The rows of a leaf, a column without children, are those of the matrix.
    """
    if j != i + 1 or parent[i] == j or (i > 0 and parent[i - 1] == i):
        return False
    shift = lower[j] - lower[i]
    if lower[j + 1] - lower[j] != shift:
        return False
    for t in range(lower[i] + 1, lower[j]):
        if below[t] != below[t + shift]:
            return False
    return True


@kernel
def row_patterns(columns, upper, starts, parent, node, rows):
    """Set the rows of all supernodes: k is in those on the tree paths to k's own.

    The paths start at the supernodes of the entries of A in row k.
    """
    number = parent.size
    end = starts[:number].copy()
    seen = np.full(number, -1, dtype=np.int32)
    for k in range(node.size):
        own = node[k]
        rows[end[own]] = k
        end[own] += 1
        seen[own] = k
        for t in range(columns[k], columns[k + 1]):
            s = node[upper[t]]
            while seen[s] != k:
                seen[s] = k
                rows[end[s]] = k
                end[s] += 1
                s = parent[s]
