"""What a solve of a QP ends with."""

from typing import Any, NamedTuple

import numpy as np

from namlcp.qp.problem import Point
from namlcp.residuals import UNDEFINED, Residuals
from namlcp.status import Status

# Objective of a QP with a certificate.
OBJECTIVE = {Status.PRIMAL_INFEASIBLE: np.inf, Status.DUAL_INFEASIBLE: -np.inf}
# Statuses that decide a QP, and those after which it is solved in another way.
FINAL = (Status.SOLVED, *OBJECTIVE)
UNDECIDED = (Status.STALLED, Status.NUMERICAL_ERROR)


class Answer(NamedTuple):
    """The status of a QP, a point or a certificate, and how a form found it.

    closest: the `Nearest` of an infeasible QP, if that was asked for.
    """

    status: Status
    point: Point
    residuals: Residuals
    iterations: int
    form: str
    message: str = ""
    closest: Any = None

    @property
    def ends(self) -> bool:
        """Tell whether no other form is to be tried."""
        return self.status in FINAL or self.status is Status.TIME_LIMIT


def objective_of(answer: Answer) -> float:
    """Return 1/2 x'Px + q'x, infinite where a certificate takes the place of x."""
    objective = answer.residuals.objective
    if answer.status is Status.SOLVED:
        return objective
    return OBJECTIVE.get(answer.status, objective)


def proved(
    status: Status, proof: Point, iterations: int, form: str, message: str = ""
) -> Answer:
    """Return the answer that a certificate gives."""
    return Answer(status, proof, UNDEFINED, iterations, form, message)
