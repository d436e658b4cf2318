"""QPs with bounds alone, solved as box LCPs; the table translates the names.

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
    LARGE_LCP,
    LCP,
    Attempt,
    Outcome,
    Prepared,
    pivot,
    relax_csr,
    solve_auto,
)
from namlcp.limits import Limits
from namlcp.linalg import add_columns
from namlcp.qp.answer import Answer, proved
from namlcp.qp.certificates import accept_dual
from namlcp.qp.guess import NO_ENTRIES, Guess
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP, Point
from namlcp.qp.rounding import correct_rounding, is_correctable
from namlcp.residuals import Residuals, ordered_qp_residuals, qp_residuals
from namlcp.status import Status


def box_lcp(qp: QP, matrix: Prepared | None = None) -> LCP:
    """Return a QP with bounds alone as a box LCP; `matrix` is P if it was prepared.

    P is symmetric: its compressed columns are its compressed rows.
    """
    matrix = matrix or Prepared.unchecked(qp.P, symmetric=True)
    return LCP(matrix, qp.q, qp.lb, qp.ub)


def box_point(qp: QP, z: np.ndarray) -> tuple[Point, Residuals]:
    """Return the point of the QP for z of the LCP, and its residuals on the QP."""
    P, q, lb, ub = qp.P, qp.q, qp.lb, qp.ub
    if qp.is_dense:
        with np.errstate(all="ignore"):  # overflow is no solution
            w = P @ z + q
        x, z_box = on_bounds(z, w, lb, ub)
        point = Point(x, NO_ENTRIES, NO_ENTRIES, z_box)
        return point, qp_residuals(*qp, *point)
    columns = P.indptr, P.indices, P.data
    x, z_box, residuals = measured_box(columns, (q, lb, ub), z)
    return Point(x, NO_ENTRIES, NO_ENTRIES, z_box), Residuals(*residuals)


@kernel
def measured_box(P, vectors, z):
    """Return x, z_box and the numbers of `Residuals` of the QP for z of the LCP.

    P = (indptr, indices, data), vectors = (q, lb, ub). One call takes 5 us less than
    one for each step.
    """
    q, lb, ub = vectors
    none, zeros = q[:0], np.zeros(q.size)
    w, Px = q.copy(), np.zeros(q.size)
    add_columns(P[0], P[1], P[2], z, w)
    x, z_box = on_bounds(z, w, lb, ub)
    add_columns(P[0], P[1], P[2], x, Px)
    products = Px, none, none, zeros, zeros
    measured = ordered_qp_residuals(
        (q, none, none, lb, ub), (x, none, none, z_box), products
    )
    return x, z_box, measured


def corrected_point(qp: QP, z: np.ndarray, limits: Limits) -> tuple[Point, Residuals]:
    """Return `box_point`, corrected where its residuals are rounding."""
    point, residuals = box_point(qp, z)
    if is_correctable(residuals, *limits.tolerances):
        point = correct_rounding(qp, point, residuals, *limits.tolerances)
        residuals = qp_residuals(*qp, *point)
    return point, residuals


@kernel
def on_bounds(z, w, lower, upper):
    """Return (x, z_box) of the QP for z, w and the bounds of the LCP, all (n,).

    x_j = z_j and z_box_j = 0 where z_j - w_j lies between the bounds. Elsewhere x_j is
    the bound and z_box_j = -w_j; a w_j too small to move z_j - w_j may have the wrong
    sign: then z_box_j = 0, and w_j remains as a dual residual.
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
    """Tell whether the box has a finite point."""
    for j in range(lower.size):
        if lower[j] > upper[j] or lower[j] == np.inf or upper[j] == -np.inf:
            return False
    return True


# Relative tolerances of the LCP that `solve_large_box` tries one after another.
SHARPER = (ACCURACY, 1e-11, 1e-13)


def solve_bounds(qp: QP, guess: Guess, limits: Limits, memory: Memory) -> Answer | None:
    """Solve a QP with bounds alone as a box LCP; None if that decides nothing."""
    large = not qp.is_dense and qp.q.size >= LARGE_LCP
    limits.announce(relax_csr if large else pivot)
    if large:
        memory.ensure_convex(qp.P)
        outcome = solve_large_box(qp, guess, limits, memory)
    else:
        inner = Limits(0.0, ACCURACY, limits.max_iter, limits.deadline)
        attempt = Attempt(box_lcp(qp), guess.start, inner, ask_convex=True)
        attempt.run()
        now = attempt.work.now
        if now.solved and now.convex:  # the residuals of the LCP need no check
            point, residuals = corrected_point(qp, attempt.best(), limits)
            if residuals.solved(*limits.tolerances):
                count = now.factorisations
                return Answer(Status.SOLVED, point, residuals, count, "bounds")
        outcome = attempt.outcome()
    status, iterations = outcome.status, outcome.iterations
    point, residuals = corrected_point(qp, outcome.z, limits)
    if outcome.ray is not None:
        memory.ensure_convex(as_sparse(qp.P))
        proof = accept_dual(
            qp, point.x, NO_ENTRIES, NO_ENTRIES, outcome.ray, limits.eps_abs
        )
        if proof is None:
            return None
        return proved(Status.DUAL_INFEASIBLE, proof, iterations, "bounds")
    if residuals.solved(*limits.tolerances):
        if not outcome.convex:
            return None  # the interior-point method may find that P is not convex
        status = Status.SOLVED
    elif status is Status.SOLVED:
        status = Status.STALLED
    return Answer(status, point, residuals, iterations, "bounds")


def solve_large_box(qp: QP, guess: Guess, limits: Limits, memory: Memory) -> Outcome:
    """Solve the box LCP with sharper tolerances until the residuals of the QP pass.

    The duality gap of the QP adds up the errors of all unknowns.
    """
    lcp, z0 = box_lcp(qp, memory.prepared(qp.P)), guess.start
    for eps_rel in SHARPER:
        inner = Limits(0.0, eps_rel, limits.max_iter, limits.deadline)
        found = solve_auto(lcp, z0, inner)
        _, residuals = box_point(qp, found.z)
        if found.status is not Status.SOLVED or residuals.solved(*limits.tolerances):
            break
        z0 = found.z
    return found._replace(convex=True)
