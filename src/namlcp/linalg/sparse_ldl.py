"""Sparse L D L' of quasi-definite matrices of one pattern, factored many times.

The matrix K is given by its upper triangle in CSC, with all diagonal entries, which are
the last of their columns. Every symmetric permutation of a quasi-definite matrix has an
L D L' without pivoting (R. Vanderbei, SIAM J. Optim. 5 (1995) 100-113). With y the
entries of K in row k of the triangle: for all i with l_ki not 0, in rising order,

    y_j -= l_ji y_i  (i < j < k),    l_ki = y_i / d_i,    d_k = k_kk - sum_i l_ki y_i

(T. Davis, "Algorithm 849", ACM Trans. Math. Softw. 31 (2005) 587-591). Columns of L are
alike if each is the first below the diagonal in the one before, and both have the same
rows below that. Four such columns are a *chunk*, applied to y at a time.

Where L ends with a dense block, every one of its rows would read most of L. So the
single columns before the block are applied to the y_j before it alone. Then each of
them is read once, and subtracted from all rows of the block,

    s_rc -= l_ri d_i l_ci    (i before the block, c < r in it),

and the block is factored, row by row. In the meantime `values` has the s_rc in place of
the l_rc, and `inverse` has the pivots of the block, as far as they are known.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import isfinite

from namlcp.arrays import refuse_size
from namlcp.limits import NEVER, OutOfTime
from namlcp.linalg.ordering import permuted

cnp.import_array()

# Smallest pivot that is not 0 for us: the reciprocals of smaller ones may overflow.
LEAST = float(np.finfo(np.float64).tiny)
# Operations after which the watch is told of them.
LOOK_AFTER = 1e5
# SMALLEST_BLOCK, BEFORE_BLOCK: columns that a dense block at the end of L must have to
# be treated as one, and columns before it for each of its own.


class Factors:
    """Factors of quasi-definite matrices with one pattern of the upper triangle."""

    def __init__(self, indptr):
        self.n, self.nnz = indptr.size - 1, indptr[indptr.size - 1]

    def refactor(self, data, deadline=NEVER):
        """Factor; ValueError if a pivot is 0, OutOfTime if the deadline is reached."""
        watch, values = Watched(), numbers(data, self.nnz)
        watch.until = deadline.at
        with cython.nogil:
            is_done = self.factor_values(values, watch)
        raise_kept(watch)
        if watch.over:
            raise OutOfTime
        if not is_done:
            raise ValueError("a pivot vanishes")

    def solve(self, rhs):
        x = new_vector(self.n)
        self.solve_into(numbers(rhs, self.n), data_of(x))
        return x

    def factor_values(self, data, watch):
        """Do as `refactor` does; False if a pivot is 0, or the watch says to stop."""
        return False

    def solve_into(self, rhs, x):
        """Set x = K^-1 rhs; x may be rhs."""


def as_array(values, size):
    length: cnp.npy_intp = size
    return cnp.PyArray_SimpleNewFromData(
        1, cython.address(length), cnp.NPY_DOUBLE, values
    )


class SparseFactors(Factors):
    """L D L' by chunks of columns."""

    def __init__(self, indptr, indices, order):
        Factors.__init__(self, indptr)
        self.entries, self.work = order.entries, order.work
        refuse_size("the factors", self.entries)
        n, entries = self.n, self.entries
        triangle = permuted(indptr, indices, order.place, True)
        columns, rows, source = triangle
        ints, longs = new_places(3 * n), new_indices(3 * (n + 1))
        below, chunks = new_places(entries), new_places(entries)
        values, reals = new_vector(entries), new_vector(2 * n)
        self.arrays = order.place, triangle, ints, longs, below, chunks, values, reals
        self.place, self.columns = places(order.place, n), places(columns, n + 1)
        self.rows, self.source = places(rows, rows.size), places(source, source.size)
        self.diagonal, self.starts = places(ints, 3 * n), longs_at(longs, 3 * (n + 1))
        self.width, self.reach = self.diagonal + n, self.diagonal + 2 * n
        self.lines, self.done = self.starts + n + 1, self.starts + 2 * (n + 1)
        self.below, self.chunks = places(below, entries), places(chunks, entries)
        self.values = numbers(values, entries)
        self.inverse = numbers(reals, 2 * n)
        self.y = self.inverse + n
        ends, parent = places(indptr, n + 1), places(order.parent, n)
        counts = places(order.counts, n)
        with cython.nogil:
            lay_out(self, ends, parent, counts)

    @property
    def pivots(self):
        """The diagonal of D, in the order of elimination."""
        return 1.0 / as_array(self.inverse, self.n)

    def factor_values(self, data, watch):
        starts, width, y = self.starts, self.width, self.y
        values, inverse, n = self.values, self.inverse, self.n
        operations, since = self.work / max(n, 1), 0.0
        for k in range(n):
            self.done[k] = 0
            y[k] = 0.0
        # The columns begin : end are applied: those before the block, then its own.
        begin: Py_ssize_t = 0
        end = self.first
        while begin < n:
            for k in range(begin, n):
                if begin == 0:
                    pivot = data[self.diagonal[k]]
                    for t in range(self.columns[k], self.columns[k + 1]):
                        y[self.rows[t]] = data[self.source[t]]
                else:
                    pivot = inverse[k]
                    for j in range(begin, k):
                        y[j] = values[starts[j] + k - j - 1]
                for t in range(self.lines[k], self.lines[k + 1]):
                    i: Py_ssize_t = self.chunks[t]
                    if i < begin:
                        continue
                    if i >= end:
                        break
                    if width[i] == 1:
                        pivot -= apply_one(self, i, self.done[i])
                        self.done[i] += 1
                    elif k >= i + 4:
                        pivot -= apply_four(self, i)
                    else:  # a row of the chunk itself
                        total = 0.0
                        for j in range(i, k):
                            total += apply_one(self, j, k - j - 1)
                        pivot -= total
                if k >= end:
                    inverse[k] = pivot
                    for j in range(end, k):
                        values[starts[j] + k - j - 1] = y[j]
                        y[j] = 0.0
                elif LEAST <= abs(pivot) and isfinite(pivot):
                    inverse[k] = 1.0 / pivot
                else:
                    return False
                since += operations
                if since > LOOK_AFTER:
                    if is_over(watch, since):
                        return False
                    since = 0.0
            if end < n:
                subtract_products(self)
            begin, end = end, n
        return True

    def solve_into(self, rhs, x):
        for j in range(self.n):
            self.y[self.place[j]] = rhs[j]
        solve_forward(self)
        solve_backward(self)
        for j in range(self.n):
            x[j] = self.y[self.place[j]]


