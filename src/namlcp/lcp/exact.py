"""Box LCPs by pivoting, the path where needed: the compiled stages and who calls them.

`solve_box` works on a copy scaled to a unit diagonal. What it finds is judged on the
caller's data.
"""

import math
import time
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from namlcp.lcp import pivoting
from namlcp.lcp.interior import follow
from namlcp.lcp.largefaces import LargeFaces
from namlcp.lcp.matrix import Columns, columns_of
from namlcp.lcp.pivoting import (
    BLOCK_STEPS,
    MOST_RHO,
    SEARCH_STEPS,
    pivot,
    resume,
)
from namlcp.lcp.workspace import (
    ASKED,
    BEST_Z,
    CENTRE,
    CONVEX,
    EPS_ABS,
    EPS_REL,
    FACTORED,
    FEWEST,
    LOWER,
    OUTSIDE,
    PATHED,
    PATIENCE,
    RHO,
    RHS,
    SEARCHING,
    SIZE,
    STATE,
    UPPER,
    D,
    Q,
    S,
    Work,
    X,
    Z,
    workspace,
)
from namlcp.progress import Report
from namlcp.residuals import natural_residual, natural_residuals
from namlcp.status import Status

ACCURACY = 1e-9
"""eps_rel, unless the caller gives a tolerance."""

MAX_ITER = 5000
"""Factorisations at most, unless the caller says."""

BITSETS = 20_000
"""Up to this order the elimination order can come from bitsets (50 MB)."""

BLOCK_ORDER, BLOCK_ENTRIES = 2000, 20_000
"""From this order and so many entries on, symmetric faces are factored in blocks."""

DENSE_LU = 600
"""Up to this order faces of sparse unsymmetric matrices go to dense LU."""

UNSEEN, MOST_AT_ONCE = 0.02, 50
"""Time [s] and factorisations between two looks at the deadline; no result changes."""

LAST_STEPS = 200
"""So many factorisations, and one for each unknown, are left to a hopeless case."""

PATH_STEPS = 60
LARGE_STEPS = 150
PATH_CHUNK = 5
"""Steps of the path at most, and so many between two looks at the deadline."""

PATH_TARGET = 1e-8

RAY_TOLERANCE = 1e-9
SLOPE_ROUNDING = 1e-13
LEAST_FALL = 1e-10
NEARBY = 1e-3
"""Of a proof of unsolvability: what is 0 in v, in A'v, in q'v, relative to the terms;
and the share of v_i by which it may be moved to get there."""

SHARPNESS, SHARPENINGS, SHARPENING_WORK = 1e-6, 2000, 200_000_000
"""Of what A leaves of a proof so much may remain; steps and multiplications at most."""


class Outcome(NamedTuple):
    """Status, z, w = A z + q, iterations as `LCPResult` counts them, ray or None.

    `convex` says, where it was asked and A = A', that A is positive semidefinite.
    """

    status: Status
    z: np.ndarray
    w: np.ndarray
    iterations: int
    ray: np.ndarray | None
    convex: bool = False


def solve_box(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    z0: np.ndarray | None = None,
    *,
    symmetric: bool = True,
    eps_abs: float = 0.0,
    eps_rel: float = ACCURACY,
    max_iter: int = MAX_ITER,
    deadline: float = math.inf,
    report: Report = None,
    ask_convex: bool = False,
) -> Outcome:
    """Solve a box LCP by pivoting, without checks.

    Parameters
    ----------
    A : (n, n) array or sparse array
        float64; dense C-contiguous, or canonical CSR (CSC too if symmetric).
    symmetric : bool
        A = A'. Nothing tests it here.
    eps_abs, eps_rel : float
        SOLVED when Res < eps_abs on this problem, or Res <= eps_rel Res(clip(0)) on
        the problem scaled to a unit diagonal.
    max_iter : int
        Factorisations at most.
    deadline : float
        Value of time.perf_counter() at which to stop.
    report : callable
        Called as report(factorisations, least Res so far, unknowns at bounds).
    ask_convex : bool
        For symmetric A: tell whether it is positive semidefinite (one factorisation).
    """
    n = q.size
    columns = columns_of(A, symmetric)
    work = workspace(columns, n)
    vectors, scalar = work.vectors, work.scalar
    vectors[Q], vectors[LOWER], vectors[UPPER] = q, lower, upper
    if z0 is not None:
        vectors[Z] = z0
    scalar[EPS_ABS], scalar[EPS_REL] = eps_abs, eps_rel
    compressed = columns.dense.shape[0] == 0
    large = symmetric and compressed and in_blocks(n, columns.data.size)
    outside = large or (not symmetric and compressed and n > DENSE_LU)
    faces = LargeFaces(work) if large else None
    work.counter[ASKED] = ask_convex and not large
    with np.errstate(all="ignore"):  # a singular face overflows, and is noticed
        problem, limits = (A, q, lower, upper, columns), (max_iter, deadline, report)
        status, ray = drive(*problem, symmetric, work, outside, faces, *limits)
        if faces is not None and ask_convex and status is Status.SOLVED:
            work.counter[CONVEX] = faces.is_convex()
    z = vectors[BEST_Z] * vectors[D]
    z = np.minimum(np.maximum(z, lower), upper)
    w = A @ z + q
    if status is Status.SOLVED and scalar[SIZE] > 0.0:
        plain, scaled = natural_residuals(z, w, lower, upper, 1.0 / vectors[D])
        if not (plain < eps_abs or scaled <= eps_rel * scalar[SIZE] < math.inf):
            status = Status.STALLED
    if status is Status.STALLED and symmetric and n <= DENSE_LU:
        # Nearly singular towards the solution: rho hides it, so once more without.
        given: dict[str, Any] = {"eps_abs": eps_abs, "eps_rel": eps_rel}
        given |= {"max_iter": max_iter, "deadline": deadline, "report": report}
        again = solve_box(A, q, lower, upper, z, symmetric=False, **given)
        if again.status is Status.SOLVED:
            return again._replace(convex=bool(work.counter[CONVEX]))
    counter = work.counter
    return Outcome(status, z, w, int(counter[FACTORED]), ray, bool(counter[CONVEX]))


