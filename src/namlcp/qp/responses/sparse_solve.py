"""Sparse QPs with the same matrices, one after another, by responses."""

from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.linalg import SparseFactors, arrays_of, attach_factors, by_rows
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP
from namlcp.qp.responses.solve import Responses
from namlcp.qp.responses.sparse import SHIFT
from namlcp.qp.responses.sparse_run import attach_sparse, run_sparse
from namlcp.qp.responses.state import allocate
from namlcp.qp.transforms import equilibrate

# Most variables, rows and equations together: a response to a row has so many entries.
MOST_LENGTH = 20_000


class SparseResponses(Responses):
    """What is kept for QPs with the same sparse P, G and A: see the door of this room.

    P is positive semidefinite. It need not be definite: it suffices that P and A
    together determine x.
    """

    kernel = staticmethod(run_sparse)

    @classmethod
    def of(cls, qp: QP) -> "SparseResponses | None":
        """Return responses for the matrices of a QP.

        None if these are dense, or so large or full that other methods are quicker.
        """
        n, m, p = qp.q.size, qp.h.size, qp.b.size
        if qp.is_dense or p > n or n + m + p > MOST_LENGTH:
            return None
        found = cls(qp.P, qp.G, qp.A)
        return found if isinstance(found.kkt.factors, SparseFactors) else None

    def attach(self, P: csc_array, G: csc_array, A: csc_array) -> None:
        """Take matrices, and memory for them; the same pattern as before saves time."""
        self.matrices = P, G, A
        n, m, p = P.shape[0], G.shape[0], A.shape[0]
        no_rows = csr_array((0, n))
        self.kkt = KKT(P, by_rows(A), no_rows, getattr(self, "kkt", None))
        kkt, factors = self.kkt, self.kkt.plan()
        if not isinstance(factors, SparseFactors):
            return
        scale = np.ones(kkt.size)
        equilibrate(kkt.indptr, kkt.indices, kkt.base.copy(), scale)
        self.vectors = SHIFT / scale**2, np.empty(kkt.size)
        self.rows = arrays_of(by_rows(G))
        numbers = factors.values, factors.inverse, factors.work
        attach_factors(self.state, factors.pattern, numbers)
        triangle = kkt.indptr, kkt.indices, kkt.base, kkt.data
        given: Any = (n, m, p), triangle, self.vectors, self.rows
        if not attach_sparse(self.state, *given):
            self.memory = allocate(self.now)
            attach_sparse(self.state, *given)
