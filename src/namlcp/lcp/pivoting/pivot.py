"""Block principal pivoting inside a proximal-point loop: the compiled stage `pivot`.

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0). With
the others fixed, the free unknowns F solve the free system (A_FF + rho I) z_F = rhs.
Then the unknowns with a wrong sign change their states, all of them (Judice and Pires,
Computers Ops Res 21 (1994) 587-596); that may go round, and is then given up. The
proximal-point loop around it regularises singular systems by rho I and refines the
solution of the others.
"""

import numpy as np

from namlcp.compiled import floats, ints, kernel, part, pasted
from namlcp.lcp.criterion import are_met_part
from namlcp.lcp.pivoting.free_system import (
    analyse,
    free_order,
    has_unit_diagonal,
    is_definite,
    refactor,
    solve_free,
)
from namlcp.lcp.pivoting.state import bounds_of, matrix_of, state_at
from namlcp.linalg.columns import (
    add_product,
    all_finite,
    largest_entry,
    scale_columns,
    write_diagonal,
)
from namlcp.linalg.definite import PSD_SLACK
from namlcp.linalg.lapack import copy
from namlcp.residuals import natural_residuals

# Why `pivot` returns.
GO_ON = -1  # never returned
DONE = 0  # solved
MORE = 1  # the budget of factorisations is used up
HALTED = 2  # no progress, w is not finite, or too many proximal steps
FREE_SYSTEM = 3  # the caller solves the free system, rhs to z, and calls `resume`
RAY = 4  # the caller tests whether rhs proves that there is no solution

SWEEP_RELAXATION = 1.4
"""Relaxation parameter of the first sweeps."""

FIRST_SWEEPS, STILL_SWEEPS = 30, 3
"""First sweeps at most; sweeps in a row without a change of state that end them."""

BLOCK_STEPS = 3
"""Changes of states without fewer wrong signs until block pivoting is given up."""


RHO = 1e-8
"""The proximal parameter, relative to the unit diagonal. With 1e-9 singular problems
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
def first_sweeps(m):
    """Sweep by projected SOR; update z, w = A z + q and state.

    An unknown that does not move costs no pass over its column.
    """
    dense, indptr, indices, data = matrix_of(m, m.scaled)
    z, w, state = floats(m.z, m.n), floats(m.w, m.n), ints(m.state, m.n)
    lower, upper = bounds_of(m)
    has_unit = ints(m.has_unit, m.n)
    still = 0
    for _ in range(FIRST_SWEEPS):
        still += 1
        for i in range(m.n):
            if has_unit[i]:
                t = min(max(z[i] - SWEEP_RELAXATION * w[i], lower[i]), upper[i])
                step = t - z[i]
                if step != 0.0:
                    z[i] = t
                    # Written out: a call costs more than the work on a sparse column.
                    if dense.shape[0] > 0:
                        for k in range(m.n):
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
def write_w(m, z, w):
    copy(floats(m.q, m.n), w)
    add_product(matrix_of(m, m.scaled), z, w)


@part
def meets(m, scaled, plain, margin):
    """Tell whether residuals meet the tolerances times a margin."""
    return are_met_part(margin * m.eps_abs, margin * m.eps_rel, m.size, plain, scaled)


@part
def residuals_of(m, z):
    """Return Res(z) for w = A z + q, of the scaled problem and as given."""
    lower, upper = bounds_of(m)
    return natural_residuals(z, floats(m.w, m.n), lower, upper, floats(m.d, m.n))


@part
def record(m):
    """Copy z to best if its Res is the least; return whether that fell to a quarter."""
    scaled, plain = residuals_of(m, floats(m.z, m.n))
    improved = scaled < 0.25 * m.best_residual
    if scaled < m.best_residual:
        m.best_residual = scaled
        copy(floats(m.z, m.n), floats(m.best, m.n))
        m.solved = meets(m, scaled, plain, 1.0)
    return improved


@part
def clip_rounding(m):
    """Clip z if no free unknown is outside its bounds by more than the tolerance."""
    z, (lower, upper) = floats(m.z, m.n), bounds_of(m)
    tolerance = m.tolerance
    for i in range(m.n):
        if not lower[i] - tolerance <= z[i] <= upper[i] + tolerance:
            return
    for i in range(m.n):
        z[i] = min(max(z[i], lower[i]), upper[i])


@pasted
def set_goals(m):
    """Write to goal the states that the signs of z and w ask for; count the changes."""
    z, (lower, upper) = floats(m.z, m.n), bounds_of(m)
    w, centre = floats(m.w, m.n), floats(m.centre, m.n)
    state, goal = ints(m.state, m.n), ints(m.goal, m.n)
    rho, tolerance = m.rho, m.tolerance
    wrong = 0
    for i in range(m.n):
        goal[i] = state[i]
        if state[i] == 0:
            if z[i] < lower[i] - tolerance:
                goal[i] = -1
            elif z[i] > upper[i] + tolerance:
                goal[i] = 1
        elif lower[i] < upper[i]:
            if state[i] * (w[i] + rho * (z[i] - centre[i])) > tolerance:
                goal[i] = 0
        wrong += goal[i] != state[i]
    return wrong


@part
def may_be_ray(m, v):
    """Tell whether q'v < 0 and v moves no unknown towards a finite bound."""
    q, (lower, upper) = floats(m.q, m.n), bounds_of(m)
    least = RAY_ROUNDING * largest_entry(v)
    descent = 0.0
    for i in range(v.size):
        if (v[i] > least and upper[i] < np.inf) or (
            v[i] < -least and lower[i] > -np.inf
        ):
            return False
        descent += q[i] * v[i]
    return descent < 0.0


