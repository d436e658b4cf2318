"""The KKT system of an active set for sparse matrices.

K is scaled to rows of size 1 and factored as the quasi-definite K + DELTA diag(I, -I).
Refinement with residuals of K itself removes the shift: each step multiplies the error
by about DELTA over the least singular value of K.
"""

import numpy as np

from namlcp.derivatives.systems.active import ActiveSet
from namlcp.linalg import (
    Compressed,
    add_column_sums,
    add_columns,
    add_transposed,
    by_rows,
    submatrix,
    times,
)
from namlcp.qp import KKT, QP, equilibrate

SHIFTS = 1e-8, 3.7e-8, 1.3e-7
"""DELTA: added to the diagonal of P, and subtracted for rows, in units of K scaled. A
smaller shift makes smaller pivots, whose rounding errors would exceed it; the larger
ones are tried where a pivot is 0 by rounding."""

PROJECTIONS = 4
"""Steps that project random vectors to the null space of K."""

FIRST_BLOCK, GROWTH, MOST = 1, 4, 64
"""Vectors projected first; if the null space has as many dimensions, GROWTH times as
many are, up to MOST. Of a larger null space a part is found."""

VANISHED = 1e-3
"""A projected unit vector with a norm below this over sqrt(order) counts as 0: a random
one has a larger part in any null space."""

NULL = 1e-6
"""Projected vectors with singular values below this, relative to the largest, are
multiples of the others."""

ZERO_IMAGE = 1e-12
"""Largest norm of K v, for K scaled and a unit vector v of its null space."""

REFINEMENTS, ROUNDING = 20, 1e-15
"""Most steps of refinement, and the residual that ends it, relative to the largest
number of right-hand side and solution."""


class SparseSystem:
    """The system of one active set.

    Attributes
    ----------
    regular : bool
        Whether K has one solution, as far as the shifted factors can tell; if not,
        `solve` gives one of least norm, in the units of K scaled.
    null_space : (order, k) array
        A basis of the vectors (u_F, nu, lam_I) that K maps to 0.
    """

    def __init__(self, qp: QP, active: ActiveSet) -> None:
        self.qp, self.active = qp, active
        self.free = free = np.flatnonzero(active.side == 0)
        P, A = submatrix(qp.P, free, free), submatrix(qp.A, active.equalities, free)
        G = submatrix(qp.G, active.rows, free)
        self.kkt = kkt = KKT(P, by_rows(A), by_rows(G))
        self.scale = np.ones(kkt.size)
        self.values, self.upper = kkt.base.copy(), np.empty(kkt.base.size)
        equilibrate(kkt.indptr, kkt.indices, self.values, self.scale)
        self.upper[:] = self.values
        self.upper[kkt.diagonal] = 0.0
        if not any(self.factor(shift) for shift in SHIFTS):
            raise ValueError("the KKT matrix of the active constraints has no factors")
        self.basis = self.find_null_space()
        self.null_space = (self.basis * self.scale).T
        self.regular = not self.null_space.size

    def factor(self, shift: float) -> bool:
        """Factor K scaled + shift diag(I, -I); False if a pivot is 0 by rounding."""
        kkt = self.kkt
        kkt.data[:] = self.values
        kkt.data[kkt.diagonal[: kkt.n]] += shift
        kkt.data[kkt.diagonal[kkt.n :]] -= shift
        return kkt.factor()

    def find_null_space(self) -> np.ndarray:
        """Return an orthonormal basis of the null space of K scaled, by rows.

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
                    return V[:0]
            values, basis = np.linalg.svd(V, full_matrices=False)[1:]
            basis = basis[values > NULL * values[0]]
            image = [np.linalg.norm(self.product(v)) for v in basis]
            basis = basis[np.array(image) <= ZERO_IMAGE]
            if basis.shape[0] < width or width >= min(size, MOST):
                return basis
            width *= GROWTH
        return np.empty((0, 0))

    def product(self, w: np.ndarray) -> np.ndarray:
        """Return K w for the scaled K."""
        Kw, kkt = np.zeros(w.size), self.kkt
        add_columns(Compressed(kkt.indptr, kkt.indices, self.values), w, Kw)
        add_column_sums(Compressed(kkt.indptr, kkt.indices, self.upper), w, Kw)
        return Kw

    def solve(
        self, r: np.ndarray, d: np.ndarray, e: np.ndarray, u: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Write u_F, for u_B as given and u_F = 0; return (lam, nu, rest).

        G_I u = d_I and A u = e hold, and rest = r - P u - G'lam - A'nu is 0 on F.
        """
        P, _, G, _, A = self.qp[:5]
        equalities, rows, _ = self.active
        free, n, p = self.free, self.free.size, equalities.size
        rest = r
        if n < r.size and u.any():
            rest, d, e = r - times(P, u), d - times(G, u), e - times(A, u)
        v = self.solve_kkt(np.concatenate((rest[free], e[equalities], d[rows])))
        lam, nu = np.zeros(d.size), np.zeros(e.size)
        u[free], nu[equalities], lam[rows] = v[:n], v[n : n + p], v[n + p :]
        terms = times(P, u)
        add_transposed(G, lam, terms)
        add_transposed(A, nu, terms)
        return lam, nu, r - terms

    def solve_kkt(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for one right-hand side, refined."""
        rhs = self.across(rhs * self.scale)
        w, rest, error = np.zeros(rhs.size), rhs, np.inf
        for _ in range(REFINEMENTS):
            trial = w + self.kkt.plan().solve(rest)
            rest = rhs - self.product(trial)
            before, error = error, float(np.abs(rest).max(initial=0.0))
            if not error < before:
                break
            w = trial
            size = max(np.abs(v).max(initial=0.0) for v in (rhs, w))
            if not ROUNDING * size < error < 0.5 * before:
                break
        return self.across(w) * self.scale

    def across(self, w: np.ndarray) -> np.ndarray:
        """Return the part of w that is orthogonal to the null space of K scaled."""
        return w if self.regular else w - self.basis.T @ (self.basis @ w)
