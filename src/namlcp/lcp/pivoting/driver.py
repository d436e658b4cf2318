"""Box LCPs by pivoting: what surrounds the compiled loop."""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.data import LCP, is_solved_by_zero
from namlcp.lcp.pivoting.pivot import Code, pivot
from namlcp.lcp.pivoting.rays import proof
from namlcp.lcp.pivoting.state import Pivoting
from namlcp.lcp.shifted import HELD, Shifted
from namlcp.limits import Limits
from namlcp.linalg.csc import submatrix
from namlcp.measure import are_met, natural_residuals
from namlcp.status import Outcome, Status

# Factorisations at most, by default.
MAX_FACTORISATIONS = 5000
# Sparse symmetric problems with more unknowns and more entries than this have their
# free systems factored by `linalg.factors`, which is faster where there is much fill.
LARGE_ORDER, LARGE_ENTRIES = 2000, 20_000
# Largest order at which sparse nonsymmetric systems are solved by dense LU.
DENSE_ORDER = 600

# Vectors in the memory: the scaled matrix is D A D; the iterate, the right-hand side.
D, Z, RHS = range(3)

STATUSES = {
    Code.DONE: Status.SOLVED,
    Code.HALTED: Status.STALLED,
    Code.MOST: Status.MAX_ITER,
    Code.LATE: Status.TIME_LIMIT,
    Code.RAY: Status.UNSOLVABLE,
}


class Attempt(Pivoting):
    """One attempt to solve a box LCP, scaled to a unit diagonal, and its memory."""

    ray: np.ndarray | None = None
    # The last factors: free unknowns and rho; unknowns in them, free or held.
    free: np.ndarray
    factored = np.nan
    member: np.ndarray
    system: Shifted | None = None
    factors: Any = None

    def __init__(
        self, lcp: LCP, z0: np.ndarray | None, limits: Limits, ask_convex: bool
    ) -> None:
        """Copy the problem; limits.max_iter counts factorisations.

        ask_convex: test by one more of them whether a symmetric A is positive
        semidefinite; `convex` is then the result.
        """
        matrix, n = lcp.matrix, lcp.q.size
        vectors = lcp.q, lcp.lower, lcp.upper, np.empty(0) if z0 is None else z0
        super().__init__(matrix.columns, vectors, matrix.symmetric, limits.deadline.at)
        self.lcp, self.limits = lcp, limits
        self.most = limits.max_iter or MAX_FACTORISATIONS
        self.eps_abs, self.eps_rel = limits.eps_abs, limits.eps_rel
        large = n > LARGE_ORDER and self.entries > LARGE_ENTRIES
        large = large if self.symmetric else n > DENSE_ORDER
        self.is_external = large and not self.is_dense
        self.ask_convex = ask_convex

    def run(self) -> None:
        """Run the method; `status` tells how it ended, `ray` is a certificate."""
        self.status = STATUSES[pivot(self)]
        if self.solved and self.ray is None:
            self.status = Status.SOLVED

    def outcome(self) -> Outcome:
        """Check the point that was found; where that fails, try z = clip(0)."""
        lcp, status, z = self.lcp, self.status, self.best()
        with np.errstate(all="ignore"):
            w = lcp.w(z)
            if status is Status.SOLVED and self.size > 0.0:
                root = lcp.matrix.root
                residuals = natural_residuals(z, w, lcp.lower, lcp.upper, root)
                if not are_met(*self.limits.tolerances, self.size, *residuals):
                    status = Status.STALLED
        if status is Status.STALLED and is_solved_by_zero(lcp):
            z = lcp.start()
            w, status = lcp.w(z), Status.SOLVED
        count = self.factorisations
        return lcp.outcome(status, z, w, count, "pivoting", ray=self.ray)

    def best(self) -> np.ndarray:
        return self.best_between(self.lcp.lower, self.lcp.upper)

    def is_unsolvable(self) -> bool:
        with np.errstate(all="ignore"):  # the direction may overflow
            self.ray = proof(self.lcp, self.vector(RHS) * self.vector(D))
        return self.ray is not None

    def report(self) -> None:
        if self.limits.report is not None:
            active, z = np.count_nonzero(self.state()), self.best()
            residual = self.lcp.residual(z, self.lcp.w(z))
            self.limits.report(self.factorisations, residual, active)

    def solve_free_system(self) -> None:
        """Write to z the solution of the free system of `pivot`, NaN if singular.

        Bounded unknowns may stay in the factors of a symmetric matrix, held by huge
        diagonal entries, so that one elimination order serves several free systems.
        """
        free, z = self.state() == 0, self.vector(Z)
        if self.rho != self.factored or (free != self.free).any():
            self.factorisations += 1
            self.free, self.factored = free, self.rho
            if self.system is None or not self.symmetric:
                lower, upper = self.lcp.lower, self.lcp.upper
                self.member = lower < upper if self.symmetric else free
                rows = np.flatnonzero(self.member)
                indptr, indices, _ = self.lcp.matrix.columns
                scaled = self.memory[10 * free.size :][: self.entries]
                A = sparse.csc_array((scaled, indices, indptr))
                A = submatrix(A, rows, rows)
                self.system = Shifted(A, np.ones(rows.size) if self.symmetric else None)
            shift = np.where(free, self.rho, HELD)[self.member]
            self.factors = self.system.factors(shift)
        z[free] = np.nan
        if self.factors is not None:
            rhs = np.where(free, self.vector(RHS), 0.0)[self.member]
            z[free] = self.factors.solve(rhs)[free[self.member]]