@part
def reset_patience(m, rho):
    """Forget the fewest wrong signs, and set rho."""
    m.fewest_wrong = m.n + 1
    m.patience = BLOCK_STEPS
    if rho != m.rho:
        m.rho = rho
        m.must_factor = True


@pasted
def end_outer_step(m):
    """Move the proximal point to z, with the difference in rhs."""
    z, v, centre = floats(m.z, m.n), floats(m.rhs, m.n), floats(m.centre, m.n)
    improved = record(m)
    m.outer_steps += 1
    rho = m.rho
    exact = m.best_residual <= EXACT_RESIDUAL * m.size
    if m.solved and (exact or rho == 0.0 or not improved):
        return DONE
    if m.outer_steps >= OUTER_STEPS:
        return HALTED
    for i in range(m.n):
        v[i] = z[i] - centre[i]
        centre[i] = z[i]
    reset_patience(m, RHO)
    # Steps 3, 6, 12, ...: later directions are more accurate, but every test costs.
    turn = m.outer_steps // 3
    due = m.outer_steps == 3 * turn and turn > 0 and turn & (turn - 1) == 0
    if due and rho > 0.0 and may_be_ray(m, v):
        return RAY
    return GO_ON


@part
def change_states(m, wrong):
    """Change all states to goal, or halt if the wrong signs do not get fewer."""
    state, goal = ints(m.state, m.n), ints(m.goal, m.n)
    if wrong < m.fewest_wrong:
        m.fewest_wrong = wrong
        m.patience = BLOCK_STEPS
    elif m.patience > 0:
        m.patience -= 1
    else:
        return HALTED
    copy(goal, state)
    m.must_factor = True
    return GO_ON


@part
def may_end_early(m, wrong):
    """Tell whether an outer step of a symmetric A may end with one sign in FEW wrong.

    Solving the proximal problem exactly far from the solution wastes factorisations;
    the next proximal step uses the same factor unless rho changes.
    """
    early = m.symmetric and m.rho > 0.0 and m.factorisations > SOME
    falls = wrong < m.fewest_wrong and m.outer_steps < EARLY_STEPS
    return early and falls and FEW * wrong <= m.n


@pasted
def use_solution(m):
    """Change wrong states at the solution z, or end the outer step. Return a code."""
    z, w = floats(m.z, m.n), floats(m.w, m.n)
    clip_rounding(m)
    write_w(m, z, w)
    if not all_finite(w):
        if m.rho > 0.0:
            return HALTED
        # The free system is singular: go on from the best point with rho > 0.
        copy(floats(m.best, m.n), floats(m.centre, m.n))
        reset_patience(m, RHO)
        return GO_ON
    wrong = set_goals(m)
    if wrong == 0 or may_end_early(m, wrong):
        return end_outer_step(m)
    if m.solved:
        return DONE
    return change_states(m, wrong)


@part
def set_right_side(m):
    """Write the bounds of bounded unknowns to z, and the right-hand side to rhs."""
    z, (lower, upper) = floats(m.z, m.n), bounds_of(m)
    rhs, centre, state = floats(m.rhs, m.n), floats(m.centre, m.n), ints(m.state, m.n)
    for i in range(m.n):
        z[i] = 0.0
        if state[i] != 0:
            z[i] = lower[i] if state[i] < 0 else upper[i]
    write_w(m, z, rhs)
    rho = m.rho
    for i in range(m.n):
        rhs[i] = rho * centre[i] - rhs[i]


