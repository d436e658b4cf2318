"""QPs with the same matrices, one after another, by responses; dense ones."""

import ctypes
from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np

from namlcp.compiled import new_record
from namlcp.limits import NEVER, Deadline, Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.answer import Answer, proved
from namlcp.qp.certificates import accept_dual, accept_primal
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point
from namlcp.qp.responses.active import CONTRADICTION, DONE, GROWN, LATE, STUCK
from namlcp.qp.responses.course import SUMMED
from namlcp.qp.responses.free import MOST_WORK, WIDE, run_free
from namlcp.qp.responses.judgement import NUMBERS, ROUNDING
from namlcp.qp.responses.proximal import UNBOUNDED
from namlcp.qp.responses.run import (
    attach_matrices,
    run,
    take_hint,
)
from namlcp.qp.responses.state import ResponseState, allocate
from namlcp.residuals import Residuals, qp_residuals, signed_gap
from namlcp.status import Status

SOLVED = Status.SOLVED
# Codes of kernels after which there is a point or a candidate for a certificate.
JUDGED = (DONE, SUMMED, LATE, CONTRADICTION, UNBOUNDED)
# What `wrapped` makes an answer of: the array of a result after DONE, see `parted`, the
# iterations, and the name of the method.
Done = tuple[np.ndarray, int, str]
# Solves that are left to other methods without trying, after 1, 2, ... were tried in a
# row and left to these.
PAUSES = 0, 1, 3, 7, 15
NO_NUMBERS = np.empty(0)


class Held:
    """The factors that a solve has left, for the derivatives of its result.

    Attributes
    ----------
    space : DenseResponses or None
        Where they are; None if there are none.
    stamp : int
        That of the space when they were made.
    """

    space: "DenseResponses | None" = None
    stamp = 0

    def take(self, space: "DenseResponses") -> None:
        """Note where the factors of a solve that has just ended are."""
        self.space, self.stamp = space, space.stamp

    @property
    def address(self) -> int:
        """Where the record of the factors is, 0 if there are none any more."""
        space = self.space
        return 0 if space is None or space.stamp != self.stamp else space.address

    def __del__(self) -> None:
        """Let others have the space."""
        if self.space is not None:
            self.space.release()


def pivot_work(n: int, rows: int) -> float:
    """Return the most operations of a pivot, for n variables and rows of G and A."""
    return 4.0 * n * (2 * n + rows)


def most_pivots(max_iter: int, order: int) -> int:
    """Return the most pivots within a limit, see `active`, for n + m + p = order."""
    return max(max_iter, GROWN * order)


def parted(numbers: np.ndarray, n: int, m: int, p: int) -> tuple[Point, Residuals]:
    """Return the point and the residuals in the array of a result."""
    size = n + p + m
    end = size + n
    parts = numbers[:n], numbers[n : n + p], numbers[n + p : size], numbers[size:end]
    # These take half the time of Point(...) and Residuals(...).
    point = tuple.__new__(Point, parts)
    return point, tuple.__new__(Residuals, numbers[end:].tolist())


def wrapped(qp: QP, numbers: np.ndarray, iterations: int, form: str) -> Answer:
    """Return the SOLVED answer of a `Done`."""
    point, residuals = parted(numbers, qp.q.size, qp.h.size, qp.b.size)
    return Answer(SOLVED, point, residuals, iterations, form)


def summed(qp: QP, point: Point, found: Residuals, eps_abs: float) -> Residuals:
    """Return the residuals of a point with sums in the order of the data.

    found: those in another order. Often the terms of the gap alone are so large that
    the order matters.
    """
    if max(found.primal_size, found.dual_size) * ROUNDING > eps_abs:
        return qp_residuals(*qp, *point)
    vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
    gap = signed_gap(vectors, tuple(point), qp.P @ point.x)
    return found._replace(gap=abs(gap))


