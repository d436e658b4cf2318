"""BLAS and LAPACK, as SciPy offers them, on row-major matrices at pointers.

A row-major matrix is the transpose of a column-major one, which BLAS sees.
"""

import cython
from cython import p_double
from cython.cimports.namlcp.linalg.vectors import fill
from cython.cimports.scipy.linalg.cython_blas import ddot, dgemm, dgemv, dtrsm
from cython.cimports.scipy.linalg.cython_lapack import (
    dgetrf,
    dgetrs,
    dpotrf,
    dpotrs,
    dtrtri,
)


def _times(letter, C, count, n, x, out, size):
    rows: cython.int = count
    columns: cython.int = n
    step: cython.int = 1
    one: cython.double = 1.0
    zero: cython.double = 0.0
    fill(out, 0.0, size)
    if count > 0 and n > 0:
        dgemv(
            cython.address(letter), cython.address(columns), cython.address(rows),
            cython.address(one), cython.cast(p_double, C), cython.address(columns),
            cython.cast(p_double, x), cython.address(step), cython.address(zero), out,
            cython.address(step),
        )  # fmt: skip


def blas_times(C, count, n, x, out):
    """Set out = C x for `count` rows of n numbers."""
    _times(b"T", C, count, n, x, out, count)


def blas_times_transposed(C, count, n, x, out):
    """Set out = C'x."""
    _times(b"N", C, count, n, x, out, n)


def blas_dot(a, b, n):
    """Return a'b with the sum of BLAS."""
    size: cython.int = n
    step: cython.int = 1
    return ddot(
        cython.address(size), cython.cast(p_double, a), cython.address(step),
        cython.cast(p_double, b), cython.address(step),
    )  # fmt: skip


def cholesky(A, n):
    """Overwrite the lower triangle of A by its Cholesky factor; False if it has none.

    The upper triangle is neither read nor written.
    """
    order: cython.int = n
    info: cython.int = 0
    if n > 0:
        dpotrf(
            b"U", cython.address(order), A, cython.address(order),
            cython.address(info),
        )  # fmt: skip
    return info == 0


def cholesky_solve(L, n, b):
    """Overwrite b (n,) by the solution of L L'x = b."""
    order: cython.int = n
    one: cython.int = 1
    info: cython.int = 0
    if n > 0:
        dpotrs(
            b"U", cython.address(order), cython.address(one),
            cython.cast(p_double, L), cython.address(order), b, cython.address(order),
            cython.address(info),
        )  # fmt: skip


def lu(A, n, pivots):
    """Overwrite A, column by column, by its LU factors; False if a pivot is 0."""
    order: cython.int = n
    info: cython.int = 0
    if n > 0:
        dgetrf(
            cython.address(order), cython.address(order), A, cython.address(order),
            pivots, cython.address(info),
        )  # fmt: skip
    return info == 0


def lu_solve(factors, n, pivots, b):
    """Overwrite b (n,) by the solution of A x = b, with factors from `lu`."""
    order: cython.int = n
    one: cython.int = 1
    info: cython.int = 0
    if n > 0:
        dgetrs(
            b"N", cython.address(order), cython.address(one),
            cython.cast(p_double, factors), cython.address(order),
            cython.cast(cython.p_int, pivots), b, cython.address(order),
            cython.address(info),
        )  # fmt: skip


def solve_rows(L, n, X, count):
    """Overwrite `count` rows X of n numbers by X L'^-1 for a lower triangle L."""
    order: cython.int = n
    rows: cython.int = count
    one: cython.double = 1.0
    if n > 0 and count > 0:
        dtrsm(
            b"L", b"U", b"T", b"N", cython.address(order), cython.address(rows),
            cython.address(one), cython.cast(p_double, L), cython.address(order), X,
            cython.address(order),
        )  # fmt: skip


def invert_lower(L, n):
    """Overwrite a lower triangle by its inverse."""
    order: cython.int = n
    info: cython.int = 0
    if n > 0:
        dtrtri(
            b"U", b"N", cython.address(order), L,
            cython.address(order), cython.address(info),
        )  # fmt: skip


def _multiply(letter, A, B, C, rows, columns, inner):
    m: cython.int = columns
    n: cython.int = rows
    k: cython.int = inner
    width: cython.int = inner if letter == b"T" else columns
    one: cython.double = 1.0
    zero: cython.double = 0.0
    if rows > 0 and columns > 0 and inner > 0:
        dgemm(
            cython.address(letter), b"N", cython.address(m),
            cython.address(n), cython.address(k), cython.address(one),
            cython.cast(p_double, B), cython.address(width), cython.cast(p_double, A),
            cython.address(k), cython.address(zero), C, cython.address(m),
        )  # fmt: skip


def times_transposed(A, B, C, rows, columns, inner):
    """Set C = A B' for A (rows, inner) and B (columns, inner)."""
    _multiply(b"T", A, B, C, rows, columns, inner)


def times(A, B, C, rows, columns, inner):
    """Set C = A B for A (rows, inner) and B (inner, columns)."""
    _multiply(b"N", A, B, C, rows, columns, inner)
