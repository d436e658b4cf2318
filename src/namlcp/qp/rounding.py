"""Corrections of a solution whose residuals are at rounding level, but too large.

Rounding errors of a multiplier near 1e7, about 1e-9, make a dual residual that may
exceed its tolerance; large terms of the duality gap leave a gap. Both can be removed by
small changes of unknowns whose own residuals are below tolerance: the dual residual by
z_box where a bound allows the sign, else by x; the gap by x, then by multipliers.

With terms of 1e12 the gap is a multiple of 1e-4, and passes 1e-9 only as 0. Changes of
x that would remove it without rounding make it another multiple, mostly a smaller one.
"""

import cython
import numpy as np
import scipy.sparse as sp
from cython.cimports.libc.math import INFINITY, copysign, fabs

from namlcp.checks import as_sparse, matrix
from namlcp.linalg import add_transposed, times
from namlcp.measure import signed_gap
from namlcp.qp.problem import Point
from namlcp.residuals import qp_residuals

# PASSES: Gauss-Seidel passes over the entries of the dual residual.
# Most corrections of the gap by x.
MOVES = 16
# Entries of the dual residual above the first fraction of the tolerance are reduced, to
# the second where x takes them up. The first pair leaves room for the gap, the second
# changes x less.
SHARES = (0.5, 0.0), (0.95, 0.95)
# Largest ratio of a residual to its tolerance that is corrected: a larger one is not
# due to rounding alone. A gap or a primal residual is also corrected up to so many
# units in the last place of its largest term.
CORRECTABLE, LAST_PLACES = 1e3, 256.0
# Rounding unit times the largest term of a residual, relative to the tolerance, below
# which rounding has no part in a residual above it: another iteration removes it.
COARSE = 1e-5
# The rounding error of a sum over its terms: the spacing of the numbers next to 1.
UNIT = 2.0**-52


def is_correctable(found, eps_abs, eps_rel):
    """Tell whether rounding may be all that keeps these residuals above tolerance."""
    largest = max(found.primal_size, found.dual_size, found.gap_size)
    if not UNIT * largest >= COARSE * (eps_abs + eps_rel * largest):
        return False
    gap = max(found.gap - LAST_PLACES * UNIT * found.gap_size, 0.0)
    primal = max(found.primal - LAST_PLACES * UNIT * found.primal_size, 0.0)
    rest = found._replace(primal=primal, gap=gap).worst(eps_abs, eps_rel)
    return rest <= CORRECTABLE and not found.solved(eps_abs, eps_rel)


def correct_rounding(qp, point, found, eps_abs, eps_rel):
    """Return the point, which has the residuals `found`, with the large ones reduced.

    The matrices are dense or sparse in any layout; sums run in their order.
    """
    best, least = point, found.worst(eps_abs, eps_rel)
    tol = eps_abs + eps_rel * found.dual_size
    for share, rest in SHARES:
        new, seen = point, found
        if found.dual > share * tol:
            new = correct_dual_residual(qp, point, share * tol, rest * tol)
            seen = qp_residuals(*qp, *new)
        trials = iter((new,))
        gap_tol = eps_abs + eps_rel * seen.gap_size
        if seen.gap > gap_tol and seen.dual <= tol:
            trials = gap_corrections(qp, new, gap_tol, tol - seen.dual)
        for trial in trials:
            worst = qp_residuals(*qp, *trial).worst(eps_abs, eps_rel)
            if worst < least:
                best, least = trial, worst
            if least <= 1.0:
                return best
        if found.dual <= share * tol:
            break
    return best


def correct_dual_residual(qp, point, tol, rest=0.0):
    """Return the point with dual residuals above `tol` removed by z_box or x.

    Where x removes them, it leaves those of modulus `rest`.
    """
    point = point._replace(x=point.x.copy(), z_box=point.z_box.copy())
    r = times(qp.P, point.x) + qp.q
    for M, multiplier in ((qp.G, point.z), (qp.A, point.y)):  # as `qp_residuals` adds
        part = np.zeros(r.size)
        add_transposed(M, multiplier, part)
        r += part
    P = qp.P
    if not sp.issparse(P) or P.format != "csc":
        P = as_sparse(matrix("P", P, "csc"))
    gauss_seidel(P, qp, point, r, tol, rest)
    return point


