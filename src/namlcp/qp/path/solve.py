"""Solution of a QP by the interior-point method: presolve, scale, iterate, map back."""

import numpy as np

from namlcp.checks import as_sparse
from namlcp.limits import Limits
from namlcp.qp.answer import Answer, proved
from namlcp.qp.guess import Guess
from namlcp.qp.judge import Judge
from namlcp.qp.memory import Memory
from namlcp.qp.path.advance import advance
from namlcp.qp.path.candidates import contradiction
from namlcp.qp.path.loop import Interior
from namlcp.qp.path.refinement import Refinement
from namlcp.qp.path.workspace import Workspace
from namlcp.qp.problem import QP
from namlcp.qp.transforms import ScaledQP, presolve
from namlcp.status import Status

FORM = "path"


def solve_path(qp: QP, guess: Guess, limits: Limits, memory: Memory) -> Answer:
    """Solve a QP with sparse matrices; ValueError if P is not positive semidefinite.

    If the active set of the guess is the right one, no iteration is needed. `memory`
    holds the factors of a problem solved before, and takes those of this one.
    """
    limits.announce(advance)
    own = qp
    if qp.is_dense:
        own = qp._replace(P=as_sparse(qp.P), G=as_sparse(qp.G), A=as_sparse(qp.A))
    memory.ensure_convex(own.P)
    answer = follow_path(own, guess, limits, memory)
    if qp.is_dense and answer.status is Status.SOLVED:  # dense sums round differently
        judge = Judge(qp, limits)
        judge.offer(answer.point)
        answer = judge.answer(Status.STALLED, answer.iterations, FORM)
    return answer


def follow_path(qp: QP, guess: Guess, limits: Limits, memory: Memory) -> Answer:
    """Solve a sparse convex QP."""
    small = presolve(qp, *limits.tolerances, memory.presolved)
    memory.presolved = small
    judge = Judge(qp, limits)
    for reason in small.contradictions:
        proof = contradiction(judge, small, reason)
        if proof is not None:
            return proved(Status.PRIMAL_INFEASIBLE, proof, 0, FORM, reason.message)
    if small.q.size == 0:
        none, zero = np.empty(0), np.zeros(small.lower.size)
        judge.offer(small.point(none, none, zero, zero, none))
        return judge.answer(Status.STALLED, 0, FORM)
    problem = memory.scaled = ScaledQP(small, memory.scaled)
    work = Workspace(problem, limits)
    refinement = Refinement(work, judge, limits.deadline)
    if guess.x.size:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            refinement.run(*problem.guess(guess))
        if judge.best <= 1.0:
            return judge.answer(Status.SOLVED, 0, FORM)
    loop = Interior(work, judge, limits, refinement)
    status = loop.run(guess)
    if loop.certificates.proof is not None:
        return proved(status, loop.certificates.proof, loop.iterations, FORM)
    return judge.answer(status, loop.iterations, FORM)
