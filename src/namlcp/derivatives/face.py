"""The constraints of a solved QP that its derivative holds, as `qp` describes the rule.

They are the strictly active ones, if their KKT matrix is regular; else independent ones
among them, if need be with the weakly active ones.

The multipliers of constraints that depend on each other are not unique. Let N span the
combinations (y, z, z_box) of active constraints that vanish, A'y + G'z + z_box = 0 with
z_box zero outside the active bounds. All multipliers of the solution are then those of
one plus N t, with the signs that rows and bounds want.
"""

from typing import NamedTuple

import numpy as np

from namlcp.derivatives.factors import DenseFactors, KKTFactors
from namlcp.derivatives.marks import sides_of
from namlcp.linalg import add_transposed, by_rows, submatrix, times
from namlcp.qp import KKT, QP, Point

VANISHED = 1e-9
"""Entries of a combination up to this multiple of its largest one count as 0."""

INDEPENDENT = 1e-6
"""A combination of null vectors counts as 0 in the multipliers below this norm."""


class ActiveSet(NamedTuple):
    """Constraints held with equality.

    equalities, rows: rows of A and of G, in rising order. side (n,) int8: -1 for a
    variable at its lower bound, 1 at the upper one, 0 for a free variable.
    """

    equalities: np.ndarray
    rows: np.ndarray
    side: np.ndarray

    def factors(self, qp: QP) -> DenseFactors | KKTFactors:
        """Return the factors of the KKT matrix K of these constraints."""
        free, (P, _, G, _, A, *_) = np.flatnonzero(self.side == 0), qp
        if qp.is_dense:
            C = np.concatenate((A[self.equalities], G[self.rows]))[:, free]
            zero = np.zeros((C.shape[0], C.shape[0]))
            return DenseFactors(np.block([[P[np.ix_(free, free)], C.T], [C, zero]]))
        A, G = submatrix(A, self.equalities, free), submatrix(G, self.rows, free)
        return KKTFactors(KKT(submatrix(P, free, free), by_rows(A), by_rows(G)))


def active_sets(qp: QP, point: Point) -> tuple[ActiveSet, ActiveSet, int]:
    """Return the strictly active constraints, all active ones, and how many are weak.

    A pinned variable (lb_j = ub_j) always counts as strictly active, at the bound that
    its multiplier presses on.
    """
    m, equalities = qp.h.size, np.arange(qp.b.size)
    sides, weak = sides_of(qp, point)
    strict, whole = (
        ActiveSet(equalities, np.flatnonzero(side[:m]), side[m:]) for side in sides
    )
    return strict, whole, weak


class Face:
    """The constraints held, and the factors of their KKT matrix K.

    Attributes
    ----------
    active, whole : ActiveSet
        The constraints held, and all that are active.
    point : Point
        The solution, with multipliers that are 0 for constraints that are not held.
    factors : DenseFactors or KKTFactors
        Those of K.
    weak : int
        How many constraints are active with a multiplier 0.
    singular : bool
        Whether K is singular with the strictly active constraints alone.
    """

    def __init__(self, qp: QP, solution: Point) -> None:
        self.qp = qp
        strict, self.whole, self.weak = active_sets(qp, solution)
        self.hold(strict, solution)
        self.singular = not self.factors.regular
        if self.singular:
            self.hold_independent()
        if not self.factors.regular and self.weak:
            self.hold(self.whole, solution)
            self.hold_independent()

    def hold(self, active: ActiveSet, point: Point) -> None:
        """Hold active constraints; `point` has their multipliers."""
        self.active, self.point = active, point
        self.factors = active.factors(self.qp)

    def hold_independent(self) -> None:
        """Leave out active constraints that depend on others, if there are any."""
        N = dependencies(self.qp, self.active, self.factors.null_space)
        if N.size:
            self.hold(*independent(self.qp, self.active, self.point, N))

    def backward(self, cotangents: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """Return the gradients in q, h, b, lb and ub from those in the solution."""
        P, _, G, _, A = self.qp[:5]
        (gx, gy, gz, gz_box), (equalities, rows, side) = cotangents, self.active
        free, held = np.flatnonzero(side == 0), side != 0
        u, lam, nu = held * gz_box, np.zeros(gz.size), np.zeros(gy.size)
        right = gx, gy, gz
        if u.any():
            right = gx - times(P, u), gy - times(A, u), gz - times(G, u)
        places = free, equalities, rows
        v = self.factors.solve(
            np.concatenate([w[at] for w, at in zip(right, places, strict=True)])
        )
        n, p = free.size, equalities.size
        u[free], nu[equalities], lam[rows] = v[:n], v[n : n + p], v[n + p :]
        terms = times(P, u)
        add_transposed(G, lam, terms)
        add_transposed(A, nu, terms)
        mu = held * (gx - terms)
        return 0.0 - u, lam, nu, (side < 0) * mu, (side > 0) * mu


def dependencies(qp: QP, active: ActiveSet, null_space: np.ndarray) -> np.ndarray:
    """Return N, from the null space of the KKT matrix of active constraints.

    A vector (u, v) of that has P u = 0, C u = 0 and C'v = 0: v alone is a dependency.
    """
    count = active.equalities.size + active.rows.size
    V = null_space[null_space.shape[0] - count :]
    size = np.linalg.norm(null_space, axis=0)
    left, values, _ = np.linalg.svd(V / size, full_matrices=False)
    V = left[:, values > INDEPENDENT]
    y, z = np.zeros((qp.b.size, V.shape[1])), np.zeros((qp.h.size, V.shape[1]))
    y[active.equalities], z[active.rows] = np.split(V, [active.equalities.size])
    z_box = -(qp.A.T @ y + qp.G.T @ z)
    z_box[active.side == 0] = 0.0
    return np.concatenate((y, z, z_box))


def signs(qp: QP, active: ActiveSet) -> np.ndarray:
    """Return the signs that (y, z, z_box) must have, 0 where any sign will do."""
    of_box = np.where(qp.lb == qp.ub, 0, active.side)
    return np.concatenate((np.zeros(qp.b.size), np.ones(qp.h.size), of_box))


def independent(
    qp: QP, active: ActiveSet, point: Point, N: np.ndarray
) -> tuple[ActiveSet, Point]:
    """Return independent active constraints that carry all multipliers alone.

    Each dependency is followed until a first multiplier is 0, whose constraint then
    counts as inactive (Caratheodory's theorem). Where a dependency has equalities
    alone, one of them is left out.
    """
    p, m, sign = qp.b.size, qp.h.size, signs(qp, active)
    value, left_out = np.concatenate(point[1:]), np.zeros(sign.size, dtype=bool)
    value[sign * value < 0.0] = 0.0
    for k in range(N.shape[1]):
        column = N[:, k]
        size = np.abs(column)
        limiting = (size > VANISHED * size.max()) & (sign != 0) & ~left_out
        places = np.flatnonzero(limiting)
        if places.size:
            i = places[np.argmin(np.abs(value[places]) / size[places])]
            value = value - value[i] / column[i] * column
            value[sign * value < 0.0] = 0.0
            value[i] = 0.0
        else:
            i = int(np.argmax(size[:p]))
        left_out[i] = True
        N[:, k + 1 :] -= np.outer(column, N[i, k + 1 :] / column[i])
    out_y, out_z, out_box = np.split(left_out, (p, p + m))
    held = ActiveSet(
        active.equalities[~out_y[active.equalities]],
        active.rows[~out_z[active.rows]],
        np.where(out_box, 0, active.side),
    )
    return held, Point(point.x, *np.split(value, (p, p + m)))
