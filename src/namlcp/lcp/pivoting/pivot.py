"""Block principal pivoting inside a proximal-point loop: the compiled stage `pivot`.

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0). With
the others fixed, the free unknowns F solve the free system (A_FF + rho I) z_F = rhs.
Then the unknowns with a wrong sign change their states: all of them (Judice and Pires,
Computers Ops Res 21 (1994) 587-596), or only the last one (Murty 1974) when nothing
else makes progress; Murty's rule is finite for every P-matrix. The proximal-point loop
around it regularises singular systems by rho I and refines the solution of the others.
For symmetric A, once that stagnates, `line_search` shortens the steps.
"""

import numpy as np

from namlcp.compiled import kernel, part, pasted
from namlcp.lcp.pivoting.free_system import (
    INDEFINITE,
    REGULAR,
    analyse,
    free_order,
    refactor,
    solve_free,
)
from namlcp.lcp.pivoting.line_search import end_at, states_at, step_to
from namlcp.lcp.pivoting.work import opened
from namlcp.linalg import (
    PSD_SLACK,
    add_product,
    all_finite,
    copy,
    largest_entry,
    scale_columns,
    write_diagonal,
)
from namlcp.residuals import natural_residuals

# Why `pivot` returns.
GO_ON = -1  # never returned
DONE = 0  # solved
MORE = 1  # the budget of factorisations is used up
STAGNATED = 2  # no progress: the caller changes rho or the proximal point
FREE_SYSTEM = 3  # the caller solves the free system, rhs to z, and calls `resume`
RAY = 4  # the caller tests whether rhs proves that there is no solution
STUCK = 5  # w is not finite, or too many proximal steps

SWEEP_RELAXATION = 1.4
"""Relaxation parameter of the first sweeps."""

FIRST_SWEEPS, STILL_SWEEPS = 30, 3
"""First sweeps at most; sweeps in a row without a change of state that end them."""

BLOCK_STEPS, SEARCH_STEPS = 3, 100
"""Changes of states without fewer wrong signs until block pivoting counts as stagnated,
and changes of states with the line search until it is given up."""

LEAST_RHO, MOST_RHO = 1e-8, 1.0
"""Range of a positive rho, relative to the unit diagonal. With 1e-9 singular problems
end with smaller residuals, but many of full degeneracy stagnate before they end."""

OUTER_STEPS = 200
"""Proximal steps at most."""

EARLY_STEPS, FEW, SOME = 20, 64, 4
"""Proximal steps that may end early, while at most one sign in FEW is wrong and more
than SOME factorisations were made: see `may_end_early`."""

EXACT_RESIDUAL = 1e-15
"""Scaled Res, relative to its value at clip(0), below which no step is tried."""

START_MARGIN = 0.01
"""Part of the tolerances that a start must meet to be returned as it is: in a sequence
of slowly changing problems the errors of starts add up, to that part."""

RAY_ROUNDING = 1e-9
"""Entry of a ray, relative to the largest, that counts as 0."""


@part
def first_sweeps(work):
    """Sweep by projected SOR; update z, w = A z + q and state.

    An unknown that does not move costs no pass over its column.
    """
    dense, indptr, indices, data = work.scaled
    z, w, state, lower, upper = work.z, work.w, work.state, work.lower, work.upper
    still = 0
    for _ in range(FIRST_SWEEPS):
        still += 1
        for i in range(z.size):
            if work.has_unit[i]:
                t = min(max(z[i] - SWEEP_RELAXATION * w[i], lower[i]), upper[i])
                step = t - z[i]
                if step != 0.0:
                    z[i] = t
                    # Written out: a call costs more than the work on a sparse column.
                    if dense.shape[0] > 0:
                        for k in range(w.size):
                            w[k] += step * dense[i, k]
                    else:
                        for p in range(np.uint32(indptr[i]), np.uint32(indptr[i + 1])):
                            w[np.uint32(indices[p])] += step * data[p]
            found = state_of(z[i] - w[i], lower[i], upper[i])
            if found != state[i]:
                state[i] = found
                still = 0
        if still >= STILL_SWEEPS:
            break


