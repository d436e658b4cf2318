"""Box LCPs by pivoting: the loop around the compiled stages.

An `Attempt` solves a copy of the problem that is scaled to a unit diagonal. Its
solution is checked on the caller's data.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from namlcp.lcp.criterion import are_met, is_solved_by_zero
from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.pivoting import pivot as stages
from namlcp.lcp.pivoting.homogeneous import CLEAR, CLEARER, homogeneous_path
from namlcp.lcp.pivoting.interior import follow
from namlcp.lcp.pivoting.large_system import LargeSystem
from namlcp.lcp.pivoting.pivot import pivot, resume
from namlcp.lcp.pivoting.rays import proof
from namlcp.lcp.pivoting.state import PivotMemory, best_point
from namlcp.lcp.prepared import Prepared
from namlcp.limits import Limits
from namlcp.linalg import PSD_TOLERANCE
from namlcp.residuals import natural_residuals
from namlcp.status import Status

ACCURACY = 1e-9
"""Default eps_rel."""

MAX_FACTORISATIONS = 5000
"""Factorisations at most, by default."""

BITSETS = 20_000
"""Largest order that `linalg.ldl` orders for elimination: its bitsets take 50 MB."""

BLOCK_ORDER, BLOCK_ENTRIES = 2000, 20_000
"""Sparse symmetric problems with more unknowns and more entries than this are factored
in blocks; smaller ones are solved faster in one compiled call."""

DENSE_ORDER = 600
"""Largest order at which sparse nonsymmetric systems are solved by dense LU, and at
which a symmetric problem that stalled is retried with rho = 0."""

UNSEEN, MOST_AT_ONCE = 10_000_000, 50
"""Multiplications and factorisations at most between two checks of the deadline: about
10 ms. A single factorisation may take longer."""

CHEAP_ORDER, LAST_STEPS = 100, 20
"""If A is known to be no P-matrix: largest order at which the interior path is tried,
and factorisations allowed after it."""

PATH_STEPS, LARGE_PATH_STEPS = 60, 150
"""Interior-point steps at most: in `interior.follow` and in `LargeSystem.follow`."""

PATH_CHUNK = 5
"""Interior-point steps at most in one compiled call."""

PATH_TARGET = 1e-8
"""Scaled Res, relative to its value at clip(0), at which the interior path ends."""

NO_START = np.empty(0)
"""z0 where there is none."""

HALTS = stages.STAGNATED, stages.STUCK
"""Codes of `pivot` that tell of no progress."""


def solve_box(
    lcp: LCP, z0: np.ndarray | None, limits: Limits, ask_convex: bool = False
) -> Outcome:
    """Solve a box LCP by pivoting.

    limits.max_iter counts factorisations. With ask_convex, one more factorisation tests
    whether a symmetric A is positive semidefinite; outcome.convex has the result.
    """
    attempt = Attempt(lcp, z0, limits, ask_convex)
    attempt.run()
    return outcome_of(attempt)


def outcome_of(attempt: "Attempt") -> Outcome:
    """Return the checked outcome of an attempt after `run`; try again if it stalled."""
    lcp, limits = attempt.lcp, attempt.limits
    with np.errstate(all="ignore"):  # singular systems overflow, which is detected
        outcome = attempt.outcome()
        stalled = outcome.status is Status.STALLED and lcp.matrix.symmetric
        used_up = outcome.iterations >= attempt.most
        if not stalled or used_up or outcome.beyond or lcp.q.size > DENSE_ORDER:
            return outcome
        # rho may dominate an ill-conditioned matrix. As "nonsymmetric" rho begins at 0.
        again = lcp._replace(matrix=Prepared.unchecked(lcp.A, False))
        retry = Attempt(again, outcome.z, limits, False, outcome.iterations)
        retry.run()
        retried = retry.outcome()
    if retried.status is Status.SOLVED or retried.ray is not None:
        return retried._replace(convex=outcome.convex)
    return outcome._replace(iterations=retried.iterations)


class Attempt:
    """One attempt to solve a box LCP: its memory, and the stages written in Python."""

    def __init__(
        self,
        lcp: LCP,
        z0: np.ndarray | None,
        limits: Limits,
        ask_convex: bool,
        before: int = 0,
    ) -> None:
        """Copy the problem; `before` counts the factorisations of earlier attempts."""
        self.lcp, self.limits, self.before = lcp, limits, before
        self.path_end = before  # factorisations when an interior path had ended
        self.beyond = False  # whether the problem was left to methods for any matrix
        self.most = limits.max_iter or MAX_FACTORISATIONS
        n = lcp.q.size
        start = NO_START if z0 is None else z0
        self.work = PivotMemory(lcp.matrix.columns, lcp.q, lcp.lower, lcp.upper, start)
        now = self.work.now
        now.eps_abs, now.eps_rel = limits.eps_abs, limits.eps_rel
        now.factorisations, now.symmetric = before, lcp.matrix.symmetric
        compressed = not now.is_dense
        large = compressed and now.symmetric and in_blocks(n, now.entries)
        by_lu = compressed and not now.symmetric and n > DENSE_ORDER
        now.external_solve = large or by_lu
        now.ask_convex = ask_convex and not large
        self.large = LargeSystem(self.work) if large else None
        self.ask_convex = ask_convex

    def run(self) -> None:
        """Run the method; `status` and `ray` are what `drive` returns."""
        with np.errstate(all="ignore"):  # as in `outcome_of`
            self.status, self.ray = self.drive()

    def outcome(self) -> Outcome:
        """Check and, where the check fails, run again; z = clip(0) comes last."""
        lcp, now, status, ray = self.lcp, self.work.now, self.status, self.ray
        if self.large and self.ask_convex and status is Status.SOLVED:
            now.convex = self.large.is_convex()
        z, w, status = self.checked(status)
        if status is Status.STALLED and self.may_be_decided():
            first = z, w
            now.best_residual, now.solved = math.inf, False
            self.run()
            ray = self.ray
            z, w, status = self.checked(self.status)
            is_better = lcp.residual(z, w) <= lcp.residual(*first)
            if status is not Status.SOLVED and not is_better:
                z, w = first
        if status is Status.STALLED and is_solved_by_zero(lcp):
            z = lcp.start()
            w, status = lcp.w(z), Status.SOLVED
        count = now.factorisations
        return Outcome(
            status, z, w, count, "pivoting", ray, None, now.convex, beyond=self.beyond
        )

    def best(self) -> np.ndarray:
        """Return the best z so far in the caller's scaling."""
        return best_point(self.work.address, self.lcp.lower, self.lcp.upper)

    def checked(self, status: Status) -> tuple[np.ndarray, np.ndarray, Status]:
        """Return the best z, its w, and STALLED in place of SOLVED if they fail."""
        z, size = self.best(), self.work.now.size
        w = self.lcp.w(z)
        if status is Status.SOLVED and size > 0.0:
            _, _, lower, upper = self.lcp
            root = 1.0 / self.work.d
            residuals = natural_residuals(z, w, lower, upper, root)
            if not are_met(*self.limits.tolerances, size, *residuals):
                status = Status.STALLED
        return z, w, status

    def drive(self) -> tuple[Status, np.ndarray | None]:
        """Call `pivot` until it is done, and do what its return codes ask for.

        Return the status and, with UNSOLVABLE, a certificate or None. A second call
        rejects the solution of the first.
        """
        work, now, limits = self.work, self.work.now, self.limits
        chunk = 1 if limits.report is not None else at_once(work.n)
        code = stages.STUCK if now.started else stages.MORE
        status = Status.SOLVED
        while code != stages.DONE:
            done, limit = now.factorisations, self.most
            if code in HALTS and self.may_be_decided():
                ray = self.decide(limit)
                self.report()
                if ray is not None:
                    return Status.UNSOLVABLE, ray
                done, code = now.factorisations, stages.MORE
            if code in HALTS or now.path_followed:
                self.beyond = self.is_beyond(code)
            if code == stages.STUCK or self.beyond:
                status = Status.STALLED
                break
            if done >= limit:
                status = Status.MAX_ITER
                break
            if done > self.before and limits.deadline.reached():
                status = Status.TIME_LIMIT
                break
            if code == stages.RAY:
                ray = proof(self.lcp, work.d, work.rhs * work.d)
                if ray is not None:
                    return Status.UNSOLVABLE, ray
            elif code == stages.STAGNATED:
                self.change_course()
                if limits.deadline.reached():
                    status = Status.TIME_LIMIT
                    break
            if code == stages.FREE_SYSTEM:
                self.solve_free_system()
                code = resume(work.address)
            else:
                code = pivot(work.address, min(chunk, limit - done))
            if now.factorisations > done:
                self.report()
        return Status.SOLVED if now.solved else status, None

    def is_beyond(self, code: int) -> bool:
        """Tell whether to leave the problem to methods for any matrix.

        That is where A is no P-matrix and the interior path, tried if it is cheap, has
        not led to a solution soon; or where free systems are factored by sparse LU:
        Murty's rule takes too many of these.
        """
        now = self.work.now
        if code == stages.STUCK:
            due = True
        elif code == stages.STAGNATED:
            due = now.path_followed or self.work.n > CHEAP_ORDER
        else:
            late = now.factorisations > self.path_end + LAST_STEPS
            due = now.path_followed and late
        by_lu = now.external_solve and not self.large and not now.path_followed
        if by_lu and code in HALTS:
            return True
        return due and (now.not_p or self.lcp.matrix.is_general)

    def report(self) -> None:
        """Report factorisations, Res of the best z, and how many states are bounded."""
        if self.limits.report is not None:
            active, z = np.count_nonzero(self.work.state), self.best()
            residual = self.lcp.residual(z, self.lcp.w(z))
            self.limits.report(self.work.now.factorisations, residual, active)

    def solve_free_system(self) -> None:
        """Solve the free system in blocks, or by sparse LU if A is not symmetric."""
        if self.large:
            self.large.solve()
            return
        work, now = self.work, self.work.now
        now.factorisations += 1
        free = np.flatnonzero(work.state == 0)
        shift = now.rho * sparse.eye_array(free.size)
        A = self.scaled_matrix()[:, free].tocsr()[free]
        try:
            work.z[free] = splu(sparse.csc_array(A + shift)).solve(work.rhs[free])
        except RuntimeError:  # exactly singular
            work.z[free] = np.nan

    def change_course(self) -> None:
        """Follow the interior path the first time; later restart with a larger rho."""
        now, deadline = self.work.now, self.limits.deadline
        self.path_end = now.factorisations
        if now.path_followed:
            now.rho = min(1000.0 * now.rho, stages.MOST_RHO)
            now.line_search = now.symmetric
            self.start_at_centre()
        elif self.large:
            self.large.follow(PATH_TARGET, LARGE_PATH_STEPS, deadline)
        else:
            chunk = PATH_CHUNK
            if now.is_dense:  # sparse steps here are short
                chunk = min(chunk, at_once(self.work.n))
            steps = 0
            while steps < PATH_STEPS:
                budget = min(chunk, PATH_STEPS - steps)
                taken = follow(self.work.address, PATH_TARGET, budget)
                steps += taken
                if taken < budget or deadline.reached():
                    return

    def start_at_centre(self) -> None:
        """Restart block pivoting at the proximal point with the current rho."""
        work, now, centre = self.work, self.work.now, self.work.centre
        w = work.q + work.d * (self.lcp.A @ (work.d * centre))
        work.x[:] = centre
        work.s[:] = centre - w / (now.rho if now.line_search else 1.0)
        s = centre - w
        work.state[:] = np.where(s <= work.lower, -1, s >= work.upper)
        now.fewest_wrong = w.size + 1
        now.patience = stages.SEARCH_STEPS if now.line_search else stages.BLOCK_STEPS

    def may_be_decided(self) -> bool:
        """Tell whether to follow the homogeneous path: A != A' is semidefinite.

        A definite A has a solution, which `interior` finds as well if it may be used.
        """
        now = self.work.now
        if now.symmetric or now.path_followed:
            return False
        matrix = self.lcp.matrix
        if not now.external_solve and matrix.is_semidefinite(-PSD_TOLERANCE):
            return False
        return matrix.is_semidefinite(PSD_TOLERANCE)

    def decide(self, limit: int) -> np.ndarray | None:
        """Follow the homogeneous path; return a certificate, or restart from `best`."""
        work, now, deadline = self.work, self.work.now, self.limits.deadline
        now.path_followed = True
        scaled, clear = self.scaled_matrix(), CLEAR
        for point in homogeneous_path(scaled, work.q, work.lower, work.upper):
            if point.ratio < 1.0:
                z = np.clip(point.z, work.lower, work.upper)
                w = work.q + scaled @ z
                found, plain = natural_residuals(z, w, work.lower, work.upper, work.d)
                if found < now.best_residual:
                    now.best_residual, work.best[:] = found, z
                    tolerances = self.limits.tolerances
                    now.solved = are_met(*tolerances, now.size, plain, found)
            elif point.ratio > clear:
                clear = CLEARER * point.ratio
                ray = proof(self.lcp, work.d, point.z * work.d)
                if ray is not None:
                    return ray
            if now.solved or now.factorisations >= limit or deadline.reached():
                break
            now.factorisations += 1
        work.centre[:] = work.best
        now.rho = stages.LEAST_RHO
        self.start_at_centre()
        return None

    def scaled_matrix(self) -> Any:
        """Return the matrix with a unit diagonal, dense or CSC."""
        scaled, n = self.work.scaled, self.work.n
        if scaled.dense.shape[0] == n:
            return scaled.dense.T
        arrays = scaled.data, scaled.indices, scaled.indptr
        return sparse.csc_array(arrays, shape=(n, n))


def in_blocks(n: int, entries: int) -> bool:
    """Tell whether the systems of a sparse symmetric matrix are factored in blocks."""
    return n > BITSETS or (n > BLOCK_ORDER and entries > BLOCK_ENTRIES)


def at_once(n: int) -> int:
    """Return how many factorisations of order n may pass between deadline checks."""
    return int(min(max(3 * UNSEEN // max(n, 1) ** 3, 1), MOST_AT_ONCE))
