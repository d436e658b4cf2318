"""Corrections of a solution whose residuals are at rounding level, but too large.

Rounding errors of a multiplier near 1e7, about 1e-9, make a dual residual that may
exceed its tolerance; large terms of the duality gap leave a gap. Both can be removed by
small changes of unknowns whose own residuals are below tolerance: the dual residual by
z_box where a bound allows the sign, else by x; the gap by x, then by multipliers.

With terms of 1e12 the gap is a multiple of 1e-4, and passes 1e-9 only as 0. Changes of
x that would remove it without rounding make it another multiple, mostly a smaller one.
"""

import numpy as np

from namlcp.linalg.csc import add_transposed, times
from namlcp.measure import signed_gap
from namlcp.qp.problem import Point
from namlcp.residuals import qp_residuals

# Most steps of x against a dual residual, and against a gap.
PASSES, MOVES = 3, 16
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


def corrections(qp, point, found, eps_abs, eps_rel):
    """Yield points with smaller residuals than those `found` at this one.

    The matrices are dense or sparse in any layout; sums run in their order.
    """
    tol = eps_abs + eps_rel * found.dual_size
    for share, rest in SHARES:
        new, seen = point, found
        if found.dual > share * tol:
            new = correct_dual_residual(qp, point, share * tol, rest * tol)
            seen = qp_residuals(*qp, *new)
        gap_tol = eps_abs + eps_rel * seen.gap_size
        if seen.gap > gap_tol and seen.dual <= tol:
            new = correct_gap_by_x(qp, new, gap_tol)
            yield new
            new = correct_gap_by_multipliers(qp, new, gap_tol, tol - seen.dual)
        yield new
        if found.dual <= share * tol:
            return


def correct_dual_residual(qp, point, tol, rest=0.0):
    """Return the point with dual residuals above `tol` removed by z_box or x.

    Where x removes them, by Jacobi steps on the Lagrangian, it leaves those of modulus
    `rest`.
    """
    x, y, z, z_box = point
    Gtz, Aty = np.zeros((2, x.size))
    add_transposed(qp.G, z, Gtz)
    add_transposed(qp.A, y, Aty)
    least = np.where(qp.lb > -np.inf, -np.inf, 0.0)
    most = np.where(qp.ub < np.inf, np.inf, 0.0)
    curvature = qp.P.diagonal()
    for _ in range(PASSES):
        r = times(qp.P, x) + qp.q + Gtz + Aty  # as `qp_residuals` adds
        z_box = np.where(np.abs(r + z_box) > tol, np.clip(-r, least, most), z_box)
        r += z_box
        large = (np.abs(r) > tol) & (curvature > 0.0)
        if not large.any():
            break
        x = x.copy()
        x[large] -= (r - np.copysign(rest, r))[large] / curvature[large]
        x = qp.clip(x)
    return point._replace(x=x, z_box=z_box)


def correct_gap_by_x(qp, point, tol):
    """Return the point with x changed for the least gap.

    The gap g has the gradient v = 2 Px + q in x. The least change -g v/v'v of the
    variables inside their bounds removes it but for rounding; the next ones, by a
    random half of the variables each, start from the gap that was left. The first
    point with a gap of at most `tol` is the last one.
    """
    inside = (point.x > qp.lb) & (point.x < qp.ub)
    rng = np.random.default_rng(0)
    Px = times(qp.P, point.x)
    gap = signed_gap(qp, point, Px)
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
        gap = signed_gap(qp, point, Px)
        if abs(gap) < least:
            best, least = point, abs(gap)
        if least <= tol:
            break
    return best


def correct_gap_by_multipliers(qp, point, tol, dual_left):
    """Return the point with its gap removed by multipliers.

    All multipliers of one sum s'z, such as ub'z_box^+, change together, by -g s/s's for
    the gap g; ub'z_box^+ is first, being added last and thus rounded least. Those that
    would flip their sign are left out once; a sum is skipped if some still would, or if
    all corrections together would add more than `dual_left` to the dual residual.
    """
    x, y, z, z_box = point
    n, p, m = x.size, y.size, z.size
    # multipliers and their right-hand sides in the order b, h, lb, ub
    multiplier = np.concatenate((y, z, np.minimum(z_box, 0.0), np.maximum(z_box, 0.0)))
    side = np.concatenate((qp.b, qp.h, qp.lb, qp.ub))
    usable = np.isfinite(side) & (side != 0.0)
    usable[p:] &= multiplier[p:] != 0.0
    Px = times(qp.P, x)
    added = np.zeros(n)  # to the dual residual, by all changes
    gap = signed_gap(qp, point, Px)
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
            fits = (part < p) | ((multiplier[part] + change) * multiplier[part] > 0.0)
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
            gap = signed_gap(qp, new_point, Px)
            if abs(gap) <= tol:
                return new_point
    return point
