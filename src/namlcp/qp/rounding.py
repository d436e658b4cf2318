"""Corrections of a solution whose residuals are at rounding level, but too large.

Rounding errors of a multiplier near 1e7, about 1e-9, make a dual residual that may
exceed its tolerance; large terms of the duality gap leave a gap. Both can be removed by
small changes of unknowns whose own residuals are below tolerance: the dual residual by
z_box where a bound allows the sign, else by x; the gap by multipliers.
"""

from typing import Any

import numpy as np

from namlcp.compiled import kernel
from namlcp.linalg import add_transposed, arrays_of, times
from namlcp.qp.problem import QP, Point
from namlcp.residuals import Residuals, qp_residuals, signed_gap

# Gauss-Seidel passes over the entries of the dual residual.
PASSES = 3
# Most corrections of the gap by a single multiplier.
TRIES = 64
# Fraction of the tolerance above which an entry of the dual residual is corrected.
SHARE = 0.5


def correct_rounding(
    qp: QP, point: Point, found: Residuals, eps_abs: float, eps_rel: float
) -> Point:
    """Return the point, which has the residuals `found`, with the large ones reduced.

    The matrices are CSC.
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
    """Return the point with dual residuals above `tol` removed by z_box or x."""
    point = point._replace(x=point.x.copy(), z_box=point.z_box.copy())
    r = times(qp.P, point.x) + qp.q
    for M, multiplier in ((qp.G, point.z), (qp.A, point.y)):  # as `qp_residuals` adds
        part = np.zeros(r.size)
        add_transposed(M, multiplier, part)
        r += part
    gauss_seidel(*arrays_of(qp.P), (qp.lb, qp.ub), tol, r, (point.x, point.z_box))
    return point


@kernel
def gauss_seidel(indptr, indices, data, bounds, tol, r, unknowns):
    """Reduce dual residuals |r_j + z_box_j| > tol by z_box_j, then by x_j.

    x_j takes a Gauss-Seidel step on the Lagrangian. P is in CSC, r = Px + q + G'z +
    A'y, bounds = (lb, ub), unknowns = (x, z_box); r and the unknowns are overwritten.
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
    """Return the point with its gap, of modulus `size`, removed by multipliers.

    First all multipliers of one sum s'z, such as ub'z_box^+, change together, by -g
    s/s's for the gap g; ub'z_box^+ is first, being added last and thus rounded least.
    Then single multipliers change, since each makes the sums round differently. A
    correction is skipped if it flips a sign, or if all corrections together would add
    more than `dual_left` to the dual residual.
    """
    x, y, z, z_box = point
    n, p, m = x.size, y.size, z.size
    # multipliers and their right-hand sides in the order b, h, lb, ub
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
        """Return the point after a correction by multipliers k, None if skipped."""
        for _ in range(2):
            top = np.abs(side[k]).max()
            s = side[k] / top  # else s's may overflow
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
    """Return the largest modulus in each row of a CSC matrix."""
    largest = np.zeros(M.shape[0])
    np.maximum.at(largest, M.indices, np.abs(M.data))
    return largest
