"""The path: a regularised primal-dual interior method with an exact finish.

For P positive semidefinite and any rows: presolve, equilibrate, follow the central path
W Z = mu through one sparse quasi-definite KKT matrix, try the exact active-set finish as
soon as it can pay, and judge every candidate on the user's own data. Mehrotra's predictor
and corrector (SIAM J. Optim. 2, 1992), one corrector of Gondzio (Comput. Optim. Appl. 6,
1996), separate primal and dual steps, and proximal regularisation centred at the current
point whose size follows the accuracy of the linear solves.
"""

import time
from collections.abc import Callable
from math import inf
from typing import NamedTuple

import numpy as np

from namlcp.checks import QPData
from namlcp.options import Options
from namlcp.qp import certificates
from namlcp.qp.finish import Finish
from namlcp.qp.judge import Judge
from namlcp.qp.presolve import presolve
from namlcp.qp.scaling import ScaledQP
from namlcp.qp.steps import (
    advance,
    assemble,
    centred_target,
    corrector_target,
    evaluate,
    piece_step,
    right_side,
    shift_inside,
)
from namlcp.status import Status

Report = Callable[..., None]

SHORT = 0.99  # fraction of the longest step
ROUNDS = 6  # sets tried by one finish
PATIENCE = 100  # iterations without halving the worst residual before STALLED


class PathResult(NamedTuple):
    """A status, the point or certificate (see `QPResult`), and how it was found."""

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    iterations: int
    message: str
    history: list[tuple]


def solve(
    qp: QPData,
    options: Options,
    x0: np.ndarray | None = None,
    deadline: float = inf,
    report: Report | None = None,
) -> PathResult:
    """Solve a convex QP in CSC; `deadline` is a value of time.perf_counter().

    x0 is a guess of x: if its active set is the right one, no iteration is needed.
    Raises ValueError if P is not positive semidefinite.
    """
    certificates.check_convex(qp.P)
    small = presolve(qp, options.eps_abs, options.eps_rel)
    judge = Judge(qp, options)
    for reason in small.contradictions:
        proof = certificates.contradiction(judge, small, reason)
        if proof is not None:
            return PathResult(Status.PRIMAL_INFEASIBLE, *proof, 0, reason.message, [])
    problem = ScaledQP(small)
    loop = Interior(problem, judge, options)
    status = loop.run(x0, deadline, report)
    point = judge.proof or judge.point
    return PathResult(status, *point, loop.iterations, loop.message, [])


class Regularisation:
    """rho and delta, moved by the accuracy of the linear solves."""

    floor, least = 1e-7, 1e-16
    top = 1e-6
    poor, good = 1e-5, 1e-8

    def __init__(self) -> None:
        self.rho, self.delta = 1e-6, 1e-4
        self.wait = 0

    def follow(self, mu_old: float, mu: float) -> None:
        """Shrink with mu down to the floor."""
        factor = 1.0 - min(1.0, abs(mu_old - mu) / mu_old)
        if self.rho > self.floor:
            self.rho = max(self.rho * factor, self.floor)
        if self.delta > self.floor:
            self.delta = max(self.delta * factor, self.floor)

    def raise_both(self) -> None:
        """Answer an inaccurate solve."""
        self.rho = max(self.rho, min(10.0 * self.rho, self.top))
        self.delta = max(self.delta, min(10.0 * self.delta, self.top))
        self.wait = 3

    def adapt(
        self, error: float, rho_binds: bool, delta_binds: bool
    ) -> None:
        """After a step: raise after poor solves, lower what binds after good ones."""
        if error > self.poor:
            self.raise_both()
        elif self.wait > 0:
            self.wait -= 1
        elif error < self.good:
            if rho_binds:
                self.rho = max(0.1 * self.rho, self.least)
            if delta_binds:
                self.delta = max(0.1 * self.delta, self.least)


class Interior:
    """The iterate (x, y, W, Z) of a scaled problem, and the loop."""

    def __init__(self, problem: ScaledQP, judge: Judge, options: Options) -> None:
        self.problem, self.judge, self.options = problem, judge, options
        n, p, m, size = problem.n, problem.p, problem.c.size, problem.kkt.size
        self.x, self.y = np.zeros(n), np.zeros(p)
        self.W, self.Z = np.ones(m), np.ones(m)
        self.rd, self.Px, self.Ctv = np.empty((3, n))
        self.rp = np.empty(p)
        self.rw, self.rc, self.tau, self.omega = np.empty((4, m))
        self.weight, self.rhs, self.v, self.t, self.dt = np.empty((5, size))
        self.dW, self.dZ, self.dW2, self.dZ2 = np.zeros((4, m))
        self.state = np.empty(11)
        self.step = np.empty(3)
        self.change = np.empty(2)
        self.reg = Regularisation()
        self.iterations = 0
        self.message = ""
        self.finish = Finish(problem, self.offer)
        self.best = inf
        self.best_point = self.x.copy(), self.y.copy(), self.Z.copy()

    def offer(self, x: np.ndarray, y: np.ndarray, Z: np.ndarray) -> float:
        """Let the judge see a scaled point."""
        return self.judge.offer(*self.problem.user_point(x, y, Z))

    def run(
        self, x0: np.ndarray | None, deadline: float, report: Report | None
    ) -> Status:
        """Iterate until solved, proved impossible, or out of iterations or time."""
        status = self.follow(x0, deadline, report)
        if self.best < inf:
            self.offer(*self.best_point)
        return Status.SOLVED if self.judge.best <= 1.0 else status

    def follow(
        self, x0: np.ndarray | None, deadline: float, report: Report | None
    ) -> Status:
        """The loop."""
        trigger = FinishTrigger(self.options)
        tests = certificates.LoopTests(self.problem, self.judge)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            if x0 is not None and self.guess(x0):
                return Status.SOLVED
            if not self.start():
                return Status.NUMERICAL_ERROR
            active = self.Z > self.W
            mark, since = inf, 0
            mu_old = 0.0
            for k in range(self.options.max_iter + 1):
                self.iterations = k
                worst = self.evaluate()
                if report is not None:
                    report(k, *self.state[5:8], self.step[0], int(np.sum(active)))
                if not worst < inf and k > 0:
                    return Status.STALLED
                before, active = active, self.Z > self.W
                if worst <= 1.0 and self.offer(self.x, self.y, self.Z) <= 1.0:
                    self.polish(active)
                    return Status.SOLVED
                if trigger.ready(worst, self.state[0], active, before):
                    self.finish.run(self.x, self.y, self.Z, active, ROUNDS, GOOD)
                    if self.judge.best <= 1.0:
                        return Status.SOLVED
                if tests.decide(self, k):
                    return self.judge.verdict
                since = 0 if worst <= 0.5 * mark else since + 1
                mark = min(mark, worst)
                if k == self.options.max_iter:
                    return Status.MAX_ITER
                if since > PATIENCE:
                    return Status.STALLED
                if time.perf_counter() > deadline:
                    return Status.TIME_LIMIT
                mu = self.state[0]
                if k > 0 and mu_old > 0.0:
                    self.reg.follow(mu_old, mu)
                mu_old = mu
                if not self.advance():
                    return Status.STALLED
        raise AssertionError("unreachable")
