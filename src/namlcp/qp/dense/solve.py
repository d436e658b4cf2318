"""Solution of a small or dense QP by the dual active-set method."""

import ctypes

import numpy as np

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.answer import Answer, proved
from namlcp.qp.certificates import accept_dual, accept_primal
from namlcp.qp.dense import pivots
from namlcp.qp.dense.scaling import scaled_qp, variable_scaling
from namlcp.qp.dense.state import DualState, numbers_needed
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point
from namlcp.qp.responses import ROUNDING, Held, parted, solve_once
from namlcp.residuals import Residuals, qp_residuals
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
        point = unscaled(point, c, code == pivots.UNBOUNDED)
    largest = max(residuals.primal_size, residuals.dual_size, residuals.gap_size)
    if c is not None or largest * ROUNDING > limits.eps_abs:
        # summed again in the order that qpsolvers uses
        residuals = qp_residuals(*qp, *point)
    answer = judged(qp, code, count, (point, residuals), limits)
    if answer is not None and limits.report is not None:
        active = int((answer.point.z > 0).sum())
        limits.report(count, *answer.residuals[:3], 0.0, active)
    return answer


def unscaled(point: Point, c: np.ndarray, is_ray: bool) -> Point:
    """Return the point of the QP in x from that in x / c.

    is_ray: z_box is a ray, see `pivots.solve`, and is scaled as x.
    """
    z_box = c * point.z_box if is_ray else point.z_box / c
    return point._replace(x=c * point.x, z_box=z_box)


def judged(
    qp: QP,
    code: int,
    count: int,
    found: tuple[Point, Residuals],
    limits: Limits,
) -> Answer | None:
    """Return the answer that a code of `pivots.solve` stands for.

    None: its certificate does not pass.
    """
    point, residuals = found
    if code == pivots.INFEASIBLE:
        proof = accept_primal(qp, *point[:3], limits.eps_abs)
        status = Status.PRIMAL_INFEASIBLE
        return None if proof is None else proved(status, proof, count, "dual")
    if code == pivots.UNBOUNDED:
        proof = accept_dual(qp, *point, limits.eps_abs)
        status = Status.DUAL_INFEASIBLE
        return None if proof is None else proved(status, proof, count, "dual")
    status = Status.TIME_LIMIT if code == pivots.TIME_LIMIT else Status.STALLED
    if residuals.solved(*limits.tolerances):
        status = Status.SOLVED
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
