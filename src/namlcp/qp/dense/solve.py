"""A small or full QP by dual pivots, as an `Answer` judged on the data it was given."""

from typing import Any

import numpy as np

from namlcp.limits import Limits
from namlcp.linalg import as_dense
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.answer import Answer
from namlcp.qp.certificates import accept_dual, accept_primal
from namlcp.qp.dense import pivots
from namlcp.qp.dense.units import column_units, in_units
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP, Point
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Status

NO_HINT = np.empty(0, dtype=np.int64)


# A tolerance below this times the terms of the gap is decided by their rounding.
ROUNDING = 4e-15


def solve_dense(qp: QP, guess: Guess, limits: Limits) -> Answer | None:
    """Pivot on the multipliers' LCP; None where it does not decide."""
    limits.announce(pivots.solve)
    own = qp
    if not qp.is_dense:
        own = qp._replace(P=as_dense(qp.P), G=as_dense(qp.G), A=as_dense(qp.A))
    hint = NO_HINT
    if guess.active.size:
        hint = qp.b.size + np.flatnonzero(guess.active)
    found = call_dense(own, guess.x, hint, limits)
    c = None
    if found[0] == pivots.UNEVEN:
        c = column_units(own.P)
        start = guess.x / c if guess.x.size else guess.x
        found = call_dense(in_units(own, c), start, hint, limits)
    code, count, x, y, z, z_box, numbers = found
    if code in (pivots.NOT_CONVEX, pivots.UNEVEN):
        return None
    if c is not None:
        x, z_box = c * x, c * z_box if code == pivots.UNBOUNDED else z_box / c
    point, residuals = Point(x, y, z, z_box), Residuals(*numbers)
    if c is not None or residuals.gap_size * ROUNDING > limits.eps_abs:
        residuals = qp_residuals(*qp, *point)
    status = Status.TIME_LIMIT if code == pivots.LATE else Status.STALLED
    if residuals.solved(*limits.tolerances):
        status = Status.SOLVED
    if code in (pivots.INFEASIBLE, pivots.UNBOUNDED):
        if code == pivots.INFEASIBLE:
            status = Status.PRIMAL_INFEASIBLE
            proof = accept_primal(qp, x, y, z, limits.eps_abs)
        else:
            status = Status.DUAL_INFEASIBLE
            proof = accept_dual(qp, x, y, z, z_box, limits.eps_abs)
        if proof is None:
            return None
        point, residuals = proof, UNDEFINED
    if limits.report is not None:
        limits.report(count, *residuals[:3], 0.0, int((point.z > 0).sum()))
    return Answer(status, point, residuals, count, "dual")


def call_dense(
    qp: QP, start: np.ndarray, hint: np.ndarray, limits: Limits
) -> tuple[Any, ...]:
    """Return what `pivots.solve` returns, by the deadline."""
    n, rows = qp.q.size, qp.h.size + qp.b.size
    most = limits.max_iter or DEFAULT_OPTIONS.max_iter
    work = 4.0 * most * n * (n + rows)
    return limits.deadline.run(pivots.solve, work, *qp, start, hint, most)
