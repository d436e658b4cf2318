"""A regularised primal-dual interior-point method: presolve, scale, iterate, map back.

The iterates follow the central path W Z = mu, W the slacks and Z the multipliers of the
one-sided constraints, for a positive semidefinite P and any rows. Each iteration
factors one quasi-definite KKT matrix and makes Mehrotra's predictor and corrector
(SIAM J. Optim. 2, 1992), one corrector of Gondzio (Comput. Optim. Appl. 6, 1996), and
steps of separate length.

What an iterate needs, as `look` says: REPORT: to be reported; JUDGE: measured on
unscaled data; ACTIVE_SET: refined with its active set; PROVE: tested for a certificate;
CLOCK: the time to be looked at; STOP: the end of the loop; DOUBT: the least shifts to
be asked, once, whether there is a feasible point.
"""

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY

from namlcp.checks import as_sparse
from namlcp.limits import PASS
from namlcp.qp.certificates import alone
from namlcp.qp.kkt import ScaledQP
from namlcp.qp.reductions import presolve
from namlcp.status import Status

# MOST_RESTARTS: most of them after cold starts. LIFT: the least target of W'Z, relative
# to the gap, then. TOLERABLE: primal residual over its tolerance up to which a restart
# relaxes right-hand sides, twice at most.
LIFT, TOLERABLE = 0.01, 0.5
# Where an iterate meets the tolerances and the judge refuses it, as terms of the gap
# cancel in the user's sum, the least target of W'Z falls to the part CLOSER, and at
# most to LEAST; the loop ends after MOST_REFUSED of them.
CLOSER, LEAST = 0.1, 1e-8
# Slacks and multipliers of a warm start are at least INSIDE times the largest one, or
# times LEAST_SLACK and LEAST_MULTIPLIER if these are larger.
INSIDE, LEAST_SLACK, LEAST_MULTIPLIER = 1e-2, 1.0, 1e-3
# PATIENCE, WARM_PATIENCE: iterations without halving the worst residual before a
# restart, after a cold start and after a warm one.
# Gap over its tolerance up to which an iterate with small primal and dual residuals is
# worth measuring on unscaled data, where the sums of the gap round differently.
CLOSE = 1e3
# An active-set refinement needs a worst residual, or a mean of W Z, below these; a
# worst residual that fell to the part DROP since the last refinement; and from STEADY
# times the tolerance on an active set that did not change in the last iteration.
NEAR, NEAR_MU, DROP, STEADY = 1e-2, 1e-7, 0.1, 100.0
# The least shifts are asked where the primal residual is above FAR times its tolerance
# and RESISTS iterations have not halved the worst one.
FAR = 10.0
# Passes over the entries of L in one iteration, about.
PASSES = 20.0
FORM = "path"


def solve_interior(qp, chain, guess, judge, memory):
    """Solve a QP; ValueError if P is not positive semidefinite.

    If the active set of the guess is the right one, no iteration is needed. `memory`
    holds the factors of a problem solved before, and takes those of this one.
    """
    limits, deadline = judge.limits, judge.limits.deadline
    entries = qp.P.size + qp.G.size + qp.A.size
    deadline.check(PASS * entries)
    qp = qp._replace(P=as_sparse(qp.P))
    memory.ensure_convex(qp.P, deadline)
    found = alone(judge.qp, *limits.tolerances)
    if found is not None:
        message, proof = found
        judge.keep(Status.PRIMAL_INFEASIBLE, proof)
        return judge.answer(Status.PRIMAL_INFEASIBLE, 0, FORM, message)
    if judge.is_solved:  # by an engine that could not tell whether P is convex
        return judge.answer(Status.SOLVED, 0, FORM)
    deadline.check(PASS * entries)
    last = memory.scaled
    small = presolve(qp, *limits.tolerances, last and last.small)
    for message, y, z in small.contradictions:
        none = np.zeros(qp.q.size)
        x, proof = judge.qp.clip(0.0), chain.point(none, y, z, none, data=0.0)
        if judge.accept_multipliers(x, proof.y, proof.z):
            return judge.answer(Status.PRIMAL_INFEASIBLE, 0, FORM, message)
    deadline.check(2.0 * PASS * entries)
    problem = memory.scaled = ScaledQP(small, last)
    deadline.check()
    m = Interior(problem, chain.then(problem), judge, limits)
    if guess.x.size:  # its active set may be that of the solution
        as_array(m.start, m.length)[:] = np.concatenate(problem.guess(guess))
        refine(m)
        raise_kept(m)
        if judge.is_solved:
            return judge.answer(Status.SOLVED, 0, FORM)
    return judge.answer(run(m, guess), m.iterations, FORM)


