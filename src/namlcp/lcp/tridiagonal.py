"""Tridiagonal box LCPs by elimination, from a start that is nearly right.

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0); a
"face" is the states of all. Each iteration solves the free system of one face by the
Thomas algorithm; then every unknown with a wrong sign changes its state: for an
M-matrix this is policy iteration. From a good start (the previous time step of an
American option) one or two faces suffice. After `MOST_FACES` others go on.

A segment of free unknowns begins an elimination of its own, but if A is dominant, the
pivots equal those of A to rounding after a few rows. The pivots of A are stored, so
that no divisions are needed from there on.
"""

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.lcp.criterion import are_met_part
from namlcp.lcp.data import LCP
from namlcp.lcp.prepared import ABOVE, BELOW, DIAGONAL, INVERSE, ROOT
from namlcp.limits import Limits
from namlcp.linalg.lapack import copy
from namlcp.outcome import Outcome
from namlcp.residuals import deviation
from namlcp.status import Status

# Rows of `points`: z and w = A z + q of the face, the factors c_i of the elimination,
# the best z so far and its w.
Z, W, COUPLING, BEST_Z, BEST_W = range(5)

# `numbers`: scaled Res(clip(0)), wrong sign that is rounding, least Res, faces so far.
SIZE, SLACK, LEAST, FACES = range(4)

# Why `solve_faces` returns. ROUNDED: every sign is right, but the residual is not.
SOLVED, MORE, STUCK, ROUNDED = range(4)

MOST_FACES = 50
"""Faces at most."""

SIGN_ROUNDING = 1e-15
"""Violation of a sign, relative to Res(clip(0)), that counts as 0."""

SAME_PIVOT = 4.0 * np.finfo(float).eps
"""Relative difference up to which two pivots count as equal."""

UNKNOWNS = 1_000_000
"""Unknowns times faces between two checks of the deadline: about 20 ms."""

# The sums may be taken in any order, so that they vectorise; NaN keeps its meaning.
fast = part(fastmath={"reassoc"})


@part
def eliminate(lcp, slack, state, points):
    """Write z and w of a face; change the states with a wrong sign.

    Return the number of changes, -1 if a pivot is not positive, and whether z is in the
    box. The elimination gives z_i = t_i - c_i z_{i+1}; bounded unknowns have t_i =
    bound, c_i = 0. This recurrence limits the speed, so all else is done in its loops.
    """
    rows, q, lower, upper = lcp
    z, w, coupling = points[Z], points[W], points[COUPLING]
    n = q.size
    t, c = 0.0, 0.0
    same, positive = True, True  # same: c is that of the elimination of A itself
    for i in range(n):
        if state[i] != 0:
            t = lower[i] if state[i] < 0 else upper[i]
            c = 0.0
            same = False
        elif same:
            inverse = rows[INVERSE, i]
            t = -q[i] * inverse - (rows[BELOW, i] * inverse) * t
            c = rows[ABOVE, i] * inverse
        else:
            pivot = rows[DIAGONAL, i] - rows[BELOW, i] * c
            positive &= pivot > 0.0
            inverse = 1.0 / pivot
            t = (-q[i] - rows[BELOW, i] * t) * inverse
            c = rows[ABOVE, i] * inverse
            same = abs(pivot * rows[INVERSE, i] - 1.0) <= SAME_PIVOT
        z[i] = t
        coupling[i] = c
    wrong, inside = 0, True
    left, here, right = z[n - 1], 0.0, 0.0
    for j in range(n - 1, -1, -1):
        right, here = here, left
        left = 0.0
        if j > 0:
            left = z[j - 1]
            if state[j - 1] == 0:
                left -= coupling[j - 1] * here
                z[j - 1] = left
        r = rows[BELOW, j] * left + rows[DIAGONAL, j] * here
        w[j] = r = r + rows[ABOVE, j] * right + q[j]
        if state[j] != 0:
            if state[j] * r * rows[ROOT, j] > slack and lower[j] < upper[j]:
                state[j] = 0
                wrong += 1
        elif not lower[j] <= here <= upper[j]:
            inside = False
            tolerance = slack * rows[ROOT, j]
            if here < lower[j] - tolerance or here > upper[j] + tolerance:
                state[j] = -1 if here < lower[j] else 1
                wrong += 1
            positive &= here == here  # stored pivots that are not positive are NaN
    return wrong if positive else -1, inside


@part
def clip_into_box(lcp, z, w):
    """Clip z to the bounds and write w = A z + q, summed as SciPy sums it."""
    rows, q, lower, upper = lcp
    below, diagonal, above = rows[BELOW], rows[DIAGONAL], rows[ABOVE]
    for i in range(z.size):
        z[i] = min(max(z[i], lower[i]), upper[i])
    left, here, last = 0.0, z[0], z.size - 1
    for i in range(last):
        right = z[i + 1]
        w[i] = below[i] * left + diagonal[i] * here + above[i] * right + q[i]
        left, here = here, right
    w[last] = below[last] * left + diagonal[last] * here + q[last]


