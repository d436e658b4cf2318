"""The KKT matrix K, its varying diagonal and its L D L' factors.

        [P  A'  G']          [P + dx   A'   G']
    K = [A  0   0 ],   K~ =  [A       -dy    0],   dx, dy, dv > 0 (quasi-definite).
        [G  0   0 ]          [G        0   -dv]

K is kept as the upper triangle in CSC, so column n + i is row i of C = [A; G] and the
diagonal is the last entry of every column.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import sqrt
from cython.cimports.namlcp.limits import is_over
from cython.cimports.namlcp.linalg.arrays import numbers, places
from cython.cimports.namlcp.linalg.blas import (
    add_squares,
    blas_times,
    cholesky,
    cholesky_solve,
)
from cython.cimports.namlcp.linalg.csc import Columns, take_columns
from cython.cimports.namlcp.linalg.sparse_ldl import Factors
from cython.cimports.namlcp.linalg.vectors import copy, fill

from namlcp.checks import constant, refuse_size
from namlcp.limits import NEVER
from namlcp.linalg.factors import plan_factors

# Rows are condensed where they are as many as variables, and have this part of entries
# that are not zero.
FULL = 0.5


class KKT:
    """K for P (both triangles stored), A and G, with the factors of K~.

    indptr, indices, base: the upper triangle of K in CSC, all diagonal entries stored.
    data: the values of K~, of which the caller writes data[diagonal]. factored: the
    `data` that `factors` belong to; those of `last` if it has the same pattern. n,
    size: the orders of P and K.
    """

    def __init__(self, P, A, G, last=None):
        self.n = P.indptr.size - 1
        self.size = self.n + A.indptr.size + G.indptr.size - 2
        entries = P.data.size + A.data.size + G.data.size + self.size
        refuse_size("the KKT matrix", entries)
        self.indptr = np.empty(self.size + 1, dtype=np.int32)
        self.indices, self.base = np.empty(entries, dtype=np.int32), np.empty(entries)
        upper_triangle(P, A, G, self.indptr, self.indices, self.base)
        entries = self.indptr[self.size]
        self.indices, self.base = self.indices[:entries], self.base[:entries]
        self.diagonal = self.indptr[1:] - 1
        self.data = np.empty(entries)
        self.factors = None
        self.factored = constant(entries, np.nan)  # unlike any data
        if last is not None and (
            np.array_equal(last.indptr, self.indptr)
            and np.array_equal(last.indices, self.indices)
        ):
            self.factors, self.factored = last.factors, last.factored

    def plan(self, condense=False, deadline=NEVER):
        """Return the factors, which are not computed yet if they are new.

        With `condense`, K~ is definite in its first n rows and negative definite in the
        others. Raises OutOfTime.
        """
        if self.factors is None:
            n, rows = self.n, self.size - self.n
            entries = self.indptr[self.size] - self.indptr[n] - rows
            if condense and n <= rows and entries >= FULL * n * rows:
                self.factors = Condensed(self.indptr, self.indices, n)
            else:
                self.factors = plan_factors(self.indptr, self.indices, deadline)
        return self.factors

    def factor(self):
        """Factor K~; False if a pivot vanishes."""
        try:
            self.plan().refactor(self.data)
        except (RuntimeError, ValueError):
            return False
        return True


class Condensed(Factors):
    """K~ with full rows by the Cholesky factor of S = P + dx + R'R, R = D C.

    D^2 = 1 / (dy, dv).
    """

    def __init__(self, indptr, indices, n):
        Factors.__init__(self, indptr)
        rows = self.n - n
        self.width, self.entries = n, n * self.n
        parts = np.empty(n * n), np.zeros(rows * n), np.empty((3, self.n))
        self.arrays = indptr, indices, *parts
        self.indptr = places(indptr, self.n + 1)
        self.indices = places(indices, self.nnz)
        self.S, self.R = numbers(parts[0], n * n), numbers(parts[1], rows * n)
        self.D, self.y = numbers(parts[2][0], self.n), numbers(parts[2][1], self.n)
        self.u = numbers(parts[2][2], self.n)

    def factor_values(self, data, watch):
        n, S, R, D, indptr = self.width, self.S, self.R, self.D, self.indptr
        rows = self.n - n
        fill(S, 0.0, n * n)
        for j in range(n):
            for t in range(indptr[j], indptr[j + 1]):
                S[j * n + self.indices[t]] = data[t]
        for i in range(rows):
            last = indptr[n + i + 1] - 1
            D[i] = sqrt(-1.0 / data[last])
            for t in range(indptr[n + i], last):
                R[i * n + self.indices[t]] = D[i] * data[t]
        first: Py_ssize_t = 0
        while first < rows:
            count = min(BLOCK, rows - first)
            if is_over(watch, count * n * n):
                return False
            add_squares(R + first * n, count, n, S)
            first += count
        return cholesky(S, n)

    def solve_into(self, rhs, x):
        n, rows, D, y, u = self.width, self.n - self.width, self.D, self.y, self.u
        for i in range(rows):
            y[i] = D[i] * rhs[n + i]
        blas_times(self.R, rows, n, y, u, b"N")
        for j in range(n):
            u[j] += rhs[j]
        cholesky_solve(self.S, n, u)
        copy(u, x, n)
        blas_times(self.R, rows, n, x, u, b"T")
        for i in range(rows):
            x[n + i] = D[i] * (u[i] - y[i])


def upper_triangle(P, A, G, indptr, indices, data):
    """Write the upper triangle of K from P in CSC (both triangles), A and G in CSR."""
    M: Columns
    n: Py_ssize_t = P.indptr.size - 1
    column, k = n, cython.cast(Py_ssize_t, 0)
    take_columns(P, n, cython.address(M))
    indptr[0] = 0
    for j in range(n):
        diagonal = 0.0
        for t in range(M.indptr[j], M.indptr[j + 1]):
            if M.indices[t] < j:
                indices[k], data[k] = M.indices[t], M.data[t]
                k += 1
            elif M.indices[t] == j:
                diagonal = M.data[t]
        indices[k], data[k] = j, diagonal
        k += 1
        indptr[j + 1] = k
    for C in (A, G):
        rows: Py_ssize_t = C.indptr.size - 1
        take_columns(C, rows, cython.address(M))  # the columns of C'
        for i in range(rows):
            for t in range(M.indptr[i], M.indptr[i + 1]):
                indices[k], data[k] = M.indices[t], M.data[t]
                k += 1
            indices[k], data[k] = column, 0.0
            k += 1
            column += 1
            indptr[column] = k
    return 0
