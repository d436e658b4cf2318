"""The one judge of a solve: what engines offer, measured on the user's own arrays.

A point solves the QP where its residuals (`namlcp.residuals`), recomputed here, are
within the tolerances; the best point so far is kept. A certificate is accepted by
`certificates` alone.

A residual is a sum, and sums of the same terms in another order differ by about the
rounding unit times their moduli. With terms near 1e9 (QFFFFF80) that is far above a
tolerance of 1e-9: a point may pass in the order in which the QP's matrices are stored
and fail in that of the user's own. Where that matters the order is the user's.
"""

from math import inf
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg.blas import dnrm2

from namlcp.limits import Limits
from namlcp.linalg import is_clean_csc
from namlcp.measure import on_bounds, residuals_of_columns, rounding_errors
from namlcp.outcome import FINAL, Outcome
from namlcp.qp.certificates import Proof, accept_dual, accept_primal
from namlcp.qp.problem import QP, Point
from namlcp.qp.rounding import correct_rounding, is_correctable
from namlcp.residuals import Residuals, qp_residuals
from namlcp.status import Status

BY_LUCK = (
    "The tolerances are met in one order of summation and missed in that of the "
    "arguments: the terms of the residuals are too large for them. Loosen eps_abs."
)
# Residual over its tolerance up to which a point may be as good as it can be.
NEAR = 10.0
Matrices = tuple[Any, Any, Any]


