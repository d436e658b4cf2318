"""The KKT system of an active set for sparse matrices.

K is scaled to rows of size 1 and factored as the quasi-definite K + DELTA diag(I, -I).
Refinement with residuals of K itself removes the shift: each step multiplies the error
by about DELTA over the least singular value of K.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.linalg import add_column_sums, add_columns
from namlcp.qp import KKT

DELTA = 1e-8
"""Added to the diagonal of P, and subtracted for rows, in units of K scaled. A smaller
shift makes smaller pivots, whose rounding errors would exceed it."""

SCALINGS = 4
"""Passes of the scaling of K; each divides by the square roots of the row maxima."""

PROJECTIONS = 4
"""Steps that project random vectors to the null space of K."""

FIRST_BLOCK, GROWTH = 1, 4
"""Vectors projected first; if the null space has more dimensions, this multiple."""

VANISHED = 1e-3
"""A projected unit vector with a norm below this over sqrt(order) counts as 0: a random
one has a larger part in any null space."""

NULL = 1e-6
"""Projected vectors with singular values below this, relative to the largest, are
multiples of the others."""

ZERO_IMAGE = 1e-12
"""Largest norm of K v, for K scaled and a unit vector v of its null space."""

REFINEMENTS = 20
"""Most steps of refinement; one or two are enough for a regular K."""


class SparseSystem:
    """Factors of the KKT system of P, A and the active rows G.

    Attributes
    ----------
    regular : bool
        Whether K has one solution, as far as the shifted factors can tell.
    null_space : (order, k) array
        A basis of the vectors (u, v) that K maps to 0.
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
        kkt.plan().refactor(kkt.data)  # no pivot of a quasi-definite matrix is 0
        self.null_space = scale[:, None] * self.find_null_space()
        self.regular = not self.null_space.size

    def find_null_space(self) -> np.ndarray:
        """Return an orthonormal basis of the null space of K scaled.

        v - K~^-1 K v, K~ the factored matrix, keeps what K maps to 0 and multiplies all
        else by about DELTA over its singular value.
        """
        size, width = self.kkt.size, FIRST_BLOCK
        while size:
            width = min(width, size)
            V = np.random.default_rng(0).standard_normal((width, size))
            V /= np.linalg.norm(V, axis=1)[:, None]
            for _ in range(PROJECTIONS):
                V = np.array([v - self.kkt.plan().solve(self.product(v)) for v in V])
                if np.linalg.norm(V, axis=1).max() < VANISHED / np.sqrt(size):
                    return np.empty((size, 0))
            values, basis = np.linalg.svd(V, full_matrices=False)[1:]
            basis = basis[values > NULL * values[0]]
            image = [np.linalg.norm(self.product(v)) for v in basis]
            basis = basis[np.array(image) <= ZERO_IMAGE]
            if basis.shape[0] < width or width == size:
                return basis.T
            width *= GROWTH
        return np.empty((0, 0))

    def product(self, w: np.ndarray) -> np.ndarray:
        """Return K w for the scaled K."""
        Kw, indptr, indices = np.zeros(w.size), self.kkt.indptr, self.kkt.indices
        add_columns(indptr, indices, self.values, w, Kw)
        add_column_sums(indptr, indices, self.upper, w, Kw)
        return Kw

    def solve(self, r: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (u, v)."""
        rhs = np.concatenate((r, s)) * self.scale
        w, rest, error = np.zeros(rhs.size), rhs, np.inf
        for _ in range(REFINEMENTS):
            trial = w + self.kkt.plan().solve(rest)
            rest = rhs - self.product(trial)
            before, error = error, float(np.abs(rest).max(initial=0.0))
            if not error < before:
                break
            w = trial
            if not 0.0 < error < 0.5 * before:
                break
        w *= self.scale
        return w[: r.size], w[r.size :]
