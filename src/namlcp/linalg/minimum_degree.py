"""Approximate minimum degree: a fill-reducing order of a sparse symmetric matrix.

Eliminating a variable joins all its neighbours. The graph is kept as a quotient graph:
an eliminated variable, now an *element*, stands for the clique of its neighbours, and
a variable beside several elements is beside all their variables. Degrees are bounded
from above by sums over elements. Variables with the same neighbours become one
*supervariable*, whose degree leaves itself out. After P. Amestoy, T. Davis and I. Duff,
SIAM J. Matrix Anal. Appl. 17 (1996) 886-905, with their aggressive absorption: an
element whose variables all belong to the new one is dropped.

Rows beside many others, hubs, would be looked at whenever one of those is eliminated.
They are ordered last. Fill then is nearly that of an order of all rows, if a variable
counts the hubs beside it when the least degree is sought.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import sqrt
from cython.cimports.libc.stdlib import free, malloc, realloc
from cython.cimports.namlcp.limits import Watched, is_over, raise_kept
from cython.cimports.namlcp.linalg.arrays import places

from namlcp.limits import NEVER, OutOfTime
from namlcp.linalg.ordering import postordered

# Neighbours of a hub at least, relative to the square root of the order, and to the
# mean over all rows.
ABOVE_ROOT, ABOVE_MEAN = 2.0, 6.0
# Operations for each neighbour of a pivot, about.
OPERATIONS = 100.0


def minimum_degree(indptr, indices, deadline=NEVER):
    """Return an `Order` of a symmetric matrix; OutOfTime if the deadline is reached.

    The matrix is in CSC, its entries below the diagonal are not read.
    """
    size: Py_ssize_t = indptr.size - 1
    kind, place = np.empty((2, size), np.int32)
    # Sums of SciPy's matrices have indices of 64 bits.
    indptr = np.ascontiguousarray(indptr, np.int32)
    indices = np.ascontiguousarray(indices, np.int32)
    columns, rows = places(indptr, size + 1), places(indices, indices.size)
    kinds, to = places(kind, size), places(place, size)
    watch = Watched()
    watch.until = deadline.at
    with cython.nogil:
        is_done = order_by_degree(columns, rows, size, kinds, to, watch)
    raise_kept(watch)
    if watch.over:
        raise OutOfTime
    if not is_done:
        raise MemoryError("no memory for an elimination order")
    return postordered(indptr, indices, place)


def order_by_degree(indptr, indices, size, kind, place, watch):
    """Set the places of all rows; `kind` is work space.

    False where there is not enough memory, or the watch, if not None, says to stop.
    """
    quotient: Quotient
    g = cython.address(quotient)
    longs = cython.cast(cython.p_Py_ssize_t, malloc(3 * 8 * (size + 1)))
    shorts = cython.cast(cython.p_int, malloc(10 * 4 * (size + 1)))
    is_done: cython.bint = longs != cython.NULL and shorts != cython.NULL
    g.adjacent, g.size, g.kind, g.place, g.done = cython.NULL, size, kind, place, 0
    if is_done:
        g.start, g.mark, g.degree = longs, longs + size, longs + 2 * size
        g.length, g.elements = shorts, shorts + size
        g.weight, g.following = shorts + 2 * size, shorts + 3 * size
        g.last, g.hubs = shorts + 4 * size, shorts + 5 * size
        g.head, g.after = shorts + 6 * size, shorts + 7 * size
        g.before, g.bucket = shorts + 8 * size, shorts + 9 * size
        mark_hubs(g, indptr, indices)
        is_done = eliminate_all(g, indptr, indices, watch)
        for i in range(size):
            if kind[i] == BESIDE:
                place[i] = g.done
                g.done += 1
    free(g.adjacent)
    free(longs)
    free(shorts)
    return is_done


def mark_hubs(g, indptr, indices):
    """Set the kinds, and `degree` to the number of all neighbours."""
    kind, degree = g.kind, g.degree
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
    for i in range(g.size):
        kind[i] = BESIDE if degree[i] > least else VARIABLE


def eliminate_all(g, indptr, indices, watch):
    """Set the places of the variables, from 0 on; False if that does not succeed."""
    left = write_graph(g, indptr, indices)
    if left < 0:
        return False
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
            g.place[i] = g.done
            g.done += 1
            i = g.following[i]
    return True


def write_graph(g, indptr, indices):
    """Set the graph of the variables; return their number, -1 without memory."""
    start, length, kind = g.start, g.length, g.kind
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
        if kind[i] == VARIABLE:
            variables += 1
            g.end += g.degree[i]  # and hubs, which leave gaps
    g.room = 2 * g.end + variables
    g.adjacent = cython.cast(cython.p_int, malloc(4 * (g.room + 1)))
    adjacent = g.adjacent
    if adjacent == cython.NULL:
        return -1
    for j in range(g.size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i < j and kind[i] == VARIABLE and kind[j] == VARIABLE:
                adjacent[start[i] + length[i]] = j
                length[i] += 1
                adjacent[start[j] + length[j]] = i
                length[j] += 1
    for i in range(g.size):
        g.hubs[i] = g.degree[i] - length[i]
        g.degree[i] = length[i]
        if kind[i] == VARIABLE:
            insert(g, i, listed_degree(g, i))
    return variables


def listed_degree(g, i):
    """Return the number of the list for variable i: rows and hubs beside it."""
    return min(g.degree[i] + g.hubs[i], g.size - 1)


def insert(g, i, d):
    """Make i the first of the list of degree d."""
    first = g.head[d]
    g.before[i] = NONE
    g.after[i] = first
    if first >= 0:
        g.before[first] = i
    g.head[d] = i


def remove(g, i, d):
    """Take i out of the list of degree d."""
    before, after = g.before[i], g.after[i]
    if before >= 0:
        g.after[before] = after
    else:
        g.head[d] = after
    if after >= 0:
        g.before[after] = before


def reserve(g, pivot):
    """Make room in `adjacent` for the element of the pivot; False if there is none."""
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
    """Append to `adjacent` all variables beside the pivot.

    Their weights become negative, they leave their lists, and the elements beside the
    pivot are absorbed. start[pivot] and degree[pivot] become those of the element.
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
    """Append the rows that j stands for to those of i."""
    g.following[g.last[i]] = j
    g.last[i] = g.last[j]


def merge_alike(g, begin):
    """Merge variables of the new element that have the same neighbours.

    Only those with the same key are compared. All marks are below `tag`.
    """
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
    """Return the variables of the new element to the lists; the least degree.

    `left` rows are not eliminated yet. `adjacent` then ends with supervariables.
    """
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
