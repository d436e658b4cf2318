"""A small or full QP by dual pivots, as an `Answer` judged on the data it was given."""

from typing import Any

import numpy as np

from namlcp.limits import Deadline
from namlcp.linalg import as_dense
from namlcp.options import Options
from namlcp.progress import Progress
from namlcp.qp import certificates
from namlcp.qp.answer import Answer
from namlcp.qp.dense import pivots
from namlcp.qp.dense.units import column_units, in_units
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Status

NO_HINT = np.empty(0, dtype=np.int64)


# A tolerance below this times the terms of the gap is decided by their rounding.
ROUNDING = 4e-15


def solve_dense(
    qp: QP,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
) -> Answer | None:
    """Pivot on the multipliers' LCP; None where it does not decide."""
    if progress is not None:
        progress.announce(pivots.solve)
    own = qp
    if not qp.is_dense:
        own = qp._replace(P=as_dense(qp.P), G=as_dense(qp.G), A=as_dense(qp.A))
    hint = NO_HINT
    if guess.active.size:
        hint = qp.b.size + np.flatnonzero(guess.active)
    found = call_dense(own, guess.x, hint, options, deadline)
    c = None
    if found[0] == pivots.UNEVEN:
        c = column_units(own.P)
        start = guess.x / c if guess.x.size else guess.x
        found = call_dense(in_units(own, c), start, hint, options, deadline)
    code, count, x, y, z, z_box, numbers = found
    if code in (pivots.NOT_CONVEX, pivots.UNEVEN):
        return None
    if c is not None:
        x, z_box = c * x, c * z_box if code == pivots.UNBOUNDED else z_box / c
    residuals = Residuals(*numbers)
    if c is not None or residuals.gap_size * ROUNDING > options.eps_abs:
        residuals = qp_residuals(*qp, x, y, z, z_box)
    solved = residuals.solved(options.eps_abs, options.eps_rel)
    status = Status.TIME_LIMIT if code == pivots.LATE else Status.STALLED
    if solved:
        status = Status.SOLVED
    if code in (pivots.INFEASIBLE, pivots.UNBOUNDED):
        tol = options.eps_abs
        if code == pivots.INFEASIBLE:
            status = Status.PRIMAL_INFEASIBLE
            proof = certificates.accept_primal(qp, x, y, z, tol)
        else:
            status = Status.DUAL_INFEASIBLE
            proof = certificates.accept_dual(qp, x, y, z, z_box, tol)
        if proof is None:
            return None
        x, y, z, z_box = proof
        residuals = UNDEFINED
    if progress is not None:
        progress.row(count, *residuals[:3], 0.0, int((z > 0).sum()))
    return Answer(status, x, y, z, z_box, residuals, count, "dual", "")


def call_dense(
    qp: QP,
    start: np.ndarray,
    hint: np.ndarray,
    options: Options,
    deadline: Deadline,
) -> tuple[Any, ...]:
    """Return what `pivots.solve` returns, by the deadline."""
    n, rows = qp.q.size, qp.h.size + qp.b.size
    work = 4.0 * options.max_iter * n * (n + rows)
    return deadline.run(pivots.solve, work, *qp, start, hint, options.max_iter)
