"""QPs with bounds alone are box LCPs: the one module that knows both alphabets.

QP, bounds only                       box LCP
P, q                                  A, q
lb <= x <= ub                         lower <= z <= upper
x                                     z
-z_box = P x + q                      w = A z + q
z_box <= 0 at lb, >= 0 at ub          w >= 0 at lower, <= 0 at upper
ray x, q'x = -1                       ray v, q'v = -1 (no solution)
"""

import numpy as np

from namlcp.checks import as_sparse
from namlcp.compiled import kernel
from namlcp.lcp import (
    ACCURACY,
    LARGE,
    LCP,
    Outcome,
    Prepared,
    pivot,
    relax_csr,
    solve_auto,
    solve_box,
)
from namlcp.limits import Deadline, Limits
from namlcp.options import Options
from namlcp.progress import Progress
from namlcp.qp import certificates
from namlcp.qp.answer import Answer
from namlcp.qp.guess import NOTHING, Guess
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP
from namlcp.residuals import UNDEFINED, qp_residuals
from namlcp.status import Status


def box_lcp(qp: QP, matrix: Prepared | None = None) -> LCP:
    """Return the box LCP that a QP with bounds only is, of a matrix prepared before.

    P is symmetric, so that its compressed columns pass for compressed rows.
    """
    matrix = matrix or Prepared.unchecked(qp.P, symmetric=True)
    return LCP(matrix, qp.q, qp.lb, qp.ub)


@kernel
def box_point(z, w, lower, upper):
    """Return (x, z_box): x on its bound and z_box = -w where z - w leaves the box.

    Elsewhere z_box = 0; a w of the wrong sign, too small to move z - w off its bound,
    is left to the residual.
    """
    x, z_box = np.empty(z.size), np.empty(z.size)
    for j in range(z.size):
        s = z[j] - w[j]
        x[j], z_box[j] = z[j], 0.0
        if s <= lower[j]:
            x[j], z_box[j] = lower[j], min(-w[j], 0.0)
        elif s >= upper[j]:
            x[j], z_box[j] = upper[j], max(-w[j], 0.0)
    return x, z_box


@kernel
def is_box_open(lower, upper):
    """Tell whether there is a finite point in the box."""
    for j in range(lower.size):
        if lower[j] > upper[j] or lower[j] == np.inf or upper[j] == -np.inf:
            return False
    return True


# Relative residuals of the LCP tried one after another for a large QP with bounds.
SHARPER = (ACCURACY, 1e-11, 1e-13)


def solve_bounds(
    qp: QP,
    options: Options,
    guess: Guess,
    deadline: Deadline,
    progress: Progress | None,
    memory: Memory,
) -> Answer | None:
    """Solve the box LCP that bounds alone make; None where it does not decide."""
    large = not qp.is_dense and qp.q.size >= LARGE
    if progress is not None:
        progress.announce(relax_csr if large else pivot)
    limits = Limits(0.0, ACCURACY, options.max_iter, deadline)
    if large:
        memory.ensure_convex(qp.P)
        outcome = solve_large_box(qp, options, guess, memory, limits)
    else:
        outcome = solve_box(box_lcp(qp), guess.point, limits, ask_convex=True)
    status, iterations, ray = outcome.status, outcome.iterations, outcome.ray
    x, z_box = box_point(outcome.z, outcome.w, qp.lb, qp.ub)
    if ray is not None:
        memory.ensure_convex(as_sparse(qp.P))
        proof = certificates.accept_dual(qp, x, NOTHING, NOTHING, ray, options.eps_abs)
        if proof is None:
            return None
        return Answer(
            Status.DUAL_INFEASIBLE, *proof, UNDEFINED, iterations, "bounds", ""
        )
    residuals = qp_residuals(*qp, x, NOTHING, NOTHING, z_box)
    if residuals.solved(options.eps_abs, options.eps_rel):
        if not outcome.convex:
            return None  # the path looks closer, and may refuse
        status = Status.SOLVED
    elif status is Status.SOLVED:
        status = Status.STALLED
    return Answer(
        status, x, NOTHING, NOTHING, z_box, residuals, iterations, "bounds", ""
    )


def solve_large_box(
    qp: QP,
    options: Options,
    guess: Guess,
    memory: Memory,
    limits: Limits,
) -> Outcome:
    """Solve the box LCP of a convex QP until that, not the LCP, is solved.

    The gap adds up what each of many unknowns leaves.
    """
    lcp, z0 = box_lcp(qp, memory.prepared(qp.P)), guess.point
    for eps_rel in SHARPER:
        found = solve_auto(lcp, z0, limits._replace(eps_rel=eps_rel))
        x, z_box = box_point(found.z, found.w, qp.lb, qp.ub)
        residuals = qp_residuals(*qp, x, NOTHING, NOTHING, z_box)
        if found.status is not Status.SOLVED or residuals.solved(
            options.eps_abs, options.eps_rel
        ):
            break
        z0 = found.z
    return found._replace(convex=True)
