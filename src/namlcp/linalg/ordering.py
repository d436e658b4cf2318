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

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.namlcp.linalg.arrays import indices as longs
from cython.cimports.namlcp.linalg.arrays import places
from scipy.sparse import csc_matrix

from namlcp.checks import constant, refuse_size, transposed

MERGE = np.array(((4, 0.5), (16, 0.3), (48, 0.1), (1 << 30, 0.05)))
"""(Columns, fraction): supernodes are merged into one of at most so many columns if at
most that fraction of its entries are explicit zeros."""


class Order(NamedTuple):
    """A fill-reducing order in which every column follows its descendants.

    place has the new position of every row, parent the elimination tree in new
    positions, counts the entries of L below the diagonal, in all `entries`. work: the
    multiplications of a factorisation, about half of them in the updates.
    """

    place: np.ndarray
    parent: np.ndarray
    counts: np.ndarray
    entries: int
    work: float


class Supernodes(NamedTuple):
    """The layout of L; all indices are positions in the order.

    Supernode s has the columns first[s] : first[s + 1], its rows are rows[starts[s] :
    starts[s + 1]], ascending, its own columns first. Its block, row-major, is
    panels[s] : panels[s + 1] of the values, parent[s] the supernode of its first row
    below the block, -1 if there is none.
    Column j of the matrix has the entries data[source[t]] in the rows below[t], for t
    in lower[j] : lower[j + 1], the diagonal included.
    """

    first: np.ndarray
    parent: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    panels: np.ndarray
    lower: np.ndarray
    below: np.ndarray
    source: np.ndarray


def nested_dissection(indptr, indices):
    """Return METIS's `Order` of a matrix; None without pymetis (the extra `large`).

    Separators come last (A. George, SIAM J. Numer. Anal. 10, 1973): for large matrices
    without structure this causes less fill than minimum degree, in ten times the time.
    """
    try:
        import pymetis  # here, because few problems are so large
    except ImportError:
        return None
    size = indptr.size - 1
    upper = csc_matrix((np.ones(indices.size), indices, indptr), shape=(size, size))
    graph = (upper + upper.T).tocsr()
    graph.setdiag(0.0)
    graph.eliminate_zeros()
    adjacency = pymetis.CSRAdjacency(graph.indptr, graph.indices)
    _, place = pymetis.nested_dissection(adjacency)
    return postordered(indptr, indices, np.array(place, dtype=np.int32))


def postordered(indptr, indices, place):
    """Return the postordered equivalent of the order `place`."""
    columns, rows, _ = permuted(indptr, indices, place, True)
    parent, counts = elimination_tree(columns, rows)
    return renumbered(place, parent, counts, np.zeros(place.size, np.uint8))


def renumbered(place, parent, counts, comes_last):
    """Return an order with the columns postordered; comes_last: after its siblings."""
    size: Py_ssize_t = place.size
    position = postorder(parent, comes_last)
    new_place, new_parent, new_counts = np.empty((3, size), np.int32)
    to, old = places(position, size + 1), places(place, size)
    above, count = places(parent, size), places(counts, size)
    placed, rooted = places(new_place, size), places(new_parent, size)
    counted = places(new_counts, size)
    entries: Py_ssize_t = 0
    work: cython.double = 0.0
    for j in range(size):
        placed[j] = to[old[j]]
        rooted[to[j]] = to[above[j]] if above[j] >= 0 else -1
        counted[to[j]] = count[j]
        entries += count[j]
        work += cython.cast(cython.double, count[j]) * count[j]
    return Order(new_place, new_parent, new_counts, entries, work)


def chained(order):
    """Return the order with siblings of the same rows one after another.

    A column is full if its rows are all those of its parent, and the parent. Full
    siblings, as columns under dense rows are, become a chain with what is full below
    each: so they may join one supernode, with explicit zeros.
    """
    place, parent, counts, _, _ = order
    is_full = (parent >= 0) & (counts == counts[parent] + 1)
    number = np.bincount(parent[is_full], minlength=parent.size)  # of full children
    found = (is_full & (number <= 1) & (number[parent] > 1)).nonzero()[0]
    if not found.size:
        return order
    found = found[np.argsort(parent[found], kind="stable")]
    before, after = found[:-1], found[1:]
    same = parent[before] == parent[after]
    alone = (is_full & (number[parent] == 1)).nonzero()[0].astype(np.int32)
    heads = np.arange(parent.size, dtype=np.int32)  # the first of what is full below
    head: cython.int[::1] = heads
    child: cython.int[::1] = alone
    parents: cython.int[::1] = parent
    for t in range(child.shape[0]):
        head[parents[child[t]]] = head[child[t]]
    above, comes_last = parent.copy(), np.zeros(parent.size, np.uint8)
    above[before[same]] = heads[after[same]]
    comes_last[before[same]] = True
    return renumbered(place, above, counts, comes_last)


