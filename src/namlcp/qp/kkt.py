"""The KKT matrix K, its varying diagonal and its L D L' factors.

        [P  A'  G']          [P + dx   A'   G']
    K = [A  0   0 ],   K~ =  [A       -dy    0],   dx, dy, dv > 0 (quasi-definite).
        [G  0   0 ]          [G        0   -dv]

K is kept as the upper triangle in CSC, so column n + i is row i of C = [A; G] and the
diagonal is the last entry of every column.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.checks import refuse_size
from namlcp.compiled import kernel
from namlcp.linalg import Factors, arrays_of, plan_factors


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

    def __init__(
        self, P: csc_array, A: csr_array, G: csr_array, last: "KKT | None" = None
    ) -> None:
        """Lay out K for P (both triangles stored), A and G.

        It shares the factors of `last` if that has the same pattern.
        """
        self.n = P.shape[0]
        self.size = self.n + A.shape[0] + G.shape[0]
        entries = P.nnz + A.nnz + G.nnz + self.size
        refuse_size("the KKT matrix", entries)
        self.indptr = np.empty(self.size + 1, dtype=np.int32)
        self.indices, self.base = np.empty(entries, dtype=np.int32), np.empty(entries)
        self.set_values(P, A, G)
        entries = self.indptr[-1]
        self.indices, self.base = self.indices[:entries], self.base[:entries]
        self.diagonal = self.indptr[1:] - 1
        self.data = np.empty(entries)
        self.factors: Factors | None = None
        self.factored = np.full(entries, np.nan)  # unlike any data
        if last is not None and (
            np.array_equal(last.indptr, self.indptr)
            and np.array_equal(last.indices, self.indices)
        ):
            self.factors, self.factored = last.factors, last.factored

    def set_values(self, P: csc_array, A: csr_array, G: csr_array) -> None:
        """Write pattern and values of K, not scaled."""
        matrices = map(arrays_of, (P, A, G))
        upper_triangle(*matrices, self.indptr, self.indices, self.base)

    def plan(self) -> Factors:
        """Return the factors, which are not computed yet if they are new."""
        if self.factors is None:
            self.factors = plan_factors(self.indptr, self.indices)
        return self.factors

    def factor(self) -> bool:
        """Factor K~; False if a pivot vanishes."""
        try:
            self.plan().refactor(self.data)
        except (RuntimeError, ValueError):
            return False
        return True


@kernel
def upper_triangle(P, A, G, indptr, indices, data):
    """Write the upper triangle of K from P in CSC (both triangles), A and G in CSR.

    indptr, indices and data take the triangle.
    """
    n = P.indptr.size - 1
    indptr[0] = 0
    k = 0
    for j in range(n):
        diagonal = 0.0
        for t in range(P.indptr[j], P.indptr[j + 1]):
            if P.indices[t] < j:
                indices[k] = P.indices[t]
                data[k] = P.data[t]
                k += 1
            elif P.indices[t] == j:
                diagonal = P.data[t]
        indices[k] = j
        data[k] = diagonal
        k += 1
        indptr[j + 1] = k
    column = n
    for C in (A, G):
        for i in range(C.indptr.size - 1):
            for t in range(C.indptr[i], C.indptr[i + 1]):
                indices[k] = C.indices[t]
                data[k] = C.data[t]
                k += 1
            indices[k] = column
            data[k] = 0.0
            k += 1
            column += 1
            indptr[column] = k
