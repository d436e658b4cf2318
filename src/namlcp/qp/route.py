"""The way of a QP: transforms, and the engines that suit what these leave, in order.

A QP with bounds alone is a box LCP with A = P; a small or full one is solved by the
dual active-set method in dense form; any other, and what these two leave unsolved, by
the interior-point method. Engines offer points and certificates; the `Judge` decides.
In the end comes the closest point, if the QP is infeasible and it was asked for.
"""

import numpy as np

from namlcp.lcp.data import Prepared
from namlcp.limits import NEVER, OutOfTime
from namlcp.linalg.threads import blas_threads
from namlcp.options import RELAXATIONS
from namlcp.qp.active.solve import (
    FEW_ENTRIES,
    FULL,
    MOST_BOX,
    MOST_LINEAR,
    SPARSE_LINEAR,
    TINY_ENTRIES,
    solve_dense,
)
from namlcp.qp.bounds import is_box_open, solve_bounds
from namlcp.qp.closest import contradiction, nearest, weights_of
from namlcp.qp.interior.loop import solve_interior
from namlcp.qp.judge import Judge
from namlcp.qp.problem import NO_GUESS, Point, check_convex, make_guess
from namlcp.qp.reductions import substitute
from namlcp.residuals import UNDEFINED
from namlcp.status import ENDS, QP_COLUMNS, Progress, Status

# Most variables, and most entries of P, G and A, zeros included, of the dense form,
# which would take many seconds beyond.
DENSE_VARIABLES, DENSE_ENTRIES = 2000, 16_000_000
# Least huge bound or h_i, which stands for infinity and whose products round off all
# other terms of a sum, relative to the largest of 1, |b| and those below HUGE.
HUGE = 1e6
# Statuses after which a QP is solved in another way.
UNDECIDED = (Status.STALLED, Status.NUMERICAL_ERROR)


class Chain:
    """Transforms one after another, the user's end first.

    A transform has the methods `point`, which maps a point back to the problem before
    it, and `guess`, which maps a guess forward. With data = 0.0, `point` maps what is
    scaled at will: a ray, or multipliers that prove infeasibility; q, b and the bounds
    count as 0 then.
    """

    def __init__(self, *transforms):
        self.transforms = transforms

    def then(self, *transforms):
        return Chain(*self.transforms, *transforms)

    def point(self, *parts, data=1.0):
        """Return the user's point; `parts` as the last transform takes them."""
        for transform in reversed(self.transforms):
            parts = transform.point(*parts, data)
        return Point(*parts)


NO_TRANSFORMS = Chain()


class Memory:
    """What a solve keeps for the next QP with the same matrices or the same pattern.

    `convex` is the last P found positive semidefinite, `box` the last one prepared for
    box LCPs; `scaled` keeps factors and orders. Matrices are the same as before where
    they are the same objects. Not for two solves at a time.
    """

    def __init__(self, convex=None):
        self.convex = convex
        self.substitution = self.scaled = self.box = None

    def ensure_convex(self, P, deadline=NEVER):
        """Raise NotConvex unless P is positive semidefinite; test the same P once."""
        if self.convex is not P:
            check_convex(P, deadline)
            self.convex = P

    def prepared(self, P):
        if self.box is None or self.box.A.data is not P.data:
            self.box = Prepared(P.T)
        return self.box


def solve_checked(qp, options, guess, start, progress=None, memory=None, given=None):
    """Solve a checked QP; `start` is the perf_counter() of the call.

    `progress` takes the rows; `memory` may be kept for the next problem of the same
    pattern; `given`: P, G and A as the user stores them, in whose order is summed.
    """
    if progress is None and options.verbose:
        progress = Progress(QP_COLUMNS, True)
    if progress is not None:
        progress.say(describe(qp, options))
    limits = options.limits(start, progress)
    relaxation, stage = options.relaxation, None
    if relaxation:
        weights_of(qp, relaxation)  # raises where there are too many or too few

    def doubt(judge):
        """Seek the least shifts; tell whether they prove that no x is feasible."""
        nonlocal stage
        proof, stage = contradiction(qp, limits, route)
        return proof is not None and judge.accept_multipliers(proof.x, proof.y, proof.z)

    with threads_for(qp, options), np.errstate(all="ignore"):
        answer = route(qp, guess, limits, memory, given, doubt)
        if answer.status is Status.NUMERICAL_ERROR:
            nothing = Point(*(v * np.nan for v in answer.point))
            answer = answer._replace(point=nothing, residuals=UNDEFINED)
        if relaxation and answer.status is Status.PRIMAL_INFEASIBLE:
            same = stage if relaxation is RELAXATIONS["closest"] else None
            found = nearest(qp, relaxation, limits, route, same)
            answer = answer._replace(closest=found)
    if progress is not None:
        progress.close(answer, start)
    return answer


