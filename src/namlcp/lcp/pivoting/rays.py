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


def proof(lcp: LCP, v: np.ndarray) -> np.ndarray | None:
    """Return v, corrected and scaled, if it proves that there is no solution.

    It has few correct digits, as 1/rho has magnified its rounding errors, or a path has
    ended. It is corrected to A'v = 0, and if that fails, to (A'v)_i = 0 except where
    `CLEAR_SLOPE` allows more.
    """
    d = 1.0 / lcp.matrix.root
    largest = np.max(np.abs(v / d))
    if not 0.0 < largest < math.inf:
        return None
    v = np.where(np.abs(v / d) <= RAY_TOLERANCE * largest, 0.0, v / largest)
    has_lower, has_upper = lcp.lower > -math.inf, lcp.upper < math.inf
    if ((v > 0.0) & has_upper | (v < 0.0) & has_lower).any():
        return None
    slope, terms = slopes(lcp, d, v)
    tries = []
    if (np.abs(slope) > SLOPE_ROUNDING * terms).any():
        tries.append(np.ones(v.size, dtype=bool))
        allowed = (slope < 0.0) & has_lower | (slope > 0.0) & has_upper
        clear = allowed & (np.abs(slope) > CLEAR_SLOPE * terms)
        if clear.any() and not lcp.matrix.symmetric:
            tries.append(~clear)
    for rows in tries:
        corrected = moved(lcp, d, v, rows)
        found = None if corrected is None else proven(lcp, d, corrected)
        if found is not None:
            return found
    return proven(lcp, d, v)


def slopes(lcp: LCP, d: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return d * (lcp.A.T @ v), d * (abs(lcp.A).T @ np.abs(v))


def proven(lcp: LCP, d: np.ndarray, v: np.ndarray) -> np.ndarray | None:
    """Return v scaled to q'v + max z'(A'v) = -1 if it is a proof, else None."""
    slope, terms = slopes(lcp, d, v)
    bound = np.where(slope > 0.0, lcp.upper, lcp.lower) / d
    # Only rounding is ignored: a small slope may mean a solution far away.
    moving = np.isfinite(bound) | (np.abs(slope) > SLOPE_ROUNDING * terms)
    fall = float(lcp.q @ v + bound[moving] @ slope[moving])
    total = float(np.abs(lcp.q) @ np.abs(v) + np.abs(bound[moving]) @ terms[moving])
    return v / -fall if -math.inf < fall < -LEAST_FALL * total else None


def moved(
    lcp: LCP, d: np.ndarray, v: np.ndarray, rows: np.ndarray
) -> np.ndarray | None:
    """Return v moved to (A'v)_rows = 0 with no sign changed, None if that fails.

    The change D u is the least in the scaling d, (A'D u)_rows = (A'v)_rows. Entries
    whose sign it would change are set to 0, and a new one is computed without them.
    """
    A = lcp.A
    steps = max(min(CORRECTION_STEPS, MULTIPLICATIONS // (A.size + v.size)), 1)
    for _ in range(DROPS):
        support = np.flatnonzero(v)
        slope = d * (A.T @ v)
        B = sparse.diags_array(d[support]) @ A[support] @ sparse.diags_array(d)
        B = B.T[rows]
        if v.size <= DENSE_CORRECTION:
            B = B.toarray() if sparse.issparse(B) else B
            u = np.linalg.lstsq(B, slope[rows], rcond=None)[0]
        elif lcp.matrix.symmetric:
            B = B[support].tocsr() if sparse.issparse(B) else B[support]
            u = cg(B, slope[support], rtol=CORRECTION, maxiter=steps)[0]
        else:
            end = {"atol": CORRECTION, "btol": CORRECTION, "maxiter": steps}
            u = lsmr(B, slope[rows], **end)[0]
        found = v.copy()
        found[support] -= d[support] * u
        turned = found * v < 0.0
        if not turned.any():
            return found
        v = np.where(turned, 0.0, v)
    return None
