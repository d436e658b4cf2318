"""The proof that a box LCP has no solution: a direction v, corrected until it holds.

v_i <= 0 where the upper bound is finite and v_i >= 0 where the lower one is, hence
v'w >= 0 for every solution. But v'w = q'v + z'(A'v), and where that is negative for
every z in the box there is no solution. This needs no property of A; for a symmetric
semidefinite A, A v = 0.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg, lsmr

from namlcp.lcp.data import LCP

RAY_TOLERANCE = 1e-9
"""Scaled entry of v, relative to the largest, that counts as 0."""

SLOPE_ROUNDING = 1e-13
"""Entry of A'v, relative to |A|'|v|, that counts as 0."""

LEAST_FALL = 1e-10
"""Largest max (q'v + z'A'v) < 0, relative to its terms, that counts as 0."""

CLEAR_SLOPE = 1e-5
"""Entry of A'v, relative to |A|'|v|, that may stay where it has a bound to act on."""

DROPS = 4
"""Corrections at most; after each, entries that changed their sign are set to 0."""

DENSE_CORRECTION = 600
"""Largest order for which the correction is a dense least-squares problem."""

CORRECTION, CORRECTION_STEPS, MULTIPLICATIONS = 1e-6, 2000, 200_000_000
"""For larger orders: relative accuracy of the correction, steps and multiplications of
the iteration at most."""


def proof(lcp: LCP, d: np.ndarray, v: np.ndarray) -> np.ndarray | None:
    """Return v, corrected and scaled, if it proves that there is no solution.

    d_i = a_ii^(-1/2) scales the problem. The direction has few correct digits: with v,
    which has grown by 1/rho or 1/tau, its rounding has grown. It is corrected to
    A'v = 0, or so that only those slopes remain which are clear and have a bound.
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
        """Return D A'v."""
        return self.d * (self.A.T @ v)

    def terms(self, v: np.ndarray) -> np.ndarray:
        """Return D |A|'|v|."""
        return self.d * (self.size.T @ np.abs(v))

    def proof(self, v: np.ndarray) -> np.ndarray | None:
        """Return v scaled to q'v + max z'(A'v) = -1 if it is a proof, else None."""
        slope, terms = self.slope(v), self.terms(v)
        bound = np.where(slope > 0.0, self.lcp.upper, self.lcp.lower) / self.d
        # Only rounding is forgiven: with a small slope there is a solution far away.
        moving = np.isfinite(bound) | (np.abs(slope) > SLOPE_ROUNDING * terms)
        fall = float(self.lcp.q @ v + bound[moving] @ slope[moving])
        total = float(np.abs(self.lcp.q) @ np.abs(v))
        total += float(np.abs(bound[moving]) @ terms[moving])
        if not -math.inf < fall < -LEAST_FALL * total:
            return None  # the terms cancel, as for every v if there is a solution
        return v / -fall

    def corrected(self, v: np.ndarray, rows: np.ndarray) -> np.ndarray | None:
        """Return v moved to (A'v)_rows = 0 with no sign changed, None if that fails.

        The correction is the least in units of d. It is small, and takes most of A'v
        away though it is not exact. Entries whose sign it would change are set to 0,
        and a new correction is computed without them.
        """
        for _ in range(DROPS):
            face = np.flatnonzero(v)
            e = np.zeros(v.size)
            e[face] = self.d[face] * self.correction(v, rows, face)
            moved = v - e
            turned = moved * v < 0.0
            if not turned.any():
                return moved
            v = np.where(turned, 0.0, v)
        return None

    def correction(
        self, v: np.ndarray, rows: np.ndarray, face: np.ndarray
    ) -> np.ndarray:
        """Return the least u with (A'D u)_rows = (A'v)_rows, u = 0 outside the face."""
        A, d, slope = self.A, self.d, self.slope(v)
        if v.size <= DENSE_CORRECTION:
            part = A[face].toarray() if sparse.issparse(A) else A[face]
            part = (part * np.outer(d[face], d)).T[rows]
            return np.linalg.lstsq(part, slope[rows], rcond=None)[0]
        steps = max(min(CORRECTION_STEPS, MULTIPLICATIONS // (A.size + v.size)), 1)
        full = np.zeros(v.size)

        def times(u: np.ndarray) -> np.ndarray:
            full[face] = d[face] * u
            return self.slope(full)

        def operator(**products: Any) -> LinearOperator:
            return LinearOperator(dtype=np.float64, **products)

        if self.lcp.matrix.symmetric:
            square = face.size, face.size
            B = operator(shape=square, matvec=lambda u: times(u)[face])
            return cg(B, slope[face], rtol=CORRECTION, maxiter=steps)[0]
        B = operator(
            shape=(v.size, face.size),
            matvec=lambda u: rows * times(u),
            rmatvec=lambda u: (d * (A @ (d * (rows * u))))[face],
        )
        b = rows * slope
        return lsmr(B, b, atol=CORRECTION, btol=CORRECTION, maxiter=steps)[0]