class Responses:
    """What is kept for QPs with the same P, G and A: see the door of this room.

    It is for one thread, and holds the arrays of its matrices, which must not change.
    `kernel` solves the QP with given vectors; `form` names the method in results;
    `stamp` changes with all that is kept.
    """

    kernel: Callable[..., int]
    form = "dual"
    now: Any  # the record that `kernel` takes by its address
    matrices: tuple[Any, Any, Any]
    limits: Limits | None = None  # of the last solve
    max_iter = 0  # of these limits
    work = 0.0  # the most operations of a solve within these limits
    is_brief = True  # whether no deadline has to be looked at for so many
    length = 0  # of the array of a result
    pivot_work = 0.0  # operations of a pivot
    is_stale = False  # whether the matrices are still to be attached
    left = 0  # solves in a row that were left to other methods
    pause = 0  # solves that will be left to them without trying
    stamp = 0
    is_slow_anew = False  # whether other methods are quicker with other matrices

    def __init__(self, P: Any, G: Any, A: Any) -> None:
        """Note the matrices; the first solve computes what depends on them."""
        self.now, self.state = new_record(ResponseState)
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
        self.matrices, self.is_stale = (P, G, A), False
        self.left = self.pause = 0
        n, rows = P.shape[0], G.shape[0] + A.shape[0]
        self.length = 2 * n + rows + NUMBERS
        self.pivot_work = pivot_work(n, rows)

    def renew(self, qp: QP) -> None:
        """Note the changed matrices of a QP of the same sizes.

        The active rows of the last solved QP are tried first in the next solve, and a
        pause goes on: other values seldom make a solve much easier.
        """
        self.matrices, self.is_stale = (qp.P, qp.G, qp.A), True
        self.stamp += 1

    def attach_anew(self) -> None:
        """Take the matrices that `renew` has noted."""
        left, hints = self.left, max(self.now.kept_k, self.now.hints)
        self.attach(*self.matrices)
        self.left = left
        self.now.hints = hints  # the numbers of the rows are still in memory

    def limit(self, limits: Limits) -> None:
        """Note when solves end."""
        now, self.limits = self.now, limits
        now.eps_abs, now.eps_rel = limits.eps_abs, limits.eps_rel
        now.max_iter = self.max_iter = limits.max_iter or DEFAULT_OPTIONS.max_iter
        self.work = most_pivots(self.max_iter, self.length) * self.pivot_work
        self.is_brief = NEVER.leaves_time_for(self.work)

    def suggest(self, guess: Guess) -> None:
        """Let the next solve begin with the active rows of a guess."""
        self.stamp += 1
        take_hint(self.address, guess.active)

    def run(self, vectors: np.ndarray, limits: Limits) -> tuple[int, np.ndarray]:
        """Solve the QP with these vectors, see `QP.joined`, and the matrices at hand.

        Returns the code of the kernel and the numbers for `answer` or, after DONE,
        `parted`: the QP is SOLVED then. No other code is of use to other rooms.
        """
        if self.pause > 0:
            self.pause -= 1
            return STUCK, NO_NUMBERS
        if self.is_stale:
            self.attach_anew()
        if limits is not self.limits:
            self.limit(limits)
        self.stamp += 1
        numbers = np.empty(self.length)
        code = self.call((self.address, vectors, numbers), limits.deadline)
        if code == STUCK:
            self.left = min(self.left + 1, len(PAUSES))
            self.pause = PAUSES[self.left - 1]
        else:
            self.left = 0
        return code, numbers

    def lent(self) -> Held | None:
        """Return the factors of the last solve, None where there are none."""
        return None

    def release(self) -> None:
        """Note that nobody holds the factors any more."""

    def call(self, arguments: tuple[Any, ...], deadline: Deadline) -> int:
        """Call `kernel`, with a watch where it may run long; return its code."""
        if self.is_brief and deadline.at == inf:
            return self.kernel(*arguments, 0)
        return deadline.run(self.kernel, self.work, *arguments)

    def answer(
        self, code: int, numbers: np.ndarray, qp: QP, limits: Limits
    ) -> Answer | None:
        """Return the answer to `qp` from what `run` has returned for it.

        None: another method has to solve it, or it has a number that is not allowed.
        """
        if code not in JUDGED:
            return None
        count = self.now.pivots
        if code == DONE:
            return wrapped(qp, numbers, count, self.form)
        point, residuals = parted(numbers, qp.q.size, qp.h.size, qp.b.size)
        if code == CONTRADICTION:
            proof = accept_primal(qp, *point[:3], limits.eps_abs)
            if proof is None:
                return None
            return proved(Status.PRIMAL_INFEASIBLE, proof, count, self.form)
        if code == UNBOUNDED:
            proof = accept_dual(qp, *point, limits.eps_abs)
            if proof is None:
                return None
            return proved(Status.DUAL_INFEASIBLE, proof, count, self.form)
        if code == LATE:
            residuals = qp_residuals(*qp, *point)
            return Answer(Status.TIME_LIMIT, point, residuals, count, self.form)
        residuals = summed(qp, point, residuals, limits.eps_abs)
        if not residuals.solved(*limits.tolerances):
            return None
        return Answer(SOLVED, point, residuals, count, self.form)


