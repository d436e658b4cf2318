"""Solution of L D L' x = rhs with sparse factors, a chunk of columns at a time.

The factors and their chunks are those of `sparse_ldl`.
"""

from cython import Py_ssize_t
from cython.cimports.namlcp.linalg.arrays import indices, numbers, places


class Factored:
    """`SparseFactors` as compiled code reads them; it shares and keeps their arrays."""

    def __init__(self, factors):
        n: Py_ssize_t = factors.inverse.size
        pattern, self.n, self.factors = factors.pattern, n, factors
        self.place, self.width = places(pattern.place, n), places(pattern.width, n)
        self.starts = indices(pattern.starts, n + 1)
        self.below = places(pattern.below, self.starts[n])
        self.values = numbers(factors.values, self.starts[n])
        self.inverse, self.y = numbers(factors.inverse, n), numbers(factors.work, n)


def solve_factored(f, rhs, x):
    """Set x = K^-1 rhs, both in the original order; x may be rhs."""
    for j in range(f.n):
        f.y[f.place[j]] = rhs[j]
    solve_forward(f)
    solve_backward(f)
    for j in range(f.n):
        x[j] = f.y[f.place[j]]


def solve_forward(f):
    """Set y to L^-1 y: subtract y_i times column i, from the first to the last."""
    y, values, below, starts = f.y, f.values, f.below, f.starts
    i: Py_ssize_t = 0
    while i < f.n:
        width, y_0 = f.width[i], y[i]
        if width == 1:
            for t in range(starts[i], starts[i + 1]):
                y[below[t]] -= values[t] * y_0
            i += 1
        elif width == 2:
            a, b = starts[i], starts[i + 1]
            y_1 = y[i + 1] - values[a] * y_0
            y[i + 1] = y_1
            i += 2
            for t in range(starts[i] - b):
                y[below[b + t]] -= values[a + 1 + t] * y_0 + values[b + t] * y_1
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
        width = f.width[i - 1]
        if width == 1:
            i -= 1
            y_0 = y[i] * inverse[i]
            for t in range(starts[i], starts[i + 1]):
                y_0 -= values[t] * y[below[t]]
            y[i] = y_0
        elif width == 2:
            i -= 2
            a, b = starts[i], starts[i + 1]
            y_0, y_1 = y[i] * inverse[i], y[i + 1] * inverse[i + 1]
            for t in range(starts[i + 2] - b):
                y_t = y[below[b + t]]
                y_0 -= values[a + 1 + t] * y_t
                y_1 -= values[b + t] * y_t
            y[i + 1] = y_1
            y[i] = y_0 - values[a] * y_1
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
