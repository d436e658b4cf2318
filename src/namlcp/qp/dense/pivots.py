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

from namlcp.compiled import kernel, part, pasted
from namlcp.limits import is_over, new_watch
from namlcp.linalg import (
    PSD_SLACK,
    ZERO,
    add_rmatvec,
    add_scaled,
    backward_solve,
    cholesky,
    copy,
    dot,
    forward_solve,
    largest_entry,
    matvec,
)
from namlcp.qp.dense.active_rows import add_constraint, add_rows, refit
from namlcp.qp.dense.rows import (
    LEAST_DIVISOR,
    contradicts,
    is_ray,
    most_violated,
    right_side,
    row_norms,
    set_row,
    spread_multipliers,
    typical_curvature,
)
from namlcp.qp.dense.scaling import is_badly_scaled
from namlcp.qp.dense.thinqr import triangular_solve, triangular_solve_transposed
from namlcp.residuals import qp_residuals_of_products

SOLVED, INFEASIBLE, UNBOUNDED, NOT_CONVEX, STALLED, BADLY_SCALED, TIME_LIMIT = range(7)

# Pivots between two calls of `refit`, which removes accumulated rounding errors.
REFIT_AFTER = 32
# Violations relative to their terms up to which they count as rounding at first, for
# W = 0 and for W != 0: solving with a W much smaller than P makes x less accurate.
VIOLATION_ROUNDING, WEIGHTED_ROUNDING = 1e-14, 1e-12
# `level`, the violation that counts as rounding, grows tenfold after IDLE_PIVOTS pivots
# in a row on violations below NOISE * level; above MOST_ROUNDING the method gives up.
IDLE_PIVOTS, NOISE, MOST_ROUNDING = 10, 1e3, 1e-6
# P counts as singular if a pivot is at most this multiple of the diagonal entry of P.
ZERO_PIVOT = 1e-13
# Entries of W, relative to the largest diagonal entry of P or to `typical_curvature` if
# that is larger; from the second centre on, W is multiplied by LOWERING with each new
# centre, LOWERED times at most.
WEIGHT, LOWERING, LOWERED = 1e-4, 0.1, 5
# (Rounds of steps 2 to 4, refinement passes in each) at most: for W != 0, each round
# with a new centre, and for W = 0, each with a larger `level`.
CENTRE_ROUNDS, LEVEL_ROUNDS = (20, 20), (4, 5)
# For W != 0, the relative residual of the KKT system up to which it counts as solved.
SETTLED = 1e-11
# Pivots at most for W != 0, per variable and row; the interior-point method is safer
# for a QP that needs more.
MOST_PIVOTS = 10


@part
def refine_point(active, multiplier, k, P, q, G, h, A, b, lb, ub, L, Q, R, x, passes):
    """Refine x (n,) and multiplier[:k] on the KKT system of the k active rows N.

    With the residuals rd, rp for P itself, [L L', N'; N, 0] [dx; dm] = -[rd; rp] is
    solved by g = L^-1 rd, R'(R dm + Q g) = rp, L'dx = -(g + Q'R dm). Ends where a pass
    does not halve the relative residual, or after `passes`; returns the least one.
    With W != 0 a pass is a step of the proximal point method on the active set.
    """
    n = x.size
    row, g, dx = np.empty(n), np.empty(n), np.empty(n)
    dm, trial = np.empty(k), np.empty(n)
    new_multiplier = np.empty(k)
    best = np.inf
    for _ in range(passes):
        copy(x, trial)
        for i in range(k):
            new_multiplier[i] = multiplier[i]
        if best < np.inf:
            add_scaled(1.0, dx, trial)
            add_scaled(1.0, dm, new_multiplier)
        matvec(P, trial, g)
        size = max(largest_entry(q), largest_entry(g))
        add_scaled(1.0, q, g)
        primal, primal_size = 0.0, largest_entry(trial)
        for i in range(k):
            set_row(active[i], G, A, row)
            add_scaled(new_multiplier[i], row, g)
            d = right_side(active[i], h, b, lb, ub)
            residual = dot(row, trial) - d
            dm[i] = residual
            primal = max(primal, abs(residual))
            primal_size = max(primal_size, abs(d))
        worst = max(
            largest_entry(g) / max(size, LEAST_DIVISOR),
            primal / max(primal_size, LEAST_DIVISOR),
        )
        if not worst < best:
            break
        copy(trial, x)
        copy(new_multiplier, multiplier)
        gained = worst <= 0.5 * best
        best = worst
        if not gained or worst == 0.0:
            break
        forward_solve(L, g)
        triangular_solve_transposed(R, k, dm)
        for i in range(k):
            dm[i] -= dot(Q[i], g)
        for j in range(n):
            dx[j] = -g[j]
        for i in range(k):
            add_scaled(-dm[i], Q[i], dx)
        triangular_solve(R, k, dm)
        backward_solve(L, dx)
    return best