@fast
def both_residuals(lcp, z, w):
    """Return Res(z), of this problem and of the one with a unit diagonal."""
    (rows, _, lower, upper), plain, scaled = lcp, 0.0, 0.0
    diagonal, root = rows[DIAGONAL], rows[ROOT]
    for i in range(z.size):
        r = deviation(z[i], w[i], lower[i], upper[i])
        plain += r * r
        s = diagonal[i] * root[i]  # before squaring, or z - lower may underflow
        r = max(min(w[i] * root[i], (z[i] - lower[i]) * s), (z[i] - upper[i]) * s)
        r += 0.0 * z[i]
        scaled += r * r
    return np.sqrt(plain), np.sqrt(scaled)


@part
def begin(lcp, eps_rel, state, numbers, points):
    """Write `numbers`, clip(0) as best point, and the states after a step of Jacobi."""
    rows, q, lower, upper = lcp
    z, w, best_z, best_w = points[Z], points[W], points[BEST_Z], points[BEST_W]
    best_z.fill(0.0)
    clip_into_box(lcp, best_z, best_w)
    size = both_residuals(lcp, best_z, best_w)[1]
    numbers[SLACK] = max(SIGN_ROUNDING, 0.01 * eps_rel / np.sqrt(q.size)) * size
    numbers[SIZE] = numbers[LEAST] = size
    clip_into_box(lcp, z, w)
    for i in range(q.size):
        s = z[i] - w[i] * (rows[ROOT, i] * rows[ROOT, i])
        state[i] = np.int8(s >= upper[i]) - np.int8(s <= lower[i])


@kernel(error_model="numpy")
def solve_faces(rows, q, lower, upper, tolerances, state, numbers, points, budget):
    """Begin if no face has been solved, else go on; return a code after `budget` faces.

    tolerances: eps_abs and eps_rel. The states (n,) are overwritten. Row Z of points
    (5, n) is the start; on return Z and W are the solution, or BEST_Z and BEST_W the
    best point so far.
    """
    lcp = rows, q, lower, upper
    z, w = points[Z], points[W]
    if numbers[FACES] == 0.0:
        begin(lcp, tolerances[1], state, numbers, points)
        if numbers[SIZE] == 0.0:
            copy(points[BEST_Z], z)
            copy(points[BEST_W], w)
            return SOLVED
    for _ in range(budget):
        numbers[FACES] += 1.0
        wrong, inside = eliminate(lcp, numbers[SLACK], state, points)
        if wrong < 0:
            return STUCK
        if not inside:
            clip_into_box(lcp, z, w)
        plain, scaled = both_residuals(lcp, z, w)
        if wrong == 0:
            size, (eps_abs, eps_rel) = numbers[SIZE], tolerances
            met = are_met_part(eps_abs, eps_rel, size, plain, scaled)
            return SOLVED if met else ROUNDED
        if scaled < numbers[LEAST]:
            numbers[LEAST] = scaled
            copy(z, points[BEST_Z])
            copy(w, points[BEST_W])
    return MORE


def solve_tridiagonal(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve a box LCP with a tridiagonal matrix; iterations are faces.

    STALLED: every sign is right, but rounding keeps Res above the tolerance.
    DIVERGED: this method makes no progress; another one may go on from z.
    """
    n, report, deadline = lcp.q.size, limits.report, limits.deadline
    state, numbers, points = np.empty(n, dtype=np.int8), np.zeros(4), np.empty((5, n))
    points[Z] = 0.0 if z0 is None else z0
    rows, vectors = lcp.matrix.tridiagonal, (lcp.q, lcp.lower, lcp.upper)
    data = rows, *vectors, limits.tolerances, state, numbers, points
    most, code, faces = min(limits.max_iter or MOST_FACES, MOST_FACES), MORE, 0
    while code == MORE and faces < most and not (faces and deadline.reached()):
        budget = 1 if report is not None else min(max(1, UNKNOWNS // n), most - faces)
        code, before = solve_faces(*data, budget), faces
        faces = int(numbers[FACES])
        z, w = points[:2] if code in (SOLVED, ROUNDED) else points[3:]
        if report is not None and faces > before:
            report(faces, lcp.residual(z, w), np.count_nonzero(state))
    status = (Status.SOLVED, Status.DIVERGED, Status.DIVERGED, Status.STALLED)[code]
    if code == MORE and faces == limits.max_iter:
        status = Status.MAX_ITER
    elif code == MORE and deadline.reached():
        status = Status.TIME_LIMIT
    return lcp.outcome(status, z.copy(), w.copy(), faces, "tridiagonal")
