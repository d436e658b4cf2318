"""Dense QPs from nothing: one, or many of the same sizes, in few compiled calls.

An item of a batch has an answer of the same bits whichever items are solved before it,
and by whatever thread: it starts without active rows, and responses depend on the
matrices alone.
"""

import ctypes
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from namlcp.compiled import address_of, new_record
from namlcp.limits import NEVER, SPEED, UNCHECKED_TIME, Limits
from namlcp.options import Options
from namlcp.qp.answer import Answer
from namlcp.qp.guess import NO_GUESS, Guess
from namlcp.qp.problem import QP
from namlcp.qp.responses.active import CONTRADICTION, DONE, STUCK
from namlcp.qp.responses.judgement import NUMBERS
from namlcp.qp.responses.large import prepare
from namlcp.qp.responses.proximal import UNBOUNDED
from namlcp.qp.responses.run import ROOMLESS, UNSUITED, run, run_once
from namlcp.qp.responses.solve import (
    NO_NUMBERS,
    SOLVED,
    DenseResponses,
    Done,
    Held,
    most_pivots,
    pivot_work,
    wrapped,
)
from namlcp.qp.responses.state import ResponseState, allocate
from namlcp.qp.responses.weight import NO_WEIGHT, RHO

# Most operations of a solve that does not look at a deadline.
BRIEF_WORK = SPEED * UNCHECKED_TIME
# Most variables, equations and rows of a QP that is solved without BLAS.
MOST_ORDER = 900
# Other values of rho for `proximal`, see `weight`: where too many rounds were needed,
# and where rounding errors were too large.
LESS_RHO, MORE_RHO = 1e-2 * RHO, 1e2 * RHO
# Spaces of one-shot solves that have ended, for the next ones: making one takes as long
# as a tiny QP. At most so many are kept, of at most so many numbers each.
POOL: list["SingleSolves"] = []
MOST_SPACES, MOST_POOLED = 16, 1_000_000
# Operations of one call at most, about: until its end Ctrl-C is not seen.
MOST_WORK = 1e8


class Verdict(NamedTuple):
    """What `solve_unwrapped` has found: one of the first two at most is not None.

    Attributes
    ----------
    done
        An answer that needs no judgement. To wrap it takes an eighth of a tiny solve.
    answer
        Any other one.
    in_vain
        Whether the QP was tried from nothing, and another method has to solve it.
    stamp
        The `stamp_of` the QP, where one call has solved it.
    """

    done: Done | None = None
    answer: Answer | None = None
    in_vain: bool = False
    stamp: int | None = None


def solve_once(
    qp: QP, guess: Guess, limits: Limits, held: Held | None = None
) -> Answer | None:
    """Solve one dense QP; None where another method has to.

    `held` gets the factors of a QP that is solved.
    """
    done, answer, *_ = solve_unwrapped(qp, guess, limits, held)
    return answer if done is None else wrapped(qp, *done)


def solve_unwrapped(
    qp: QP,
    guess: Guess,
    limits: Limits,
    held: Held | None = None,
    with_weight: bool = True,
) -> Verdict:
    """Do as `solve_once`, but return a `Verdict`.

    Not with_weight: leave a QP whose P has no good factor to other methods.
    """
    try:
        space = POOL.pop()
    except IndexError:
        space = SingleSolves()
    found = space.decide(qp, guess, limits, with_weight)
    is_solved = found.done or (found.answer and found.answer.status is SOLVED)
    if held is not None and is_solved and space.has_factor:
        held.take(space)
    else:
        space.release()
    return found


def is_brief(qp: QP, max_iter: int) -> bool:
    """Tell whether `solve_once` does not look at a deadline unless there is a limit."""
    n, rows = qp.q.size, qp.h.size + qp.b.size
    work = most_pivots(max_iter, n + rows) * pivot_work(n, rows)
    return work <= BRIEF_WORK