@part
def set_multipliers(active, multiplier, k, P, q, G, A, lb, ub, x, y, z, z_box):
    """Set y, z, z_box from the active rows, and x to its active bounds exactly.

    The multipliers of active bounds follow from P x + q + G'z + A'y + z_box = 0; those
    of inequalities that have the wrong sign are set to 0. Returns the largest residual
    of this equation, relative to max(|q|, |P x|).
    """
    n, m, p = x.size, z.size, y.size
    spread_multipliers(active, multiplier, k, y, z, z_box)
    for i in range(m):
        z[i] = max(z[i], 0.0)
    for i in range(k):
        j = active[i] - p - m
        if j >= n:
            x[j - n] = ub[j - n]
        elif j >= 0:
            x[j] = lb[j]
    gradient = np.empty(n)
    matvec(P, x, gradient)
    size = max(largest_entry(q), largest_entry(gradient))
    add_scaled(1.0, q, gradient)
    add_rmatvec(A, y, gradient)
    add_rmatvec(G, z, gradient)
    for i in range(k):
        j = active[i] - p - m
        if j >= n:
            z_box[j - n] = max(-gradient[j - n], 0.0)
        elif j >= 0:
            z_box[j] = min(-gradient[j], 0.0)
    add_scaled(1.0, z_box, gradient)
    return largest_entry(gradient) / max(size, LEAST_DIVISOR)


@part
def minimise_cost(q, weight, centre, L, u0, u, x):
    """Set u0 = u = L^-1 (W centre - q) and x = L^-T u, the unconstrained minimum."""
    for j in range(q.size):
        u0[j] = weight[j] * centre[j] - q[j]
    forward_solve(L, u0)
    copy(u0, u)
    copy(u, x)
    backward_solve(L, x)


@part
def set_u(x, L, u):
    """Set u = L'x."""
    for j in range(x.size):
        u[j] = 0.0
    for i in range(x.size):
        add_scaled(x[i], L[i, : i + 1], u[: i + 1])


@part
def factor_sum(P, weight, L):
    """Set L L' = P + diag(weight); tell whether that is positive definite."""
    for i in range(P.shape[0]):
        copy(P[i], L[i])
        L[i, i] += weight[i]
    return cholesky(L) == 0


@part
def has_no_zero_pivot(P, L):
    """Tell whether no pivot of P = L L' counts as zero, see `ZERO_PIVOT`."""
    for j in range(P.shape[0]):
        if L[j, j] * L[j, j] <= ZERO_PIVOT * P[j, j]:
            return False
    return True


@part
def choose_weight(P, q, G, h, A, b, lb, ub, weight, L):
    """Set `weight` (n,) for a singular P, and L; False if P is not semidefinite.

    The first factorisation, shifted as in `convexity.check_convex`, decides that.
    """
    n = P.shape[0]
    most = 0.0
    for j in range(n):
        most = max(most, abs(P[j, j]))
    for j in range(n):
        weight[j] = PSD_SLACK * P[j, j] + (ZERO * most if most > 0.0 else 1.0)
    if not factor_sum(P, weight, L):
        return False
    scale = max(most, typical_curvature(q, G, h, A, b, lb, ub))
    if scale == 0.0:
        scale = 1.0
    for j in range(n):
        weight[j] = WEIGHT * scale
    return factor_sum(P, weight, L)


