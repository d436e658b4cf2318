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

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.residuals import natural_residual


class Distances:
    """The LCP of p, and sums over its pairs.

    M (m, m) dense or CSC, c (m,): max |c_i| = 1 or 0. lower, upper (m,): the bounds of
    p, 0 or -inf, and r or inf. signed, boxed: the indices of p with the bound 0, and of
    those that have r, too. unfixed (m,): the indices of its unknowns in z.
    """

    def __init__(
        self,
        A: Any,
        q: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        root: np.ndarray,
    ):
        """`root` (n,) is 1 / |D|."""
        low, high = np.isfinite(lower), np.isfinite(upper)
        self.base = np.where(low, lower, np.where(high, upper, 0.0))
        self.top = upper
        unfixed = self.unfixed = np.flatnonzero(lower < upper)
        c = (A @ self.base + q)[unfixed]
        if unfixed.size < q.size:
            A = A[:, unfixed][unfixed]
        root = (np.where(low | ~high, 1.0, -1.0) * root)[unfixed]
        self.scale = 1.0 / root
        if sparse.issparse(A):
            D = sparse.diags_array(self.scale)
            self.M = sparse.csc_array(D @ A @ D)
        else:
            self.M = A / np.outer(root, root)
        self.c = c / root
        self.unit = float(np.abs(self.c).max(initial=0.0)) or 1.0
        self.c /= self.unit
        self.lower = np.where((low | high)[unfixed], 0.0, -np.inf)
        self.upper = np.full(unfixed.size, np.inf)
        self.signed = np.flatnonzero((low | high)[unfixed])
        self.boxed = two = np.flatnonzero((low & high)[unfixed])
        self.upper[two] = ((upper - lower)[unfixed] * np.abs(root) / self.unit)[two]

    def z(self, p: np.ndarray) -> np.ndarray:
        """Return the unknowns of the box LCP; p_i = r_i becomes the upper bound."""
        z = self.base.copy()
        z[self.unfixed] += self.unit * self.scale * p
        full = self.unfixed[p >= self.upper]
        z[full] = self.top[full]
        return z

    def p(self, z: np.ndarray) -> np.ndarray:
        return (z - self.base)[self.unfixed] / (self.unit * self.scale)

    def F(self, p: np.ndarray) -> np.ndarray:
        F = self.M @ p
        F += self.c
        return F

    def residual(self, p: np.ndarray, F: np.ndarray) -> float:
        return natural_residual(p, F, self.lower, self.upper)

    def of(self, x: np.ndarray) -> np.ndarray:
        """Return sign_k x_{at_k} for all pairs."""
        return np.concatenate((x[self.signed], -x[self.boxed]))

    def total(self, m: np.ndarray, sign: float = -1.0) -> np.ndarray:
        """Return the sums of sign_k m_k by unknown; `sign`: of the second kind."""
        x = np.zeros(self.c.size)
        x[self.signed] = m[: self.signed.size]
        x[self.boxed] += sign * m[self.signed.size :]
        return x

    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Return p and its gaps: 1, or the middle of the box where that is nearer."""
        p = np.zeros(self.c.size)
        p[self.signed] = np.minimum(1.0, 0.5 * self.upper[self.signed])
        gaps = self.of(p)
        gaps[self.signed.size :] += self.upper[self.boxed]
        return p, gaps


class Plain:
    """The LCP of p as a plain one, x >= 0, M x + r >= 0, dense, for pivots from x = 0.

    A p_i <= r_i adds the row r_i - p_i >= 0 with a multiplier y_i >= 0 that its own
    row loses, [A E; -E' 0]. Unknowns without bounds solve their rows, p_f = -M_ff^-1
    (M_fb p_b + c_f), which leaves a Schur complement; LinAlgError where M_ff is
    singular. The first rows are those of the bounded unknowns, and max |r_i| is 1.
    """

    def __init__(self, model: Distances) -> None:
        M, r, self.model = dense(model.M), model.c, model
        b, f = model.signed, np.flatnonzero(model.lower < 0.0)
        sides = np.column_stack((M[:, b], r))
        self.back = -np.linalg.solve(M[np.ix_(f, f)], sides[f])
        left = sides[b] + M[np.ix_(b, f)] @ self.back
        E = np.eye(r.size)[np.ix_(b, model.boxed)]
        self.M = np.block([[left[:, :-1], E], [-E.T, np.zeros((E.shape[1],) * 2)]])
        r = np.append(left[:, -1], model.upper[model.boxed])
        self.unit = float(np.abs(r).max(initial=0.0)) or 1.0
        self.r = r / self.unit

    def z(self, x: np.ndarray) -> np.ndarray:
        return self.model.z(self.p(self.unit * x, 1.0))

    def direction(self, x: np.ndarray) -> np.ndarray:
        """Return how z moves along x, times a factor."""
        v = np.zeros(self.model.base.size)
        v[self.model.unfixed] = self.model.scale * self.p(x, 0.0)
        return v

    def p(self, x: np.ndarray, one: float) -> np.ndarray:
        bounded = x[: self.model.signed.size]
        p = np.empty(self.model.c.size)
        p[self.model.signed] = bounded
        p[self.model.lower < 0.0] = self.back @ np.append(bounded, one)
        return p

    def cover(self, d: np.ndarray) -> np.ndarray:
        """Return the covering vector of M for one of A: 1 in rows that A lacks."""
        own = (np.abs(self.model.scale) * d[self.model.unfixed])[self.model.signed]
        return np.append(own, np.ones(self.r.size - own.size))


def dense(A: Any) -> np.ndarray:
    return A.toarray() if sparse.issparse(A) else A
