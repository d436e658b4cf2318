"""Symbolic analysis for a sparse factorisation: order, elimination tree, supernodes.

Of a symmetric matrix, in CSC, only the upper triangle is read. The parent of a column
of L in the elimination tree is the row of its first entry below the diagonal; below
that row, the pattern of a column is a subset of its parent's. Columns of L with nearly
the same pattern form a *supernode*, a dense block for BLAS. Tree and counts: J. Liu,
SIAM J. Matrix Anal. Appl. 11 (1990) 134-172; supernodes are relaxed as in CHOLMOD
(Chen, Davis, Hager, Rajamanickam, ACM Trans. Math. Softw. 35, 2008).

Minimum degree, after P. Amestoy, T. Davis and I. Duff, SIAM J. Matrix Anal. Appl. 17
(1996) 886-905: an eliminated variable, now an *element*, stands for the clique of its
neighbours. Degrees are bounded from above by sums over elements. Variables with the
same neighbours become one *supervariable*, whose degree leaves itself out. An element
whose variables all belong to the new one is dropped (aggressive absorption).

Rows beside many others, *hubs*, would be looked at whenever one of those is eliminated.
They are ordered last. Fill then is nearly that of an order of all rows, if a variable
counts the hubs beside it when the least degree is sought.
"""

from typing import NamedTuple

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import sqrt
from cython.cimports.libc.stdlib import free, malloc, realloc
from scipy.sparse import csc_matrix, triu

from namlcp.arrays import refuse_size, transposed
from namlcp.limits import NEVER, OutOfTime

# Neighbours of a hub at least, relative to the square root of the order, and to the
# mean over all rows.
ABOVE_ROOT, ABOVE_MEAN = 2.0, 6.0
# Operations for each neighbour of a pivot, about.
OPERATIONS = 100.0
MERGE = np.array(((4, 0.5), (16, 0.3), (48, 0.1), (1 << 30, 0.05)))
"""(Columns, fraction): supernodes are merged into one of at most so many columns if at
most that fraction of its entries are explicit zeros."""


class Order(NamedTuple):
    """A fill-reducing order in which every column follows its descendants.

    place: the new position of every row; parent: the elimination tree, in new
    positions; counts: the entries of L below the diagonal, in all `entries`; work: the
    multiplications of a factorisation.
    """

    place: np.ndarray
    parent: np.ndarray
    counts: np.ndarray
    entries: int
    work: float