class SingleSolves(DenseResponses):
    """Space for single solves, one after another: the memory is kept, nothing else."""

    memory = NO_NUMBERS
    vectors: np.ndarray | None = None  # those of a large QP, for its derivatives

    def __init__(self) -> None:
        """Take no memory before the first solve."""
        self.now, self.state = new_record(ResponseState)
        self.address = ctypes.addressof(self.now)
        self.now.is_single = True

    def release(self) -> None:
        """Keep the memory for the next solve, unless it is large."""
        if self.memory.size <= MOST_POOLED and len(POOL) < MOST_SPACES:
            self.matrices = None, None, None  # the caller's, which are not to be held
            POOL.append(self)

    def decide(
        self, qp: QP, guess: Guess, limits: Limits, with_weight: bool = True
    ) -> Verdict:
        """Solve a QP; if need be without the guess, and with several weights W."""
        order, now = qp.q.size + qp.h.size + qp.b.size, self.now
        now.wanted = 0.0 if with_weight else NO_WEIGHT
        while True:
            stamp = None
            if order > MOST_ORDER or guess.active.size:
                code, numbers = self.solve_in_steps(qp, guess, limits)
            else:
                code, numbers = self.solve(qp, limits)
                stamp = now.stamp
            if code == DONE:
                return Verdict((numbers, now.pivots, self.form), None, False, stamp)
            answer = self.answer(code, numbers, qp, limits)
            if answer is not None or code not in (STUCK, CONTRADICTION, UNBOUNDED):
                return Verdict(None, answer)
            if guess.active.size:
                guess = NO_GUESS  # a wrong one may mislead
            elif code == UNBOUNDED or not self.takes_another_weight(code):
                return Verdict(in_vain=True)

    def takes_another_weight(self, code: int) -> bool:
        """Choose another W after a solve that has not decided; False if none may help.

        Without W, rounding errors are to blame; with W, these or too many rounds.
        """
        now = self.now
        is_long = now.pivots > now.max_iter or now.operations > now.most_operations
        if is_long or now.wanted in (LESS_RHO, MORE_RHO, NO_WEIGHT):
            return False
        if now.rho == 0.0:  # P is definite: a small W leaves little to the passes
            now.wanted = LESS_RHO
        else:
            now.wanted = LESS_RHO if code == STUCK and now.rounds > 1 else MORE_RHO
        return True

    def solve(self, qp: QP, limits: Limits) -> tuple[int, np.ndarray]:
        """Solve a QP by one compiled call; return what `run` does."""
        if limits is not self.limits:
            self.limit(limits)
        P, q, G, h, A, b, lb, ub = qp
        n, rows = q.size, h.size + b.size
        numbers = np.empty(2 * n + rows + NUMBERS)
        arguments = self.address, P, G, A, (q, h, b, lb, ub), numbers
        deadline = limits.deadline
        while True:
            if deadline is NEVER:  # the caller asked `is_brief`
                code = run_once(*arguments, 0)
            else:
                limits.announce(run_once)
                work = most_pivots(self.max_iter, n + rows) * pivot_work(n, rows)
                code = deadline.run(run_once, work, *arguments)
            if code != ROOMLESS:
                return code, numbers
            self.memory = allocate(self.now)

    def solve_in_steps(
        self, qp: QP, guess: Guess, limits: Limits
    ) -> tuple[int, np.ndarray]:
        """Solve a QP from a guess, or a large one; return what `run` does.

        The factors and responses of a large one are made by BLAS.
        """
        is_large = qp.q.size + qp.h.size + qp.b.size > MOST_ORDER
        limits.announce(prepare if is_large else run)
        self.attach(qp.P, qp.G, qp.A)
        self.limits, self.vectors = None, qp.joined()
        if is_large and not prepare(self.address, self.vectors):
            return UNSUITED, NO_NUMBERS
        if guess.active.size:
            self.suggest(guess)
        return self.run(self.vectors, limits)


class Solutions(NamedTuple):
    """What `run` has found for some items of a stack: one row of each array an item.

    `numbers` are those of `Residuals`. An item that is not `solved` is left to other
    methods, and its rows mean nothing.
    """

    solved: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    numbers: np.ndarray
    pivots: np.ndarray


class Stack:
    """Items of a batch; several threads may solve some of them each."""

    def __init__(self, shared: QP, stacked: Mapping[str, np.ndarray]):
        """Take clean arrays, those in `stacked` instead of the shared.

        The former have one more axis, in front. Numbers are checked by the solve.
        """
        self.arrays = {**shared._asdict(), **stacked}
        self.stacked = stacked
        self.first = tuple(
            stacked[name][0] if name in stacked else getattr(shared, name)
            for name in "PGA"
        )
        n, m, p = (M.shape[0] for M in self.first)
        self.ends = np.cumsum((n, p, m, n))  # of x, y, z and z_box in a row of `out`
        work = 4.0 * (n + m) * n * (2 * n + m + p)  # as many pivots as rows
        self.most_items = max(int(MOST_WORK / max(work, 1.0)), 1)  # of one call

    @staticmethod
    def takes(shared: QP) -> bool:
        """Tell whether QPs like this one are solved by responses."""
        return (
            shared.is_dense
            and sum(v.size for v in (shared.q, shared.h, shared.b)) <= MOST_ORDER
        )

    def solve(self, start: int, end: int, options: Options) -> Solutions:
        """Solve items start to end - 1, in work space of their own."""
        out = np.empty((end - start, self.ends[-1] + NUMBERS))
        ended = np.empty((end - start, 2), dtype=np.int64)
        space = DenseResponses(*self.first)
        now = space.now
        now.is_single = True
        for name, array in self.arrays.items():
            step = array.strides[0] if name in self.stacked else 0
            setattr(now, f"{name}_step", step)
            setattr(now, name, address_of(array) + start * step)
        now.out, now.out_step = address_of(out), out.strides[0]
        now.codes = address_of(ended)
        space.limit(options.limits())
        for first in range(start, end, self.most_items):
            now.items_left = min(end - first, self.most_items)
            run(space.address, NO_NUMBERS, NO_NUMBERS, 0)
        x, y, z, z_box, numbers = np.hsplit(out, self.ends)
        return Solutions(
            ended[:, 0] == DONE, x, y, z, z_box, numbers, pivots=ended[:, 1]
        )