@part
def state_of(s, lower, upper):
    """Return the state of an unknown with s = z - w."""
    return -1 if s <= lower else (1 if s >= upper else 0)


@part
def write_w(work, z, w):
    """Write w = A z + q of the scaled problem."""
    copy(work.q, w)
    add_product(work.scaled, z, w)


@part
def meets(now, scaled, plain, margin):
    """Tell whether residuals meet the tolerances times a margin."""
    return scaled <= margin * now.eps_rel * now.size or plain < margin * now.eps_abs


@part
def record(work):
    """Copy z to best if its Res is the least; return whether that fell to a quarter."""
    now = work.now
    scaled, plain = natural_residuals(work.z, work.w, work.lower, work.upper, work.d)
    improved = scaled < 0.25 * now.best_residual
    if scaled < now.best_residual:
        now.best_residual = scaled
        copy(work.z, work.best)
        now.solved = meets(now, scaled, plain, 1.0)
    return improved


@part
def clip_rounding(work):
    """Clip z if no free unknown is outside its bounds by more than the tolerance."""
    z, lower, upper = work.z, work.lower, work.upper
    tolerance = work.now.tolerance
    for i in range(z.size):
        if not lower[i] - tolerance <= z[i] <= upper[i] + tolerance:
            return
    for i in range(z.size):
        z[i] = min(max(z[i], lower[i]), upper[i])


@pasted
def set_goals(work):
    """Write to goal the states that the signs of z and w ask for; count the changes."""
    z, lower, upper = work.z, work.lower, work.upper
    state, goal = work.state, work.goal
    rho, tolerance = work.now.rho, work.now.tolerance
    wrong = 0
    for i in range(z.size):
        goal[i] = state[i]
        if state[i] == 0:
            if z[i] < lower[i] - tolerance:
                goal[i] = -1
            elif z[i] > upper[i] + tolerance:
                goal[i] = 1
        elif lower[i] < upper[i]:
            if state[i] * (work.w[i] + rho * (z[i] - work.centre[i])) > tolerance:
                goal[i] = 0
        wrong += goal[i] != state[i]
    return wrong


@part
def may_be_ray(work, v):
    """Tell whether q'v < 0 and v moves no unknown towards a finite bound."""
    least = RAY_ROUNDING * largest_entry(v)
    descent = 0.0
    for i in range(v.size):
        if (v[i] > least and work.upper[i] < np.inf) or (
            v[i] < -least and work.lower[i] > -np.inf
        ):
            return False
        descent += work.q[i] * v[i]
    return descent < 0.0


@part
def reset_patience(now, n, rho):
    """Forget the fewest wrong signs, and set rho."""
    now.fewest_wrong = n + 1
    now.patience = SEARCH_STEPS if now.line_search else BLOCK_STEPS
    if rho != now.rho:
        now.rho = rho
        now.must_factor = True


@pasted
def end_outer_step(work):
    """Move the proximal point to z, with the difference in rhs, and lower rho."""
    z, v, centre, now = work.z, work.rhs, work.centre, work.now
    improved = record(work)
    now.outer_steps += 1
    rho = now.rho
    exact = now.best_residual <= EXACT_RESIDUAL * now.size
    if now.solved and (exact or rho == 0.0 or not improved):
        return DONE
    if now.outer_steps >= OUTER_STEPS:
        return STUCK
    for i in range(z.size):
        v[i] = z[i] - centre[i]
        centre[i] = z[i]
    factor = 0.1 if now.line_search else 0.01
    reset_patience(now, z.size, max(factor * rho, LEAST_RHO))
    for i in range(z.size):  # where a line search starts
        work.x[i] = centre[i]
        work.s[i] = centre[i] - work.w[i] / now.rho
    # Steps 3, 6, 12, ...: later directions are more accurate, but every test costs.
    turn = now.outer_steps // 3
    due = now.outer_steps == 3 * turn and turn > 0 and turn & (turn - 1) == 0
    if due and rho > 0.0 and may_be_ray(work, v):
        return RAY
    return GO_ON


