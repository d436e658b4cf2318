"""Tridiagonal box LCPs in O(n): faces by elimination, a first one that is nearly right.

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0). A
face, the free unknowns solved for with the others at their bounds, costs one
elimination without interchange; whoever has the wrong sign then changes state. That is
block principal pivoting, or policy iteration where A is an M-matrix, and one or two
faces do where the start is a good one: the time steps of an American option.

From afar a contact set may move by only one unknown a face. So the first face comes
from a scan (`segments`) for M-matrices with lower bounds alone. Else every second
unknown is eliminated, as if its bounds were far, the rest is solved likewise, and the
eliminated ones are put back into their bounds. What that does not solve (no P-matrix,
or one far from an H-matrix) is left to the caller.
"""

import math

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.tridiagonal.diagonals import (
    ABOVE,
    BELOW,
    DIAGONAL,
    INVERSE,
    ROOT,
    Tridiagonal,
    eliminate,
    fill_in,
    halve,
    multiply,
)
from namlcp.lcp.tridiagonal.scan import scan
from namlcp.limits import Limits
from namlcp.linalg import copy
from namlcp.residuals import deviation
from namlcp.status import Status

# Rows of the work array.
COUPLING, TRIAL, SLOPE, BEST_Z, BEST_W = range(5)
# Places in the array of numbers.
EPS_ABS, EPS_REL, SIZE, TOLERANCE, BEST, MET, FACES, FEWEST, PATIENCE = range(9)

# Why `solve_faces` returns.
SOLVED = 0
MORE = 1  # the budget of faces is used up
STUCK = 2  # no progress, or a pivot that is not positive
ROUNDING = 3  # every sign is right, but the residual is not within tolerance

BLOCK_STEPS = 3
"""Faces in a row that may have no fewer wrong signs than the best one had."""

EXACT = 1e-15
"""A wrong sign below this times the norm of q is rounding."""

SAME = 4.0 * np.finfo(float).eps
"""Pivots that differ by no more, relatively, are the same."""

MAX_ITER = 5000
"""Faces at most, unless the caller says."""

UNKNOWNS = 1_000_000
"""So many unknowns are solved for between two looks at the clock."""

TINY = 1e-280
"""Sums of squares below this may have lost terms."""

COARSEST = 16
"""Up to this order the first face is that of clip(0)."""

NESTED_EPS = 1e-6
NESTED_FACES = 12
"""With half the unknowns: relative residual wanted, and faces at most."""

# The sums may be taken in any order, so that they vectorise; NaN keeps its meaning.
fast = part(fastmath={"reassoc"})


@part
def solve_face(rows, q, lower, upper, tolerance, state, coupling, z, w):
    """Write z and w = A z + q of a face; change the states of wrong sign.

    Return how many had it, or -1 where a pivot is not positive, and whether z is in the
    box. Forward z_i = t_i - c_i z_{i+1}, where a bounded unknown has t_i = bound and
    c_i = 0. The chain of these numbers takes the time, so the rest is done beside it.
    """
    n = z.size
    t, c = 0.0, 0.0
    kept = True  # c is the one of A itself
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
            kept = abs(pivot * rows[INVERSE, i] - 1.0) <= SAME
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
            if state[j - 1] == 0:  # a new chain behind every bounded unknown
                left -= coupling[j - 1] * here
                z[j - 1] = left
        r = rows[BELOW, j] * left + rows[DIAGONAL, j] * here
        r = r + rows[ABOVE, j] * right + q[j]
        w[j] = r
        if state[j] != 0:
            if state[j] * r * rows[ROOT, j] > tolerance and lower[j] < upper[j]:
                state[j] = 0
                wrong += 1
        elif not lower[j] <= here <= upper[j]:
            inside = False
            slack = tolerance * rows[ROOT, j]
            if here < lower[j] - slack:
                state[j] = -1
                wrong += 1
            elif here > upper[j] + slack:
                state[j] = 1
                wrong += 1
            positive &= here == here  # kept pivots that are not positive are NaN
    return wrong if positive else -1, inside


@part
def scaled_deviation(z, w, lower, upper, diagonal, root):
    """Return `residuals.deviation` on the problem with a unit diagonal.

    It is scaled before it is squared: with a diagonal of 1e160 its square in the units
    of z would be 0.
    """
    s = diagonal * root
    return max(min(w * root, (z - lower) * s), (z - upper) * s) + 0.0 * z


@fast
def measure(rows, lower, upper, z, w):
    """Return Res(z), of this problem and of the one with a unit diagonal."""
    diagonal, root = rows[DIAGONAL], rows[ROOT]
    plain, scaled = 0.0, 0.0
    for i in range(z.size):
        r = deviation(z[i], w[i], lower[i], upper[i])
        plain += r * r
        r = scaled_deviation(z[i], w[i], lower[i], upper[i], diagonal[i], root[i])
        scaled += r * r
    if plain < TINY:  # squares have underflown
        plain = 0.0
        for i in range(z.size):
            plain = max(plain, abs(deviation(z[i], w[i], lower[i], upper[i])))
        return plain, np.sqrt(scaled)
    return np.sqrt(plain), np.sqrt(scaled)


