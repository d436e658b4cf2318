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
from namlcp.qp.transforms.presolve import Presolved, presolve
from namlcp.qp.transforms.scaling import ScaledQP
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
    if small.contradictions or not small.q.size:
        answer = answer_of_presolve(small, chain, judge)
        if answer is not None:
            return answer
    deadline.check(2.0 * PASS * entries)
    problem = memory.scaled = ScaledQP(small, memory.scaled)
    deadline.check()
    m = Interior(problem, chain.then(small, problem), judge, limits)
    if guess.x.size and try_guess(m, guess):
        return judge.answer(Status.SOLVED, 0, FORM)
    return judge.answer(run(m, guess), m.iterations, FORM)


def answer_of_presolve(small: Presolved, chain: Any, judge: Judge) -> Outcome | None:
    """Return the answer where constraints contradict each other or no x is left."""
    sizes = small.q.size, small.b.size, small.sides.shape, small.q.size
    near = chain.then(small).point(*map(np.zeros, sizes))
    for message, y, z in small.contradictions:
        none = np.zeros(small.qp.q.size)
        proof = chain.point(none, y, z, none, data=0.0)
        if judge.accept_multipliers(near.x, proof.y, proof.z):
            return judge.answer(Status.PRIMAL_INFEASIBLE, 0, FORM, message)
    if small.q.size:
        return None
    judge.offer(near)
    return judge.answer(Status.STALLED, 0, FORM)
