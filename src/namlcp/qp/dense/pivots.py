"""The dual active-set method of Goldfarb and Idnani for small dense convex QPs.

P = L L', the rows of C are those of all constraints, and V = C L^-T. The multipliers
solve an LCP with the matrix V V', which is never formed; parametric principal pivoting
on it is this method (Math. Programming 27 (1983) 1-33). For a definite P it ends after
finitely many steps, finds infeasible problems, and needs no starting point.

1. x is the unconstrained minimum; the equalities become active.
2. The inequality violated most becomes active: its multiplier grows until it holds with
   equality (full step) or the multiplier of an active one is zero, which is then
   removed (partial step). If neither ends the step, the active rows contradict it.
3. Step 2 is repeated while a violation is above rounding. The active rows are kept as
   a QR factorisation V_F' = Q'R.
4. The KKT system of the active set is refined with residuals of the unfactored data.

For a singular P, (x - c)'W(x - c)/2 is added to the cost, W a diagonal weight, such
that P + W = L L' is definite:

5. c, the centre, moves to the solution and steps 2 to 4 are repeated. This is the
   proximal point method (Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898), exact
   after finitely many steps for a QP. Step 4 uses residuals without W, so that one or
   two centres suffice once the active set is right. If c diverges along a ray, the QP
   is unbounded.
"""

import numpy as np

from namlcp.compiled import floats, kernel, longs, part
from namlcp.limits import WATCH_SIZE, begin_watch
from namlcp.linalg import (
    add_scaled,
    copy,
    dot,
    forward_solve,
    largest_entry,
)
from namlcp.qp.dense.active_rows import (
    add_constraint,
    add_rows,
    is_late,
    refit,
    set_point,
)
from namlcp.qp.dense.refinement import refine_point, set_multipliers
from namlcp.qp.dense.rows import (
    is_contradiction,
    is_ray,
    most_violated,
    right_side,
    set_norms,
    set_row,
    spread_multipliers,
)
from namlcp.qp.dense.scaling import is_badly_scaled
from namlcp.qp.dense.state import lay_out, state_at
from namlcp.qp.dense.weights import LOWERED, choose_weight, has_factor, lower_weight
from namlcp.qp.responses import measure_result, set_products

SOLVED, INFEASIBLE, UNBOUNDED, NOT_CONVEX, STALLED, BADLY_SCALED, TIME_LIMIT = range(7)

# Pivots between two calls of `refit`, which removes accumulated rounding errors.
REFIT_AFTER = 32
# Violations relative to their terms up to which they count as rounding at first, for
# W = 0 and for W != 0: solving with a W much smaller than P makes x less accurate.
VIOLATION_ROUNDING, WEIGHTED_ROUNDING = 1e-14, 1e-12
# `level`, the violation that counts as rounding, grows tenfold after IDLE_PIVOTS pivots
# in a row on violations below NOISE * level; above MOST_ROUNDING the method gives up.
IDLE_PIVOTS, NOISE, MOST_ROUNDING = 10, 1e3, 1e-6
# (Rounds of steps 2 to 4, refinement passes in each) at most: for W != 0, each round
# with a new centre, and for W = 0, each with a larger `level`.
CENTRE_ROUNDS, LEVEL_ROUNDS = (20, 20), (4, 5)
# For W != 0, the relative residual of the KKT system up to which it counts as solved.
SETTLED = 1e-11
# Pivots at most for W != 0, per variable and row; the interior-point method is safer
# for a QP that needs more.
MOST_PIVOTS = 10


@kernel(error_model="numpy")
def solve(address, qp, guess, memory, numbers, clock):
    """Solve min 1/2 x'Px + q'x, Gx <= h, Ax = b, lb <= x <= ub; return a code.

    address: that of a `DualState` whose max_iter is set. qp: the tuple of P, q, G, h,
    A, b, lb, ub, all float64 and C-contiguous; absent parts have zero rows, absent
    bounds are infinite. guess = (start, hint): start, (n,) or empty, is a guess of x;
    hint (int64) lists inequalities that are probably active, numbered as in `rows`.
    memory: as much as `numbers_needed`; clock: see `Deadline.run`. numbers, 0 at first,
    becomes x, y, z, z_box and the numbers of `Residuals`.

    INFEASIBLE leaves a candidate for a Farkas certificate in y, z, z_box, UNBOUNDED one
    for a ray in z_box. Nothing is solved with NOT_CONVEX (P is not positive
    semidefinite) and BADLY_SCALED (the QP has to be scaled first, see `scaling`).
    """
    m = state_at(address)
    attach(m, qp, guess, numbers)
    lay_out(address, memory.ctypes.data)
    begin_watch(longs(m.watch, WATCH_SIZE), clock)
    m.k, m.pivots, m.idle = 0, 0, 0
    code = run_form(m, guess[0])
    set_products(m)
    measure_result(m)
    return code


@part
def attach(m, qp, guess, numbers):
    """Note where the problem, the hint and the result are."""
    P, q, G, h, A, b, lb, ub = qp
    m.n, m.m, m.p = q.size, h.size, b.size
    m.P, m.G, m.A = P.ctypes.data, G.ctypes.data, A.ctypes.data
    m.q, m.h, m.b = q.ctypes.data, h.ctypes.data, b.ctypes.data
    m.lb, m.ub = lb.ctypes.data, ub.ctypes.data
    m.hint, m.hints = guess[1].ctypes.data, guess[1].size
    m.out = numbers.ctypes.data
    m.x = m.out
    m.y = m.x + 8 * m.n
    m.z = m.y + 8 * m.p
    m.z_box = m.z + 8 * m.m


