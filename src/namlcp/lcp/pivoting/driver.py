"""Box LCPs by pivoting: what surrounds the compiled loop.

An `Attempt` solves a copy of the problem that is scaled to a unit diagonal. Its
solution is checked on the caller's data.
"""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP, is_solved_by_zero
from namlcp.lcp.pivoting.pivot import Code, pivot
from namlcp.lcp.pivoting.rays import proof
from namlcp.lcp.pivoting.state import Pivoting
from namlcp.lcp.shifted import HELD, Quasidefinite, Shifted
from namlcp.limits import Limits
from namlcp.linalg.csc import submatrix
from namlcp.linalg.definite import PSD_SLACK, has_positive_pivots
from namlcp.measure import are_met, natural_residuals
from namlcp.outcome import Outcome
from namlcp.status import Status

# Default eps_rel; factorisations at most, by default.
ACCURACY, MAX_FACTORISATIONS = 1e-9, 5000
# Sparse symmetric problems with more unknowns and more entries than this are left to
# `LargeSystem`; smaller ones are solved faster by compiled code alone.
LARGE_ORDER, LARGE_ENTRIES = 2000, 20_000
# Largest order at which sparse nonsymmetric systems are solved by dense LU.
DENSE_ORDER = 600
NO_START = np.empty(0)

STATUSES = {
    Code.DONE: Status.SOLVED,
    Code.HALTED: Status.STALLED,
    Code.MOST: Status.MAX_ITER,
    Code.LATE: Status.TIME_LIMIT,
    Code.RAY: Status.UNSOLVABLE,
}


class LargeSystem:
    """The factors of the current free system of a large sparse symmetric problem.

    Unknowns at their bounds are held by huge diagonal entries, so that the elimination
    order of one pattern serves many free systems.
    """

    def __init__(self, n: int) -> None:
        self.free = np.zeros(n, dtype=bool)  # unknowns in the factors
        self.rho = np.nan  # of the factors
        self.member = np.zeros(n, dtype=bool)  # unknowns in the pattern
        self.orders = 0  # elimination orders computed so far
        self.system: Any = None  # a Quasidefinite
        self.factors: Any = None

    def cover(self, work: Pivoting, free: np.ndarray) -> None:
        """Order the free unknowns and the earlier members.

        From the third time on, or if these are more than half of all unknowns, all
        unknowns with l < u are ordered, too.
        """
        self.orders += 1
        member = free | self.member
        if self.orders > 2 or 2 * np.count_nonzero(member) > member.size:
            member = free | work.is_open
        self.member = member
        rows = np.flatnonzero(member)
        part = submatrix(work.scaled_matrix, rows, rows)
        self.system = Quasidefinite(part, np.ones(rows.size))

    def solve(self, work: Pivoting) -> None:
        """Write to z the solution of the free system of `pivot`, NaN if singular."""
        free, rho = work.state == 0, work.rho
        if rho != self.rho or np.any(free != self.free):
            work.factorisations += 1
            if self.system is None or np.any(free > self.member):
                self.cover(work, free)
            shift = np.where(free, rho, HELD)[self.member]
            self.factors = self.system.factors(shift)
            self.free, self.rho = free, rho
        if self.factors is None:
            work.z[free] = np.nan
        else:
            rhs = np.where(free, work.rhs, 0.0)[self.member]
            work.z[free] = self.factors.solve(rhs)[free[self.member]]

    def is_convex(self, work: Pivoting) -> bool:
        """Tell whether A + `PSD_SLACK` I is positive definite."""
        if not np.all(work.has_unit):
            return False
        slack = PSD_SLACK * sparse.eye_array(work.n)
        upper = sparse.triu(work.scaled_matrix)
        return has_positive_pivots(sparse.csc_array(upper + slack))


class Attempt(Pivoting):
    """One attempt to solve a box LCP: its memory, and the steps written in Python.

    limits.max_iter counts factorisations.
    """

    def __init__(
        self, lcp: LCP, z0: np.ndarray | None, limits: Limits, ask_convex: bool
    ) -> None:
        """Copy the problem.

        ask_convex: test by one more factorisation whether a symmetric A is positive
        semidefinite; `outcome` sets `convex` to the result.
        """
        matrix, n = lcp.matrix, lcp.q.size
        start = NO_START if z0 is None else z0
        vectors = lcp.q, lcp.lower, lcp.upper, start
        super().__init__(matrix.columns, vectors, matrix.symmetric, limits.deadline.at)
        self.lcp, self.limits = lcp, limits
        self.ray: np.ndarray | None = None
        self.most = limits.max_iter or MAX_FACTORISATIONS
        self.eps_abs, self.eps_rel = limits.eps_abs, limits.eps_rel
        many = n > LARGE_ORDER and self.entries > LARGE_ENTRIES
        large = not self.is_dense and self.symmetric and many
        by_lu = not self.is_dense and not self.symmetric and n > DENSE_ORDER
        self.is_external = large or by_lu
        self.ask_convex = ask_convex and not large
        self.large = LargeSystem(n) if large else None
        self.is_asked = ask_convex

    def run(self) -> None:
        """Run the method; `status` tells how it ended, `ray` is a certificate."""
        self.status = STATUSES[pivot(self)]
        if self.solved and self.ray is None:
            self.status = Status.SOLVED

    def outcome(self) -> Outcome:
        """Check the point that was found; where that fails, try z = clip(0)."""
        lcp = self.lcp
        with np.errstate(all="ignore"):
            if self.large and self.is_asked and self.status is Status.SOLVED:
                self.convex = self.large.is_convex(self)
            z, w, status = self.checked(self.status)
        if status is Status.STALLED and is_solved_by_zero(lcp):
            z = lcp.start()
            w, status = lcp.w(z), Status.SOLVED
        count = self.factorisations
        return lcp.outcome(status, z, w, count, "pivoting", ray=self.ray)

    def best(self) -> np.ndarray:
        return self.best_point(self.lcp.lower, self.lcp.upper)

    def checked(self, status: Status) -> tuple[np.ndarray, np.ndarray, Status]:
        """Return the best z, its w, and STALLED in place of SOLVED if they fail."""
        z, size = self.best(), self.size
        w = self.lcp.w(z)
        if status is Status.SOLVED and size > 0.0:
            _, _, lower, upper = self.lcp
            residuals = natural_residuals(z, w, lower, upper, 1.0 / self.d)
            if not are_met(*self.limits.tolerances, size, *residuals):
                status = Status.STALLED
        return z, w, status

    def is_unsolvable(self) -> bool:
        with np.errstate(all="ignore"):  # the direction may overflow
            self.ray = proof(self.lcp, self.d, self.rhs * self.d)
        return self.ray is not None

    def report(self) -> None:
        if self.limits.report is not None:
            active, z = np.count_nonzero(self.state), self.best()
            residual = self.lcp.residual(z, self.lcp.w(z))
            self.limits.report(self.factorisations, residual, active)

    def solve_free_system(self) -> None:
        """Solve a large free system, or by sparse LU if A is not symmetric."""
        if self.large:
            self.large.solve(self)
            return
        self.factorisations += 1
        free = np.flatnonzero(self.state == 0)
        A = self.scaled_matrix[:, free].tocsr()[free]
        factors = Shifted(A).factors(np.full(free.size, self.rho))
        self.z[free] = np.nan if factors is None else factors.solve(self.rhs[free])
