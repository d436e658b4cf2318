"""The way of a QP: transforms, and the engines that suit what these leave, in order.

A QP with bounds alone is a box LCP with A = P; a small or full one is solved by the
dual active-set method in dense form; any other, and what these two leave unsolved, by
the interior-point method. Engines offer points and certificates; the `Judge` decides.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from namlcp.limits import Limits, OutOfTime
from namlcp.outcome import Outcome
from namlcp.qp.active import solve_dense
from namlcp.qp.active.solve import (
    FEW_ENTRIES,
    FULL,
    MOST_BOX,
    MOST_LINEAR,
    TINY_ENTRIES,
)
from namlcp.qp.bounds import is_box_open, solve_bounds
from namlcp.qp.chain import OWN, Chain
from namlcp.qp.guess import NO_GUESS, Guess, make_guess
from namlcp.qp.interior import solve_interior
from namlcp.qp.judge import Judge, Matrices
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP
from namlcp.qp.transforms import substitute, without_huge_bounds
from namlcp.status import Status

# Most variables, and most entries of P, G and A, zeros included, of the dense form,
# which would take many seconds beyond.
DENSE_VARIABLES, DENSE_ENTRIES = 2000, 16_000_000
# Statuses after which a QP is solved in another way.
UNDECIDED = (Status.STALLED, Status.NUMERICAL_ERROR)


def is_small(qp: QP) -> bool:
    """Tell whether the matrices have few entries, or few zeros, for the dense form."""
    n = qp.q.size
    entries = n * (n + qp.h.size + qp.b.size)
    if n > DENSE_VARIABLES or entries > DENSE_ENTRIES:
        return False
    if entries <= FEW_ENTRIES:
        return True
    P, _, G, _, A, *_ = qp
    if qp.is_dense:
        filled = sum(map(np.count_nonzero, (P, G, A)))
    else:
        filled = P.data.size + G.data.size + A.data.size
    return 100 * filled >= FULL * entries


def route(
    qp: QP,
    guess: Guess,
    limits: Limits,
    memory: Memory | None = None,
    given: Matrices | None = None,
) -> Outcome:
    """Solve a checked QP; if it stalls, go on without its huge bounds.

    `memory` may be kept for the next problem of the same pattern; it is changed.
    `given`: P, G and A as the user holds them.
    """
    judge = Judge(qp, limits, given)
    try:
        answer = solve_in_forms(qp, guess, judge, memory)
        relaxed = without_huge_bounds(qp) if answer.status in UNDECIDED else None
        if relaxed is None:
            return answer
        other = solve_in_forms(relaxed, NO_GUESS, judge, None)
    except OutOfTime:
        return judge.answer(Status.TIME_LIMIT, 0, "none")
    if other.status in UNDECIDED:
        return other._replace(status=answer.status, message=answer.message)
    return other


def solve_in_forms(
    qp: QP, guess: Guess, judge: Judge, memory: Memory | None
) -> Outcome:
    """Solve with free columns substituted; if that is undecided, without.

    A tiny sparse QP is first tried in dense form as it came.
    """
    if memory is None:
        memory = Memory()
    else:
        qp = memory.recognised(qp)
    if not qp.is_dense and (qp.h.size or qp.b.size):
        n = qp.q.size
        is_tiny = n * (n + qp.h.size + qp.b.size) <= TINY_ENTRIES
        if is_tiny and not memory.in_vain:
            found = solve_dense(qp, OWN, guess, judge, memory)
            if found is not None and found.ends:
                return found
        substitution = substitute(qp, memory.substitution, judge.limits.deadline)
        memory.substitution = substitution
        if substitution is not None:
            memory.convex = substitution.P  # P was checked; this adds only squares
            memory.in_vain = False
            chain = Chain((substitution,))
            answer = solve_by_engines(substitution.problem, chain, guess, judge, memory)
            if answer.status not in UNDECIDED:
                return answer
            guess, memory = make_guess(qp, None, answer.point), Memory()
    return solve_by_engines(qp, OWN, guess, judge, memory)


def takes_bounds(qp: QP, small: bool, memory: Memory) -> bool:
    """Tell whether there are bounds alone, which have a finite point, and many."""
    return (
        qp.h.size + qp.b.size == 0
        and (qp.q.size > MOST_BOX or not small)
        and is_box_open(qp.lb, qp.ub)
    )


def takes_dense(qp: QP, small: bool, memory: Memory) -> bool:
    """Tell whether the dense form promises more than interior points."""
    if memory.in_vain or not small:
        return False
    return not qp.is_dense or qp.q.size <= MOST_LINEAR or bool(qp.P.any())


class Engine(NamedTuple):
    """A method for QPs.

    suits(qp, small, memory): whether it is tried; small: as `is_small` says.
    solve(qp, chain, guess, judge, memory): its answer, None if that is nothing; chain:
    the way from the user's QP to `qp`.
    """

    suits: Callable[[QP, bool, Memory], bool]
    solve: Callable[[QP, Chain, Guess, Judge, Memory], Outcome | None]


ENGINES = (
    Engine(takes_bounds, solve_bounds),
    Engine(takes_dense, solve_dense),
    Engine(lambda qp, small, memory: True, solve_interior),
)


def solve_by_engines(
    qp: QP, chain: Chain, guess: Guess, judge: Judge, memory: Memory
) -> Outcome:
    """Return the answer of the first engine that decides, else that of the last one."""
    guess, small = chain.guess(guess), is_small(qp)
    for engine in ENGINES:
        if engine.suits(qp, small, memory):
            found = engine.solve(qp, chain, guess, judge, memory)
            if found is not None and found.ends:
                return found
    assert found is not None
    return found
