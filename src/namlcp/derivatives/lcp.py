"""The derivative of the solution of a box LCP in all of its data.

Let B be the unknowns at a bound with w != 0 (and those that lower = upper fixes) and F
the others, where w = 0. Backward, from the gradients (gz, gw) of a scalar in z and w:

    rho_B = gw_B,   A_FF' rho_F = -(gz + A_BF' gw_B)_F,   mu = gz + A'rho  (0 on F)
    g_q = rho,   g_A = rho z',   g_lower, g_upper = mu at the bounds active there

Forward, along a direction of the data, with r = dA z + dq:

    dz_B = dlower or dupper,   A_FF dz_F = -(r + A_FB dz_B)_F,   dw_B = (A dz + r)_B

These hold where no unknown is at a bound with w = 0 and A_FF is regular. Elsewhere the
solution has kinks, and an element of the generalised Jacobian is chosen as for QPs:
unknowns at a bound with w = 0 count as free, or as fixed where A_FF is singular with
them. Along one direction dz then solves the LCP with A and r in which unknowns of F are
free, those of B fixed, and those at a bound with w = 0 have one bound.

From order LARGE_LCP on, matrices like those of differential equations are not factored:
a Krylov method with truncated multigrid cycles has the hierarchy of the solve.
"""

from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import lsmr, splu

from namlcp.checks import no_rows
from namlcp.derivatives.dense import sides_of_lcp
from namlcp.derivatives.gradients import LCPGradients, LCPTangent, change, rank_two_on
from namlcp.derivatives.qp import KKTFactors, refined
from namlcp.lcp.data import LCP, Operator, Prepared, lcp_data
from namlcp.lcp.methods import LARGE_LCP, solve_by_method
from namlcp.lcp.multigrid.hierarchy import hierarchy_of, solve_free
from namlcp.lcp.pivoting.pivot import ACCURACY
from namlcp.limits import Limits
from namlcp.linalg.csc import submatrix
from namlcp.status import Status

# Of multigrid solves, relative to the right-hand side.
RESIDUAL = 1e-12
# A z_i between its bounds adds to the terms of w as if it were at least this multiple
# of the largest one, in units that make diag(A) ones: w is 0 up to 1e-14 of that.
ERROR = 1e-6
# A matrix is singular if the ratio of its pivots is below this; singular values below
# this times its order count as 0.
SINGULAR = 1e-13


