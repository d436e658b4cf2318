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
from cython.cimports.namlcp.linalg.csc import Columns, take_columns

from namlcp.checks import constant, refuse_size
from namlcp.linalg import plan_factors


class KKT:
    """K with the factors of K~.

    Attributes
    ----------
    indptr, indices, base : upper triangle of K in CSC, all diagonal entries stored
    data : values of K~; the caller writes its diagonal, data[diagonal]
    diagonal : positions of the diagonal entries in `base` and `data`
    factored : the `data` that `factors` belong to
    n, size : order of P; order of K
    """

    def __init__(self, P, A, G, last=None):
        """Lay out K for P (both triangles stored), A and G.

        It shares the factors of `last` if that has the same pattern.
        """
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

    def plan(self):
        """Return the factors, which are not computed yet if they are new."""
        if self.factors is None:
            self.factors = plan_factors(self.indptr, self.indices)
        return self.factors

    def factor(self):
        """Factor K~; False if a pivot vanishes."""
        try:
            self.plan().refactor(self.data)
        except (RuntimeError, ValueError):
            return False
        return True


def upper_triangle(P, A, G, indptr, indices, data):
    """Write the upper triangle of K from P in CSC (both triangles), A and G in CSR.

    indptr, indices and data take the triangle.
    """
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
