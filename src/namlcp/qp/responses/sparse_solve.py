"""Sparse QPs with the same matrices, one after another, by responses."""

from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.linalg import SparseFactors, arrays_of, attach_factors, by_rows
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP
from namlcp.qp.responses.solve import Responses
from namlcp.qp.responses.sparse import attach_sparse, begin_anew, run_sparse
from namlcp.qp.responses.state import allocate
from namlcp.qp.transforms import equilibrate

# Most variables, rows and equations together: a response to a row has so many entries.
MOST_LENGTH = 20_000
# Entries of R and D, see `sparse`, for rows equilibrated to a largest entry of 1.
SHIFT = 1e-9
# Pivot of a variable, over its diagonal entry, below which P alone is too small: R = 0
# else.
LEAST_PIVOT = 1e-7
# Residuals of a solve with K, over the right-hand side: the one that has to be reached,
# the one at which it is not refined further. Passes of refinement at most, and the gain
# of one below which it was not worth it.
REACHED, ACCURATE, MOST_PASSES, GAIN = 1e-9, 1e-11, 4, 0.5
# Curvature of a row, in equilibrated units, over the largest one of a trial solve, up
# to which the equations fix the row.
FIXED = 1e-11
# Operations for each entry of K, G, L and a vector from which on another method is
# quicker: the interior-point method takes about a microsecond for an entry.
MOST_OPERATIONS = 2000.0


class SparseResponses(Responses):
    """What is kept for QPs with the same sparse P, G and A: see the door of this room.

    P is positive semidefinite. It need not be definite: it suffices that P and A
    together determine x.
    """

    kernel = staticmethod(run_sparse)
    kkt: KKT | None = None

    @classmethod
    def of(cls, qp: QP) -> "SparseResponses | None":
        """Return responses for the matrices of a QP.

        None if these are dense, or so large or full that other methods are quicker, or
        P and A do not determine x.
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
        self.kkt = kkt = KKT(P, by_rows(A), csr_array((0, n)), self.kkt)
        self.rows, self.rest = by_rows(G), np.empty(kkt.size)
        triangle = kkt.indptr, kkt.indices, kkt.base, self.rest
        given: Any = (n, m, p), triangle, arrays_of(self.rows)
        if not attach_sparse(self.state, *given):
            self.memory = allocate(self.now)
            attach_sparse(self.state, *given)
        factors = kkt.plan()
        if not isinstance(factors, SparseFactors):
            return
        unit = np.ones(kkt.size)  # of x and y; 1 / unit of the rows of K
        equilibrate(kkt.indptr, kkt.indices, kkt.base.copy(), unit)
        largest = self.factor_and_try(SHIFT / unit**2)
        if largest is None:
            return
        numbers = factors.values, factors.inverse, factors.work
        attach_factors(self.state, factors.pattern, numbers)
        norms = np.sqrt(self.rows.power(2) @ unit[:n] ** 2)
        norms[norms == 0.0] = 1.0
        begin_anew(self.state, 1.0 / np.append(norms, unit[:n]))
        entries = factors.values.size + kkt.base.size + self.rows.nnz + self.now.length
        self.now.most_operations = MOST_OPERATIONS * entries
        self.now.response_operations = 2.0 * (self.now.passes + 2) * entries
        self.now.least_curvature = FIXED * largest
        self.now.is_ready = 1

    def factor_and_try(self, shift: np.ndarray) -> float | None:
        """Factor K~ and choose the passes of refinement by a trial solve.

        `shift` are the diagonals of R and D. Returns the largest entry of the solution
        in equilibrated units; None where P and A do not allow accurate solves.
        """
        assert self.kkt is not None
        kkt, n = self.kkt, self.kkt.n
        kkt.data[:] = kkt.base
        kkt.data[kkt.diagonal[n:]] -= shift[n:]
        if not (kkt.factor() and self.least_pivot() >= LEAST_PIVOT):
            kkt.data[kkt.diagonal[:n]] += shift[:n]
            if not (kkt.factor() and self.least_pivot() > 0.0):
                return None
        upper = csc_array((kkt.base, kkt.indices, kkt.indptr), shape=2 * (kkt.size,))
        diagonal, lower = kkt.base[kkt.diagonal], upper.T
        # Entries of size 1 in equilibrated units, with signs that have no pattern.
        size = np.sqrt(shift / SHIFT)
        rhs = size * np.where(np.cos(np.arange(kkt.size)) > 0.0, 1.0, -1.0)
        u, error = np.zeros(kkt.size), 1.0
        passes = -1
        while error > ACCURATE and passes < MOST_PASSES:
            rest = rhs - (upper @ u + lower @ u - diagonal * u)
            other = u + kkt.plan().solve(rest)
            rest = rhs - (upper @ other + lower @ other - diagonal * other)
            new = float(np.abs(rest / size).max(initial=0.0))
            if not new < GAIN * error:
                break
            u, error = other, new
            passes += 1
        self.now.passes = max(passes, 0)
        if not error <= REACHED:
            return None
        return float(np.abs(u * size)[:n].max(initial=0.0))

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
