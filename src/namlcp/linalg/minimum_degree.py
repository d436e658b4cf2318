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

from typing import NamedTuple

import numpy as np

from namlcp.compiled import kernel, part, uncounted
from namlcp.linalg.ldl import NONE, relink
from namlcp.linalg.ordering import Order, degrees, postorder_tree

LARGE = 2000
"""Order of a matrix from which on hubs cost more time than they save fill."""

FEW, MANY = 10.0, 2.0
"""Neighbours of a hub at least, relative to the square root of the order: of a matrix
below the order `LARGE`, and above."""

ABOVE_MEAN = 4.0
"""Neighbours of a hub at least, relative to the mean over all rows."""

OUTSIDE, VARIABLE, BESIDE = 0, 1, 2
"""Kinds of a row: not to be ordered, ordered by its degree, a hub."""


class Quotient(NamedTuple):
    """The quotient graph; a node is a variable or, once eliminated, an element.

    All arrays have an entry for each row. The neighbours of node i are adjacent[p] for
    p in start[i] : start[i] + length[i]; of a variable, the first elements[i] of them
    are elements, of an element all are variables. weight[i] tells how many rows a
    supervariable stands for, 0 if it is part of another; it is negative while i belongs
    to the element being formed. degree[i] bounds the rows beside i. The rows that i
    stands for are i, following[i], following[following[i]], ..., last[i]. hubs[i]
    counts the hubs beside i. mark[e] is 0 for an element that has been absorbed.

    Variables of equal listed degree d, see `listed_degree`, form a list: head[d],
    after[head[d]], ...; `before` links back. While an element is formed, its variables
    are in no such list: they are in lists of equal keys, from bucket[key] on, and
    before[i] is the key of i.
    """

    start: np.ndarray
    mark: np.ndarray
    length: np.ndarray
    elements: np.ndarray
    weight: np.ndarray
    degree: np.ndarray
    following: np.ndarray
    last: np.ndarray
    hubs: np.ndarray
    head: np.ndarray
    after: np.ndarray
    before: np.ndarray
    bucket: np.ndarray


def minimum_degree(
    indptr: np.ndarray, indices: np.ndarray, member: np.ndarray | None = None
) -> Order:
    """Order the rows in `member` of a symmetric matrix, or all of them.

    The matrix is in CSC, its entries below the diagonal are not read.
    """
    size = indptr.size - 1
    if member is None:
        member = np.ones(size, dtype=np.bool_)
    long, short = np.empty((2, size), np.int64), np.empty((11, size), np.int32)
    return Order(*order_by_degree(indptr, indices, member, long, short))


@kernel
def order_by_degree(indptr, indices, member, long, short):
    """Return place, parent and counts of an `Order` of the rows in `member`.

    long (2, n) and short (11, n) are overwritten.
    """
    graph = Quotient(
        uncounted(long[0]), uncounted(long[1]), uncounted(short[0]),
        uncounted(short[1]), uncounted(short[2]), uncounted(short[3]),
        uncounted(short[4]), uncounted(short[5]), uncounted(short[6]),
        uncounted(short[7]), uncounted(short[8]), uncounted(short[9]),
        uncounted(short[10]),
    )  # fmt: skip
    size = member.size
    kind = np.empty(size, dtype=np.int8)
    place = np.empty(size, dtype=np.int32)
    for i in range(size):
        kind[i] = VARIABLE if member[i] else OUTSIDE
        place[i] = -1
    degree = degrees(indptr, indices, member)
    mark_hubs(indptr, indices, degree, kind)
    done = eliminate_all(indptr, indices, kind, graph, place)
    # The lists are empty now, and serve to sort the hubs by their degrees.
    for i in range(size):
        if kind[i] == BESIDE:
            d = np.int32(min(degree[i], size - 1))
            relink(np.int32(i), d, NONE, graph.head, graph.after, graph.before)
    for d in range(size):
        i = graph.head[d]
        while i >= 0:
            place[i] = done
            done += 1
            i = graph.after[i]
    parent, counts = postorder_tree(indptr, indices, place)
    return place, parent, counts


