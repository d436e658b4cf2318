"""Dense QPs with the same matrices, one after another, by responses."""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.answer import Answer, proved
from namlcp.qp.certificates import accept_primal
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point
from namlcp.qp.responses.active import CONTRADICTION, DONE, LATE, STUCK
from namlcp.qp.responses.course import SUMMED
from namlcp.qp.responses.judgement import NUMBERS
from namlcp.qp.responses.run import (
    attach_matrices,
    run,
    take_hint,
)
from namlcp.qp.responses.state import allocate, new_state
from namlcp.residuals import Residuals, qp_residuals
from namlcp.status import Status

SOLVED = Status.SOLVED
# Codes of kernels after which there is a point or a candidate for a certificate.
JUDGED = (DONE, SUMMED, LATE, CONTRADICTION)
# Most variables, equations and rows of a QP that is solved by responses.
MOST_ORDER = 900
# Spaces of one-shot solves that have ended, for the next ones: making one takes as long
# as a tiny QP. At most so many numbers each are kept.
POOL: list["DenseResponses"] = []
MOST_POOLED = 1_000_000
# Solves that are left to other methods without trying, after 1, 2, ... were tried in a
# row and left to these.
PAUSES = 0, 1, 3, 7, 15


def solve_once(qp: QP, guess: Guess, limits: Limits) -> Answer | None:
    """Solve one dense QP; None where another method has to."""
    if qp.q.size + qp.h.size + qp.b.size > MOST_ORDER:
        return None
    limits.announce(run)
    try:
        space = POOL.pop()
        space.attach(qp.P, qp.G, qp.A)
        space.pause = 0
    except IndexError:
        space = DenseResponses(qp.P, qp.G, qp.A)
        space.now.is_single = True
    if guess.active.size:
        space.suggest(guess.active)
    found = space.solve(qp.q, qp.h, qp.b, qp.lb, qp.ub, limits)
    if space.memory.size <= MOST_POOLED:
        POOL.append(space)
    return found


class Responses:
    """What is kept for QPs with the same P, G and A: see the door of this room.

    It is for one thread, and holds the arrays of its matrices, which must not change.
    `kernel` solves the QP with given vectors.
    """

    kernel: Callable[..., int]
    matrices: tuple[Any, Any, Any]
    limits: Limits | None = None  # of the last solve
    left = 0  # solves in a row that were left to other methods
    pause = 0  # solves that will be left to them without trying

    def __init__(self, P: Any, G: Any, A: Any) -> None:
        """Note the matrices; the first solve computes what depends on them."""
        self.now, self.state = new_state()
        self.address = ctypes.addressof(self.now)
        self.attach(P, G, A)

    def __reduce__(self) -> tuple[type["Responses"], tuple[Any, ...]]:
        """Let a copy begin anew with the same matrices: addresses cannot be copied."""
        return type(self), self.matrices

    @property
    def are_unsuited(self) -> bool:
        """Tell whether the last solve found that the matrices are not suited."""
        return not self.now.is_ready

    def attach(self, P: Any, G: Any, A: Any) -> None:
        """Take matrices, and memory for them."""
        raise NotImplementedError

    def renew(self, qp: QP) -> None:
        """Take the changed matrices of a QP of the same sizes.

        The active rows of the last solved QP are tried first in the next solve, and a
        pause goes on: other values seldom make a solve much easier.
        """
        kept, left, pause = self.now.kept_k, self.left, self.pause
        self.attach(qp.P, qp.G, qp.A)
        self.left, self.pause = left, pause
        self.now.hints = kept  # the numbers of the rows are still in memory

    def limit(self, limits: Limits) -> None:
        """Note when solves end."""
        now, self.limits = self.now, limits
        now.eps_abs, now.eps_rel = limits.eps_abs, limits.eps_rel
        now.max_iter = limits.max_iter or DEFAULT_OPTIONS.max_iter

    def suggest(self, active: np.ndarray) -> None:
        """Let the next solve begin with these rows active, see `Guess.active`."""
        take_hint(self.address, active)

    def solve(
        self,
        q: np.ndarray,
        h: np.ndarray,
        b: np.ndarray,
        lb: np.ndarray,
        ub: np.ndarray,
        limits: Limits,
    ) -> Answer | None:
        """Solve the QP with these vectors, clean arrays of the right sizes.

        Returns None where another method has to solve it, or a number is not allowed.
        """
        if self.pause > 0:
            self.pause -= 1
            return None
        if limits is not self.limits:
            self.limit(limits)
        n, m, p = q.size, h.size, b.size
        size = n + p + m
        out = np.empty(size + n + NUMBERS)
        work = 4.0 * self.now.max_iter * n * (n + size)  # of so many pivots
        code = limits.deadline.run(
            self.kernel, work, self.address, q, h, b, lb, ub, out
        )
        self.left = min(self.left + 1, len(PAUSES)) if code == STUCK else 0
        self.pause = PAUSES[self.left - 1] if self.left else 0
        if code not in JUDGED:
            return None
        end = size + n
        point = Point(out[:n], out[n : n + p], out[n + p : size], out[size:end])
        if code == DONE:
            residuals = tuple.__new__(Residuals, out[end:].tolist())  # twice as fast
            return Answer(SOLVED, point, residuals, self.now.pivots, "dual")
        P, G, A = self.matrices
        qp = QP(P, q, G, h, A, b, lb, ub)
        return self.summed(code, point, qp, limits)

    def summed(self, code: int, point: Point, qp: QP, limits: Limits) -> Answer | None:
        """Return the answer that a result makes after sums in the order of the data."""
        count = self.now.pivots
        if code == CONTRADICTION:
            proof = accept_primal(qp, *point[:3], limits.eps_abs)
            if proof is None:
                return None
            return proved(Status.PRIMAL_INFEASIBLE, proof, count, "dual")
        residuals = qp_residuals(*qp, *point)
        status = Status.TIME_LIMIT
        if code == SUMMED:
            if not residuals.solved(*limits.tolerances):
                return None
            status = Status.SOLVED
        return Answer(status, point, residuals, count, "dual")


class DenseResponses(Responses):
    """What is kept for QPs with the same dense P, G and A."""

    kernel = staticmethod(run)

    @classmethod
    def of(cls, qp: QP) -> "DenseResponses | None":
        """Return responses for the matrices of a QP; None if these are sparse."""
        return cls(qp.P, qp.G, qp.A) if qp.is_dense else None

    def attach(self, P: np.ndarray, G: np.ndarray, A: np.ndarray) -> None:
        """Take matrices, and memory for them."""
        self.matrices, self.left, self.pause = (P, G, A), 0, 0
        if not attach_matrices(self.address, P, G, A):
            self.memory = allocate(self.now)
            attach_matrices(self.address, P, G, A)
