"""The loop of a regularised primal-dual interior-point method.

The iterates follow the central path W Z = mu, W the slacks and Z the multipliers of the
one-sided constraints, for a positive semidefinite P and any rows. Each iteration
factors one quasi-definite KKT matrix and makes Mehrotra's predictor and corrector
(SIAM J. Optim. 2, 1992), one corrector of Gondzio (Comput. Optim. Appl. 6, 1996), and
steps of separate length. An active-set refinement is tried near the solution; the judge
measures candidates on unscaled data and keeps the best.

A warm start that stagnates is followed by a cold start, a cold start that stagnates by
one whose mu falls more slowly (`restart`).
"""

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.linalg.sparse_ldl import as_array
from cython.cimports.namlcp.linalg.vectors import copy, fill
from cython.cimports.namlcp.qp.interior.active_set import refine
from cython.cimports.namlcp.qp.interior.certificates import find_proof
from cython.cimports.namlcp.qp.interior.look import (
    ACTIVE_SET,
    DOUBT,
    JUDGE,
    PROMISING,
    PROVE,
    REPORT,
    STOP,
    look,
)
from cython.cimports.namlcp.qp.interior.newton import (
    DELTA,
    POOR,
    RHO,
    factor,
    regularise,
    solve,
    strengthen,
)
from cython.cimports.namlcp.qp.interior.state import EXACT, attach, offer
from cython.cimports.namlcp.qp.interior.steps import (
    aim_at_centre,
    aim_at_longer_step,
    assemble,
    evaluate,
    move,
    prepare_start,
    set_right_side,
    set_step,
    start_inside,
)
from cython.cimports.namlcp.watch import look_at_clock, raise_kept

from namlcp.status import Status

# MOST_RESTARTS: most of them after cold starts. LIFT: the least target of W'Z, relative
# to the gap, then. TOLERABLE: primal residual over its tolerance up to which a restart
# relaxes right-hand sides.
LIFT, TOLERABLE = 0.01, 0.5
# Where an iterate meets the tolerances here and only its gap is refused by the judge,
# as terms of the gap cancel in the user's sum, the least target of W'Z falls to the
# part CLOSER of what it was, and at most to LEAST; the loop ends with MOST_REFUSED.
CLOSER, LEAST = 0.1, 1e-8
# Slacks and multipliers of a warm start are at least INSIDE times the largest one, or
# times LEAST_SLACK and LEAST_MULTIPLIER if these are larger.
INSIDE, LEAST_SLACK, LEAST_MULTIPLIER = 1e-2, 1.0, 1e-3
# Gondzio's corrector is tried if the sum of the primal and the dual step is below the
# first, and kept if the sum grows by the second.
LONG, GAIN = 1.8, 0.02
# PATIENCE, WARM_PATIENCE: iterations without halving the worst residual before a
# restart, after a cold start and after a warm one. FACTORISATIONS: those tried for one
# step, each with more regularisation.


def run(m: Interior, guess):
    """Iterate until solved, proved impossible, or out of iterations or time.

    Returns the status; the judge has the point or the certificate.
    """
    status = iterate(m, guess)
    if status is not Status.SOLVED and m.best < INFINITY:
        offer(m, m.best_x)
    return status


def try_guess(m: Interior, guess):
    """Try the active set of a guess; tell whether it solves the QP."""
    scaled = m.problem.guess(m.problem.small.guess(guess))
    as_array(m.start, m.length)[:] = np.concatenate(scaled)
    refine(m)
    raise_kept(m)
    return m.judge.is_solved


def iterate(m, guess):
    """Run the loop; return the status."""
    if is_late(m):  # before the first factorisation
        return Status.TIME_LIMIT
    for k in range(4):
        m.tested[k] = PROMISING
    m.reports, m.doubts = m.limits.report is not None, m.judge.doubt is not None
    m.is_warm = guess.x.size > 0 and start_warm(m, guess)
    while True:
        with cython.nogil:
            begin(m)
            goes_on: cython.bint = m.is_warm or start(m)
        while goes_on:
            with cython.nogil:
                old_mu = m.mu
                evaluate(m)
                if m.iterations > 0:
                    regularise(m, old_mu)
                wants = look(m)
            if wants:
                verdict = answer(m, wants)
                raise_kept(m)
                if verdict is not None:
                    return verdict
            if wants & STOP:
                break
            with cython.nogil:
                goes_on = step(m)
        raise_kept(m)
        if m.iterations == m.max_iter:
            return Status.MAX_ITER
        if m.over:
            return Status.TIME_LIMIT
        if not goes_on and m.iterations == 0:
            return Status.NUMERICAL_ERROR
        if not restart(m):
            return Status.STALLED
        m.iterations += 1


