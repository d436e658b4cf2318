"""Sides so far away that they only do harm: 1e10 where "no bound" was meant.

Products with such a side round off what the near ones say. Where a solve stalls it is
tried again without them, and what comes of it is judged with them.
"""

import numpy as np

from namlcp.options import Options
from namlcp.qp.answer import Answer
from namlcp.qp.problem import QP
from namlcp.residuals import qp_residuals
from namlcp.status import Status

FAR = 1e6  # times all nearer sides, and 1


def without_far_sides(qp: QP) -> QP | None:
    """Return the QP with its far sides made infinite; None if it has none."""
    sides = np.abs(np.concatenate((qp.h, qp.lb, qp.ub)))
    near = np.concatenate((np.ones(1), np.abs(qp.b), sides[sides < FAR]))
    far = FAR * near.max()
    limits = np.concatenate((qp.h, -qp.lb, qp.ub))
    if not ((far <= limits) & (limits < np.inf)).any():
        return None
    h = np.where(qp.h >= far, np.inf, qp.h)
    lb = np.where(qp.lb <= -far, -np.inf, qp.lb)
    ub = np.where(qp.ub >= far, np.inf, qp.ub)
    return qp._replace(h=h, lb=lb, ub=ub)


def confirmed(qp: QP, answer: Answer, options: Options) -> Answer | None:
    """Return the answer of the QP without far sides if it is one of the QP itself.

    So it is for a solution that keeps them, and for a proof of infeasibility.
    """
    if answer.status is Status.PRIMAL_INFEASIBLE:
        return answer
    if answer.status is not Status.SOLVED:
        return None
    point = answer.x, answer.y, answer.z, answer.z_box
    residuals = qp_residuals(*qp, *point)
    if not residuals.solved(options.eps_abs, options.eps_rel):
        return None
    return answer._replace(residuals=residuals)
