"""Box LCPs by pivoting: the loop around the compiled stages.

An `Attempt` solves a copy of the problem that is scaled to a unit diagonal. Its
solution is checked on the caller's data.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from namlcp.lcp.criterion import are_met, is_solved_by_zero
from namlcp.lcp.data import LCP
from namlcp.lcp.pivoting import pivot as stages
from namlcp.lcp.pivoting.large_system import LargeSystem
from namlcp.lcp.pivoting.pivot import pivot, resume
from namlcp.lcp.pivoting.rays import proof
from namlcp.lcp.pivoting.state import PivotMemory, best_point
from namlcp.limits import Limits
from namlcp.outcome import Outcome
from namlcp.residuals import natural_residuals
from namlcp.status import Status

ACCURACY = 1e-9
"""Default eps_rel."""

MAX_FACTORISATIONS = 5000
"""Factorisations at most, by default."""

LARGE_ORDER, LARGE_ENTRIES = 2000, 20_000
"""Sparse symmetric problems with more unknowns and more entries than this are left to
`LargeSystem`; smaller ones are solved faster in one compiled call."""

DENSE_ORDER = 600
"""Largest order at which sparse nonsymmetric systems are solved by dense LU."""

UNSEEN, MOST_AT_ONCE = 10_000_000, 50
"""Multiplications and factorisations at most between two checks of the deadline: about
10 ms. A single factorisation may take longer."""

NO_START = np.empty(0)
"""z0 where there is none."""


class Attempt:
    """One attempt to solve a box LCP: its memory, and the stages written in Python.

    limits.max_iter counts factorisations.
    """

    def __init__(
        self, lcp: LCP, z0: np.ndarray | None, limits: Limits, ask_convex: bool
    ) -> None:
        """Copy the problem.

        ask_convex: test by one more factorisation whether a symmetric A is positive
        semidefinite; `outcome` sets work.now.convex to the result.
        """
        self.lcp, self.limits = lcp, limits
        self.most = limits.max_iter or MAX_FACTORISATIONS
        n = lcp.q.size
        start = NO_START if z0 is None else z0
        self.work = PivotMemory(lcp.matrix.columns, lcp.q, lcp.lower, lcp.upper, start)
        now = self.work.now
        now.eps_abs, now.eps_rel = limits.eps_abs, limits.eps_rel
        now.symmetric = lcp.matrix.symmetric
        compressed = not now.is_dense
        many = n > LARGE_ORDER and now.entries > LARGE_ENTRIES
        large = compressed and now.symmetric and many
        by_lu = compressed and not now.symmetric and n > DENSE_ORDER
        now.external_solve = large or by_lu
        now.ask_convex = ask_convex and not large
        self.large = LargeSystem(self.work) if large else None
        self.ask_convex = ask_convex

    def run(self) -> None:
        """Run the method; `status` and `ray` are what `drive` returns."""
        self.status, self.ray = self.drive()

    def outcome(self) -> Outcome:
        """Check the point that was found; where that fails, try z = clip(0)."""
        lcp, now = self.lcp, self.work.now
        with np.errstate(all="ignore"):
            if self.large and self.ask_convex and self.status is Status.SOLVED:
                now.convex = self.large.is_convex()
            z, w, status = self.checked(self.status)
        if status is Status.STALLED and is_solved_by_zero(lcp):
            z = lcp.start()
            w, status = lcp.w(z), Status.SOLVED
        count = now.factorisations
        return lcp.outcome(status, z, w, count, "pivoting", ray=self.ray)

    def best(self) -> np.ndarray:
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

        Return the status and, with UNSOLVABLE, a certificate.
        """
        work, now, limits = self.work, self.work.now, self.limits
        chunk = 1
        if limits.report is None:
            chunk = min(max(3 * UNSEEN // max(work.n, 1) ** 3, 1), MOST_AT_ONCE)
        code, status = stages.MORE, Status.SOLVED
        while code != stages.DONE:
            done = now.factorisations
            if code == stages.HALTED:
                status = Status.STALLED
            elif done >= self.most:
                status = Status.MAX_ITER
            elif done > 0 and limits.deadline.reached():
                status = Status.TIME_LIMIT
            if status is not Status.SOLVED:
                break
            if code == stages.RAY:
                with np.errstate(all="ignore"):  # the direction may overflow
                    ray = proof(self.lcp, work.d, work.rhs * work.d)
                if ray is not None:
                    return Status.UNSOLVABLE, ray
            if code == stages.FREE_SYSTEM:
                self.solve_free_system()
                code = resume(work.address)
            else:
                code = pivot(work.address, min(chunk, self.most - done))
            if now.factorisations > done:
                self.report()
        return Status.SOLVED if now.solved else status, None

    def report(self) -> None:
        if self.limits.report is not None:
            active, z = np.count_nonzero(self.work.state), self.best()
            residual = self.lcp.residual(z, self.lcp.w(z))
            self.limits.report(self.work.now.factorisations, residual, active)

    def solve_free_system(self) -> None:
        """Solve a large free system, or by sparse LU if A is not symmetric."""
        if self.large:
            self.large.solve()
            return
        work, now = self.work, self.work.now
        now.factorisations += 1
        free = np.flatnonzero(work.state == 0)
        shift = now.rho * sparse.eye_array(free.size)
        A = work.scaled[:, free].tocsr()[free]
        try:
            work.z[free] = splu(sparse.csc_array(A + shift)).solve(work.rhs[free])
        except RuntimeError:  # exactly singular
            work.z[free] = np.nan
