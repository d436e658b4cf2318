"""The loop of a regularised primal-dual interior-point method.

The iterates follow the central path W Z = mu, W the slacks and Z the multipliers of the
one-sided constraints, for a positive semidefinite P and any rows. Each iteration
factors one quasi-definite KKT matrix and makes Mehrotra's predictor and corrector
(SIAM J. Optim. 2, 1992), one corrector of Gondzio (Comput. Optim. Appl. 6, 1996), and
steps of separate length. An active-set refinement is tried near the solution; `Judge`
measures candidates on unscaled data and keeps the best.

A warm start that stagnates is followed by a cold start, a cold start that stagnates by
one whose mu falls more slowly (`restart`).
"""

import numpy as np

from namlcp.limits import Limits
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.guess import Guess
from namlcp.qp.judge import Judge
from namlcp.qp.path.advance import (
    ACTIVE_SET,
    EVALUATE,
    FAILED,
    JUDGE,
    MEASURE,
    PROVE,
    REPORT,
    START,
    STOP,
)
from namlcp.qp.path.candidates import CertificateSearch
from namlcp.qp.path.refinement import Refinement
from namlcp.qp.path.regularisation import DELTA, RHO
from namlcp.qp.path.workspace import Workspace
from namlcp.status import Status

# Restarts after cold starts, and the least target of W'Z, relative to the gap, then.
MOST_RESTARTS, LIFT = 2, 0.01
# Primal residual over its tolerance up to which a restart relaxes right-hand sides.
TOLERABLE = 0.5
# Relative residual at which refinement of the linear solves ends: the first factor
# times the tolerance, the second one for tolerances up to EXACT, within these limits.
ACCURACY, MOST_ACCURATE, LEAST_ACCURATE = (1e-2, 1e-3), 1e-14, 1e-8
# With a tolerance up to this, a solution is refined before it is returned.
EXACT = 1e-8
# Slacks and multipliers of a warm start are at least INSIDE times the largest one, or
# times LEAST_SLACK and LEAST_MULTIPLIER if these are larger.
INSIDE, LEAST_SLACK, LEAST_MULTIPLIER = 1e-2, 1.0, 1e-3
# Iterations without halving the worst residual before a restart, after a cold start
# and after a warm one.
PATIENCE, WARM_PATIENCE = 100, 10
# A K with more entries is large. The worst residual has to fall to this part of that at
# the last active-set refinement before the next one, for small and for large K.
LARGE_KKT, DROP = 5_000, (0.1, 1e-3)