class Judge:
    """The best point so far; `best` is the largest of its residuals over tolerances.

    The QP is solved if best <= 1. `given`: P, G and A as the user holds them, each
    None where absent. `proof`: a certificate that was accepted: verdict, point,
    residuals.
    """

    def __init__(self, qp: QP, limits: Limits, given: Matrices | None = None) -> None:
        self.qp, self.checked, self.limits = qp, qp, limits
        self.given = None if given and are_own(given, qp) else given
        self.is_columns = type(qp.P) is not np.ndarray
        self.best = inf
        self.point: Point | None = None
        self.residuals: Residuals | None = None
        self.proof: tuple[Status, Point, Residuals] | None = None
        self.message = ""

    @property
    def is_solved(self) -> bool:
        """Tell whether the best point solves the QP."""
        return self.best <= 1.0

    def offer(self, point: Point) -> float:
        """Measure the point on its bounds, or within them, or with rounding corrected.

        All have x within its bounds, and multipliers of the right signs. Returns the
        least of their largest residuals over tolerances.
        """
        tolerances, worst = self.limits.tolerances, inf
        z = np.maximum(point.z, 0.0)
        for moves in (True, False):
            x, z_box = on_bounds(point.x, point.z_box, self.qp.lb, self.qp.ub, moves)
            near = Point(x, point.y, z, z_box)
            found = self.measure(near)
            worst = min(worst, found.worst(*tolerances))
            if worst <= 1.0:
                return worst
        if is_correctable(found, *tolerances) or self.is_near(found, near):
            corrected = correct_rounding(self.qp, near, found, *tolerances)
            if corrected is not near:
                worst = min(worst, self.measure(corrected).worst(*tolerances))
        return worst

    def measure(self, point: Point, known: Residuals | None = None) -> Residuals:
        """Return the residuals of one point; keep it if it is the best.

        `known`: they, where they have been computed on the arrays of the QP.
        """
        found = known or self.residuals_of(point)
        worst = found.worst(*self.limits.tolerances)
        if self.given is not None and worst <= 1.0 and self.is_luck(found, point):
            self.take_order_of_user(self.given)
            found = self.residuals_of(point)
            worst = found.worst(*self.limits.tolerances)
        if worst < self.best:
            self.best, self.residuals, self.point = worst, found, point
        return found

    def residuals_of(self, point: Point) -> Residuals:
        """Return the residuals of a point, by the definition."""
        P, q, G, h, A, b, lb, ub = self.qp
        if self.is_columns:
            vectors = q, h, b, lb, ub
            return Residuals(*residuals_of_columns(P, G, A, vectors, tuple(point)))
        return qp_residuals(*self.qp, *point)

    def is_luck(self, found: Residuals, point: Point) -> bool:
        """Tell whether another order of the sums may leave residuals too large."""
        return not self.moved(found, point, 1.0).solved(*self.limits.tolerances)

    def is_near(self, found: Residuals, point: Point) -> bool:
        """Tell whether another order of the sums may pass, and not by far."""
        if found.worst(*self.limits.tolerances) > NEAR:
            return False
        return self.moved(found, point, -1.0).solved(*self.limits.tolerances)

    def moved(self, found: Residuals, point: Point, sign: float) -> Residuals:
        """Return the residuals, >= 0, with bounds of their rounding errors added."""
        matrices = (self.qp.P, self.qp.G, self.qp.A)
        own = (norm(M if self.qp.is_dense else M.data) for M in matrices)
        primal, dual, gap = rounding_errors(*own, *map(norm, point[:3]))
        return found._replace(
            primal=max(found.primal + sign * primal, 0.0),
            dual=max(found.dual + sign * dual, 0.0),
            gap=max(found.gap + sign * gap, 0.0),
        )

    def take_order_of_user(self, given: Matrices) -> None:
        """Measure from now on in the order in which the user's matrices are stored."""
        own = self.qp.P, self.qp.G, self.qp.A
        P, G, A = (as_stored(C, M) for C, M in zip(given, own, strict=True))
        C = sp.csc_array(P.copy()) if sp.issparse(P) else P  # SciPy sorts it in place
        if abs(C - C.T).max() > 0.0:
            P = self.qp.P  # (P + P') / 2
        self.qp, self.given = self.qp._replace(P=P, G=G, A=A), None
        self.is_columns = all(map(is_clean_csc, (P, G, A)))
        self.message = BY_LUCK  # unless a point passes
        if self.point is not None:
            self.best = inf
            self.measure(self.point)

    def accept_multipliers(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> bool:
        """Tell whether multipliers prove that no x is feasible; x: the point at hand.

        The certificate is kept.
        """
        proof = accept_primal(self.checked, x, y, z, self.limits.eps_abs)
        return self.keep(Status.PRIMAL_INFEASIBLE, proof)

    def accept_ray(self, d: np.ndarray, point: Point | None = None) -> bool:
        """Tell whether the QP is unbounded along d; the certificate is kept."""
        x, y, z, _ = point or self.qp.point()
        proof = accept_dual(self.checked, x, y, z, d, self.limits.eps_abs)
        return self.keep(Status.DUAL_INFEASIBLE, proof)

    def keep(self, status: Status, proof: Proof | None) -> bool:
        """Keep a certificate, if it is one."""
        if proof is not None:
            self.proof = status, *proof
        return proof is not None

    def answer(
        self, status: Status, iterations: int, method: str, message: str = ""
    ) -> Outcome:
        """Return the certificate, or the best point, SOLVED if it passes.

        If it does not, a final `status` becomes STALLED.
        """
        if self.proof is not None:
            return Outcome(*self.proof, iterations, method, message)
        if self.point is None or self.residuals is None:
            self.point = self.qp.point(self.qp.clip(np.zeros(self.qp.q.size)))
            self.residuals = self.residuals_of(self.point)
        if self.is_solved:
            status = Status.SOLVED
        elif status in FINAL:
            status, message = Status.STALLED, message or self.message
        return Outcome(status, self.point, self.residuals, iterations, method, message)


def are_own(given: Matrices, qp: QP) -> bool:
    """Tell whether (P, G, A) as they came are the very matrices of the QP."""
    P, G, A = given
    return P is qp.P and (G is None or G is qp.G) and (A is None or A is qp.A)


def as_stored(given: Any, own: Any) -> Any:
    """Return a matrix of the user in its own order, the QP's where it is absent.

    CSC arrays get the types that compiled code takes.
    """
    if given is None:
        return own
    if not sp.issparse(given):
        return np.atleast_2d(np.asarray(given, dtype=float))
    if given.format != "csc":
        return given
    data = np.ascontiguousarray(given.data, dtype=float)
    places = (np.ascontiguousarray(v, np.int32) for v in (given.indices, given.indptr))
    return sp.csc_array((data, *places), shape=given.shape)


def norm(entries: np.ndarray) -> float:
    """Return the 2-norm of all entries, without overflow or a warning of it."""
    return float(dnrm2(entries.ravel(order="K"))) if entries.size else 0.0
