"""Sparse L D L' of quasi-definite matrices of one pattern, factored many times.

`analyse` lays out all indices once; `ldl_factor` and `ldl_solve_into`, for compiled
callers, then only compute. They take pointers, which need no sign test of an index. The
matrix K is given by its upper triangle in CSC, with all diagonal entries, which are the
last of their columns. Every symmetric permutation of a quasi-definite matrix has an L D
L' without pivoting (R. Vanderbei, SIAM J. Optim. 5 (1995) 100-113); L has ones on its
diagonal.

Row by row, with y the entries of K in row k of the triangle: for all i with l_ki not 0,
in rising order,

    y_j -= l_ji y_i  (i < j < k),    l_ki = y_i / d_i,    d_k = k_kk - sum_i l_ki y_i

(T. Davis, "Algorithm 849", ACM Trans. Math. Softw. 31 (2005) 587-591). Columns are
alike if each is the first below the diagonal in the one before, and both have the same
rows below that. Four or two such columns, a *chunk*, are applied to y at a time: each
entry of y is read and written once for all of them, and has one index.

The functions for compiled callers do not count references (_nrt=False): counting them
in every chunk takes as long as the arithmetic. Those for one chunk are inlined.
"""

from typing import NamedTuple

import numpy as np

from namlcp.checks import refuse_size
from namlcp.compiled import entries, kernel, part
from namlcp.linalg.ordering import STRICT, Order, permuted

CONSECUTIVE = 8
"""Rows that a chunk must have for a test whether they follow each other without gaps.
If they do, they need no indices, and the processor takes several at a time."""

LEAST = float(np.finfo(np.float64).tiny)
"""Smallest pivot that is not 0 for us: the reciprocals of smaller ones may overflow."""


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
    chunk that begins with i.
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
    return (
        diagonal, columns, rows, source, starts, below, lines, chunks, width, done
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


@kernel(error_model="numpy")
def factor_sparse(pattern, data, values, inverse, y):
    """Call `ldl_factor`, all arguments arrays."""
    return ldl_factor(
        inverse.size, entries_of(pattern), entries(data), entries(values),
        entries(inverse), entries(y),
    )  # fmt: skip


@kernel(error_model="numpy")
def solve_sparse(pattern, values, inverse, rhs, x, y):
    """Call `ldl_solve_into`, all arguments arrays."""
    ldl_solve_into(
        inverse.size, entries_of(pattern), entries(values), entries(inverse),
        entries(rhs), entries(x), entries(y),
    )  # fmt: skip


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
    )


@part(_nrt=False)
def ldl_factor(n, pattern, data, values, inverse, y):
    """Set the values of L and the reciprocals of the pivots, inverse (n,).

    `data` are the values of K, of order n; y (n,) is overwritten. Pivots may be
    negative. Returns False if one is not finite, or smaller than `LEAST`.
    """
    columns, rows, source = pattern.columns, pattern.rows, pattern.source
    for k in range(n):
        pattern.done[k] = 0
        y[k] = 0.0
    for k in range(n):
        pivot = data[pattern.diagonal[k]]
        for t in range(columns[k], columns[k + 1]):
            y[rows[t]] = data[source[t]]
        for t in range(pattern.lines[k], pattern.lines[k + 1]):
            i = pattern.chunks[t]
            width = pattern.width[i]
            if width == 1:
                pivot -= apply_one(i, pattern, values, inverse, y)
            elif k < i + width:
                pivot -= apply_part(i, k, pattern, values, inverse, y)
            elif width == 2:
                pivot -= apply_two(i, pattern, values, inverse, y)
            else:
                pivot -= apply_four(i, pattern, values, inverse, y)
        if not LEAST <= abs(pivot) < np.inf:
            return False
        inverse[k] = 1.0 / pivot
    return True


@part(_nrt=False, forceinline=True)
def apply_one(i, pattern, values, inverse, y):
    """Apply column i to y, and append l_ki to it; return l_ki y_i."""
    below = pattern.below
    a = pattern.starts[i]
    end = a + pattern.done[i]
    pattern.done[i] += 1
    y_i = y[i]
    y[i] = 0.0
    for p in range(a, end):
        y[below[p]] -= values[p] * y_i
    l_i = y_i * inverse[i]
    values[end] = l_i
    return l_i * y_i


