"""Tridiagonal box LCPs by block principal pivoting, from a start that is nearly right.

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0). In
this package, "face" means the states of all unknowns. Each iteration solves the free
system of one face by an elimination without interchanges; then every unknown with a
wrong sign changes its state. For M-matrices this is policy iteration. From a good start
(the previous time step of an American option) one or two faces suffice.

From a bad start the active set may change by only one unknown per face. So for
M-matrices with lower bounds alone, `scan` finds the first face. Otherwise every second
unknown is eliminated without regard to its bounds, the reduced LCP is solved in the
same way, and the eliminated unknowns are recomputed and clipped. Problems for which
pivoting then makes no progress are left to the caller.

A face of a few hundred unknowns takes microseconds. So one (7, n + 2) array `work` and
one array `number` hold the state of a solve; the constants below name their entries.
"""

import math

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.lcp.criterion import are_met_part
from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.tridiagonal.diagonals import (
    ABOVE,
    BELOW,
    DIAGONAL,
    INVERSE,
    ROOT,
    Tridiagonal,
    TridiagonalLCP,
    eliminate_rows,
    fill_in,
    halve,
    multiply,
)
from namlcp.lcp.tridiagonal.scan import scan
from namlcp.limits import Limits
from namlcp.linalg import copy
from namlcp.residuals import deviation
from namlcp.status import Status

# Rows of `work`: z and w = A z + q of the last face, at the end the best ones; the
# factors c_i of the elimination; clip(z) and its w; the best z and its w.
Z, W, COUPLING, TRIAL_Z, TRIAL_W, BEST_Z, BEST_W = range(7)

# Entries of `number`. SIZE: Res(clip(0)) with a unit diagonal. SIGN_SLACK: largest
# violation of a sign that counts as rounding. BEST: least Res so far; MET: it is within
# tolerance. WARM: the first face follows from the start z, not from `state`. FACES:
# number of faces so far. FEWEST: least number of wrong signs so far, 0 before the
# start. FACES_LEFT: how many may still follow without fewer.
EPS_ABS, EPS_REL, SIZE, SIGN_SLACK, BEST = range(5)
MET, WARM, FACES, FEWEST, FACES_LEFT = range(5, 10)

# Why `solve_faces` returns.
SOLVED = 0
MORE = 1  # the budget of faces is used up
STUCK = 2  # no progress, or a pivot that is not positive
ROUNDED = 3  # every sign is right, but the residual is not within tolerance

MAX_FACES = 5000
"""Faces at most, by default."""

FACES_WITHOUT_PROGRESS = 3
"""Faces in a row that may have no fewer wrong signs than the least number so far."""

SIGN_ROUNDING = 1e-15
"""Violation of a sign, relative to || q ||_2 with a unit diagonal, that counts as 0."""

SAME_PIVOT = 4.0 * np.finfo(float).eps
"""Relative difference up to which two pivots count as equal."""

UNKNOWNS = 1_000_000
"""Unknowns times faces between two checks of the deadline: about 20 ms."""

UNDERFLOW = 1e-280
"""Sums of squares below this may have lost terms by underflow."""

COARSEST = 16
"""Up to this order the reduction by half ends with the start z = 0."""

NESTED_EPS, NESTED_FACES = 1e-6, 12
"""For the reduced LCPs: relative tolerance, and faces at most."""

# The sums may be taken in any order, so that they vectorise; NaN keeps its meaning.
fast = part(fastmath={"reassoc"})


