"""Corrections of a solution whose residuals are at rounding level, but too large.

A multiplier near 1e7 has rounding errors of 1e-9. Where the tolerance is less, they are
a dual residual; where the terms of the duality gap are near 1e11, they are a gap. Both
are linear in other unknowns, whose own residuals have tolerance left:

- the entry r_j of the dual residual goes into z_box_j where x_j has a bound on that
  side, else into x_j (a Gauss-Seidel step on the Lagrangian, dx_j = -r_j/P_jj);
- the gap g goes into multipliers with the sides s, dz = -g s/s's.

The judge measures every point made here like any other.
"""

from typing import Any

import numpy as np

from namlcp.compiled import kernel
from namlcp.linalg import add_transposed, times
from namlcp.qp.problem import QP, Point
from namlcp.residuals import Residuals, qp_residuals, signed_gap

# Gauss-Seidel passes over the dual residual.
PASSES = 3
# Corrections of the gap by a single multiplier, at most.
TRIES = 64
# Part of the tolerance above which an entry of the dual residual is corrected.
SHARE = 0.5


def correct_rounding(
    qp: QP, point: Point, found: Residuals, eps_abs: float, eps_rel: float
) -> Point:
    """Return the point, which has the residuals `found`, with smaller ones if possible.

    Matrices are CSC. Where nothing can be corrected the result is `point` itself.
    """
    tol = eps_abs + eps_rel * found.dual_size
    if found.dual > SHARE * tol:
        point = correct_dual_residual(qp, point, SHARE * tol)
        found = qp_residuals(*qp, *point)
    gap_tol = eps_abs + eps_rel * found.gap_size
    if found.gap > gap_tol and found.dual <= tol:
        point = correct_gap(qp, point, found.gap, gap_tol, tol - found.dual)
    return point


def correct_dual_residual(qp: QP, point: Point, tol: float) -> Point:
    """Return the point with dual residuals above `tol` moved into z_box or x."""
    point = point._replace(x=point.x.copy(), z_box=point.z_box.copy())
    r = times(qp.P, point.x) + qp.q
    for M, multiplier in ((qp.G, point.z), (qp.A, point.y)):  # as `qp_residuals` adds
        part = np.zeros(r.size)
        add_transposed(M, multiplier, part)
        r += part
    bounds = qp.lb, qp.ub
    P = qp.P
    gauss_seidel(P.indptr, P.indices, P.data, bounds, tol, r, (point.x, point.z_box))
    return point


@kernel
def gauss_seidel(indptr, indices, data, bounds, tol, r, unknowns):
    """Reduce |r_j + z_box_j| above tol by z_box_j, then by x_j; r = Px + q + C'v.

    bounds = (lb, ub), unknowns = (x, z_box).
    """
    lb, ub = bounds
    x, z_box = unknowns
    for _ in range(PASSES):
        for j in range(x.size):
            if abs(r[j] + z_box[j]) <= tol:
                continue
            least = -np.inf if lb[j] > -np.inf else 0.0
            most = np.inf if ub[j] < np.inf else 0.0
            z_box[j] = min(max(-r[j], least), most)
            rest = r[j] + z_box[j]
            if abs(rest) <= tol:
                continue
            curvature = 0.0
            for t in range(indptr[j], indptr[j + 1]):
                if indices[t] == j:
                    curvature = data[t]
            if curvature > 0.0:
                step = min(max(x[j] - rest / curvature, lb[j]), ub[j]) - x[j]
                x[j] += step
                for t in range(indptr[j], indptr[j + 1]):
                    r[indices[t]] += data[t] * step


def correct_gap(
    qp: QP, point: Point, size: float, tol: float, dual_left: float
) -> Point:
    """Return the point with its gap, of this size, moved into multipliers.

    First all multipliers of one sum of the gap change together, which is the smallest
    change (dz = -g s/s's); ub'z_box^+ comes first, because the sum that is added last
    is rounded least. Then one multiplier after another changes, because the sums round
    differently with each. Corrections are skipped that flip a sign, or with which the
    dual residual would grow by more than `dual_left` in all.
    """
    x, y, z, z_box = point
    n, p, m = x.size, y.size, z.size
    # the multipliers and their sides in the order b, h, lb, ub
    multiplier = np.concatenate((y, z, np.minimum(z_box, 0.0), np.maximum(z_box, 0.0)))
    side = np.concatenate((qp.b, qp.h, qp.lb, qp.ub))
    kinds = np.split(np.arange(side.size), np.cumsum((p, m, n)))
    largest = np.concatenate((row_maxima(qp.A), row_maxima(qp.G), np.ones(2 * n)))
    usable = np.isfinite(side) & (side != 0.0)
    usable[p:] &= multiplier[p:] != 0.0
    Px = times(qp.P, x)
    added = np.zeros(n)  # to the dual residual, by all changes

    def gap_of(point: Point) -> float:
        return signed_gap((qp.q, qp.h, qp.b, qp.lb, qp.ub), point, Px)

    def changed(k: np.ndarray, gap: float) -> Point | None:
        """Move the gap into the multipliers k, or those of them that may change."""
        for _ in range(2):
            top = np.abs(side[k]).max()
            s = side[k] / top  # or s's leaves the range
            new = multiplier[k] - gap / top / (s @ s) * s
            free = np.abs(new - multiplier[k]) * largest[k] <= dual_left
            free &= (k < p) | (new * multiplier[k] > 0.0)
            if free.all():
                break
            k = k[free]
            if not k.size:
                return None
        if not free.all():
            return None
        change = np.zeros(side.size)
        change[k] = new - multiplier[k]
        dy, dz, lower, upper = (change[kind] for kind in kinds)
        total = added + lower + upper
        add_transposed(qp.A, dy, total)
        add_transposed(qp.G, dz, total)
        if not np.abs(total).max(initial=0.0) <= dual_left:
            return None
        added[:] = total
        multiplier[k] = new
        y, z, lower, upper = (multiplier[kind] for kind in kinds)
        return Point(x, y, z, lower + upper)

    groups = [k[usable[k]] for k in reversed(kinds)]
    step = np.divide(size, np.abs(side), out=np.zeros(side.size), where=usable)
    single = usable & (step * largest <= dual_left)
    single[p:] &= np.abs(multiplier[p:]) > step[p:]
    turns = np.flatnonzero(single)
    turns = turns[:: max(-(-turns.size // TRIES), 1)]
    gap = gap_of(point)
    for k in (*groups, *turns[:, None]):
        new_point = changed(k, gap) if k.size else None
        if new_point is not None:
            gap = gap_of(new_point)
            if abs(gap) <= tol:
                return new_point
    return point


def row_maxima(M: Any) -> np.ndarray:
    """Return the largest modulus of each row of a CSC matrix."""
    largest = np.zeros(M.shape[0])
    np.maximum.at(largest, M.indices, np.abs(M.data))
    return largest
