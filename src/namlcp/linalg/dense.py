"""Dense matrices of small order: products, and triangles L of factors S = L L'.

Matrices are row-major. The factor of a set that gains and loses rows is packed without
its zeros: row i begins at i (i + 1) / 2. Removing a row and column of S leaves L with
one entry too many in each later row, which Givens rotations of its columns take away
(Gill, Golub, Murray and Saunders, Math. Comp. 28 (1974) 505-535, method C1 in the form
for L).
"""

from cython.cimports.libc.math import sqrt

# The diagonal entry of L for a row that depends on those before it.
HUGE = 1e100


def factor_in_place(L, n, least):
    """Overwrite the lower triangle of a matrix S by its Cholesky factor L.

    The upper triangle is overwritten, too. A row whose pivot is at most `least` times
    its diagonal entry depends on those before it, and becomes (0, ..., 0, HUGE).
    Returns how many rows do.
    """
    dependent: Py_ssize_t = 0
    for first in range(0, n, 4):
        end = min(first + 4, n)
        for i in range(first, end):  # row i of L' comes above the diagonal of row i
            row = L + i * n
            for k in range(i + 1, n):
                row[k] = L[k * n + i]
            for j in range(first, i):
                add_scaled(-L[j * n + i], L + j * n + i, row + i, n - i)
            pivot = row[i]
            if pivot > least * (pivot + dot(row, row, i)):
                row[i] = sqrt(pivot)
                for k in range(i + 1, n):
                    row[k] /= row[i]
            else:
                dependent += 1
                fill(row, 0.0, n)
                row[i] = HUGE
            for k in range(i + 1, n):
                L[k * n + i] = row[k]
        for i in range(end, n):
            row = L + first * n
            add_four(
                -row[i], row + end, -row[n + i], row + n + end,
                -row[2 * n + i], row + 2 * n + end, -row[3 * n + i], row + 3 * n + end,
                L + i * n + end, i - end + 1,
            )  # fmt: skip
    return dependent


def invert_triangle(L, n):
    """Overwrite a lower triangular L by L^-1, with zeros above its diagonal."""
    for i in range(n):
        row = L + i * n
        pivot = 1.0 / row[i]
        fill(row + i + 1, 0.0, n - i - 1)
        j: Py_ssize_t = 0
        while j + 4 <= i:
            a, b, c, d = row[j], row[j + 1], row[j + 2], row[j + 3]
            above = L + j * n
            fill(row + j, 0.0, 4)
            add_four(
                a, above, b, above + n, c, above + 2 * n, d, above + 3 * n, row, j + 4
            )
            j += 4
        while j < i:
            a, row[j] = row[j], 0.0
            add_scaled(a, L + j * n, row, j + 1)
            j += 1
        for j in range(i):
            row[j] *= -pivot
        row[i] = pivot


def forward_solve(L, n, b):
    """Overwrite b (n,) by the solution of L x = b for a lower triangle L."""
    for i in range(n):
        row = L + i * n
        b[i] = (b[i] - dot(row, b, i)) / row[i]


def backward_solve(L, n, b):
    """Overwrite b (n,) by the solution of L'x = b for a lower triangle L."""
    for i in range(n - 1, -1, -1):
        row = L + i * n
        b[i] /= row[i]
        add_scaled(-b[i], row, b, i)


# ---- products


def times_rows(C, count, n, width, x, out):
    """Set out = C x for `count` rows of n numbers, `width` of which count."""
    i: Py_ssize_t = 0
    while i + 4 <= count:
        row = C + i * n
        four_dots(x, row, row + n, row + 2 * n, row + 3 * n, width, out + i)
        i += 4
    while i < count:
        out[i] = dot(x, C + i * n, width)
        i += 1


def add_times_transposed(C, count, n, y, out):
    """Add C'y for `count` rows of n numbers, skipping the zeros of y."""
    for i in range(count):
        if y[i] != 0.0:
            add_scaled(y[i], C + i * n, out, n)


def times_triangle(V, n, x, out):
    """Set out = V x for a lower triangle V of order n, with zeros above."""
    for i in range(0, n, 4):
        end = min(i + 4, n)
        times_rows(V + i * n, end - i, n, end, x, out + i)


def times_triangle_transposed(V, n, v, out):
    """Set out = V'v for a lower triangle V of order n, with zeros above."""
    fill(out, 0.0, n)
    i: Py_ssize_t = 0
    while i + 4 <= n:
        row = V + i * n
        add_four(
            v[i], row, v[i + 1], row + n, v[i + 2], row + 2 * n, v[i + 3], row + 3 * n,
            out, i + 4,
        )  # fmt: skip
        i += 4
    while i < n:
        add_scaled(v[i], V + i * n, out, i + 1)
        i += 1


# ---- packed triangles


def triangle_solve(L, k, b):
    """Overwrite b (k,) by L^-1 b."""
    start: Py_ssize_t = 0
    for i in range(k):
        b[i] = (b[i] - dot(L + start, b, i)) / L[start + i]
        start += i + 1


def triangle_solve_transposed(L, k, b):
    """Overwrite b (k,) by L'^-1 b."""
    for i in range(k - 1, -1, -1):
        row = L + i * (i + 1) // 2
        b[i] /= row[i]
        add_scaled(-b[i], row, b, i)


def append_to_triangle(L, k, b, diagonal):
    """Add row and column k to S; b = L^-1 s for the new entries s of S."""
    row = L + k * (k + 1) // 2
    copy(b, row, k)
    row[k] = diagonal


def remove_from_triangle(L, k, leaving, cosines, sines):
    """Remove row and column `leaving` of k from S; the last two are work space."""
    for i in range(leaving, k - 1):
        row, below = L + i * (i + 1) // 2, L + (i + 1) * (i + 2) // 2
        copy(below, row, leaving)
        carried = below[leaving]
        for j in range(leaving, i):
            following = below[j + 1]
            row[j] = cosines[j] * carried + sines[j] * following
            carried = cosines[j] * following - sines[j] * carried
        following = below[i + 1]
        radius = sqrt(carried * carried + following * following)
        cosines[i], sines[i] = carried / radius, following / radius
        row[i] = radius
