"""The indices of K and L, laid out once for all matrices of one pattern.

Columns of L are alike if each is the first below the diagonal in the one before, and
both have the same rows below that. Four or two such columns are a *chunk*.
"""

from typing import NamedTuple

import numpy as np

from namlcp.checks import refuse_size
from namlcp.compiled import entries, kernel, part
from namlcp.linalg.ordering import STRICT, Order, permuted

SMALLEST_BLOCK, BEFORE_BLOCK = 16, 20
"""Columns that a dense block at the end of L must have to be treated as one, and
columns before it for each of its own: with fewer, rows are as fast one by one."""


class Pattern(NamedTuple):
    """The indices of K and L; all but `place` are in the order of elimination.

    Row i of K becomes row place[i]. The diagonal entry of row k is data[diagonal[k]],
    with `data` those of K. Column k of the strict upper triangle has the entries
    data[source[t]] in rows[t], for t in columns[k] : columns[k + 1].

    Column i of L below the diagonal has values[p] in the rows below[p], ascending, for
    p in starts[i] : starts[i + 1]. Row k has entries in the chunks that begin with the
    columns chunks[t], ascending, for t in lines[k] : lines[k + 1]. width[i] is 1, 2 or
    4, the number of columns of the chunk, for its first and its last column i.
    done[i], scratch of a factorisation, counts the rows that are complete below the
    chunk that begins with i. The chunk is applied row by row to the first reach[i] of
    the rows below it: to those before the dense block (`first_dense`) if it has one or
    two columns and is before the block, otherwise to all.
    """

    place: np.ndarray
    diagonal: np.ndarray
    columns: np.ndarray
    rows: np.ndarray
    source: np.ndarray
    starts: np.ndarray
    below: np.ndarray
    lines: np.ndarray
    chunks: np.ndarray
    width: np.ndarray
    done: np.ndarray
    reach: np.ndarray


def analyse(indptr: np.ndarray, indices: np.ndarray, order: Order) -> Pattern:
    """Lay out L for a matrix K whose rows are all in the order."""
    refuse_size("the factors", int(order.counts.sum(dtype=np.int64)))
    return Pattern(order.place, *lay_out(indptr, indices, *order))


@kernel
def lay_out(indptr, indices, place, parent, counts):
    """Return the fields of the `Pattern` of K after its place."""
    n = parent.size
    columns, rows, source = permuted(indptr, indices, place, n, STRICT)
    diagonal = np.empty(n, dtype=np.int32)
    for i in range(n):
        diagonal[place[i]] = indptr[i + 1] - 1
    starts, lines = np.empty(n + 1, dtype=np.int64), np.empty(n + 1, dtype=np.int64)
    width, done = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int64)
    starts[0] = 0
    for k in range(n):
        starts[k + 1] = starts[k] + counts[k]
        done[k] = starts[k]
        width[k] = -1
    below = np.empty(starts[n], dtype=np.int32)
    for k in range(n):
        # Row k of L has entries on the paths from those of K up the tree to k.
        width[k] = k  # the last row that came by, for now
        for t in range(columns[k], columns[k + 1]):
            i = rows[t]
            while width[i] != k:
                width[i] = k
                below[done[i]] = k
                done[i] += 1
                i = parent[i]
    for k in range(n):
        done[k] = 0
    begin = 0
    while begin < n:
        width[begin] = chunk_from(begin, parent, counts)
        width[begin + width[begin] - 1] = width[begin]
        for t in range(starts[begin], starts[begin + 1]):
            done[below[t]] += 1
        begin += width[begin]
    lines[0] = 0
    for k in range(n):
        lines[k + 1] = lines[k] + done[k]
        done[k] = lines[k]
    chunks = np.empty(lines[n], dtype=np.int32)
    begin = 0
    while begin < n:
        for t in range(starts[begin], starts[begin + 1]):
            k = below[t]
            chunks[done[k]] = begin
            done[k] += 1
        begin += width[begin]
    first, reach = first_dense(n, starts), np.zeros(n, dtype=np.int32)
    begin = 0
    while begin < n:
        last = begin + width[begin] - 1
        for t in range(starts[last], starts[last + 1]):
            reach[begin] += begin >= first or width[begin] == 4 or below[t] < first
        begin = last + 1
    return (
        diagonal, columns, rows, source, starts, below, lines, chunks, width, done,
        reach,
    )  # fmt: skip


@part
def chunk_from(begin, parent, counts):
    """Return how many columns from `begin` on are alike: 1, 2 or 4."""
    end = begin
    while end < begin + 3 and parent[end] == end + 1:
        if counts[end] != counts[end + 1] + 1:
            break
        end += 1
    found = end - begin + 1
    return found if found != 3 else 2


@part
def first_dense(n, starts):
    """Return the column with which the dense block that L ends with begins.

    It is n, no column, if the block is small or has few columns before it.
    """
    first = n
    while first > 0 and starts[first] - starts[first - 1] == n - first:
        first -= 1
    block = n - first
    return first if block >= SMALLEST_BLOCK and first >= BEFORE_BLOCK * block else n


@part
def entries_of(pattern):
    """Return the pattern with pointers in place of arrays."""
    return Pattern(
        entries(pattern.place),
        entries(pattern.diagonal),
        entries(pattern.columns),
        entries(pattern.rows),
        entries(pattern.source),
        entries(pattern.starts),
        entries(pattern.below),
        entries(pattern.lines),
        entries(pattern.chunks),
        entries(pattern.width),
        entries(pattern.done),
        entries(pattern.reach),
    )