def gauss_seidel(P, qp, point, r, tol, left):
    """Reduce dual residuals |r_j + z_box_j| > tol by z_box_j, to `left` by x_j.

    x_j takes that part of a Gauss-Seidel step on the Lagrangian. P is in CSC, r = Px +
    q + G'z + A'y; r and the point's x and z_box are overwritten.
    """
    indptr: cython.int[::1] = P.indptr
    indices: cython.int[::1] = P.indices
    data: cython.double[::1] = P.data
    lb: cython.double[::1] = qp.lb
    ub: cython.double[::1] = qp.ub
    x: cython.double[::1] = point.x
    z_box: cython.double[::1] = point.z_box
    for _ in range(PASSES):
        for j in range(x.shape[0]):
            if fabs(r[j] + z_box[j]) <= tol:
                continue
            least = -INFINITY if lb[j] > -INFINITY else 0.0
            most = INFINITY if ub[j] < INFINITY else 0.0
            z_box[j] = min(max(-r[j], least), most)
            rest = r[j] + z_box[j]
            if fabs(rest) <= tol:
                continue
            curvature = 0.0
            for t in range(indptr[j], indptr[j + 1]):
                if indices[t] == j:
                    curvature = data[t]
            if curvature > 0.0:
                excess = rest - copysign(left, rest)
                new = min(max(x[j] - excess / curvature, lb[j]), ub[j])
                for t in range(indptr[j], indptr[j + 1]):
                    r[indices[t]] += data[t] * (new - x[j])
                x[j] = new
    return 0


def gap_corrections(qp, point, tol, dual_left):
    """Yield the point with its gap reduced by x, then by multipliers, too.

    These add at most `dual_left` to the dual residual.
    """
    moved = correct_gap_by_x(qp, point, tol)
    yield moved
    new = correct_gap_by_multipliers(qp, moved, tol, dual_left)
    if new is not moved:
        yield new


def correct_gap_by_x(qp, point, tol):
    """Return the point with x changed for the least gap.

    The gap g has the gradient v = 2 Px + q in x. The least change -g v/v'v of the
    variables inside their bounds removes it but for rounding; the next ones, by a
    random half of the variables each, start from the gap that was left. The first
    point with a gap of at most `tol` is the last one.
    """
    vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
    inside = (point.x > qp.lb) & (point.x < qp.ub)
    rng = np.random.default_rng(0)
    Px = times(qp.P, point.x)
    gap = signed_gap(vectors, tuple(point), Px)
    best, least = point, abs(gap)
    for move in range(MOVES):
        v = np.where(inside, 2.0 * Px + qp.q, 0.0)
        if move > 0:
            v[rng.random(v.size) < 0.5] = 0.0
        top = np.abs(v).max(initial=0.0)
        if not 0.0 < top < np.inf:
            continue
        v /= top  # else v'v may overflow
        point = point._replace(x=qp.clip(point.x - gap / top / (v @ v) * v))
        Px = times(qp.P, point.x)
        gap = signed_gap(vectors, tuple(point), Px)
        if abs(gap) < least:
            best, least = point, abs(gap)
        if least <= tol:
            break
    return best


def correct_gap_by_multipliers(qp, point, tol, dual_left):
    """Return the point with its gap removed by multipliers.

    All multipliers of one sum s'z, such as ub'z_box^+, change together, by -g s/s's for
    the gap g; ub'z_box^+ is first, being added last and thus rounded least. Those that
    would flip their sign, or change the dual residual by more than `dual_left`, are
    left out once; a sum is skipped if some are left then, or if all corrections
    together would add more than that.
    """
    x, y, z, z_box = point
    n, p, m = x.size, y.size, z.size
    # multipliers and their right-hand sides in the order b, h, lb, ub
    multiplier = np.concatenate((y, z, np.minimum(z_box, 0.0), np.maximum(z_box, 0.0)))
    side = np.concatenate((qp.b, qp.h, qp.lb, qp.ub))
    largest = np.concatenate((row_maxima(qp.A), row_maxima(qp.G), np.ones(2 * n)))
    usable = np.isfinite(side) & (side != 0.0)
    usable[p:] &= multiplier[p:] != 0.0
    Px = times(qp.P, x)
    vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
    added = np.zeros(n)  # to the dual residual, by all changes
    gap = signed_gap(vectors, tuple(point), Px)
    ends = p, p + m, p + m + n
    for part in reversed(np.split(np.arange(side.size), ends)):
        fits = usable[part]
        for _ in range(2):
            part = part[fits]
            if part.size == 0:
                break
            top = np.abs(side[part]).max()
            s = side[part] / top  # side^2 may overflow
            change = -gap / top / (s @ s) * s
            fits = np.abs(change) * largest[part] <= dual_left
            fits &= (part < p) | ((multiplier[part] + change) * multiplier[part] > 0.0)
        if not (part.size and fits.all()):
            continue
        new = multiplier.copy()
        new[part] += change
        dy, dz, lower, upper = np.split(new - multiplier, ends)
        total = added + lower + upper
        add_transposed(qp.A, dy, total)
        add_transposed(qp.G, dz, total)
        if np.abs(total).max() <= dual_left:
            added, multiplier = total, new
            y, z, lower, upper = np.split(multiplier, ends)
            new_point = Point(x, y, z, lower + upper)
            gap = signed_gap(vectors, tuple(new_point), Px)
            if abs(gap) <= tol:
                return new_point
    return point


def row_maxima(M):
    """Return the largest modulus in each row of a matrix, 0 of an empty row."""
    if not sp.issparse(M):
        return np.abs(M).max(axis=1, initial=0.0)
    largest, entries = np.zeros(M.shape[0]), M.tocoo()
    np.maximum.at(largest, entries.row, np.abs(entries.data))
    return largest