class DenseResponses(Responses):
    """What is kept for QPs with the same dense P, G and A."""

    kernel = staticmethod(run)

    @classmethod
    def of(cls, qp: QP) -> "DenseResponses | None":
        """Return responses for the matrices of a QP; None if these are sparse."""
        return cls(qp.P, qp.G, qp.A) if qp.is_dense else None

    def attach(self, P: np.ndarray, G: np.ndarray, A: np.ndarray) -> None:
        """Take matrices, and memory for them."""
        super().attach(P, G, A)
        if not attach_matrices(self.address, P, G, A):
            self.memory = allocate(self.now)
            attach_matrices(self.address, P, G, A)

    def can_run_again(self, limits: Limits) -> bool:
        """Tell whether `run_again` may follow: nobody has to look at the clock."""
        return self.is_brief and limits.deadline.at == inf

    def run_again(self, vectors: np.ndarray) -> tuple[int, np.ndarray]:
        """Do as `run` with other vectors after a DONE, by one of the two forms alone.

        After another code nothing is known: `run` has to begin anew.
        """
        self.stamp += 1
        numbers = np.empty(self.length)
        kernel = run_free if self.now.is_free else self.kernel
        return kernel(self.address, vectors, numbers, 0), numbers

    @property
    def has_factor(self) -> bool:
        """Whether the factor at hand is that of P, and of the last active rows.

        That of `free` has not these, and that of `proximal` is of P + W.
        """
        return not self.now.face_is_kept and self.now.rho == 0.0

    def lent(self) -> Held | None:
        """Return the factors of the last solve, None where there are none."""
        if not self.has_factor:
            return None
        held = Held()
        held.take(self)
        return held

    def call(self, arguments: tuple[Any, ...], deadline: Deadline) -> int:
        """Call `kernel`, or that of `free` where it is the smaller form."""
        if self.now.is_free:
            return self.call_free(arguments, deadline)
        return super().call(arguments, deadline)

    def call_free(self, arguments: tuple[Any, ...], deadline: Deadline) -> int:
        """Call the kernel of `free`; where it does not decide, `kernel`.

        The active rows of the last solved QP are a hint for this one, which has no
        factor of theirs, and stay one if it does not solve the QP.
        """
        code = deadline.run(run_free, MOST_WORK, *arguments)
        if code not in (WIDE, STUCK):
            return code
        now = self.now
        kept, now.kept_k = now.kept_k, 0
        now.hints = kept
        code = super().call(arguments, deadline)
        if code != DONE:
            now.hints = kept
        return code