@part
def lower_weight(weight, active, multiplier, k, P, G, A, L, Q, R, watch):
    """Lower the weight and renew L, Q, R; return the number of active rows, or -1."""
    for j in range(weight.size):
        weight[j] *= LOWERING
    if not factor_sum(P, weight, L):
        return np.int64(-1)
    kept = active[:k].copy()
    return add_rows(kept, active, multiplier, np.int64(0), G, A, L, Q, R, watch)


@pasted
def run_pivots(
    P, q, G, h, A, b, lb, ub, L, weight, start, hint, x, y, z, z_box, max_iter, watch
):
    """Run steps 1 to 5 with P + diag(weight) = L L'; set x, y, z and z_box.

    The weight is zero for a definite P. Returns (code, pivots). INFEASIBLE leaves a
    candidate for a Farkas certificate in y, z, z_box, UNBOUNDED one for a ray in z_box.
    A relative violation counts as rounding up to `level` in the steps, up to `exact` in
    the solution.
    """
    n, m, p = q.size, h.size, b.size
    Q, R = np.empty((n, n)), np.empty((n, n))
    active, multiplier = np.empty(n + 1, dtype=np.int64), np.empty(n + 1)
    row, norms, u0, u = np.empty(n), np.ones(m), np.empty(n), np.empty(n)
    Gx, centre, point = np.empty(m), np.zeros(n), np.empty(n)
    definite = largest_entry(weight) == 0.0
    rounds, passes = LEVEL_ROUNDS if definite else CENTRE_ROUNDS
    level = VIOLATION_ROUNDING if definite else WEIGHTED_ROUNDING
    # np.int64, because a literal would compile every callee once more
    k, pivots, idle, exact = np.int64(0), 0, 0, VIOLATION_ROUNDING
    # Step 1: the minimum, the equalities, and the inequalities of a guess.
    copy(start, centre)
    minimise_cost(q, weight, centre, L, u0, u, x)
    matvec(G, x, Gx)
    if definite and p == 0:
        if most_violated(x, Gx, h, lb, ub, norms, level, p) < 0:
            refine_point(
                active, multiplier, k, P, q, G, h, A, b, lb, ub, L, Q, R, x, passes
            )
            set_multipliers(active, multiplier, k, P, q, G, A, lb, ub, x, y, z, z_box)
            return SOLVED, 0
    row_norms(G, norms)
    for i in range(p):
        k = add_constraint(
            i, A[i], b[i], active, multiplier, k, L, Q, R, u, x, p, level, watch
        )
        if k < 0:
            active[-1 - k] = i
            spread_multipliers(active, multiplier, -k, y, z, z_box)
            return INFEASIBLE, pivots
    if hint.size > 0:
        k = add_rows(hint, active, multiplier, k, G, A, L, Q, R, watch)
        if definite:
            k = refit(
                active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x, watch
            )
        else:
            copy(centre, x)
    for turn in range(rounds):
        # Steps 2 and 3; a hint for a singular P is first tried as it is, by step 4.
        while (
            pivots < max_iter
            and level <= MOST_ROUNDING
            and (definite or turn > 0 or hint.size == 0)
            and not is_over(watch, n * m)
        ):
            matvec(G, x, Gx)
            entering = most_violated(x, Gx, h, lb, ub, norms, level, p)
            if entering < 0:
                break
            pivots += 1
            if pivots % REFIT_AFTER == 0:
                k = refit(
                    active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x, watch
                )
            set_row(entering, G, A, row)
            d = right_side(entering, h, b, lb, ub)
            size = abs(d) + np.sqrt(dot(row, row)) * largest_entry(x)
            is_noise = dot(row, x) - d <= NOISE * level * size
            idle = idle + 1 if is_noise else 0
            if idle == IDLE_PIVOTS:
                level *= 10.0  # the violations are rounding
                idle = 0
            k = add_constraint(
                entering, row, d, active, multiplier, k, L, Q, R, u, x, p, level, watch
            )
            if k < 0:
                active[-1 - k] = entering
                if (definite or not is_noise) and contradicts(
                    active, multiplier, -k, h, b, lb, ub
                ):
                    spread_multipliers(active, multiplier, -k, y, z, z_box)
                    return INFEASIBLE, pivots
                level *= 10.0  # dependent rows that disagree by rounding
                k = refit(
                    active, multiplier, -1 - k, G, h, A, b, lb, ub, u0, L, Q, R, u, x,
                    watch,
                )  # fmt: skip
        # Step 4.
        copy(x, point)
        error = refine_point(
            active, multiplier, k, P, q, G, h, A, b, lb, ub, L, Q, R, x, passes
        )
        left = set_multipliers(
            active, multiplier, k, P, q, G, A, lb, ub, x, y, z, z_box
        )
        if is_over(watch, 0):
            return TIME_LIMIT, pivots
        if pivots >= max_iter or level > MOST_ROUNDING:
            return STALLED, pivots
        matvec(G, x, Gx)
        exact = 10.0 * (level if definite else exact)
        settled = definite or max(error, left) <= SETTLED
        if settled and most_violated(x, Gx, h, lb, ub, norms, exact, p) < 0:
            return SOLVED, pivots
        # Step 5, or step 2 again with a larger level.
        if definite:
            level = exact
        elif settled:  # x, as the centre, is the solution: no refit is needed
            copy(x, centre)
            minimise_cost(q, weight, centre, L, u0, u, x)
            copy(centre, x)
            set_u(x, L, u)
            level = exact
            continue
        else:
            copy(z_box, u)  # u is computed anew below
            for j in range(n):
                z_box[j] = point[j] - centre[j]
            if turn > 0 and is_ray(z_box, P, q, G, h, lb, ub, norms, row, Gx):
                return UNBOUNDED, pivots
            copy(u, z_box)
            if 0 < turn <= LOWERED:
                k = lower_weight(weight, active, multiplier, k, P, G, A, L, Q, R, watch)
                if k < 0:
                    return STALLED, pivots
            copy(point, centre)
            minimise_cost(q, weight, centre, L, u0, u, x)
            exact = VIOLATION_ROUNDING
        k = refit(active, multiplier, k, G, h, A, b, lb, ub, u0, L, Q, R, u, x, watch)
    return STALLED, pivots


