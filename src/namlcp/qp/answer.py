"""The answer of one form of a QP, and the better one of two answers."""

from typing import NamedTuple

import numpy as np

from namlcp.limits import Limits
from namlcp.qp.problem import QP, Point
from namlcp.residuals import UNDEFINED, Residuals, qp_residuals
from namlcp.status import Status

# Objective of a QP with a certificate.
OBJECTIVE = {Status.PRIMAL_INFEASIBLE: np.inf, Status.DUAL_INFEASIBLE: -np.inf}
# Statuses that decide a QP, and those after which it is solved in another way.
FINAL = (Status.SOLVED, *OBJECTIVE)
UNDECIDED = (Status.STALLED, Status.NUMERICAL_ERROR)


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
