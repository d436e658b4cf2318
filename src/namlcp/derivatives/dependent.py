"""Active constraints that depend on each other: their multipliers are not unique.

Let N span the combinations of active rows that vanish: A'N_y + G_I'N_z + N_box = 0 with
N_box zero outside the active bounds. The multipliers of the solution are then all
lambda + N t with nonnegative entries of z, and signs of z_box as the bounds want them.
"""

from typing import NamedTuple

import numpy as np

from namlcp.derivatives.systems import ActiveSet
from namlcp.qp import QP, Point

VANISHED = 1e-9
"""Entries of a combination up to this multiple of its largest one count as 0."""

INDEPENDENT = 1e-6
"""A combination of null vectors counts as 0 in the multipliers below this norm."""


class Dependencies(NamedTuple):
    """A basis of the vanishing combinations, its columns, of d elements.

    y (p, d), z (m, d), z_box (n, d); entries of constraints that are not active are 0.
    """

    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray

    @property
    def number(self) -> int:
        """Return d."""
        return self.y.shape[1]


def dependencies(qp: QP, active: ActiveSet, null_space: np.ndarray) -> Dependencies:
    """Return the dependencies of the active constraints, from those of the KKT matrix.

    The matrix is that of the free variables, the equalities of `active` and its rows.
    A vector (u, v) of its null space has P u = 0, C u = 0 and C'v = 0, so that v alone
    is a dependency.
    """
    order = active.equalities.size + active.rows.size
    V = null_space[null_space.shape[0] - order :]
    size = np.linalg.norm(null_space, axis=0)
    left, values, _ = np.linalg.svd(V / size, full_matrices=False)
    V = left[:, values > INDEPENDENT]
    y, z = np.zeros((qp.b.size, V.shape[1])), np.zeros((qp.h.size, V.shape[1]))
    y[active.equalities] = V[: active.equalities.size]
    z[active.rows] = V[active.equalities.size :]
    z_box = -(qp.A.T @ y + qp.G.T @ z)
    z_box[active.side == 0] = 0.0
    return Dependencies(y, z, z_box)


def signed_multipliers(
    qp: QP, active: ActiveSet, point: Point, found: Dependencies
) -> tuple[np.ndarray, np.ndarray]:
    """Return the multipliers that must stay nonnegative, and their rows of N.

    They are z, then z_box times the side of each bound; a pinned variable has 0 in N.
    """
    side = np.where(qp.lb == qp.ub, 0, active.side)
    N = np.concatenate((found.z, side[:, None] * found.z_box))
    return np.concatenate((point.z, side * point.z_box)), N


def basic(
    qp: QP, active: ActiveSet, point: Point, found: Dependencies
) -> tuple[ActiveSet, Point]:
    """Return independent active constraints that carry all multipliers alone.

    Each dependency is followed until a first multiplier is 0, whose constraint then
    counts as inactive (Caratheodory's theorem). Where a dependency has equalities
    alone, one of them is left out.
    """
    value, N = signed_multipliers(qp, active, point, found)
    value = np.maximum(value, 0.0)
    y, N_y = point.y.copy(), found.y.copy()
    m = qp.h.size
    dropped = np.zeros(value.size, dtype=bool)
    left_out = np.zeros(y.size, dtype=bool)
    for k in range(found.number):
        column = N[:, k]
        large = np.abs(column) > VANISHED * max(
            np.abs(column).max(initial=0.0), np.abs(N_y[:, k]).max(initial=0.0)
        )
        places = np.flatnonzero(large & ~dropped)
        if places.size:
            steps = value[places] / np.abs(column[places])
            i = places[np.argmin(steps)]
            t = -value[i] / column[i]
            value, y = np.maximum(value + t * column, 0.0), y + t * N_y[:, k]
            value[i] = 0.0
            dropped[i] = True
            share = N[i] / column[i]
        else:
            i = int(np.argmax(np.abs(N_y[:, k])))
            left_out[i] = True
            share = N_y[i] / N_y[i, k]
        share[: k + 1] = 0.0
        N, N_y = N - np.outer(column, share), N_y - np.outer(N_y[:, k], share)
    side = active.side.copy()
    side[dropped[m:]] = 0
    rows = active.rows[~dropped[:m][active.rows]]
    equalities = active.equalities[~left_out[active.equalities]]
    pinned = qp.lb == qp.ub
    z_box = np.where(pinned, point.z_box, active.side * value[m:])
    return ActiveSet(equalities, rows, side), Point(point.x, y, value[:m], z_box)
