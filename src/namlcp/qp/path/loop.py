"""The loop of a regularised primal-dual interior-point method.

The iterates follow the central path W Z = mu, W the slacks and Z the multipliers of the
one-sided constraints, for a positive semidefinite P and any rows. Each iteration
factors one quasi-definite KKT matrix and makes Mehrotra's predictor and corrector
(SIAM J. Optim. 2, 1992), one corrector of Gondzio (Comput. Optim. Appl. 6, 1996), and
steps of separate length. An active-set refinement is tried near the solution; `Judge`
measures candidates on unscaled data and keeps the best.

A warm start that stagnates is followed by a cold start, a cold start that stagnates by
one with another scaling (`rescale`). Once, where a certificate seemed near, two
fallback QPs decide whether the problem is infeasible or unbounded (`solve_fallback`).
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
    DUAL_NORM,
    GAP,
    GAP_SIZE,
    MU,
    PRIMAL,
    PRIMAL_SIZE,
    ROW_NORM,
    SLACK_NORM,
    assemble,
    centred_target,
    evaluate,
    newton_right_side,
    shifted_inside,
    slack_step,
    take_step,
)
from namlcp.qp.transforms import UNITS, ScaledQP
from namlcp.status import Status

# Indices in `norms`: primal residual, dual residual and gap; the sizes of their terms.
RESIDUALS, SIZES = slice(PRIMAL, GAP + 1), slice(PRIMAL_SIZE, GAP_SIZE + 1)
# Index in `length` of W'Z after the longest steps of W and of Z, which come before it.
PRODUCT = 2
# Fraction of the longest feasible step that is taken.
SHORT = 0.99
# Gondzio's corrector is tried if the sum of the primal and the dual step is below the
# first, and kept if the sum grows by the second.
LONG, GAIN = 1.8, 0.02
# Least target of W'Z, relative to the tolerance of the gap.
CENTRED = 0.01
# Least target of W'Z, relative to the gap, once the scaling was changed.
LIFT = 0.1
# Primal residual over its tolerance up to which a restart relaxes right-hand sides.
TOLERABLE = 0.5
# Relative residual at which refinement of the linear solves ends: this times the
# tolerance, within these limits.
ACCURACY, MOST_ACCURATE, LEAST_ACCURATE = 1e-4, 1e-14, 1e-10
# Gap over its tolerance up to which an iterate with small primal and dual residuals is
# worth measuring on unscaled data, where the sums of the gap round differently.
CLOSE = 1e3
# With a tolerance up to this, a solution is refined before it is returned.
EXACT = 1e-8
# Slacks and multipliers of a warm start are at least INSIDE times the largest one, or
# times LEAST_SLACK and LEAST_MULTIPLIER if these are larger.
INSIDE, LEAST_SLACK, LEAST_MULTIPLIER = 1e-2, 1.0, 1e-3
# Iterations without halving the worst residual before a restart, after a cold start
# and after a warm one, and before the fallback QPs.
PATIENCE, WARM_PATIENCE, FALLBACK_AFTER = 100, 10, 12
# Scaled dual residual up to which rho is not held responsible for it.
ROUNDING = 1e-12
# Factorisations tried for one step, each with more regularisation.
FACTORISATIONS = 3


class Stagnation:
    """Counts iterations since the worst residual was last halved."""

    def __init__(self) -> None:
        self.reference_residual, self.iterations_since = inf, 0

    def count(self, worst: float) -> int:
        """Count an iteration with this worst residual; return the count."""
        self.iterations_since += 1
        if worst <= 0.5 * self.reference_residual:
            self.reference_residual, self.iterations_since = worst, 0
        return self.iterations_since


class Interior:
    """The iterate (x, y, W, Z) of a scaled problem, and the loop."""

    def __init__(
        self, problem: ScaledQP, judge: Judge, limits: Limits, refinement: Refinement
    ) -> None:
        self.problem, self.judge, self.limits = problem, judge, limits
        n, p, m, size = problem.n, problem.p, problem.c.size, problem.kkt.size
        self.x, self.y = np.zeros(n), np.zeros(p)
        self.W, self.Z = np.ones(m), np.ones(m)
        self.rd, self.Px, self.Ctv = np.empty((3, n))
        self.rp = np.empty(p)
        self.rw, self.rc, self.tau, self.omega = np.empty((4, m))
        self.dW, self.dZ, self.dW_other, self.dZ_other = np.zeros((4, m))
        self.weight, self.rhs, self.v, self.t, self.dt, self.du = np.zeros((6, size))
        self.norms = np.zeros(GAP_SIZE + 1)
        self.ratios = np.zeros(3)  # primal, dual residual and gap over the tolerance
        self.length = np.ones(3)
        self.change = np.zeros(2)  # largest change of x, and of y and Z
        self.error = 0.0  # relative residual of the last linear solve
        self.reg = Regularisation()
        self.max_iter = limits.max_iter or DEFAULT_OPTIONS.max_iter
        self.tol = max(limits.tolerances)
        accuracy = min(max(ACCURACY * self.tol, MOST_ACCURATE), LEAST_ACCURATE)
        problem.kkt.accuracy = accuracy
        self.refinement = refinement
        self.certificates = CertificateSearch(problem, judge)
        self.fallback_solver: fallback.Solver | None = None
        self.iterations = 0
        self.is_warm = False
        self.tries = 1  # scalings tried
        self.lift = 0.0  # LIFT once the scaling was changed
        self.best = inf  # the least worst ratio, in the present scaling
        self.best_point = self.x, self.y, self.Z

    def offer(self, x: np.ndarray, y: np.ndarray, Z: np.ndarray) -> float:
        """Return the judge's ratio of residual to tolerance for a scaled point."""
        return self.judge.offer(self.problem.point(x, y, Z))

    def run(self, guess: Guess) -> Status:
        """Iterate until solved, proved impossible, or out of iterations or time."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            status = self.iterate(guess)
            if self.best < inf:
                self.offer(*self.best_point)
        return status

    def iterate(self, guess: Guess) -> Status:
        """Run the loop."""
        deadline, report = self.limits.deadline, self.limits.report
        if deadline.reached():  # before the first factorisation
            return Status.TIME_LIMIT
        self.is_warm = guess.x.size > 0 and self.warm_start(guess)
        if not self.is_warm and not self.start():
            return Status.NUMERICAL_ERROR
        is_large = self.problem.kkt.base.size > LARGE_KKT
        timing, stagnation = RefinementTiming(self.tol, is_large), Stagnation()
        active = self.Z > self.W
        for k in range(self.max_iter + 1):
            self.iterations = k
            mu_old = self.norms[MU]
            worst = self.evaluate()
            before, active = active, self.Z > self.W
            if report is not None:
                step = self.length[:PRODUCT].min()
                report(k, *self.norms[RESIDUALS], step, int(active.sum()))
            if k > 0:
                self.regularise(mu_old)
            solved = self.is_close(worst) and self.offer(self.x, self.y, self.Z) <= 1.0
            if solved and self.tol > EXACT:
                return Status.SOLVED
            if solved or timing.is_due(worst, self.norms[MU], active, before):
                self.refinement.run(self.x, self.y, self.Z, active)
            if self.judge.best <= 1.0:
                return Status.SOLVED
            verdict = self.certificates.find(self)
            since = stagnation.count(worst)
            if verdict is None and since == FALLBACK_AFTER:
                verdict = self.solve_fallback()
            if verdict is not None:
                return verdict
            if k == self.max_iter:
                break
            if deadline.reached():
                return Status.TIME_LIMIT
            patience = WARM_PATIENCE if self.is_warm else PATIENCE
            stagnates = since > patience or not worst < inf
            if stagnates or not self.step():
                if not self.restart():
                    return Status.STALLED
                timing, stagnation = RefinementTiming(self.tol, is_large), Stagnation()
        return Status.MAX_ITER

    def restart(self) -> bool:
        """Start cold: first as scaled, then rescaled; False after the last scaling."""
        if not self.is_warm and not self.rescale():
            return False
        self.is_warm = False
        return self.start()

    def rescale(self) -> bool:
        """Change to the next scaling and keep mu large; False after the last scaling.

        If the best point violates the constraints within TOLERABLE, right-hand sides
        are relaxed to it: where dependent rows contradict each other by rounding
        errors, y diverges.
        """
        if self.tries == len(UNITS) or self.problem.c.size == 0:
            return False
        self.tries += 1
        self.lift = LIFT
        self.offer(*self.best_point)
        self.x, self.y, self.Z = (v.copy() for v in self.best_point)
        self.problem.scale_vectors()  # undo an earlier relaxation
        self.evaluate()
        self.best = inf
        n, p = self.x.size, self.y.size
        ratio = self.problem.change_units()
        self.t /= ratio
        Z = self.Z * ratio[self.problem.place]
        self.best_point = self.x / ratio[:n], self.y * ratio[n : n + p], Z
        if self.ratios[0] <= TOLERABLE:
            self.problem.relax(self.t)
        return True

    def solve_fallback(self) -> Status | None:
        """Return the verdict of the fallback QPs, once, if a candidate was promising.

        None if the best point of the loop solves the QP.
        """
        solver = self.fallback_solver
        if solver is None or not self.certificates.promised:
            return None
        self.fallback_solver = None
        if self.offer(*self.best_point) <= 1.0:
            return None
        point = self.problem.point(self.x, self.y, self.Z)
        qp, tol, project = self.judge.qp, self.limits.eps_abs, self.certificates.project
        verdict = fallback.find_certificate(qp, point, tol, solver, project)
        if verdict is None:
            return None
        status, self.certificates.proof = verdict
        return status

    def warm_start(self, guess: Guess) -> bool:
        """Start from a guess, moved inside; False if it has no multipliers."""
        if not (guess.z.any() or guess.z_box.any()):
            return False
        self.x, self.y, self.Z, _ = self.problem.guess(guess)
        self.W[:] = 0.0
        self.evaluate()
        self.best = inf
        slack = -self.rw
        largest = np.abs(slack).max(initial=LEAST_SLACK)
        self.W[:] = np.maximum(slack, INSIDE * largest)
        self.Z[:] = np.maximum(self.Z, INSIDE * self.Z.max(initial=LEAST_MULTIPLIER))
        return True

    def start(self) -> bool:
        """Solve with W = Z = 1 as weights, then shift inside (Mehrotra)."""
        s = self.problem
        self.reg = Regularisation()
        self.W[:] = 1.0
        self.Z[:] = 1.0
        self.rd[:], self.rp[:], self.rw[:], self.rc[:] = s.q, -s.b, -s.c, 0.0
        if not self.factor():
            return False
        self.direction()
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
        """Compute the residuals; return the worst over its tolerance, inf for NaN."""
        s, kkt = self.problem, self.problem.kkt
        evaluate(
            *kkt.triangle, s.unit, s.q, s.b, s.place, s.sign, s.c,
            self.x, self.y, self.W, self.Z, self.v, self.Px, self.Ctv, self.t,
            self.rd, self.rp, self.rw, self.norms,
        )  # fmt: skip
        eps_abs, eps_rel = self.limits.tolerances
        self.ratios[:] = self.norms[RESIDUALS] / (eps_abs + eps_rel * self.norms[SIZES])
        worst = float(self.ratios.max())
        if worst < self.best:
            self.best = worst
            self.best_point = self.x.copy(), self.y.copy(), self.Z.copy()
        return worst if worst < inf else inf

    def is_close(self, worst: float) -> bool:
        """Tell whether the iterate is worth measuring on unscaled data (`CLOSE`)."""
        return worst <= CLOSE and bool(self.ratios[:2].max() <= 1.0)

    def regularise(self, mu_old: float) -> None:
        """Adapt rho and delta after a step, to its effect on the residuals."""
        norms, (change_x, change_yz) = self.norms, self.change
        if self.problem.c.size == 0:
            self.reg.lower()
            return
        self.reg.follow(mu_old, norms[MU])
        rd, constraints = norms[DUAL_NORM], max(norms[ROW_NORM], norms[SLACK_NORM])
        rho_binds = rd > ROUNDING and self.reg.rho * change_x > 0.5 * rd
        delta_binds = self.reg.delta * change_yz > 0.5 * constraints
        self.reg.adapt(self.error, rho_binds, delta_binds)

    def step(self) -> bool:
        """Predict, correct, centre, move; False if no factorisation succeeds."""
        W, Z = self.W, self.Z
        for _ in range(FACTORISATIONS):
            if not self.factor():
                self.error = np.inf
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
            mu = self.norms[MU]
            sigma = min(max(self.length[PRODUCT] / (m * mu), 0.0), 1.0) ** 3
            gap = self.limits.eps_abs + self.limits.eps_rel * self.norms[GAP_SIZE]
            lift = self.lift * self.norms[GAP]
            target = max(sigma * mu, CENTRED * gap / m, lift / m)
            self.rc[:] = target - W * Z - self.dW * self.dZ
            self.direction()
            if self.length[:PRODUCT].sum() < LONG:
                self.centre(target)
        self.error = max(self.error, predicted)
        primal, dual = self.length[:PRODUCT] * SHORT if m else (1.0, 1.0)
        take_step(
            self.problem.n, self.du, self.dW, self.dZ, primal, dual, self.x, self.y, W,
            Z, self.change,
        )  # fmt: skip
        return True

    def centre(self, target: float) -> None:
        """Add Gondzio's corrector if it lengthens the steps."""
        primal, dual = self.length[:PRODUCT]
        centred_target(self.W, self.Z, self.dW, self.dZ, primal, dual, target, self.rc)
        kept = self.du, self.error
        self.exchange_steps()
        self.direction()
        if not self.length[:PRODUCT].sum() >= primal + dual + GAIN:
            self.du, self.error = kept
            self.exchange_steps()
            self.length[:PRODUCT] = primal, dual

    def exchange_steps(self) -> None:
        """Exchange the two pairs of arrays for dW and dZ."""
        self.dW, self.dW_other = self.dW_other, self.dW
        self.dZ, self.dZ_other = self.dZ_other, self.dZ

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
        s, kkt = self.problem, self.problem.kkt
        newton_right_side(
            self.rd, self.rp, self.rw, self.rc, s.place, s.sign, self.Z, self.omega,
            self.weight, self.tau, self.rhs,
        )  # fmt: skip
        self.du, self.error = kkt.solve(self.rhs)
        slack_step(
            *kkt.triangle, s.n, self.du, s.place, s.sign,
            self.omega, self.tau, self.rc, self.W, self.Z, self.dt, self.dW, self.dZ,
            self.length,
        )  # fmt: skip
