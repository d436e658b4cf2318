"""Solution of a small or dense QP by the dual active-set method."""

import ctypes

import numpy as np

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.answer import Answer
from namlcp.qp.certificates import accept_dual, accept_primal
from namlcp.qp.dense import pivots
from namlcp.qp.dense.scaling import scaled_qp, variable_scaling
from namlcp.qp.dense.state import DualState, numbers_needed
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point
from namlcp.qp.responses import ROUNDING, Held, parted, solve_once
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Status

NO_HINT = np.empty(0, dtype=np.int64)


def solve_dense(
    qp: QP, guess: Guess, limits: Limits, held: Held | None = None
) -> Answer | None:
    """Solve by responses, else by `pivots.solve`, scaled if need be.

    None where it does not decide; `held` as for `solve_once`.
    """
    own = qp.in_dense_form()
    answer = solve_once(own, guess, limits, held)
    if answer is not None:
        return answer
    limits.announce(pivots.solve)
    hint = NO_HINT
    if guess.active.size:
        hint = qp.b.size + np.flatnonzero(guess.active)
    c = None
    code, count, point, residuals = call_dense(own, guess.x, hint, limits)
    if code == pivots.BADLY_SCALED:
        c = variable_scaling(own.P)
        start = guess.x / c if guess.x.size else guess.x
        code, count, point, residuals = call_dense(
            scaled_qp(own, c), start, hint, limits
        )
    if code in (pivots.NOT_CONVEX, pivots.BADLY_SCALED):
        return None
    if c is not None:
        z_box = point.z_box
        z_box = c * z_box if code == pivots.UNBOUNDED else z_box / c
        point = point._replace(x=c * point.x, z_box=z_box)
    largest = max(residuals.primal_size, residuals.dual_size, residuals.gap_size)
    if c is not None or largest * ROUNDING > limits.eps_abs:
        # summed again in the order that qpsolvers uses
        residuals = qp_residuals(*qp, *point)
    if code in (pivots.INFEASIBLE, pivots.UNBOUNDED):
        if code == pivots.INFEASIBLE:
            status = Status.PRIMAL_INFEASIBLE
            proof = accept_primal(qp, *point[:3], limits.eps_abs)
        else:
            status = Status.DUAL_INFEASIBLE
            proof = accept_dual(qp, *point, limits.eps_abs)
        if proof is None:
            return None
        point, residuals = proof, UNDEFINED
    elif residuals.solved(limits.eps_abs, limits.eps_rel):
        status = Status.SOLVED
    else:
        late = code == pivots.TIME_LIMIT
        status = Status.TIME_LIMIT if late else Status.STALLED
    if limits.report is not None:
        limits.report(count, *residuals[:3], 0.0, int((point.z > 0).sum()))
    return Answer(status, point, residuals, count, "dual")


def call_dense(
    qp: QP, start: np.ndarray, hint: np.ndarray, limits: Limits
) -> tuple[int, int, Point, Residuals]:
    """Return what `call_kernel` returns, run under the deadline."""
    n, rows = qp.q.size, qp.h.size + qp.b.size
    most = limits.max_iter or DEFAULT_OPTIONS.max_iter
    work = 4.0 * most * n * (n + rows)
    return limits.deadline.run(call_kernel, work, qp, (start, hint), most)


def call_kernel(
    qp: QP, guess: tuple[np.ndarray, np.ndarray], max_iter: int, clock: int
) -> tuple[int, int, Point, Residuals]:
    """Return the code of `pivots.solve`, the pivots, the point and its residuals."""
    sizes = qp.q.size, qp.h.size, qp.b.size
    now, memory = DualState(max_iter=max_iter), np.empty(numbers_needed(*sizes))
    numbers = np.zeros(sum(sizes) + qp.q.size + len(Residuals._fields))
    address = ctypes.addressof(now)
    code = pivots.solve(address, tuple(qp), guess, memory, numbers, clock)
    return code, now.pivots, *parted(numbers, *sizes)