@part
def run_form(m, start):
    """Solve the QP with W = 0 if P is definite, else with the W that it needs.

    Returns the code.
    """
    if is_badly_scaled(floats(m.P, (m.n, m.n))):
        return BADLY_SCALED
    m.is_definite = has_factor(m)
    m.level = VIOLATION_ROUNDING
    if not m.is_definite:
        if not choose_weight(m):
            return NOT_CONVEX
        m.level = WEIGHTED_ROUNDING
        m.max_iter = min(m.max_iter, MOST_PIVOTS * (m.n + m.m + m.p))
    centre = floats(m.centre, m.n)
    for j in range(m.n):
        centre[j] = start[j] if start.size > 0 else 0.0
    if not begin(m):
        return INFEASIBLE
    return run_rounds(m)


@part
def begin(m):
    """Do step 1: the minimum, the equalities, and the inequalities of the hint.

    False if the equalities contradict each other.
    """
    minimise_cost(m)
    set_norms(m)
    for i in range(m.p):
        if not add_constraint(m, i):
            spread_multipliers(m, m.k + 1)
            return False
    if m.hints > 0:
        add_rows(m, longs(m.hint, m.hints))
        if m.is_definite:
            refit(m)
        else:
            copy(floats(m.centre, m.n), floats(m.x, m.n))
    return True


@part
def run_rounds(m):
    """Do steps 2 to 5, as often as needed; return the code.

    A relative violation counts as rounding up to `level` in the steps, up to `exact` in
    the solution.
    """
    x, point, centre = floats(m.x, m.n), floats(m.point, m.n), floats(m.centre, m.n)
    rounds, passes = LEVEL_ROUNDS if m.is_definite else CENTRE_ROUNDS
    exact = VIOLATION_ROUNDING
    for turn in range(rounds):
        # the hint of a singular QP is first tried as it is
        if m.is_definite or turn > 0 or m.hints == 0:
            if not add_violated(m):
                return INFEASIBLE
        copy(x, point)
        error = refine_point(m, passes)
        left = set_multipliers(m)
        if is_late(m, 0):
            return TIME_LIMIT
        if m.pivots >= m.max_iter or m.level > MOST_ROUNDING:
            return STALLED
        exact = 10.0 * (m.level if m.is_definite else exact)
        settled = m.is_definite or max(error, left) <= SETTLED
        if settled and most_violated(m, exact) < 0:
            return SOLVED
        if m.is_definite:
            m.level = exact
            refit(m)
        elif settled:
            m.level = exact
            copy(x, centre)
            minimise_cost(m)
            copy(centre, x)  # which the active rows fit, so that they need no refit
            set_u(m)
        else:
            if turn > 0 and moves_along_ray(m):
                return UNBOUNDED
            if 0 < turn <= LOWERED and not lower_weight(m):
                return STALLED
            exact = VIOLATION_ROUNDING
            copy(point, centre)
            minimise_cost(m)
            refit(m)
    return STALLED


@part
def add_violated(m):
    """Do steps 2 and 3; False if the active rows contradict each other.

    They also end where the pivots or the time are used up, and where `level` exceeds
    MOST_ROUNDING.
    """
    while (
        m.pivots < m.max_iter and m.level <= MOST_ROUNDING and not is_late(m, m.n * m.m)
    ):
        entering = most_violated(m, m.level)
        if entering < 0:
            break
        m.pivots += 1
        if m.pivots % REFIT_AFTER == 0:
            refit(m)
        is_noise = may_be_noise(m, entering)
        m.idle = m.idle + 1 if is_noise else 0
        if m.idle == IDLE_PIVOTS:
            m.level *= 10.0  # the violations are rounding
            m.idle = 0
        if not add_constraint(m, entering):
            if (m.is_definite or not is_noise) and is_contradiction(m):
                spread_multipliers(m, m.k + 1)
                return False
            m.level *= 10.0  # dependent rows that disagree by rounding
            refit(m)
    return True


@part
def may_be_noise(m, index):
    """Tell whether a violation is at most NOISE * level times the size of its terms."""
    row, x = floats(m.row, m.n), floats(m.x, m.n)
    set_row(m, index)
    d = right_side(m, index)
    size = abs(d) + np.sqrt(dot(row, row)) * largest_entry(x)
    return dot(row, x) - d <= NOISE * m.level * size


@part
def minimise_cost(m):
    """Set u0 = u = L^-1 (W c - q) and x = L^-T u, the unconstrained minimum."""
    q, weight, centre = floats(m.q, m.n), floats(m.weight, m.n), floats(m.centre, m.n)
    u0 = floats(m.u0, m.n)
    for j in range(m.n):
        u0[j] = weight[j] * centre[j] - q[j]
    forward_solve(floats(m.L, (m.n, m.n)), u0)
    copy(u0, floats(m.u, m.n))
    set_point(m)


@part
def set_u(m):
    """Set u = L'x."""
    L, x, u = floats(m.L, (m.n, m.n)), floats(m.x, m.n), floats(m.u, m.n)
    for j in range(m.n):
        u[j] = 0.0
    for i in range(m.n):
        add_scaled(x[i], L[i, : i + 1], u[: i + 1])


@part
def moves_along_ray(m):
    """Tell whether the solution leaves its centre along a ray; set z_box to that."""
    point, centre = floats(m.point, m.n), floats(m.centre, m.n)
    ray, z_box = floats(m.change, m.n), floats(m.z_box, m.n)
    for j in range(m.n):
        ray[j] = point[j] - centre[j]
    if not is_ray(m, ray):
        return False
    copy(ray, z_box)
    return True
