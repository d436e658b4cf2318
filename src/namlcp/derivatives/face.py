"""The constraints of a solved QP that its derivative holds, as `qp` describes the rule.

They are the strictly active ones, if their KKT matrix is regular; else independent ones
among them, if need be with the weakly active ones.

The multipliers of constraints that depend on each other are not unique. Let N span the
combinations (y, z, z_box) of active constraints that vanish, A'y + G'z + z_box = 0 with
z_box zero outside the active bounds. All multipliers of the solution are then those of
one plus N t, with the signs that rows and bounds want.
"""

import numpy as np

from namlcp.derivatives.factors import DenseFactors, KKTFactors
from namlcp.linalg import by_rows, submatrix
from namlcp.qp import KKT, QP, Point

VANISHED = 1e-9
"""Entries of a combination up to this multiple of its largest one count as 0."""

INDEPENDENT = 1e-6
"""A combination of null vectors counts as 0 in the multipliers below this norm."""


def factored(qp: QP, held: np.ndarray) -> DenseFactors | KKTFactors:
    """Return the factors of the KKT matrix K of held constraints."""
    (P, _, G, _, A, *_), p, m = qp, qp.b.size, qp.h.size
    equalities, rows = np.flatnonzero(held[:p]), np.flatnonzero(held[p : p + m])
    free = np.flatnonzero(held[p + m :] == 0)
    if qp.is_dense:
        C = np.concatenate((A[equalities], G[rows]))[:, free]
        zero = np.zeros((C.shape[0], C.shape[0]))
        return DenseFactors(np.block([[P[np.ix_(free, free)], C.T], [C, zero]]))
    A, G = submatrix(A, equalities, free), submatrix(G, rows, free)
    return KKTFactors(KKT(submatrix(P, free, free), by_rows(A), by_rows(G)))


def dependencies(qp: QP, held: np.ndarray, null_space: np.ndarray) -> np.ndarray:
    """Return N, from the null space of the KKT matrix of held constraints.

    A vector (u, v) of that has P u = 0, C u = 0 and C'v = 0: v alone is a dependency.
    """
    p, rows = qp.b.size, qp.b.size + qp.h.size
    at = np.flatnonzero(held[:rows])
    V = null_space[null_space.shape[0] - at.size :]
    size = np.linalg.norm(null_space, axis=0)
    left, values, _ = np.linalg.svd(V / size, full_matrices=False)
    V = left[:, values > INDEPENDENT]
    N = np.zeros((held.size, V.shape[1]))
    N[at] = V
    N[rows:] = -(qp.A.T @ N[:p] + qp.G.T @ N[p:rows])
    N[rows:][held[rows:] == 0] = 0.0
    return N


def signs(qp: QP, held: np.ndarray) -> np.ndarray:
    """Return the signs that (y, z, z_box) must have, 0 where any sign will do."""
    of_box = np.where(qp.lb == qp.ub, 0, held[held.size - qp.q.size :])
    return np.concatenate((np.zeros(qp.b.size), np.ones(qp.h.size), of_box))


def independent(
    qp: QP, held: np.ndarray, point: Point, N: np.ndarray
) -> tuple[np.ndarray, Point]:
    """Return independent constraints among the held that carry all multipliers alone.

    Each dependency is followed until a first multiplier is 0, whose constraint then
    counts as inactive (Caratheodory's theorem). Where a dependency has equalities
    alone, one of them is left out.
    """
    p, m, sign = qp.b.size, qp.h.size, signs(qp, held)
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
    return np.where(left_out, 0, held), Point(point.x, *np.split(value, (p, p + m)))
