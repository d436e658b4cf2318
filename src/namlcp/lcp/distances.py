"""A box LCP in the distances p of its unknowns from a bound, scaled.

z = base + unit D p with a diagonal D, which is negative where z has only an upper
bound. Unknowns with l = u are left out. With F = M p + c the problem becomes

    p_i >= 0 where z_i has a bound, p_i <= r_i where it has two,
    F_i >= 0 at p_i = 0,  F_i <= 0 at p_i = r_i,  F_i = 0 otherwise.

Interior paths take it by its complementary pairs: first every p_i >= 0 with a
multiplier, then every r_i - p_i. Pair k has the gap g_k > 0, which changes with sign_k
p_{at_k}, and the multiplier m_k > 0. In a solution

    F = M p + c = sum of sign_k m_k over the pairs of an unknown,  g_k m_k = 0.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse

from namlcp.residuals import natural_residual

# Rounds of scaling rows and columns by their absolute sums.
EQUILIBRATIONS = 3


class Distances:
    """The LCP of p, and sums over its pairs.

    M (m, m) dense or CSC, c (m,): F = M p + c, and max |c_i| = 1 or 0.
    r (m,): largest p, 0 where it is infinite.
    signed, boxed: the indices of p with the bound 0, and of those that have r, too.
    lower, upper (m,): the bounds of p, infinite ones included.
    unfixed (m,): the indices of its unknowns in z. base (n,), scale (m,), unit: see
    above.
    """

    def __init__(
        self,
        A: Any,
        q: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        scaling: Callable[[Any], np.ndarray],
    ):
        """Take a dense or sparse A; scaling(A without its fixed rows) is |diag(D)|."""
        low, high = np.isfinite(lower), np.isfinite(upper)
        self.base = np.where(low, lower, np.where(high, upper, 0.0))
        self.top = upper
        unfixed = self.unfixed = np.flatnonzero(lower < upper)
        c = (A @ self.base + q)[unfixed]
        self.signed = np.flatnonzero((low | high)[unfixed])
        self.boxed = np.flatnonzero((low & high)[unfixed])
        self.plain = self.signed.size == unfixed.size and self.boxed.size == 0
        if unfixed.size < q.size:
            A = A[:, unfixed][unfixed]
        d = scaling(A)
        self.scale = np.where(low | ~high, 1.0, -1.0)[unfixed] * d
        self.M = congruent(A, self.scale)
        self.c = self.scale * c
        self.unit = float(np.abs(self.c).max(initial=0.0)) or 1.0
        self.c /= self.unit
        self.r = np.zeros(unfixed.size)
        self.r[self.boxed] = ((upper - lower)[unfixed] / (self.unit * d))[self.boxed]
        self.lower, self.upper = np.full((2, unfixed.size), [[-np.inf], [np.inf]])
        self.lower[self.signed] = 0.0
        self.upper[self.boxed] = self.r[self.boxed]

    def z(self, p: np.ndarray) -> np.ndarray:
        """Return the unknowns of the box LCP; p_i = r_i becomes the upper bound."""
        z = self.base.copy()
        z[self.unfixed] += self.unit * self.scale * p
        full = self.unfixed[p >= self.upper]
        z[full] = self.top[full]
        return z

    def p(self, z: np.ndarray) -> np.ndarray:
        """Return the distances that belong to z."""
        return (z - self.base)[self.unfixed] / (self.unit * self.scale)

    def F(self, p: np.ndarray) -> np.ndarray:
        F = self.M @ p
        F += self.c
        return F

    def residual(self, p: np.ndarray, F: np.ndarray) -> float:
        """Return Res(p) of this LCP; p need not be within its bounds."""
        return natural_residual(p, F, self.lower, self.upper)

    def of(self, x: np.ndarray) -> np.ndarray:
        """Return sign_k x_{at_k} for all pairs; it may share memory with x."""
        if self.plain:
            return x
        return np.concatenate((x[self.signed], -x[self.boxed]))

    def total(self, m: np.ndarray, sign: float = -1.0) -> np.ndarray:
        """Return the sums of sign_k m_k by unknown; it may share memory with m.

        `sign` is that of the second kind of pairs.
        """
        if self.plain:
            return m
        x = np.zeros(self.c.size)
        x[self.signed] = m[: self.signed.size]
        x[self.boxed] += sign * m[self.signed.size :]
        return x

    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Return p and its gaps: 1, or the middle of the box where that is nearer.

        Unknowns without bounds start at 0.
        """
        p = np.zeros(self.c.size)
        p[self.signed] = 1.0
        p[self.boxed] = np.minimum(1.0, 0.5 * self.r[self.boxed])
        gaps = self.of(p).copy()
        gaps[self.signed.size :] += self.r[self.boxed]
        return p, gaps


def congruent(A: Any, d: np.ndarray) -> Any:
    """Return D A D, dense or CSC."""
    if sparse.issparse(A):
        D = sparse.diags_array(d)
        return sparse.csc_array(D @ A @ D)
    return A * np.outer(d, d)


def equilibrating_scale(A: Any) -> np.ndarray:
    """Return d > 0: the larger of row sum i and column sum i of |D A D| is near 1."""
    d, size = np.ones(A.shape[0]), abs(A)
    for _ in range(EQUILIBRATIONS):
        total = np.maximum(size @ d, size.T @ d) * d
        d /= np.sqrt(np.where(total > 0.0, total, 1.0))
    return d


def unit_diagonal_scale(A: Any) -> np.ndarray:
    """Return d > 0 such that D A D has a unit diagonal; d_i = 1 where a_ii <= 0."""
    diagonal = A.diagonal()
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
