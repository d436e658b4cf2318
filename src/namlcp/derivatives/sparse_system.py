"""The KKT system of an active set for sparse matrices.

K is scaled to rows of size 1 and factored as the quasi-definite K + DELTA diag(I, -I).
Refinement with residuals of K itself removes the shift: each step multiplies the error
by about DELTA over the least singular value of K.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.linalg import add_column_sums, add_columns
from namlcp.qp import KKT

DELTA = 1e-9
"""Added to the diagonal of P, and subtracted for rows, in units of K scaled."""

SCALINGS = 4
"""Passes of the scaling of K; each divides by the square roots of the row maxima."""

INVERSE_STEPS = 3
"""Steps of inverse iteration that estimate the least singular value of K."""

REFINEMENTS = 20
"""Most steps of refinement; one or two are enough for a regular K."""


class SparseSystem:
    """Factors of the KKT system of P, A and the active rows G.

    Attributes
    ----------
    regular : bool
        Whether K has one solution, as far as the shifted factors can tell.
    """

    def __init__(self, P: csc_array, A: csr_array, G: csr_array) -> None:
        self.kkt = kkt = KKT(P, A, G)
        columns = np.repeat(np.arange(kkt.size), np.diff(kkt.indptr))
        scale = np.ones(kkt.size)
        size = np.abs(kkt.base)
        for _ in range(SCALINGS):
            scaled = size * scale[kkt.indices] * scale[columns]
            largest = np.zeros(kkt.size)
            np.maximum.at(largest, columns, scaled)
            np.maximum.at(largest, kkt.indices, scaled)
            scale /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
        self.scale = scale
        self.values = kkt.base * scale[kkt.indices] * scale[columns]
        self.upper = self.values.copy()
        self.upper[kkt.diagonal] = 0.0
        kkt.data[:] = self.values
        kkt.data[kkt.diagonal[: kkt.n]] += DELTA
        kkt.data[kkt.diagonal[kkt.n :]] -= DELTA
        self.regular = kkt.factor() and self.least_singular_value() > DELTA

    def least_singular_value(self) -> float:
        """Estimate the least singular value of the shifted and scaled K."""
        v = np.random.default_rng(0).standard_normal(self.kkt.size)
        least = np.inf
        for _ in range(INVERSE_STEPS):
            v /= np.linalg.norm(v)
            v = self.kkt.plan().solve(v)
            least = min(least, 1.0 / float(np.linalg.norm(v)))
        return least

    def residual(self, rhs: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return rhs - K w, scaled."""
        Kw, indptr, indices = np.zeros(w.size), self.kkt.indptr, self.kkt.indices
        add_columns(indptr, indices, self.values, w, Kw)
        add_column_sums(indptr, indices, self.upper, w, Kw)
        return rhs - Kw

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (u, v)."""
        rhs = np.concatenate((r, s)) * self.scale
        w, rest, error = np.zeros(rhs.size), rhs, np.inf
        for _ in range(REFINEMENTS):
            trial = w + self.kkt.plan().solve(rest)
            rest = self.residual(rhs, trial)
            before, error = error, float(np.abs(rest).max(initial=0.0))
            if not error < before:
                break
            w = trial
            if not 0.0 < error < 0.5 * before:
                break
        w *= self.scale
        return w[: r.size], w[r.size :]
