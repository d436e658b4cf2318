"""A box LCP as a plain one, p >= 0, M p + r >= 0, with a dense and scaled matrix.

Methods that pivot from p = 0 take this form. A bounded unknown becomes its distance p_i
from a bound. One with two bounds at the distance h_i adds the row h_i - p_i >= 0 with a
multiplier y_i >= 0 that its own row loses, [A E; -E' 0]. Unknowns without bounds solve
their rows, z_f = -A_ff^-1 (A_fb z_b + q_f); M is what is left of the others, a Schur
complement. Fixed unknowns leave no trace but in r. The form is scaled to a unit
diagonal, by the same factors for rows and columns, and to max |r_i| = 1.
"""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP


def dense(A: Any) -> np.ndarray:
    return A.toarray() if sparse.issparse(A) else A


def is_plain(lcp: LCP) -> bool:
    return not lcp.lower.any() and bool(np.all(lcp.upper == np.inf))


class Plain:
    """The plain form of a box LCP.

    M (m, m) and r (m,). The first rows are those of the bounded unknowns. Raises
    LinAlgError where A_ff is singular.
    """

    def __init__(self, lcp: LCP) -> None:
        low, high = np.isfinite(lcp.lower), np.isfinite(lcp.upper)
        self.base = np.where(low, lcp.lower, np.where(high, lcp.upper, 0.0))
        self.bounded = np.flatnonzero((low | high) & (lcp.lower < lcp.upper))
        self.free = np.flatnonzero(~(low | high))
        self.sign = np.where(low, 1.0, -1.0)[self.bounded]
        A = dense(lcp.A)
        if is_plain(lcp):
            M, r = A, lcp.q
        else:
            M, r = self.without_free(A, A @ self.base + lcp.q)
            M = M * np.outer(self.sign, self.sign)
            two = np.flatnonzero((low & high)[self.bounded])
            E = np.eye(self.bounded.size)[:, two]
            M = np.block([[M, E], [-E.T, np.zeros((two.size, two.size))]])
            room = (lcp.upper - lcp.lower)[self.bounded[two]]
            r = np.concatenate((r * self.sign, room))
        diagonal = M.diagonal()
        self.root = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        self.M, self.r = M / np.outer(self.root, self.root), r / self.root
        self.unit = float(np.abs(self.r).max(initial=0.0)) or 1.0
        self.r /= self.unit

    def without_free(
        self, A: np.ndarray, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrix and vector of the bounded unknowns alone."""
        b, f = self.bounded, self.free
        sides = np.column_stack((A[np.ix_(f, b)], q[f]))
        solved = np.linalg.solve(A[np.ix_(f, f)], sides)
        self.slope, self.shift = -solved[:, :-1], -solved[:, -1]
        left = np.column_stack((A[np.ix_(b, b)], q[b])) - A[np.ix_(b, f)] @ solved
        return left[:, :-1], left[:, -1]

    def point(self, p: np.ndarray) -> np.ndarray:
        """Return z in the variables of the box LCP."""
        z = self.base + self.unit * self.direction(p)
        if self.free.size:
            z[self.free] += self.shift
        return z

    def direction(self, p: np.ndarray) -> np.ndarray:
        """Return how z moves along p, times a factor."""
        z = np.zeros(self.base.size)
        z[self.bounded] = self.sign * (p / self.root)[: self.bounded.size]
        if self.free.size:
            z[self.free] = self.slope @ z[self.bounded]
        return z

    def cover(self, d: np.ndarray) -> np.ndarray:
        """Return the covering vector of M for one of A: 1 in rows that A lacks."""
        full = np.ones(self.r.size)
        full[: self.bounded.size] = d[self.bounded]
        return full / self.root
