"""Certificates: multipliers that prove a QP infeasible, rays that prove it unbounded.

Primal infeasible: (y, z >= 0, z_box) with A'y + G'z + z_box = 0 and
b'y + h'z + lb'z_box^- + ub'z_box^+ = -1 (Farkas). Unbounded: a direction d, q'd = -1,
with P d = 0, A d = 0, G d <= 0, d in the recession cone of the bounds. Every form
proposes candidates; `accept_primal` and `accept_dual` alone accept them.

One bound or one row may prove it alone. Where lb_j > ub_j, z_box_j = 1 / (lb_j - ub_j)
is the multiplier of both bounds, which cancel each other in the first equation; where
lb_j = inf, ub_j = -inf or h_i = -inf, it is -1, 1 or 1. All others are 0 then.

The test of a Farkas certificate: let r be the residual of the first equation and lam
the 1-norm of the multipliers. Every x that violates no constraint by more than t has
1 <= |r|_inf |x|_1 + t lam. The certificate thus excludes all x with |x|_1 below
(1 - t lam)/|r|_inf; if r = 0, every x violates some constraint by 1/lam or more.
"""

import numpy as np

from namlcp.qp.acceptance import accepted
from namlcp.qp.bounds import is_box_open
from namlcp.qp.problem import QP, Point
from namlcp.residuals import UNDEFINED, Residuals

LARGEST = float(np.finfo(float).max)
Proof = tuple[Point, Residuals]
"""A certificate, and as `dual` and `primal` the residuals |A'y + G'z + z_box|, or |P d|
and the largest of |A d| and (G d)+."""
NO_RESIDUAL = UNDEFINED._replace(dual=0.0)


def accept_primal(
    qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, tol: float
) -> Proof | None:
    """Return (NaN, y, z, z_box) with value -1 if it proves that no x is feasible.

    z_box follows from y and z; x is the current point, `tol` the absolute tolerance.
    """
    found = accepted(qp, (x, y, z), None, tol)
    if found is None:
        return None
    point = Point(np.full(x.size, np.nan), *found[0])
    return point, UNDEFINED._replace(dual=found[2])


def accept_dual(
    qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, d: np.ndarray, tol: float
) -> Proof | None:
    """Return (d, NaN, NaN, NaN) with q'd = -1 if it proves unboundedness.

    d is first clipped to the recession cone of the bounds; (x, y, z) is the current
    point, `tol` the absolute tolerance.
    """
    found = accepted(qp, (x, y, z), d, tol)
    if found is None:
        return None
    point = Point(*found[0], *(np.full(v.size, np.nan) for v in (y, z, d)))
    return point, UNDEFINED._replace(primal=found[1], dual=found[2])


def alone(qp: QP, eps_abs: float, eps_rel: float) -> tuple[str, Proof] | None:
    """Return why one bound, or one row, proves that no x is feasible, if one does.

    Bounds contradict each other if no x is within tolerance of both.
    """
    empty = (qp.h == -np.inf).nonzero()[0]
    if is_box_open(qp.lb, qp.ub) and not empty.size:
        return None
    size = np.minimum(np.maximum(np.abs(qp.lb), np.abs(qp.ub)), LARGEST)
    crossed = 0.5 * qp.lb - 0.5 * qp.ub > eps_abs + eps_rel * size  # NaN for inf - inf
    wrong = (crossed | (qp.lb == np.inf) | (qp.ub == -np.inf)).nonzero()[0]
    if not (wrong.size or empty.size):
        return None
    proof = qp.point(np.full(qp.q.size, np.nan))
    for j in wrong[:1]:
        low, high = float(qp.lb[j]), float(qp.ub[j])
        is_finite = np.isfinite((low, high)).all()
        proof.z_box[j] = 0.5 / (0.5 * low - 0.5 * high) if is_finite else 1.0
        if low == np.inf:
            proof.z_box[j] = -1.0
        sides = f"lb = {low}, ub = {high}"
        return f"bounds of x[{j}] contradict each other: {sides}", (proof, NO_RESIDUAL)
    i = empty[0]
    proof.z[i] = 1.0
    return f"row {i} of G has h = -inf", (proof, NO_RESIDUAL)


def largest(*vectors: np.ndarray) -> float:
    """Return the largest modulus of all entries, 0 for none."""
    return max(float(np.abs(v).max(initial=0.0)) for v in vectors)
