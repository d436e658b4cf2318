"""The factorisation, row by row.

With y the entries of K in row k of the triangle: for all i with l_ki not 0, in rising
order,

    y_j -= l_ji y_i  (i < j < k),    l_ki = y_i / d_i,    d_k = k_kk - sum_i l_ki y_i

(T. Davis, "Algorithm 849", ACM Trans. Math. Softw. 31 (2005) 587-591). The columns i of
a chunk are applied to y at a time: each entry of y is read and written once for all of
them, and has one index.

Where L ends with a dense block, its rows have most of the work, and every one would
read most of L. So the chunks of one or two columns before the block are applied to the
y_j before it alone. Then each of these columns is read once, and subtracted from all
rows of the block,

    s_rc -= l_ri d_i l_ci    (i before the block, c < r in it),

and the block is factored, row by row. In the meantime `values` has the s_rc in place of
the l_rc, and `inverse` has the pivots of the block, as far as they are known. Chunks of
four columns are as fast row by row.
"""

import numpy as np

from namlcp.compiled import entries, kernel, part
from namlcp.linalg.sparse_ldl.pattern import entries_of, first_dense

CONSECUTIVE = 8
"""Rows that a chunk must have for a test whether they follow each other without gaps.
If they do, they need no indices, and the processor takes several at a time."""

LEAST = float(np.finfo(np.float64).tiny)
"""Smallest pivot that is not 0 for us: the reciprocals of smaller ones may overflow."""


@kernel(error_model="numpy")
def factor_sparse(pattern, data, values, inverse, y):
    """Call `ldl_factor`, all arguments arrays."""
    return ldl_factor(
        inverse.size, entries_of(pattern), entries(data), entries(values),
        entries(inverse), entries(y),
    )  # fmt: skip


@part(_nrt=False)
def ldl_factor(n, pattern, data, values, inverse, y):
    """Set the values of L and the reciprocals of the pivots, inverse (n,).

    `data` are the values of K, of order n; y (n,) is overwritten. Pivots may be
    negative. Returns False if one is not finite, or smaller than `LEAST`.
    """
    columns, rows, source = pattern.columns, pattern.rows, pattern.source
    starts, first = pattern.starts, first_dense(n, pattern.starts)
    for k in range(n):
        pattern.done[k] = 0
        y[k] = 0.0
    # The columns begin : end are applied: those before the dense block, then its own.
    begin, end = 0, first
    while begin < n:
        for k in range(begin, n):
            if begin == 0:
                pivot = data[pattern.diagonal[k]]
                for t in range(columns[k], columns[k + 1]):
                    y[rows[t]] = data[source[t]]
            else:
                pivot = inverse[k]
                for j in range(begin, k):
                    y[j] = values[starts[j] + k - j - 1]
            for t in range(pattern.lines[k], pattern.lines[k + 1]):
                i = pattern.chunks[t]
                if i < begin:
                    continue
                if i >= end:
                    break
                width = pattern.width[i]
                if width == 1:
                    pivot -= apply_one(i, pattern, values, inverse, y)
                elif k < i + width:
                    pivot -= apply_part(i, k, pattern, values, inverse, y)
                elif width == 2:
                    pivot -= apply_two(i, pattern, values, inverse, y)
                else:
                    pivot -= apply_four(i, pattern, values, inverse, y)
            if k >= end:
                inverse[k] = pivot
                for j in range(end, k):
                    values[starts[j] + k - j - 1] = y[j]
                    y[j] = 0.0
            elif LEAST <= abs(pivot) < np.inf:
                inverse[k] = 1.0 / pivot
            else:
                return False
        if end < n:
            subtract_products(first, pattern, values, inverse)
        begin, end = end, n
    return True


@part(_nrt=False)
def subtract_products(first, pattern, values, inverse):
    """Subtract from the dense block the products that chunks before it do not reach."""
    starts, below = pattern.starts, pattern.below
    i = 0
    while i < first:
        end = i + pattern.width[i]
        rows = starts[end] - starts[end - 1] - pattern.reach[i]
        for j in range(i, end):
            for s in range(starts[j + 1] - rows, starts[j + 1]):
                c = below[s]
                y_c = values[s] / inverse[j]
                to = starts[c] - c - 1
                for t in range(s + 1, starts[j + 1]):
                    values[to + below[t]] -= values[t] * y_c
        i = end


@part(_nrt=False, forceinline=True)
def apply_one(i, pattern, values, inverse, y):
    """Apply column i to y, and append l_ki to it; return l_ki y_i."""
    below = pattern.below
    a, rows = pattern.starts[i], pattern.done[i]
    count = min(rows, pattern.reach[i])
    pattern.done[i] += 1
    y_i = y[i]
    y[i] = 0.0
    for p in range(a, a + count):
        y[below[p]] -= values[p] * y_i
    l_i = y_i * inverse[i]
    values[a + rows] = l_i
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
    count = min(rows, pattern.reach[i])
    pattern.done[i] += 1
    y_0 = y[i]
    y_1 = y[i + 1] - values[a] * y_0
    y[i] = 0.0
    y[i + 1] = 0.0
    a += 1
    for s in range(count):
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
    count = min(rows, pattern.reach[i])
    pattern.done[i] += 1
    y_0 = y[i]
    y_1 = y[i + 1] - values[a] * y_0
    y_2 = y[i + 2] - values[a + 1] * y_0 - values[b] * y_1
    y_3 = y[i + 3] - values[a + 2] * y_0 - values[b + 1] * y_1 - values[c] * y_2
    y[i], y[i + 1], y[i + 2], y[i + 3] = 0.0, 0.0, 0.0, 0.0
    a, b, c = a + 3, b + 2, c + 1
    if count >= CONSECUTIVE and below[d + count - 1] - below[d] + 1 == count:
        first = below[d]
        for s in range(count):
            y[first + s] -= (
                values[a + s] * y_0 + values[b + s] * y_1
                + values[c + s] * y_2 + values[d + s] * y_3
            )  # fmt: skip
    else:
        for s in range(count):
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
