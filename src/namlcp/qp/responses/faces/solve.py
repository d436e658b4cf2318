"""QPs with matrices of one pattern, one after another, by faces."""

import ctypes
from math import inf
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from namlcp.checks import as_sparse
from namlcp.compiled import new_record
from namlcp.limits import Deadline, Limits
from namlcp.linalg import SparseFactors, attach_factors, by_rows
from namlcp.qp.guess import Guess
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP
from namlcp.qp.responses.active import STUCK
from namlcp.qp.responses.faces.run import MOST_FACES, begin_at, run_faces
from namlcp.qp.responses.faces.state import FaceState, allocate
from namlcp.qp.responses.solve import NO_NUMBERS, Responses
from namlcp.qp.transforms import equilibrate

# Solves and products of a face, in passes over the entries of K and L.
PASSES = 20.0
# Most variables, rows and equations together of a QP with dense matrices: other methods
# make more of these.
MOST_DENSE = 150


class Faces(Responses):
    """What is kept for QPs with matrices of one pattern: see the door.

    It solves nothing before `suggest` has told it of a solution. The zeros of dense
    matrices are left out.
    """

    kernel = staticmethod(run_faces)
    form = "face"
    kkt: Any = None  # a `KKT`
    attached: tuple[Any, Any, Any] = (None, None, None)  # P, G and A in it

    @classmethod
    def of(cls, qp: QP) -> "Faces | None":
        """Return what keeps faces for the matrices of a QP; None if large and dense."""
        order = qp.q.size + qp.h.size + qp.b.size
        if qp.is_dense and order > MOST_DENSE:
            return None
        return cls(qp.P, qp.G, qp.A)

    def __init__(self, P: Any, G: Any, A: Any) -> None:
        """Note the matrices; the first solve computes what depends on them."""
        self.now, self.state = new_record(FaceState)
        self.address = ctypes.addressof(self.now)
        self.matrices, self.is_stale = (P, G, A), True
        self.hint: Guess | None = None
        self.is_begun = False  # whether there is a point to begin with

    @property
    def are_unsuited(self) -> bool:
        """Tell whether the last solve found that the matrices are not suited."""
        return not (self.is_stale or self.now.is_ready)

    @property
    def step_work(self) -> float:
        """Operations of a solve on another face than the last; lays out its factors."""
        if self.is_stale:
            self.attach_anew()
        return self.now.face_work if self.now.is_ready else inf

    def attach(self, P: Any, G: Any, A: Any) -> None:
        """Take matrices, in the order found before if their pattern is the same."""
        super().attach(P, G, A)
        before, self.attached = self.attached, (P, G, A)
        if before[1] is G and before[2] is A and has_indices_of(P, before[0]):
            self.kkt.set_values(P, *self.rows)
        else:
            self.lay_out(*map(as_sparse, (P, G, A)))
        if self.now.is_ready:
            kkt = self.kkt
            kkt.data[:] = kkt.base
            self.unit[:] = 1.0
            equilibrate(kkt.indptr, kkt.indices, kkt.data, self.unit)
            kkt.data[:] = kkt.base
            self.now.is_factored = 0

    def lay_out(self, P: csc_array, G: csc_array, A: csc_array) -> None:
        """Make the KKT matrix, and a place for its factors."""
        now = self.now
        self.rows = by_rows(A), by_rows(G)
        kkt = self.kkt = KKT(P, *self.rows, self.kkt)
        factors = kkt.plan()
        now.is_ready = isinstance(factors, SparseFactors)
        if not isinstance(factors, SparseFactors):
            return
        if now.size == 0:
            now.n, now.m, now.p = P.shape[0], G.shape[0], A.shape[0]
            now.rows, now.size = now.n + now.m, kkt.size
            self.memory, self.unit = allocate(now)
        entries = kkt.base.size + factors.values.size
        now.face_work = factors.order.work + PASSES * entries
        numbers = factors.values, factors.inverse, factors.work
        attach_factors(self.state, factors.pattern, numbers)
        for name in ("indptr", "indices", "base", "data"):
            setattr(now, name, getattr(kkt, name).ctypes.data)

    def attach_anew(self) -> None:
        """Take the matrices that `renew` has noted; the last point stays the start."""
        left = self.left
        self.attach(*self.matrices)
        self.left = left

    def suggest(self, guess: Guess) -> None:
        """Let the next solve begin with this point and these active rows."""
        self.hint, self.is_begun = guess, True

    def run(self, vectors: np.ndarray, limits: Limits) -> tuple[int, np.ndarray]:
        """Do as `Responses.run`, from the last point."""
        return super().run(vectors, limits) if self.is_begun else (STUCK, NO_NUMBERS)

    def call(self, arguments: tuple[Any, ...], deadline: Deadline) -> int:
        """Call the kernel; return its code."""
        if self.hint is not None and self.now.is_ready:
            x, y, z, _, active = self.hint
            begin_at(self.address, x, y, z, active)
            self.hint = None
        return deadline.run(self.kernel, MOST_FACES * self.now.face_work, *arguments)


def has_indices_of(P: Any, other: Any) -> bool:
    """Tell whether two matrices are CSC arrays that share their indices."""
    return (
        type(P) is type(other) is csc_array
        and P.indices is other.indices
        and P.indptr is other.indptr
    )