def in_blocks(n: int, entries: int) -> bool:
    """Tell whether the faces of a sparse symmetric matrix are worth blocks."""
    return n > BITSETS or (n > BLOCK_ORDER and entries > BLOCK_ENTRIES)


def drive(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    columns: Columns,
    symmetric: bool,
    work: Work,
    outside: bool,
    faces: LargeFaces | None,
    max_iter: int,
    deadline: float,
    report: Report,
) -> tuple[Status, np.ndarray | None]:
    """Call `pivot` until it is done, and do for it what it asks for."""
    counter, n = work.counter, q.size
    chunk = 1
    code = pivoting.MORE
    while code != pivoting.SOLVED:
        done = int(counter[FACTORED])
        # Murty's rule may go round in circles where a minor was seen to be negative.
        limit = min(max_iter, LAST_STEPS + n) if hopeless(work) else max_iter
        if code == pivoting.STUCK or done >= limit:
            status = Status.STALLED if code == pivoting.STUCK else Status.MAX_ITER
            return (Status.UNSOLVABLE if counter[OUTSIDE] else status), None
        if done > 0 and time.perf_counter() >= deadline:
            return Status.TIME_LIMIT, None
        if code == pivoting.RAY:
            ray = proof(A, q, work.vectors[RHS] * work.vectors[D], work, symmetric)
            if ray is not None:
                return Status.UNSOLVABLE, ray
        elif code == pivoting.STAGNATED:
            cure(A, work, symmetric, outside, faces, deadline)
        if code == pivoting.FACE:
            if faces is None:
                solve_outside(work)
            else:
                faces.solve()
            code = resume(symmetric, work)
        else:
            budget, began = min(chunk, limit - done), time.perf_counter()
            code = pivot(columns, symmetric, work, budget, outside)
            if report is None:
                each = (time.perf_counter() - began) / (counter[FACTORED] - done + 1)
                chunk = int(min(max(UNSEEN / max(each, 1e-6), 1.0), MOST_AT_ONCE))
        if report is not None and counter[FACTORED] > done:
            active = np.count_nonzero(work.marks[STATE])
            z = np.clip(work.vectors[BEST_Z] * work.vectors[D], lower, upper)
            residual = natural_residual(z, A @ z + q, lower, upper)
            report(int(counter[FACTORED]), residual, active)
    return Status.SOLVED, None


def hopeless(work: Work) -> bool:
    """Tell whether A is not a P-matrix and the path has failed."""
    return bool(work.counter[OUTSIDE] and work.counter[PATHED])