@part
def clip(x, lower, upper, z):
    """Set z to clip(x, lower, upper)."""
    for i in range(z.size):
        z[i] = min(max(x[i], lower[i]), upper[i])


@fast
def squares_at_zero(rows, q, lower, upper, zero):
    """Return the squares of Res and || q ||_2 with a unit diagonal.

    zero : (n + 2,) array
        clip(0), with a zero at both ends.
    """
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
def begin(rows, q, lower, upper, warm, state, number, work, z, w):
    """Measure clip(0); if `warm`, take the states to which a Jacobi step from z leads.

    Where clip(0) is the solution it is the start.
    """
    n = z.size
    zero, root = work[COUPLING], rows[ROOT]
    zero[0] = zero[n + 1] = 0.0
    for i in range(n):
        zero[i + 1] = min(max(0.0, lower[i]), upper[i])
    residual, size = squares_at_zero(rows, q, lower, upper, zero)
    number[SIZE] = np.sqrt(residual)
    if residual == 0.0:
        copy(zero[1 : n + 1], z)
        multiply(rows, z, q, w)
        return
    relative = 0.01 * number[EPS_REL] * np.sqrt(residual / n)
    number[TOLERANCE] = max(EXACT * np.sqrt(size), relative)
    number[FEWEST], number[PATIENCE] = z.size + 1, BLOCK_STEPS
    number[BEST] = np.inf
    if warm:
        multiply(rows, z, q, w)
        for i in range(z.size):
            s = z[i] - w[i] * (root[i] * root[i])
            state[i] = np.int8(s >= upper[i]) - np.int8(s <= lower[i])


@part
def end(problem, number, work, z, w):
    """Set z, w to the best point so far, clip(0) if there is none."""
    rows, q, lower, upper = problem
    n = z.size
    if number[BEST] < np.inf:
        copy(work[BEST_Z, :n], z)
        copy(work[BEST_W, :n], w)
    else:
        z.fill(0.0)
        clip(z, lower, upper, z)
        multiply(rows, z, q, w)


@part
def is_met(number, plain, scaled):
    """Tell whether these residuals are within tolerance."""
    relative = scaled <= number[EPS_REL] * number[SIZE] < np.inf
    return relative or plain < number[EPS_ABS]


@kernel(error_model="numpy")
def solve_faces(rows, q, lower, upper, warm, state, number, work, z, w, budget):
    """Begin where number[FEWEST] = 0, else go on, for `budget` faces. Return a code.

    Parameters
    ----------
    rows : (5, n) array
        The matrix, see `Tridiagonal`.
    q, lower, upper : (n,) array
        The rest of the problem.
    warm : bool
        The first face is that of the start z, not that of `state`.
    state : (n,) int8 array
        States.
    number : (9,) array
        EPS_ABS, EPS_REL, at first zeros besides; how far it is.
    work : (5, n + 2) array
        Work.
    z, w : (n,) array
        Start; on return the best point and A z + q.
    """
    if number[FEWEST] == 0.0:
        begin(rows, q, lower, upper, warm, state, number, work, z, w)
        if number[SIZE] == 0.0:
            return SOLVED
    n = z.size
    coupling, trial, slope = work[COUPLING, :n], work[TRIAL, :n], work[SLOPE, :n]
    tolerance = number[TOLERANCE]
    while budget > 0:
        budget -= 1
        number[FACES] += 1.0
        wrong, inside = solve_face(
            rows, q, lower, upper, tolerance, state, coupling, z, w
        )
        if wrong == 0:
            if not inside:
                clip(z, lower, upper, z)
                multiply(rows, z, q, w)
            plain, scaled = measure(rows, lower, upper, z, w)
            if is_met(number, plain, scaled):
                number[BEST] = scaled
                return SOLVED
        if wrong >= 0:
            clip(z, lower, upper, trial)
            multiply(rows, trial, q, slope)
            plain, scaled = measure(rows, lower, upper, trial, slope)
            if scaled < number[BEST]:
                number[BEST] = scaled
                number[MET] = is_met(number, plain, scaled)
                copy(trial, work[BEST_Z])
                copy(slope, work[BEST_W])
            if wrong < number[FEWEST]:
                number[FEWEST], number[PATIENCE] = wrong, BLOCK_STEPS
            number[PATIENCE] -= 1.0
        if wrong <= 0 or number[PATIENCE] < 0.0:
            end((rows, q, lower, upper), number, work, z, w)
            if number[MET]:
                return SOLVED
            return ROUNDING if wrong == 0 else STUCK
    end((rows, q, lower, upper), number, work, z, w)
    return MORE


