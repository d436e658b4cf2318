"""A checked QP by the `route`, then the closest point; what is printed of it."""

from time import perf_counter
from typing import Any

import numpy as np

from namlcp.limits import Deadline, Limits
from namlcp.linalg import blas_threads
from namlcp.options import RELAXATIONS, Options
from namlcp.outcome import Outcome
from namlcp.progress import QP_COLUMNS, Progress
from namlcp.qp.closest import StageOne, contradiction, nearest, weights_of
from namlcp.qp.guess import Guess
from namlcp.qp.judge import Judge
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP, Point
from namlcp.qp.route import route
from namlcp.residuals import UNDEFINED
from namlcp.status import Status


def solve_checked(
    qp: QP,
    options: Options,
    guess: Guess,
    start: float,
    progress: Progress | None = None,
    memory: Memory | None = None,
    given: tuple[Any, Any, Any] | None = None,
) -> Outcome:
    """Solve a checked QP; `start` is the perf_counter() of the call.

    `progress` takes the rows; where they are printed, it is made here if it is None.
    `memory` may be kept for the next problem of the same pattern; it is changed.
    `given`: P, G and A as the user stores them, in whose order sums are judged.
    """
    if progress is None and options.verbose:
        progress = Progress(QP_COLUMNS, True)
    if progress is not None:
        progress.say(describe(qp, options))
    deadline = Deadline(start + options.time_limit)
    limits = options.limits(deadline, progress)
    relaxation = options.relaxation
    if relaxation:
        weights_of(qp, relaxation)  # raises where there are too many or too few
    order = qp.q.size + qp.h.size + qp.b.size
    threads = blas_threads(options.threads, order, qp.is_dense)
    with threads, np.errstate(all="ignore"):
        doubt = Doubt(qp, limits)
        answer = route(qp, guess, limits, memory, given, doubt.proves)
        if answer.status is Status.NUMERICAL_ERROR:
            nothing = Point(*(v * np.nan for v in answer.point))
            answer = answer._replace(point=nothing, residuals=UNDEFINED)
        if relaxation and answer.status is Status.PRIMAL_INFEASIBLE:
            stage = doubt.stage if relaxation is RELAXATIONS["closest"] else None
            found = nearest(qp, relaxation, limits, route, stage)
            answer = answer._replace(closest=found)
    if progress is not None:
        progress.close(conclude(answer, perf_counter() - start))
    return answer


class Doubt:
    """Whether a QP is infeasible; `stage`: its least shifts, once they were sought."""

    stage: StageOne | None = None

    def __init__(self, qp: QP, limits: Limits) -> None:
        self.qp, self.limits = qp, limits

    def proves(self, judge: Judge) -> bool:
        """Tell whether they prove it; the judge has the certificate then."""
        proof, self.stage = contradiction(self.qp, self.limits, route)
        return proof is not None and judge.accept_multipliers(proof.x, proof.y, proof.z)


def describe(qp: QP, options: Options) -> str:
    """Return the first lines of the verbose output."""
    bounds = np.count_nonzero(np.isfinite(qp.lb)) + np.count_nonzero(np.isfinite(qp.ub))
    kind = "dense" if qp.is_dense else "sparse"
    return (
        f"namlcp  QP: n = {qp.q.size}, equalities = {qp.b.size}, "
        f"inequalities = {qp.h.size}\n"
        f"  {kind}, bounds = {bounds}; stop: eps_abs = {options.eps_abs:g}, "
        f"eps_rel = {options.eps_rel:g}"
    )


def conclude(answer: Outcome, seconds: float) -> str:
    """Return the closing sentence of the verbose output."""
    status, r = answer.status.value, answer.residuals
    return (
        f"{status}: {answer.method}, {answer.iterations} it, {seconds:.1e} s"
        f", primal {r.primal:.0e}, dual {r.dual:.0e}, gap {r.gap:.0e}"
    )
