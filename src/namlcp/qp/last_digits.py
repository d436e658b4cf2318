"""The last digits: what rounding leaves of the residuals goes where it does no harm.

A multiplier of 1e7 in units of which the tolerance is 1e-13 cannot be written down in
double precision: its last digit is a dual residual. So is a gap whose terms are 1e11.
Both are linear in what has digits to spare, and the tolerances of the other residuals
leave room:

- the entry r_j of the dual residual goes into z_box_j where x_j has a bound on that
  side, else into x_j (a Gauss-Seidel step on the Lagrangian, dx_j = -r_j/P_jj);
- the gap g goes into multipliers with sides s, dz = -g s/s's.

Every point made here is judged on the user's data like any other.
"""

from typing import Any

import numpy as np

from namlcp.compiled import kernel
from namlcp.linalg import add_transposed, times
from namlcp.qp.problem import QP
from namlcp.residuals import Residuals, qp_residuals, signed_gap

Point = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

PASSES = 3  # Gauss-Seidel passes
TRIES = 64  # corrections of the gap at most
SHARE = 0.5  # of the tolerance that a residual may take up before it is moved


def settle(
    qp: QP, point: Point, found: Residuals, eps_abs: float, eps_rel: float
) -> Point:
    """Return the point, of these residuals, with its dual residual and its gap moved.

    Matrices are CSC. Where nothing can be moved it is `point` itself.
    """
    tol = eps_abs + eps_rel * found.dual_size
    if found.dual > SHARE * tol:
        point = move_dual_residual(qp, point, SHARE * tol)
        found = qp_residuals(*qp, *point)
    gap_tol = eps_abs + eps_rel * found.gap_size
    if found.gap > gap_tol and found.dual <= tol:
        point = move_gap(qp, point, found.gap, gap_tol, tol - found.dual)
    return point


def move_dual_residual(qp: QP, point: Point, tol: float) -> Point:
    """Return the point with dual residuals above `tol` in z_box or in x."""
    x, y, z, z_box = point
    x, z_box = x.copy(), z_box.copy()
    r = times(qp.P, x) + qp.q
    for M, multiplier in ((qp.G, z), (qp.A, y)):  # in the order of the judge
        part = np.zeros(x.size)
        add_transposed(M, multiplier, part)
        r += part
    P = qp.P
    absorb(P.indptr, P.indices, P.data, qp.lb, qp.ub, tol, r, x, z_box)
    return x, y, z, z_box


@kernel
def absorb(indptr, indices, data, lb, ub, tol, r, x, z_box):
    """Reduce |r_j + z_box_j| above tol by z_box_j, then by x_j; r = Px + q + C'v."""
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


def move_gap(qp: QP, point: Point, size: float, tol: float, room: float) -> Point:
    """Return the point with its gap, of this size, moved into multipliers.

    What is added last is rounded least, so first all of ub'z_box^+ give way together
    (the smallest change, dz = -g s/s's), then those of the other sums. Then one
    multiplier after another: the sums round differently with each of them. What would
    change its sign, or take more than `room` of the dual residual, is left out, and so
    is what would together with all before.
    """
    x, y, z, z_box = point
    n, p, m = x.size, y.size, z.size
    multiplier = np.concatenate((y, z, np.minimum(z_box, 0.0), np.maximum(z_box, 0.0)))
    vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
    side = np.concatenate((qp.b, qp.h, qp.lb, qp.ub))
    column = np.concatenate((peaks(qp.A), peaks(qp.G), np.ones(2 * n)))
    usable = np.isfinite(side) & (side != 0.0)
    usable[p:] &= multiplier[p:] != 0.0
    Px = times(qp.P, x)
    spent = np.zeros(n)  # of the room

    def moved(k: np.ndarray, gap: float) -> tuple[Point, float] | None:
        """Move the gap into the multipliers k, or those of them that may change."""
        for _ in range(2):
            largest = np.abs(side[k]).max()
            s = side[k] / largest  # or s's leaves the range
            new = multiplier[k] - gap / largest / (s @ s) * s
            free = np.abs(new - multiplier[k]) * column[k] <= room
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
        part = spent + change[p + m : p + m + n] + change[p + m + n :]
        add_transposed(qp.A, change[:p], part)
        add_transposed(qp.G, change[p : p + m], part)
        if not np.abs(part).max(initial=0.0) <= room:
            return None
        spent[:] = part
        multiplier[k] = new
        y, z = multiplier[:p], multiplier[p : p + m]
        z_box = multiplier[p + m : p + m + n] + multiplier[p + m + n :]
        new_point = x, y, z, z_box
        return new_point, signed_gap(vectors, new_point, Px)

    kinds = np.split(np.arange(side.size), np.cumsum((p, m, n)))
    groups = [k[usable[k]] for k in reversed(kinds)]
    step = np.divide(size, np.abs(side), out=np.zeros(side.size), where=usable)
    single = usable & (step * column <= room)
    single[p:] &= np.abs(multiplier[p:]) > step[p:]
    turns = np.flatnonzero(single)
    turns = turns[:: max(-(-turns.size // TRIES), 1)]
    gap = signed_gap(vectors, point, Px)
    for k in (*groups, *turns[:, None]):
        found = moved(k, gap) if k.size else None
        if found is not None:
            point_now, gap = found
            if abs(gap) <= tol:
                return point_now
    return point


def peaks(M: Any) -> np.ndarray:
    """Return the largest modulus of each row of a CSC matrix."""
    largest = np.zeros(M.shape[0])
    np.maximum.at(largest, M.indices, np.abs(M.data))
    return largest
