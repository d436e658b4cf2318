"""Outcomes of QPs with a certificate."""

import numpy as np

from namlcp.outcome import Outcome
from namlcp.status import Status

# Objective of a QP with a certificate.
OBJECTIVE = {Status.PRIMAL_INFEASIBLE: np.inf, Status.DUAL_INFEASIBLE: -np.inf}
# Statuses after which a QP is solved in another way.
UNDECIDED = (Status.STALLED, Status.NUMERICAL_ERROR)


def objective_of(answer: Outcome) -> float:
    """Return 1/2 x'Px + q'x, infinite where a certificate takes the place of x."""
    objective = answer.residuals.objective
    if answer.status is Status.SOLVED:
        return objective
    return OBJECTIVE.get(answer.status, objective)