@part
def eliminate_face(lcp, slack, state, work):
    """Write z and w = A z + q of a face; change the states with a wrong sign.

    Return the number of changes, -1 if a pivot is not positive, and whether z is in the
    box. The elimination gives z_i = t_i - c_i z_{i+1}; bounded unknowns have t_i =
    bound, c_i = 0. This recurrence limits the speed, so all else is done in its loops.
    """
    rows, q, lower, upper = lcp
    n = q.size
    z, w, coupling = work[Z, :n], work[W, :n], work[COUPLING, :n]
    t, c = 0.0, 0.0
    kept = True  # c is that of the elimination of A itself
    positive = True
    for i in range(n):
        if state[i] != 0:
            t = lower[i] if state[i] < 0 else upper[i]
            c = 0.0
            kept = False
        elif kept:
            inverse = rows[INVERSE, i]
            t = -q[i] * inverse - (rows[BELOW, i] * inverse) * t
            c = rows[ABOVE, i] * inverse
        else:
            pivot = rows[DIAGONAL, i] - rows[BELOW, i] * c
            positive &= pivot > 0.0
            inverse = 1.0 / pivot
            t = (-q[i] - rows[BELOW, i] * t) * inverse
            c = rows[ABOVE, i] * inverse
            kept = abs(pivot * rows[INVERSE, i] - 1.0) <= SAME_PIVOT
        z[i] = t
        coupling[i] = c
    wrong = 0
    inside = True
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
        r = r + rows[ABOVE, j] * right + q[j]
        w[j] = r
        if state[j] != 0:
            if state[j] * r * rows[ROOT, j] > slack and lower[j] < upper[j]:
                state[j] = 0
                wrong += 1
        elif not lower[j] <= here <= upper[j]:
            inside = False
            tolerance = slack * rows[ROOT, j]
            if here < lower[j] - tolerance:
                state[j] = -1
                wrong += 1
            elif here > upper[j] + tolerance:
                state[j] = 1
                wrong += 1
            positive &= here == here  # kept pivots that are not positive are NaN
    return wrong if positive else -1, inside


@part
def scaled_deviation(z, w, lower, upper, diagonal, root):
    """Return `residuals.deviation` of the problem with a unit diagonal.

    Scaling comes before squaring: with a diagonal of 1e160, the square of z - lower
    would underflow.
    """
    s = diagonal * root
    return max(min(w * root, (z - lower) * s), (z - upper) * s) + 0.0 * z


@fast
def both_residuals(lcp, z, w):
    """Return Res(z), of this problem and of the one with a unit diagonal."""
    rows, _, lower, upper = lcp
    diagonal, root = rows[DIAGONAL], rows[ROOT]
    plain, scaled = 0.0, 0.0
    for i in range(z.size):
        r = deviation(z[i], w[i], lower[i], upper[i])
        plain += r * r
        r = scaled_deviation(z[i], w[i], lower[i], upper[i], diagonal[i], root[i])
        scaled += r * r
    if plain < UNDERFLOW:  # squares have underflown
        plain = 0.0
        for i in range(z.size):
            plain = max(plain, abs(deviation(z[i], w[i], lower[i], upper[i])))
        return plain, np.sqrt(scaled)
    return np.sqrt(plain), np.sqrt(scaled)


@part
def clip_into_box(lcp, x, z, w):
    """Write z = clip(x) and w = A z + q."""
    for i in range(z.size):
        z[i] = min(max(x[i], lcp.lower[i]), lcp.upper[i])
    multiply(lcp.rows, z, lcp.q, w)


@fast
def squares_at_zero(lcp, zero):
    """Return the squares of Res(clip(0)) and || q ||_2 with a unit diagonal.

    zero (n + 2,) is clip(0) with an additional zero at both ends.
    """
    rows, q, lower, upper = lcp
    below, diagonal, above, root = rows[BELOW], rows[DIAGONAL], rows[ABOVE], rows[ROOT]
    residual, size = 0.0, 0.0
    for i in range(q.size):
        z = zero[i + 1]
        w = below[i] * zero[i] + diagonal[i] * z + above[i] * zero[i + 2] + q[i]
        r = scaled_deviation(z, w, lower[i], upper[i], diagonal[i], root[i])
        residual += r * r
        size += (q[i] * root[i]) * (q[i] * root[i])
    return residual, size


