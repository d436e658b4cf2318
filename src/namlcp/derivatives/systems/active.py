"""The active constraints of a solved QP."""

from typing import NamedTuple

import numpy as np

from namlcp.derivatives.systems.marks import sides_of
from namlcp.qp import QP, Point


class ActiveSet(NamedTuple):
    """Constraints held with equality.

    equalities, rows: rows of A and of G, in rising order. side (n,) int8: -1 for a
    variable at its lower bound, 1 at the upper one, 0 for a free variable.
    """

    equalities: np.ndarray
    rows: np.ndarray
    side: np.ndarray


def active_sets(qp: QP, point: Point) -> tuple[ActiveSet, ActiveSet, int]:
    """Return the strictly active constraints, all active ones, and how many are weak.

    A pinned variable (lb_j = ub_j) always counts as strictly active, at the bound that
    its multiplier presses on.
    """
    m = qp.h.size
    (strict, whole), weak = sides_of(qp, point)
    every = np.arange(qp.b.size)
    held, active = (
        ActiveSet(every, v[:m].nonzero()[0], v[m:]) for v in (strict, whole)
    )
    return held, active, weak
