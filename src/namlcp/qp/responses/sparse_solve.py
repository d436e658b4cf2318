"""Sparse QPs with the same matrices, one after another, by responses."""

from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.limits import Deadline
from namlcp.linalg import SparseFactors, arrays_of, attach_factors, by_rows
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP
from namlcp.qp.responses.run import (
    OTHER_WEIGHT,
    attach_sparse,
    begin_anew,
    run_sparse,
    try_factors,
)
from namlcp.qp.responses.solve import Responses
from namlcp.qp.responses.state import allocate
from namlcp.qp.responses.weight import LEAST_SHAPE
from namlcp.qp.transforms import equilibrate

# Most variables, rows and equations together: a response to a row has so many entries.
MOST_LENGTH = 20_000
# Entries of R and D, see `sparse`, for rows equilibrated to a largest entry of 1.
SHIFT = 1e-9
# Pivot of a variable, over its diagonal entry, below which P alone is too small: R = 0
# else.
LEAST_PIVOT = 1e-7
# Residual of a solve with K, over the right-hand side, that has to be reached.
REACHED = 1e-9
# Curvature of a row, in equilibrated units, over the largest one of a trial solve, up
# to which the equations fix the row.
FIXED = 1e-11
# Operations for each entry of K, G, L and a vector from which on another method is
# quicker: the interior-point method takes about a microsecond for an entry.
MOST_OPERATIONS = 2000.0


class SparseResponses(Responses):
    """What is kept for QPs with the same sparse P, G and A: see the door of this room.

    P is positive semidefinite. Where P and A together do not determine x, P + W takes
    the place of P, see `weight`.
    """

    kernel = staticmethod(run_sparse)
    kkt: KKT | None = None

    @classmethod
    def of(cls, qp: QP) -> "SparseResponses | None":
        """Return responses for the matrices of a QP.

        None if these are dense, or so large or full that other methods are quicker.
        """
        n, m, p = qp.q.size, qp.h.size, qp.b.size
        if qp.is_dense or p > n or n + m + p > MOST_LENGTH:
            return None
        found = cls(qp.P, qp.G, qp.A)
        return found if found.now.is_ready else None

    def attach(self, P: csc_array, G: csc_array, A: csc_array) -> None:
        """Take matrices, and what depends on them: factors, units, memory.

        The same pattern as before saves time.
        """
        super().attach(P, G, A)
        n, m, p = P.shape[0], G.shape[0], A.shape[0]
        self.rows, self.equations = by_rows(G), by_rows(A)
        self.kkt = kkt = KKT(P, self.equations, csr_array((0, n)), self.kkt)
        self.rest = np.empty(kkt.size)
        triangle = kkt.indptr, kkt.indices, kkt.base, self.rest
        given: Any = (n, m, p), triangle, arrays_of(self.rows)
        if not attach_sparse(self.state, *given):
            self.memory = allocate(self.now)
            attach_sparse(self.state, *given)
        factors = kkt.plan()
        if not isinstance(factors, SparseFactors):
            return
        self.unit = unit = np.ones(kkt.size)  # of x and y; 1 / unit of the rows of K
        equilibrate(kkt.indptr, kkt.indices, kkt.base.copy(), unit)
        entries = factors.values.size + kkt.base.size + self.rows.nnz + self.now.length
        self.now.most_operations = MOST_OPERATIONS * entries
        numbers = factors.values, factors.inverse, factors.work
        attach_factors(self.state, factors.pattern, numbers)
        self.now.is_ready = 1
        self.is_slow_anew = not self.factor_and_try()
        if not self.is_slow_anew:
            self.begin(unit[:n] ** 2, np.zeros(n))
        else:
            diagonal = kkt.base[kkt.diagonal[:n]].copy()
            self.now.largest = largest = diagonal.max(initial=0.0)
            positive = diagonal > LEAST_SHAPE * largest
            mean = np.exp(np.log(diagonal[positive]).mean()) if positive.any() else 1.0
            self.cost, self.shape = diagonal, np.where(positive, diagonal, mean)
            self.begin(1.0 / self.shape, np.zeros(n))
            self.now.rho = np.inf  # the first solve chooses it

    def begin(self, metric: np.ndarray, weight: np.ndarray) -> None:
        """Note W, and the norms of rows in units of x, squared; forget responses."""
        rows, equations = (moduli(C, metric) for C in (self.rows, self.equations))
        scale = 1.0 / np.sqrt(np.append(rows, metric))
        begin_anew(self.state, scale, 1.0 / np.sqrt(equations), weight)

    def call(self, arguments: tuple[Any, ...], deadline: Deadline) -> int:
        """Call the kernel; if it asks for another W, factor P + W and call it again."""
        code = super().call(arguments, deadline)
        if code != OTHER_WEIGHT:
            return code
        assert self.kkt is not None
        kkt, weight = self.kkt, self.now.rho * self.shape
        kkt.base[kkt.diagonal[: kkt.n]] = self.cost + weight
        self.now.is_ready = self.factor_and_try()
        self.begin(1.0 / self.shape, weight)
        return super().call(arguments, deadline)

    def factor_and_try(self) -> bool:
        """Factor K~ and choose the passes of refinement by a trial solve.

        False where P and A do not allow accurate solves.
        """
        assert self.kkt is not None
        kkt, n, shift = self.kkt, self.kkt.n, SHIFT / self.unit**2
        kkt.data[:] = kkt.base
        kkt.data[kkt.diagonal[n:]] -= shift[n:]
        if not (kkt.factor() and self.least_pivot() >= LEAST_PIVOT):
            kkt.data[kkt.diagonal[:n]] += shift[:n]
            if not (kkt.factor() and self.least_pivot() > 0.0):
                return False
        # Entries of size 1 in equilibrated units, with signs that have no pattern.
        size = np.sqrt(shift / SHIFT)
        rhs = size * np.where(np.cos(np.arange(kkt.size)) > 0.0, 1.0, -1.0)
        error, largest = try_factors(self.state, rhs, size)
        self.now.least_curvature = FIXED * largest
        entries = self.now.most_operations / MOST_OPERATIONS
        self.now.response_operations = 2.0 * (self.now.passes + 2) * entries
        return bool(error <= REACHED)

    def least_pivot(self) -> float:
        """Return the least pivot of a variable over its diagonal entry of K~.

        -1 where a pivot has not the sign that it has in a quasi-definite matrix.
        """
        assert self.kkt is not None
        kkt, factors = self.kkt, self.kkt.plan()
        assert isinstance(factors, SparseFactors)
        inverse = factors.inverse[factors.order.place]
        if np.any(inverse[: kkt.n] <= 0.0) or np.any(inverse[kkt.n :] >= 0.0):
            return -1.0
        ratio = inverse[: kkt.n] * kkt.data[kkt.diagonal[: kkt.n]]
        return 1.0 / float(ratio.max(initial=1.0))


def moduli(C: csr_array, metric: np.ndarray) -> np.ndarray:
    """Return the sums of C_ij^2 metric_j over the rows of C, 1 for an empty row."""
    row = np.repeat(np.arange(C.shape[0]), np.diff(C.indptr))
    found = np.bincount(row, C.data**2 * metric[C.indices], C.shape[0])
    return np.where(found > 0.0, found, 1.0)