@part
def begin(lcp, state, number, work):
    """Write SIZE, SIGN_SLACK and the counters to number; if WARM, write state.

    The states are those after a Jacobi step from z. If clip(0) solves the LCP, only
    SIZE = 0, z and w are written.
    """
    rows, q, lower, upper = lcp
    n = q.size
    z, w = work[Z, :n], work[W, :n]
    zero, root = work[COUPLING], rows[ROOT]
    zero[0] = zero[n + 1] = 0.0
    for i in range(n):
        zero[i + 1] = min(max(0.0, lower[i]), upper[i])
    residual, size = squares_at_zero(lcp, zero)
    number[SIZE] = np.sqrt(residual)
    if residual == 0.0:
        copy(zero[1 : n + 1], z)
        multiply(rows, z, q, w)
        return
    relative = 0.01 * number[EPS_REL] * np.sqrt(residual / n)
    number[SIGN_SLACK] = max(SIGN_ROUNDING * np.sqrt(size), relative)
    number[FEWEST], number[FACES_LEFT] = n + 1, FACES_WITHOUT_PROGRESS
    number[BEST] = np.inf
    if number[WARM]:
        multiply(rows, z, q, w)
        for i in range(n):
            s = z[i] - w[i] * (root[i] * root[i])
            state[i] = np.int8(s >= upper[i]) - np.int8(s <= lower[i])


@part
def take_best(lcp, number, work):
    """Write the best point so far to z and w, clip(0) if there is none."""
    n = lcp.q.size
    z, w = work[Z, :n], work[W, :n]
    if number[BEST] < np.inf:
        copy(work[BEST_Z, :n], z)
        copy(work[BEST_W, :n], w)
    else:
        z.fill(0.0)
        clip_into_box(lcp, z, z, w)


@part
def is_met(number, plain, scaled):
    """Do what `Criterion.met` does."""
    eps_abs, eps_rel, size = number[EPS_ABS], number[EPS_REL], number[SIZE]
    return are_met_part(eps_abs, eps_rel, size, plain, scaled)


@kernel(error_model="numpy")
def solve_faces(rows, q, lower, upper, state, number, work, budget):
    """Begin if number[FEWEST] = 0, else go on; return a code after `budget` faces.

    The fields of a `TridiagonalLCP` are faster to pass from Python than itself. The
    states (n,) are overwritten. `number` has EPS_ABS, EPS_REL, WARM and zeros at first.
    Row Z of `work` is the start z; on return, rows Z and W are the best z and its w.
    """
    lcp = TridiagonalLCP(rows, q, lower, upper)
    if number[FEWEST] == 0.0:
        begin(lcp, state, number, work)
        if number[SIZE] == 0.0:
            return SOLVED
    n = lcp.q.size
    z, w = work[Z, :n], work[W, :n]
    trial_z, trial_w = work[TRIAL_Z, :n], work[TRIAL_W, :n]
    while budget > 0:
        budget -= 1
        number[FACES] += 1.0
        wrong, inside = eliminate_face(lcp, number[SIGN_SLACK], state, work)
        if wrong == 0:
            if not inside:
                clip_into_box(lcp, z, z, w)
            plain, scaled = both_residuals(lcp, z, w)
            if is_met(number, plain, scaled):
                number[BEST] = scaled
                return SOLVED
        if wrong >= 0:
            clip_into_box(lcp, z, trial_z, trial_w)
            plain, scaled = both_residuals(lcp, trial_z, trial_w)
            if scaled < number[BEST]:
                number[BEST] = scaled
                number[MET] = is_met(number, plain, scaled)
                copy(trial_z, work[BEST_Z])
                copy(trial_w, work[BEST_W])
            if wrong < number[FEWEST]:
                number[FEWEST], number[FACES_LEFT] = wrong, FACES_WITHOUT_PROGRESS
            number[FACES_LEFT] -= 1.0
        if wrong <= 0 or number[FACES_LEFT] < 0.0:
            take_best(lcp, number, work)
            if number[MET]:
                return SOLVED
            return ROUNDED if wrong == 0 else STUCK
    take_best(lcp, number, work)
    return MORE


@kernel(error_model="numpy")
def scan_for_states(rows, q, lower, upper, state, work, stack, spans):
    """Write the states that `scan` finds; work, stack and spans are overwritten."""
    lcp = TridiagonalLCP(rows, q, lower, upper)
    for i in range(state.size):
        state[i] = -1 if lower[i] > -np.inf else 0
    eliminate_face(lcp, np.inf, state, work)  # no state is changed
    scan(rows, work[W, : state.size], lower, upper, stack, spans, state)