@kernel(error_model="numpy")
def solve(P, q, G, h, A, b, lb, ub, start, hint, max_iter, address):
    """Solve min 1/2 x'Px + q'x, Gx <= h, Ax = b, lb <= x <= ub.

    All arrays are float64 and C-contiguous; absent parts have zero rows, absent bounds
    are infinite. start, (n,) or empty, is a guess of x; hint (int64) lists inequalities
    that are probably active, numbered as in `rows`; address: see `Deadline.run`.
    Returns (code, pivots, x, y, z, z_box, residuals), the last as in `Residuals`.
    Nothing is solved with NOT_CONVEX (P is not positive semidefinite) and BADLY_SCALED
    (the QP has to be scaled first, see `scaling`).
    """
    n, m, p = q.size, h.size, b.size
    x, y, z, z_box = np.zeros(n), np.zeros(p), np.zeros(m), np.zeros(n)
    L, weight = np.empty((n, n)), np.zeros(n)
    code, pivots = NOT_CONVEX, 0
    badly_scaled = is_badly_scaled(P)
    ready = not badly_scaled and factor_sum(P, weight, L) and has_no_zero_pivot(P, L)
    if badly_scaled:
        code = BADLY_SCALED
    elif not ready:
        ready = choose_weight(P, q, G, h, A, b, lb, ub, weight, L)
        max_iter = min(max_iter, MOST_PIVOTS * (n + m + p))
    if ready:
        code, pivots = run_pivots(
            P, q, G, h, A, b, lb, ub, L, weight, start, hint, x, y, z, z_box, max_iter,
            new_watch(address),
        )  # fmt: skip
    Px, Gx, Ax = np.empty(n), np.empty(m), np.empty(p)
    Gtz, Aty = np.zeros(n), np.zeros(n)
    matvec(P, x, Px)
    matvec(G, x, Gx)
    matvec(A, x, Ax)
    add_rmatvec(G, z, Gtz)
    add_rmatvec(A, y, Aty)
    residuals = qp_residuals_of_products(
        (q, h, b, lb, ub), (x, y, z, z_box), (Px, Gx, Ax, Gtz, Aty)
    )
    return code, pivots, x, y, z, z_box, residuals
