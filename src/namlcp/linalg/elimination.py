"""The pattern of L for a sparse symmetric matrix: tree, counts, order, supernodes.

See `ordering`. The matrix is in CSC, and only its upper triangle is read.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.namlcp.linalg.arrays import indices as longs
from cython.cimports.namlcp.linalg.arrays import numbers, places


def permuted(indptr, indices, place, size: Py_ssize_t, is_strict: cython.bint):
    """Return the permuted upper triangle in CSC, and where its entries come from.

    is_strict: without the diagonal. place[i] is the new place of row i, of `size`
    places, or -1. The entries of a column are in their original order.
    """
    n: Py_ssize_t = place.size
    least = STRICT if is_strict else WHOLE
    columns = np.zeros(size + 1, np.int32)
    starts, entries = places(indptr, n + 1), places(indices, indices.size)
    to, ends = places(place, n), places(columns, size + 1)
    count_entries(starts, entries, to, n, least, ends, size)
    rows, source = np.empty((2, columns[size]), np.int32)
    permute(
        starts, entries, to, n, least, ends, places(rows, ends[size]),
        places(source, ends[size]),
    )  # fmt: skip
    return columns, rows, source


def count_entries(indptr, indices, place, n, least, columns, size):
    """Set columns[k], 0 before, to the end of column k of the permuted triangle."""
    for j in range(n):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i <= j - least and place[i] >= 0 and place[j] >= 0:
                columns[max(place[i], place[j])] += 1
    for k in range(1, size + 1):
        columns[k] += columns[k - 1]


def permute(indptr, indices, place, n, least, columns, rows, source):
    """Fill the columns from their ends on; columns[k] becomes the first entry."""
    for j in range(n - 1, -1, -1):
        for t in range(indptr[j + 1] - 1, indptr[j] - 1, -1):
            i = indices[t]
            if i <= j - least and place[i] >= 0 and place[j] >= 0:
                k = max(place[i], place[j])
                columns[k] -= 1
                rows[columns[k]] = min(place[i], place[j])
                source[columns[k]] = t


def elimination_tree(columns, rows):
    """Return each column's parent, -1 at a root, and its entries below the diagonal."""
    size: Py_ssize_t = columns.size - 1
    parent, count, seen = np.empty((3, size), np.int32)
    set_tree(
        places(columns, size + 1), places(rows, rows.size), size,
        places(parent, size), places(count, size), places(seen, size),
    )  # fmt: skip
    return parent, count


def set_tree(columns, rows, size, parent, count, seen):
    """Follow each entry (k, i) of L up the tree to a column that row k has seen."""
    for k in range(size):
        parent[k] = -1
        count[k] = 0
        seen[k] = k
        for t in range(columns[k], columns[k + 1]):
            i = rows[t]
            while seen[i] != k:
                seen[i] = k
                count[i] += 1
                if parent[i] < 0:
                    parent[i] = k
                i = parent[i]


def postordered_tree(indptr, indices, place):
    """Return the parents and the counts of an `Order`; `place` becomes its place."""
    size: Py_ssize_t = np.count_nonzero(place >= 0)
    columns, rows, _ = permuted(indptr, indices, place, size, True)
    parent, counts = elimination_tree(columns, rows)
    position = np.empty(size + 1, np.int32)
    head, following, path = np.empty((3, size + 1), np.int32)
    set_postorder(
        places(parent, size), size, places(position, size + 1), places(head, size + 1),
        places(following, size + 1), places(path, size + 1),
    )  # fmt: skip
    place[place >= 0] = position[place[place >= 0]]
    position[size] = -1  # the parent of a root is -1, the last position
    new_parent, new_counts = np.empty((2, size), np.int32)
    new_parent[position[:size]] = position[parent]
    new_counts[position[:size]] = counts
    return new_parent, new_counts


def set_postorder(parent, size, place, head, following, path):
    """Set the place of every node so that each directly follows its descendants."""
    for k in range(size + 1):  # the last list: the roots
        head[k] = -1
    for j in range(size - 1, -1, -1):
        k = parent[j] if parent[j] >= 0 else size
        following[j] = head[k]
        head[k] = j
    path[0] = size
    depth: Py_ssize_t = 0
    done: Py_ssize_t = 0
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


def merged(parent, counts, lower, below, limits):
    """Return the first column of every supernode, and the number of columns.

    limits: pairs (columns, fraction of explicit zeros), see `ordering.MERGE`.
    """
    size: Py_ssize_t = parent.size
    first, filled = np.empty(size + 1, np.int32), np.empty(size)
    found = merge(
        places(parent, size), places(counts, size), places(lower, size + 1),
        places(below, below.size), size, numbers(limits, limits.size),
        places(first, size + 1), numbers(filled, size),
    )  # fmt: skip
    return first[: found + 1].copy()


def merge(parent, counts, lower, below, size, limits, first, filled):
    """Set the first columns; `filled` counts entries without explicit zeros.

    The supernode that ends with a column is merged with the one before if that is its
    child, or if both are leaves with the same rows, and the limits allow it.
    """
    found: Py_ssize_t = 0
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
            while columns > limits[2 * k]:
                k += 1
            true = filled[found - 1] + filled[found - 2]
            if entries - true > limits[2 * k + 1] * entries:
                break
            filled[found - 2] = true
            found -= 1
    first[found] = size
    return found


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


def row_patterns(columns, upper, starts, parent, node, rows):
    """Set the rows of all supernodes: k is in those on the tree paths to k's own.

    The paths start at the supernodes of the entries of A in row k.
    """
    size: Py_ssize_t = node.size
    count: Py_ssize_t = parent.size
    end, seen = starts[:count].astype(np.intp), np.full(count, -1, np.int32)
    set_row_patterns(
        places(columns, size + 1), places(upper, upper.size), places(parent, count),
        places(node, size), size, longs(end, count), places(seen, count),
        places(rows, rows.size),
    )  # fmt: skip


def set_row_patterns(columns, upper, parent, node, size, end, seen, rows):
    """Append each row to its supernodes; end[s] is where the rows of s end so far."""
    for k in range(size):
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