class Interior:
    """The loop on a workspace, which has the iterate (x, y, W, Z)."""

    def __init__(
        self, work: Workspace, judge: Judge, limits: Limits, refinement: Refinement
    ) -> None:
        self.work, self.now, self.problem = work, work.now, work.problem
        self.judge, self.limits, self.refinement = judge, limits, refinement
        now = self.now
        now.max_iter = limits.max_iter or DEFAULT_OPTIONS.max_iter
        now.reports = limits.report is not None
        now.tol = max(limits.tolerances)
        accuracy = ACCURACY[now.tol <= EXACT] * now.tol
        now.accuracy = min(max(accuracy, MOST_ACCURATE), LEAST_ACCURATE)
        now.drop = DROP[work.kkt.base.size > LARGE_KKT]
        now.best = np.inf
        now.primal_step = now.dual_step = 1.0
        self.certificates = CertificateSearch(work, judge)
        self.is_warm = False
        self.restarts = 0

    @property
    def iterations(self) -> int:
        """The number of iterations."""
        return min(self.now.iterations, self.now.max_iter)

    def offer(self, x: np.ndarray, y: np.ndarray, Z: np.ndarray) -> float:
        """Return the judge's ratio of residual to tolerance for a scaled point."""
        return self.judge.offer(self.problem.point(x, y, Z))

    def offer_best(self) -> float:
        """Do the same for the best iterate since the last restart."""
        work = self.work
        return self.offer(work.best_x, work.best_y, work.best_Z)

    def run(self, guess: Guess) -> Status:
        """Iterate until solved, proved impossible, or out of iterations or time."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            status = self.iterate(guess)
            if status is not Status.SOLVED and self.now.best < np.inf:
                self.offer_best()
        return status

    def iterate(self, guess: Guess) -> Status:
        """Run the loop."""
        if self.limits.deadline.reached():  # before the first factorisation
            return Status.TIME_LIMIT
        self.is_warm = guess.x.size > 0 and self.warm_start(guess)
        found = self.begin(EVALUATE if self.is_warm else START)
        if found == FAILED and self.now.iterations == 0:
            return Status.NUMERICAL_ERROR
        while True:
            verdict = None if found == FAILED else self.look()
            if verdict is not None:
                return verdict
            if found == FAILED or self.now.wants & STOP:
                if self.iterations == self.now.max_iter:
                    return Status.MAX_ITER
                if not self.restart():
                    return Status.STALLED
                self.now.iterations += 1
                found = self.begin(START)
            else:
                found = self.work.resume()

    def begin(self, stage: int) -> int:
        """Begin to iterate at this stage; return what `advance` does."""
        now = self.now
        now.since, now.reference, now.last_refined = 0, np.inf, np.inf
        # no residual is stuck before there is one to compare it with
        now.old_primal = now.old_primal_norm = now.old_dual_norm = np.inf
        now.krylov_pays, now.attained = True, 0.0
        now.patience = WARM_PATIENCE if self.is_warm else PATIENCE
        now.rho, now.delta, now.wait = RHO, DELTA, 0
        return self.work.run(stage)

    def look(self) -> Status | None:
        """Do what the iterate needs; return the status if that ends the loop."""
        now, work, wants = self.now, self.work, self.now.wants
        if wants & REPORT and self.limits.report is not None:
            step = min(now.primal_step, now.dual_step)
            residuals = now.primal, now.dual, now.gap
            self.limits.report(
                now.iterations, *residuals, step, int(work.active.sum())
            )  # fmt: skip
        # A refinement mostly succeeds: where it is due, an iterate is measured before
        # it only if that would end the loop.
        solved, measured = False, not wants & JUDGE
        if not measured and (now.worst <= 1.0 or not wants & ACTIVE_SET):
            solved, measured = self.offer(work.x, work.y, work.Z) <= 1.0, True
            if solved and now.tol > EXACT:
                return Status.SOLVED
        if solved or wants & ACTIVE_SET:
            self.refinement.run(work.x, work.y, work.Z, work.active)
            if not measured and self.judge.best > 1.0:
                self.offer(work.x, work.y, work.Z)
        if self.judge.best <= 1.0:
            return Status.SOLVED
        verdict = None
        if wants & PROVE:
            verdict = self.certificates.find()
        if verdict is None and now.iterations < now.max_iter:
            now.operations = 0.0
            if self.limits.deadline.reached():
                return Status.TIME_LIMIT
        return verdict

    def restart(self) -> bool:
        """Prepare a cold start with mu kept large; False after MOST_RESTARTS of them.

        If the best point violates the constraints within TOLERABLE, right-hand sides
        are relaxed to it: where dependent rows contradict each other by rounding
        errors, y diverges. After a warm start the first cold one is as any other.
        """
        if self.is_warm:
            self.is_warm = False
            return True
        work, now, problem = self.work, self.now, self.problem
        if self.restarts == MOST_RESTARTS or problem.c.size == 0:
            return False
        self.restarts += 1
        now.lift = LIFT
        self.offer_best()
        work.x[:], work.y[:], work.Z[:] = work.best_x, work.best_y, work.best_Z
        problem.scale_vectors()  # undo an earlier relaxation
        work.attach()
        work.perform(MEASURE)
        now.best = np.inf
        if now.primal_ratio <= TOLERABLE:
            problem.relax(work.t)
        work.attach()
        return True

    def warm_start(self, guess: Guess) -> bool:
        """Start from a guess, moved inside; False if it has no multipliers."""
        if not (guess.z.any() or guess.z_box.any()):
            return False
        work = self.work
        work.x[:], work.y[:], work.Z[:], _ = self.problem.guess(guess)
        work.W[:] = 0.0
        work.perform(MEASURE)
        self.now.best = np.inf
        slack = -work.rw
        largest = np.abs(slack).max(initial=LEAST_SLACK)
        work.W[:] = np.maximum(slack, INSIDE * largest)
        work.Z[:] = np.maximum(work.Z, INSIDE * work.Z.max(initial=LEAST_MULTIPLIER))
        return True
