"""Box LCPs by pivoting: what surrounds the compiled loop, and its certificates.

A direction v proves that there is no solution: if v_i <= 0 where the upper bound is
finite and v_i >= 0 where the lower one is, then v'w >= 0 for every solution, which
contradicts v'w = q'v + z'(A'v) < 0 for every z in the box. This holds for every A; if A
is symmetric and semidefinite, A v = 0.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg, lsmr

from namlcp.arrays import from_arrays
from namlcp.lcp.data import LCP, Criterion, is_solved_by_zero
from namlcp.lcp.pivoting.pivot import Code, pivot
from namlcp.lcp.pivoting.state import Pivoting
from namlcp.lcp.shifted import HELD, Shifted
from namlcp.limits import Limits
from namlcp.linalg.csc import submatrix
from namlcp.status import Outcome, Status

# Factorisations at most, by default: of pivoting, and of a search after it.
MAX_FACTORISATIONS = 5000
# Sparse symmetric problems with more unknowns and more entries than this have their
# free systems factored by `linalg.factors`, which is faster where there is much fill.
LARGE_ORDER, LARGE_ENTRIES = 2000, 20_000
# Largest order at which sparse nonsymmetric systems are solved by dense LU, and v is
# corrected by a dense least-squares problem.
DENSE_ORDER = 600
# Scaled entry of v, relative to the largest one, that counts as 0.
RAY_TOLERANCE = 1e-9
# Entry of A'v, relative to |A|'|v|, that counts as 0; modulus of max (q'v + z'A'v),
# relative to its terms, that does.
SLOPE_ROUNDING, LEAST_FALL = 1e-13, 1e-10
# Entries of A'v beyond this, relative to |A|'|v|, may stay if A is not symmetric and a
# finite bound on z_i limits the product with z_i.
CLEAR_SLOPE = 1e-5
# Of an iterative correction: relative accuracy, steps and multiplications at most.
CORRECTION, CORRECTION_STEPS, MULTIPLICATIONS = 1e-6, 2000, 200_000_000

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
    """One attempt to solve a box LCP; limits.max_iter counts factorisations.

    ask_convex: test by one more of them whether a symmetric A is positive semidefinite;
    `convex` is then the result. `ray` is a certificate.
    """

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
        self.status = STATUSES[pivot(self)]
        if self.solved and self.ray is None:
            self.status = Status.SOLVED

    def outcome(self) -> Outcome:
        """Check the point that was found; where that fails, try z = clip(0)."""
        lcp, status, z = self.lcp, self.status, self.best_point()
        criterion = Criterion(lcp, self.limits)
        criterion.size = self.size
        with np.errstate(all="ignore"):
            w = lcp.w(z)
            if status is Status.SOLVED and self.size > 0.0:
                if not criterion.accepts(z, w):
                    status = Status.STALLED
        if status is Status.STALLED and is_solved_by_zero(lcp):
            z = lcp.start()
            w, status = lcp.w(z), Status.SOLVED
        count = self.factorisations
        return lcp.outcome(status, z, w, count, "pivoting", ray=self.ray)

    def is_unsolvable(self) -> bool:
        with np.errstate(all="ignore"):  # the direction may overflow
            self.ray = proof(self.lcp, self.vector(RHS) * self.vector(D))
        return self.ray is not None

    def report(self) -> None:
        if self.limits.report is not None:
            active, z = np.count_nonzero(self.state()), self.best_point()
            residual = self.lcp.residual(z, self.lcp.w(z))
            self.limits.report(self.factorisations, residual, active)

    def solve_free_system(self) -> None:
        """Write to z the solution of the free system, NaN if singular.

        Bounded unknowns stay in the factors of a symmetric matrix, held by huge
        diagonal entries, so that one elimination order serves all free systems.
        """
        free, z = self.state() == 0, self.vector(Z)
        if self.rho != self.factored or (free != self.free).any():
            self.factorisations += 1
            self.free, self.factored = free, self.rho
            if self.system is None or not self.symmetric:
                self.member = free | self.symmetric
                rows = np.flatnonzero(self.member)
                indptr, indices, _ = self.lcp.matrix.columns
                scaled = self.memory[10 * free.size :][: self.entries]
                A = from_arrays((indptr, indices, scaled), (free.size, free.size))
                A = submatrix(A, rows, rows)
                self.system = Shifted(A, np.ones(rows.size) if self.symmetric else None)
            shift = np.where(free, self.rho, HELD)[self.member]
            self.factors = self.system.factors(shift)
        z[free] = np.nan
        if self.factors is not None:
            rhs = np.where(free, self.vector(RHS), 0.0)[self.member]
            z[free] = self.factors.solve(rhs)[free[self.member]]


# ---- certificates


def proof(lcp: LCP, v: np.ndarray) -> np.ndarray | None:
    """Return v, corrected and scaled, if it proves that there is no solution.

    It has few correct digits, as 1/rho has magnified its rounding errors, or a path has
    ended. It is corrected to A'v = 0, and if that fails, except where `CLEAR_SLOPE`
    allows more.
    """
    d = 1.0 / lcp.matrix.root
    largest = np.max(np.abs(v / d))
    if not 0.0 < largest < math.inf:
        return None
    v = np.where(np.abs(v / d) <= RAY_TOLERANCE * largest, 0.0, v / largest)
    has_lower, has_upper = lcp.lower > -math.inf, lcp.upper < math.inf
    if ((v > 0.0) & has_upper | (v < 0.0) & has_lower).any():
        return None
    slope, terms = slopes(lcp, d, v)
    tries = []
    if (np.abs(slope) > SLOPE_ROUNDING * terms).any():
        tries.append(np.ones(v.size, dtype=bool))
        allowed = (slope < 0.0) & has_lower | (slope > 0.0) & has_upper
        clear = allowed & (np.abs(slope) > CLEAR_SLOPE * terms)
        if clear.any() and not lcp.matrix.symmetric:
            tries.append(~clear)
    for rows in tries:
        found = corrected(lcp, d, v, rows)
        if found is not None:
            return found
    return proven(lcp, d, v)


def slopes(lcp: LCP, d: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return d * (lcp.A.T @ v), d * (abs(lcp.A).T @ np.abs(v))


def proven(lcp: LCP, d: np.ndarray, v: np.ndarray) -> np.ndarray | None:
    """Return v scaled to q'v + max z'(A'v) = -1 if it is a proof, else None."""
    slope, terms = slopes(lcp, d, v)
    bound = np.where(slope > 0.0, lcp.upper, lcp.lower) / d
    # Only rounding is ignored: a small slope may mean a solution far away.
    moving = np.isfinite(bound) | (np.abs(slope) > SLOPE_ROUNDING * terms)
    fall = float(lcp.q @ v + bound[moving] @ slope[moving])
    total = float(np.abs(lcp.q) @ np.abs(v) + np.abs(bound[moving]) @ terms[moving])
    return v / -fall if -math.inf < fall < -LEAST_FALL * total else None


def corrected(
    lcp: LCP, d: np.ndarray, v: np.ndarray, rows: np.ndarray
) -> np.ndarray | None:
    """Return the proof near v with (A'v)_rows = 0 and no sign changed, or None.

    The change D u is the least in the scaling d, (A'D u)_rows = (A'v)_rows.
    """
    A, support = lcp.A, np.flatnonzero(v)
    steps = max(min(CORRECTION_STEPS, MULTIPLICATIONS // (A.size + v.size)), 1)
    slope = d * (A.T @ v)
    B = sparse.diags_array(d[support]) @ A[support] @ sparse.diags_array(d)
    B = B.T[rows]
    if v.size <= DENSE_ORDER:
        B = B.toarray() if sparse.issparse(B) else B
        u = np.linalg.lstsq(B, slope[rows], rcond=None)[0]
    elif lcp.matrix.symmetric:
        B = B[support].tocsr() if sparse.issparse(B) else B[support]
        u = cg(B, slope[support], rtol=CORRECTION, maxiter=steps)[0]
    else:
        end = {"atol": CORRECTION, "btol": CORRECTION, "maxiter": steps}
        u = lsmr(B, slope[rows], **end)[0]
    found = v.copy()
    found[support] -= d[support] * u
    return None if (found * v < 0.0).any() else proven(lcp, d, found)
