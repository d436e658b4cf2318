"""The one judge of a solve: what engines offer, measured on the user's own arrays.

A point solves the QP where its residuals (`namlcp.residuals`), recomputed here, are
within the tolerances; the best point so far is kept. A certificate is accepted by
`certificates` alone.

A residual is a sum, and sums of the same terms in another order differ by about the
rounding unit times their moduli. With terms near 1e9 (QFFFFF80) that is far above a
tolerance of 1e-9: a point may pass in the order in which the QP's matrices are stored
and fail in that of the user's own. Where that matters the order is the user's.
"""

import numpy as np
import scipy.sparse as sp
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.measure import largest_ratio, on_bounds, rounding_errors
from scipy.linalg.blas import dnrm2

from namlcp.checks import matrix
from namlcp.linalg import asymmetry
from namlcp.qp.certificates import accepted
from namlcp.qp.problem import Point
from namlcp.qp.rounding import corrections, is_correctable
from namlcp.residuals import qp_residuals
from namlcp.status import FINAL, Outcome, Status

BY_LUCK = (
    "The tolerances are met in one order of summation and missed in that of the "
    "arguments: the terms of the residuals are too large for them. Loosen eps_abs."
)
# Residual over its tolerance up to which a point may be as good as it can be.
NEAR = 10.0


class Judge:
    """The best point so far; `best` is the largest of its residuals over tolerances.

    The QP is solved if best <= 1. `given`: P, G and A as the user stores them, each
    None where absent; None where these are the matrices of the QP. `doubt`: asked once,
    with the judge, whether the QP is infeasible; None if nobody is, or has been.
    `proof`: a certificate that was accepted: status, point, residuals. `offered`: the
    residuals of the last point that was offered.
    """

    def __init__(self, qp, limits, given=None, doubt=None):
        self.qp, self.checked, self.limits, self.doubt = qp, qp, limits, doubt
        self.tolerances = limits.eps_abs, limits.eps_rel
        self.given = None if given is None or are_own(given, qp) else given
        self.best = INFINITY
        self.point = self.residuals = self.proof = self.offered = None
        self.message = ""

    @property
    def is_solved(self):
        return self.best <= 1.0

    def offer(self, point):
        """Measure the point on its bounds, or within them, or with rounding corrected.

        All have x within its bounds, and multipliers of the right signs. Returns the
        least of their largest residuals over tolerances.
        """
        least, z = INFINITY, np.maximum(point.z, 0.0)
        for moves in (True, False):
            x, z_box = on_bounds(point.x, point.z_box, self.qp.lb, self.qp.ub, moves)
            trial = Point(x, point.y, z, z_box)
            self.offered = residuals = self.measure(trial)
            ratio = self.ratio(residuals)
            least = min(least, ratio)
            if least <= 1.0:
                return least
        if is_correctable(residuals, *self.tolerances) or (
            ratio <= NEAR and self.ratio_in_other_order(residuals, trial, -1.0) <= 1.0
        ):
            for new in corrections(self.qp, trial, residuals, *self.tolerances):
                least = min(least, self.ratio(self.measure(new)))
                if least <= 1.0:
                    break
        return least

    def misses_gap(self):
        """Tell whether the gap alone of the last point offered misses its tolerance."""
        return self.ratio(self.offered._replace(gap=0.0)) <= 1.0

    def measure(self, point, residuals=None):
        """Return the residuals of one point; keep it if it is the best.

        `residuals`: they, where they have been computed on the arrays of the QP.
        """
        residuals = residuals or self.residuals_of(point)
        ratio = self.ratio(residuals)
        if self.given is not None and ratio <= 1.0:
            if self.ratio_in_other_order(residuals, point, 1.0) > 1.0:
                self.take_order_of_user()
                residuals = self.residuals_of(point)
                ratio = self.ratio(residuals)
        if ratio < self.best:
            self.best, self.residuals, self.point = ratio, residuals, point
        return residuals

    def ratio(self, residuals):
        eps_abs, eps_rel = self.tolerances
        return largest_ratio(residuals, eps_abs, eps_rel)

    def residuals_of(self, point):
        return qp_residuals(*self.qp, *point)

    def ratio_in_other_order(self, residuals, point, sign):
        """Return the largest residual over its tolerance after another order of sums.

        sign: 1.0 for the most that it may be, -1.0 for the least.
        """
        P, G, A = (norm(M) for M in (self.checked.P, self.checked.G, self.checked.A))
        x, y, z = map(norm, point[:3])
        pairs = zip(residuals[:3], rounding_errors(P, G, A, x, y, z), strict=True)
        changed = [max(r + sign * error, 0.0) for r, error in pairs]
        return self.ratio((*changed, *residuals[3:]))

    def take_order_of_user(self):
        """Measure from now on in the order in which the user's matrices are stored."""
        own = self.qp.P, self.qp.G, self.qp.A
        P, G, A = map(as_stored, self.given, own)
        if asymmetry(matrix("P", P, "csc"))[0] > 0.0:
            P = self.qp.P  # (P + P') / 2
        self.qp, self.given = self.qp._replace(P=P, G=G, A=A), None
        self.message = BY_LUCK  # unless a point passes
        if self.point is not None:
            self.best = INFINITY
            self.measure(self.point)

    def accept_multipliers(self, x, y, z):
        """Tell whether multipliers prove that no x is feasible; x: the point at hand.

        The certificate is kept.
        """
        proof = accepted(self.checked, (x, y, z), None, self.limits.eps_abs)
        return self.keep(Status.PRIMAL_INFEASIBLE, proof)

    def accept_ray(self, d, point=None):
        """Tell whether the QP is unbounded along d; the certificate is kept."""
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
        """Return the certificate, or the best point, SOLVED if it passes.

        If it does not, a final `status` becomes STALLED.
        """
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
    """Tell whether (P, G, A) as they came have the entries of the QP, as it has them.

    They are its very matrices, or in CSC with its values and other types of indices.
    """
    for M, own in zip(given, (qp.P, qp.G, qp.A), strict=True):
        if M is None or M is own:
            continue
        if getattr(M, "format", "") != "csc" or M.data is not own.data:
            return False
    return True


def as_stored(given, own):
    """Return a matrix of the user in its own order, the QP's where it is absent."""
    if given is None:
        return own
    if sp.issparse(given):
        return given
    return np.atleast_2d(np.asarray(given, dtype=float))


def norm(M):
    """Return the 2-norm of all entries, without overflow or a warning of it."""
    entries = M if type(M) is np.ndarray else M.data
    return dnrm2(entries.ravel(order="K")) if entries.size else 0.0