def cure(
    A: Any,
    work: Work,
    symmetric: bool,
    outside: bool,
    faces: LargeFaces | None,
    deadline: float,
) -> None:
    """Get block pivoting going again: once by the path, then by a larger rho."""
    counter, vectors, scalar = work.counter, work.vectors, work.scalar
    if not counter[PATHED]:
        if faces is not None:
            faces.follow(PATH_TARGET, LARGE_STEPS, deadline)
            return
        if outside:
            counter[PATHED] = 1
            return
        for _ in range(PATH_STEPS // PATH_CHUNK):
            taken = follow(symmetric, work, PATH_TARGET, PATH_CHUNK)
            if taken < PATH_CHUNK or time.perf_counter() >= deadline:
                return
    else:
        scalar[RHO] = min(1000.0 * scalar[RHO], MOST_RHO)
        w = vectors[Q] + vectors[D] * (A @ (vectors[D] * vectors[CENTRE]))
        counter[SEARCHING] = symmetric
        vectors[X] = vectors[CENTRE]
        vectors[S] = vectors[CENTRE] - w / (scalar[RHO] if symmetric else 1.0)
        s = vectors[CENTRE] - w
        at_upper = np.where(s >= vectors[UPPER], 1, 0)
        work.marks[STATE] = np.where(s <= vectors[LOWER], -1, at_upper)
        counter[FEWEST] = w.size + 1
        counter[PATIENCE] = SEARCH_STEPS if symmetric else BLOCK_STEPS


def solve_outside(work: Work) -> None:
    """Solve the face system of `work` by sparse LU, for unsymmetric matrices."""
    scaled, vectors = work.scaled, work.vectors
    work.counter[FACTORED] += 1
    n = vectors.shape[1]
    face = np.flatnonzero(work.marks[STATE] == 0)
    A = sparse.csc_array((scaled.data, scaled.indices, scaled.indptr), shape=(n, n))
    shift = work.scalar[RHO] * sparse.eye_array(face.size)
    try:
        factor = splu(sparse.csc_array(A[:, face].tocsr()[face] + shift))
        vectors[Z][face] = factor.solve(vectors[RHS][face])
    except RuntimeError:  # exactly singular
        vectors[Z][face] = np.nan


def proof(
    A: Any, q: np.ndarray, v: np.ndarray, work: Work, symmetric: bool
) -> np.ndarray | None:
    """Return v scaled to q'v = -1 if it proves that there is no solution, else None.

    v is 0 on the side of every finite bound, hence v'w >= 0 for every solution. But
    v'w = z'(A'v) + q'v, and z'(A'v) <= 0 for every z in the box: a contradiction. This
    needs no property of A; a symmetric semidefinite A has A v = 0.
    """
    lower, upper, d = work.vectors[LOWER], work.vectors[UPPER], work.vectors[D]
    v = np.where(np.abs(v / d) <= RAY_TOLERANCE * np.max(np.abs(v / d)), 0.0, v)
    into_bound = (v > 0.0) & (upper < math.inf) | (v < 0.0) & (lower > -math.inf)
    fall = float(q @ v)
    if not -math.inf < fall < 0.0 or np.any(into_bound):
        return None
    v = settled(A, v / -fall, d, symmetric)
    fall = float(q @ v)
    if not fall < -LEAST_FALL * (np.abs(q) @ np.abs(v)):
        return None  # the terms of q'v cancel, as for every v if there is a solution
    v = v / -fall
    slope = d * (A.T @ v)
    # Only rounding is forgiven: a true slope, however small, has a solution far away.
    slope[np.abs(slope) <= SLOPE_ROUNDING * d * (abs(A).T @ np.abs(v))] = 0.0
    moving = slope != 0.0
    side = np.where(slope > 0.0, upper, lower)[moving]
    return v if side @ slope[moving] < 0.5 else None


def settled(A: Any, v: np.ndarray, d: np.ndarray, symmetric: bool) -> np.ndarray:
    """Return v moved a little to A'v = 0, or v itself where that leads elsewhere.

    The proximal loop ends a few digits short of it: with v, which has grown by 1/rho,
    the rounding of a nearly singular factor has grown, too. On the face e is sought
    with A'e = A'v; it is small, and need not be exact to take most of that away.
    """
    slope, size = d * (A.T @ v), d * (abs(A).T @ np.abs(v))
    if not (np.abs(slope) > SLOPE_ROUNDING * size).any():
        return v
    face = np.flatnonzero(v)
    e = np.zeros(v.size)
    if v.size <= DENSE_LU:
        rows = A[face].toarray() if sparse.issparse(A) else A[face]
        part = np.linalg.lstsq((rows * np.outer(d[face], d)).T, slope, rcond=None)[0]
    elif symmetric:

        def times(u: np.ndarray) -> np.ndarray:
            e[face] = d[face] * u
            return d[face] * (A @ e)[face]

        B = LinearOperator((face.size, face.size), matvec=times, dtype=np.float64)
        steps = min(SHARPENINGS, SHARPENING_WORK // (A.size + v.size))
        part, _ = cg(B, slope[face], rtol=SHARPNESS, maxiter=max(steps, 1))
    else:
        return v
    e[face] = d[face] * part
    return v - e if (np.abs(e) <= NEARBY * np.abs(v)).all() else v