def answer(m, wants):
    """Do what the iterate needs; return the status if that ends the loop."""
    if wants & REPORT:
        count = int(as_array(m.active, m.m).sum())
        length = min(m.step.primal, m.step.dual)
        m.limits.report(m.iterations, m.primal, m.dual, m.gap, length, count)
    # A refinement mostly succeeds: where it is due, an iterate is measured before it
    # only if that would end the loop.
    solved: cython.bint = False
    measured: cython.bint = not wants & JUDGE
    if not measured and (m.worst <= 1.0 or not wants & ACTIVE_SET):
        solved, measured = offer(m, m.x) <= 1.0, True
        if solved and m.tol > EXACT:
            return Status.SOLVED
        if m.worst <= 1.0 and not solved and m.judge.misses_gap():
            m.least_target = max(CLOSER * m.least_target, LEAST)
            m.refused += 1
    if solved or wants & ACTIVE_SET:
        copy(m.x, m.start, m.length)
        refine(m)
        if not measured and not m.judge.is_solved:
            offer(m, m.x)
    if m.judge.is_solved:
        return Status.SOLVED
    verdict = find_proof(m) if wants & PROVE else None
    if verdict is None and wants & DOUBT:
        m.doubts = False
        if m.judge.is_disproved():
            return Status.PRIMAL_INFEASIBLE
    if verdict is None and m.iterations < m.max_iter and is_late(m):
        return Status.TIME_LIMIT
    if verdict is None and m.refused >= MOST_REFUSED:
        return Status.STALLED
    return verdict


# ---- an iteration


def begin(m):
    """Forget how earlier iterates converged, and start with much regularisation."""
    m.since_halved, m.reference, m.last_refined = 0, INFINITY, INFINITY
    # no residual is stuck before there is one to compare it with
    m.old_primal = m.old_primal_norm = m.old_dual_norm = INFINITY
    m.krylov_pays, m.attained = True, 0.0
    m.patience = WARM_PATIENCE if m.is_warm else PATIENCE
    m.rho, m.delta, m.wait = RHO, DELTA, 0


def start(m):
    """Set the first point; False if K~ has no factors."""
    prepare_start(m)
    assemble(m)
    if not factor(m):
        return False
    find_step(m)
    start_inside(m)
    return True


def step(m):
    """Make a step; False if K~ has no good factors."""
    if not predict(m):
        return False
    error = m.step.error
    if m.m > 0:
        correct(m)
    m.step.error = max(m.step.error, error)
    move(m)
    m.iterations += 1
    return True


def predict(m):
    """Make Mehrotra's predictor, the step for W Z + W dZ + Z dW = 0."""
    for _ in range(FACTORISATIONS):
        assemble(m)
        m.step.error = INFINITY
        if factor(m):
            for k in range(m.m):
                m.rc[k] = -m.W[k] * m.Z[k]
            find_step(m)
            if m.step.error <= POOR:
                return True
        strengthen(m)
    return m.step.error < INFINITY


def find_step(m):
    """Solve the Newton system for the target."""
    set_right_side(m)
    solve(m)
    set_step(m)


def correct(m):
    """Make his corrector, then Gondzio's where the steps are short."""
    aim_at_centre(m)
    find_step(m)
    if m.step.primal + m.step.dual < LONG:
        aim_at_longer_step(m)
        m.step, m.other = m.other, m.step
        find_step(m)
        longer = m.step.primal + m.step.dual
        if not longer >= m.other.primal + m.other.dual + GAIN:
            m.step, m.other = m.other, m.step


# ---- in Python: the judge, the clock, other starts


def is_late(m):
    """Tell whether the time is over; raise what a signal's handler raised."""
    look_at_clock(m)
    raise_kept(m)
    return m.over


def restart(m):
    """Prepare a cold start with mu kept large; False after MOST_RESTARTS of them.

    If the best point violates the constraints within TOLERABLE, right-hand sides are
    relaxed to it: where dependent rows contradict each other by rounding errors, y
    diverges. After a warm start the first cold one is as any other.
    """
    if m.is_warm:
        m.is_warm = False
        return True
    if m.restarts == MOST_RESTARTS or m.m == 0:
        return False
    m.restarts += 1
    m.lift = LIFT
    offer(m, m.best_x)
    copy(m.best_x, m.x, m.length)
    m.problem.scale_vectors()  # undo an earlier relaxation
    attach(m)
    evaluate(m)
    m.best = INFINITY
    if m.primal_ratio <= TOLERABLE:
        m.problem.relax(as_array(m.t, m.size))
    attach(m)
    return True


def start_warm(m, guess):
    """Start from a guess, moved inside; False if it has no multipliers."""
    if not (guess.z.any() or guess.z_box.any()):
        return False
    x, y, W, Z = m.point
    x[:], y[:], Z[:], _ = m.problem.guess(m.problem.small.guess(guess))
    fill(m.W, 0.0, m.m)
    evaluate(m)
    m.best = INFINITY
    slack = -as_array(m.rw, m.m)
    most = np.abs(slack).max(initial=LEAST_SLACK)
    W[:] = np.maximum(slack, INSIDE * most)
    Z[:] = np.maximum(Z, INSIDE * Z.max(initial=LEAST_MULTIPLIER))
    return True
