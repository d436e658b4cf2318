"""Box LCPs by pivoting: what surrounds the compiled loop.

An `Attempt` solves a copy of the problem that is scaled to a unit diagonal. Its
solution is checked on the caller's data.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from namlcp.lcp.criterion import is_solved_by_zero
from namlcp.lcp.data import LCP
from namlcp.lcp.pivoting.large_system import LargeSystem
from namlcp.lcp.pivoting.pivot import Code, pivot
from namlcp.lcp.pivoting.rays import proof
from namlcp.lcp.pivoting.state import Pivoting
from namlcp.limits import Limits
from namlcp.measure import are_met, natural_residuals
from namlcp.outcome import Outcome
from namlcp.status import Status

ACCURACY = 1e-9
"""Default eps_rel."""

MAX_FACTORISATIONS = 5000
"""Factorisations at most, by default."""

LARGE_ORDER, LARGE_ENTRIES = 2000, 20_000
"""Sparse symmetric problems with more unknowns and more entries than this are left to
`LargeSystem`; smaller ones are solved faster by compiled code alone."""

DENSE_ORDER = 600
"""Largest order at which sparse nonsymmetric systems are solved by dense LU."""

NO_START = np.empty(0)
"""z0 where there is none."""

STATUSES = {
    Code.DONE: Status.SOLVED,
    Code.HALTED: Status.STALLED,
    Code.MOST: Status.MAX_ITER,
    Code.LATE: Status.TIME_LIMIT,
    Code.RAY: Status.UNSOLVABLE,
}


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
        shift = self.rho * sparse.eye_array(free.size)
        A = self.scaled_matrix[:, free].tocsr()[free]
        try:
            self.z[free] = splu(sparse.csc_array(A + shift)).solve(self.rhs[free])
        except RuntimeError:  # exactly singular
            self.z[free] = np.nan
