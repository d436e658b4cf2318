"""A box LCP in the distances p of its unknowns from a bound, scaled.

z = base + unit D p with a diagonal D, which is negative where z has only an upper
bound. Unknowns with l = u are left out. With F = M p + c the problem becomes

    p_i >= 0 where z_i has a bound, p_i <= r_i where it has two,
    F_i >= 0 at p_i = 0,  F_i <= 0 at p_i = r_i,  F_i = 0 otherwise.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from namlcp.lcp.scaling import congruent
from namlcp.residuals import natural_residual


class Distances:
    """The LCP of p.

    M (m, m) dense or CSC, c (m,): F = M p + c, and max |c_i| = 1 or 0.
    r (m,): largest p, 0 where it is infinite.
    signed, boxed (m,): whether p has the bound 0, and whether it has r, too.
    lower, upper (m,): the bounds of p, infinite ones included.
    kept (m,): the indices of its unknowns in z. base (n,), scale (m,), unit: see above.
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
        kept = self.kept = np.flatnonzero(lower < upper)
        c = (A @ self.base + q)[kept]
        self.signed, self.boxed = (low | high)[kept], (low & high)[kept]
        if kept.size < q.size:
            A = A[:, kept][kept]
        d = scaling(A)
        self.scale = np.where(low | ~high, 1.0, -1.0)[kept] * d
        self.M = congruent(A, self.scale)
        self.c = self.scale * c
        self.unit = float(np.abs(self.c).max(initial=0.0)) or 1.0
        self.c /= self.unit
        self.r = np.zeros(kept.size)
        self.r[self.boxed] = ((upper - lower)[kept] / (self.unit * d))[self.boxed]
        self.lower = np.where(self.signed, 0.0, -np.inf)
        self.upper = np.where(self.boxed, self.r, np.inf)

    def z(self, p: np.ndarray) -> np.ndarray:
        """Return the unknowns of the box LCP; p_i = r_i becomes the upper bound."""
        z = self.base.copy()
        z[self.kept] += self.unit * self.scale * p
        full = self.kept[p >= self.upper]
        z[full] = self.top[full]
        return z

    def p(self, z: np.ndarray) -> np.ndarray:
        """Return the distances that belong to z."""
        return (z - self.base)[self.kept] / (self.unit * self.scale)

    def F(self, p: np.ndarray) -> np.ndarray:
        """Return M p + c."""
        F = self.M @ p
        F += self.c
        return F

    def residual(self, p: np.ndarray, F: np.ndarray) -> float:
        """Return Res(p) of this LCP; p need not be within its bounds."""
        return natural_residual(p, F, self.lower, self.upper)
