"""Box LCPs by pivoting, the path where needed: the compiled stages and who calls them.

`solve_box` works on a copy scaled to a unit diagonal. What it finds is judged on the
caller's data.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.pivoting import blocks as pivoting
from namlcp.lcp.pivoting.blocks import (
    BLOCK_STEPS,
    LEAST_RHO,
    MOST_RHO,
    SEARCH_STEPS,
    pivot,
    resume,
)
from namlcp.lcp.pivoting.homogeneous import (
    congruent,
    equilibration,
    homogeneous_path,
    is_definite,
)
from namlcp.lcp.pivoting.interior import follow
from namlcp.lcp.pivoting.large_faces import LargeFaces
from namlcp.lcp.pivoting.rays import DENSE, proof
from namlcp.lcp.pivoting.work import (
    ASKED,
    BEST,
    BEST_Z,
    CENTRE,
    CONVEX,
    EPS_ABS,
    EPS_REL,
    FACTORED,
    FEWEST,
    LOWER,
    MET,
    OUTSIDE,
    PATHED,
    PATIENCE,
    RHO,
    RHS,
    SEARCHING,
    SIZE,
    STARTED,
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
from namlcp.lcp.prepared import Prepared
from namlcp.limits import Deadline, Limits
from namlcp.linalg import Columns
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

UNSEEN, MOST_AT_ONCE = 10_000_000, 50
"""Operations and factorisations between two looks at the deadline, or one of these."""

LAST_STEPS = 200
"""So many factorisations, and one for each unknown, are left to a hopeless case."""

PATH_STEPS = 60
LARGE_STEPS = 150
PATH_CHUNK = 5
"""Steps of the path at most, and so many between two points that may be kept."""

PATH_TARGET = 1e-8

CURVATURE = 1e-10
"""So much below 0, of a unit diagonal, is rounding of a semidefinite matrix."""

ROUNDING = 1e-15
"""Of w = A z + q, relative to its terms."""

DEAD_ENDS = pivoting.STAGNATED, pivoting.STUCK

CLEAR = 1e3
"""kappa / tau from which on a proof is looked for; then at ten times as much."""


def solve_box(
    lcp: LCP, z0: np.ndarray | None, limits: Limits, ask_convex: bool = False
) -> Outcome:
    """Solve a box LCP by pivoting; iterations are factorisations.

    The matrix is dense and C-contiguous or canonical CSR (CSC too if symmetric).
    ask_convex: for symmetric A, tell whether it is positive semidefinite (one
    factorisation).
    """
    matrix, q, lower, upper = lcp
    A, columns, symmetric = lcp.A, matrix.columns, matrix.symmetric
    eps_abs, eps_rel, most, deadline, report = limits
    max_iter = most or MAX_ITER
    n = q.size
    work = workspace(columns, n)
    vectors, scalar = work.vectors, work.scalar
    vectors[Q], vectors[LOWER], vectors[UPPER] = q, lower, upper
    if z0 is not None:
        vectors[Z] = z0
    scalar[EPS_ABS], scalar[EPS_REL] = eps_abs, eps_rel
    compressed = columns.dense.shape[0] == 0
    large = symmetric and compressed and in_blocks(n, columns.data.size)
    outside = large or (not symmetric and compressed and n > DENSE)
    faces = LargeFaces(work) if large else None
    work.counter[ASKED] = ask_convex and not large
    with np.errstate(all="ignore"):  # a singular face overflows, and is noticed
        problem, given = (A, q, lower, upper, columns), (max_iter, deadline, report)
        status, ray = drive(*problem, symmetric, work, outside, faces, *given)
        if faces is not None and ask_convex and status is Status.SOLVED:
            work.counter[CONVEX] = faces.is_convex()
        z, w, status = judged(A, q, lower, upper, work, status)
        if status is Status.STALLED and may_decide(work, symmetric, outside):
            first = z, w
            scalar[BEST], scalar[MET] = math.inf, 0.0
            status, ray = drive(*problem, symmetric, work, outside, faces, *given)
            z, w, status = judged(A, q, lower, upper, work, status)
            is_better = status is Status.SOLVED or natural_residual(
                z, w, lower, upper
            ) <= natural_residual(*first, lower, upper)
            z, w = (z, w) if is_better else first
        exact = solved_by_zero(A, q, lower, upper) if status is Status.STALLED else None
        if exact is not None:
            (z, w), status = exact, Status.SOLVED
    if status is Status.STALLED and symmetric and n <= DENSE:
        # Nearly singular towards the solution: rho hides it, so once more without.
        unsymmetric = Prepared.unchecked(A, symmetric=False)
        again = solve_box(lcp._replace(matrix=unsymmetric), z, limits)
        if again.status is Status.SOLVED or again.ray is not None:
            return again._replace(convex=bool(work.counter[CONVEX]))
    done, convex = int(work.counter[FACTORED]), bool(work.counter[CONVEX])
    return Outcome(status, z, w, done, "pivoting", ray, convex=convex)


def judged(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    work: Work,
    status: Status,
) -> tuple[np.ndarray, np.ndarray, Status]:
    """Return the best z, w = A z + q, and STALLED where they belie SOLVED."""
    vectors, scalar = work.vectors, work.scalar
    z = np.minimum(np.maximum(vectors[BEST_Z] * vectors[D], lower), upper)
    w = A @ z + q
    if status is Status.SOLVED and scalar[SIZE] > 0.0:
        plain, scaled = natural_residuals(z, w, lower, upper, 1.0 / vectors[D])
        goal = scalar[EPS_REL] * scalar[SIZE]
        if not (plain < scalar[EPS_ABS] or scaled <= goal < math.inf):
            status = Status.STALLED
    return z, w, status


def solved_by_zero(
    A: Any, q: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return z = clip(0) and w if they solve but for the rounding of w, else None."""
    z = np.clip(np.zeros(q.size), lower, upper)
    w = A @ z + q
    terms = np.abs(q) + abs(A) @ np.abs(z)
    v = np.where(np.abs(w) <= ROUNDING * terms, 0.0, w)
    return None if np.maximum(np.minimum(v, z - lower), z - upper).any() else (z, w)


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
    deadline: Deadline,
    report: Report,
) -> tuple[Status, np.ndarray | None]:
    """Call `pivot` until it is done, and do for it what it asks for.

    Called again, what `pivot` held for the solution was none.
    """
    counter, n = work.counter, q.size
    chunk = 1 if report is not None else at_once(n)
    code = pivoting.STUCK if counter[STARTED] else pivoting.MORE
    while code != pivoting.SOLVED:
        done = int(counter[FACTORED])
        # Murty's rule may go round in circles where a minor was seen to be negative.
        limit = min(max_iter, LAST_STEPS + n) if hopeless(work) else max_iter
        if code in DEAD_ENDS and may_decide(work, symmetric, outside):
            ray = decide(A, q, work, limit, deadline)
            tell(report, A, q, lower, upper, work)
            if ray is not None:
                return Status.UNSOLVABLE, ray
            done, code = int(counter[FACTORED]), pivoting.MORE
        if code == pivoting.STUCK or done >= limit:
            status = Status.STALLED if code == pivoting.STUCK else Status.MAX_ITER
            return left(work, Status.UNSOLVABLE if counter[OUTSIDE] else status)
        if done > 0 and deadline.reached():
            return left(work, Status.TIME_LIMIT)
        if code == pivoting.RAY:
            ray = proof(A, q, work.vectors[RHS] * work.vectors[D], work, symmetric)
            if ray is not None:
                return Status.UNSOLVABLE, ray
        elif code == pivoting.STAGNATED:
            cure(A, work, symmetric, outside, faces, deadline)
            if deadline.reached():
                return left(work, Status.TIME_LIMIT)
        if code == pivoting.FACE:
            if faces is None:
                solve_outside(work)
            else:
                faces.solve()
            code = resume(symmetric, work)
        else:
            budget = min(chunk, limit - done)
            code = pivot(columns, symmetric, work, budget, outside)
        if counter[FACTORED] > done:
            tell(report, A, q, lower, upper, work)
    return Status.SOLVED, None


