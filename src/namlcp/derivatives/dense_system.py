"""The KKT system of an active set, [P C'; C 0] (u, v) = (r, s), factored once.

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
"""The system counts as singular if the reciprocal of its condition is below this."""


class Cholesky:
    """Cholesky factors of P and of its Schur complement."""

    def __init__(self, P: np.ndarray, C: np.ndarray) -> None:
        """Factor; `good` tells whether pivots are far enough from 0."""
        self.W, self.good = np.empty((0, 0)), False
        self.L = factor(P)
        if self.L is None:
            return
        self.M = None
        if C.shape[0]:
            self.W = dtrtrs(self.L, C.T, lower=1)[0]
            self.M = factor(self.W.T @ self.W)
        self.good = not C.shape[0] or self.M is not None

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u and v."""
        if not r.size:
            return r, s
        t = dtrtrs(self.L, r, lower=1)[0]
        v = s
        if s.size:
            v = dpotrs(self.M, self.W.T @ t - s, lower=1)[0]
            t = t - self.W @ v
        return dtrtrs(self.L, t, lower=1, trans=1)[0], v


def factor(P: np.ndarray) -> np.ndarray | None:
    """Return the Cholesky factor of P, None if a pivot is too small."""
    if not P.size:
        return P
    L, info = dpotrf(P, lower=1, clean=0)
    if info or np.any(L.diagonal() ** 2 < LEAST_PIVOT * P.diagonal()):
        return None
    return L


class Indefinite:
    """L D L' of the whole matrix, by the diagonal pivoting of Bunch and Kaufman."""

    def __init__(self, K: np.ndarray) -> None:
        """Factor; `good` tells whether K is regular."""
        size = np.abs(K).max(axis=1)
        self.scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
        K = K * self.scale * self.scale[:, None]
        # without a large lwork dsytrf is unblocked
        lwork = int(dsytrf_lwork(K.shape[0], lower=1)[0])
        self.L, self.pivots, info = dsytrf(K, lower=1, lwork=lwork)
        self.good = info == 0
        if self.good:
            norm = np.abs(K).sum(axis=1).max()
            self.good = dsycon(self.L, self.pivots, norm, lower=1)[0] >= SINGULAR

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u and v."""
        rhs = np.concatenate((r, s)) * self.scale
        out = dsytrs(self.L, self.pivots, rhs, lower=1)[0] * self.scale
        return out[: r.size], out[r.size :]


class LeastNorm:
    """The pseudo-inverse of a singular matrix."""

    good = True

    def __init__(self, K: np.ndarray) -> None:
        values, vectors = np.linalg.eigh(K)
        kept = np.abs(values) > SINGULAR * K.shape[0] * np.abs(values).max(initial=0.0)
        self.values, self.vectors = values[kept], vectors[:, kept]

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u and v."""
        rhs = np.concatenate((r, s))
        out = self.vectors @ ((self.vectors.T @ rhs) / self.values)
        return out[: r.size], out[r.size :]


class DenseSystem:
    """The system for dense P and C.

    Attributes
    ----------
    regular : bool
        Whether it has one solution; if not, `solve` gives one of least norm.
    """

    def __init__(self, P: np.ndarray, C: np.ndarray) -> None:
        self.P, self.C = P, C
        self.factors: Any = Cholesky(P, C)
        if not self.factors.good:
            zero = np.zeros((C.shape[0], C.shape[0]))
            K = np.block([[P, C.T], [C, zero]])
            self.factors = Indefinite(K)
        self.regular = bool(self.factors.good)
        if not self.regular:
            self.factors = LeastNorm(K)

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (u, v)."""
        u, v = self.factors.solve(r, s)
        du, dv = self.factors.solve(r - self.P @ u - v @ self.C, s - self.C @ u)
        return u + du, v + dv