@part
def mark_hubs(indptr, indices, degree, kind):
    """Set the kind of hubs: of rows beside many others, and many that are no such rows.

    `degree` has the degrees of the rows that are variables. A dense block is not made
    of hubs: its rows soon become one supervariable.
    """
    size = 0
    total = 0
    highest = 0
    for i in range(kind.size):
        size += kind[i] == VARIABLE
        total += degree[i]
        highest = max(highest, degree[i])
    factor = MANY if size >= LARGE else FEW
    least = max(factor * np.sqrt(size), ABOVE_MEAN * total / max(size, 1))
    if highest <= least:
        return
    large = np.empty(kind.size, dtype=np.bool_)
    for i in range(kind.size):
        large[i] = degree[i] > least
    inside = degrees(indptr, indices, large)
    for i in range(kind.size):
        if degree[i] - inside[i] > least:
            kind[i] = BESIDE


@part(forceinline=True)
def eliminate_all(indptr, indices, kind, graph, place):
    """Set the places of the variables, from 0 on; return how many there are."""
    weight, degree = graph.weight, graph.degree
    entries, left = count_neighbours(indptr, indices, kind, graph)
    adjacent = np.empty(2 * entries + left, dtype=np.int32)
    write_neighbours(indptr, indices, kind, graph, adjacent)
    end = entries
    done = 0
    least = 0  # no list of a smaller degree has members
    tag = 2  # marks are below it, see `update`
    widest = 0
    while left > 0:
        while graph.head[least] < 0:
            least += 1
        pivot = graph.head[least]
        relink(pivot, NONE, np.int32(least), graph.head, graph.after, graph.before)
        begin = end
        most = bound(pivot, graph, adjacent)
        if begin + most > adjacent.size:
            larger = np.empty(2 * adjacent.size + most, dtype=np.int32)
            for p in range(begin):
                larger[p] = adjacent[p]
            adjacent = larger
        end = form_element(pivot, graph, adjacent, begin)
        widest = max(widest, degree[pivot])
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


@part(forceinline=True)
def count_neighbours(indptr, indices, kind, graph):
    """Set the graph but for its entries; return the numbers of entries and variables.

    No length is set: that of every list is 0.
    """
    size = kind.size
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
            relink(np.int32(i), d, NONE, graph.head, graph.after, graph.before)
    return entries, variables


@part(forceinline=True)
def write_neighbours(indptr, indices, kind, graph, adjacent):
    """Write the neighbours of all variables, and set the lengths of their lists."""
    start, length = graph.start, graph.length
    for j in range(kind.size):
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
    return np.int32(min(graph.degree[i] + graph.hubs[i], graph.head.size - 1))


@part(forceinline=True)
def bound(pivot, graph, adjacent):
    """Return the length of all lists that the new element is formed of."""
    begin = graph.start[pivot]
    total = np.int64(graph.length[pivot])
    for p in range(begin, begin + graph.elements[pivot]):
        total += graph.length[adjacent[p]]
    return total


@part(forceinline=True)
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
            i = adjacent[p]
            if weight[i] > 0:
                d = listed_degree(i, graph)
                relink(i, NONE, d, graph.head, graph.after, graph.before)
                rows += weight[i]
                weight[i] = -weight[i]
                adjacent[end] = i
                end += 1
    graph.degree[pivot] = rows
    return end


@part(forceinline=True)
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
        i = adjacent[p]
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
        degree[i] = min(degree[i], rows)
        key %= weight.size
        graph.before[i] = key
        graph.after[i] = graph.bucket[key]
        graph.bucket[key] = i


@part
def append(j, i, graph):
    """Append the rows that j stands for to those of i."""
    graph.following[graph.last[i]] = j
    graph.last[i] = graph.last[j]


@part(forceinline=True)
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
        i = graph.bucket[key]
        graph.bucket[key] = NONE
        while i >= 0 and after[i] >= 0:
            # the first neighbour of all is the new element
            for q in range(start[i] + 1, start[i] + length[i]):
                graph.mark[adjacent[q]] = tag
            previous = i
            j = after[i]
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
                    graph.hubs[i] = max(graph.hubs[i], graph.hubs[j])
                    append(j, i, graph)
                    after[previous] = after[j]
                else:
                    previous = j
                j = after[j]
            tag += 1
            i = after[i]
    return tag


@part(forceinline=True)
def link_all(pivot, graph, adjacent, end, left):
    """Return the variables of the new element to the lists, with their new degrees.

    `left` rows are not eliminated yet. Returns the new end of `adjacent`, which then
    holds supervariables only, and the least degree of them.
    """
    weight, degree = graph.weight, graph.degree
    begin = graph.start[pivot]
    lowest = np.int32(weight.size)
    to = begin
    for p in range(begin, end):
        i = adjacent[p]
        if weight[i] == 0:
            continue
        weight[i] = -weight[i]
        rows = degree[i] + degree[pivot] - weight[i]
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
