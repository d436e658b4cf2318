"""The compiled loop: it runs until an iterate needs the caller; m is the record.

`advance` goes from stage to stage. One iteration is

1. EVALUATE: residuals, regularisation, and a `look` at what they ask for,
2. STEP: assemble and factor K~,
3. FACTORED, PREDICTED: Mehrotra's predictor, the step towards W Z = 0,
4. CORRECTED: his corrector, towards W Z = sigma mu,
5. CENTRED: Gondzio's corrector, where the steps are short,
6. the move, and EVALUATE again.

FACTOR and SOLVE lie between them and are the only places where K~ is factored and
solved with: by this function, or by the caller, to whom it returns FACTOR or SOLVE
where `is_external`. REFINE and KRYLOV improve a solution; it returns KRYLOV for each
step of that, so that only those who need it wait for its compilation. It returns LOOK
where an iterate has `wants`, READY when it has done what it was asked for alone, FAILED
when no factorisation succeeds.
"""

import numpy as np

from namlcp.compiled import floats_at, ints_at, kernel, part, record_of
from namlcp.qp.path.active_set import choose_next_set, correct_set, hold, is_set_solved
from namlcp.qp.path.newton import (
    begin_solve,
    is_factored,
    is_refined,
    keep_factored,
)
from namlcp.qp.path.regularisation import (
    POOR,
    is_full_step,
    regularise,
    strengthen,
)
from namlcp.qp.path.steps import (
    WIDTH,
    aim_at_centre,
    aim_at_longer_step,
    aim_at_zero,
    assemble,
    evaluate,
    exchange_steps,
    move,
    multiply,
    prepare_start,
    set_right_side,
    set_step,
    start_inside,
)

# Stages of the loop, and of the linear systems in it.
START, FIRST_FACTORED, FIRST_SOLVED, EVALUATE, STEP = range(5)
FACTORED, PREDICTED, CORRECTED, CENTRED = range(5, 9)
FACTOR, KEEP_FACTORED, SOLVE, REFINE, KRYLOV = range(10, 15)
# Stages that the caller asks for alone: the residuals, products, an active-set system.
MEASURE, PRODUCTS, HOLD, HELD, PROXIMAL, CORRECT = range(20, 26)
# Why `advance` returns, beside FACTOR and SOLVE.
LOOK, READY, FAILED = range(30, 33)
# What an iterate may need: to be reported, measured on unscaled data, refined with its
# active set, tested for a certificate; the end of the loop, or a look at the clock.
REPORT, JUDGE, ACTIVE_SET, PROVE, STOP, CLOCK = (1 << k for k in range(6))
# Gap over its tolerance up to which an iterate with small primal and dual residuals is
# worth measuring on unscaled data, where the sums of the gap round differently.
CLOSE = 1e3
# Relative residual after refinement above which GMRES is tried.
GMRES_ABOVE = 1e-6
# Gondzio's corrector is tried if the sum of the primal and the dual step is below the
# first, and kept if the sum grows by the second.
LONG, GAIN = 1.8, 0.02
# Factorisations tried for one step, each with more regularisation.
FACTORISATIONS = 3
# An active-set refinement needs a worst residual, or a mean of W Z, below these.
NEAR, NEAR_MU = 1e-2, 1e-7
# Worst residual over its tolerance from which on a refinement needs an active set that
# did not change in the last iteration.
STEADY = 100.0
# A residual converges if an iteration reduces it to this part: then there is no test
# for a certificate.
CONVERGING = 0.25
# Relative residual of a candidate for a certificate up to which it is promising, and up
# to which it is tested. Between these, it is tested where it fell to the part AGAIN of
# that at the last test.
PROMISING, SMALL_RATIO, AGAIN = 0.1, 1e-4, 0.1
# An iteration counts IDLE times in the patience if a step of full length leaves more
# than the part STUCK of a large primal residual: the next steps will do no better.
IDLE, STUCK = 20, 0.99
# Operations between two looks at the clock: some hundredths of a second.
OPERATIONS = 1e8