class Supernodes(NamedTuple):
    """The layout of L; all indices are positions in the order.

    Supernode s has the columns first[s] : first[s + 1], its rows are rows[starts[s] :
    starts[s + 1]], ascending, its own columns first. Its block, column-major, is
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


def minimum_degree(indptr, indices, deadline=NEVER):
    """Return an `Order` of a symmetric matrix; OutOfTime if the deadline is reached."""
    size: Py_ssize_t = indptr.size - 1
    place = new_places(size)
    columns, rows = places(indptr, size + 1), places(indices, indices.size)
    to, watch = places(place, size), Watched()
    watch.until = deadline.at
    with cython.nogil:
        is_done = order_by_degree(columns, rows, size, to, watch)
    raise_kept(watch)
    if watch.over:
        raise OutOfTime
    if not is_done:
        raise MemoryError("no memory for an elimination order")
    return postordered(indptr, indices, place)


def order_by_degree(indptr, indices, size, place, watch):
    """Set all places; False without memory, or if the watch, unless None, says so."""
    quotient: Quotient
    g = cython.address(quotient)
    longs = cython.cast(cython.p_Py_ssize_t, malloc((3 * 8 + 10 * 4) * (size + 1)))
    if longs == cython.NULL:
        return False
    ints = cython.cast(cython.p_int, longs + 3 * size)
    g.size, g.place = size, place
    g.start, g.mark, g.degree = longs, longs + size, longs + 2 * size
    g.length, g.elements, g.weight = ints, ints + size, ints + 2 * size
    g.following, g.last, g.hubs = ints + 3 * size, ints + 4 * size, ints + 5 * size
    g.head, g.after = ints + 6 * size, ints + 7 * size
    g.before, g.bucket = ints + 8 * size, ints + 9 * size
    left = write_graph(g, indptr, indices)
    is_done: cython.bint = left >= 0 and eliminate_all(g, left, watch)
    free(g.adjacent)
    free(longs)
    return is_done


def write_graph(g, indptr, indices):
    """Set the graph without hubs; return its variables, -1 without memory."""
    start, length, degree, place = g.start, g.length, g.degree, g.place
    for i in range(g.size):
        degree[i] = 0
    total: Py_ssize_t = 0
    for j in range(g.size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i < j:
                degree[i] += 1
                degree[j] += 1
                total += 2
    least = max(ABOVE_ROOT * sqrt(g.size), ABOVE_MEAN * total / max(g.size, 1))
    variables: Py_ssize_t = 0
    g.end = 0
    for i in range(g.size):
        start[i] = g.end
        length[i] = 0
        g.elements[i] = 0
        g.weight[i] = 1
        g.mark[i] = 1
        g.head[i] = NONE
        g.bucket[i] = NONE
        g.following[i] = NONE
        g.last[i] = i
        place[i] = HUB
        if degree[i] <= least:
            place[i] = VARIABLE
            variables += 1
            g.end += degree[i]  # and hubs, which leave gaps
    g.room = 2 * g.end + variables
    g.adjacent = cython.cast(cython.p_int, malloc(4 * (g.room + 1)))
    adjacent = g.adjacent
    if adjacent == cython.NULL:
        return -1
    for j in range(g.size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i < j and place[i] == VARIABLE and place[j] == VARIABLE:
                adjacent[start[i] + length[i]] = j
                length[i] += 1
                adjacent[start[j] + length[j]] = i
                length[j] += 1
    for i in range(g.size):
        g.hubs[i] = degree[i] - length[i]
        degree[i] = length[i]
        if place[i] == VARIABLE:
            insert(g, i, listed_degree(g, i))
    return variables


def eliminate_all(g, left, watch):
    """Set all places, those of hubs last; False without memory or time."""
    done: cython.int = 0
    least: Py_ssize_t = 0  # no list of a smaller degree has members
    widest: Py_ssize_t = 0
    i: Py_ssize_t
    g.tag = 2  # marks are below it, see `update`
    while left > 0:
        while g.head[least] < 0:
            least += 1
        pivot: Py_ssize_t = g.head[least]
        remove(g, pivot, least)
        if not reserve(g, pivot):
            return False
        begin = g.end
        form_element(g, pivot)
        if watch is not None and is_over(watch, OPERATIONS * (g.end + 1 - begin)):
            return False
        widest = max(widest, g.degree[pivot])
        update(g, pivot)
        g.tag += widest + 1
        merge_alike(g, begin)
        left += g.weight[pivot]
        least = min(least, link_all(g, pivot, left))
        i = pivot
        while i >= 0:
            g.place[i] = done
            done += 1
            i = g.following[i]
    for i in range(g.size):
        if g.place[i] == HUB:
            g.place[i] = done
            done += 1
    return True


def listed_degree(g, i):
    return min(g.degree[i] + g.hubs[i], g.size - 1)


def insert(g, i, d):
    first = g.head[d]
    g.before[i] = NONE
    g.after[i] = first
    if first >= 0:
        g.before[first] = i
    g.head[d] = i


def remove(g, i, d):
    before, after = g.before[i], g.after[i]
    if before >= 0:
        g.after[before] = after
    else:
        g.head[d] = after
    if after >= 0:
        g.before[after] = before


def reserve(g, pivot):
    begin = g.start[pivot]
    most: Py_ssize_t = g.length[pivot]
    for p in range(begin, begin + g.elements[pivot]):
        most += g.length[g.adjacent[p]]
    if g.end + most > g.room:
        g.room = 2 * g.room + most
        larger = realloc(g.adjacent, 4 * g.room)
        if larger == cython.NULL:
            return False
        g.adjacent = cython.cast(cython.p_int, larger)
    return True


def form_element(g, pivot):
    """Append to `adjacent` all variables beside the pivot, with weights negated.

    start[pivot] and degree[pivot] become those of the element.
    """
    start, length, weight = g.start, g.length, g.weight
    adjacent, end = g.adjacent, g.end
    weight[pivot] = -weight[pivot]
    begin = start[pivot]
    number = g.elements[pivot]
    start[pivot] = end
    rows: Py_ssize_t = 0
    for q in range(begin, begin + number + 1):
        if q < begin + number:
            e = adjacent[q]
            g.mark[e] = 0
            first, last = start[e], start[e] + length[e]
        else:
            first, last = q, begin + length[pivot]
        for p in range(first, last):
            i = adjacent[p]
            if weight[i] > 0:
                remove(g, i, listed_degree(g, i))
                rows += weight[i]
                weight[i] = -weight[i]
                adjacent[end] = i
                end += 1
    g.degree[pivot] = rows
    g.end = end


def update(g, pivot):
    """Put the new element into the lists of its variables; bound their degrees.

    First, mark[e] - tag becomes the number of rows of an element e that do not belong
    to the new one, for all e beside it. A variable that has no other neighbours than
    the new element's is eliminated together with the pivot.
    """
    start, length, elements = g.start, g.length, g.elements
    weight, mark, degree = g.weight, g.mark, g.degree
    adjacent, tag = g.adjacent, g.tag
    begin, end = start[pivot], g.end
    for p in range(begin, end):
        i = adjacent[p]
        for q in range(start[i], start[i] + elements[i]):
            e = adjacent[q]
            if mark[e] >= tag:
                mark[e] += weight[i]
            elif mark[e] != 0:
                mark[e] = tag + degree[e] + weight[i]
    for p in range(begin, end):
        i = adjacent[p]
        first = start[i]
        to = first
        key: Py_ssize_t = 0
        rows: Py_ssize_t = 0
        for q in range(first, first + elements[i]):
            e = adjacent[q]
            if mark[e] > tag:
                rows += mark[e] - tag
                adjacent[to] = e
                to += 1
                key += e
            else:
                mark[e] = 0
        middle = to
        for q in range(first + elements[i], first + length[i]):
            j = adjacent[q]
            if weight[j] > 0:
                rows += weight[j]
                adjacent[to] = j
                to += 1
                key += j
        if to == first:
            weight[pivot] += weight[i]
            degree[pivot] += weight[i]
            weight[i] = 0
            append(g, i, pivot)
            continue
        # There is room for the pivot: it, or an element of its own, has left.
        adjacent[to] = adjacent[middle]
        adjacent[middle] = adjacent[first]
        adjacent[first] = pivot
        elements[i] = middle - first + 1
        length[i] = to - first + 1
        degree[i] = min(degree[i], rows)
        key %= g.size
        g.before[i] = key
        g.after[i] = g.bucket[key]
        g.bucket[key] = i


def append(g, j, i):
    g.following[g.last[i]] = j
    g.last[i] = g.last[j]


def merge_alike(g, begin):
    """Merge variables of the new element, of one key, that have the same neighbours."""
    start, length, after = g.start, g.length, g.after
    mark, adjacent, tag = g.mark, g.adjacent, g.tag
    for p in range(begin, g.end):
        if g.weight[adjacent[p]] == 0:
            continue
        key = g.before[adjacent[p]]
        i = g.bucket[key]
        g.bucket[key] = NONE
        while i >= 0 and after[i] >= 0:
            # the first neighbour of all is the new element
            for q in range(start[i] + 1, start[i] + length[i]):
                mark[adjacent[q]] = tag
            previous = i
            j = after[i]
            while j >= 0:
                alike: cython.bint = length[j] == length[i]
                alike = alike and g.elements[j] == g.elements[i]
                q = start[j] + 1
                while alike and q < start[j] + length[j]:
                    alike = mark[adjacent[q]] == tag
                    q += 1
                if alike:
                    g.weight[i] += g.weight[j]
                    g.weight[j] = 0
                    g.hubs[i] = max(g.hubs[i], g.hubs[j])
                    append(g, j, i)
                    after[previous] = after[j]
                else:
                    previous = j
                j = after[j]
            tag += 1
            i = after[i]
    g.tag = tag


def link_all(g, pivot, left):
    """Return the variables of the new element to the lists; the least degree."""
    weight, degree, adjacent = g.weight, g.degree, g.adjacent
    begin = g.start[pivot]
    lowest = g.size
    to = begin
    for p in range(begin, g.end):
        i = adjacent[p]
        if weight[i] == 0:
            continue
        weight[i] = -weight[i]
        rows = degree[i] + degree[pivot] - weight[i]
        degree[i] = min(rows, left - weight[i])
        d = listed_degree(g, i)
        insert(g, i, d)
        lowest = min(lowest, d)
        adjacent[to] = i
        to += 1
    weight[pivot] = -weight[pivot]
    g.elements[pivot] = 0
    g.length[pivot] = to - begin
    g.end = to
    return lowest


def nested_dissection(indptr, indices):
    """Return METIS's `Order` of a matrix; None without pymetis (the extra `large`).

    For large matrices without structure this causes less fill than minimum degree, in
    ten times the time (A. George, SIAM J. Numer. Anal. 10, 1973).
    """
    try:
        import pymetis  # here, because few problems are so large
    except ImportError:
        return None
    size = indptr.size - 1
    upper = csc_matrix((np.ones(indices.size), indices, indptr), shape=(size, size))
    upper = triu(upper, 1)
    graph = (upper + upper.T).tocsr()
    adjacency = pymetis.CSRAdjacency(graph.indptr, graph.indices)
    _, place = pymetis.nested_dissection(adjacency)
    return postordered(indptr, indices, np.array(place, dtype=np.int32))


def postordered(indptr, indices, place):
    """Return an order with the columns postordered."""
    columns, rows, _ = permuted(indptr, indices, place, True)
    parent, counts = elimination_tree(columns, rows)
    size: Py_ssize_t = place.size
    found, room = [new_places(size) for _ in range(3)], new_places(4 * size + 2)
    new, to = places(found[0], size), places(room, 4 * size + 2)
    new_parent, new_count = places(found[1], size), places(found[2], size)
    old, above, below = places(place, size), places(parent, size), places(counts, size)
    postorder(size, above, to, to + size)
    entries: Py_ssize_t = 0
    work: cython.double = 0.0
    for j in range(size):
        k = to[j]
        new[j] = to[old[j]]
        new_parent[k] = to[above[j]] if above[j] >= 0 else -1
        new_count[k] = below[j]
        entries += below[j]
        work += cython.cast(cython.double, below[j]) * below[j]
    return Order(*found, entries, work)


def permuted(indptr, indices, place, is_strict):
    """Return the permuted upper triangle in CSC, and where its entries come from.

    is_strict: without the diagonal. place[i] is the new place of row i. The entries of
    a column are in their original order.
    """
    n: Py_ssize_t = place.size
    least = 1 if is_strict else 0
    starts = same_places(n + 1, 0)
    begin, other = places(indptr, n + 1), places(indices, indices.size)
    start, new = places(starts, n + 1), places(place, n)
    for j in range(n):
        for t in range(begin[j], begin[j + 1]):
            i = other[t]
            if i <= j - least:
                start[max(new[i], new[j])] += 1
    for k in range(n):  # start[k] is the end of column k, then its beginning
        start[k + 1] += start[k]
    count = start[n]
    rows, sources = new_places(count), new_places(count)
    row, source = places(rows, count), places(sources, count)
    for j in range(n - 1, -1, -1):
        for t in range(begin[j + 1] - 1, begin[j] - 1, -1):
            i = other[t]
            if i <= j - least:
                k = max(new[i], new[j])
                start[k] -= 1
                row[start[k]] = min(new[i], new[j])
                source[start[k]] = t
    return starts, rows, sources


def elimination_tree(indptr, indices):
    """Return each column's parent, -1 at a root, and its entries below the diagonal.

    Each entry (k, i) of L is followed up the tree to a column that row k has seen.
    """
    size: Py_ssize_t = indptr.size - 1
    parents, counts = same_places(size, -1), same_places(size, 0)
    room = new_places(size)
    parent, count = places(parents, size), places(counts, size)
    seen = places(room, size)
    begin, rows = places(indptr, size + 1), places(indices, indices.size)
    for k in range(size):
        seen[k] = k
        for t in range(begin[k], begin[k + 1]):
            i = rows[t]
            while seen[i] != k:
                seen[i] = k
                count[i] += 1
                if parent[i] < 0:
                    parent[i] = k
                i = parent[i]
    return parents, counts


def postorder(size, parent, place, room):
    """Set the place of every node, each directly after its descendants.

    room: for 3 size + 2 numbers.
    """
    head, following, path = room, room + size + 1, room + 2 * size + 1
    for k in range(size + 1):
        head[k] = -1  # the last list: the roots
    for j in range(size - 1, -1, -1):
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