@part(_nrt=False, forceinline=True)
def apply_part(i, k, pattern, values, inverse, y):
    """Apply the columns i : k of a chunk to y, for a row k of their own.

    Appends the l_kj to them; returns the sum of l_kj y_j.
    """
    starts = pattern.starts
    a = starts[i]
    y_0 = y[i]
    l_0 = y_0 * inverse[i]
    total = l_0 * y_0
    y[i] = 0.0
    values[a + k - i - 1] = l_0
    if k > i + 1:
        b = starts[i + 1]
        y_1 = y[i + 1] - values[a] * y_0
        l_1 = y_1 * inverse[i + 1]
        total += l_1 * y_1
        y[i + 1] = 0.0
        values[b + k - i - 2] = l_1
        if k > i + 2:
            y_2 = y[i + 2] - values[a + 1] * y_0 - values[b] * y_1
            l_2 = y_2 * inverse[i + 2]
            total += l_2 * y_2
            y[i + 2] = 0.0
            values[starts[i + 2]] = l_2
    return total


@part(_nrt=False, forceinline=True)
def apply_two(i, pattern, values, inverse, y):
    """Do as `apply_one` with the columns i and i + 1; return the sum of l_kj y_j."""
    starts, below = pattern.starts, pattern.below
    a, b = starts[i], starts[i + 1]
    rows = pattern.done[i]
    pattern.done[i] += 1
    y_0 = y[i]
    y_1 = y[i + 1] - values[a] * y_0
    y[i] = 0.0
    y[i + 1] = 0.0
    a += 1
    for s in range(rows):
        y[below[b + s]] -= values[a + s] * y_0 + values[b + s] * y_1
    l_0, l_1 = y_0 * inverse[i], y_1 * inverse[i + 1]
    values[a + rows] = l_0
    values[b + rows] = l_1
    return l_0 * y_0 + l_1 * y_1


@part(_nrt=False, forceinline=True)
def apply_four(i, pattern, values, inverse, y):
    """Do as `apply_one` with the columns i : i + 4; return the sum of l_kj y_j."""
    starts, below = pattern.starts, pattern.below
    a, b = starts[i], starts[i + 1]
    c, d = starts[i + 2], starts[i + 3]
    rows = pattern.done[i]
    pattern.done[i] += 1
    y_0 = y[i]
    y_1 = y[i + 1] - values[a] * y_0
    y_2 = y[i + 2] - values[a + 1] * y_0 - values[b] * y_1
    y_3 = y[i + 3] - values[a + 2] * y_0 - values[b + 1] * y_1 - values[c] * y_2
    y[i], y[i + 1], y[i + 2], y[i + 3] = 0.0, 0.0, 0.0, 0.0
    a, b, c = a + 3, b + 2, c + 1
    if rows >= CONSECUTIVE and below[d + rows - 1] - below[d] + 1 == rows:
        first = below[d]
        for s in range(rows):
            y[first + s] -= (
                values[a + s] * y_0 + values[b + s] * y_1
                + values[c + s] * y_2 + values[d + s] * y_3
            )  # fmt: skip
    else:
        for s in range(rows):
            y[below[d + s]] -= (
                values[a + s] * y_0 + values[b + s] * y_1
                + values[c + s] * y_2 + values[d + s] * y_3
            )  # fmt: skip
    l_0, l_1 = y_0 * inverse[i], y_1 * inverse[i + 1]
    l_2, l_3 = y_2 * inverse[i + 2], y_3 * inverse[i + 3]
    values[a + rows] = l_0
    values[b + rows] = l_1
    values[c + rows] = l_2
    values[d + rows] = l_3
    return l_0 * y_0 + l_1 * y_1 + l_2 * y_2 + l_3 * y_3


@part(_nrt=False)
def ldl_solve_into(n, pattern, values, inverse, rhs, x, y):
    """Set x = K^-1 rhs, both in the original order; y (n,) is overwritten.

    x may be rhs.
    """
    place, width = pattern.place, pattern.width
    for j in range(n):
        y[place[j]] = rhs[j]
    i = 0
    while i < n:
        if width[i] == 1:
            forward_one(i, pattern, values, y)
            i += 1
        elif width[i] == 2:
            forward_two(i, pattern, values, y)
            i += 2
        else:
            forward_four(i, pattern, values, y)
            i += 4
    while i > 0:
        if width[i - 1] == 1:
            i -= 1
            backward_one(i, pattern, values, inverse, y)
        elif width[i - 1] == 2:
            i -= 2
            backward_two(i, pattern, values, inverse, y)
        else:
            i -= 4
            backward_four(i, pattern, values, inverse, y)
    for j in range(n):
        x[j] = y[place[j]]