def run(m: Interior, guess):
    """Iterate; return the status. The judge has the point or the certificate."""
    status = iterate(m, guess)
    if status is not Status.SOLVED and m.best < INFINITY:
        offer(m, m.best_x)
    return status


def iterate(m, guess):
    """Run the loop; return the status."""
    if is_late(m):  # before the first factorisation
        return Status.TIME_LIMIT
    m.tested[0] = m.tested[1] = PROMISING
    m.reports = m.limits.report is not None
    m.is_warm = guess.x.size > 0 and start_warm(m, guess)
    while True:
        m.since_halved, m.reference, m.last_refined = 0, INFINITY, INFINITY
        m.old_primal_norm = m.old_dual_norm = INFINITY  # no residual is stuck yet
        m.krylov_pays, m.attained = True, 0.0
        m.patience = WARM_PATIENCE if m.is_warm else PATIENCE
        m.rho, m.delta, m.wait = RHO, DELTA, 0
        with cython.nogil:
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
    """Give the iterate what it needs; return the status if that ends the loop."""
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
        if m.worst <= 1.0 and not solved:
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
    if verdict is not None:
        return verdict
    if wants & DOUBT and m.judge.is_disproved():
        return Status.PRIMAL_INFEASIBLE
    if m.iterations < m.max_iter and is_late(m):
        return Status.TIME_LIMIT
    return Status.STALLED if m.refused >= MOST_REFUSED else None


# ---- an iteration


def look(m):
    wants: cython.int = REPORT if m.reports else 0
    if m.worst <= CLOSE and max(m.primal_ratio, m.dual_ratio) <= 1.0:
        wants |= JUDGE
    same: cython.bint = True
    for k in range(m.m):
        is_active: cython.bint = m.Z[k] > m.W[k]
        if is_active != m.active[k]:
            same, m.active[k] = False, is_active
    near: cython.bint = m.tol * m.worst < NEAR or m.mu < NEAR_MU
    if near and m.worst <= DROP * m.last_refined and (m.worst < STEADY or same):
        m.last_refined = m.worst
        wants |= ACTIVE_SET
    if promises(m):
        wants |= PROVE
    m.since_halved += 1
    if m.worst <= 0.5 * m.reference:
        m.reference, m.since_halved = m.worst, 0
    if m.since_halved == RESISTS and m.primal_ratio > FAR:
        wants |= DOUBT
    stagnates: cython.bint = m.since_halved > m.patience or not m.worst < INFINITY
    if stagnates or m.iterations >= m.max_iter:
        wants |= STOP
    if is_over(m, PASSES * m.factors.entries):
        wants |= CLOCK
    return wants


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
    x[:], y[:], Z[:], _ = m.problem.guess(guess)
    fill(m.W, 0.0, m.m)
    evaluate(m)
    m.best = INFINITY
    slack = -as_array(m.rw, m.m)
    most = np.abs(slack).max(initial=LEAST_SLACK)
    W[:] = np.maximum(slack, INSIDE * most)
    Z[:] = np.maximum(Z, INSIDE * Z.max(initial=LEAST_MULTIPLIER))
    return True
