"""The KKT system of an active set, [P C'; C 0] (u, v) = (r, s), for dense matrices.

P is that of the free variables, C holds the active rows. For a definite P with
P = L L' and W = L^-1 C' the Schur complement is S = W'W, and

    S v = W' L^-1 r - s,   u = L^-T (L^-1 r - W v).

All else is factored as a symmetric indefinite matrix. Each solve ends with a step of
refinement, as the derivative is then exact to rounding.
"""

from typing import Any

import numpy as np
from scipy.linalg.lapack import (
    dpotrf,
    dpotrs,
    dsycon,
    dsytrf,
    dsytrf_lwork,
    dsytrs,
    dtrtrs,
)

LEAST_PIVOT = 1e-8
"""Cholesky factors are used if no pivot is below this multiple of its diagonal entry;
a single step of refinement then removes the error of the Schur complement."""

SINGULAR = 1e-13
"""A matrix scaled to rows of size 1 is singular if the reciprocal of its condition is
below this, and eigenvalues below this times its order count as 0."""


class Cholesky:
    """Cholesky factors of P and of its Schur complement.

    `good` tells whether all pivots are far enough from 0.
    """

    def __init__(self, P: np.ndarray, C: np.ndarray) -> None:
        self.good = False
        self.L = factor(P)
        if self.L is None:
            return
        self.W = self.S = np.empty((P.shape[0], 0))
        if C.size:
            self.W = dtrtrs(self.L, C.T, lower=1)[0]
            self.S = factor(self.W.T @ self.W)
        self.good = self.S is not None and (C.size > 0 or not C.shape[0])

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u and v."""
        if not r.size:
            return r, s
        t, v = dtrtrs(self.L, r, lower=1)[0], s
        if s.size:
            v = dpotrs(self.S, self.W.T @ t - s, lower=1)[0]
            t -= self.W @ v
        return dtrtrs(self.L, t, lower=1, trans=1)[0], v


def factor(P: Any) -> Any:
    """Return the Cholesky factor of P, None if a pivot is too small."""
    if not P.size:
        return P
    L, info = dpotrf(P, lower=1, clean=0)
    if info or np.any(L.diagonal() ** 2 < LEAST_PIVOT * P.diagonal()):
        return None
    return L


class Indefinite:
    """L D L' by the pivoting of Bunch and Kaufman; if singular, the pseudo-inverse.

    null_space: an orthonormal basis of it, for the matrix scaled to rows of size 1.
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
            self.null_space = vectors[:, ~kept]

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u and v."""
        rhs = np.concatenate((r, s)) * self.scale
        if self.is_singular:
            out = self.vectors @ ((self.vectors.T @ rhs) / self.values)
        else:
            out = dsytrs(self.L, self.pivots, rhs, lower=1)[0]
        out *= self.scale
        return out[: r.size], out[r.size :]


class DenseSystem:
    """The system for dense P and C.

    Attributes
    ----------
    regular : bool
        Whether it has one solution; if not, `solve` gives one of least norm.
    null_space : (order, k) array
        A basis of the vectors (u, v) that the matrix maps to 0.
    """

    def __init__(self, P: np.ndarray, C: np.ndarray) -> None:
        self.P, self.C = P, C
        self.factors: Any = Cholesky(P, C)
        self.null_space = np.empty((P.shape[0] + C.shape[0], 0))
        if not self.factors.good:
            zero = np.zeros((C.shape[0], C.shape[0]))
            self.factors = Indefinite(np.block([[P, C.T], [C, zero]]))
            self.null_space = self.factors.scale[:, None] * self.factors.null_space
        self.regular = not self.null_space.size

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (u, v)."""
        u, v = self.factors.solve(r, s)
        du, dv = self.factors.solve(r - self.P @ u - v @ self.C, s - self.C @ u)
        return u + du, v + dv