@part
def search(work):
    """Search on the way to the solution z of the free system; set goal if step < 1."""
    now, s_end, lower, upper = work.now, work.rhs, work.lower, work.upper
    end_at(work.z, work.centre, work.w, now.rho, work.state, s_end)
    if step_to(work.x, work.s, work.z, s_end, lower, upper) < 1.0:
        states_at(work.s, lower, upper, now.rho, now.tolerance, work.state, work.goal)


@pasted
def change_states(work, wrong, single):
    """Change states to goal: all, or if `single` and stagnated only the last one."""
    now, state, goal = work.now, work.state, work.goal
    first = 0
    if now.line_search and not now.not_p and now.patience > 0:
        now.patience -= 1
        search(work)
    elif wrong < now.fewest_wrong:
        now.fewest_wrong = wrong
        now.patience = BLOCK_STEPS
    elif now.patience > 0:
        now.patience -= 1
    elif single:
        first = state.size - 1
        while goal[first] == state[first]:
            first -= 1
    else:
        return STAGNATED
    for i in range(first, state.size):
        state[i] = goal[i]
    now.must_factor = True
    return GO_ON


@part
def may_end_early(now, wrong, n):
    """Tell whether an outer step of a symmetric A may end with one sign in FEW wrong.

    Solving the proximal problem exactly far from the solution wastes factorisations;
    the next proximal step uses the same factor unless rho changes.
    """
    early = now.symmetric and now.rho > 0.0 and now.factorisations > SOME
    falls = wrong < now.fewest_wrong and now.outer_steps < EARLY_STEPS
    return early and falls and not now.path_followed and FEW * wrong <= n


@pasted
def use_solution(work):
    """Change wrong states at the solution z, or end the outer step. Return a code."""
    z, now = work.z, work.now
    clip_rounding(work)
    write_w(work, z, work.w)
    if not all_finite(work.w):
        if now.rho > 0.0:
            return STUCK
        # The free system is singular: go on from the best point with rho > 0.
        copy(work.best, work.centre)
        reset_patience(now, z.size, LEAST_RHO)
        return GO_ON
    wrong = set_goals(work)
    if wrong == 0 or may_end_early(now, wrong, z.size):
        return end_outer_step(work)
    if now.solved:
        return DONE
    # For a symmetric A, a larger rho is tried before single states are changed.
    single = now.path_followed and (now.rho >= MOST_RHO or not now.symmetric)
    return change_states(work, wrong, single)


@part
def set_right_side(work):
    """Write the bounds of bounded unknowns to z, and the right-hand side to rhs."""
    z, rhs, state, rho = work.z, work.rhs, work.state, work.now.rho
    for i in range(z.size):
        z[i] = 0.0
        if state[i] != 0:
            z[i] = work.lower[i] if state[i] < 0 else work.upper[i]
    write_w(work, z, rhs)
    for i in range(z.size):
        rhs[i] = rho * work.centre[i] - rhs[i]


@part
def scale_problem(columns, work):
    """Scale the problem to a unit diagonal; write the scaled clip(z) to centre."""
    q, lower, upper, d = work.q, work.lower, work.upper, work.d
    write_diagonal(columns, d)
    for i in range(d.size):
        work.has_unit[i] = d[i] > 0.0
        d[i] = 1.0 / np.sqrt(d[i]) if d[i] > 0.0 else 1.0
        q[i] *= d[i]
        lower[i] /= d[i]
        upper[i] /= d[i]
        work.centre[i] = min(max(work.z[i] / d[i], lower[i]), upper[i])
    scale_columns(columns, d, work.scaled)


