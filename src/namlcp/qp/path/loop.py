"""The path: a regularised primal-dual interior method with an active-set refinement.

For P positive semidefinite and any rows: presolve, equilibrate, follow the central path
W Z = mu through one sparse quasi-definite KKT matrix, refine the active set
as soon as that can pay, and judge every candidate on the user's own data. Mehrotra's
predictor and corrector (SIAM J. Optim. 2, 1992), one corrector of Gondzio (Comput.
Optim. Appl. 6, 1996), separate primal and dual steps.
"""

from math import inf

import numpy as np

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.guess import Guess
from namlcp.qp.judge import Judge
from namlcp.qp.path import fallback
from namlcp.qp.path.candidates import CertificateSearch
from namlcp.qp.path.refinement import LARGE_KKT, Refinement, RefinementTiming
from namlcp.qp.path.regularisation import POOR, Regularisation
from namlcp.qp.path.steps import (
    advance,
    assemble,
    centred_target,
    evaluate,
    newton_right_side,
    shifted_inside,
    slack_step,
)
from namlcp.qp.transforms import UNITS, ScaledQP
from namlcp.status import Status

SHORT = 0.99  # fraction of the longest step
LONG = 1.8  # sum of the steps above which Gondzio's corrector is not tried
GAIN = 0.02  # growth of the steps that pays for Gondzio's corrector
PATIENCE = 100  # iterations without halving the worst residual before another try
LIFT = 0.1  # part of the gap that m mu does not fall below in another try
TOLERABLE = 0.5  # violation over its tolerance that another try may leave
ACCURACY = 1e-4  # of the linear solves, relative to the tolerance
CLOSE = 1e3  # gap over its tolerance at which the judge sees a feasible iterate
EXACT = 1e-8  # tolerances up to this one ask for a refinement in any case
INSIDE = 1e-2  # least slack and multiplier of a warm start, relative to the largest
DOUBTED = 10  # iterations without halving before a warm start is given up
DOUBT = 12  # iterations without halving before the fallback QPs are asked


