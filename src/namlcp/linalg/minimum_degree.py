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

All indices are made int64 where they are read, so that a part is compiled once.
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.compiled import ints_at, kernel, longs_at, part
from namlcp.linalg.ordering import Order, count_inside, postordered

ABOVE_ROOT = 2.0
"""Neighbours of a hub at least, relative to the square root of the order. Below an
order of 2000 ten times the root would save 1.6 % of the work of a factorisation, and
cost a fifth more time to order."""

ABOVE_MEAN = 4.0
"""Neighbours of a hub at least, relative to the mean over all rows."""

NONE = -1
"""No row, or no list."""

OUTSIDE, VARIABLE, BESIDE = 0, 1, 2
"""Kinds of a row: not to be ordered, ordered by its degree, a hub."""


class Quotient(NamedTuple):
    """The quotient graph; a node is a variable or, once eliminated, an element.

    All fields but `size`, the number of rows, are pointers to an entry for each row.
    The neighbours of node i are adjacent[p] for p in start[i] : start[i] + length[i];
    of a variable, the first elements[i] of them are elements, of an element all are
    variables. weight[i] tells how many rows a supervariable stands for, 0 if it is part
    of another; it is negative while i belongs to the element being formed. degree[i]
    bounds the rows beside i. The rows that i stands for are i, following[i],
    following[following[i]], ..., last[i]. hubs[i] counts the hubs beside i. mark[e] is
    0 for an element that has been absorbed.

    Variables of equal listed degree d, see `listed_degree`, form a list: head[d],
    after[head[d]], ...; `before` links back. While an element is formed, its variables
    are in no such list: they are in lists of equal keys, from bucket[key] on, and
    before[i] is the key of i.
    """

    size: int
    start: Any
    mark: Any
    length: Any
    elements: Any
    weight: Any
    degree: Any
    following: Any
    last: Any
    hubs: Any
    head: Any
    after: Any
    before: Any
    bucket: Any


def minimum_degree(
    indptr: np.ndarray, indices: np.ndarray, member: np.ndarray | None = None
) -> Order:
    """Order the rows in `member` of a symmetric matrix, or all of them.

    The matrix is in CSC, its entries below the diagonal are not read.
    """
    size = indptr.size - 1
    kind = np.full(size, VARIABLE, dtype=np.int32)
    if member is not None:
        kind[~member] = OUTSIDE
    place = np.empty(size, dtype=np.int32)
    long, short = np.empty((4, size), np.int64), np.empty((12, size), np.int32)
    # Sums of SciPy's matrices have indices of 64 bits; the kernel reads addresses.
    indptr, indices = (np.ascontiguousarray(v, np.int32) for v in (indptr, indices))
    order_by_degree(indptr, indices, kind, place, long, short)
    return postordered(indptr, indices, place)


@kernel
def order_by_degree(indptr, indices, kind, place, long, short):
    """Set place[i] for all rows i of the kind VARIABLE, -1 for the others.

    kind (n,), long (4, n) and short (12, n) are overwritten.
    """
    size = place.size
    starts = ints_at(indptr.ctypes.data, size + 1)
    rows = ints_at(indices.ctypes.data, indices.size)
    kinds, places = ints_at(kind.ctypes.data, size), ints_at(place.ctypes.data, size)
    first, width = long.ctypes.data, 8 * size
    degree, inside = longs_at(first, size), longs_at(first + width, size)
    start = longs_at(first + 2 * width, size)
    mark = longs_at(first + 3 * width, size)
    first, width = short.ctypes.data, 4 * size
    graph = Quotient(
        size, start, mark,
        ints_at(first, size), ints_at(first + width, size),
        ints_at(first + 2 * width, size), ints_at(first + 3 * width, size),
        ints_at(first + 4 * width, size), ints_at(first + 5 * width, size),
        ints_at(first + 6 * width, size), ints_at(first + 7 * width, size),
        ints_at(first + 8 * width, size), ints_at(first + 9 * width, size),
        ints_at(first + 10 * width, size),
    )  # fmt: skip
    large = ints_at(first + 11 * width, size)
    for i in range(size):
        places[i] = -1
    mark_hubs(starts, rows, kinds, size, degree, inside, large)
    done = eliminate_all(starts, rows, kinds, graph, places)
    # The lists are empty now, and serve to sort the hubs by their degrees.
    for i in range(size):
        if kinds[i] == BESIDE:
            d = min(degree[i], size - 1)
            relink(i, d, NONE, graph.head, graph.after, graph.before)
    for d in range(size):
        i = graph.head[d]
        while i >= 0:
            places[i] = done
            done += 1
            i = graph.after[i]


@part
def relink(v, degree, old, head, after, before):
    """Move v from the list of degree `old` to that of `degree`; < 0 means no list."""
    if old >= 0:
        if before[v] >= 0:
            after[before[v]] = after[v]
        else:
            head[old] = after[v]
        if after[v] >= 0:
            before[after[v]] = before[v]
    if degree >= 0:
        before[v] = -1
        after[v] = head[degree]
        if head[degree] >= 0:
            before[head[degree]] = v
        head[degree] = v