@part(_nrt=False, forceinline=True)
def forward_one(i, pattern, values, y):
    """Subtract from y column i times y_i."""
    below, starts = pattern.below, pattern.starts
    y_i = y[i]
    for p in range(starts[i], starts[i + 1]):
        y[below[p]] -= values[p] * y_i


@part(_nrt=False, forceinline=True)
def forward_two(i, pattern, values, y):
    """Do as `forward_one` for the columns i and i + 1."""
    below, starts = pattern.below, pattern.starts
    a, b = starts[i], starts[i + 1]
    rows = starts[i + 2] - b
    y_0 = y[i]
    y_1 = y[i + 1] - values[a] * y_0
    y[i + 1] = y_1
    a += 1
    for s in range(rows):
        y[below[b + s]] -= values[a + s] * y_0 + values[b + s] * y_1


@part(_nrt=False, forceinline=True)
def forward_four(i, pattern, values, y):
    """Do as `forward_one` for the columns i : i + 4."""
    below, starts = pattern.below, pattern.starts
    a, b = starts[i], starts[i + 1]
    c, d = starts[i + 2], starts[i + 3]
    rows = starts[i + 4] - d
    y_0 = y[i]
    y_1 = y[i + 1] - values[a] * y_0
    y_2 = y[i + 2] - values[a + 1] * y_0 - values[b] * y_1
    y_3 = y[i + 3] - values[a + 2] * y_0 - values[b + 1] * y_1 - values[c] * y_2
    y[i + 1], y[i + 2], y[i + 3] = y_1, y_2, y_3
    a, b, c = a + 3, b + 2, c + 1
    for s in range(rows):
        y[below[d + s]] -= (
            values[a + s] * y_0 + values[b + s] * y_1
            + values[c + s] * y_2 + values[d + s] * y_3
        )  # fmt: skip


@part(_nrt=False, forceinline=True)
def backward_one(i, pattern, values, inverse, y):
    """Set y_i to y_i / d_i minus the product of column i and y."""
    below, starts = pattern.below, pattern.starts
    y_i = y[i] * inverse[i]
    for p in range(starts[i], starts[i + 1]):
        y_i -= values[p] * y[below[p]]
    y[i] = y_i


@part(_nrt=False, forceinline=True)
def backward_two(i, pattern, values, inverse, y):
    """Do as `backward_one` for the columns i and i + 1."""
    below, starts = pattern.below, pattern.starts
    a, b = starts[i], starts[i + 1]
    rows = starts[i + 2] - b
    y_0, y_1 = y[i] * inverse[i], y[i + 1] * inverse[i + 1]
    for s in range(rows):
        y_s = y[below[b + s]]
        y_0 -= values[a + 1 + s] * y_s
        y_1 -= values[b + s] * y_s
    y[i + 1] = y_1
    y[i] = y_0 - values[a] * y_1


@part(_nrt=False, forceinline=True)
def backward_four(i, pattern, values, inverse, y):
    """Do as `backward_one` for the columns i : i + 4."""
    below, starts = pattern.below, pattern.starts
    a, b = starts[i], starts[i + 1]
    c, d = starts[i + 2], starts[i + 3]
    rows = starts[i + 4] - d
    y_0, y_1 = y[i] * inverse[i], y[i + 1] * inverse[i + 1]
    y_2, y_3 = y[i + 2] * inverse[i + 2], y[i + 3] * inverse[i + 3]
    for s in range(rows):
        y_s = y[below[d + s]]
        y_0 -= values[a + 3 + s] * y_s
        y_1 -= values[b + 2 + s] * y_s
        y_2 -= values[c + 1 + s] * y_s
        y_3 -= values[d + s] * y_s
    y_2 -= values[c] * y_3
    y_1 -= values[b] * y_2 + values[b + 1] * y_3
    y_0 -= values[a] * y_1 + values[a + 1] * y_2 + values[a + 2] * y_3
    y[i], y[i + 1], y[i + 2], y[i + 3] = y_0, y_1, y_2, y_3