# ---- the layout


def lay_out(f, indptr, parent, counts):
    """Set the columns of L, the chunks of its rows, and where the diagonal of K is."""
    n, starts, below, lines = f.n, f.starts, f.below, f.lines
    done, width, reach = f.done, f.width, f.reach
    for j in range(n):
        f.diagonal[f.place[j]] = indptr[j + 1] - 1
    starts[0] = 0
    for k in range(n):
        starts[k + 1] = starts[k] + counts[k]
        done[k] = starts[k]
        reach[k] = k  # here, each column is a supernode
    append_rows(n, f.columns, f.rows, parent, reach, width, done, below)
    begin: Py_ssize_t = 0
    while begin < n:
        columns = 4  # that are alike
        for i in range(begin, begin + 3):
            if parent[i] != i + 1 or counts[i] != counts[i + 1] + 1:
                columns = 1
                break
        width[begin] = width[begin + columns - 1] = columns
        begin += columns
    f.first = n
    while f.first > 0 and counts[f.first - 1] == n - f.first:
        f.first -= 1
    block = n - f.first
    if block < SMALLEST_BLOCK or f.first < BEFORE_BLOCK * block:
        f.first = n
    for k in range(n):
        done[k] = 0
        reach[k] = n
    begin = 0
    while begin < n:
        is_cut: cython.bint = width[begin] == 1 and begin < f.first
        if is_cut:
            reach[begin] = 0
        for t in range(starts[begin], starts[begin + 1]):
            done[below[t]] += 1
            reach[begin] += is_cut and below[t] < f.first
        begin += width[begin]
    lines[0] = 0
    for k in range(n):
        lines[k + 1] = lines[k] + done[k]
        done[k] = lines[k]
    begin = 0
    while begin < n:
        for t in range(starts[begin], starts[begin + 1]):
            k = below[t]
            f.chunks[done[k]] = begin
            done[k] += 1
        begin += width[begin]


# ---- the chunks of a factorisation


