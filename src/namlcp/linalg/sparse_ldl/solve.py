"""Solution of L D L' x = rhs, a chunk of columns at a time."""

from namlcp.compiled import entries, kernel, part
from namlcp.linalg.sparse_ldl.pattern import entries_of


@kernel(error_model="numpy")
def solve_sparse(pattern, values, inverse, rhs, x, y):
    """Call `ldl_solve_into`, all arguments arrays."""
    ldl_solve_into(
        inverse.size, entries_of(pattern), entries(values), entries(inverse),
        entries(rhs), entries(x), entries(y),
    )  # fmt: skip


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
