"""BLAS and LAPACK, as SciPy offers them, on row-major matrices at pointers.

A row-major matrix is the transpose of a column-major one, which BLAS sees. A C `int` is
passed on by its address.
"""

import cython
from cython import address, cast, p_double
from cython.cimports.scipy.linalg.cython_blas import (
    ddot,
    dgemv,
    dsyrk,
    dtrmm,
    dtrsm,
)
from cython.cimports.scipy.linalg.cython_lapack import (
    dgetrf,
    dgetrs,
    dpotrf,
    dtrtri,
)


def blas_times(C, rows, columns, x, out, letter):
    """Set out = C x ("T", as BLAS sees C') or C'x ("N")."""
    step: cython.int = 1
    one: cython.double = 1.0
    zero: cython.double = 0.0
    fill(out, 0.0, rows if letter == b"T" else columns)
    if rows > 0 and columns > 0:
        dgemv(
            address(letter), address(columns), address(rows), address(one),
            cast(p_double, C), address(columns), cast(p_double, x), address(step),
            address(zero), out, address(step),
        )  # fmt: skip


def blas_dot(a, b, n):
    """Return a'b with the sum of BLAS."""
    step: cython.int = 1
    return ddot(
        address(n), cast(p_double, a), address(step), cast(p_double, b), address(step)
    )


def cholesky(A, n):
    """Overwrite the lower triangle of A by its Cholesky factor; False if it has none.

    The upper triangle is neither read nor written.
    """
    info: cython.int = 0
    if n > 0:
        dpotrf(b"U", address(n), A, address(n), address(info))
    return info == 0


def lu(A, n, pivots):
    """Overwrite A, column by column, by its LU factors; False if a pivot is 0."""
    info: cython.int = 0
    if n > 0:
        dgetrf(address(n), address(n), A, address(n), pivots, address(info))
    return info == 0


def lu_solve(factors, n, pivots, b):
    """Overwrite b (n,) by the solution of A x = b, with factors from `lu`."""
    one: cython.int = 1
    info: cython.int = 0
    if n > 0:
        dgetrs(
            b"N", address(n), address(one), cast(p_double, factors), address(n),
            cast(cython.p_int, pivots), b, address(n), address(info),
        )  # fmt: skip


def solve_rows(L, n, X, count):
    """Overwrite `count` rows X of n numbers by X L'^-1 for a lower triangle L."""
    one: cython.double = 1.0
    if n > 0 and count > 0:
        dtrsm(
            b"L", b"U", b"T", b"N", address(n), address(count), address(one),
            cast(p_double, L), address(n), X, address(n),
        )  # fmt: skip


def times_lower(X, count, width, V, n, letter):
    """Overwrite `count` rows X of n numbers by X V ("N") or X V' ("T"), V lower.

    They begin `width` numbers apart.
    """
    one: cython.double = 1.0
    if n > 0 and count > 0:
        dtrmm(
            b"L", b"U", address(letter), b"N", address(n), address(count),
            address(one), cast(p_double, V), address(n), X, address(width),
        )  # fmt: skip


def invert_lower(L, n):
    """Overwrite a lower triangle by its inverse."""
    info: cython.int = 0
    if n > 0:
        dtrtri(b"U", b"N", address(n), L, address(n), address(info))


def add_gram(X, rows, n, width, letter, beta, W, width_W):
    """Set the lower triangle of W to beta W + X X' ("T", as BLAS sees X) or X'X ("N").

    The rows of X (rows, n) and of W begin so many numbers apart.
    """
    one: cython.double = 1.0
    order = rows if letter == b"T" else n
    inner = n if letter == b"T" else rows
    if rows > 0 and n > 0:
        dsyrk(
            b"U", address(letter), address(order), address(inner), address(one),
            cast(p_double, X), address(width), address(beta), W, address(width_W),
        )  # fmt: skip
