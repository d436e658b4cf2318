"""What a form found, and which of two answers is the better one."""

from typing import NamedTuple

import numpy as np

from namlcp.options import Options
from namlcp.qp.problem import QP
from namlcp.residuals import Residuals, qp_residuals
from namlcp.status import Status

OBJECTIVE = {Status.PRIMAL_INFEASIBLE: np.inf, Status.DUAL_INFEASIBLE: -np.inf}
FINAL = (Status.SOLVED, *OBJECTIVE)


class Answer(NamedTuple):
    """What a form found: a claim, a point or a certificate, and how."""

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    residuals: Residuals
    iterations: int
    form: str
    message: str


def late(qp: QP) -> Answer:
    """Return the answer where time is over before a form has begun: x = clip(0)."""
    x = np.minimum(np.maximum(np.zeros(qp.q.size), qp.lb), qp.ub)
    point = x, np.zeros(qp.b.size), np.zeros(qp.h.size), np.zeros(qp.q.size)
    return Answer(
        Status.TIME_LIMIT, *point, qp_residuals(*qp, *point), 0, "substitution", ""
    )


def is_decided(answer: Answer | None) -> bool:
    """Tell whether no other form need be tried."""
    return answer is not None and answer.status in (*FINAL, Status.TIME_LIMIT)


def better(answer: Answer, other: Answer, options: Options) -> Answer:
    """Return `other`, tried after `answer`, unless that has the better point."""
    eps = options.eps_abs, options.eps_rel
    if other.status not in FINAL and (
        answer.residuals.worst(*eps) < other.residuals.worst(*eps)
    ):
        return answer._replace(status=other.status, message=other.message)
    return other
