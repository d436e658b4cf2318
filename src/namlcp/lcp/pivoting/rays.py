"""The proof that a box LCP has no solution: a direction, moved to where it holds.

v is 0 on the side of every finite bound, hence v'w >= 0 for every solution. But v'w =
q'v + z'(A'v), and where that is negative for every z in the box there is none. This
needs no property of A; a symmetric semidefinite A has A v = 0.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg, lsmr

from namlcp.lcp.pivoting.work import LOWER, UPPER, D, Work

RAY_TOLERANCE = 1e-9
SLOPE_ROUNDING = 1e-13
LEAST_FALL = 1e-10
"""What is 0 in v, in A'v, in q'v, relative to the terms."""

CLEAR_SLOPE = 1e-5
"""Of A'v, relative to the terms: what may stay, where its sign is right."""

DROPS = 4
"""Times that entries are set to 0 because they would change their sign."""

DENSE = 600
"""Up to this order moves, and faces of sparse unsymmetric matrices, are dense."""

SHARPNESS, SHARPENINGS, SHARPENING_WORK = 1e-6, 2000, 200_000_000
"""Beyond it: of what A leaves of v so much may remain; steps and multiplications."""


def proof(
    A: Any, q: np.ndarray, v: np.ndarray, work: Work, symmetric: bool
) -> np.ndarray | None:
    """Return v, moved and scaled, if it proves that there is no solution, else None.

    The direction comes with some digits only: with v, which has grown by 1/rho or
    1/tau, rounding has grown, too. It is moved to A'v = 0, or so that only slopes
    remain which are clear and allowed.
    """
    lower, upper, d = work.vectors[LOWER], work.vectors[UPPER], work.vectors[D]
    largest = np.max(np.abs(v / d))
    if not 0.0 < largest < math.inf:
        return None
    v = np.where(np.abs(v / d) <= RAY_TOLERANCE * largest, 0.0, v / largest)
    into_bound = (v > 0.0) & (upper < math.inf) | (v < 0.0) & (lower > -math.inf)
    if into_bound.any():
        return None
    size, slope = abs(A), d * (A.T @ v)
    terms = d * (size.T @ np.abs(v))
    if (np.abs(slope) <= SLOPE_ROUNDING * terms).all():
        return checked(A, size, q, v, work)
    allowed = (slope < 0.0) & (lower > -math.inf) | (slope > 0.0) & (upper < math.inf)
    clear = allowed & (np.abs(slope) > CLEAR_SLOPE * terms)
    every = np.ones(v.size, dtype=bool)
    for rows in (every,) if symmetric or not clear.any() else (every, ~clear):
        moved = settled(A, v, d, rows, symmetric)
        found = None if moved is None else checked(A, size, q, moved, work)
        if found is not None:
            return found
    return checked(A, size, q, v, work)


def checked(
    A: Any, size: Any, q: np.ndarray, v: np.ndarray, work: Work
) -> np.ndarray | None:
    """Return v scaled to q'v + max z'(A'v) = -1 if it is a proof; size = |A|."""
    lower, upper, d = work.vectors[LOWER], work.vectors[UPPER], work.vectors[D]
    slope, terms = d * (A.T @ v), d * (size.T @ np.abs(v))
    side = np.where(slope > 0.0, upper, lower)
    # Only rounding is forgiven: a true slope, however small, has a solution far away.
    moving = np.isfinite(side) | (np.abs(slope) > SLOPE_ROUNDING * terms)
    fall = float(q @ v + side[moving] @ slope[moving])
    room = float(np.abs(q) @ np.abs(v))
    room += float(np.abs(side[moving]) @ terms[moving])
    if not -math.inf < fall < -LEAST_FALL * room:
        return None  # the terms cancel, as for every v if there is a solution
    return v / -fall


def settled(
    A: Any, v: np.ndarray, d: np.ndarray, rows: np.ndarray, symmetric: bool
) -> np.ndarray | None:
    """Return v moved to (A'v)_rows = 0 with no sign changed, None where it cannot be.

    The move is the least in units of d. It is small, and need not be exact to take most
    of A'v away. Entries that it would turn are 0 in truth, and it is sought without.
    """
    for _ in range(DROPS):
        face = np.flatnonzero(v)
        moved = v - move(A, v, d, rows, face, symmetric)
        turned = moved * v < 0.0
        if not turned.any():
            return moved
        v = np.where(turned, 0.0, v)
    return None


def move(
    A: Any, v: np.ndarray, d: np.ndarray, rows: np.ndarray, face: np.ndarray,
    symmetric: bool,
) -> np.ndarray:  # fmt: skip
    """Return e on the face with (A'e)_rows = (A'v)_rows."""
    e = np.zeros(v.size)
    slope = d * (A.T @ v)
    if v.size <= DENSE:
        part = A[face].toarray() if sparse.issparse(A) else A[face]
        part = (part * np.outer(d[face], d)).T[rows]
        e[face] = d[face] * np.linalg.lstsq(part, slope[rows], rcond=None)[0]
        return e
    steps = max(min(SHARPENINGS, SHARPENING_WORK // (A.size + v.size)), 1)

    def times(u: np.ndarray) -> np.ndarray:
        e[face] = d[face] * u
        return d * (A.T @ e)

    def times_transposed(u: np.ndarray) -> np.ndarray:
        return (d * (A @ (d * u)))[face]

    if symmetric:
        shape = face.size, face.size
        B = LinearOperator(shape, matvec=lambda u: times(u)[face], dtype=np.float64)
        part, _ = cg(B, slope[face], rtol=SHARPNESS, maxiter=steps)
    else:
        shape = v.size, face.size
        B = LinearOperator(
            shape, matvec=lambda u: rows * times(u),
            rmatvec=lambda u: times_transposed(rows * u), dtype=np.float64,
        )  # fmt: skip
        part = lsmr(B, rows * slope, atol=SHARPNESS, btol=SHARPNESS, maxiter=steps)[0]
    e[face] = d[face] * part
    return e