@pasted
def begin_pivoting(columns, work):
    """Scale the problem, measure clip(0), sweep from the user's z. Return a code."""
    z, w, centre, rhs, now = work.z, work.w, work.centre, work.rhs, work.now
    n = z.size
    scale_problem(columns, work)
    now.best_residual = np.inf
    # First z = clip(0), whose Res is the reference of eps_rel; then the start.
    for i in range(n):
        z[i] = min(max(0.0, work.lower[i]), work.upper[i])
    for start in range(2):
        write_w(work, z, w)
        record(work)
        if start == 0:
            now.size = now.best_residual
            copy(centre, z)
        if now.size == 0.0 or (now.solved and start == 0):
            return DONE
    if now.solved:
        scaled, plain = natural_residuals(z, w, work.lower, work.upper, work.d)
        if meets(now, scaled, plain, START_MARGIN):
            return DONE
    eps = 0.01 * now.eps_rel * now.size / np.sqrt(n)
    now.tolerance = max(1e-14 * largest_entry(work.q), eps)
    copy(z, centre)
    copy(w, rhs)
    before = now.best_residual
    first_sweeps(work)
    record(work)
    # On a nonsymmetric A the sweeps may diverge: discard them if Res did not fall.
    if now.best_residual == before and not now.symmetric:
        copy(centre, z)
        copy(rhs, w)
    for i in range(n):
        work.state[i] = state_of(z[i] - w[i], work.lower[i], work.upper[i])
        centre[i] = z[i]
    now.must_factor = True
    reset_patience(now, n, LEAST_RHO if now.symmetric else 0.0)
    return GO_ON


@part
def has_unit_diagonal(work):
    """Tell whether all a_ii > 0, which are 1 after scaling."""
    for i in range(work.has_unit.size):
        if not work.has_unit[i]:
            return False
    return True


@part
def is_definite(work):
    """Tell whether A + `PSD_SLACK` I is positive definite; False where an a_ii <= 0."""
    if not has_unit_diagonal(work):
        return False
    for i in range(work.state.size):
        work.state[i] = 0
        work.shift[i] = PSD_SLACK
    factor = analyse(work, free_order(work, work.state))
    return refactor(work, work.shift, factor) == REGULAR


@kernel(error_model="numpy")
def pivot(columns, arena, budget):
    """Begin or go on until solved, or for `budget` factorisations. Return a code.

    `columns` are those of the user's matrix. On the first call q, lower, upper hold the
    user's problem, z the start, and the scalars the tolerances and the properties of A.
    On return `best` is the best z of the scaled problem. With ask_convex, now.convex
    tells once the problem is solved whether `is_definite`: at one more factorisation,
    unless all unknowns were free in one of the others.
    """
    work = opened(arena)
    now, shift = work.now, work.shift
    code = GO_ON
    if not now.started:
        now.started = True
        code = begin_pivoting(columns, work)
    if now.external_solve and code != DONE:
        set_right_side(work)
        return FREE_SYSTEM
    while code == GO_ON and budget > 0:
        budget -= 1
        for i in range(shift.size):
            shift[i] = now.rho
        factor = analyse(work, free_order(work, work.state))
        found = refactor(work, shift, factor)
        now.not_p |= found == INDEFINITE
        whole = factor.order.size == shift.size
        if now.ask_convex and whole and now.rho <= PSD_SLACK:
            now.convex = found == REGULAR and has_unit_diagonal(work)
        now.factorisations += 1
        now.must_factor = False
        while code == GO_ON and not now.must_factor:
            set_right_side(work)
            solve_free(now.symmetric, factor, work.rhs, work.z)
            code = use_solution(work)
    if code == DONE and now.ask_convex and not now.convex:
        now.convex = is_definite(work)
    return MORE if code == GO_ON else code


@kernel(error_model="numpy")
def resume(arena):
    """Go on with the caller's solution of the free system in z. Return a code."""
    return use_solution(opened(arena))
