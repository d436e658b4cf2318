"""Bounds and right-hand sides that are huge, as 1e10 where "no bound" was meant.

Products with them round off the contributions of the others. A QP that stalls is solved
without them, and its solution is judged with them; it needs no way back.
"""

import numpy as np

from namlcp.qp.problem import QP

# Least huge bound, relative to all that are not, and to 1.
HUGE = 1e6


def without_huge_bounds(qp: QP) -> QP | None:
    """Return the QP with its huge bounds made infinite; None if it has none."""
    sides = np.abs(np.concatenate((qp.h, qp.lb, qp.ub)))
    ordinary = np.concatenate((np.ones(1), np.abs(qp.b), sides[sides < HUGE]))
    huge = HUGE * ordinary.max()
    upper = np.concatenate((qp.h, -qp.lb, qp.ub))
    if not ((huge <= upper) & (upper < np.inf)).any():
        return None
    h = np.where(qp.h >= huge, np.inf, qp.h)
    lb = np.where(qp.lb <= -huge, -np.inf, qp.lb)
    ub = np.where(qp.ub >= huge, np.inf, qp.ub)
    return qp._replace(h=h, lb=lb, ub=ub)
