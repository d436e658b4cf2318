"""The stopping criterion of the methods "auto" and "multigrid".

A point z solves a box LCP if Res(z) < eps_abs for the problem as given, or if Res(z) <=
eps_rel Res(clip(0)) for the problem scaled to a unit diagonal.
"""

from functools import cached_property

import numpy as np

from namlcp.lcp.data import LCP
from namlcp.limits import Limits
from namlcp.linalg.columns import LEAST_DIVISOR
from namlcp.measure import are_met, natural_residuals

W_ROUNDING = 1e-15
"""Entry of w = A z + q, relative to |A||z| + |q|, that counts as 0."""


class Criterion:
    """The stopping criterion of one LCP, with the tolerances of `limits`."""

    def __init__(self, lcp: LCP, limits: Limits):
        self.lcp, self.limits = lcp, limits
        self.root = lcp.matrix.root

    def residuals(self, z: np.ndarray, w: np.ndarray) -> tuple[float, float]:
        """Return Res(z) of the problem as given and scaled to a unit diagonal."""
        _, _, lower, upper = self.lcp
        return natural_residuals(z, w, lower, upper, self.root)

    @cached_property
    def size(self) -> float:
        """Res(clip(0)) of the problem scaled to a unit diagonal."""
        z = self.lcp.start()
        return self.residuals(z, self.lcp.w(z) if z.any() else self.lcp.q)[1]

    @cached_property
    def goal(self) -> float:
        """Estimate of the largest Res of the scaled problem that `accepts` accepts."""
        largest = float(self.root.max(initial=LEAST_DIVISOR))
        return max(self.limits.eps_rel * self.size, self.limits.eps_abs / largest)

    def accepts(self, z: np.ndarray, w: np.ndarray) -> bool:
        """Tell whether z with w = A z + q solves the problem."""
        return self.met(*self.residuals(z, w))

    def met(self, plain: float, scaled: float) -> bool:
        """Tell whether a point with these `residuals` solves the problem."""
        return are_met(*self.limits.tolerances, self.size, plain, scaled)


def is_solved_by_zero(lcp: LCP) -> bool:
    """Tell whether z = clip(0) is a solution but for the rounding of w."""
    z = lcp.start()
    w = lcp.w(z)
    terms = np.abs(lcp.q) + abs(lcp.A) @ np.abs(z)
    w[np.abs(w) <= W_ROUNDING * terms] = 0.0
    return not np.maximum(np.minimum(w, z - lcp.lower), z - lcp.upper).any()
