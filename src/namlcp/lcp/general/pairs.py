"""The complementary pairs of a box LCP, for interior-point paths.

An unknown p_i >= 0 is paired with a multiplier; so is its room r_i - p_i where p_i has
an upper bound r_i. Pair k has the gap g_k > 0, which changes with sign_k p_{at_k}, and
the multiplier m_k > 0. In a solution

    F = M p + c = sum of sign_k m_k over the pairs of an unknown,  g_k m_k = 0.
"""

import numpy as np

from namlcp.lcp.distances import Distances


class Pairs:
    """Which unknowns the pairs belong to: first all p_i >= 0, then all rooms."""

    def __init__(self, model: Distances):
        self.size = model.c.size
        self.signed, self.boxed = map(np.flatnonzero, (model.signed, model.boxed))
        self.number = self.signed.size + self.boxed.size
        self.plain = self.signed.size == self.size and self.boxed.size == 0

    def of(self, x: np.ndarray) -> np.ndarray:
        """Return sign_k x_{at_k} for all pairs; it may share memory with x."""
        if self.plain:
            return x
        return np.concatenate((x[self.signed], -x[self.boxed]))

    def total(self, m: np.ndarray) -> np.ndarray:
        """Return the sums of sign_k m_k by unknown; it may share memory with m."""
        return self.gathered(m, -1.0)

    def gathered(self, m: np.ndarray, sign: float = 1.0) -> np.ndarray:
        """Return the sums of m_k, with this sign for rooms, by unknown."""
        if self.plain:
            return m
        x = np.zeros(self.size)
        x[self.signed] = m[: self.signed.size]
        x[self.boxed] += sign * m[self.signed.size :]
        return x

    def start(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return p and its gaps: 1, or the middle of the box where that is nearer.

        Unknowns without bounds start at 0.
        """
        p = np.zeros(self.size)
        p[self.signed] = 1.0
        p[self.boxed] = np.minimum(1.0, 0.5 * r[self.boxed])
        gaps = self.of(p).copy()
        gaps[self.signed.size :] += r[self.boxed]
        return p, gaps