@kernel(error_model="numpy")
def advance(state):
    """Run the stage of the record state[0], and those after it; see the module."""
    m = record_of(state)
    while True:
        stage = m.stage
        if stage == FACTOR:
            m.is_factored = is_factored(m)
            if not m.is_factored:
                m.stage = KEEP_FACTORED
                return FACTOR
            m.stage = m.after
        elif stage == KEEP_FACTORED:
            keep_factored(m)
            m.stage = m.after
        elif stage == SOLVE:
            m.stage = m.after
            return SOLVE
        elif stage == REFINE:
            m.stage, m.after = SOLVE, REFINE
            if is_refined(m):
                m.stage = m.then
                if m.krylov_pays and not m.error <= GMRES_ABOVE:
                    m.stage, m.krylov_step = KRYLOV, -1
        elif stage == KRYLOV:
            return KRYLOV
        elif stage == START:
            prepare_start(m)
            assemble(m)
            m.stage, m.after = FACTOR, FIRST_FACTORED
        elif stage == FIRST_FACTORED:
            if not m.is_factored:
                return FAILED
            solve(m, FIRST_SOLVED)
        elif stage == FIRST_SOLVED:
            set_step(m)
            start_inside(m)
            m.stage = EVALUATE
        elif stage == EVALUATE:
            old_mu = m.mu
            evaluate(m)
            if m.iterations > 0:
                regularise(m, old_mu)
            m.stage = STEP
            m.attempts = 0
            if look(m) != 0:
                return LOOK
        elif stage == STEP:
            assemble(m)
            m.stage, m.after = FACTOR, FACTORED
        elif stage == FACTORED:
            m.attempts += 1
            if m.is_factored:
                aim_at_zero(m)
                solve(m, PREDICTED)
            else:
                m.error = np.inf
                strengthen(m)
                if m.attempts == FACTORISATIONS:
                    return FAILED
                m.stage = STEP
        elif stage == PREDICTED:
            set_step(m)
            m.predicted_error = m.error
            if not m.error <= POOR:
                strengthen(m)
                if m.attempts < FACTORISATIONS:
                    m.stage = STEP
                    continue
                if not m.error < np.inf:
                    return FAILED
            if m.m > 0:
                aim_at_centre(m)
                solve(m, CORRECTED)
            else:
                end_step(m)
        elif stage == CORRECTED:
            set_step(m)
            if m.primal_step + m.dual_step < LONG:
                aim_at_longer_step(m)
                exchange_steps(m)
                solve(m, CENTRED)
            else:
                end_step(m)
        elif stage == CENTRED:
            set_step(m)
            longer = m.primal_step + m.dual_step
            if not longer >= m.other_primal_step + m.other_dual_step + GAIN:
                exchange_steps(m)
            end_step(m)
        elif stage == HOLD:
            hold(m)
            m.stage, m.after = FACTOR, HELD
        elif stage == HELD:
            m.converged = False
            if not m.is_factored:
                return READY
            m.stage = PROXIMAL
        elif stage == PROXIMAL:
            if is_set_solved(m):
                choose_next_set(m)
                return READY
            m.stage, m.after = SOLVE, CORRECT
        elif stage == CORRECT:
            correct_set(m)
            m.stage = PROXIMAL
        elif stage == MEASURE:
            evaluate(m)
            return READY
        elif stage == PRODUCTS:
            n, size = m.n, m.size
            x, v = floats_at(m.set_x, n), floats_at(m.set_v, size)
            Px, Ctv = floats_at(m.Pdx, n), floats_at(m.Ctdv, n)
            multiply(m, x, v, Px, Ctv, floats_at(m.dv, size))
            return READY
        else:  # READY
            return stage


@part
def solve(m, then):
    """Set up the Newton system of the target, to be solved before the stage `then`."""
    set_right_side(m)
    begin_solve(m)
    m.stage, m.after, m.then = SOLVE, REFINE, then


@part
def end_step(m):
    """Move by the step; the next stage is EVALUATE."""
    m.error = max(m.error, m.predicted_error)
    move(m)
    m.iterations += 1
    m.stage = EVALUATE


@part
def look(m):
    """Set `wants` to what the iterate needs of the caller; return it."""
    wants = REPORT if m.reports else 0
    if m.worst <= CLOSE and max(m.primal_ratio, m.dual_ratio) <= 1.0:
        wants |= JUDGE
    same = mark_active(m)
    near = m.tol * m.worst < NEAR or m.mu < NEAR_MU
    if near and m.worst <= m.drop * m.last_refined and (m.worst < STEADY or same):
        m.last_refined = m.worst
        wants |= ACTIVE_SET
    if promises(m):
        wants |= PROVE
    is_stuck = m.primal_ratio > CLOSE and m.primal > STUCK * m.old_primal
    m.since += IDLE if is_stuck and is_full_step(m) else 1
    m.old_primal = m.primal
    if m.worst <= 0.5 * m.reference:
        m.reference, m.since = m.worst, 0
    stagnates = m.since > m.patience or not m.worst < np.inf
    if stagnates or m.iterations >= m.max_iter:
        wants |= STOP
    m.operations += m.iteration_work
    if m.operations >= OPERATIONS:
        wants |= CLOCK
    m.wants = wants
    return wants


