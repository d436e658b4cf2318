"""Certificates that a box LCP has no solution: a direction v, corrected for rounding.

If v_i <= 0 where the upper bound is finite and v_i >= 0 where the lower one is, then
v'w >= 0 for every solution. If also v'w = q'v + z'(A'v) < 0 for every z in the box,
there is no solution. This holds for every A; if A is symmetric and semidefinite, A v
= 0.
"""

import math

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg, lsmr

from namlcp.lcp.data import LCP

# Scaled entry of v, relative to the largest one, that counts as 0.
RAY_TOLERANCE = 1e-9
# Entry of A'v, relative to |A|'|v|, that counts as 0; modulus of max (q'v + z'A'v),
# relative to its terms, that does.
SLOPE_ROUNDING, LEAST_FALL = 1e-13, 1e-10
# Entries of A'v beyond this, relative to |A|'|v|, may stay if A is not symmetric and a
# finite bound on z_i limits the product with z_i.
CLEAR_SLOPE = 1e-5
# Corrections at most; after each, entries that changed their sign are set to 0. Largest
# order for which the correction is a dense least-squares problem; beyond, relative
# accuracy of the iterative one, its steps and its multiplications at most.
DROPS, DENSE_CORRECTION = 4, 600
CORRECTION, CORRECTION_STEPS, MULTIPLICATIONS = 1e-6, 2000, 200_000_000


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
        A, d, slope = self.A, sparse.diags_array(self.d), self.slope(v)
        B = (sparse.diags_array(self.d[support]) @ A[support] @ d).T[rows]
        if v.size <= DENSE_CORRECTION:
            B = B.toarray() if sparse.issparse(B) else B
            return np.linalg.lstsq(B, slope[rows], rcond=None)[0]
        steps = max(min(CORRECTION_STEPS, MULTIPLICATIONS // (A.size + v.size)), 1)
        if self.lcp.matrix.symmetric:
            B = B[support].tocsr() if sparse.issparse(B) else B[support]
            return cg(B, slope[support], rtol=CORRECTION, maxiter=steps)[0]
        b = slope[rows]
        return lsmr(B, b, atol=CORRECTION, btol=CORRECTION, maxiter=steps)[0]
