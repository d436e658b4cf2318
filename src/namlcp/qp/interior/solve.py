"""Solution of a QP by the interior-point method: presolve, scale, iterate, map back."""

from typing import Any

import numpy as np

from namlcp.checks import as_sparse
from namlcp.limits import PASS
from namlcp.qp.certificates import alone
from namlcp.qp.interior.loop import run, try_guess
from namlcp.qp.interior.state import Interior
from namlcp.qp.judge import Judge
from namlcp.qp.problem import QP, Guess
from namlcp.qp.transforms import Presolved, ScaledQP, presolve
from namlcp.status import Outcome, Status

FORM = "path"


def solve_interior(
    qp: QP, chain: Any, guess: Guess, judge: Judge, memory: Any
) -> Outcome:
    """Solve a QP; ValueError if P is not positive semidefinite.

    If the active set of the guess is the right one, no iteration is needed. `memory`
    holds the factors of a problem solved before, and takes those of this one.
    """
    limits, deadline = judge.limits, judge.limits.deadline
    for name in ("P", "G", "A") if qp.is_dense else ():
        M = getattr(qp, name)
        deadline.check(PASS * M.size)
        qp = qp._replace(**{name: as_sparse(M)})
    entries = qp.P.data.size + qp.G.data.size + qp.A.data.size
    deadline.check()
    memory.ensure_convex(qp.P, deadline)
    found = alone(judge.qp, *limits.tolerances)
    if found is not None:
        message, proof = found
        judge.keep(Status.PRIMAL_INFEASIBLE, proof)
        return judge.answer(Status.PRIMAL_INFEASIBLE, 0, FORM, message)
    if judge.is_solved:  # by an engine that could not tell whether P is convex
        return judge.answer(Status.SOLVED, 0, FORM)
    deadline.check(PASS * entries)
    small = presolve(qp, *limits.tolerances, memory.presolved)
    memory.presolved = small
    reason = refuted(small, chain, judge)
    if reason is not None:
        return judge.answer(Status.PRIMAL_INFEASIBLE, 0, FORM, reason)
    if small.q.size == 0:
        none, zero = np.empty(0), np.zeros(small.sides.shape)
        judge.offer(chain.then(small).point(none, np.zeros(small.b.size), zero, none))
        return judge.answer(Status.STALLED, 0, FORM)
    deadline.check(2.0 * PASS * entries)
    problem = memory.scaled = ScaledQP(small, memory.scaled)
    deadline.check()
    m = Interior(problem, chain.then(small, problem), judge, limits)
    if guess.x.size and try_guess(m, guess):
        return judge.answer(Status.SOLVED, 0, FORM)
    return judge.answer(run(m, guess), m.iterations, FORM)


def refuted(small: Presolved, chain: Any, judge: Judge) -> str | None:
    """Return why the constraints contradict each other, as presolve found, or None."""
    for message, y, z in small.contradictions:
        small.hold_fixed(np.zeros(small.qp.q.size), y, z)
        x = chain.then(small).primal(np.zeros(small.q.size))
        if judge.accept_multipliers(x, *chain.certificate(y, z)):
            return message
    return None
