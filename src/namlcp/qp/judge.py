"""The one judge of a solve: what engines offer, measured on the user's own arrays.

A point solves the QP where its residuals (`namlcp.residuals`), recomputed here, are
within the tolerances; the best point so far is kept. A certificate is accepted by
`certificates` alone.

A residual is a sum, and sums of the same terms in another order differ by about the
rounding unit times their moduli. With terms near 1e9 (QFFFFF80) that is far above a
tolerance of 1e-9: a point may pass in the order in which the QP's matrices are stored
and fail in that of the user's own. Where that matters the order is the user's.

Rounding errors of a multiplier near 1e7, about 1e-9, make a dual residual that may
exceed its tolerance; large terms of the duality gap leave a gap. `corrections` remove
both by small changes: the dual residual by z_box where a bound allows the sign, else by
x; the gap by x, then by multipliers. With terms of 1e12 the gap is a multiple of 1e-4,
and passes 1e-9 only as 0. Changes of x that would remove it without rounding make it
another multiple, mostly a smaller one.
"""

import numpy as np
import scipy.sparse as sp
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.measure import (
    largest_ratio,
    on_bounds,
    residuals_of_columns,
)
from scipy.linalg.blas import dnrm2

from namlcp.checks import matrix
from namlcp.linalg.csc import add_transposed, is_clean_csc, times
from namlcp.linalg.factors import asymmetry
from namlcp.measure import signed_gap
from namlcp.qp.certificates import accepted
from namlcp.qp.problem import Point
from namlcp.residuals import Residuals, qp_residuals
from namlcp.status import FINAL, Outcome, Status

BY_LUCK = (
    "The tolerances are met in one order of summation and missed in that of the "
    "arguments: the terms of the residuals are too large for them. Loosen eps_abs."
)
# Residual over its tolerance up to which a point may be as good as it can be.
NEAR = 10.0
# Most steps of x against a dual residual, and against a gap.
PASSES, MOVES = 3, 16
# Entries of the dual residual above the first fraction of the tolerance are reduced, to
# the second where x takes them up. The first pair leaves room for the gap, the second
# changes x less.
SHARES = (0.5, 0.0), (0.95, 0.95)
# Largest ratio of a residual to its tolerance that may be due to rounding alone; of a
# gap or a primal residual also so many units in the last place of its largest term.
CORRECTABLE, LAST_PLACES = 1e3, 256.0
# Rounding unit times the largest term of a residual, relative to the tolerance, below
# which rounding has no part in a residual above it: another iteration removes it.
COARSE = 1e-5
# The rounding error of a sum over its terms: the spacing of the numbers next to 1.
UNIT = 2.0**-52


