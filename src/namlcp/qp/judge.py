"""Residual checks on unscaled data: `Judge` measures points and keeps the best one.

The interior-point method measures its points on the QP it was given. If that came from
a substitution, `confirmed` measures the final point again on the user's own data.
Measuring there alone would be weaker: x can be clipped to bounds, and z_box can take up
dual residuals, but not where the bounds are still rows of the user.

A residual is a sum, and sums of the same terms in another order differ by about the
rounding unit times their moduli. With terms near 1e9 (QFFFFF80) that is far above a
tolerance of 1e-9: a point may pass in the order in which the QP's matrices are stored
and fail in that of the user's own. `upheld` asks for both.
"""

from math import inf
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg.blas import dnrm2

from namlcp.compiled import kernel
from namlcp.limits import Limits
from namlcp.linalg import compiled_form
from namlcp.qp.answer import FINAL, Answer
from namlcp.qp.certificates import accept_dual, accept_primal
from namlcp.qp.problem import QP, Point
from namlcp.qp.rounding import UNIT, correct_rounding, is_correctable
from namlcp.qp.transforms import Substitution
from namlcp.residuals import Residuals, clean_qp_residuals, qp_residuals
from namlcp.status import Status

BY_LUCK = (
    "The tolerances are met in one order of summation and missed in that of the "
    "arguments: the terms of the residuals are too large for them. Loosen eps_abs."
)


class Judge:
    """The best point so far; `best` is the largest of its residuals over tolerances.

    The point solves the QP if best <= 1.
    """

    def __init__(self, qp: QP, limits: Limits) -> None:
        """Start with the zero point, not measured."""
        self.qp, self.limits = qp, limits
        self.vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
        self.matrices = tuple(compiled_form(M) for M in (qp.P, qp.G, qp.A))
        self.best = inf
        self.point = qp.point()
        self.measured: Residuals | None = None

    @property
    def residuals(self) -> Residuals:
        """The residuals of the best point."""
        return self.measured or qp_residuals(*self.qp, *self.point)

    def offer(self, point: Point) -> float:
        """Measure the point, then with x clipped, then with rounding corrected.

        Returns the least of their largest residuals over tolerances.
        """
        tolerances = self.limits.tolerances
        found = self.measure(point)
        worst = found.worst(*tolerances)
        if leaves_bounds(point.x, self.qp.lb, self.qp.ub):
            point = point._replace(x=self.qp.clip(point.x))
            found = self.measure(point)
            worst = min(worst, found.worst(*tolerances))
        if worst > 1.0 and is_correctable(found, *tolerances):
            corrected = correct_rounding(self.qp, point, found, *tolerances)
            if corrected is not point:
                worst = min(worst, self.measure(corrected).worst(*tolerances))
        return worst

    def measure(self, point: Point) -> Residuals:
        """Return the residuals of one point; keep it if it is the best."""
        if None in self.matrices:
            found = qp_residuals(*self.qp, *point)
        else:
            found = clean_qp_residuals(self.matrices, self.vectors, tuple(point))
        worst = found.worst(*self.limits.tolerances)
        if worst < self.best:
            self.best, self.measured, self.point = worst, found, point
        return found

    def answer(self, status: Status, iterations: int, form: str) -> Answer:
        """Return the best point, SOLVED if it passes.

        If it does not, a final `status` becomes STALLED.
        """
        if self.best <= 1.0:
            status = Status.SOLVED
        elif status in FINAL:
            status = Status.STALLED
        return Answer(status, self.point, self.residuals, iterations, form)


@kernel
def leaves_bounds(x, lb, ub):
    """Tell whether an entry of x is not between its bounds."""
    for j in range(x.size):
        if not lb[j] <= x[j] <= ub[j]:
            return True
    return False


def confirmed(answer: Answer, back: Substitution, limits: Limits) -> Answer:
    """Map the answer of a substituted QP back and check it on the user's own data.

    It becomes STALLED if its point or certificate does not pass there.
    """
    qp, point, tol = back.user, answer.point, limits.eps_abs
    proof = None
    if answer.status is Status.PRIMAL_INFEASIBLE:
        _, y, z, _ = back.certificate(point)
        proof = accept_primal(qp, qp.point().x, y, z, tol)
    elif answer.status is Status.DUAL_INFEASIBLE:
        x, y, z, _ = qp.point()
        proof = accept_dual(qp, x, y, z, back.ray(point.x), tol)
    if proof is not None:
        return answer._replace(point=proof)
    judge = Judge(qp, limits)
    judge.offer(back.point(point))
    found = judge.answer(answer.status, answer.iterations, answer.form)
    return found._replace(message=answer.message)


def upheld(
    answer: Answer, qp: QP, given: tuple[Any, Any, Any], limits: Limits
) -> Answer:
    """Return a SOLVED answer corrected for the user's own sums, STALLED if that fails.

    `given` = (P, G, A) as they came, None where absent. Nothing is computed where they
    are the very matrices of the QP, whose sums have been taken, and little where the
    rounding errors of all sums are within the tolerances.
    """
    if answer.status is not Status.SOLVED or are_own(given, qp):
        return answer
    own = qp.P, qp.G, qp.A
    found = answer.residuals
    primal, dual, gap = rounding_errors(own, answer.point)
    uncertain = found._replace(
        primal=found.primal + primal, dual=found.dual + dual, gap=found.gap + gap
    )
    if uncertain.solved(*limits.tolerances):
        return answer
    matrices = (as_stored(C, M) for C, M in zip(given, own, strict=True))
    theirs = qp._replace(**dict(zip("PGA", matrices, strict=True)))
    judge = Judge(theirs, limits)
    judge.offer(answer.point)
    judged = judge.answer(Status.STALLED, answer.iterations, answer.form)
    message = answer.message if judged.status is Status.SOLVED else BY_LUCK
    return judged._replace(message=message)


def are_own(given: tuple[Any, Any, Any], qp: QP) -> bool:
    """Tell whether (P, G, A) as they came are the very matrices of the QP."""
    P, G, A = given
    return P is qp.P and (G is None or G is qp.G) and (A is None or A is qp.A)


def as_stored(given: Any, own: Any) -> Any:
    """Return a matrix of the user in its own order, the QP's where it is absent.

    CSC arrays get the types for which kernels are compiled.
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


def rounding_errors(
    matrices: tuple[Any, Any, Any], point: Point
) -> tuple[float, float, float]:
    """Return bounds of what another order of the sums changes in the three residuals.

    The moduli of the terms of a row of M x sum up to at most || M ||_F || x ||_2. The
    gap's other sums run over vectors, in one order only.
    """
    P, G, A = (norm(M if isinstance(M, np.ndarray) else M.data) for M in matrices)
    x, y, z, _ = map(norm, point)
    return UNIT * max(G, A) * x, UNIT * (P * x + G * z + A * y), UNIT * P * x * x


def norm(entries: np.ndarray) -> float:
    """Return the 2-norm of all entries, without overflow or a warning of it."""
    return float(dnrm2(entries.ravel(order="K"))) if entries.size else 0.0
