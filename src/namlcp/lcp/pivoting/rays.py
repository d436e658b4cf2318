"""Certificates that a box LCP has no solution: a direction v, corrected for rounding.

If v_i <= 0 where the upper bound is finite and v_i >= 0 where the lower one is, then
v'w >= 0 for every solution. If also v'w = q'v + z'(A'v) < 0 for every z in the box,
there is no solution. This holds for every A; if A is symmetric and semidefinite, A v
= 0.
"""

import math

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg, lsmr

from namlcp.lcp.data import LCP

RAY_TOLERANCE = 1e-9
"""Scaled entry of v, relative to the largest one, that counts as 0."""

SLOPE_ROUNDING = 1e-13
"""Entry of A'v, relative to |A|'|v|, that counts as 0."""

LEAST_FALL = 1e-10
"""Modulus of max (q'v + z'A'v), relative to its terms, that counts as 0."""

CLEAR_SLOPE = 1e-5
"""Entries of A'v beyond this, relative to |A|'|v|, may stay if A is not symmetric and
a finite bound on z_i limits the product with z_i."""

DROPS = 4
"""Corrections at most; after each, entries that changed their sign are set to 0."""

DENSE_CORRECTION = 600
"""Largest order for which the correction is a dense least-squares problem."""

CORRECTION, CORRECTION_STEPS, MULTIPLICATIONS = 1e-6, 2000, 200_000_000
"""For larger orders, of the iterative correction: relative accuracy, steps at most, and
multiplications at most."""


def proof(lcp: LCP, d: np.ndarray, v: np.ndarray) -> np.ndarray | None:
    """Return v, corrected and scaled, if it proves that there is no solution.

    d_i = a_ii^(-1/2) scales the problem. The direction has few correct digits, because
    1/rho or 1/tau has magnified its rounding errors. It is corrected to A'v = 0, and if
    that fails, to (A'v)_i = 0 except where `CLEAR_SLOPE` allows more.
    """
    largest = np.max(np.abs(v / d))
    if not 0.0 < largest < math.inf:
        return None
    v = np.where(np.abs(v / d) <= RAY_TOLERANCE * largest, 0.0, v / largest)
    has_lower, has_upper = lcp.lower > -math.inf, lcp.upper < math.inf
    if ((v > 0.0) & has_upper | (v < 0.0) & has_lower).any():
        return None
    candidate = Candidates(lcp, d)
    slope, terms = candidate.slope(v), candidate.terms(v)
    if (np.abs(slope) <= SLOPE_ROUNDING * terms).all():
        return candidate.proof(v)
    allowed = (slope < 0.0) & has_lower | (slope > 0.0) & has_upper
    clear = allowed & (np.abs(slope) > CLEAR_SLOPE * terms)
    every = np.ones(v.size, dtype=bool)
    symmetric = lcp.matrix.symmetric
    for rows in (every,) if symmetric or not clear.any() else (every, ~clear):
        corrected = candidate.corrected(v, rows)
        found = None if corrected is None else candidate.proof(corrected)
        if found is not None:
            return found
    return candidate.proof(v)


class Candidates:
    """Directions v of one LCP, with A'v and its terms scaled by d."""

    def __init__(self, lcp: LCP, d: np.ndarray) -> None:
        self.lcp, self.A, self.d = lcp, lcp.A, d
        self.size = abs(lcp.A)

    def slope(self, v: np.ndarray) -> np.ndarray:
        return self.d * (self.A.T @ v)

    def terms(self, v: np.ndarray) -> np.ndarray:
        return self.d * (self.size.T @ np.abs(v))

    def proof(self, v: np.ndarray) -> np.ndarray | None:
        """Return v scaled to q'v + max z'(A'v) = -1 if it is a proof, else None."""
        slope, terms = self.slope(v), self.terms(v)
        bound = np.where(slope > 0.0, self.lcp.upper, self.lcp.lower) / self.d
        # Only rounding is ignored: a small slope may mean a solution far away.
        moving = np.isfinite(bound) | (np.abs(slope) > SLOPE_ROUNDING * terms)
        fall = float(self.lcp.q @ v + bound[moving] @ slope[moving])
        total = float(np.abs(self.lcp.q) @ np.abs(v))
        total += float(np.abs(bound[moving]) @ terms[moving])
        if not -math.inf < fall < -LEAST_FALL * total:
            return None
        return v / -fall

    def corrected(self, v: np.ndarray, rows: np.ndarray) -> np.ndarray | None:
        """Return v moved to (A'v)_rows = 0 with no sign changed, None if that fails.

        The correction is the least in the scaling d. Entries whose sign it would change
        are set to 0, and a new correction is computed without them.
        """
        for _ in range(DROPS):
            support = np.flatnonzero(v)
            e = np.zeros(v.size)
            e[support] = self.d[support] * self.correction(v, rows, support)
            moved = v - e
            turned = moved * v < 0.0
            if not turned.any():
                return moved
            v = np.where(turned, 0.0, v)
        return None

    def correction(
        self, v: np.ndarray, rows: np.ndarray, support: np.ndarray
    ) -> np.ndarray:
        """Return the least-squares u with (A'D u)_rows = (A'v)_rows on the support."""
        A, d, slope = self.A, self.d, self.slope(v)
        if v.size <= DENSE_CORRECTION:
            part = A[support].toarray() if sparse.issparse(A) else A[support]
            part = (part * np.outer(d[support], d)).T[rows]
            return np.linalg.lstsq(part, slope[rows], rcond=None)[0]
        steps = max(min(CORRECTION_STEPS, MULTIPLICATIONS // (A.size + v.size)), 1)
        full = np.zeros(v.size)

        def times(u: np.ndarray) -> np.ndarray:
            full[support] = d[support] * u
            return self.slope(full)

        if self.lcp.matrix.symmetric:
            square = support.size, support.size
            B = LinearOperator(square, lambda u: times(u)[support], dtype=float)
            return cg(B, slope[support], rtol=CORRECTION, maxiter=steps)[0]
        B = LinearOperator(
            (v.size, support.size),
            lambda u: rows * times(u),
            lambda u: (d * (A @ (d * (rows * u))))[support],
            dtype=float,
        )
        b = rows * slope
        return lsmr(B, b, atol=CORRECTION, btol=CORRECTION, maxiter=steps)[0]
