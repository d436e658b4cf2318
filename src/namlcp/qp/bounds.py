"""QPs with bounds alone, solved as box LCPs; the table translates the names.

QP, bounds only                       box LCP
P, q                                  A, q
lb <= x <= ub                         lower <= z <= upper
x                                     z
-z_box = P x + q                      w = A z + q
z_box <= 0 at lb, >= 0 at ub          w >= 0 at lower, <= 0 at upper
ray x, q'x = -1                       ray v, q'v = -1 (no solution)
"""

from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY

from namlcp.checks import as_sparse
from namlcp.lcp.data import LCP, Prepared
from namlcp.lcp.methods import LARGE_LCP, solve_auto
from namlcp.lcp.pivoting.driver import Attempt
from namlcp.lcp.pivoting.pivot import ACCURACY
from namlcp.limits import Limits
from namlcp.linalg.csc import times
from namlcp.qp.problem import NO_ENTRIES
from namlcp.status import Status

# Relative tolerances that are tried one after another on a large LCP.
SHARPER = (ACCURACY, 1e-11, 1e-13)
FORM = "bounds"


def is_box_open(lower, upper):
    """Tell whether the box has a finite point."""
    n: Py_ssize_t = lower.size
    low, high = numbers(lower, n), numbers(upper, n)
    for j in range(n):
        if low[j] > high[j] or low[j] == INFINITY or high[j] == -INFINITY:
            return False
    return True


def solve_bounds(qp, chain, guess, judge, memory):
    """Solve a QP with bounds alone as a box LCP; None if that decides nothing."""
    limits, z0 = judge.limits, guess.x if guess.x.size else None
    if qp.is_dense:  # to copy and check it may have taken long
        limits.deadline.check()
    convex = not qp.is_dense and qp.q.size >= LARGE_LCP
    if convex:
        memory.ensure_convex(qp.P, limits.deadline)
        lcp = LCP(memory.prepared(qp.P), qp.q, qp.lb, qp.ub)
        for eps_rel in SHARPER:  # the gap of the QP adds up the errors of all unknowns
            inner = Limits(0.0, eps_rel, limits.max_iter, limits.deadline)
            outcome = solve_auto(lcp, z0, inner)
            z0 = outcome.point.z
            worst = judge.offer(point_of(qp, chain, z0))
            if outcome.status is not Status.SOLVED or worst <= 1.0:
                break
    else:
        inner = Limits(0.0, ACCURACY, limits.max_iter, limits.deadline)
        matrix = Prepared.unchecked(qp.P, symmetric=True)  # by columns is by rows
        lcp = LCP(matrix, qp.q, qp.lb, qp.ub)
        attempt = Attempt(lcp, z0, inner, ask_convex=True)
        attempt.run()
        if attempt.solved and attempt.convex:  # the residuals of the LCP need no check
            if judge.offer(point_of(qp, chain, attempt.best_point())) <= 1.0:
                return judge.answer(Status.SOLVED, attempt.factorisations, FORM)
        outcome, convex = attempt.outcome(), attempt.convex
        if outcome.ray is None:
            judge.offer(point_of(qp, chain, outcome.point.z))
    if outcome.ray is not None:
        memory.ensure_convex(as_sparse(qp.P))
        point = point_of(qp, chain, outcome.point.z)
        ray = outcome.ray, NO_ENTRIES, NO_ENTRIES, 0.0 * outcome.ray
        if not judge.accept_ray(chain.point(*ray, data=0.0).x, point):
            return None
    elif judge.is_solved and not convex:
        return None  # the interior-point method may find that P is not convex
    return judge.answer(outcome.status, outcome.iterations, FORM)


def point_of(qp, chain, z):
    return chain.point(z, NO_ENTRIES, NO_ENTRIES, -(times(qp.P, z) + qp.q))
