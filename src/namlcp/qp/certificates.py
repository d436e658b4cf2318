"""Infeasible, unbounded, non-convex: found on the way and proved on the user's data.

Primal infeasible: (y, z >= 0, z_box) with A'y + G'z + z_box = 0 and
b'y + h'z + lb'z_box^- + ub'z_box^+ = -1 (Farkas). Unbounded: a direction d, q'd = -1,
with P d = 0, A d = 0, G d <= 0, d in the recession cone of the bounds. Candidates are
the iterate and the last Newton step, raw or *polished* (projected by one factorisation
of K). The proofs are accepted by `accept_primal` and `accept_dual` alone.

Meaning of the acceptance: every x that violates no constraint by more than t has
1 <= |r|_inf |x|_1 + t lam, with r the residual of the Farkas system and lam the 1-norm
of the multipliers, so that 1/lam is the margin by which the problem is infeasible.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csc_array

from namlcp.checks import as_sparse
from namlcp.linalg import by_rows, without_zeros
from namlcp.qp.kkt import KKT
from namlcp.qp.last_digits import Point
from namlcp.qp.problem import QP
from namlcp.qp.transforms import equilibrate

if TYPE_CHECKING:
    pass

ROUNDING = 1e3 * np.finfo(float).eps
CANCELLED = 1e-10  # of the terms of a row, in a proof without a radius


def accept_primal(
    qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, tol: float
) -> Point | None:
    """Return (NaN, y, z, z_box) scaled to -1 if it proves that no x is feasible.

    The bounds' multipliers are completed exactly; x is the point the residual is
    weighed with.
    """
    z = np.where(np.isinf(qp.h), 0.0, np.maximum(z, 0.0))
    s = qp.G.T @ z + qp.A.T @ y
    allowed = np.where(s < 0.0, np.isfinite(qp.ub), np.isfinite(qp.lb))
    z_box = np.where(allowed & (s != 0.0), -s, 0.0)
    up, down = np.flatnonzero(z_box > 0.0), np.flatnonzero(z_box < 0.0)
    rows = np.flatnonzero(z)
    terms = np.concatenate(
        (
            qp.b * y,
            qp.h[rows] * z[rows],
            qp.ub[up] * z_box[up],
            qp.lb[down] * z_box[down],
        )
    )
    value = terms.sum()
    if not value < -ROUNDING * np.abs(terms).sum():
        return None
    y, z, z_box = y / -value, z / -value, z_box / -value
    residual = np.abs(s / -value + z_box)
    lam = np.abs(y).sum() + z.sum() + np.abs(z_box).sum()
    claim = residual, x, y, z, z_box, tol * lam
    alone = np.ones(x.size), np.ones(y.size), np.ones(z.size)
    if is_contradiction(*claim, alone) and is_contradiction(*claim, equilibration(qp)):
        return np.full(x.size, np.nan), y, z, z_box
    return None


def is_contradiction(
    residual: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    z_box: np.ndarray,
    margin: float,
    scale: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> bool:
    """Tell whether the residual is small enough in these units of x, y and z."""
    d, a, g = scale
    worst = largest(residual * d)
    relative = worst / max(largest(y / a), largest(z / g), largest(z_box * d))
    radius = 1e3 * worst * max(1.0, float(np.abs(x / d).sum())) + margin
    return (relative <= 1e-8 and radius <= 1.0) or (relative <= 1e-12 and margin <= 0.5)


def equilibration(qp: QP) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return units of x, y and z in which no row or column of A and G is a tiny one.

    In the user's units a column of tiny entries would hide its residual.
    """
    n, p = qp.q.size, qp.b.size
    A, G = (by_rows(without_zeros(as_sparse(M))) for M in (qp.A, qp.G))
    kkt = KKT(csc_array((n, n)), A, G)
    scale = np.ones(kkt.size)
    equilibrate(kkt.indptr, kkt.indices, kkt.base, scale)
    return scale[:n], scale[n : n + p], scale[n + p :]


def accept_dual(
    qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, d: np.ndarray, tol: float
) -> Point | None:
    """Return (d, NaN, NaN, NaN) with q'd = -1 if it proves unboundedness."""
    d = np.where(np.isfinite(qp.ub), np.minimum(d, 0.0), d)
    d = np.where(np.isfinite(qp.lb), np.maximum(d, 0.0), d)
    terms = qp.q * d
    value = terms.sum()
    if not value < -ROUNDING * np.abs(terms).sum():
        return None
    d = d / -value
    Pd, Ad = qp.P @ d, qp.A @ d
    Gd = np.where(np.isinf(qp.h), 0.0, np.maximum(qp.G @ d, 0.0))
    parts = largest(Pd), largest(Ad), largest(Gd)
    relative = max(parts) / largest(d)
    weights = [max(1.0, np.abs(v).sum()) for v in (x, y, z)]
    radius = 1e3 * float(np.dot(parts, weights)) + tol * np.abs(d).sum()
    if (relative <= 1e-8 and radius <= 1.0) or (
        relative <= 1e-12
        and tol * np.abs(d).sum() <= 0.5
        and all(cancels(M, d, v) for M, v in ((qp.P, Pd), (qp.A, Ad), (qp.G, Gd)))
    ):
        nan_y, nan_z, nan = (np.full(v.size, np.nan) for v in (y, z, d))
        return d, nan_y, nan_z, nan
    return None


def cancels(M: Any, d: np.ndarray, Md: np.ndarray) -> bool:
    """Tell whether M d is small beside its own terms, row by row, in any units."""
    return bool((np.abs(Md) <= CANCELLED * (abs(M) @ np.abs(d))).all())


def largest(v: np.ndarray) -> float:
    """Return max |v_i|, 0 for no entries."""
    return float(np.abs(v).max()) if v.size else 0.0
