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

from typing import Any

import numpy as np
from scipy.sparse import csc_array

from namlcp.checks import as_sparse
from namlcp.linalg import add_transposed, by_rows, times, without_zeros
from namlcp.qp.acceptance import farkas_numbers, is_clear, is_contradiction, is_ray
from namlcp.qp.bounds import is_box_open
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP, Point
from namlcp.qp.transforms import equilibrate
from namlcp.residuals import UNDEFINED, Residuals

# The user's own units of x, y and z.
ONES = 3 * (np.ones(1),)
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
    z_kept = np.where((z <= 0.0) | np.isinf(qp.h), 0.0, z)  # NaN is kept
    s = np.zeros(x.size)
    add_transposed(qp.G, z_kept, s)
    add_transposed(qp.A, y, s)
    z_box, numbers = farkas_numbers((qp.b, qp.h, qp.lb, qp.ub), y, z_kept, s)
    value, moduli, lam = numbers
    if not is_clear(value, moduli):
        return None
    y, z, z_box, s = (v / -value for v in (y, z_kept, z_box, s))
    margin, moduli = tol * lam / -value, moduli / -value

    def proves(units: tuple[np.ndarray, ...]) -> bool:
        """Tell whether the multipliers pass in units of x, y and z."""
        d, a, g = units
        worst = largest((s + z_box) * d)
        most = max(largest(y / a), largest(z / g), largest(z_box * d))
        return is_contradiction(worst, most, np.abs(x / d).sum(), margin, moduli)

    if not (proves(ONES) and proves(equilibration(qp, csc_array((x.size, x.size))))):
        return None
    point = Point(np.full(x.size, np.nan), y, z, z_box)
    return point, UNDEFINED._replace(dual=largest(s + z_box))


def equilibration(qp: QP, P: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return factors of x, y and z that equilibrate P, A and G.

    Without them a column of tiny entries would have a tiny residual for any y and z,
    and a variable that counts in large units one for any step along it.
    """
    n, p = qp.q.size, qp.b.size
    A, G = (by_rows(without_zeros(as_sparse(M))) for M in (qp.A, qp.G))
    kkt = KKT(csc_array(P), A, G)
    scale = np.ones(kkt.size)
    equilibrate(kkt.indptr, kkt.indices, kkt.base, scale)
    return scale[:n], scale[n : n + p], scale[n + p :]


def accept_dual(
    qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, d: np.ndarray, tol: float
) -> Proof | None:
    """Return (d, NaN, NaN, NaN) with q'd = -1 if it proves unboundedness.

    d is first clipped to the recession cone of the bounds; (x, y, z) is the current
    point, `tol` the absolute tolerance.
    """
    d = np.where(np.isfinite(qp.ub), np.minimum(d, 0.0), d)
    d = np.where(np.isfinite(qp.lb), np.maximum(d, 0.0), d)
    terms = qp.q * d
    value, moduli = terms.sum(), np.abs(terms).sum()
    if not is_clear(value, moduli):
        return None
    d, moduli = d / -value, moduli / -value
    residuals = (
        times(qp.P, d),
        times(qp.A, d),
        np.where(np.isinf(qp.h), 0.0, np.maximum(times(qp.G, d), 0.0)),
    )
    matrices = qp.P, qp.A, qp.G
    left = max(map(uncancelled, matrices, 3 * (d,), residuals))
    margin = tol * np.abs(d).sum()

    def proves(units: tuple[np.ndarray, ...], sizes: list[float]) -> bool:
        """Tell whether d passes in units of x, y and z, for points of these sizes."""
        parts = [largest(u * v) for u, v in zip(units, residuals, strict=True)]
        error = float(np.dot(parts, sizes))
        return is_ray(max(parts), largest(d / units[0]), error, margin, moduli, left)

    if not proves(ONES, [max(1.0, np.abs(v).sum()) for v in (x, y, z)]):
        return None
    units = equilibration(qp, qp.P)
    if not proves(units, 3 * [max(1.0, largest(units[0] * qp.q))]):
        return None
    point = Point(d, *(np.full(v.size, np.nan) for v in (y, z, d)))
    dual, *primal = map(largest, residuals)
    return point, UNDEFINED._replace(primal=max(primal), dual=dual)


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


def uncancelled(M: Any, d: np.ndarray, Md: np.ndarray) -> float:
    """Return the largest |M d| over |M| |d| row by row: the same in any units."""
    terms = abs(M) @ np.abs(d)
    return largest(np.divide(Md, terms, out=np.zeros_like(Md), where=terms > 0.0))


def largest(v: np.ndarray) -> float:
    """Return max |v_i|, 0 for no entries."""
    return float(np.abs(v).max()) if v.size else 0.0
