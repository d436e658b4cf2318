"""The KKT system of an active set for dense matrices.

For P_FF = L L' and V = C_F L^-T the Schur complement is S = V V', and

    [P_FF C_F'; C_F 0] (u, v) = (r, s):   S v = V L^-1 r - s,
                                          u = L^-T (L^-1 r - V'v).

Where P_FF or S is not definite, the whole matrix is factored as a symmetric indefinite
one. Each solve ends with a step of refinement: the derivative is exact to rounding.
"""

from typing import Any

import numpy as np
from scipy.linalg.lapack import dsycon, dsytrf, dsytrf_lwork, dsytrs

from namlcp.compiled import kernel, part
from namlcp.derivatives.systems.active import ActiveSet
from namlcp.linalg import (
    add_rmatvec,
    add_scaled,
    backward_solve,
    cholesky,
    cholesky_solve,
    dot,
    forward_solve,
    product,
    solve_rows,
)
from namlcp.qp import QP

LEAST_PIVOT = 1e-8
"""Cholesky factors are used if no pivot is below this multiple of its diagonal entry;
a single step of refinement then removes the error of the Schur complement."""

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
        self, qp: QP, active: ActiveSet, memory: np.ndarray | None = None
    ) -> None:
        """Factor, unless `memory` has the factors already."""
        self.matrices = qp.P, qp.G, qp.A
        free = (active.side == 0).nonzero()[0]
        self.places = active.equalities, active.rows, free
        held = active.equalities.size + active.rows.size
        if memory is not None:
            self.memory, self.regular = memory, True
        else:
            self.memory = np.empty(memory_size(free.size, held))
            self.regular = factor_dense(self.matrices, self.places, self.memory)
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
        right, unknowns = (r, d, e), (u, lam, nu, rest)
        if self.indefinite is None:
            solve_dense(self.matrices, self.places, self.memory, right, unknowns)
            return lam, nu, rest
        equalities, rows, free = self.places
        for _ in range(SOLVES):
            s = remainder(self.matrices, self.places, right, unknowns)
            du, dv = self.indefinite.solve(rest[free], s)
            u[free] += du
            nu[equalities] += dv[: equalities.size]
            lam[rows] += dv[equalities.size :]
        remainder(self.matrices, self.places, right, unknowns)
        return lam, nu, rest


SOLVES = 2
"""Solves with the factors for one right-hand side: the second one refines the first."""


def memory_size(free: int, held: int) -> int:
    """Return the numbers that the factors take for so many free variables and rows."""
    return free * free + min(held, free) * (free + min(held, free))


@part
def factors_in(memory, n, k):
    """Return L (n, n), V (k, n) and S (k, k), which lie one after another in memory."""
    L, V = memory[: n * n], memory[n * n : (n + k) * n]
    S = memory[(n + k) * n : (n + k) * n + k * k]
    return L.reshape((n, n)), V.reshape((k, n)), S.reshape((k, k))


@kernel
def factor_dense(matrices, places, memory):
    """Write L, V and the Cholesky factor of S to memory; tell whether they exist.

    matrices = (P, G, A), places = (equalities, rows, free); L and that factor are lower
    triangles, what is above them has no meaning.
    """
    P, G, A = matrices
    equalities, rows, free = places
    n, p, k = free.size, equalities.size, equalities.size + rows.size
    if k > n:
        return False
    L, V, S = factors_in(memory, n, k)
    for a in range(n):
        row = P[free[a]]
        for c in range(a + 1):
            L[a, c] = row[free[c]]
    for i in range(k):
        row = A[equalities[i]] if i < p else G[rows[i - p]]
        for c in range(n):
            V[i, c] = row[free[c]]
    if not is_factored(L):
        return False
    solve_rows(L, False, V)
    product(1.0, V, V, 0.0, S)
    return is_factored(S)


@part
def is_factored(M):
    """Overwrite the lower triangle of M by its Cholesky factor; False if M is singular.

    That is where a pivot is too small a part of its diagonal entry.
    """
    diagonal = np.empty(M.shape[0])
    for i in range(diagonal.size):
        diagonal[i] = M[i, i]
    if cholesky(M) != 0:
        return False
    for i in range(diagonal.size):
        if not M[i, i] * M[i, i] >= LEAST_PIVOT * diagonal[i]:
            return False
    return True


@kernel
def remainder(matrices, places, right, unknowns):
    """Set rest = r - P u - G'lam - A'nu; return (e - A u, d_I - G_I u).

    matrices = (P, G, A), places = (equalities, rows, free), right = (r, d, e),
    unknowns = (u, lam, nu, rest).
    """
    P, G, A = matrices
    equalities, rows, _ = places
    r, d, e = right
    u, lam, nu, rest = unknowns
    for j in range(r.size):
        rest[j] = 0.0
    add_rmatvec(P, u, rest)  # P = P'
    add_rmatvec(G, lam, rest)
    add_rmatvec(A, nu, rest)
    for j in range(r.size):
        rest[j] = r[j] - rest[j]
    p = equalities.size
    s = np.empty(p + rows.size)
    for i in range(p):
        s[i] = e[equalities[i]] - dot(A[equalities[i]], u)
    for i in range(rows.size):
        s[p + i] = d[rows[i]] - dot(G[rows[i]], u)
    return s


@kernel
def solve_dense(matrices, places, memory, right, unknowns):
    """Solve with the factors of `factor_dense`; the other arguments as in `remainder`.

    On entry u is 0 on F, lam and nu are 0.
    """
    equalities, rows, free = places
    u, lam, nu, rest = unknowns
    n, p = free.size, equalities.size
    L, V, S = factors_in(memory, n, p + rows.size)
    t = np.empty(n)
    for _ in range(SOLVES):
        s = remainder(matrices, places, right, unknowns)
        for a in range(n):
            t[a] = rest[free[a]]
        forward_solve(L, t)
        for i in range(s.size):
            s[i] = dot(V[i], t) - s[i]
        cholesky_solve(S, s)
        for i in range(s.size):
            add_scaled(-s[i], V[i], t)
        backward_solve(L, t)
        for a in range(n):
            u[free[a]] += t[a]
        for i in range(p):
            nu[equalities[i]] += s[i]
        for i in range(rows.size):
            lam[rows[i]] += s[p + i]
    remainder(matrices, places, right, unknowns)


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
