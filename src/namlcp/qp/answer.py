"""The answer of one form of a QP, the better one of two, and the last verdict.

A residual is a sum, and sums of the same terms in another order differ by about the
rounding unit times their moduli. With terms near 1e9 (QFFFFF80) that is far above a
tolerance of 1e-9: a point may pass in the order in which the QP's matrices are stored
and fail in that of the user's own. `upheld` asks both.
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.limits import Limits
from namlcp.qp.problem import QP, Point
from namlcp.residuals import UNDEFINED, Residuals, host_residuals, qp_residuals
from namlcp.status import Status

# Objective of a QP with a certificate.
OBJECTIVE = {Status.PRIMAL_INFEASIBLE: np.inf, Status.DUAL_INFEASIBLE: -np.inf}
# Statuses that decide a QP, and those after which it is solved in another way.
FINAL = (Status.SOLVED, *OBJECTIVE)
UNDECIDED = (Status.STALLED, Status.NUMERICAL_ERROR)

# Spacing of the numbers next to 1, the rounding error of a sum over its terms.
UNIT = float(np.finfo(float).eps)
BY_LUCK = (
    "The tolerances are met in one order of summation and missed in that of the "
    "arguments: the terms of the residuals are too large for them. Loosen eps_abs."
)


class Answer(NamedTuple):
    """The status of a QP, a point or a certificate, and how a form found it."""

    status: Status
    point: Point
    residuals: Residuals
    iterations: int
    form: str
    message: str = ""

    @property
    def ends(self) -> bool:
        """Tell whether no other form is to be tried."""
        return self.status in FINAL or self.status is Status.TIME_LIMIT


def proved(
    status: Status, proof: Point, iterations: int, form: str, message: str = ""
) -> Answer:
    """Return the answer that a certificate gives."""
    return Answer(status, proof, UNDEFINED, iterations, form, message)


def out_of_time(qp: QP) -> Answer:
    """Return the answer where time ran out before any form began: x = clip(0)."""
    point = qp.point(qp.clip(np.zeros(qp.q.size)))
    residuals = qp_residuals(*qp, *point)
    return Answer(Status.TIME_LIMIT, point, residuals, 0, "substitution")


def better(answer: Answer, other: Answer, limits: Limits) -> Answer:
    """Return the answer with the better point; `other`, the later one, if it is final.

    The status and the message are those of `other` in any case.
    """
    worst, new = (a.residuals.worst(*limits.tolerances) for a in (answer, other))
    if other.status not in FINAL and worst < new:
        return answer._replace(status=other.status, message=other.message)
    return other


def upheld(
    answer: Answer, qp: QP, given: tuple[Any, Any, Any], limits: Limits
) -> Answer:
    """Return a SOLVED answer that the user's own sums do not uphold as STALLED.

    `given` = (P, G, A) as they came, None where absent. Nothing is computed where they
    are the very matrices of the QP, whose sums have been taken, and little where the
    rounding errors of all sums are within the tolerances.
    """
    own = qp.P, qp.G, qp.A
    same = all(M is C or C is None for M, C in zip(own, given, strict=True))
    if same or answer.status is not Status.SOLVED:
        return answer
    found, point = answer.residuals, answer.point
    errors = rounding_errors(own, point)
    uncertain = found._replace(
        primal=found.primal + errors[0],
        dual=found.dual + errors[1],
        gap=found.gap + errors[2],
    )
    if uncertain.solved(*limits.tolerances):
        return answer
    vectors = qp.q, qp.h, qp.b, qp.lb, qp.ub
    primal, dual, gap = host_residuals(given, vectors, point)
    theirs = found._replace(
        primal=max(primal, found.primal),
        dual=max(dual, found.dual),
        gap=max(gap, found.gap),
    )
    if theirs.solved(*limits.tolerances):
        return answer
    return answer._replace(status=Status.STALLED, residuals=theirs, message=BY_LUCK)


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
    """Return the 2-norm of all entries, infinite where it overflows."""
    flat = entries.ravel(order="K")
    with np.errstate(over="ignore"):
        return float(flat.dot(flat)) ** 0.5