@part
def mark_hubs(indptr, indices, kind, size, degree, inside, large):
    """Set the kind of hubs: of rows beside many others, and many that are no such rows.

    Sets `degree` to the degrees of the rows that are variables; `inside` and `large`
    are overwritten. A dense block is not made of hubs: its rows soon become one
    supervariable.
    """
    count_inside(indptr, indices, kind, size, degree)
    number = total = highest = 0
    for i in range(size):
        number += kind[i]
        total += degree[i]
        if degree[i] > highest:
            highest = degree[i]
    least = ABOVE_ROOT * np.sqrt(number)
    if number > 0:
        least = max(least, ABOVE_MEAN * total / number)
    if highest <= least:
        return
    for i in range(size):
        large[i] = degree[i] > least
    count_inside(indptr, indices, large, size, inside)
    for i in range(size):
        if degree[i] - inside[i] > least:
            kind[i] = BESIDE


@part
def eliminate_all(indptr, indices, kind, graph, place):
    """Set the places of the variables, from 0 on; return how many there are."""
    weight, degree = graph.weight, graph.degree
    entries, left = count_neighbours(indptr, indices, kind, graph)
    memory = np.empty(2 * entries + left, dtype=np.int32)  # read until the loop ends
    adjacent = ints_at(memory.ctypes.data, memory.size)
    write_neighbours(indptr, indices, kind, graph, adjacent)
    end = entries
    done = 0
    least = 0  # no list of a smaller degree has members
    tag = 2  # marks are below it, see `update`
    widest = 0
    while left > 0:
        while graph.head[least] < 0:
            least += 1
        pivot = np.int64(graph.head[least])
        relink(pivot, NONE, least, graph.head, graph.after, graph.before)
        begin = end
        most = bound(pivot, graph, adjacent)
        if begin + most > memory.size:
            larger = np.empty(2 * memory.size + most, dtype=np.int32)
            for p in range(begin):
                larger[p] = memory[p]
            memory = larger
            adjacent = ints_at(memory.ctypes.data, memory.size)
        end = form_element(pivot, graph, adjacent, begin)
        if degree[pivot] > widest:
            widest = np.int64(degree[pivot])
        update(pivot, graph, adjacent, end, tag)
        tag = merge_alike(begin, end, graph, adjacent, tag + widest + 1)
        left += weight[pivot]
        end, lowest = link_all(pivot, graph, adjacent, end, left)
        least = min(least, lowest)
        i = pivot
        while i >= 0:
            place[i] = done
            done += 1
            i = graph.following[i]
    return done