class Judge:
    """The best point so far; `best` is the largest of its residuals over tolerances.

    `given`: P, G and A as the user stores them, each None where absent; None where
    these are the matrices of the QP. `doubt`: asked once, with the judge, whether the
    QP is infeasible. `proof`: a certificate that was accepted: status, point,
    residuals.
    """

    def __init__(self, qp, limits, given=None, doubt=None):
        self.qp, self.checked, self.limits, self.doubt = qp, qp, limits, doubt
        self.given = None if given is None or are_own(given, qp) else given
        self.is_columns = type(qp.P) is not np.ndarray
        self.best = INFINITY
        self.point = self.residuals = self.proof = None
        self.message = ""

    @property
    def is_solved(self):
        return self.best <= 1.0

    def offer(self, point):
        """Measure the point on its bounds, or within them, or with rounding corrected.

        Returns the least ratio.
        """
        least, z = INFINITY, np.maximum(point.z, 0.0)
        for moves in (True, False):
            x, z_box = on_bounds(point.x, point.z_box, self.qp.lb, self.qp.ub, moves)
            trial = Point(x, point.y, z, z_box)
            residuals = self.measure(trial)
            ratio = self.ratio(residuals)
            least = min(least, ratio)
            if least <= 1.0:
                return least
        if is_correctable(residuals, *self.limits.tolerances) or (
            ratio <= NEAR and self.ratio_in_other_order(residuals, trial, -1.0) <= 1.0
        ):
            for new in corrections(self.qp, trial, residuals, *self.limits.tolerances):
                least = min(least, self.ratio(self.measure(new)))
                if least <= 1.0:
                    break
        return least

    def measure(self, point):
        """Return the residuals of a point; keep the best one."""
        residuals = self.residuals_of(point)
        ratio = self.ratio(residuals)
        is_doubtful = self.given is not None and ratio <= 1.0
        if is_doubtful and self.ratio_in_other_order(residuals, point, 1.0) > 1.0:
            self.take_order_of_user()
            return self.measure(point)
        if ratio < self.best:
            self.best, self.residuals, self.point = ratio, residuals, point
        return residuals

    def ratio(self, residuals):
        eps_abs, eps_rel = self.limits.tolerances
        return largest_ratio(residuals, eps_abs, eps_rel)

    def residuals_of(self, point):
        if not self.is_columns:
            return qp_residuals(*self.qp, *point)
        return Residuals(*residuals_of_columns(self.qp, point))

    def ratio_in_other_order(self, residuals, point, sign):
        """Return the largest residual over its tolerance after another order of sums.

        sign: 1.0 for the most that it may be, -1.0 for the least. The moduli of the
        terms of a row of M x sum up to at most || M ||_F || x ||_2; the gap's other
        sums run over vectors, in one order only.
        """
        P, G, A = (norm(M) for M in (self.checked.P, self.checked.G, self.checked.A))
        x, y, z = map(norm, point[:3])
        errors = max(G, A) * x, P * x + G * z + A * y, P * x * x
        pairs = zip(residuals[:3], errors, strict=True)
        changed = [max(r + sign * UNIT * error, 0.0) for r, error in pairs]
        return self.ratio((*changed, *residuals[3:]))

    def take_order_of_user(self):
        """Measure from now on in the order in which the user's matrices are stored."""
        qp, self.given, given = self.qp, None, zip("PGA", self.given, strict=True)
        for name, M in given:
            if M is not None:  # one row may be a vector
                M = M if sp.issparse(M) else np.array(M, float)
                qp = qp._replace(**{name: M.reshape(getattr(qp, name).shape)})
        if asymmetry(matrix("P", qp.P, "csc"))[0] > 0.0:
            qp = qp._replace(P=self.qp.P)  # (P + P') / 2
        self.qp, self.is_columns = qp, all(map(is_clean_csc, (qp.P, qp.G, qp.A)))
        self.message = BY_LUCK  # unless a point passes
        if self.point is not None:
            self.best = INFINITY
            self.measure(self.point)

    def accept_multipliers(self, x, y, z):
        """Tell whether multipliers prove that no x, as that at hand, is feasible."""
        proof = accepted(self.checked, (x, y, z), None, self.limits.eps_abs)
        return self.keep(Status.PRIMAL_INFEASIBLE, proof)

    def accept_ray(self, d, point=None):
        """Tell whether the QP is unbounded along d."""
        x, y, z, _ = point or self.qp.point()
        proof = accepted(self.checked, (x, y, z), d, self.limits.eps_abs)
        return self.keep(Status.DUAL_INFEASIBLE, proof)

    def keep(self, status, proof):
        if proof is not None:
            self.proof = status, *proof
        return proof is not None

    def is_disproved(self):
        """Ask the doubt, once; tell whether it proves that no x is feasible."""
        doubt, self.doubt = self.doubt, None
        return doubt is not None and doubt(self)

    def answer(self, status, iterations, method, message=""):
        """Return the certificate, or the best point; what it cannot show is STALLED."""
        if self.proof is not None:
            return Outcome(*self.proof, iterations, method, message)
        if self.point is None:
            self.point = self.qp.point(self.qp.clip(np.zeros(self.qp.q.size)))
            self.residuals = self.residuals_of(self.point)
        if self.best <= 1.0:
            status = Status.SOLVED
        elif status in FINAL:
            status, message = Status.STALLED, message or self.message
        return Outcome(status, self.point, self.residuals, iterations, method, message)


def are_own(given, qp):
    """Tell whether (P, G, A) as they came are stored as those of the QP."""
    for M, own in zip(given, (qp.P, qp.G, qp.A), strict=True):
        if M is not None and M is not own:
            if getattr(M, "format", "") != "csc" or M.data is not own.data:
                return False
    return True


def norm(M):
    entries = M if type(M) is np.ndarray else M.data
    return dnrm2(entries.ravel(order="K")) if entries.size else 0.0


# ---- corrections of rounding


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
            yield from correct_gap_by_multipliers(qp, new)
        else:
            yield new
        if found.dual <= share * tol:
            return


def correct_dual_residual(qp, point, tol, rest=0.0):
    """Return the point with dual residuals above `tol` removed by z_box or x.

    x takes Jacobi steps, which leave residuals of modulus `rest`.
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
    random half of the variables each, start from the gap that was left.
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


def correct_gap_by_multipliers(qp, point):
    """Yield points with the gap removed by the multipliers of one sum s'z each.

    They change by -g s/s's for the gap g; ub'z_box^+ is first, being added last and
    thus rounded least. Those that would flip their sign are left out once; a sum is
    skipped if some still would.
    """
    x, y, z, z_box = point
    gap = signed_gap(qp, point, times(qp.P, x))
    sides = qp.b, qp.h, qp.lb, qp.ub
    multipliers = y, z, np.minimum(z_box, 0.0), np.maximum(z_box, 0.0)
    for k in (3, 2, 1, 0):
        old, new, fits = multipliers[k], [*multipliers], np.isfinite(sides[k])
        fits &= (k == 0) | (old != 0.0)
        for _ in range(2):
            side = np.where(fits, sides[k], 0.0)
            top = np.abs(side).max(initial=0.0) or 1.0
            s = side / top  # side^2 may overflow
            new[k] = old - gap / top / (s @ s or 1.0) * s
            flips = (k > 0) & (new[k] * old < 0.0)
            fits &= ~flips
        if s.any() and not flips.any():
            yield Point(x, new[0], new[1], new[2] + new[3])