@kernel(error_model="numpy")
def scan_for_states(rows, q, lower, upper, state, work, stack, spans):
    """Set the states to those that `scan` finds."""
    n = q.size
    for i in range(n):
        state[i] = -1 if lower[i] > -np.inf else 0
    z, slope = work[TRIAL, :n], work[SLOPE, :n]
    # With infinite tolerance no state is changed.
    solve_face(rows, q, lower, upper, np.inf, state, work[COUPLING, :n], z, slope)
    scan(rows, slope, lower, upper, stack, spans, state)


class Solver:
    """One solve: the arrays it needs, and how far it is.

    Attributes
    ----------
    z, w : (n,) array
        Best point so far and A z + q.
    """

    def __init__(
        self,
        A: Tridiagonal,
        q: np.ndarray,
        lower: np.ndarray,
        upper: np.ndarray,
        z: np.ndarray,
        eps_abs: float,
        eps_rel: float,
    ):
        self.A = A
        self.problem = A.rows, q, lower, upper
        n = z.size
        self.z, self.w = z, np.empty(n)
        self.state = np.empty(n, dtype=np.int8)
        self.work = np.empty((5, n + 2))
        self.number = np.zeros(9)
        self.number[EPS_ABS], self.number[EPS_REL] = eps_abs, eps_rel
        self.warm = True

    @property
    def faces(self) -> int:
        """Faces solved so far."""
        return int(self.number[FACES])

    def run(self, budget: int) -> int:
        """Call `solve_faces`."""
        point = self.z, self.w, budget
        return solve_faces(
            *self.problem, self.warm, self.state, self.number, self.work, *point
        )

    def begin_afar(self) -> None:
        """Find a first face without a start: by the scan, or from half the unknowns."""
        rows, q, lower, upper = self.problem
        n = q.size
        self.number[FEWEST] = 0.0
        one_sided = not np.any((upper < math.inf) & (lower < upper))
        self.warm = not (self.A.z_matrix and one_sided)
        if self.warm:
            nested(rows, q, lower, upper, self.z)
        else:
            m = (n + 1) // 2
            stack, spans = np.empty((6, m)), np.empty((2, m), dtype=np.int64)
            scan_for_states(*self.problem, self.state, self.work, stack, spans)


def nested(
    rows: np.ndarray, q: np.ndarray, lower: np.ndarray, upper: np.ndarray, z: np.ndarray
) -> None:
    """Write to z a start from the solution with half the unknowns, and so on."""
    n = q.size
    z.fill(0.0)
    if n <= COARSEST:
        return
    m = (n + 1) // 2
    rows_below, q_below, below = np.empty((5, m)), np.empty(m), np.empty(m)
    halve(rows, q, rows_below, q_below)
    if not eliminate(rows_below)[0]:
        return
    box = lower[::2].copy(), upper[::2].copy()
    nested(rows_below, q_below, *box, below)
    solver = Solver(
        Tridiagonal(rows_below, False), q_below, *box, below, 0.0, NESTED_EPS
    )
    solver.run(NESTED_FACES)
    fill_in(rows, q, lower, upper, solver.z, z)


def solve_tridiagonal(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Solve a box LCP whose matrix has a form `tridiagonal`; iterations are faces.

    STALLED: every sign is right, so that rounding alone is left to blame. UNSOLVABLE: A
    is none that elimination can decide, and another method may do better from z on.
    """
    matrix, q, lower, upper = lcp
    assert matrix.tridiagonal is not None
    n = q.size
    max_iter = limits.max_iter or MAX_ITER
    z = np.zeros(n) if z0 is None else z0.copy()
    solver = Solver(
        matrix.tridiagonal, q, lower, upper, z, limits.eps_abs, limits.eps_rel
    )
    afar = z0 is None
    if afar:
        solver.begin_afar()

    def outcome(status: Status) -> Outcome:
        return Outcome(status, solver.z, solver.w, solver.faces, "tridiagonal")

    while True:
        before = solver.faces
        budget = 1 if limits.report is not None else max(1, UNKNOWNS // n)
        code = solver.run(min(budget, max_iter - before))
        if limits.report is not None and solver.faces > before:
            residual = lcp.residual(solver.z, solver.w)
            limits.report(solver.faces, residual, np.count_nonzero(solver.state))
        if code == SOLVED:
            return outcome(Status.SOLVED)
        if code == ROUNDING:
            return outcome(Status.STALLED)
        if code == STUCK and afar:
            return outcome(Status.UNSOLVABLE)
        if solver.faces >= max_iter:
            return outcome(Status.MAX_ITER)
        if limits.deadline.reached():
            return outcome(Status.TIME_LIMIT)
        if code == STUCK:
            solver.begin_afar()
            afar = True