class LCPDerivative:
    """The derivative of one solution."""

    def __init__(self, lcp: LCP, given: Any, z: np.ndarray, w: np.ndarray) -> None:
        """Choose F and factor A_FF; `given`: A as the user stores it."""
        if isinstance(lcp.A, Operator):
            raise ValueError("derivatives need the entries of A, got a LinearOperator")
        self.lcp, self.given, self.z = lcp, given, z
        matrix, q, lower, upper = lcp
        free = (lower < z) & (z < upper)
        error = ERROR * np.max(matrix.root * np.abs(z), initial=0.0) / matrix.root
        terms = abs(matrix.A) @ (np.abs(z) + np.where(free, error, 0.0)) + np.abs(q)
        self.strict, self.whole = sides_of_lcp(terms, lower, upper, matrix.slopes, z, w)
        self.weak = int(np.count_nonzero(self.whole) - np.count_nonzero(self.strict))
        self.singular = False
        for side in (self.strict, self.whole) if self.weak else (self.strict,):
            self.side, self.free, self.factors = side, np.flatnonzero(side == 0), None
            is_large = matrix.is_sparse and self.free.size >= LARGE_LCP
            if not self.free.size or (is_large and hierarchy_of(matrix) is not None):
                break
            self.factors = factored(matrix, self.free)
            if self.factors.regular:
                break
            self.singular = True

    def backward(self, dz: Any, dw: Any) -> LCPGradients:
        q, side = self.lcp.q, self.side
        rho, mu = self.solve(change("dz", dz, "q", q), change("dw", dw, "q", q), True)
        lower, upper = np.where(side < 0, mu, 0.0), np.where(side > 0, mu, 0.0)

        def matrix(_: str) -> Any:
            return rank_two_on(self.given, rho, self.z, 0.0 * rho, self.z)

        return LCPGradients(rho, lower, upper, self.weak, self.singular, matrix)

    def forward(self, *changes: Any) -> LCPTangent:
        dz, dw = self.solve(*self.direction(self.side, *changes), False)
        return LCPTangent(dz, dw, self.weak, self.singular)

    def solve(self, r: Any, fixed: Any, transposed: bool) -> tuple[Any, Any]:
        """Return v and M v + r, M = A or A': v = fixed on B, M v + r = 0 on F."""
        M, free = self.lcp.A.T if transposed else self.lcp.A, self.free
        v = np.where(self.side != 0, fixed, 0.0)
        right = r + M @ v if v.any() else r
        if free.size:
            v[free] = -self.solve_free(right, transposed)
        return v, np.where(self.side != 0, M @ v + r, 0.0)

    def solve_free(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """Solve with A_FF or A_FF': by factors, or by cycles as long as these do."""
        free = self.free
        if self.factors is None:
            matrix = self.turned if transposed else self.lcp.matrix
            hierarchy = hierarchy_of(matrix)
            if hierarchy is not None:
                u, converged = solve_free(hierarchy, self.side == 0, right, RESIDUAL)
                if converged:
                    return u[free]
            self.factors = factored(self.lcp.matrix, free)
        return self.factors.solve(right[free], transposed)

    @cached_property
    def turned(self) -> Prepared:
        """A'."""
        matrix = self.lcp.matrix
        if matrix.symmetric:
            return matrix
        return Prepared.unchecked(csr_array(matrix.A.T), False)

    def directional(self, *changes: Any) -> LCPTangent:
        if not self.weak and not self.singular:
            return self.forward(*changes)
        side, fixed = self.whole, self.strict != 0
        r, moved = self.direction(side, *changes)
        lower = np.where(fixed | (side < 0), moved, -np.inf)
        upper = np.where(fixed | (side > 0), moved, np.inf)
        lcp = lcp_data(self.lcp.matrix, r, lower, upper)
        found = solve_by_method(*lcp, Limits(eps_rel=ACCURACY))
        if found.status is not Status.SOLVED:
            raise ValueError(
                "the solution has no derivative along this direction: the LCP of the "
                f"critical cone is {found.status.value}"
            )
        dz, dw, _ = found.point
        return LCPTangent(dz, dw, self.weak, self.singular)

    def direction(
        self, side: Any, dA: Any, dq: Any, dlower: Any, dupper: Any
    ) -> tuple[Any, Any]:
        """Return dA z + dq, and how the bounds at these sides move."""
        q, dA = self.lcp.q, change("dA", dA, "A", self.lcp.A)
        r = change("dq", dq, "q", q)
        if dA is not None:
            r = r + dA @ self.z
        dlower = change("dlower", dlower, "q", q)
        return r, np.where(side < 0, dlower, change("dupper", dupper, "q", q))


def factored(matrix: Prepared, free: np.ndarray) -> "LUFactors | KKTFactors":
    """Return the factors of A_FF, without pivoting if it is sparse and definite."""
    if not matrix.is_sparse:
        return LUFactors(matrix.A[np.ix_(free, free)])
    A = submatrix(csc_array(matrix.A), free, free)
    if matrix.symmetric:
        with suppress(ValueError):  # a pivot vanishes: A is indefinite
            found = KKTFactors(A, no_rows(free.size))
            if (found.kkt.plan().pivots > 0.0).all():
                return found
    return LUFactors(A)


class LUFactors:
    """LU factors of K with rows and columns scaled; least squares if it is singular."""

    def __init__(self, K: Any) -> None:
        size = abs(K)
        self.rows, self.columns = scales = [size.sum(axis=k) for k in (1, 0)]
        for scale in scales:
            scale[scale == 0.0] = 1.0
            scale **= -0.5
        K, pivots = self.rows[:, None] * K * self.columns, np.zeros(1)
        if isinstance(K, np.ndarray):
            lu, order, _ = dgetrf(K)
            pivots = np.abs(lu.diagonal())
            self.solve_scaled = lambda v, turned: dgetrs(lu, order, v, turned)[0]
        else:
            K = csc_array(K)
            with suppress(RuntimeError):  # a pivot is exactly 0
                lu = splu(K)
                pivots = np.abs(lu.U.diagonal())
                self.solve_scaled = lambda v, turned: lu.solve(v, "NT"[turned])
        self.K, self.regular = K, bool(pivots.min() > SINGULAR * pivots.max())

    def solve(self, r: np.ndarray, transposed: bool = False) -> np.ndarray:
        K, left, right = self.K, self.rows, self.columns
        if transposed:
            K, left, right = K.T, right, left
        if self.regular:
            w = refined(
                lambda v: self.solve_scaled(v, transposed), K.__matmul__, left * r
            )
        elif isinstance(K, np.ndarray):
            w = np.linalg.lstsq(K, left * r, SINGULAR * r.size)[0]
        else:
            w = lsmr(K, left * r, atol=1e-14, btol=1e-14)[0]
        return right * w