def permuted(indptr, indices, place, is_strict):
    """Return the permuted upper triangle in CSC, and where its entries come from.

    is_strict: without the diagonal. place[i] is the new place of row i. The entries of
    a column are in their original order.
    """
    n, least = place.shape[0], 1 if is_strict else 0
    starts = np.zeros(n + 1, np.int32)
    start: cython.int[::1] = starts
    for j in range(n):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i <= j - least:
                start[max(place[i], place[j])] += 1
    for k in range(1, n + 1):  # start[k] is the end of column k, then its beginning
        start[k] += start[k - 1]
    rows, sources = np.empty((2, start[n]), np.int32)
    row: cython.int[::1] = rows
    source: cython.int[::1] = sources
    for j in range(n - 1, -1, -1):
        for t in range(indptr[j + 1] - 1, indptr[j] - 1, -1):
            i = indices[t]
            if i <= j - least:
                k = max(place[i], place[j])
                start[k] -= 1
                row[start[k]] = min(place[i], place[j])
                source[start[k]] = t
    return starts, rows, sources


def elimination_tree(indptr, indices):
    """Return each column's parent, -1 at a root, and its entries below the diagonal.

    Each entry (k, i) of L is followed up the tree to a column that row k has seen.
    """
    size = indptr.shape[0] - 1
    parents, counts = constant(size, -1, np.int32), np.zeros(size, np.int32)
    parent: cython.int[::1] = parents
    count: cython.int[::1] = counts
    seen: cython.int[::1] = np.empty(size, np.int32)
    for k in range(size):
        seen[k] = k
        for t in range(indptr[k], indptr[k + 1]):
            i = indices[t]
            while seen[i] != k:
                seen[i] = k
                count[i] += 1
                if parent[i] < 0:
                    parent[i] = k
                i = parent[i]
    return parents, counts


def postorder(parent, comes_last):
    """Return the place of every node, each directly after its descendants.

    Those that come last are after their siblings. The last entry is -1, the parent of
    a root.
    """
    size = parent.shape[0]
    position = constant(size + 1, -1, np.int32)
    place: cython.int[::1] = position
    head: cython.int[::1] = constant(size + 1, -1, np.int32)  # the last list: the roots
    following: cython.int[::1] = np.empty(size, np.int32)
    path: cython.int[::1] = np.empty(size + 1, np.int32)
    for turn in range(2):  # what comes last is put into the lists first
        for j in range(size - 1, -1, -1):
            if comes_last[j] + turn == 1:
                k = parent[j] if parent[j] >= 0 else size
                following[j] = head[k]
                head[k] = j
    path[0] = size
    depth: Py_ssize_t = 0
    done: cython.int = 0
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
    return position


def supernodes(indptr, indices, order):
    """Return the layout of L for a symmetric matrix in this order."""
    size = order.parent.size
    columns, upper, source = permuted(indptr, indices, order.place, False)
    lower, below, source = transposed(columns, upper, source.astype(float), size)
    source = source.astype(np.int32)
    first = merged(order.parent, order.counts, lower, below)
    last = first[1:] - 1
    k = np.diff(first).astype(np.int64)
    f = k + order.counts[last]
    starts = np.concatenate(([0], np.cumsum(f)))
    panels = np.concatenate(([0], np.cumsum(f * k)))
    refuse_size("the factors", int(panels[-1]))
    node = np.repeat(np.arange(k.size, dtype=np.int32), k)
    above = order.parent[last]
    parent = np.where(above < 0, -1, node[above]).astype(np.int32)
    rows, own = np.empty(starts[-1], np.int32), np.arange(size)
    rows[own + np.repeat(starts[:-1] - first[:-1], k)] = own
    ends, seen = (starts[:-1] + k).astype(np.intp), np.empty(size, np.int32)
    append_rows(
        size, places(columns, size + 1), places(upper, upper.size),
        places(parent, k.size), places(node, size), places(seen, size),
        longs(ends, k.size), places(rows, rows.size),
    )  # fmt: skip
    return Supernodes(first, parent, starts, rows, panels, lower, below, source)


def merged(parent, counts, lower, below):
    """Return the first column of every supernode, and the number of columns.

    The supernode that ends with a column is merged with the one before if that is its
    child, or if both are leaves with the same rows, and MERGE allows it. `filled`
    counts entries without explicit zeros.
    """
    limits: cython.double[:, ::1] = MERGE
    size, found = parent.shape[0], cython.cast(Py_ssize_t, 0)
    starts = np.empty(size + 1, np.int32)
    first: cython.int[::1] = starts
    filled: cython.double[::1] = np.empty(size)
    for j in range(size):
        first[found] = j
        filled[found] = counts[j] + 1.0
        found += 1
        while found > 1:
            before = first[found - 1] - 1
            is_child: cython.bint = before < parent[before] <= j
            if not is_child and not are_twins(before, j, parent, lower, below):
                break
            columns = j + 1 - first[found - 2]
            entries = columns * (0.5 * (columns + 1.0) + counts[j])
            k: Py_ssize_t = 0
            while columns > limits[k, 0]:
                k += 1
            true = filled[found - 1] + filled[found - 2]
            if entries - true > limits[k, 1] * entries:
                break
            filled[found - 2] = true
            found -= 1
    first[found] = size
    return starts[: found + 1].copy()


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


def append_rows(n, indptr, indices, parent, node, seen, end, rows):
    """Append to the rows of each supernode s, from end[s] on, those below it.

    Row k is below the supernodes on the tree paths from those of its entries, which are
    column k of the upper triangle, to its own. `seen` is work space.
    """
    for k in range(n):
        seen[k] = -1
    for k in range(n):
        seen[node[k]] = k
        for t in range(indptr[k], indptr[k + 1]):
            s = node[indices[t]]
            while seen[s] != k:
                seen[s] = k
                rows[end[s]] = k
                end[s] += 1
                s = parent[s]
