"""The KKT system of an active set for dense matrices.

Where it has no good Cholesky factors, the whole matrix is factored as a symmetric
indefinite one.
"""

from typing import Any

import numpy as np
from scipy.linalg.lapack import dsycon, dsytrf, dsytrf_lwork, dsytrs

from namlcp.derivatives.systems.active import ActiveSet
from namlcp.derivatives.systems.cholesky import CholeskySystem
from namlcp.qp import QP

SINGULAR = 1e-13
"""A matrix scaled to rows of size 1 is singular if the reciprocal of its condition is
below this, and eigenvalues below this times its order count as 0."""


class DenseSystem:
    """The system of one active set.

    Attributes
    ----------
    regular : bool
        Whether it has one solution; if not, `solve` gives one of least norm.
    null_space : (order, k) array
        A basis of the vectors (u_F, nu, lam_I) that the matrix maps to 0.
    """

    def __init__(
        self, qp: QP, active: ActiveSet, factors: CholeskySystem | None = None
    ) -> None:
        """Factor, unless the factors are there already."""
        free = (active.side == 0).nonzero()[0]
        self.places = active.equalities, active.rows, free
        held = active.equalities.size + active.rows.size
        self.system: Any = factors
        self.regular = True
        if factors is None:
            sizes = qp.q.size, qp.h.size, qp.b.size
            self.system = CholeskySystem(*sizes, free.size, held)
            self.system.hold((qp.P, qp.G, qp.A), self.places)
            self.regular = self.system.factor()
        self.indefinite: Indefinite | None = None
        self.null_space = np.empty((free.size + held, 0))
        if not self.regular:
            C = np.concatenate((qp.A[active.equalities], qp.G[active.rows]))[:, free]
            zero = np.zeros((C.shape[0], C.shape[0]))
            K = np.block([[qp.P[np.ix_(free, free)], C.T], [C, zero]])
            self.indefinite = Indefinite(K)
            self.null_space = self.indefinite.null_space
            self.regular = not self.null_space.size

    def solve(
        self, r: np.ndarray, d: np.ndarray, e: np.ndarray, u: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Write u_F, for u_B as given and u_F = 0; return (lam, nu, rest).

        G_I u = d_I and A u = e hold, and rest = r - P u - G'lam - A'nu is 0 on F.
        """
        lam, nu, rest = np.zeros(d.size), np.zeros(e.size), np.empty(r.size)
        vectors = r, d, e, u, lam, nu, rest
        if self.indefinite is None:
            self.system.solve(*vectors)
            return lam, nu, rest
        equalities, rows, free = self.places
        for _ in range(2):  # the second solve refines the first
            s = self.system.remainder(*vectors)
            du, dv = self.indefinite.solve(rest[free], s)
            u[free] += du
            nu[equalities] += dv[: equalities.size]
            lam[rows] += dv[equalities.size :]
        self.system.remainder(*vectors)
        return lam, nu, rest


class Indefinite:
    """L D L' by the pivoting of Bunch and Kaufman; if singular, the pseudo-inverse.

    null_space: a basis of it.
    """

    def __init__(self, K: np.ndarray) -> None:
        size = np.abs(K).max(axis=1, initial=0.0)
        self.scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
        K = K * self.scale * self.scale[:, None]
        self.null_space = np.empty((K.shape[0], 0))
        self.is_singular = True
        if np.all(size > 0.0):
            # without a large lwork dsytrf is unblocked
            lwork = int(dsytrf_lwork(K.shape[0], lower=1)[0])
            self.L, self.pivots, info = dsytrf(K, lower=1, lwork=lwork)
            norm = np.abs(K).sum(axis=1).max()
            rcond = 0.0 if info else dsycon(self.L, self.pivots, norm, lower=1)[0]
            self.is_singular = rcond < SINGULAR
        if self.is_singular:
            values, vectors = np.linalg.eigh(K)
            kept = np.abs(values) > SINGULAR * K.shape[0]
            self.values, self.vectors = values[kept], vectors[:, kept]
            self.null_space = self.scale[:, None] * vectors[:, ~kept]

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[Any, Any]:
        """Return u and v."""
        rhs = np.concatenate((r, s)) * self.scale
        if self.is_singular:
            out = self.vectors @ ((self.vectors.T @ rhs) / self.values)
        else:
            out = dsytrs(self.L, self.pivots, rhs, lower=1)[0]
        out *= self.scale
        return out[: r.size], out[r.size :]
