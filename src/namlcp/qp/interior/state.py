"""The memory of one solve by the interior-point method: one object, one allocation."""

import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY

from namlcp.options import DEFAULT_OPTIONS

# Relative residual at which refinement of the linear solves ends: the first factor
# times the tolerance, the second one for tolerances up to EXACT, within these limits.
ACCURACY, ACCURACY_EXACT = 1e-2, 1e-3
MOST_ACCURATE, LEAST_ACCURATE = 1e-14, 1e-8
# With a tolerance up to this, a solution is refined before it is returned.
EXACT = 1e-8
# Least target of W'Z, relative to the tolerance of the gap.
LEAST_TARGET = 0.01


class Interior(Watched):
    """A scaled problem, the iterate (x, y, W, Z), and what an iteration computes.

    problem: a `ScaledQP`; chain: the way from the user's QP to that.
    """

    def __init__(self, problem, chain, judge, limits):
        self.problem, self.chain = problem, chain
        self.judge, self.limits = judge, limits
        self.kkt = problem.kkt
        self.n, self.p, self.m = problem.n, problem.p, problem.c.size
        self.size, self.nnz = self.kkt.size, self.kkt.base.size
        self.length = self.n + self.p + 2 * self.m
        lay_out(self)
        size: Py_ssize_t = self.taken
        self.memory = np.zeros(size)
        self.begin, self.taken = numbers(self.memory, size), 0
        lay_out(self)
        attach(self)
        self.until = limits.deadline.at
        self.eps_abs, self.eps_rel = limits.eps_abs, limits.eps_rel
        self.tol = max(self.eps_abs, self.eps_rel)
        accuracy = ACCURACY_EXACT if self.tol <= EXACT else ACCURACY
        self.accuracy = min(max(accuracy * self.tol, MOST_ACCURATE), LEAST_ACCURATE)
        self.max_iter = limits.max_iter or DEFAULT_OPTIONS.max_iter
        self.best, self.step.primal, self.step.dual = INFINITY, 1.0, 1.0
        self.least_target = LEAST_TARGET

    @property
    def point(self):
        """The iterate (x, y, W, Z), as it changes."""
        return (
            as_array(self.x, self.n), as_array(self.y, self.p),
            as_array(self.W, self.m), as_array(self.Z, self.m),
        )  # fmt: skip


def reals(m, count):
    """Return the place of the next numbers; before there is memory, count them."""
    found = m.begin + m.taken
    m.taken += count + 1
    return found


def lay_out(m):
    """Give every vector its place; parts of a point follow one another."""
    n, p, size = m.n, m.p, m.size
    m.x, m.best_x = reals(m, m.length), reals(m, m.length)
    m.start, m.found = reals(m, m.length), reals(m, m.length)
    m.y, m.Z, m.active = m.x + n, m.x + n + p, m.x + n + p + m.m
    m.rd, m.Px, m.Ctv, m.rp = reals(m, n), reals(m, n), reals(m, n), reals(m, p)
    m.W, m.rw, m.rc = reals(m, m.m), reals(m, m.m), reals(m, m.m)
    m.tau, m.omega = reals(m, m.m), reals(m, m.m)
    m.step.dW, m.step.dZ, m.step.du = reals(m, m.m), reals(m, m.m), reals(m, size)
    m.other.dW, m.other.dZ, m.other.du = reals(m, m.m), reals(m, m.m), reals(m, size)
    m.v, m.t, m.dv = reals(m, size), reals(m, size), reals(m, size)
    m.weight, m.row_size, m.rhs = reals(m, size), reals(m, size), reals(m, size)
    m.r, m.answer, m.u = reals(m, size), reals(m, size), reals(m, size)
    m.trial, m.trial_r, m.least_u = reals(m, size), reals(m, size), reals(m, size)
    m.krylov = reals(m, 2 * KRYLOV_STEPS * size)
    m.goal, m.held, m.dt = reals(m, size), reals(m, size), reals(m, size)
    m.Pdx, m.Ctdv = reals(m, n), reals(m, n)


def attach(m):
    """Take the vectors of the problem, which a restart replaces."""
    kkt, problem = m.kkt, m.problem
    m.indptr, m.indices = places(kkt.indptr, m.size + 1), places(kkt.indices, m.nnz)
    m.base, m.data = numbers(kkt.base, m.nnz), numbers(kkt.data, m.nnz)
    m.factored = numbers(kkt.factored, m.size)
    m.factors = kkt.plan(True, m.limits.deadline)
    m.place, m.sign = places(problem.place, m.m), numbers(problem.sign, m.m)
    m.unit = numbers(problem.unit, m.size)
    m.q, m.b = numbers(problem.q, m.n), numbers(problem.b, m.p)
    m.c = numbers(problem.c, m.m)
    m.cost, m.goal_b, m.goal_c = m.q, m.b, m.c
    return 0


def offer(m, point):
    """Let the judge measure a point; return its largest residual over tolerances."""
    x, y, Z = as_array(point, m.n), as_array(point + m.n, m.p), point + m.n + m.p
    return m.judge.offer(m.chain.point(x, y, as_array(Z, m.m)))