@part
def scale_problem(m):
    """Scale the problem to a unit diagonal; write the scaled clip(z) to centre."""
    q, (lower, upper) = floats(m.q, m.n), bounds_of(m)
    z, centre, d = floats(m.z, m.n), floats(m.centre, m.n), floats(m.d, m.n)
    has_unit = ints(m.has_unit, m.n)
    unscaled = matrix_of(m, m.values)
    write_diagonal(unscaled, d)
    for i in range(m.n):
        has_unit[i] = d[i] > 0.0
        d[i] = 1.0 / np.sqrt(d[i]) if d[i] > 0.0 else 1.0
        q[i] *= d[i]
        lower[i] /= d[i]
        upper[i] /= d[i]
        centre[i] = min(max(z[i] / d[i], lower[i]), upper[i])
    scale_columns(unscaled, d, matrix_of(m, m.scaled))


@pasted
def begin_pivoting(m):
    """Scale the problem, measure clip(0), sweep from the user's z. Return a code."""
    z, w, (lower, upper) = floats(m.z, m.n), floats(m.w, m.n), bounds_of(m)
    centre, rhs, state = floats(m.centre, m.n), floats(m.rhs, m.n), ints(m.state, m.n)
    scale_problem(m)
    m.best_residual = np.inf
    # First z = clip(0), whose Res is the reference of eps_rel; then the start.
    for i in range(m.n):
        z[i] = min(max(0.0, lower[i]), upper[i])
    for start in range(2):
        write_w(m, z, w)
        record(m)
        if start == 0:
            m.size = m.best_residual
            copy(centre, z)
        if m.size == 0.0 or (m.solved and start == 0):
            return DONE
    if m.solved:
        scaled, plain = residuals_of(m, z)
        if meets(m, scaled, plain, START_MARGIN):
            return DONE
    eps = 0.01 * m.eps_rel * m.size / np.sqrt(m.n)
    m.tolerance = max(1e-14 * largest_entry(floats(m.q, m.n)), eps)
    copy(z, centre)
    copy(w, rhs)
    before = m.best_residual
    first_sweeps(m)
    record(m)
    # On a nonsymmetric A the sweeps may diverge: discard them if Res did not fall.
    if m.best_residual == before and not m.symmetric:
        copy(centre, z)
        copy(rhs, w)
    for i in range(m.n):
        state[i] = state_of(z[i] - w[i], lower[i], upper[i])
        centre[i] = z[i]
    m.must_factor = True
    reset_patience(m, RHO if m.symmetric else 0.0)
    return GO_ON


@kernel(error_model="numpy")
def pivot(address, budget):
    """Begin or go on until solved, or for `budget` factorisations. Return a code.

    address: that of a `PivotState` with its vectors in place, the tolerances and the
    properties of A; at first q, lower, upper are the user's, z is the start. On return
    `best` is the best z of the scaled problem. With ask_convex, m.convex tells once the
    problem is solved whether `is_definite`: at one more factorisation, of what the
    others have not shown to be so.
    """
    m = state_at(address)
    state, shift = ints(m.state, m.n), floats(m.shift, m.n)
    rhs, z = floats(m.rhs, m.n), floats(m.z, m.n)
    code, is_free_definite = GO_ON, False
    if not m.started:
        m.started = True
        code = begin_pivoting(m)
    if m.external_solve and code != DONE:
        set_right_side(m)
        return FREE_SYSTEM
    while code == GO_ON and budget > 0:
        budget -= 1
        for i in range(m.n):
            shift[i] = m.rho
        factor = analyse(m, free_order(m, state))
        is_free_definite = refactor(m, shift, factor) and m.rho <= PSD_SLACK
        whole = factor.order.size == m.n
        if m.ask_convex and whole and m.rho <= PSD_SLACK:
            m.convex = is_free_definite and has_unit_diagonal(m)
        m.factorisations += 1
        m.must_factor = False
        while code == GO_ON and not m.must_factor:
            set_right_side(m)
            solve_free(m.symmetric, factor, rhs, z)
            code = use_solution(m)
    if code == DONE and m.ask_convex and not m.convex:
        m.convex = is_definite(m, is_free_definite)
    return MORE if code == GO_ON else code


@kernel(error_model="numpy")
def resume(address):
    """Go on with the caller's solution of the free system in z. Return a code."""
    return use_solution(state_at(address))
