"""Which constraints of a solved QP are active, and with a multiplier or without.

A constraint is strictly active if its multiplier is not 0, and weakly active if its
multiplier is 0 although it holds with equality; there the solution has a kink.
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.qp import QP, Point

ACTIVE = 1e-8
"""A multiplier counts as 0 if in no column of the stationarity condition its term
exceeds this multiple of the largest term there; a slack counts as 0 up to this multiple
of (1 + max |x|) times the largest entry of the row."""


class ActiveSet(NamedTuple):
    """Constraints held with equality.

    equalities, rows: rows of A and of G, in rising order. side (n,) int8: -1 for a
    variable at its lower bound, 1 at the upper one, 0 for a free variable.
    """

    equalities: np.ndarray

    rows: np.ndarray
    side: np.ndarray

    @property
    def size(self) -> int:
        """Count the inequalities and bounds."""
        return self.rows.size + int(np.count_nonzero(self.side))


def active_sets(qp: QP, point: Point) -> tuple[ActiveSet, ActiveSet]:
    """Return the strictly active constraints, then these with the weakly active ones.

    A pinned variable (lb_j = ub_j) always counts as strictly active, at the bound that
    its multiplier presses on.
    """
    x, y, z, z_box = point
    size = np.maximum(np.abs(qp.P @ x), np.abs(qp.q))
    for C, multiplier in ((qp.G, z), (qp.A, y)):
        if multiplier.size:
            np.maximum(size, np.abs(multiplier @ C), out=size)
    np.maximum(size, np.abs(z_box), out=size)
    shown = np.abs(z_box) > ACTIVE * size
    side = np.where(shown, np.sign(z_box), 0.0).astype(np.int8)
    pinned = qp.lb == qp.ub
    side[pinned] = np.where(z_box[pinned] > 0.0, 1, -1)
    candidates = np.flatnonzero(z > 0.0)
    largest = weights(qp.G, candidates, size) * z[candidates]
    rows = candidates[largest > ACTIVE]
    every = np.arange(qp.b.size)
    strict = ActiveSet(every, rows, side)

    near = ACTIVE * (1.0 + np.abs(x).max(initial=0.0))
    at_lower, at_upper = x - qp.lb <= near, qp.ub - x <= near
    weak_side = np.where(side != 0, side, 1 * at_upper - 1 * (at_lower & ~at_upper))
    slack = qp.h - qp.G @ x
    is_active = slack <= near * weights(qp.G, np.arange(z.size), np.ones(x.size))
    is_active[rows] = True
    return strict, ActiveSet(
        every, np.flatnonzero(is_active), weak_side.astype(np.int8)
    )


def weights(G: Any, rows: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return max_j |G_ij| / size_j of some rows i, where 0 / 0 counts as 0."""
    with np.errstate(divide="ignore"):
        scale = np.where(size > 0.0, 1.0 / size, 0.0)
    if type(G) is np.ndarray:
        return (np.abs(G[rows]) * scale).max(axis=1, initial=0.0)
    part = np.zeros(G.shape[0])
    columns = np.repeat(np.arange(G.shape[1]), np.diff(G.indptr))
    np.maximum.at(part, G.indices, np.abs(G.data) * scale[columns])
    return part[rows]