def threads_for(qp, options):
    """Let BLAS have the threads that a solve may use, in a `with` block."""
    order = qp.q.size + qp.h.size + qp.b.size
    return blas_threads(options.threads, order, qp.is_dense)


def route(qp, guess, limits, memory=None, given=None, doubt=None):
    """Solve a checked QP; if it stalls, go on without its huge bounds."""
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

    A tiny problem is tried in dense form before: as it came, and once.
    """
    memory, substitution, last = memory or Memory(), None, solve_by_engines
    if not qp.is_dense and qp.h.size + qp.b.size > 0:
        if entries_of(qp) <= TINY_ENTRIES and takes_dense(qp):  # once, as it came
            found = solve_dense(qp, NO_TRANSFORMS, guess, judge)
            if found is not None and found.status in ENDS:
                return found
            last = solve_interior
        substitution = substitute(qp, memory.substitution, judge.limits.deadline)
    memory.substitution = substitution
    if substitution is not None:
        memory.convex = substitution.P  # P was checked; this adds only squares
        chain = Chain(substitution)
        small, forward = substitution.problem, substitution.guess(guess)
        answer = solve_by_engines(small, chain, forward, judge, memory)
        if answer.status not in UNDECIDED:
            return answer
        guess, memory = make_guess(qp, None, answer.point), Memory()
    return last(qp, NO_TRANSFORMS, guess, judge, memory)


def solve_by_engines(qp, chain, guess, judge, memory):
    """Return the first answer that decides, else that of the last engine."""
    for suits, solve in ENGINES:
        if suits(qp):
            found = solve(qp, chain, guess, judge, memory)
            if found is not None and found.status in ENDS:
                return found
    return found


def without_huge_bounds(qp):
    """Return the QP with its huge bounds made infinite; None if it has none."""
    sides = qp.h, -qp.lb, qp.ub
    sizes = np.abs(np.concatenate(sides))
    huge = HUGE * np.abs(qp.b).max(initial=sizes[sizes < HUGE].max(initial=1.0))
    h, low, ub = (np.where(v >= huge, np.inf, v) for v in sides)
    if all(map(np.array_equal, (h, low, ub), sides)):
        return None
    return qp._replace(h=h, lb=-low, ub=ub)


def entries_of(qp):
    return qp.q.size * (qp.q.size + qp.h.size + qp.b.size)


def is_small(qp):
    entries = entries_of(qp)
    if qp.q.size > DENSE_VARIABLES or entries > DENSE_ENTRIES:
        return False
    if entries <= FEW_ENTRIES:
        return True
    matrices = qp.P, qp.G, qp.A
    filled = [np.count_nonzero(M) if qp.is_dense else M.data.size for M in matrices]
    return 100 * sum(filled) >= FULL * entries


def takes_bounds(qp):
    return (
        qp.h.size + qp.b.size == 0
        and (qp.q.size > MOST_BOX or not is_small(qp))
        and is_box_open(qp.lb, qp.ub)
    )


def takes_dense(qp):
    """Tell whether the dense form promises more than interior points."""
    if not is_small(qp):
        return False
    most, cost = (MOST_LINEAR, qp.P) if qp.is_dense else (SPARSE_LINEAR, qp.P.data)
    return qp.q.size <= most or cost.any()


ENGINES = (
    (takes_bounds, solve_bounds),
    (takes_dense, solve_dense),
    (lambda qp: True, solve_interior),
)
"""The methods for QPs, in order: whether one is tried, and its answer, None if that is
nothing. chain: the way from the user's QP to `qp`."""


def describe(qp, options):
    bounds = np.count_nonzero(np.isfinite(qp.lb)) + np.count_nonzero(np.isfinite(qp.ub))
    kind = "dense" if qp.is_dense else "sparse"
    return (
        f"namlcp  QP: n = {qp.q.size}, equalities = {qp.b.size}, "
        f"inequalities = {qp.h.size}\n"
        f"  {kind}, bounds = {bounds}; stop: eps_abs = {options.eps_abs:g}, "
        f"eps_rel = {options.eps_rel:g}"
    )
