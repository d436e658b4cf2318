"""Dense QPs with the same matrices, one after another, by responses."""

from collections.abc import Callable
from typing import Any

import numpy as np

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.answer import Answer, proved
from namlcp.qp.certificates import accept_primal
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point, refuse_numbers, without_huge_sides
from namlcp.qp.responses.active import CONTRADICTION, DONE, LATE, STUCK
from namlcp.qp.responses.judgement import NUMBERS
from namlcp.qp.responses.run import (
    FAULTY,
    HUGE,
    attach_matrices,
    attach_vectors,
    run,
    take_hint,
)
from namlcp.qp.responses.state import allocate, new_state
from namlcp.residuals import Residuals, qp_residuals
from namlcp.status import Status

# Relative rounding error of a residual: where this times its largest term exceeds
# eps_abs, all are summed again by `qp_residuals`, in the order that qpsolvers uses.
ROUNDING = 4e-15


# Spaces of one-shot solves that have ended, for the next ones: making one takes as long
# as a tiny QP. At most so many numbers each are kept.
MOST_VARIABLES = 300
POOL: list["DenseResponses"] = []
MOST_POOLED = 1_000_000
# Solves in a row that are left to other methods before responses are no longer tried.
MOST_LEFT = 3


def solve_once(qp: QP, guess: Guess, limits: Limits) -> Answer | None:
    """Solve one dense QP; None where another method has to."""
    if qp.q.size + qp.b.size > MOST_VARIABLES:
        return None
    limits.announce(run)
    try:
        space = POOL.pop()
        space.attach(qp.P, qp.G, qp.A)
    except IndexError:
        space = DenseResponses(qp.P, qp.G, qp.A)
    if guess.active.size:
        space.suggest(guess.active)
    found = space.solve(qp.q, qp.h, qp.b, qp.lb, qp.ub, limits)
    if space.memory.size <= MOST_POOLED:
        POOL.append(space)
    return found


class Responses:
    """What is kept for QPs with the same P, G and A: see the door of this room.

    It is for one thread, and holds the arrays of its matrices, which must not change.
    `kernel` solves the QP whose vectors have been attached.
    """

    kernel: Callable[..., int]
    matrices: tuple[Any, Any, Any]
    left = 0  # to other methods, one solve after the other

    def __init__(self, P: Any, G: Any, A: Any) -> None:
        """Note the matrices; the first solve computes what depends on them."""
        self.now, self.state = new_state()
        self.attach(P, G, A)

    def __reduce__(self) -> tuple[type["Responses"], tuple[Any, ...]]:
        """Let a copy begin anew with the same matrices: addresses cannot be copied."""
        return type(self), self.matrices

    @property
    def are_unsuited(self) -> bool:
        """Tell whether the matrices do not suit, or the last solves were all left."""
        return not self.now.is_ready or self.left >= MOST_LEFT

    def attach(self, P: Any, G: Any, A: Any) -> None:
        """Take matrices, and memory for them."""
        raise NotImplementedError

    def set_size(self) -> None:
        """Set the number of entries of a result."""
        self.size = 2 * self.now.n + self.now.m + self.now.p + NUMBERS

    def renew(self, qp: QP) -> None:
        """Take the changed matrices of a QP of the same sizes.

        The active rows of the last solved QP are tried first in the next solve.
        """
        now = self.now
        kept = now.kept_k
        self.attach(qp.P, qp.G, qp.A)
        now.hints = kept  # their numbers are still in memory

    def suggest(self, active: np.ndarray) -> None:
        """Let the next solve begin with these rows active, see `Guess.active`."""
        take_hint(self.state, active)

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

        Returns None where another method has to solve it. Raises ValueError for a
        number that is not allowed.
        """
        now = self.now
        now.eps_abs, now.eps_rel = limits.eps_abs, limits.eps_rel
        now.max_iter = limits.max_iter or DEFAULT_OPTIONS.max_iter
        out = np.empty(self.size)
        attach_vectors(self.state, (q, h, b, lb, ub), out)
        most = 4.0 * now.max_iter * now.n * (2 * now.n + now.m + now.p)
        code = limits.deadline.run(self.kernel, most, self.state)
        self.left = self.left + 1 if code == STUCK else 0
        if code == DONE or code == LATE:
            return self.answer(code, out, (q, h, b, lb, ub), limits)
        P, G, A = self.matrices
        qp = QP(P, q, G, h, A, b, lb, ub)
        if code == CONTRADICTION:
            x, y, z, _ = self.parts(out)
            proof = accept_primal(qp, x, y, z, limits.eps_abs)
            if proof is None:
                return None
            return proved(Status.PRIMAL_INFEASIBLE, proof, now.pivots, "dual")
        if code == FAULTY:
            refuse_numbers(qp)
        if code == HUGE:
            qp = without_huge_sides(qp)
            return self.solve(qp.q, qp.h, qp.b, qp.lb, qp.ub, limits)
        return None

    def parts(self, out: np.ndarray) -> Point:
        """Return x, y, z, z_box of a result."""
        n, p, end = self.now.n, self.now.p, self.now.n + self.now.p + self.now.m
        return Point(out[:n], out[n : n + p], out[n + p : end], out[end : end + n])

    def answer(
        self,
        code: int,
        out: np.ndarray,
        vectors: tuple[np.ndarray, ...],
        limits: Limits,
    ) -> Answer:
        """Return the answer that a result makes."""
        point, numbers = self.parts(out), out[-NUMBERS:].tolist()
        residuals = Residuals(*numbers)
        status = Status.SOLVED if code == DONE else Status.TIME_LIMIT
        if max(numbers[3:6]) * ROUNDING > limits.eps_abs:
            q, h, b, lb, ub = vectors
            P, G, A = self.matrices
            residuals = qp_residuals(P, q, G, h, A, b, lb, ub, *point)
            if code == DONE and not residuals.solved(*limits.tolerances):
                status = Status.STALLED
        return Answer(status, point, residuals, self.now.pivots, "dual")


class DenseResponses(Responses):
    """What is kept for QPs with the same dense P, G and A."""

    kernel = staticmethod(run)

    @classmethod
    def of(cls, qp: QP) -> "DenseResponses | None":
        """Return responses for the matrices of a QP; None if these are sparse."""
        return cls(qp.P, qp.G, qp.A) if qp.is_dense else None

    def attach(self, P: np.ndarray, G: np.ndarray, A: np.ndarray) -> None:
        """Take matrices, and memory for them."""
        self.matrices = P, G, A
        if not attach_matrices(self.state, P, G, A):
            self.memory = allocate(self.now)
            attach_matrices(self.state, P, G, A)
        self.set_size()
