"""Matrices of records: products, and the triangles L of factors S = L L'.

A matrix lies at an address, row by row. The factor of the active rows gains and loses
rows, and is packed without its zeros: row i begins at i (i + 1) / 2. Removing a row and
column of S leaves L with one entry too many in each later row, which Givens rotations
of its columns take away (Gill, Golub, Murray and Saunders, Math. Comp. 28 (1974)
505-535, method C1 in the form for L).
"""

import numpy as np

from namlcp.compiled import floats, part
from namlcp.linalg import add_scaled, dot

# The diagonal entry of L for a row that depends on those before it.
HUGE = 1e100


@part
def row_of(address, i, n):
    """Return row i of a row-major matrix with n columns."""
    return floats(address + 8 * n * i, n)


@part
def factor_in_place(address, n, least):
    """Overwrite the lower triangle of a matrix S by its Cholesky factor L.

    A row whose pivot is at most `least` times its diagonal entry depends on those
    before it, and becomes (0, ..., 0, HUGE). Returns how many rows do.
    """
    dependent = 0
    for i in range(n):
        row = row_of(address, i, n)
        for j in range(i):
            other = row_of(address, j, n)
            row[j] = (row[j] - dot(other[:j], row[:j])) / other[j]
        pivot = row[i] - dot(row[:i], row[:i])
        if pivot > least * row[i]:
            row[i] = np.sqrt(pivot)
        else:
            dependent += 1
            for j in range(i):
                row[j] = 0.0
            row[i] = HUGE
    return dependent


@part
def invert_triangle(address, n):
    """Overwrite a lower triangular L by L^-1, with zeros above its diagonal."""
    for i in range(n):
        row = row_of(address, i, n)
        pivot = 1.0 / row[i]
        for j in range(i):
            factor, other = row[j], row_of(address, j, n)
            row[j] = 0.0
            add_scaled(factor, other[: j + 1], row[: j + 1])
        for j in range(i):
            row[j] *= -pivot
        row[i] = pivot
        for j in range(i + 1, n):
            row[j] = 0.0


# ---- products


@part(fastmath={"reassoc"})
def four_dots(row, a, b, c, d):
    """Return the products of `row` with four vectors."""
    first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
    for j in range(row.size):
        first += row[j] * a[j]
        second += row[j] * b[j]
        third += row[j] * c[j]
        fourth += row[j] * d[j]
    return first, second, third, fourth


@part
def add_four_scaled(factor, a, b, c, d, out):
    """Add a, b, c and d times the first four factors to out."""
    fa, fb, fc, fd = factor[0], factor[1], factor[2], factor[3]
    for j in range(out.size):
        out[j] += (fa * a[j] + fb * b[j]) + (fc * c[j] + fd * d[j])


@part
def times_rows(address, count, n, x, out):
    """Set out = C x for the `count` rows of a matrix C with n columns, four at once."""
    i = 0
    while i + 4 <= count:
        a, b = row_of(address, i, n), row_of(address, i + 1, n)
        c, d = row_of(address, i + 2, n), row_of(address, i + 3, n)
        out[i], out[i + 1], out[i + 2], out[i + 3] = four_dots(x, a, b, c, d)
        i += 4
    while i < count:
        out[i] = dot(x, row_of(address, i, n))
        i += 1


@part
def times_triangle(address, n, x, out):
    """Set out = V x for a lower triangle V of order n, with zeros above."""
    for i in range(0, n, 4):
        end = min(i + 4, n)
        times_rows(address + 8 * n * i, end - i, n, x[:end], out[i:])


@part
def times_triangle_transposed(address, n, v, out):
    """Set out = V'v for a lower triangle V of order n, with zeros above."""
    for j in range(n):
        out[j] = 0.0
    i = 0
    while i + 4 <= n:
        a, b = row_of(address, i, n), row_of(address, i + 1, n)
        c, d = row_of(address, i + 2, n), row_of(address, i + 3, n)
        add_four_scaled(v[i:], a, b, c, d, out[: i + 4])
        i += 4
    while i < n:
        add_scaled(v[i], row_of(address, i, n), out[: i + 1])
        i += 1


# ---- packed triangles


@part
def triangle_solve(L, k, b):
    """Overwrite b (k,) by L^-1 b."""
    start = 0
    for i in range(k):
        b[i] = (b[i] - dot(L[start : start + i], b[:i])) / L[start + i]
        start += i + 1


@part
def triangle_solve_transposed(L, k, b):
    """Overwrite b (k,) by L'^-1 b."""
    for i in range(k - 1, -1, -1):
        start = i * (i + 1) // 2
        b[i] /= L[start + i]
        add_scaled(-b[i], L[start : start + i], b[:i])


@part
def append_to_triangle(L, k, b, diagonal):
    """Add row and column k to S; b = L^-1 s for the new entries s of S."""
    start = k * (k + 1) // 2
    for j in range(k):
        L[start + j] = b[j]
    L[start + k] = diagonal


@part
def remove_from_triangle(L, k, leaving, cosines, sines):
    """Remove row and column `leaving` of k from S; the last two are work space."""
    for i in range(leaving, k - 1):
        row, below = i * (i + 1) // 2, (i + 1) * (i + 2) // 2
        for j in range(leaving):
            L[row + j] = L[below + j]
        carried = L[below + leaving]
        for j in range(leaving, i):
            following = L[below + j + 1]
            L[row + j] = cosines[j] * carried + sines[j] * following
            carried = cosines[j] * following - sines[j] * carried
        following = L[below + i + 1]
        radius = np.sqrt(carried * carried + following * following)
        cosines[i], sines[i] = carried / radius, following / radius
        L[row + i] = radius