def left(work: Work, status: Status) -> tuple[Status, None]:
    """Return how it ended: the path may have met the tolerance before a limit."""
    return Status.SOLVED if work.scalar[MET] else status, None


def tell(
    report: Report,
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    work: Work,
) -> None:
    """Report the factorisations so far, the least Res and the unknowns at bounds."""
    if report is None:
        return
    active = np.count_nonzero(work.marks[STATE])
    z = np.clip(work.vectors[BEST_Z] * work.vectors[D], lower, upper)
    residual = natural_residual(z, A @ z + q, lower, upper)
    report(int(work.counter[FACTORED]), residual, active)


def at_once(n: int) -> int:
    """Return how many factorisations of order n go by without a look at the clock."""
    return int(min(max(3 * UNSEEN // max(n, 1) ** 3, 1), MOST_AT_ONCE))


def hopeless(work: Work) -> bool:
    """Tell whether A is not a P-matrix and the path has failed."""
    return bool(work.counter[OUTSIDE] and work.counter[PATHED])


def cure(
    A: Any,
    work: Work,
    symmetric: bool,
    outside: bool,
    faces: LargeFaces | None,
    deadline: Deadline,
) -> None:
    """Get block pivoting going again: once by the path, then by a larger rho."""
    counter, scalar = work.counter, work.scalar
    if not counter[PATHED]:
        if faces is not None:
            faces.follow(PATH_TARGET, LARGE_STEPS, deadline)
            return
        if outside:
            counter[PATHED] = 1
            return
        steps, chunk = 0, PATH_CHUNK
        if work.scaled.dense.shape[0] > 0:  # sparse ones that take long are in blocks
            chunk = min(chunk, at_once(work.vectors.shape[1]))
        while steps < PATH_STEPS:
            budget = min(chunk, PATH_STEPS - steps)
            taken = follow(symmetric, work, PATH_TARGET, budget)
            steps += taken
            if taken < budget or deadline.reached():
                return
    else:
        scalar[RHO] = min(1000.0 * scalar[RHO], MOST_RHO)
        counter[SEARCHING] = symmetric
        start_over(A, work)


def start_over(A: Any, work: Work) -> None:
    """Begin block pivoting with rho at the centre."""
    counter, vectors, searching = work.counter, work.vectors, work.counter[SEARCHING]
    w = vectors[Q] + vectors[D] * (A @ (vectors[D] * vectors[CENTRE]))
    vectors[X] = vectors[CENTRE]
    vectors[S] = vectors[CENTRE] - w / (work.scalar[RHO] if searching else 1.0)
    s = vectors[CENTRE] - w
    at_upper = np.where(s >= vectors[UPPER], 1, 0)
    work.marks[STATE] = np.where(s <= vectors[LOWER], -1, at_upper)
    counter[FEWEST] = w.size + 1
    counter[PATIENCE] = SEARCH_STEPS if searching else BLOCK_STEPS


def may_decide(work: Work, symmetric: bool, outside: bool) -> bool:
    """Tell whether the homogeneous path is the way on: x'Ax >= 0, A not symmetric.

    Where x'Ax > 0 there is nothing to decide, and the short path does as well.
    """
    if symmetric or work.counter[PATHED]:
        return False
    A = matrix_of(work)
    A = congruent(A, equilibration(A))  # what has a_ii = 0 has no unit yet
    return (outside or not is_definite(A, -CURVATURE)) and is_definite(A, CURVATURE)


def decide(
    A: Any, q: np.ndarray, work: Work, limit: int, deadline: Deadline
) -> np.ndarray | None:
    """Follow the homogeneous path; return a proof, else give `work` its best point."""
    counter, vectors, scalar = work.counter, work.vectors, work.scalar
    lower, upper, d = vectors[LOWER], vectors[UPPER], vectors[D]
    counter[PATHED] = 1
    scaled, clear = matrix_of(work), CLEAR
    for point in homogeneous_path(scaled, vectors[Q], lower, upper):
        if point.clarity < 1.0:
            z = np.clip(point.z, lower, upper)
            w = vectors[Q] + scaled @ z
            residual, plain = natural_residuals(z, w, lower, upper, d)
            if residual < scalar[BEST]:
                scalar[BEST], vectors[BEST_Z] = residual, z
                met = residual <= scalar[EPS_REL] * scalar[SIZE]
                scalar[MET] = met or plain < scalar[EPS_ABS]
        elif point.clarity > clear:
            clear = 10.0 * point.clarity
            ray = proof(A, q, point.z * d, work, False)
            if ray is not None:
                return ray
        over = counter[FACTORED] >= limit or deadline.reached()
        if scalar[MET] or over:
            break
        counter[FACTORED] += 1
    vectors[CENTRE] = vectors[BEST_Z]
    scalar[RHO] = LEAST_RHO
    start_over(A, work)
    return None


def matrix_of(work: Work) -> Any:
    """Return the matrix scaled to a unit diagonal."""
    scaled, n = work.scaled, work.vectors.shape[1]
    if scaled.dense.shape[0] == n:
        return scaled.dense.T
    arrays = scaled.data, scaled.indices, scaled.indptr
    return sparse.csc_array(arrays, shape=(n, n))


def solve_outside(work: Work) -> None:
    """Solve the face system of `work` by sparse LU, for unsymmetric matrices."""
    vectors = work.vectors
    work.counter[FACTORED] += 1
    face = np.flatnonzero(work.marks[STATE] == 0)
    A = matrix_of(work)
    shift = work.scalar[RHO] * sparse.eye_array(face.size)
    try:
        factor = splu(sparse.csc_array(A[:, face].tocsr()[face] + shift))
        vectors[Z][face] = factor.solve(vectors[RHS][face])
    except RuntimeError:  # exactly singular
        vectors[Z][face] = np.nan
