"""The way of a QP: transforms, and the engines that suit what these leave, in order.

A QP with bounds alone is a box LCP with A = P; a small or full one is solved by the
dual active-set method in dense form; any other, and what these two leave unsolved, by
the interior-point method. Engines offer points and certificates; the `Judge` decides.
"""

import numpy as np

from namlcp.limits import OutOfTime
from namlcp.outcome import ENDS
from namlcp.qp.active import solve_dense
from namlcp.qp.active.solve import (
    FEW_ENTRIES,
    FULL,
    MOST_BOX,
    MOST_LINEAR,
    SPARSE_LINEAR,
    TINY_ENTRIES,
)
from namlcp.qp.bounds import is_box_open, solve_bounds
from namlcp.qp.chain import NO_TRANSFORMS, Chain
from namlcp.qp.guess import NO_GUESS, make_guess
from namlcp.qp.interior import solve_interior
from namlcp.qp.judge import Judge
from namlcp.qp.memory import Memory
from namlcp.qp.transforms import substitute
from namlcp.status import Status

# Most variables, and most entries of P, G and A, zeros included, of the dense form,
# which would take many seconds beyond.
DENSE_VARIABLES, DENSE_ENTRIES = 2000, 16_000_000
# Least huge bound or h_i, which stands for infinity and whose products round off all
# other terms of a sum, relative to the largest of 1, |b| and those below HUGE.
HUGE = 1e6
# Statuses after which a QP is solved in another way.
UNDECIDED = (Status.STALLED, Status.NUMERICAL_ERROR)


def route(qp, guess, limits, memory=None, given=None, doubt=None):
    """Solve a checked QP; if it stalls, go on without its huge bounds.

    `memory` may be kept for the next problem of the same pattern; it is changed.
    `given`: P, G and A as the user stores them. `doubt`: see `Judge`.
    """
    judge = Judge(qp, limits, given, doubt)
    try:
        answer = solve_transformed(qp, guess, judge, memory)
        relaxed = without_huge_bounds(qp) if answer.status in UNDECIDED else None
        if relaxed is not None:
            first, answer = answer, solve_transformed(relaxed, NO_GUESS, judge, None)
            if answer.status in UNDECIDED:
                answer = answer._replace(status=first.status, message=first.message)
    except OutOfTime:
        return judge.answer(Status.TIME_LIMIT, 0, "none")
    if answer.status is Status.STALLED:
        of_rows = answer.residuals._replace(dual=0.0, gap=0.0)
        if not of_rows.solved(*limits.tolerances) and judge.is_disproved():
            return judge.answer(answer.status, answer.iterations, answer.method)
    return answer


def solve_transformed(qp, guess, judge, memory):
    """Solve with free columns substituted; if that is undecided, without.

    A tiny sparse QP is first tried in dense form as it came.
    """
    memory, small = memory or Memory(), None
    if type(qp.P) is np.ndarray or not (qp.h.size or qp.b.size):
        return solve_by_engines(qp, NO_TRANSFORMS, guess, judge, memory)
    if entries_of(qp) <= TINY_ENTRIES and takes_dense(qp, True, memory):
        found = solve_dense(qp, NO_TRANSFORMS, guess, judge, memory)
        if found is not None and found.status in ENDS:
            return found
        small = False  # not in dense form again
    substitution = substitute(qp, memory.substitution, judge.limits.deadline)
    memory.substitution = substitution
    if substitution is not None:
        memory.convex = substitution.P  # P was checked; this adds only squares
        memory.dense_failed, chain = False, Chain(substitution)
        answer = solve_by_engines(substitution.problem, chain, guess, judge, memory)
        if answer.status not in UNDECIDED:
            return answer
        guess, memory = make_guess(qp, None, answer.point), Memory()
    return solve_by_engines(qp, NO_TRANSFORMS, guess, judge, memory, small)


def solve_by_engines(qp, chain, guess, judge, memory, small=None):
    """Return the answer of the first engine that decides, else that of the last one."""
    guess, small = chain.guess(guess), is_small(qp) if small is None else small
    for suits, solve in ENGINES:
        if suits(qp, small, memory):
            found = solve(qp, chain, guess, judge, memory)
            if found is not None and found.status in ENDS:
                return found
    return found


def without_huge_bounds(qp):
    """Return the QP with its huge bounds made infinite; None if it has none."""
    sides = np.abs(np.concatenate((qp.h, qp.lb, qp.ub)))
    ordinary = np.concatenate((np.ones(1), np.abs(qp.b), sides[sides < HUGE]))
    huge = HUGE * ordinary.max()
    upper = np.concatenate((qp.h, -qp.lb, qp.ub))
    if not ((huge <= upper) & (upper < np.inf)).any():
        return None
    h = np.where(qp.h >= huge, np.inf, qp.h)
    lb = np.where(qp.lb <= -huge, -np.inf, qp.lb)
    ub = np.where(qp.ub >= huge, np.inf, qp.ub)
    return qp._replace(h=h, lb=lb, ub=ub)


def entries_of(qp):
    """Return how many entries P, G and A have, zeros included."""
    return qp.q.size * (qp.q.size + qp.h.size + qp.b.size)


def is_small(qp):
    """Tell whether the matrices have few entries, or few zeros, for the dense form."""
    entries = entries_of(qp)
    if qp.q.size > DENSE_VARIABLES or entries > DENSE_ENTRIES:
        return False
    if entries <= FEW_ENTRIES:
        return True
    matrices = qp.P, qp.G, qp.A
    if type(qp.P) is np.ndarray:
        filled = sum(map(np.count_nonzero, matrices))
    else:
        filled = sum([M.data.size for M in matrices])
    return 100 * filled >= FULL * entries


def takes_bounds(qp, small, memory):
    """Tell whether there are bounds alone, which have a finite point, and many."""
    return (
        qp.h.size + qp.b.size == 0
        and (qp.q.size > MOST_BOX or not small)
        and is_box_open(qp.lb, qp.ub)
    )


def takes_dense(qp, small, memory):
    """Tell whether the dense form promises more than interior points."""
    if memory.dense_failed or not small:
        return False
    is_dense = type(qp.P) is np.ndarray
    most, cost = (MOST_LINEAR, qp.P) if is_dense else (SPARSE_LINEAR, qp.P.data)
    return qp.q.size <= most or cost.any()


ENGINES = (
    (takes_bounds, solve_bounds),
    (takes_dense, solve_dense),
    (lambda qp, small, memory: True, solve_interior),
)
"""The methods for QPs, in order: suits(qp, small, memory), whether one is tried, with
small as `is_small` says, and solve(qp, chain, guess, judge, memory), its answer, None
if that is nothing. chain: the way from the user's QP to `qp`."""