class TridiagonalSolver:
    """One solve: z is the start, then with w = A z + q the best point so far."""

    def __init__(
        self, lcp: TridiagonalLCP, z: np.ndarray | None, eps_abs: float, eps_rel: float
    ):
        self.lcp = lcp
        n = lcp.q.size
        self.state = np.empty(n, dtype=np.int8)
        self.work = np.empty((7, n + 2))
        self.z, self.w = self.work[Z, :n], self.work[W, :n]
        self.z[:] = 0.0 if z is None else z
        self.number = np.zeros(10)
        self.number[EPS_ABS], self.number[EPS_REL] = eps_abs, eps_rel
        self.number[WARM] = 1.0

    @property
    def faces(self) -> int:
        """Faces solved so far."""
        return int(self.number[FACES])

    def run(self, budget: int) -> int:
        """Call `solve_faces`."""
        return solve_faces(*self.lcp, self.state, self.number, self.work, budget)

    def begin_afar(self, z_matrix: bool) -> None:
        """Begin anew, with a first face from `scan` or a z from `nested_start`."""
        _, _, lower, upper = self.lcp
        self.number[FEWEST] = 0.0
        one_sided = not np.any((upper < math.inf) & (lower < upper))
        is_scanned = z_matrix and one_sided
        self.number[WARM] = not is_scanned
        if is_scanned:
            m = (lower.size + 1) // 2
            stack, spans = np.empty((6, m)), np.empty((2, m), dtype=np.int64)
            scan_for_states(*self.lcp, self.state, self.work, stack, spans)
        else:
            nested_start(self.lcp, self.z)


def nested_start(lcp: TridiagonalLCP, z: np.ndarray) -> None:
    """Write to z a start from the solution of the LCP of every second unknown."""
    rows, q, lower, upper = lcp
    z.fill(0.0)
    if q.size <= COARSEST:
        return
    m = (q.size + 1) // 2
    rows_below, q_below = np.empty((5, m)), np.empty(m)
    halve(rows, q, rows_below, q_below)
    if not eliminate_rows(rows_below)[0]:
        return
    below = TridiagonalLCP(rows_below, q_below, lower[::2].copy(), upper[::2].copy())
    solver = TridiagonalSolver(below, None, 0.0, NESTED_EPS)
    nested_start(below, solver.z)
    solver.run(NESTED_FACES)
    fill_in(rows, q, lower, upper, solver.z, z)


def solve_tridiagonal(
    lcp: LCP, form: Tridiagonal, z0: np.ndarray | None, limits: Limits
) -> Outcome:
    """Solve a box LCP whose matrix is `form`; iterations are faces.

    STALLED: every sign is right, but rounding keeps Res above the tolerance.
    DIVERGED: this method makes no progress; another one may go on from z.
    """
    n = lcp.q.size
    max_iter, report = limits.max_iter or MAX_FACES, limits.report
    problem = TridiagonalLCP(form.rows, lcp.q, lcp.lower, lcp.upper)
    solver = TridiagonalSolver(problem, z0, limits.eps_abs, limits.eps_rel)
    is_cold = z0 is None
    if is_cold:
        solver.begin_afar(form.z_matrix)
    status = None
    while status is None:
        before = solver.faces
        budget = 1 if report is not None else max(1, UNKNOWNS // n)
        code = solver.run(min(budget, max_iter - before))
        if report is not None and solver.faces > before:
            residual = lcp.residual(solver.z, solver.w)
            report(solver.faces, residual, np.count_nonzero(solver.state))
        if code == SOLVED:
            status = Status.SOLVED
        elif code == ROUNDED:
            status = Status.STALLED
        elif code == STUCK and is_cold:
            status = Status.DIVERGED
        elif solver.faces >= max_iter:
            status = Status.MAX_ITER
        elif limits.deadline.reached():
            status = Status.TIME_LIMIT
        elif code == STUCK:
            solver.begin_afar(form.z_matrix)
            is_cold = True
    z, w = solver.z.copy(), solver.w.copy()
    return Outcome(status, z, w, solver.faces, "tridiagonal")