def subtract_products(f):
    """Subtract from the dense block the products that `apply_one` leaves out."""
    starts, below, values = f.starts, f.below, f.values
    i: Py_ssize_t = 0
    while i < f.first:
        first = starts[i] + f.reach[i] if f.width[i] == 1 else starts[i + 1]
        for s in range(first, starts[i + 1]):
            c = below[s]
            y_c = values[s] / f.inverse[i]
            to = starts[c] - c - 1
            for t in range(s + 1, starts[i + 1]):
                values[to + below[t]] -= values[t] * y_c
        i += f.width[i]


def apply_one(f, i, rows):
    """Apply column i, of so many rows, to y, and append l_ki to it; return l_ki y_i."""
    y, values, below, a = f.y, f.values, f.below, f.starts[i]
    y_i = y[i]
    y[i] = 0.0
    for p in range(a, a + min(rows, f.reach[i])):
        y[below[p]] -= values[p] * y_i
    l_i = y_i * f.inverse[i]
    values[a + rows] = l_i
    return l_i * y_i


def apply_four(f, i):
    """Do as `apply_one` with the columns i : i + 4; return the sum of l_kj y_j."""
    y, values, inverse, below = f.y, f.values, f.inverse, f.below
    a, b = f.starts[i], f.starts[i + 1]
    c, d = f.starts[i + 2], f.starts[i + 3]
    rows = f.done[i]
    f.done[i] += 1
    y_0 = y[i]
    y_1 = y[i + 1] - values[a] * y_0
    y_2 = y[i + 2] - values[a + 1] * y_0 - values[b] * y_1
    y_3 = y[i + 3] - values[a + 2] * y_0 - values[b + 1] * y_1 - values[c] * y_2
    y[i], y[i + 1], y[i + 2], y[i + 3] = 0.0, 0.0, 0.0, 0.0
    a, b, c = a + 3, b + 2, c + 1
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


# ---- solution


def solve_forward(f):
    """Set y to L^-1 y: subtract y_i times column i, from the first to the last."""
    y, values, below, starts = f.y, f.values, f.below, f.starts
    i: Py_ssize_t = 0
    while i < f.n:
        y_0 = y[i]
        if f.width[i] == 1:
            for t in range(starts[i], starts[i + 1]):
                y[below[t]] -= values[t] * y_0
            i += 1
        else:
            a, b, c, d = starts[i], starts[i + 1], starts[i + 2], starts[i + 3]
            y_1 = y[i + 1] - values[a] * y_0
            y_2 = y[i + 2] - values[a + 1] * y_0 - values[b] * y_1
            y_3 = y[i + 3] - values[a + 2] * y_0 - values[b + 1] * y_1 - values[c] * y_2
            y[i + 1], y[i + 2], y[i + 3] = y_1, y_2, y_3
            i += 4
            for t in range(starts[i] - d):
                y[below[d + t]] -= (
                    values[a + 3 + t] * y_0 + values[b + 2 + t] * y_1
                    + values[c + 1 + t] * y_2 + values[d + t] * y_3
                )  # fmt: skip


def solve_backward(f):
    """Set y to (D L')^-1 y, y_i from the entries below it."""
    y, values, below, starts, inverse = f.y, f.values, f.below, f.starts, f.inverse
    i = f.n
    while i > 0:
        if f.width[i - 1] == 1:
            i -= 1
            y_0 = y[i] * inverse[i]
            for t in range(starts[i], starts[i + 1]):
                y_0 -= values[t] * y[below[t]]
            y[i] = y_0
        else:
            i -= 4
            a, b, c, d = starts[i], starts[i + 1], starts[i + 2], starts[i + 3]
            y_0, y_1 = y[i] * inverse[i], y[i + 1] * inverse[i + 1]
            y_2, y_3 = y[i + 2] * inverse[i + 2], y[i + 3] * inverse[i + 3]
            for t in range(starts[i + 4] - d):
                y_t = y[below[d + t]]
                y_0 -= values[a + 3 + t] * y_t
                y_1 -= values[b + 2 + t] * y_t
                y_2 -= values[c + 1 + t] * y_t
                y_3 -= values[d + t] * y_t
            y_2 -= values[c] * y_3
            y_1 -= values[b] * y_2 + values[b + 1] * y_3
            y_0 -= values[a] * y_1 + values[a + 1] * y_2 + values[a + 2] * y_3
            y[i], y[i + 1], y[i + 2], y[i + 3] = y_0, y_1, y_2, y_3