class Interior:
    """The iterate (x, y, W, Z) of a scaled problem, and the loop."""

    def __init__(
        self,
        problem: ScaledQP,
        judge: Judge,
        limits: Limits,
        refinement: Refinement,
    ) -> None:
        """Allocate everything the loop needs."""
        self.problem, self.judge, self.limits = problem, judge, limits
        n, p, m, size = problem.n, problem.p, problem.c.size, problem.kkt.size
        self.x, self.y = np.zeros(n), np.zeros(p)
        self.W, self.Z = np.ones(m), np.ones(m)
        self.rd, self.Px, self.Ctv = np.empty((3, n))
        self.rp = np.empty(p)
        self.rw, self.rc, self.tau, self.omega = np.empty((4, m))
        self.dW, self.dZ, self.dW_other, self.dZ_other = np.zeros((4, m))
        self.weight, self.rhs, self.v, self.t, self.dt, self.du = np.zeros((6, size))
        self.norms = np.zeros(11)
        self.ratios = np.zeros(3)  # primal, dual residual and gap over the tolerance
        self.length = np.ones(3)
        self.change = np.zeros(2)
        self.error = 0.0
        self.reg = Regularisation()
        self.max_iter = limits.max_iter or DEFAULT_OPTIONS.max_iter
        self.tol = max(limits.tolerances)
        problem.kkt.accuracy = min(max(ACCURACY * self.tol, 1e-14), 1e-10)
        self.refinement = refinement
        self.tests = CertificateSearch(problem, judge)
        self.ask: fallback.Solver | None = None
        self.iterations = 0
        self.is_warm = False
        self.tries = 1
        self.lift = 0.0
        self.best = inf
        self.best_point = self.x, self.y, self.Z

    def offer(self, x: np.ndarray, y: np.ndarray, Z: np.ndarray) -> float:
        """Let the judge see a scaled point."""
        return self.judge.offer(self.problem.point(x, y, Z))

    def run(self, guess: Guess) -> Status:
        """Iterate until solved, proved impossible, or out of iterations or time."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            status = self.follow(guess)
            if self.best < inf:
                self.offer(*self.best_point)
        return status

    def follow(self, guess: Guess) -> Status:
        """Run the loop."""
        deadline, report = self.limits.deadline, self.limits.report
        if deadline.reached():  # before the first factorisation
            return Status.TIME_LIMIT
        self.is_warm = guess.x.size > 0 and self.warm_start(guess)
        if not self.is_warm and not self.start():
            return Status.NUMERICAL_ERROR
        is_large = self.problem.kkt.base.size > LARGE_KKT
        timing = RefinementTiming(self.tol, is_large)
        active = self.Z > self.W
        mark, since = inf, 0
        for k in range(self.max_iter + 1):
            self.iterations = k
            mu_old = self.norms[0]
            worst = self.evaluate()
            before, active = active, self.Z > self.W
            if report is not None:
                report(k, *self.norms[5:8], self.length[:2].min(), int(active.sum()))
            if k > 0:
                self.regularise(mu_old)
            done = self.is_close(worst) and self.offer(self.x, self.y, self.Z) <= 1.0
            if done and self.tol > EXACT:
                return Status.SOLVED
            if done or timing.is_due(worst, self.norms[0], active, before):
                self.refinement.run(self.x, self.y, self.Z, active)
            if self.judge.best <= 1.0:
                return Status.SOLVED
            verdict = self.tests.find(self)
            if verdict is not None:
                return verdict
            since = 0 if worst <= 0.5 * mark else since + 1
            mark = mark if since else worst
            patience = DOUBTED if self.is_warm else PATIENCE
            stuck = since > patience or not worst < inf
            if since == DOUBT and self.tests.promised:
                verdict = self.doubt()
                if verdict is not None:
                    return verdict
            if k == self.max_iter:
                break
            if deadline.reached():
                return Status.TIME_LIMIT
            if stuck or not self.step():
                if not self.restart():
                    return Status.STALLED
                mark, since = inf, 0
                timing = RefinementTiming(self.tol, is_large)
        return Status.MAX_ITER

    def restart(self) -> bool:
        """Start again: cold after a warm start, then in other units; else False.

        Later tries are centred. Rows that the best point violates tolerably give way
        to it: dependent rows contradict each other by rounding errors, and y grows for
        ever.
        """
        if not self.is_warm:
            if self.tries == len(UNITS) or self.problem.c.size == 0:
                return False
            self.tries += 1
            self.lift = LIFT
            self.offer(*self.best_point)
            self.x, self.y, self.Z = (v.copy() for v in self.best_point)
            self.problem.scale_vectors()  # nothing has given way yet
            self.evaluate()
            self.best = inf
            n, p = self.x.size, self.y.size
            ratio = self.problem.change_units()
            self.t /= ratio
            Z = self.Z * ratio[self.problem.place]
            self.best_point = self.x / ratio[:n], self.y * ratio[n : n + p], Z
            if self.ratios[0] <= TOLERABLE:
                self.problem.relax(self.t)
        self.is_warm = False
        return self.start()

    def doubt(self) -> Status | None:
        """Let the judge see the best point, and ask the fallback QPs, once."""
        ask, self.ask = self.ask, None
        if ask is None or self.offer(*self.best_point) <= 1.0:
            return None
        point = self.problem.point(self.x, self.y, self.Z)
        verdict = fallback.find_certificate(
            self.judge.qp, point, self.limits.eps_abs, ask, self.tests.project
        )
        if verdict is None:
            return None
        self.tests.proof = verdict[1]
        return verdict[0]

    def warm_start(self, guess: Guess) -> bool:
        """Start from the multipliers of a guess too, moved inside; False without any.

        Every slack and multiplier is at least INSIDE times the largest one.
        """
        if not (guess.z.any() or guess.z_box.any()):
            return False
        self.x, self.y, self.Z, _ = self.problem.guess(guess)
        self.W[:] = 0.0
        self.evaluate()
        self.best = inf
        slack = -self.rw
        self.W[:] = np.maximum(slack, INSIDE * np.abs(slack).max(initial=1.0))
        self.Z[:] = np.maximum(self.Z, INSIDE * self.Z.max(initial=1e-3))
        return True

    def start(self) -> bool:
        """Solve with W = Z = 1 as weights, then shift inside (Mehrotra)."""
        s, kkt = self.problem, self.problem.kkt
        self.reg = Regularisation()
        self.W[:] = 1.0
        self.Z[:] = 1.0
        self.rc[:] = 0.0
        if not self.factor():
            return False
        newton_right_side(
            s.q, -s.b, -s.c, self.rc, s.place, s.sign, self.Z, self.omega, self.weight,
            self.tau, self.rhs,
        )  # fmt: skip
        self.du, self.error = kkt.solve(self.rhs)
        self.measure_step()
        self.x[:] = self.du[: s.n]
        self.y[:] = self.du[s.n : s.n + s.p]
        self.Z[:] = self.dZ
        self.W[:] = -self.dZ
        self.dZ[:] = 0.0
        self.du[:] = 0.0
        if s.c.size:
            self.W, self.Z = shifted_inside(self.W, self.Z)
        return True

    def evaluate(self) -> float:
        """Compute the residuals; return the worst over its tolerance, keep the best."""
        s, kkt = self.problem, self.problem.kkt
        evaluate(
            *kkt.triangle, s.unit, s.q, s.b, s.place, s.sign, s.c,
            self.x, self.y, self.W, self.Z, self.v, self.Px, self.Ctv, self.t,
            self.rd, self.rp, self.rw, self.norms,
        )  # fmt: skip
        eps_abs, eps_rel = self.limits.tolerances
        self.ratios[:] = self.norms[5:8] / (eps_abs + eps_rel * self.norms[8:11])
        worst = float(self.ratios.max())
        if worst < self.best:
            self.best = worst
            self.best_point = self.x.copy(), self.y.copy(), self.Z.copy()
        return worst if worst < inf else inf

    def is_close(self, worst: float) -> bool:
        """Tell whether the user's data may judge the iterate solved.

        The gap is a difference of large sums, which come out differently there.
        """
        return worst <= CLOSE and bool(self.ratios[:2].max() <= 1.0)

    def regularise(self, mu_old: float) -> None:
        """Adapt rho and delta to the step that led here."""
        mu, rd, rp, rw = self.norms[:4]
        if self.problem.c.size == 0:
            self.reg.lower()
            return
        self.reg.follow(mu_old, mu)
        self.reg.adapt(
            self.error,
            rd > 1e-12 and self.reg.rho * self.change[0] > 0.5 * rd,
            self.reg.delta * self.change[1] > 0.5 * max(rp, rw),
        )

    def step(self) -> bool:
        """Predict, correct, centre, move; False if no factorisation succeeds."""
        W, Z = self.W, self.Z
        for _ in range(3):
            if not self.factor():
                self.reg.strengthen()
                continue
            self.rc[:] = -W * Z
            self.direction()
            predicted = self.error
            if predicted <= POOR:
                break
            self.reg.strengthen()
        if not np.isfinite(self.error):
            return False
        m = W.size
        if m:
            mu = self.norms[0]
            sigma = min(max(self.length[2] / (m * mu), 0.0), 1.0) ** 3
            gap = self.limits.eps_abs + self.limits.eps_rel * self.norms[10]
            smu = max(sigma * mu, 0.01 * gap / m, self.lift * self.norms[7] / m)
            self.rc[:] = smu - W * Z - self.dW * self.dZ
            self.direction()
            if self.length[0] + self.length[1] < LONG:
                self.centre(smu)
        self.error = max(self.error, predicted)
        primal, dual = self.length[:2] * SHORT if m else (1.0, 1.0)
        advance(
            self.problem.n, self.du, self.dW, self.dZ, primal, dual, self.x, self.y, W,
            Z, self.change,
        )  # fmt: skip
        return True

    def centre(self, smu: float) -> None:
        """Add Gondzio's corrector if it lengthens the steps."""
        primal, dual = self.length[:2]
        centred_target(self.W, self.Z, self.dW, self.dZ, primal, dual, smu, self.rc)
        kept = self.du, self.error
        self.dW, self.dW_other = self.dW_other, self.dW
        self.dZ, self.dZ_other = self.dZ_other, self.dZ
        self.direction()
        if not self.length[0] + self.length[1] >= primal + dual + GAIN:
            self.du, self.error = kept
            self.dW, self.dW_other = self.dW_other, self.dW
            self.dZ, self.dZ_other = self.dZ_other, self.dZ
            self.length[:2] = primal, dual

    def factor(self) -> bool:
        """Factor K~ at the current W, Z, rho and delta."""
        s, kkt = self.problem, self.problem.kkt
        assemble(
            kkt.base, kkt.diagonal, s.n, s.p, s.place, self.W, self.Z, self.reg.rho,
            self.reg.delta, self.omega, self.weight, kkt.data,
        )  # fmt: skip
        return kkt.factor()

    def direction(self) -> None:
        """Solve for the target rc; set du, dW, dZ, the longest steps and the error."""
        s = self.problem
        newton_right_side(
            self.rd, self.rp, self.rw, self.rc, s.place, s.sign, self.Z, self.omega,
            self.weight, self.tau, self.rhs,
        )  # fmt: skip
        self.du, self.error = s.kkt.solve(self.rhs)
        self.measure_step()

    def measure_step(self) -> None:
        """Set dW, dZ and the longest steps from du."""
        s, kkt = self.problem, self.problem.kkt
        slack_step(
            *kkt.triangle, s.n, self.du, s.place, s.sign,
            self.omega, self.tau, self.rc, self.W, self.Z, self.dt, self.dW, self.dZ,
            self.length,
        )  # fmt: skip