@part
def count_neighbours(indptr, indices, kind, graph):
    """Set the graph but for its entries; return the numbers of entries and variables.

    No length is set: that of every list is 0.
    """
    size = graph.size
    variables = 0
    for i in range(size):
        graph.degree[i] = 0
        graph.hubs[i] = 0
        graph.length[i] = 0
        graph.elements[i] = 0
        graph.weight[i] = 1
        graph.mark[i] = 1
        graph.head[i] = NONE
        graph.bucket[i] = NONE
        graph.following[i] = NONE
        graph.last[i] = i
        variables += kind[i] == VARIABLE
    for j in range(size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i >= j:
                continue
            if kind[i] == VARIABLE and kind[j] == VARIABLE:
                graph.degree[i] += 1
                graph.degree[j] += 1
            elif kind[i] == BESIDE:
                graph.hubs[j] += 1
            elif kind[j] == BESIDE:
                graph.hubs[i] += 1
    entries = 0
    for i in range(size):
        graph.start[i] = entries
        entries += graph.degree[i]
        if kind[i] == VARIABLE:
            d = listed_degree(i, graph)
            relink(i, d, NONE, graph.head, graph.after, graph.before)
    return entries, variables


@part
def write_neighbours(indptr, indices, kind, graph, adjacent):
    """Write the neighbours of all variables, and set the lengths of their lists."""
    start, length = graph.start, graph.length
    for j in range(graph.size):
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if i < j and kind[i] == VARIABLE and kind[j] == VARIABLE:
                adjacent[start[i] + length[i]] = j
                length[i] += 1
                adjacent[start[j] + length[j]] = i
                length[j] += 1


@part
def listed_degree(i, graph):
    """Return the number of the list for variable i: rows and hubs beside it."""
    return min(np.int64(graph.degree[i]) + graph.hubs[i], graph.size - 1)


@part
def bound(pivot, graph, adjacent):
    """Return the length of all lists that the new element is formed of."""
    begin = graph.start[pivot]
    total = np.int64(graph.length[pivot])
    for p in range(begin, begin + graph.elements[pivot]):
        total += graph.length[adjacent[p]]
    return total


@part
def form_element(pivot, graph, adjacent, end):
    """Append to `adjacent` all variables beside the pivot; return the new end.

    Their weights become negative, they leave their lists, and the elements beside the
    pivot are absorbed. start[pivot] and degree[pivot] become those of the element.
    """
    start, length, weight = graph.start, graph.length, graph.weight
    weight[pivot] = -weight[pivot]
    begin = start[pivot]
    number = graph.elements[pivot]
    start[pivot] = end
    rows = 0
    for q in range(begin, begin + number + 1):
        if q < begin + number:
            e = adjacent[q]
            graph.mark[e] = 0
            first, last = start[e], start[e] + length[e]
        else:
            first, last = q, begin + length[pivot]
        for p in range(first, last):
            i = np.int64(adjacent[p])
            if weight[i] > 0:
                d = listed_degree(i, graph)
                relink(i, NONE, d, graph.head, graph.after, graph.before)
                rows += weight[i]
                weight[i] = -weight[i]
                adjacent[end] = i
                end += 1
    graph.degree[pivot] = rows
    return end


@part
def update(pivot, graph, adjacent, end, tag):
    """Put the new element into the lists of its variables; bound their degrees.

    First, mark[e] - tag becomes the number of rows of an element e that do not belong
    to the new one, for all e beside it. A variable that has no other neighbours than
    the new element's is eliminated together with the pivot.
    """
    start, length, elements = graph.start, graph.length, graph.elements
    weight, mark, degree = graph.weight, graph.mark, graph.degree
    begin = start[pivot]
    for p in range(begin, end):
        i = adjacent[p]
        for q in range(start[i], start[i] + elements[i]):
            e = adjacent[q]
            if mark[e] >= tag:
                mark[e] += weight[i]
            elif mark[e] != 0:
                mark[e] = tag + degree[e] + weight[i]
    for p in range(begin, end):
        i = np.int64(adjacent[p])
        first = start[i]
        to = first
        key = 0
        rows = 0
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
            append(i, pivot, graph)
            continue
        # There is room for the pivot: it, or an element of its own, has left the list.
        adjacent[to] = adjacent[middle]
        adjacent[middle] = adjacent[first]
        adjacent[first] = pivot
        elements[i] = middle - first + 1
        length[i] = to - first + 1
        if rows < degree[i]:
            degree[i] = rows
        key %= graph.size
        graph.before[i] = key
        graph.after[i] = graph.bucket[key]
        graph.bucket[key] = i


@part
def append(j, i, graph):
    """Append the rows that j stands for to those of i."""
    graph.following[graph.last[i]] = j
    graph.last[i] = graph.last[j]


@part
def merge_alike(begin, end, graph, adjacent, tag):
    """Merge variables of the new element that have the same neighbours.

    Only those with the same key are compared. Marks are below `tag` on entry, and below
    the number returned.
    """
    start, length, after = graph.start, graph.length, graph.after
    for p in range(begin, end):
        if graph.weight[adjacent[p]] == 0:
            continue
        key = graph.before[adjacent[p]]
        i = np.int64(graph.bucket[key])
        graph.bucket[key] = NONE
        while i >= 0 and after[i] >= 0:
            # the first neighbour of all is the new element
            for q in range(start[i] + 1, start[i] + length[i]):
                graph.mark[adjacent[q]] = tag
            previous = i
            j = np.int64(after[i])
            while j >= 0:
                alike = length[j] == length[i]
                alike &= graph.elements[j] == graph.elements[i]
                q = start[j] + 1
                while alike and q < start[j] + length[j]:
                    alike = graph.mark[adjacent[q]] == tag
                    q += 1
                if alike:
                    graph.weight[i] += graph.weight[j]
                    graph.weight[j] = 0
                    if graph.hubs[j] > graph.hubs[i]:
                        graph.hubs[i] = graph.hubs[j]
                    append(j, i, graph)
                    after[previous] = after[j]
                else:
                    previous = j
                j = np.int64(after[j])
            tag += 1
            i = np.int64(after[i])
    return tag


@part
def link_all(pivot, graph, adjacent, end, left):
    """Return the variables of the new element to the lists, with their new degrees.

    `left` rows are not eliminated yet. Returns the new end of `adjacent`, which then
    holds supervariables only, and the least degree of them.
    """
    weight, degree = graph.weight, graph.degree
    begin = graph.start[pivot]
    lowest = graph.size
    to = begin
    for p in range(begin, end):
        i = np.int64(adjacent[p])
        if weight[i] == 0:
            continue
        weight[i] = -weight[i]
        rows = np.int64(degree[i]) + degree[pivot] - weight[i]
        degree[i] = min(rows, left - weight[i])
        d = listed_degree(i, graph)
        relink(i, d, NONE, graph.head, graph.after, graph.before)
        lowest = min(lowest, d)
        adjacent[to] = i
        to += 1
    weight[pivot] = -weight[pivot]
    graph.elements[pivot] = 0
    graph.length[pivot] = to - begin
    return to, lowest
