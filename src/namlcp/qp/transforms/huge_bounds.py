"""Removal of huge bounds and right-hand sides, such as 1e10 in the place of infinity.

Sums that contain products with them round off all other terms. A point of the QP
without them needs no mapping back.
"""

import numpy as np

from namlcp.qp.problem import QP

# Least huge bound or h_i, relative to the largest of 1, |b| and those below HUGE.
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