@part
def mark_active(m):
    """Mark the constraints with Z > W; tell whether they are those of last time."""
    m.active, m.was_active = m.was_active, m.active
    active, was_active = ints_at(m.active, m.m), ints_at(m.was_active, m.m)
    W, Z = floats_at(m.W, m.m), floats_at(m.Z, m.m)
    same = True
    for k in range(m.m):
        active[k] = Z[k] > W[k]
        if active[k] != was_active[k]:
            same = False
    return same


@part
def promises(m):
    """Set the ratios of the candidates for certificates; tell whether one is tested.

    In an infeasible (unbounded) problem the primal (dual) residual cannot vanish. While
    it is within the tolerance or falls to a quarter, no candidate is tested.
    """
    dual_norm, primal_norm = m.dual_norm, max(m.row_norm, m.slack_norm)
    m.dual_stuck = dual_norm > CONVERGING * m.old_dual_norm and m.dual > m.tol
    m.primal_stuck = primal_norm > CONVERGING * m.old_primal_norm and m.primal > m.tol
    m.old_dual_norm, m.old_primal_norm = dual_norm, primal_norm
    if not (m.primal_stuck or m.dual_stuck):
        return False
    n, p, size = m.n, m.p, m.size
    du, dy = floats_at(m.du, size), floats_at(m.du + WIDTH * n, p)
    dZ, dv, dt = floats_at(m.dZ, m.m), floats_at(m.dv, size), floats_at(m.dt, size)
    Pdx, Ctdv = floats_at(m.Pdx, n), floats_at(m.Ctdv, n)
    place, sign = ints_at(m.place, m.m), floats_at(m.sign, m.m)
    for j in range(size):
        dv[j] = 0.0
    for i in range(p):
        dv[n + i] = dy[i]
    for k in range(m.m):
        dv[place[k]] += sign[k] * max(dZ[k], 0.0)
    multiply(m, du, dv, Pdx, Ctdv, dt)
    x, largest = floats_at(m.x, n), 1.0
    for j in range(n):
        largest = max(largest, abs(x[j]))
    y, Z = floats_at(m.y, p), floats_at(m.Z, m.m)
    v, t = floats_at(m.v, size), floats_at(m.t, size)
    ratios = floats_at(m.ratios, 4)
    ratios[0] = farkas_ratio(m, y, Z, v, floats_at(m.Ctv, n), largest)
    ratios[1] = farkas_ratio(m, dy, dZ, dv, Ctdv, largest)
    ratios[2] = ray_ratio(m, x, floats_at(m.Px, n), t)
    ratios[3] = ray_ratio(m, du, Pdx, dt)
    tested, found = floats_at(m.tested, 4), False
    for k in range(4):
        stuck = m.primal_stuck if k < 2 else m.dual_stuck
        if not stuck or not ratios[k] <= PROMISING:
            ratios[k] = np.inf
            continue
        if ratios[k] <= SMALL_RATIO or ratios[k] <= AGAIN * tested[k]:
            found = True
    return found


@part
def farkas_ratio(m, y, Z, v, Ctv, size):
    """Return min(|r| |x| / -value, |r| / |multipliers|), inf if value >= 0."""
    b, c = floats_at(m.b, m.p), floats_at(m.c, m.m)
    value, most = 0.0, 0.0
    for i in range(m.p):
        value += b[i] * y[i]
        most = max(most, abs(y[i]))
    for k in range(m.m):
        value += c[k] * max(Z[k], 0.0)
        most = max(most, Z[k])
    if not value < 0.0:
        return np.inf
    residual = 0.0
    for j in range(m.n):
        residual = max(residual, abs(Ctv[j] + v[j]))
    return min(residual * size / -value, residual / most)


@part
def ray_ratio(m, d, Pd, t):
    """Return max(|P d|, |A d|, (C d)+) / |d|, inf if q'd >= 0."""
    q, place, sign = floats_at(m.q, m.n), ints_at(m.place, m.m), floats_at(m.sign, m.m)
    value, most, residual = 0.0, 0.0, 0.0
    for j in range(m.n):
        value += q[j] * d[j]
        most = max(most, abs(d[j]))
        residual = max(residual, abs(Pd[j]))
    if not value < 0.0:
        return np.inf
    for i in range(m.n, m.n + m.p):
        residual = max(residual, abs(t[i]))
    for k in range(m.m):
        residual = max(residual, sign[k] * t[place[k]])
    return residual / most
