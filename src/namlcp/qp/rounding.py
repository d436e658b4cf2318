"""Corrections of a solution whose residuals are at rounding level, but too large.

Rounding errors of a multiplier near 1e7, about 1e-9, make a dual residual that may
exceed its tolerance; large terms of the duality gap leave a gap. Both can be removed by
small changes of unknowns whose own residuals are below tolerance: the dual residual by
z_box where a bound allows the sign, else by x; the gap by multipliers.
"""

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
    count = p + m + 2 * n
    multiplier, side, largest, new = np.empty((4, count))
    usable = np.empty(count, dtype=np.bool_)
    terms = multiplier, side, largest, usable
    matrices = tuple(arrays_of(qp.A)), tuple(arrays_of(qp.G))
    lay_out((qp.b, qp.h, qp.lb, qp.ub), (y, z, z_box), matrices, terms)
    Px = times(qp.P, x)
    vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
    added = np.zeros(n)  # to the dual residual, by all changes
    gap = signed_gap(vectors, point, Px)
    ends = 0, p, p + m, p + m + n, count
    groups = [(ends[k], ends[k + 1]) for k in (3, 2, 1, 0)]
    turns = [(k, k + 1) for k in single_turns(terms, p, size, dual_left)]
    for first, last in groups + turns:
        if not propose(first, last, p, gap, dual_left, terms, new):
            continue
        change = np.zeros(count)
        change[first:last] = new[first:last] - multiplier[first:last]
        dy, dz, lower, upper = np.split(change, ends[1:4])
        total = added + lower + upper
        add_transposed(qp.A, dy, total)
        add_transposed(qp.G, dz, total)
        if not np.abs(total).max(initial=0.0) <= dual_left:
            continue
        added = total
        multiplier[first:last] = new[first:last]
        y, z, lower, upper = np.split(multiplier.copy(), ends[1:4])
        new_point = Point(x, y, z, lower + upper)
        gap = signed_gap(vectors, new_point, Px)
        if abs(gap) <= tol:
            return new_point
    return point


@kernel
def lay_out(given, multipliers, matrices, terms):
    """Set the terms of the gap, in the order b, h, lb, ub.

    given = (b, h, lb, ub), multipliers = (y, z, z_box), matrices = A and G in CSC as
    (indptr, indices, data). terms = (multiplier, side, largest, usable) are
    overwritten: `largest` is the largest modulus in the row of A or G, 1 for bounds; a
    term is `usable` if its side is finite and not 0, and its multiplier not that of
    an inactive inequality.
    """
    multiplier, side, largest, usable = terms
    b, h, lb, ub = given
    y, z, z_box = multipliers
    p, m, n = b.size, h.size, lb.size
    for i in range(p):
        multiplier[i], side[i], largest[i] = y[i], b[i], 0.0
    for i in range(m):
        multiplier[p + i], side[p + i], largest[p + i] = z[i], h[i], 0.0
    for j in range(n):
        k = p + m + j
        multiplier[k], side[k], largest[k] = min(z_box[j], 0.0), lb[j], 1.0
        k += n
        multiplier[k], side[k], largest[k] = max(z_box[j], 0.0), ub[j], 1.0
    first = 0
    for indptr, indices, data in matrices:
        for t in range(indptr[n]):
            i = first + indices[t]
            largest[i] = max(largest[i], abs(data[t]))
        first = p
    for k in range(side.size):
        usable[k] = (
            np.isfinite(side[k]) and side[k] != 0.0 and (k < p or multiplier[k] != 0.0)
        )


def single_turns(
    terms: tuple[np.ndarray, ...], p: int, size: float, dual_left: float
) -> list[int]:
    """Return at most TRIES terms that alone can change the gap by `size`."""
    multiplier, side, largest, usable = terms
    k = np.flatnonzero(usable)
    step = size / np.abs(side[k])
    single = step * largest[k] <= dual_left
    single &= (k < p) | (np.abs(multiplier[k]) > step)
    turns = k[single]
    return turns[:: max(-(-turns.size // TRIES), 1)].tolist()


@kernel
def propose(first, last, p, gap, dual_left, terms, new):
    """Set new[first:last] to multipliers without the gap; tell whether they may be.

    The usable ones change by -gap s/s's, those that would change sign or the dual
    residual by more than `dual_left` are left out once. The first p have any sign.
    """
    multiplier, side, largest, usable = terms
    for k in range(first, last):
        new[k] = multiplier[k] if usable[k] else np.nan
    for _ in range(2):
        top, squares = 0.0, 0.0
        for k in range(first, last):
            if new[k] == new[k]:
                top = max(top, abs(side[k]))
        if top == 0.0:
            return False
        for k in range(first, last):
            if new[k] == new[k]:
                squares += (side[k] / top) * (side[k] / top)  # side^2 may overflow
        left_out = False
        for k in range(first, last):
            if new[k] != new[k]:
                continue
            new[k] = multiplier[k] - gap / top / squares * (side[k] / top)
            step = abs(new[k] - multiplier[k])
            if not (
                step * largest[k] <= dual_left
                and (k < p or new[k] * multiplier[k] > 0.0)
            ):
                new[k] = np.nan
                left_out = True
        if not left_out:
            for k in range(first, last):
                if new[k] != new[k]:
                    new[k] = multiplier[k]
            return True
    return False
