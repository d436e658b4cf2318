"""What every engine returns."""

from typing import Any, NamedTuple

import numpy as np

from namlcp.status import Status

FINAL = (
    Status.SOLVED,
    Status.PRIMAL_INFEASIBLE,
    Status.DUAL_INFEASIBLE,
    Status.UNSOLVABLE,
)
"""Statuses that decide a problem."""
ENDS = (*FINAL, Status.TIME_LIMIT)
"""Statuses after which no other method is to be tried."""

OBJECTIVE = {Status.PRIMAL_INFEASIBLE: np.inf, Status.DUAL_INFEASIBLE: -np.inf}
"""Objective of a QP with a certificate."""


class Outcome(NamedTuple):
    """How the solve of a QP or an LCP ended, and which method found that.

    point: the `Point` of a QP, a certificate if the status is proved by one; the
    `LCPPoint` of an LCP. residuals: those on the data of the problem, `Residuals` of a
    QP, Res(z) of an LCP. ray: with UNSOLVABLE the proof of an LCP, beside its best
    point. closest: the `Nearest` of an infeasible QP, if that was asked for. factors:
    those that derivatives of a QP can use.
    """

    status: Status
    point: Any
    residuals: Any
    iterations: int
    method: str
    message: str = ""
    ray: np.ndarray | None = None
    closest: Any = None
    factors: Any = None
